"""Logs of records: Vector's BLF, and pcap and pcapng of a SocketCAN interface.

BLF has objects in containers, most of them compressed. Only frames are looked into; every other object is stepped over
by its size. The layouts are those that python-can reads and writes (after Toby Lorenz' Vector BLF library; Vector
publishes none).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from struct import Struct
from typing import BinaryIO, NamedTuple, TypeAlias

from eurobot_od.traffic import entries
from eurobot_od.traffic.entries import Damage, Entries, Foreign, Raw

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
FOREIGN_TYPES = {2: Damage.ERROR_FRAME, 73: Damage.ERROR_FRAME}  # CAN_ERROR, CAN_ERROR_EXT


class FdLayout(NamedTuple):
    """A CAN FD hardware object: its fields, the places of DLC, identifier, flags and length, and two flags."""

    fields: Struct
    places: tuple[int, int, int, int]
    is_fd: int
    remote: int | None


FD_HARDWARE = {
    100: FdLayout(Struct("<HBBLLBBB5x"), (2, 3, 6, 7), 0x1, None),  # CAN_FD_MESSAGE; remote is a flag of its own field
    101: FdLayout(Struct("<BBBBLLLLLLLHBBL"), (1, 4, 6, 2), 0x1000, 0x10),  # CAN_FD_MESSAGE_64
}
FRAME_TYPES = {*CLASSIC_TYPES, *FOREIGN_TYPES, *FD_HARDWARE}
CHANNEL = [str(number - 1) for number in range(256)]
"""Channels numbered from 0, as in python-can, by their number in the file."""

NOT_COMPRESSED, DEFLATE = 0, 2
REMOTE_FLAG = 0x80
EXTENDED_FLAG = 1 << 31
TICKS = {1: 1e-5}
NANOSECOND = 1e-9

PIECE = 1 << 17
"""Number of bytes unpacked at once, the size of most containers."""

BlfObject: TypeAlias = tuple[int, float, bytes]
"""An object: its type, its time in s, and its body."""


def read_blf(file: BinaryIO, largest: int) -> Entries:
    """Read a BLF file; the last entry reports a file that is cut off or not BLF."""
    frames = (each for each in _objects(file, largest) if each[0] in FRAME_TYPES)
    return entries.read_each(frames, _entry, entries.ends_within("an object", zlib.error))


def _start(file: BinaryIO, largest: int) -> float:
    """Read the file header; return the start time in s since 1970, 0 without one."""
    head = file.read(FILE_HEADER.size)
    signature, size, year, month, _, day, hour, minute, second, millisecond = FILE_HEADER.unpack(head)
    if signature != FILE_SIGNATURE:
        raise ValueError("not a BLF file")
    if size < FILE_HEADER.size:
        raise ValueError(f"a file header of {size} bytes; it has at least {FILE_HEADER.size}")
    if size > largest:
        raise ValueError(f"a file header of {size} bytes; at most {largest} are read")
    if len(file.read(size - FILE_HEADER.size)) < size - FILE_HEADER.size:
        raise EOFError
    try:
        return datetime(year, month, day, hour, minute, second, millisecond * 1000, UTC).timestamp()
    except ValueError:  # all zero, without a start time
        return 0.0


def _containers(file: BinaryIO, largest: int) -> Iterator[bytes]:
    """Yield the contents of the containers, piece by piece.

    Of a container that is cut off the available part is yielded; then EOFError is raised.
    """
    while head := file.read(OBJECT.size):
        signature, _, _, size, kind = OBJECT.unpack(head)
        if signature != SIGNATURE:
            raise ValueError("no object where one should start")
        body = file.read(_sane(size, largest) - OBJECT.size)
        if kind == CONTAINER_TYPE:
            yield from _unpacked(body)
        elif kind in FRAME_TYPES:  # a file need not have containers
            yield head + body
        if len(body) < size - OBJECT.size:
            raise EOFError
        file.read(size % 4)  # the padding has this length, and does not fill up a multiple of 4


def _sane(size: int, largest: int) -> int:
    if not OBJECT.size <= size <= largest:
        raise ValueError(f"an object of {size} bytes; at most {largest} are read")
    return size


def _unpacked(body: bytes) -> Iterator[bytes]:
    """Yield a container's content in pieces, as a few bytes may unpack to gigabytes."""
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


