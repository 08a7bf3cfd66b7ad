"""Steps as plain data: a function per kind, how a step writes numbers, objects and abort codes, and steps as YAML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.od.objects import RAW_VALUE, address_of, data_type
from eurobot_od.od.units import scale_of
from eurobot_od.od.values import RESTRICTED, Address, label
from eurobot_od.sdo.wire import AbortCode

Data: TypeAlias = "Mapping[str, Any]"
"""A step, a part of one, or a whole suite, as in the YAML."""

Steps: TypeAlias = "Iterable[Data]"

LONGEST_NAME = 60
"""Maximum length of a ParameterName in a step's name."""

BOOT_TIME = "10 s"
"""Maximum time from a reset to the boot-up, and to the first SDO answer; the standard names none."""

ANSWER_TIME = "3 s"
"""Maximum time for an answer, a change of state or an EMCY; no clause names one. More than 1 s is reported."""

FOLLOWED = "100 ms"
"""Time for a device to follow an NMT command; no clause names one."""

PRECISION = "20 ms"
"""Tolerance of the median period of frames.

The standard names none; the worst single distance is reported.
"""

BUSY = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE)
"""Aborts of a device that does not accept a value now (CiA 301, Table 22: 0x0800002x)."""

NO_BLOCKS = (AbortCode.UNKNOWN_COMMAND, AbortCode.UNSUPPORTED_ACCESS)
"""Aborts of a server without block transfer."""

OUTSIDE = (AbortCode.VALUE, AbortCode.TOO_LOW, AbortCode.TOO_HIGH)
"""Aborts of a device that checks an object's limits before anything else."""

RESTRICTED_ONES = tuple(each.high for each in RESTRICTED if each.high)
"""One COB-ID of each range that is reserved for a service (CiA 301, 7.3.5)."""


def hexadecimal(number: int, digits: int = 4) -> str:
    """Return an unsigned number as text, such as 0x1017."""
    return f"0x{number:0{digits}X}"


def title(variable: ODVariable) -> str:
    """Return address and ParameterName for a step's name: on one line, and not too long."""
    name = "".join(each if each.isprintable() else "?" for each in variable.name)
    return label(address_of(variable), name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}...")


# Kinds of steps


def skip(name: str, reason: str) -> Data:
    """Return a step that is skipped."""
    return {"name": name, "skip": reason}


def group(name: str, *steps: Data) -> Data:
    """Return steps that belong together."""
    return {"name": name, "steps": list(steps)}


def read(name: str, address: Address, **more: object) -> Data:
    """Return a step that reads an object."""
    return {"name": name, "sdo": {"read": label(address), **more}}


def write(name: str, address: Address, **more: object) -> Data:
    """Return a step that writes an object."""
    return {"name": name, "sdo": {"write": label(address), **more}}


def raw(variable: ODVariable, value: int) -> int | str:
    """Return a raw value as a step writes it, where a plain number would be a physical value."""
    return value if scale_of(variable).is_raw else f"{RAW_VALUE}{value}"


def codes(*aborts: AbortCode) -> list[str]:
    """Return abort codes as a step writes them."""
    return [hexadecimal(each, 8) for each in aborts]


def save(variable: ODVariable, kept: str = "present") -> Data:
    """Return a step that keeps an object's present value; an object without a value is skipped.

    An integer is kept as a number, any other type as bytes.
    """
    as_bytes = {} if data_type(variable).is_integer else {"data": "any"}
    none_now = codes(AbortCode.NO_DATA)
    return read("its present value", address_of(variable), **as_bytes, save=kept, optional=none_now)


def keeping(name: str, variable: ODVariable, *steps: Data) -> Data:
    """Return a group that keeps an object's value, does some steps, and restores the value."""
    return group(name, save(variable), *steps, put_back(variable))


def asking(number: str, data: Data) -> Data:
    """Return a step with its number of CiA's tool; empty: none."""
    return {**data, "ctt": number}


def undoing(*steps: Data) -> Steps:
    """Return steps of a group that are always done, as they restore what was changed."""
    return ({**each, "undo": "yes"} for each in steps)


def put_back(variable: ODVariable, kept: str = "present") -> Data:
    """Return a step that restores a kept value."""
    return {"name": "put back", "sdo": {"restore": label(address_of(variable)), "saved": kept}, "undo": "yes"}


