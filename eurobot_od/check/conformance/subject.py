"""What a conformance suite is about: a device as its file describes it, and how steps name its services."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

from eurobot_od.check.conformance.writing import Data, hexadecimal, object_at, shown
from eurobot_od.check.objects import object_type, services
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import WRITABLE, Address, DataType, Value, label
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

DEVICE_TYPE: Address = (0x1000, 0)
HEARTBEAT_TIME: Address = (0x1017, 0)

BUSY = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE)
"""Aborts by which a device says that it will not take a value now (CiA 301, Table 22: 0x0800002x)."""

BOOT_TIME = "10 s"
"""How long a device may take from a reset to its boot-up, and to its first SDO answer; the standard names no time."""


class Object(NamedTuple):
    """A variable of the file: where it is, what it is called, its type, its access, and whether PDOs may carry it.

    `low` and `high` are the limits that are narrower than those of its type, None without one. `typed` tells whether
    suites can write its values, or only its bytes.
    """

    address: Address
    name: str
    type: DataType
    access: str
    mappable: bool
    default: Value
    low: int | None
    high: int | None
    typed: bool

    @property
    def readable(self) -> bool:
        """Whether an SDO may read it."""
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        """Whether an SDO may write it."""
        return self.access in WRITABLE

    def __str__(self) -> str:
        return label(self.address, shown(self.name))

    @property
    def in_limits(self) -> bool:
        """Whether the default, if it is a number, is one that the limits allow."""
        if not isinstance(self.default, int):
            return True
        low, high = (self.default if limit is None else limit for limit in (self.low, self.high))
        return low <= self.default <= high

    @property
    def default_bytes(self) -> bytes | None:
        """The default as an SDO carries it, None if there is none, or none of its type."""
        if self.default is None:
            return None
        try:
            return self.type.write(self.default)
        except (ValueError, OverflowError):
            return None


@dataclass(frozen=True)
class Subject:
    """The device under test; `destructive` allows to store, and to give objects other values."""

    dictionary: Dictionary
    destructive: bool = False

    @property
    def node_id(self) -> int:
        """The node-ID."""
        return self.dictionary.node_id

    @cached_property
    def objects(self) -> dict[Address, Object]:
        """All variables of the file, by address."""
        return {address: self._object(address) for address in sorted(self.dictionary.addresses())}

    def _object(self, address: Address) -> Object:
        variable, typed = self.dictionary.variable(address), object_type(self.dictionary, address)
        assert variable is not None, "the dictionary has given this address"
        type_ = values.DATA_TYPES.get(variable.data_type or 0, values.DOMAIN)
        default = self.dictionary.default(address)
        low, high = (variable.min, variable.max) if type_.is_integer else (None, None)
        return Object(
            *(address, variable.name, type_, variable.access_type, bool(variable.pdo_mappable), default),
            low if low is not None and low > type_.low else None,
            high if high is not None and high < type_.high else None,
            typed is not None,
        )

    @property
    def probe(self) -> Address:
        """An object to ask for, to see whether the device answers: the device type, else the first that is readable."""
        readable = (each.address for each in self.objects.values() if each.readable)
        return DEVICE_TYPE if DEVICE_TYPE in self.objects else next(readable, DEVICE_TYPE)

    def find(self, address: Address) -> Object | None:
        """Return a variable, None if the file does not have it."""
        return self.objects.get(address)

    def writable(self, address: Address) -> bool:
        """Whether the file has a variable, and lets it be written."""
        found = self.find(address)
        return found is not None and found.writable

    def number(self, address: Address) -> int:
        """Return the number that the file gives a variable, 0 without one."""
        return self.dictionary.number(address) or 0

    # Frames of its SDO server

    def request(self, data: bytes) -> Data:
        """Return the step that sends an SDO request as it is."""
        frame = f"{services(self.dictionary).sdo_request:03X}#{data.hex().upper()}"
        return {"send": {"raw": frame}}

    def answer(self, digits: str) -> Data:
        """Return the pattern of an answer of the SDO server, `?` for any digit."""
        return {"raw": f"{services(self.dictionary).sdo_answer:03X}#{digits}"}


StepsOf: TypeAlias = "Callable[[Subject], Iterable[Data]]"
"""Makes the steps of a clause; their names do not have its number yet."""


class Clause(NamedTuple):
    """A clause of CiA 301, its topic, and what makes its steps from what a file says."""

    number: str
    topic: str
    steps: StepsOf

    def named(self, subject: Subject) -> Iterator[Data]:
        """Give the steps, each with a name that begins with the clause."""
        for step in self.steps(subject):
            yield {**step, "name": f"{self.number} {self.topic}: {step['name']}"}


class Chapter(NamedTuple):
    """A suite: its word, what it is about, and its clauses."""

    word: str
    about: str
    clauses: tuple[Clause, ...]


# Steps


def skip(name: str, reason: str) -> Data:
    """Leave out what a file has not."""
    return {"name": name, "skip": reason}


def group(name: str, *steps: Data) -> Data:
    """Return steps that belong together."""
    return {"name": name, "steps": list(steps)}


def read(name: str, address: Address, **more: object) -> Data:
    """Read an object."""
    return {"name": name, "sdo": {"read": object_at(address), **more}}


def write(name: str, address: Address, **more: object) -> Data:
    """Write an object."""
    return {"name": name, "sdo": {"write": object_at(address), **more}}


def codes(*aborts: AbortCode) -> list[str]:
    """Write abort codes."""
    return [hexadecimal(each, 8) for each in aborts]


def save(variable: Object, name: str = "present") -> Data:
    """Keep an object's present value; one that has none now cannot be looked at."""
    return read("its present value", variable.address, save=name, optional=codes(AbortCode.NO_DATA))


def put_back(variable: Object, name: str = "present", **more: object) -> Data:
    """Give an object the value kept."""
    key = "value" if variable.typed else "data"
    return write("put back", variable.address, **{key: f"{{{name}}}"}, **more)


def unchanged(variable: Object, name: str = "present") -> Data:
    """See that an object has the value kept."""
    key = "expect" if variable.typed else "data"
    return read("nothing has changed", variable.address, **{key: f"{{{name}}}"})


def nmt(command: str) -> Data:
    """Send an NMT command."""
    return {"name": f"NMT {command}", "nmt": command}


def heartbeat(state: str, within: str) -> Data:
    """Wait for a heartbeat, or the boot-up."""
    return {
        "name": "boot-up" if state == "boot-up" else f"heartbeat says {state}",
        "heartbeat": state,
        "within": within,
    }


def wait(time: str) -> Data:
    """Let time pass, and look at nothing that came meanwhile."""
    return {"name": f"wait {time}", "wait": time}


def expect(name: str, pattern: object, within: str) -> Data:
    """Wait for a frame."""
    return {"name": name, "expect": pattern, "within": within}


def never(name: str, pattern: object, span: str) -> Data:
    """See that a frame does not come."""
    return {"name": name, "never": pattern, "for": span}


def awake(subject: Subject) -> Data:
    """Ask for an object until it is answered: the device is up after a reset."""
    return {
        "name": "answers an SDO request",
        "poll": {**subject.request(initiate(ClientCommand.UPLOAD << 5, subject.probe)), "every": "100 ms"},
        "until": subject.answer("?" * 16),
        "within": BOOT_TIME,
    }