def _objects(file: BinaryIO, largest: int) -> Iterator[BlfObject]:
    """Yield the objects in the containers; an object may start in one container and end in the next."""
    start = _start(file, largest)
    left = b""
    for content in _containers(file, largest):
        data = left + content
        position = 0
        # Searched for, as the padding before an object depends on the writer.
        while (found := data.find(SIGNATURE, position, position + 8)) >= 0 and found + OBJECT.size <= len(data):
            _, header, _, size, kind = OBJECT.unpack_from(data, found)
            end = found + _sane(size, largest)
            if end > len(data):
                break
            ticks, time = CLOCK.unpack_from(data, found + OBJECT.size)
            # Later versions have a longer header with the same beginning.
            yield kind, start + time * TICKS.get(ticks, NANOSECOND), data[found + header : end]
            position = end
        left = data[position:]
        if len(left) > 8 and SIGNATURE not in left[:8]:
            raise ValueError("no object where one should start")
    if len(left) >= OBJECT.size:
        raise EOFError


def _entry(found: BlfObject) -> tuple[float, str, Raw]:
    kind, time, body = found
    channel = CHANNEL[body[0]]
    if kind in FD_HARDWARE:
        return time, channel, _of_fd_hardware(FD_HARDWARE[kind], body)
    if kind in FOREIGN_TYPES:
        return time, channel, Foreign(FOREIGN_TYPES[kind], entries.shortened(body[2:].hex().upper()))
    _, flags, length, identifier, data = CLASSIC.unpack_from(body)
    remote = length if flags & REMOTE_FLAG else None
    return time, channel, entries.frame(identifier & ~EXTENDED_FLAG, data[:length], identifier & EXTENDED_FLAG, remote)


def _of_fd_hardware(layout: FdLayout, body: bytes) -> Raw:
    """Read an object of CAN FD hardware, whose flags tell whether the frame is classic."""
    fields = layout.fields.unpack_from(body)
    dlc, identifier, flags, count = (fields[place] for place in layout.places)
    # Omitted data bytes are 0, as the maker's programs read them.
    data = body[layout.fields.size :][:count].ljust(count, b"\0")
    is_fd = flags & layout.is_fd
    number = identifier & ~EXTENDED_FLAG
    is_remote = (fields[1] & REMOTE_FLAG) if layout.remote is None else flags & layout.remote
    length = dlc if is_remote else len(data)
    return entries.recorded(number, data, length, identifier & EXTENDED_FLAG, is_remote, is_fd=is_fd)


# pcap and pcapng, as Wireshark, tshark and tcpdump write them (the IETF's drafts, and the link type SocketCAN, 227, of
# www.tcpdump.org). Packets of other interfaces are not frames of the bus, and are skipped.


SOCKETCAN = 227
"""Link type whose packets are an identifier with flags, length, FD flags, two bytes, and the data."""

PACKET = Struct(">LBBxx")  # the identifier is big-endian, whatever the byte order of the file
ERROR = 1 << 29
REMOTE = 1 << 30
EXTENDED = 1 << 31
FD = 0x04
IDENTIFIER = (1 << 29) - 1
CLASSIC_PACKET = 16
"""Maximum size of a packet with a classic frame, in bytes; FD frames have 72, and not always their flag."""

ORDERS = {b"\xd4\xc3\xb2\xa1": ("<", 1e-6), b"\xa1\xb2\xc3\xd4": (">", 1e-6),
          b"\x4d\x3c\xb2\xa1": ("<", 1e-9), b"\xa1\xb2\x3c\x4d": (">", 1e-9)}  # fmt: skip
"""Byte order and unit of fractions of a second, by the first bytes of a pcap file."""

SECTION, INTERFACE, SIMPLE, ENHANCED = 0x0A0D0D0A, 1, 3, 6
"""Block types of pcapng; others are skipped."""

BYTE_ORDER_MARK = b"\x4d\x3c\x2b\x1a"
"""The byte order mark of a little-endian section."""

NAME_OPTION, RESOLUTION_OPTION = 2, 9
DEFAULT_RESOLUTION = 6
"""An interface's name, and how its times count: in powers of 10, or of 2 if the highest bit is set."""


Packet: TypeAlias = tuple[float, str, bytes]
"""A captured packet: its time in s, its interface's name, and its bytes."""


def _captured(packet: Packet) -> tuple[float, str, Raw]:
    """Return the frame in a packet, or the reason for none; raises ValueError for an inconsistent one."""
    time, channel, content = packet
    if len(content) < PACKET.size:
        raise ValueError(f"a packet of {len(content)} bytes; it has at least {PACKET.size}")
    identifier, length, fd_flags = PACKET.unpack_from(content)
    data = content[PACKET.size : PACKET.size + length]
    number, extended, remote = identifier & IDENTIFIER, identifier & EXTENDED, identifier & REMOTE
    is_fd = fd_flags & FD or len(content) > CLASSIC_PACKET
    raw = entries.recorded(number, data, length, extended, remote, identifier & ERROR, is_fd)
    return entries.seconds(time), channel, raw


