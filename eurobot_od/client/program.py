"""Downloads a program into a node: stop, clear, write, verify, start, and see that it runs (CiA 302-3).

Rule of this file: a step that fails ends the download, and its error says in which state the node was left.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from enum import IntEnum
from typing import NamedTuple
from zlib import crc32

from eurobot_od.client.master import RemoteNode
from eurobot_od.errors import BusError, EurobotError, NoAnswer, NodeRefused, ProgramError
from eurobot_od.od.values import label
from eurobot_od.sdo.client import Progress, unwatched
from eurobot_od.sdo.wire import AbortCode

DATA, CONTROL, IDENTIFICATION, STATUS = 0x1F50, 0x1F51, 0x1F56, 0x1F57
"""Program data, program control, program software identification, flash status; a program is a sub-index of each."""

NAMES = {
    DATA: "Program data",
    CONTROL: "Program control",
    IDENTIFICATION: "Program software identification",
    STATUS: "Flash status identification",
}


class ProgramControl(IntEnum):
    """What program control is told, and tells."""

    STOP = 0
    START = 1
    RESET = 2
    CLEAR = 3


IN_PROGRESS = 0x01
"""Bit of the flash status: it is at work. The seven bits above it are the error of its last operation."""

NO_ERROR, NO_PROGRAM = 0, 1
FLASH_ERRORS: Mapping[int, str] = {
    NO_PROGRAM: "no valid program",
    2: "data format unknown",
    3: "data format error or wrong CRC",
    4: "flash not cleared before writing",
    5: "flash write error",
    6: "address error",
    7: "flash secured",
    63: "unspecified error",
}

FLASH_WAIT = 30.0
"""Seconds that a node has to erase or write its flash memory, or to restart."""

POLL = 0.1
"""Seconds between two questions for the flash status."""

ABSENT = (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX)


class Loaded(NamedTuple):
    """What was downloaded: `size` in bytes, and by which CRC the node identifies it (`` if it does not)."""

    size: int
    crc: str


def load(
    node: RemoteNode, content: bytes, program: int = 1, check_crc: bool = True, progress: Progress = unwatched
) -> Loaded:
    """Download a program and start it; `program` is the sub-index, 1 to 254.

    Raises ProgramError or BusError, with the state that the node was left in.
    """
    memory = ProgramMemory(node, program)
    with _left(node, "its program is as it was"):
        memory.read(CONTROL)
    with _left(node, "its program may be stopped"):
        with suppress(NoAnswer):  # a node that leaves its program for its loader need not confirm
            memory.control(ProgramControl.STOP)
        memory.wait()
    with _left(node, "its program is stopped and may be cleared"):
        memory.control(ProgramControl.CLEAR, FLASH_WAIT)
        memory.wait(NO_ERROR, NO_PROGRAM)
    with _left(node, "it is stopped without a whole program: download it again"):
        node.download((DATA, program), content, NAMES[DATA], FLASH_WAIT, progress)
        memory.wait(NO_ERROR)
    with _left(node, "the program is written and not started"):
        crc = memory.identify(content) if check_crc else ""
    with _left(node, "the program is written and does not run"):
        with suppress(NoAnswer):  # nor need one that leaves its loader for its program
            memory.control(ProgramControl.START)
        memory.wait(NO_ERROR)
        memory.check_started()
    return Loaded(len(content), crc)


class ProgramMemory:
    """The program control objects of one program of a node; every method raises RemoteError and BusError."""

    def __init__(self, node: RemoteNode, program: int) -> None:
        self._node, self._program = node, program

    def read(self, index: int) -> int:
        """Return the number in an object."""
        return int.from_bytes(self._node.upload((index, self._program), NAMES[index]), "little")

    def control(self, command: ProgramControl, wait: float | None = None) -> None:
        """Tell the node what to do with its program."""
        self._node.download((CONTROL, self._program), bytes([command]), f"{NAMES[CONTROL]} ({command.name})", wait)

    def wait(self, *allowed: int) -> None:
        """Wait until the flash memory is not at work; its error has to be one of the allowed, any if none is named."""
        clock = self._node.master.clock
        end = clock() + FLASH_WAIT
        while (status := self._status()) & IN_PROGRESS:
            if clock() >= end:
                raise NoAnswer("start of an operation", f"end of it in {self._where(STATUS)}", 1, FLASH_WAIT)
            self._node.master.pump(POLL)
        error = status >> 1 & 0x7F
        if allowed and error not in allowed:
            words = FLASH_ERRORS.get(error, f"error {error}")
            maker = f" (the manufacturer's 0x{status >> 16:04X})" if status >> 16 else ""
            raise ProgramError(f"{self._where(STATUS)} says: {words}{maker}")

    def identify(self, content: bytes) -> str:
        """Return by which CRC the node identifies a program, `` if it does not; raises ProgramError for another one."""
        found = self._read_if_there(IDENTIFICATION)
        known = {
            "CRC-32": crc32(content),
            "CRC-16 (start value 0)": crc_hqx(content, 0),
            "CRC-16 (start value 0xFFFF)": crc_hqx(content, 0xFFFF),
        }
        if found is None:
            return ""
        for name, crc in known.items():
            if crc == found:
                return name
        no_crc = ", ".join(f"{name} 0x{crc:X}" for name, crc in known.items())
        raise ProgramError(f"{self._where(IDENTIFICATION)} is 0x{found:X}, which is no CRC of the file ({no_crc})")

    def check_started(self) -> None:
        """Raise ProgramError if the node says that the program is stopped; a program need not have the object."""
        if self._read_if_there(CONTROL) == ProgramControl.STOP:
            raise ProgramError(f"{self._where(CONTROL)} says: stopped")

    def _status(self) -> int:
        """Return the flash status; at work for a node that is silent, at rest for one that has none."""
        try:
            return self._read_if_there(STATUS) or 0
        except NoAnswer:
            return IN_PROGRESS

    def _read_if_there(self, index: int) -> int | None:
        try:
            return self.read(index)
        except NodeRefused as error:
            if error.code in ABSENT:
                return None
            raise

    def _where(self, index: int) -> str:
        return label((index, self._program), NAMES[index])


@contextmanager
def _left(node: RemoteNode, state: str) -> Iterator[None]:
    """Add to an error in which state the node is then."""
    try:
        yield
    except (EurobotError, KeyboardInterrupt) as error:
        kind: type[EurobotError] = BusError if isinstance(error, BusError) else ProgramError
        raise kind(f"{str(error) or 'interrupted'}; node {node.node_id}: {state}") from error
