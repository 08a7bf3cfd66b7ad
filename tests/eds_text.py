"""Short ways to write the text of an EDS for a test."""

from __future__ import annotations

import re

from eurobot_od.od.values import DATA_TYPES

CODES = {each.name: code for code, each in DATA_TYPES.items()}

DEVICE_TYPE = "[1000]\nParameterName=Device type\nDataType=0x0007\nAccessType=ro\nDefaultValue=0\n"
"""The least that an EDS has."""


def variable(section: str, name: str, type_: str, default: str | None = None, more: str = "") -> str:
    """A VAR or a sub-index, mappable; without `default` it has no such line."""
    value = "" if default is None else f"DefaultValue={default}\n"
    head = f"[{section}]\nParameterName={name}\nDataType=0x{CODES[type_]:04X}\nAccessType=rw\nPDOMapping=1\n"
    return f"{head}{value}{more}\n"


def record(index: int, name: str, *members: tuple[int, str, str | None]) -> str:
    """A record of sub-indices with their types and defaults."""
    subs = (variable(f"{index:04X}sub{sub:X}", f"Entry {sub}", type_, default) for sub, type_, default in members)
    return f"[{index:04X}]\nParameterName={name}\nObjectType=9\nSubNumber={len(members)}\n{''.join(subs)}"


def pdo(
    index: int,
    *entries: str,
    cob_id: str | None = None,
    name: str = "PDO parameter",
    settings: dict[int, str] | None = None,
) -> str:
    """A PDO's two records: its COB-ID, further communication parameters by sub-index, and what it maps."""
    said = [(sub, "UNSIGNED16", text) for sub, text in (settings or {}).items()]
    mapped = [(sub, "UNSIGNED32", entry) for sub, entry in enumerate(entries, 1)]
    communication = record(index, name, (0, "UNSIGNED8", "6"), (1, "UNSIGNED32", cob_id), *said)
    return communication + record(index + 0x200, "mapping", (0, "UNSIGNED8", str(len(entries))), *mapped)


def with_entry(text: str, section: str, key: str, value: str | None) -> str:
    """Return a text with another value of `key` in `[section]`; None removes its line."""
    line = "" if value is None else f"{key}={value}\n"
    changed, count = re.subn(rf"(\[{section}\]\n(?:[^\[\n].*\n)*?){key}=.*\n", rf"\g<1>{line}", text)
    assert count == 1, (section, key)
    return changed
