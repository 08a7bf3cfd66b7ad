"""Writes a DCF: the text of an EDS with a device's values and its commissioning put in (CiA 306-1, 4.6 and 5).

Rule of this file: text in, text out; every line that is not about a value stays as it is. Reading is canopen's job,
through `dictionary`, but for one question that canopen does not ask: whether the file is all there.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from eurobot_od.errors import UnknownName
from eurobot_od.od.values import Address, Value

COMMISSIONING = "DeviceComissioning"
"""The section of node-ID and bit rate, in the spelling of the standard."""

LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
"""The sections that list the objects of the file."""

COB_ID_DIGITS = 8
"""Hexadecimal digits of a value whose default is `$NODEID+...`: COB-IDs are UNSIGNED32."""

HEADER = re.compile(r"\s*\[(?P<name>[^]]*)\]")
OBJECT = re.compile(r"(?P<index>[0-9a-f]{4})(sub(?P<sub>[0-9a-f]{1,2}))?", re.IGNORECASE)


class Section(NamedTuple):
    """`[name]` and the lines below it up to the next section; the lines above the first section have the name ``."""

    name: str
    lines: list[str]

    def get(self, key: str) -> str | None:
        """Return the value of a key, None if it is not there."""
        return next((value for name, value in map(_entry, self.lines) if name == key.lower()), None)

    def set(self, key: str, value: object) -> None:
        """Give a key its value: in its line if it has one, else in a new line behind the last entry."""
        line = f"{key}={value}"
        places = [place for place, each in enumerate(self.lines) if _entry(each)[0] == key.lower()]
        if places:
            self.lines[places[0]] = line
        else:
            self.lines.insert(self._end(), line)

    def _end(self) -> int:
        return max((place + 1 for place, line in enumerate(self.lines) if line.strip()), default=0)


def with_values(
    eds_text: str,
    values: Mapping[Address, Value],
    node_id: int,
    node_name: str,
    baudrate_kbit: int,
) -> str:
    """Return the DCF of a device: its EDS (or DCF), the ParameterValue of each address in `values`, and who it is.

    Numbers are written in the form of the object's DefaultValue, bytes in hexadecimal digits; None changes nothing.
    The commissioning stands last, so that a file that was cut off has none. Lines end in LF.
    Raises UnknownName for an address that the EDS does not describe.
    """
    sections = [each for each in _sections(eds_text) if each.name.lower() != COMMISSIONING.lower()]
    objects = {address: each for each in sections if (address := _address(each)) is not None}
    for address, value in values.items():
        if value is not None:
            _set_value(objects, address, value)
    _set_file_name(sections)
    return _text([*sections, _commissioning(node_id, node_name, baudrate_kbit)])


def missing(text: str) -> list[str]:
    """Return the sections that an EDS or DCF announces and does not have: listed objects and counted sub-indices."""
    sections = {each.name.lower(): each for each in _sections(text)}
    members = Counter(name.partition("sub")[0] for name in sections if "sub" in name)
    wanted = [name for each in LISTS for name in _listed(sections.get(each.lower()), each)]
    return [
        *(name for name in wanted if name.lower() not in sections),
        *(f"{name}sub" for name in wanted if members[name.lower()] < _announced(sections.get(name.lower()))),
    ]


def _listed(objects: Section | None, name: str) -> Iterator[str]:
    """Give the names of the sections that a list of objects announces; the list itself where it is not there."""
    if objects is None:
        yield name
        return
    for key, value in map(_entry, objects.lines):
        if key.isdecimal():
            yield value.lower().removeprefix("0x").zfill(4).upper()


def _announced(section: Section | None) -> int:
    """Return how many members an object has by its own account, 0 if that is no number."""
    try:
        return int(section.get("SubNumber") or "0", 0) if section else 0
    except ValueError:
        return 0


def _sections(text: str) -> list[Section]:
    sections = [Section("", [])]
    for line in text.replace("\r\n", "\n").removesuffix("\n").split("\n"):
        if "[" in line and (header := HEADER.match(line)):
            sections.append(Section(header["name"], []))
        else:
            sections[-1].lines.append(line)
    return sections


def _text(sections: Iterable[Section]) -> str:
    """Write the sections, an empty line behind each."""
    return "\n".join(line for each in sections for line in _lines(each))


def _lines(section: Section) -> Iterator[str]:
    if section.name:
        yield f"[{section.name}]"
    yield from section.lines
    if section.lines and section.lines[-1].strip():
        yield ""


def _entry(line: str) -> tuple[str, str]:
    """Split `key=value ; comment` into the lower-case key and the value; a line that is no entry has no key."""
    key, equals, rest = line.partition("=")
    if not equals or key.lstrip().startswith(";"):
        return "", ""
    return key.strip().lower(), rest.partition(" ;")[0].strip()


def _address(section: Section) -> Address | None:
    """Return the address of the object that a section describes, None if it describes none or one with members."""
    match = OBJECT.fullmatch(section.name)
    if match is None or section.get("SubNumber"):
        return None
    return int(match["index"], 16), int(match["sub"] or "0", 16)


def _set_value(objects: Mapping[Address, Section], address: Address, value: Value) -> None:
    if address not in objects:
        raise UnknownName("object", f"0x{address[0]:04X}:{address[1]}")
    section = objects[address]
    section.set("ParameterValue", _written(value, section.get("DefaultValue") or ""))


def _written(value: Value, like: str) -> str:
    if isinstance(value, bytes):
        return value.hex().upper()
    if isinstance(value, int):
        return _number(value, like.lower())
    return str(value)


def _number(value: int, like: str) -> str:
    if value < 0 or not like.startswith(("0x", "$nodeid")):
        return str(int(value))
    width = len(like) - 2 if like.startswith("0x") else COB_ID_DIGITS
    return f"0x{value:0{width}X}"


def _set_file_name(sections: Iterable[Section]) -> None:
    """Name the DCF and, as LastEDS, the EDS it was made from."""
    for info in sections:
        if info.name.lower() == "fileinfo" and not info.get("LastEDS"):
            eds = info.get("FileName") or ""
            info.set("LastEDS", eds)
            info.set("FileName", f"{eds.rpartition('.')[0]}.dcf")


def _commissioning(node_id: int, node_name: str, baudrate_kbit: int) -> Section:
    entries = {
        "NodeID": node_id,
        "NodeName": node_name,
        "Baudrate": baudrate_kbit,
        "NetNumber": 0,
        "NetworkName": "",
        "CANopenManager": 0,
        "LSS_SerialNumber": "",
    }
    return Section(COMMISSIONING, [f"{key}={value}" for key, value in entries.items()])
