"""Captures of a SocketCAN interface: one that Linux and dumpcap made, and every form and fault that a file may have."""

from __future__ import annotations

import io
import struct
from base64 import b64decode

import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry, Raw

CAPTURED = b64decode(
    "1MOyoQIABAAAAAAAAAAAAAAABADjAAAAWqICa/MZCQAQAAAAEAAAAAAAAAgIAAAA0nQjWSwNlwJaogJrEDcJABAAAAAQAAAAAAAADAAAAAAAAAAA"
    "AAAAAFqiAmvOUwkAEAAAABAAAACY/wABAQAAAKoAAAAAAAAAWqICa25wCQAQAAAAEAAAAEAAAAgAAAAAAAAAAAAAAABaogJrTY0JAEgAAABIAAAA"
    "AAAACAwAAACqu8zd7v8AESIzAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAWqICayitCQAQAAAA"
    "EAAAACAAAIAIAAAAAAAAAAAAAAA="
)
"""What dumpcap captured of can-utils' cansend on a virtual interface, 2026-11, brought to pcap by editcap."""

IN_IT: list[Raw] = [
    Frame(0x008, bytes.fromhex("D27423592C0D9702")),
    Frame(0x00C),
    Frame(EXTENDED | 0x18FF0001, b"\xaa"),
    RemoteFrame(0x008),
    Foreign(Damage.FD, "008#AABBCCDDEEFF001122330000"),
    Foreign(Damage.ERROR_FRAME, "080#0000000000000000"),
]

GOOD, BAD = struct.pack(">LBxxx3s5x", 0x14, 3, b"\1\2\3"), struct.pack(">LBxxx3s5x", 0x900, 3, b"\1\2\3")
FRAME = Frame(0x014, b"\1\2\3")


def read(content: bytes, form: str, largest: int = 1 << 20) -> list[LogEntry]:
    return list(formats.read(io.BytesIO(content), form, largest))


def test_captures_of_linux_and_dumpcap_are_read() -> None:
    found = read(CAPTURED, "pcap")
    assert [raw for *_, raw in found] == IN_IT
    assert round(found[0][1], 6) == 1795334746.596467


def pcap(order: str, magic: int, *packets: bytes, link_type: int = 227) -> bytes:
    """Make a pcap file; the time of each packet is 1.5 s of a file in microseconds."""
    head = struct.pack(f"{order}LHHLLLL", magic, 2, 4, 0, 0, 0x40000, link_type)
    return head + b"".join(struct.pack(f"{order}LLLL", 1, 500_000, len(each), len(each)) + each for each in packets)


@pytest.mark.parametrize(("order", "magic", "time"), [
    ("<", 0xA1B2C3D4, 1.5), (">", 0xA1B2C3D4, 1.5), ("<", 0xA1B23C4D, 1.0005), (">", 0xA1B23C4D, 1.0005),
])  # fmt: skip
def test_pcap_in_both_byte_orders_and_in_micro_and_nanoseconds(order: str, magic: int, time: float) -> None:
    assert read(pcap(order, magic, GOOD), "pcap") == [(1, time, "", FRAME)]


# pcapng


def block(order: str, kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    size = struct.pack(f"{order}L", 12 + len(body))
    return struct.pack(f"{order}L", kind) + size + body + size


def section(order: str) -> bytes:
    return block(order, 0x0A0D0D0A, struct.pack(f"{order}LHHq", 0x1A2B3C4D, 1, 0, -1))


def option(order: str, code: int, value: bytes) -> bytes:
    return struct.pack(f"{order}HH", code, len(value)) + value + bytes(-len(value) % 4)


def interface(order: str, name: str = "can0", tick: bytes = b"\6", link_type: int = 227) -> bytes:
    options = option(order, 2, name.encode()) + option(order, 9, tick) + option(order, 0, b"")
    return block(order, 1, struct.pack(f"{order}HHL", link_type, 0, 0) + options)


def packet(order: str, number: int, ticks: int, data: bytes = GOOD) -> bytes:
    return block(order, 6, struct.pack(f"{order}LLLLL", number, ticks >> 32, ticks & 0xFFFFFFFF, 16, 16) + data)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("tick", "ticks"), [(b"\6", 5_500_000_000), (b"\x09", 5_500_000_000_000), (b"\x81", 11_000)])
def test_pcapng_in_both_byte_orders_and_any_resolution(order: str, tick: bytes, ticks: int) -> None:
    content = section(order) + interface(order, tick=tick) + packet(order, 0, ticks)
    ((number, time, channel, raw),) = read(content, "pcapng")
    assert (number, round(time, 6), channel, raw) == (1, 5500.0, "can0", FRAME)


def test_other_interfaces_and_other_blocks_are_passed_over_and_sections_begin_anew() -> None:
    first = section("<") + interface("<", "eth0", link_type=1) + interface("<", "can1")
    second = section(">") + interface(">", "can2") + block(">", 3, struct.pack(">L", 16) + GOOD)
    content = first + block("<", 5, bytes(12)) + packet("<", 0, 1) + packet("<", 1, 2_000_000) + second
    assert read(content, "pcapng") == [(1, 2.0, "can1", FRAME), (2, 0.0, "can2", FRAME)]


