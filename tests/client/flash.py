"""A device with a loader: program control objects of CiA 302-3 on a small EDS, and what can go wrong with them."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

from eurobot_od.device.objects import Objects
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import Abort, Reason

NODE_ID = 9
NAMES = {0x1F50: "Program data", 0x1F51: "Program control", 0x1F56: "Program identification", 0x1F57: "Flash status"}
TYPES = {0x1F50: 0x0F, 0x1F51: 0x05, 0x1F56: 0x07, 0x1F57: 0x07}
ACCESS = {0x1F50: "rw", 0x1F51: "rw", 0x1F56: "ro", 0x1F57: "ro"}

LISTS = "[MandatoryObjects]\nSupportedObjects=0\n[OptionalObjects]\nSupportedObjects=4\n"

IDENTITY = b"""\
[1018]
ParameterName=Identity object
ObjectType=9
SubNumber=2
[1018sub0]
ParameterName=Highest sub-index
DataType=0x0005
AccessType=const
DefaultValue=1
[1018sub1]
ParameterName=Vendor-ID
DataType=0x0007
AccessType=ro
DefaultValue=7
"""


def _array(index: int) -> str:
    return f"""\
[{index:04X}]
ParameterName={NAMES[index]}
ObjectType=8
SubNumber=2
[{index:04X}sub0]
ParameterName=Highest sub-index
DataType=0x0005
AccessType=const
DefaultValue=1
[{index:04X}sub1]
ParameterName=Program 1
DataType=0x{TYPES[index]:04X}
AccessType={ACCESS[index]}
"""


def eds(*without: int) -> str:
    """Return the EDS, without some of its objects."""
    return LISTS + "".join(_array(index) for index in NAMES if index not in without)


STOPPED, STARTED = 0, 1
ERASING = 2.0
"""Time that the flash memory takes to erase or write, in s."""


class Trouble(NamedTuple):
    """What is wrong with a device: how it answers, and from which control command on it is silent."""

    without: tuple[int, ...] = ()
    refuses: int | None = None
    refuses_data: bool = False
    error_after: int | None = None
    """The control command, or the index of the program data, after which the flash status is `error`."""
    error: int = 0
    identification: int | None = None
    silent_after: int | None = None
    busy_for: float = ERASING
    starts: bool = True
    restarts: bool = False
    """Whether it is silent for a while, and does not confirm, when it is stopped or started."""


NO_TROUBLE = Trouble()


class FlashDevice:
    """A station with a loader; `program` is what is in its flash memory, `commands` what control was told."""

    next_wakeup, more = inf, ""

    def __init__(self, trouble: Trouble = NO_TROUBLE) -> None:
        self.trouble, self.program, self.running = trouble, b"old", True
        self.commands: list[int] = []
        self._now = self._busy_until = self._silent_until = 0.0
        self._status = 0
        dictionary = Dictionary.read((eds(*trouble.without) + self.more).encode(), Path("flash.eds"), NODE_ID)
        readers = {0x1F51: self._state, 0x1F56: self._identification, 0x1F57: self._flash}
        writers = {0x1F50: self._write, 0x1F51: self._control}
        self._server = SdoServer(Objects(dictionary, readers, writers))

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        self._now = now
        if frame.cob_id != 0x600 + NODE_ID or now < self._silent_until:
            return []
        answers = self._server.receive(frame.data, now)
        return [] if self._now < self._silent_until else [Frame(0x580 + NODE_ID, each) for each in answers]

    def tick(self, now: float) -> list[Frame]:
        return []

    # Objects

    def _state(self, subindex: int) -> Value:
        if not subindex:
            return 1
        return STARTED if self.running else STOPPED

    def _identification(self, subindex: int) -> Value:
        own = crc32(self.program) if self.trouble.identification is None else self.trouble.identification
        return own if subindex else 1

    def _flash(self, subindex: int) -> Value:
        if not subindex:
            return 1
        return 1 if self._now < self._busy_until else self._status

    def _write(self, _: Address, value: Value) -> None:
        if self.trouble.refuses_data:
            raise Abort(Reason.NOT_STORED)
        assert isinstance(value, bytes)
        self.program = value
        self._at_work(0x1F50)

    def _control(self, _: Address, command: Value) -> None:
        assert isinstance(command, int)
        self.commands.append(command)
        if command == self.trouble.refuses:
            raise Abort(Reason.REFUSED_NOW)
        if command == 3:
            self.program = b""
        self.running = command == 1 and self.trouble.starts
        self._at_work(command)
        if self.trouble.restarts and command in (0, 1):
            self._silent_until = self._now + ERASING
        if command == self.trouble.silent_after:
            self._silent_until = inf

    def _at_work(self, what: int) -> None:
        self._busy_until = self._now + self.trouble.busy_for
        self._status = self.trouble.error << 1 if what == self.trouble.error_after else 2 * (what == 3)


class KeyedFlashDevice(FlashDevice):
    """Takes a program after a key alone, in parts of at most 1 KiB, none of them while it still writes the last one."""

    KEY, MOST, more = 0x80, 1024, IDENTITY.decode()

    def __init__(self) -> None:
        super().__init__()
        self.is_open, self.parts = False, list[int]()

    def _identification(self, subindex: int) -> Value:
        return crc32(self.program) ^ 0xFFFF_FFFF if subindex else 1

    def _control(self, address: Address, command: Value) -> None:
        self.is_open = self.is_open or command == self.KEY
        if not self.is_open:
            raise Abort(Reason.REFUSED_NOW)
        if command != self.KEY:
            super()._control(address, command)

    def _write(self, address: Address, value: Value) -> None:
        assert isinstance(value, bytes)
        if len(value) > self.MOST or self._now < self._busy_until:
            raise Abort(Reason.NOT_STORED)
        before = self.program
        super()._write(address, value)
        self.program = before + value
        self.parts.append(len(value))
