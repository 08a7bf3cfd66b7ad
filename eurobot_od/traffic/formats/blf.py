"""Vector's BLF format: objects in containers, most of them compressed.

Only frames are looked into; every other object is stepped over by its size. The layouts are those
that python-can reads and writes (after Toby Lorenz' Vector BLF library; Vector publishes none).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from struct import Struct
from struct import error as StructError  # noqa: N812 (a class with a small name)
from typing import BinaryIO, TypeAlias

from eurobot_od.traffic.entries import LARGEST, Damage, Entries, Foreign, Raw, frame, read_each, shortened

FILE_HEADER = Struct("<4sL32xHHHHHHHH")
"""Signature, size of the header, ..., start time: year, month, weekday, day, hour, minute, second, millisecond."""

OBJECT = Struct("<4sHHLL")
"""Signature, size of the whole header, its version, size of the object, type."""

CLOCK = Struct("<L4xQ")
"""After it: 1 if the time counts 10 us, 2 for 1 ns; the time since the start."""

CONTAINER = Struct("<H6xL4x")
"""Compression (0 none, 2 deflate) and size of what it holds."""

CLASSIC = Struct("<BxBBL8s")
"""Channel, flags, length, identifier, data."""

FILE_SIGNATURE, SIGNATURE = b"LOGG", b"LOBJ"
CONTAINER_TYPE = 10
CLASSIC_TYPES = (1, 86)  # CAN_MESSAGE, CAN_MESSAGE2
# CAN_ERROR, CAN_ERROR_EXT, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64
FOREIGN_TYPES = {2: Damage.ERROR_FRAME, 73: Damage.ERROR_FRAME, 100: Damage.FD, 101: Damage.FD}
FRAME_TYPES = {*CLASSIC_TYPES, *FOREIGN_TYPES}
CHANNEL = [str(number - 1) for number in range(256)]
"""Channels as python-can counts them, from 0, by their number in the file."""

NOT_COMPRESSED, DEFLATE = 0, 2
REMOTE_FLAG, EXTENDED_FLAG = 0x80, 1 << 31
TICKS = {1: 1e-5}
NANOSECOND = 1e-9

PIECE = 1 << 17
"""Bytes of a container that are unpacked at once, as many as most containers have."""

BlfObject: TypeAlias = tuple[int, float, bytes]
"""An object: its type, its time in s since the start, and what comes after its header."""


def read_blf(file: BinaryIO, largest: int = LARGEST) -> Entries:
    """Read a BLF file; if it is not one, or is cut off, its last entry says so."""
    number, time = 0, 0.0
    try:
        start = _start(file)
        frames = (each for each in _objects(_containers(file, largest), largest) if each[0] in FRAME_TYPES)
        for number, time, channel, raw in read_each(frames, partial(_entry, start)):
            yield number, time, channel, raw
    except (EOFError, StructError, zlib.error):
        yield number + 1, time, "", Foreign(Damage.CUT_OFF, "the file ends in the middle of an object")
    except ValueError as error:
        yield number + 1, time, "", Foreign(Damage.UNREADABLE, str(error))


def _start(file: BinaryIO) -> float:
    """Read the file header; return the start time in s since 1970, 0 if there is none."""
    head = file.read(FILE_HEADER.size)
    signature, size, year, month, _, day, hour, minute, second, millisecond = FILE_HEADER.unpack(head)
    if signature != FILE_SIGNATURE:
        raise ValueError("not a BLF file")
    file.read(size - FILE_HEADER.size)
    try:
        return datetime(year, month, day, hour, minute, second, millisecond * 1000, UTC).timestamp()
    except ValueError:  # all zero: the times in the file count from nothing in particular
        return 0.0


def _containers(file: BinaryIO, largest: int) -> Iterator[bytes]:
    """Yield what the containers hold, piece by piece.

    Of a container that is cut off the available part is yielded; then EOFError is raised.
    """
    while head := file.read(OBJECT.size):
        signature, _, _, size, kind = OBJECT.unpack(head)
        if signature != SIGNATURE:
            raise ValueError("no object where one should start")
        body = file.read(_sane(size, largest) - OBJECT.size)
        if kind == CONTAINER_TYPE:
            yield from _unpacked(body)
        if len(body) < size - OBJECT.size:
            raise EOFError
        file.read(size % 4)  # the padding is as long as this, and not what would fill up a multiple of 4


def _sane(size: int, largest: int) -> int:
    if not OBJECT.size <= size <= largest:
        raise ValueError(f"an object of {size} bytes; at most {largest} are read")
    return size


def _unpacked(body: bytes) -> Iterator[bytes]:
    """Yield a container's content in pieces: a few bytes may stand for gigabytes."""
    compression, _ = CONTAINER.unpack_from(body)
    content = body[CONTAINER.size :]
    if compression == NOT_COMPRESSED:
        yield content
    elif compression == DEFLATE:
        unpacker = zlib.decompressobj()
        while piece := unpacker.decompress(content, PIECE):
            yield piece
            content = unpacker.unconsumed_tail
    else:
        raise ValueError(f"unknown compression {compression}")


def _objects(contents: Iterator[bytes], largest: int) -> Iterator[BlfObject]:
    """Yield the objects in the contents of containers; an object may start in one container and end in the next."""
    left = b""
    for content in contents:
        data, position = left + content, 0
        # How much padding comes before an object depends on the writer: its signature is looked for.
        while (found := data.find(SIGNATURE, position, position + 8)) >= 0 and found + OBJECT.size <= len(data):
            _, header, _, size, kind = OBJECT.unpack_from(data, found)
            end = found + _sane(size, largest)
            if end > len(data):
                break
            ticks, time = CLOCK.unpack_from(data, found + OBJECT.size)
            # The header is longer in later versions; what is needed of it is the same in all.
            yield kind, time * TICKS.get(ticks, NANOSECOND), data[found + header : end]
            position = end
        left = data[position:]
        if len(left) > 8 and SIGNATURE not in left[:8]:
            raise ValueError("no object where one should start")
    if len(left) >= OBJECT.size:
        raise EOFError


def _entry(start: float, found: BlfObject) -> tuple[float, str, Raw]:
    kind, since, body = found
    time, channel = start + since, CHANNEL[body[0]]
    if kind in FOREIGN_TYPES:
        return time, channel, Foreign(FOREIGN_TYPES[kind], shortened(body[2:].hex().upper()))
    _, flags, length, identifier, data = CLASSIC.unpack_from(body)
    remote = length if flags & REMOTE_FLAG else None
    return time, channel, frame(identifier & ~EXTENDED_FLAG, data[:length], identifier & EXTENDED_FLAG, remote)
