"""Downloads a program into a node (CiA 302-3): check, stop, clear, write, verify, start, check that it runs.

Rule of this file: nothing is written until everything that can be known by reading is right. A step that fails ends the
download, and its error says in which state the node was left, and how to go on.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import IntEnum
from typing import NamedTuple
from zlib import crc32

from eurobot_od.client.description import read_identity
from eurobot_od.client.master import Procedure, RemoteNode
from eurobot_od.errors import BusError, EurobotError, NoAnswer, NodeRefused, ProgramError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import FLASH_STATUS, PROGRAM_CONTROL, PROGRAM_DATA, PROGRAM_IDENTIFICATION
from eurobot_od.od.values import Address, label
from eurobot_od.sdo.wire import LARGEST, AbortCode
from eurobot_od.support.progress import Progress, unwatched
from eurobot_od.support.texts import amount

NAMES = {
    PROGRAM_DATA: "Program data",
    PROGRAM_CONTROL: "Program control",
    PROGRAM_IDENTIFICATION: "Program software identification",
    FLASH_STATUS: "Flash status identification",
}


class ProgramControl(IntEnum):
    """Commands and states of program control."""

    STOP = 0
    START = 1
    RESET = 2
    CLEAR = 3


IN_PROGRESS = 0x01
"""Busy bit of the flash status; the seven bits above it are the error of the last operation."""

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
"""Timeout for erasing or writing flash memory, or for a restart, in s."""

POLL = 0.1
"""Interval between two reads of the flash status, in s."""

ABSENT = (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX)


class DownloadProcedure(NamedTuple):
    """Differences of a maker's program download from CiA 302-3.

    `unlock` are writes before everything else, in their order. The program goes in parts of at most `part` bytes (0: in
    one transfer); after each of them the object `ready_at` has to become `ready`. `crc` is what 0x1F56 says of it.
    `objection` says why a file is no program for the device, by its header; empty if it may be one.
    """

    unlock: Sequence[tuple[Address, bytes]] = ()
    part: int = 0
    ready_at: Address | None = None
    ready: int = 0
    crc: Callable[[bytes], int] | None = None
    objection: Callable[[bytes], str] = lambda _: ""

    def parts(self, content: bytes) -> list[bytes]:
        """Return a program split into the parts that are sent."""
        size = self.part or len(content) or 1
        return [content[start : start + size] for start in range(0, len(content), size)]


STANDARD = DownloadProcedure()


class Loaded(NamedTuple):
    """Result of a download: its `size` in bytes, and the kind of CRC that verified it (empty without one)."""

    size: int
    crc: str

    @property
    def text(self) -> str:
        """Result as text."""
        verified = f"verified by {self.crc}" if self.crc else "not verified by a CRC"
        return f"{amount(self.size, 'byte')} written, {verified}, started"


@Procedure
async def load(
    node: RemoteNode,
    content: bytes,
    program: int = 1,
    check_crc: bool = True,
    progress: Progress = unwatched,
    dictionary: Dictionary | None = None,
    procedure: DownloadProcedure = STANDARD,
) -> Loaded:
    """Download a program and start it.

    `program` is the sub-index, 1 to 254; `dictionary` describes what the node should be, and `procedure`
    is its maker's. Raises ProgramError or BusError, with the state in which the node was left.
    """
    memory = ProgramMemory(node, program)
    start = f"`write {node.node_id} 0x{PROGRAM_CONTROL:X}:{program} {ProgramControl.START:d}` starts it"
    # Each phase names the state it leaves: between CLEAR and the end of the download, only the loader answers.
    with _left(node, "its program is as it was"):
        state = await memory.look(content, dictionary)
    with _left(node, f"its program may be stopped; {start} again"):
        for address, data in procedure.unlock:
            await node.download.steps(address, data, "unlock")
        if state != ProgramControl.STOP:  # a node in its loader may refuse the stop
            with suppress(NoAnswer):  # a node that enters its loader need not confirm
                await memory.control(ProgramControl.STOP)
        await memory.wait()
    may_be_there = f"its program is stopped and may be cleared: download it again, or, if it is still there, {start}"
    with _left(node, may_be_there):
        await memory.control(ProgramControl.CLEAR, FLASH_WAIT)
        await memory.wait(NO_ERROR, NO_PROGRAM)
    with _left(node, "it is stopped without a whole program: download it again"):
        for part in procedure.parts(content):
            await node.download.steps((PROGRAM_DATA, program), part, NAMES[PROGRAM_DATA], FLASH_WAIT, progress)
            await memory.ready(procedure)
        await memory.wait(NO_ERROR)
    with _left(node, f"the program is written and not started: download it again, or {start} as it is"):
        crc = await memory.identify(content, procedure) if check_crc else ""
    with _left(node, f"the program is written and does not run; {start}, or download it again"):
        with suppress(NoAnswer):  # a node that leaves its loader need not confirm
            await memory.control(ProgramControl.START)
        await memory.wait(NO_ERROR)
        # the object is optional
        if await memory.read_if_there(PROGRAM_CONTROL) == ProgramControl.STOP:
            raise ProgramError(f"{memory.where(PROGRAM_CONTROL)} says: stopped")
    return Loaded(len(content), crc)


class ProgramMemory:
    """Program control objects of one program of a node; every method raises RemoteError and BusError."""

    def __init__(self, node: RemoteNode, program: int) -> None:
        self._node, self._program = node, program

    async def look(self, content: bytes, dictionary: Dictionary | None) -> int:
        """Return the state of program control, after checks; raises ProgramError if a download is impossible."""
        if len(content) > LARGEST:
            raise ProgramError(f"the file has {len(content)} bytes; a program has at most {LARGEST}")
        if dictionary is not None:
            await self._check_file(dictionary)
        for index in (PROGRAM_DATA, PROGRAM_CONTROL):
            await self._check_number(index)
        try:
            return await self.read(PROGRAM_CONTROL)
        except NodeRefused as error:
            if error.code == AbortCode.WRITE_ONLY:  # a program that answers is running
                return ProgramControl.START
            raise

    async def _check_number(self, index: int) -> None:
        """Check that the node has the program, if it reports a number of programs; raises ProgramError."""
        try:
            number = int.from_bytes(await self._node.upload.steps((index, 0), NAMES[index]), "little")
        except NodeRefused as error:
            if error.code == AbortCode.NO_OBJECT:
                raise
        else:
            if number < self._program:
                has = f"0x{index:04X} {NAMES[index]} has {amount(number, 'program')}"
                raise ProgramError(f"{has}: there is no program {self._program}")

    async def _check_file(self, dictionary: Dictionary) -> None:
        """Check that the file describes the node and has the program; raises ProgramError."""
        other = Identity.of(dictionary).difference(await read_identity.steps(self._node))
        if other is not None:
            raise ProgramError(f"{dictionary.file} is for another device: node {self._node.node_id} has {other}")
        for index in (PROGRAM_DATA, PROGRAM_CONTROL):
            variable = dictionary.variable((index, self._program))
            if variable is None or not variable.writable:
                raise ProgramError(f"{dictionary.file} has no {self.where(index)} that can be written")

    async def read(self, index: int) -> int:
        """Return the number in an object."""
        return int.from_bytes(await self._node.upload.steps((index, self._program), NAMES[index]), "little")

    async def control(self, command: ProgramControl, wait: float | None = None) -> None:
        """Send a program control command."""
        what = f"{NAMES[PROGRAM_CONTROL]} ({command.name})"
        await self._node.download.steps((PROGRAM_CONTROL, self._program), bytes([command]), what, wait)

    async def wait(self, *allowed: int) -> None:
        """Wait until the flash memory is not busy; its error must be one of `allowed`, if given."""
        clock = self._node.master.clock
        end = clock() + FLASH_WAIT
        while (status := await self._status()) & IN_PROGRESS:
            if clock() >= end:
                raise NoAnswer("start of an operation", f"end of it in {self.where(FLASH_STATUS)}", 1, FLASH_WAIT)
            await self._node.master.pump.steps(POLL)
        # Bit 0 is "in progress", bits 1 to 7 are the error, the upper half is the maker's (CiA 302-3, 0x1F57).
        error = status >> 1 & 0x7F
        if allowed and error not in allowed:
            words = FLASH_ERRORS.get(error, f"error {error}")
            maker = f" (the manufacturer's 0x{status >> 16:04X})" if status >> 16 else ""
            raise ProgramError(f"{self.where(FLASH_STATUS)} says: {words}{maker}")

    async def ready(self, procedure: DownloadProcedure) -> None:
        """Wait until the node accepts the next part, as its maker defines it; raises NoAnswer."""
        if procedure.ready_at is None:
            return
        clock = self._node.master.clock
        end = clock() + FLASH_WAIT
        while int.from_bytes(await self._node.upload.steps(procedure.ready_at), "little") != procedure.ready:
            if clock() >= end:
                where = f"{label(procedure.ready_at)} = {procedure.ready}"
                raise NoAnswer("a part of the program", where, 1, FLASH_WAIT)
            await self._node.master.pump.steps(POLL)

    async def identify(self, content: bytes, procedure: DownloadProcedure = STANDARD) -> str:
        """Return the kind of CRC by which the node identifies the program, empty without one; raises ProgramError."""
        found = await self.read_if_there(PROGRAM_IDENTIFICATION)
        known = {
            "CRC-32": crc32(content),
            "CRC-16 (start value 0)": crc_hqx(content, 0),
            "CRC-16 (start value 0xFFFF)": crc_hqx(content, 0xFFFF),
        }
        if procedure.crc is not None:
            known = {"the maker's CRC": procedure.crc(content)}
        if found is None or found in known.values():
            return next((name for name, crc in known.items() if crc == found), "")
        # CiA 302-3 leaves to the maker how 0x1F56 identifies a program; these three CRCs are in use.
        no_crc = ", ".join(f"{name} 0x{crc:X}" for name, crc in known.items())
        where = self.where(PROGRAM_IDENTIFICATION)
        raise ProgramError(f"{where} is 0x{found:X}, which is not a CRC of the file ({no_crc})")

    async def _status(self) -> int:
        """Return the flash status: busy for a silent node, idle for one without the object."""
        try:
            return await self.read_if_there(FLASH_STATUS) or 0
        except NoAnswer:
            # A small controller cannot answer while it erases its flash memory.
            return IN_PROGRESS

    async def read_if_there(self, index: int) -> int | None:
        """Return the number in an optional object, None without the object."""
        try:
            return await self.read(index)
        except NodeRefused as error:
            if error.code in ABSENT:
                return None
            raise

    def where(self, index: int) -> str:
        """Return the label of an object."""
        return label((index, self._program), NAMES[index])


@contextmanager
def _left(node: RemoteNode, state: str) -> Iterator[None]:
    """Add the state in which the node was left to an error."""
    try:
        yield
    except (EurobotError, KeyboardInterrupt) as error:
        kind: type[EurobotError] = BusError if isinstance(error, BusError) else ProgramError
        raise kind(f"{str(error) or 'interrupted'}; node {node.node_id}: {state}") from error