class Interface(NamedTuple):
    """An interface in a pcapng file; the unit of its times is `tick`, in s."""

    link_type: int
    name: str
    tick: float


def read_pcap(file: BinaryIO, largest: int) -> Entries:
    """Read a pcap file; the last entry reports a file that is cut off or not pcap."""
    return entries.read_each(_pcap_packets(file, largest), _captured, entries.ends_within("a packet"))


def read_pcapng(file: BinaryIO, largest: int) -> Entries:
    """Read a pcapng file, as `read_pcap`."""
    return entries.read_each(_pcapng_packets(file, largest), _captured, entries.ends_within("a packet"))


def _taken(file: BinaryIO, size: int, largest: int) -> bytes:
    """Read a part of a file; raises ValueError if it is too large, EOFError if it is missing."""
    if not 0 <= size <= largest:
        raise ValueError(f"a packet of {size} bytes; at most {largest} are read")
    data = file.read(size)
    if len(data) < size:
        raise EOFError
    return data


# pcap


def _pcap_packets(file: BinaryIO, largest: int) -> Iterator[Packet]:
    magic = file.read(4)
    if magic not in ORDERS:
        raise ValueError("not a pcap file")
    order, tick = ORDERS[magic]
    # The lower half only: above it are flags and the length of a frame check sequence.
    link_type = Struct(f"{order}16xL").unpack(file.read(20))[0] & 0xFFFF
    if link_type != SOCKETCAN:
        raise ValueError(f"link type {link_type}; only {SOCKETCAN}, SocketCAN, is read")
    head = Struct(f"{order}LLL4x")
    while data := file.read(head.size):
        whole, fraction, size = head.unpack(data)
        yield whole + fraction * tick, "", _taken(file, size, largest)


# pcapng


def _pcapng_packets(file: BinaryIO, largest: int) -> Iterator[Packet]:
    order = "<"
    interfaces = list[Interface]()
    for kind, section_order, body in _blocks(file, largest):
        if kind == SECTION:  # each section counts its interfaces from 0, in its own byte order
            order = section_order
            interfaces = []
        elif kind == INTERFACE:
            interfaces.append(_interface(order, body))
        elif kind in (SIMPLE, ENHANCED):
            # A simple packet has no time, and belongs to the section's first interface.
            head = Struct(f"{order}LLLL4x" if kind == ENHANCED else "4x")
            number, high, low, size = head.unpack_from(body) or (0, 0, 0, len(body))
            if number >= len(interfaces):
                raise ValueError(f"a packet of interface {number}, of {len(interfaces)} that are described")
            interface = interfaces[number]
            if interface.link_type == SOCKETCAN:
                yield (high << 32 | low) * interface.tick, interface.name, body[head.size : head.size + size]
    if SOCKETCAN not in (each.link_type for each in interfaces):
        raise ValueError(f"no interface of link type {SOCKETCAN}, SocketCAN")


def _blocks(file: BinaryIO, largest: int) -> Iterator[tuple[int, str, bytes]]:
    """Yield the blocks: type, byte order, and body."""
    order = ""
    while head := file.read(8):
        kind = Struct(f"{order or '<'}L").unpack_from(head)[0]
        mark = b""
        if kind == SECTION:  # the mark after its length gives the byte order
            mark = _taken(file, 4, largest)
            order = "<" if mark == BYTE_ORDER_MARK else ">"
            if mark not in (BYTE_ORDER_MARK, BYTE_ORDER_MARK[::-1]):
                raise ValueError("not a pcapng file")
        elif not order:
            raise ValueError("not a pcapng file")
        size = Struct(f"{order}4xL").unpack(head)[0]
        body = _taken(file, size - 12 - len(mark), largest)
        _taken(file, 4, largest)  # the length again, for reading backwards
        yield kind, order, body


def _interface(order: str, body: bytes) -> Interface:
    head = Struct(f"{order}HH")
    options = dict[int, bytes]()
    rest = body[8:]
    while len(rest) >= head.size:
        code, size = head.unpack_from(rest)
        if code == 0:
            break
        options[code] = rest[head.size : head.size + size]
        rest = rest[head.size + size + -size % 4 :]  # values are padded to a multiple of 4
    resolution = (options.get(RESOLUTION_OPTION) or bytes([DEFAULT_RESOLUTION]))[0]
    tick = 2.0 ** -(resolution & 0x7F) if resolution & 0x80 else 10.0**-resolution
    name = options.get(NAME_OPTION, b"").decode("utf-8", "replace")
    return Interface(Struct(f"{order}H").unpack_from(body)[0], name, tick)