def test_an_interface_that_says_nothing_of_its_times_counts_microseconds() -> None:
    assert read(section("<") + interface("<", tick=b"") + packet("<", 0, 5_500_000), "pcapng")[0][1] == 5.5


@pytest.mark.parametrize("before", [b"", b"x", b"five."])
def test_an_option_of_any_length_hides_none_behind_it(before: bytes) -> None:
    options = option("<", 1, before) + option("<", 2, b"can3") + option("<", 9, b"\3")
    described = block("<", 1, struct.pack("<HHL", 227, 0, 0) + options)
    assert read(section("<") + described + packet("<", 0, 5500), "pcapng") == [(1, 5.5, "can3", FRAME)]


# What is damaged


ONE = section("<") + interface("<")
BLF = b"LOGG" + bytes(100)
BLF_OBJECT = b"LOGG" + struct.pack("<L136x", 144) + b"LOBJ" + struct.pack("<HHLL", 16, 1, 1 << 21, 10)
PCAP = 0xA1B2C3D4


@pytest.mark.parametrize(("content", "form"), [
    (pcap("<", PCAP, GOOD, BAD, GOOD), "pcap"),
    (ONE + packet("<", 0, 1) + packet("<", 0, 1, BAD) + packet("<", 0, 1), "pcapng"),
    (ONE + packet("<", 0, 1) + packet("<", 0, 1, b"no") + packet("<", 0, 1), "pcapng"),
])  # fmt: skip
def test_a_bad_packet_costs_no_other(content: bytes, form: str) -> None:
    first, bad, last = (raw for *_, raw in read(content, form))
    assert (first, last) == (FRAME, FRAME)
    assert isinstance(bad, Foreign)
    assert bad.damage is Damage.UNREADABLE


ENDS = [
    (pcap("<", PCAP, GOOD)[:-3], "pcap", Damage.CUT_OFF, "the file ends in the middle of a packet"),
    (pcap("<", PCAP, GOOD)[:30], "pcap", Damage.CUT_OFF, "the file ends in the middle of a packet"),
    (pcap("<", PCAP, GOOD)[:10], "pcap", Damage.CUT_OFF, "the file ends in the middle of a packet"),
    (pcap("<", PCAP, link_type=1), "pcap", Damage.UNREADABLE, "link type 1; only 227, SocketCAN, is read"),
    (b"no capture at all", "pcap", Damage.UNREADABLE, "not a pcap file"),
    (b"no capture at all", "pcapng", Damage.UNREADABLE, "not a pcapng file"),
    (ONE[:20], "pcapng", Damage.CUT_OFF, "the file ends in the middle of a packet"),
    (ONE + packet("<", 0, 1)[:-5], "pcapng", Damage.CUT_OFF, "the file ends in the middle of a packet"),
    (ONE + b"\6\0\0\0\0\0\0\0", "pcapng", Damage.UNREADABLE, "a packet of -12 bytes; at most 1048576 are read"),
    (ONE + b"\6\0\0\0\0\0\0\x80", "pcapng", Damage.UNREADABLE, "a packet of 2147483636 bytes; at most 1048576"),
    (section("<") + interface("<", link_type=1), "pcapng", Damage.UNREADABLE, "no interface of link type 227"),
    (section("<") + packet("<", 0, 1), "pcapng", Damage.UNREADABLE, "a packet of interface 0, of 0 that are described"),
    (ONE + packet("<", 7, 1), "pcapng", Damage.UNREADABLE, "a packet of interface 7, of 1 that are described"),
    (section("<") + block("<", 3, GOOD), "pcapng", Damage.UNREADABLE, "a packet of interface 0, of 0 that are"),
    (pcap("<", PCAP, b"no"), "pcap", Damage.UNREADABLE, "a packet of 2 bytes; it has at least 8"),
    (BLF_OBJECT, "blf", Damage.UNREADABLE, "an object of 2097152 bytes; at most 1048576 are read"),
    (BLF[:4] + struct.pack("<L", 40) + BLF[8:], "blf", Damage.UNREADABLE, "a file header of 40 bytes; it has at least"),
    (BLF[:4] + b"\xff" * 4 + BLF[8:], "blf", Damage.UNREADABLE, "a file header of 4294967295 bytes; at most 1048576"),
    (BLF[:4] + struct.pack("<L", 200) + BLF[8:100], "blf", Damage.CUT_OFF, "the file ends in the middle of an object"),
]


@pytest.mark.parametrize(("content", "form", "damage", "text"), ENDS)
def test_a_capture_that_does_not_go_on_ends_with_an_entry_that_says_so(
    content: bytes, form: str, damage: Damage, text: str
) -> None:
    *_, (*_, last) = read(content, form)
    assert isinstance(last, Foreign)
    assert (last.damage, last.text[: len(text)]) == (damage, text)