def rewritten(name: str, variable: ODVariable, kept: str = "present", bits: int = 0, **more: object) -> Data:
    """Return a step that writes a kept value, for an integer with more `bits` set."""
    key = "value" if data_type(variable).is_integer else "data"
    written = f"{{{kept}|{hexadecimal(bits, 8)}}}" if bits else f"{{{kept}}}"
    return write(name, address_of(variable), **{key: written}, **more)


def booted(name: str = "boot-up") -> Data:
    """Return a step that waits for the boot-up after a reset."""
    return {"name": name, "boot-up": "awaited", "within": BOOT_TIME}


def unchanged(variable: ODVariable, name: str = "nothing has changed", kept: str = "present", **more: object) -> Data:
    """Return a step that expects the kept value."""
    key = "expect" if data_type(variable).is_integer else "data"
    return read(name, address_of(variable), **{key: f"{{{kept}}}"}, **more)


def nmt(command: str) -> Data:
    """Return a step that sends an NMT command."""
    return {"name": f"NMT {command}", "nmt": command}


def commanded(command: str) -> Steps:
    """Return steps that send an NMT command and wait until the device has followed it."""
    return nmt(command), wait(FOLLOWED)


def heartbeat(state: str) -> Data:
    """Return a step that waits for a heartbeat with a state."""
    return {"name": f"heartbeat says {state}", "heartbeat": state, "within": ANSWER_TIME}


def wait(time: str) -> Data:
    """Return a step that waits, and ignores the frames that come meanwhile."""
    return {"name": f"wait {time}", "wait": time}


def expect(name: str, pattern: object, within: str = ANSWER_TIME) -> Data:
    """Return a step that waits for a frame."""
    return {"name": name, "expect": pattern, "within": within}


def never(name: str, pattern: object, span: str) -> Data:
    """Return a step that fails if a frame comes."""
    return {"name": name, "never": pattern, "for": span}


def every(message: Data, milliseconds: int, count: int) -> Data:
    """Return a step that expects a frame periodically."""
    time = f"{milliseconds} ms"
    period = {"message": message, "every": time, "tolerance": PRECISION, "count": count, "worst": time}
    return {"name": f"{count} times every {milliseconds} ms", "period": period}


def sent(name: str, cob_id: int, data: bytes = b"") -> Data:
    """Return a step that sends a raw frame."""
    return {"name": name, "send": {"raw": f"{cob_id:03X}#{data.hex().upper()}"}}


def remote(cob_id: int, length: int = 1) -> Data:
    """Return a step that sends a remote frame, with the length of the data it requests."""
    return {"name": f"remote frame 0x{cob_id:03X}", "send": {"raw": f"{cob_id:03X}#R{length}"}}


def emcy(name: str, code: int) -> Data:
    """Return a step that waits for an EMCY."""
    return {"name": name, "emcy": hexadecimal(code), "within": ANSWER_TIME}


# Steps as text

BARE = re.compile(r"0x[0-9A-F]+|[0-9]+ ?(?:ms|s)|(?!yes|no|on|off|true|false|null)[a-z]+(?:[- ][a-z]+)*")
"""Texts that need no quotes: hexadecimal numbers, durations, the words of the format."""

QUOTED = ("name", "skip", "data")
"""Keys whose values are always texts."""


def documents(suites: Iterable[Data]) -> str:
    """Return suites as the YAML documents of one file."""
    lines: list[str] = []
    for suite in suites:
        lines.append("---")
        for key, value in suite.items():
            if key in ("setup", "steps", "teardown"):
                lines.append(f"{key}:")
                lines += [line for step in value for line in _step_lines(step, "  ")]
            else:
                lines.append(f"{key}: {_inline(value, key)}")
    return "".join(f"{line}\n" for line in lines)


def _step_lines(data: Data, indent: str) -> Iterator[str]:
    """Yield a step on one line, a group with one line per step."""
    if "steps" not in data:
        yield f"{indent}- {_inline(data)}"
        return
    yield f"{indent}- name: {_inline(data['name'], 'name')}"
    yield f"{indent}  steps:"
    for each in data["steps"]:
        yield from _step_lines(each, indent + "    ")


def _inline(value: Any, key: str = "") -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_inline(each, name)}" for name, each in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_inline(each, key) for each in value) + "]"
    text = str(value)
    bare = isinstance(value, int) or (key not in QUOTED and BARE.fullmatch(text))
    return text if bare else json.dumps(text, ensure_ascii=False)
