"""Steps as plain data: a function for each kind, and how a step writes numbers, objects and abort codes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.od.objects import RAW_VALUE, address_of, data_type
from eurobot_od.od.units import scale_of
from eurobot_od.od.values import RESTRICTED, Address, label
from eurobot_od.sdo.wire import AbortCode

Data: TypeAlias = "Mapping[str, Any]"
"""A step, a part of one, or a whole suite: what stands in the YAML."""

Steps: TypeAlias = "Iterable[Data]"

LONGEST_NAME = 60
"""Characters of a ParameterName that a step's name has."""

BOOT_TIME = "10 s"
"""How long a device may take from a reset to its boot-up, and to its first SDO answer; the standard names no time."""

ANSWER_TIME = "3 s"
"""How long an answer, a change of state or an EMCY may take: no clause names a time. What takes over 1 s is shown."""

FOLLOWED = "100 ms"
"""After this time an NMT command has been followed; no clause names a time."""

PRECISION = "20 ms"
"""By how much the median of frames may be off their time, none of which is left out.

The standard names no precision: how late one of them came is shown.
"""

BUSY = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE)
"""Aborts by which a device says that it will not take a value now (CiA 301, Table 22: 0x0800002x)."""

NO_BLOCKS = (AbortCode.UNKNOWN_COMMAND, AbortCode.UNSUPPORTED_ACCESS)
"""Aborts of a server that has no block transfer."""

OUTSIDE = (AbortCode.VALUE, AbortCode.TOO_LOW, AbortCode.TOO_HIGH)
"""Aborts of a device that looks at an object's limits first, whatever else is wrong with a value."""

RESTRICTED_ONES = tuple(each.high for each in RESTRICTED if each.high)
"""An identifier of each range that nothing but its own service may have (CiA 301, 7.3.5)."""


def hexadecimal(number: int, digits: int = 4) -> str:
    """Write a number that is not signed."""
    return f"0x{number:0{digits}X}"


def title(variable: ODVariable) -> str:
    """Write address and ParameterName as a step's name has them: on one line, and not too long."""
    name = "".join(each if each.isprintable() else "?" for each in variable.name)
    return label(address_of(variable), name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}...")


# Kinds of steps


def skip(name: str, reason: str) -> Data:
    """Skip what a file does not have."""
    return {"name": name, "skip": reason}


def group(name: str, *steps: Data) -> Data:
    """Return steps that belong together."""
    return {"name": name, "steps": list(steps)}


def read(name: str, address: Address, **more: object) -> Data:
    """Read an object."""
    return {"name": name, "sdo": {"read": label(address), **more}}


def write(name: str, address: Address, **more: object) -> Data:
    """Write an object."""
    return {"name": name, "sdo": {"write": label(address), **more}}


def raw(variable: ODVariable, value: int) -> int | str:
    """Return how a step writes a raw value of an object, which others take for a physical one."""
    return value if scale_of(variable).is_raw else f"{RAW_VALUE}{value}"


def codes(*aborts: AbortCode) -> list[str]:
    """Write abort codes."""
    return [hexadecimal(each, 8) for each in aborts]


def save(variable: ODVariable, kept: str = "present") -> Data:
    """Keep an object's present value; one that has none now cannot be looked at.

    Of an integer it is the number, of anything else the bytes, every one of which has to come back.
    """
    as_bytes = {} if data_type(variable).is_integer else {"data": "any"}
    none_now = codes(AbortCode.NO_DATA)
    return read("its present value", address_of(variable), **as_bytes, save=kept, optional=none_now)


def keeping(name: str, variable: ODVariable, *steps: Data) -> Data:
    """Do some steps with an object, and give it back the value that it had."""
    return group(name, save(variable), *steps, put_back(variable))


def asking(number: str, data: Data) -> Data:
    """Have a step ask a test of CiA's tool, by its number; one with an empty number asks none."""
    return {**data, "ctt": number}


def undoing(*steps: Data) -> Steps:
    """Have steps of a group done whatever becomes of the others: they undo what was changed."""
    return ({**each, "undo": "yes"} for each in steps)


def put_back(variable: ODVariable, kept: str = "present") -> Data:
    """Give an object the value kept, unless it has it."""
    return {"name": "put back", "sdo": {"restore": label(address_of(variable)), "saved": kept}, "undo": "yes"}


def rewritten(name: str, variable: ODVariable, kept: str = "present", bits: int = 0, **more: object) -> Data:
    """Write the value kept, of a whole number with some more bits set."""
    key = "value" if data_type(variable).is_integer else "data"
    written = f"{{{kept}|{hexadecimal(bits, 8)}}}" if bits else f"{{{kept}}}"
    return write(name, address_of(variable), **{key: written}, **more)


def booted(name: str = "boot-up") -> Data:
    """Wait for the boot-up, which ends a reset."""
    return {"name": name, "boot-up": "awaited", "within": BOOT_TIME}


def unchanged(variable: ODVariable, name: str = "nothing has changed", kept: str = "present", **more: object) -> Data:
    """See that an object has the value kept."""
    key = "expect" if data_type(variable).is_integer else "data"
    return read(name, address_of(variable), **{key: f"{{{kept}}}"}, **more)


def nmt(command: str) -> Data:
    """Send an NMT command."""
    return {"name": f"NMT {command}", "nmt": command}


def commanded(command: str) -> Steps:
    """Send an NMT command, and let the device follow it."""
    return nmt(command), wait(FOLLOWED)


def heartbeat(state: str) -> Data:
    """Wait for a heartbeat."""
    return {"name": f"heartbeat says {state}", "heartbeat": state, "within": ANSWER_TIME}


def wait(time: str) -> Data:
    """Let time pass, and look at nothing that came meanwhile."""
    return {"name": f"wait {time}", "wait": time}


def expect(name: str, pattern: object, within: str = ANSWER_TIME) -> Data:
    """Wait for a frame; `within` is a time that a clause names."""
    return {"name": name, "expect": pattern, "within": within}


def never(name: str, pattern: object, span: str) -> Data:
    """See that a frame does not come."""
    return {"name": name, "never": pattern, "for": span}


def every(message: Data, milliseconds: int, count: int) -> Data:
    """See that a frame comes again and again at its time."""
    time = f"{milliseconds} ms"
    period = {"message": message, "every": time, "tolerance": PRECISION, "count": count, "worst": time}
    return {"name": f"{count} times every {milliseconds} ms", "period": period}


def sent(name: str, cob_id: int, data: bytes = b"") -> Data:
    """Send a frame as it is."""
    return {"name": name, "send": {"raw": f"{cob_id:03X}#{data.hex().upper()}"}}


def remote(cob_id: int, length: int = 1) -> Data:
    """Send a remote frame, with the length of what it asks for in bytes."""
    return {"name": f"remote frame 0x{cob_id:03X}", "send": {"raw": f"{cob_id:03X}#R{length}"}}


def emcy(name: str, code: int) -> Data:
    """Wait for an EMCY."""
    return {"name": name, "emcy": hexadecimal(code), "within": ANSWER_TIME}
