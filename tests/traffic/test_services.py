"""CANopen services: what one frame says, by the dictionaries of the nodes."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder
from tests.eds_text import DEVICE_TYPE, pdo, record, variable
from tests.kit import plant
from tests.rows import rows

SERVICES = [
    # NMT: to all, to a known node, to another one, an unknown command
    (0x000, "01 00", "NMT", "start, all nodes"),
    (0x000, "81 02", "NMT", "reset, lift"),
    (0x000, "80 7F", "NMT", "pre-operational, node 127"),
    (0x000, "07 02", "NMT", "command 7, lift"),
    # boot-up, heartbeat, a state that CiA 301 does not have
    (0x702, "00", "Heartbeat", "lift, boot-up"),
    (0x701, "05", "Heartbeat", "panel, operational"),
    (0x703, "7F", "Heartbeat", "scale, pre-operational"),
    (0x710, "04", "Heartbeat", "node 16, stopped"),
    (0x701, "09", "Heartbeat", "panel, state 9"),
    # EMCY: ours by name, CiA 301's by its class, one that is gone
    (0x082, "10 82 11 08 00 03 00 00", "EMCY", "lift, 0x8210 pdo too short, register 0x11, 08 00 03 00 00"),
    (0x085, "30 81 11 00 00 00 00 00", "EMCY", "node 5, 0x8130 "),
    (0x082, "00 00 00 00 00 00 00 00", "EMCY", "lift, 0x0000 no error, register 0x00"),
    # SDO: expedited write and read with names and values, refused, segments, blocks
    (0x602, "2B 17 10 00 E8 03 00 00", "SDO", "lift, write 0x1017:00 Producer heartbeat time = 1000"),
    (0x582, "60 17 10 00 00 00 00 00", "SDO", "lift, written 0x1017:00 Producer heartbeat time"),
    (0x602, "40 17 10 00 00 00 00 00", "SDO", "lift, read 0x1017:00 Producer heartbeat time"),
    (0x582, "4B 17 10 00 E8 03 00 00", "SDO", "lift, value of 0x1017:00 Producer heartbeat time = 1000"),
    (0x582, "41 08 10 00 14 00 00 00", "SDO", "lift, value of 0x1008:00 Manufacturer device name, 20 bytes"),
    (0x582, "80 99 99 01 00 00 02 06", "SDO", "lift, abort 0x9999:01: 0x06020000 Object does not exist"),
    (0x582, "80 17 10 00 01 00 00 00", "SDO", "0x00000001 unknown code"),
    (0x602, "60 00 00 00 00 00 00 00", "SDO", "lift, next segment"),
    (0x582, "05 45 75 72 6F 62 00 00", "SDO", "lift, segment of 5 bytes, the last"),
    (0x602, "A0 21 10 00 7F 00 00 00", "SDO", "lift, read 0x1021:00"),
    (0x602, "E0 00 00 00 00 00 00 00", "SDO", "lift, command 7"),
    # words for an error code that is the devices' own
    (0x082, "02 FF 81 00 00 00 00 00", "EMCY", "lift, 0xFF02 lift blocked"),
    # LSS: a request and an answer of each form (CiA 305)
    (0x7E5, "04 01 00 00 00 00 00 00", "LSS", "all devices into state configuration"),
    (0x7E5, "11 05 00 00 00 00 00 00", "LSS", "set node-ID 5"),
    (0x7E5, "11 FF 00 00 00 00 00 00", "LSS", "set no node-ID"),
    (0x7E4, "11 01 00 00 00 00 00 00", "LSS", "set node-ID: node-ID out of range"),
    (0x7E4, "11 FF 07 00 00 00 00 00", "LSS", "set node-ID: error 7 of its own"),
    (0x7E5, "13 00 02 00 00 00 00 00", "LSS", "set bit rate: 500 kbit/s"),
    (0x7E5, "13 00 05 00 00 00 00 00", "LSS", "set bit rate: index 5"),  # reserved in the table
    (0x7E5, "13 01 02 00 00 00 00 00", "LSS", "set bit rate: index 2 of table 1"),
    (0x7E4, "13 00 00 00 00 00 00 00", "LSS", "set bit rate: done"),
    (0x7E5, "15 E8 03 00 00 00 00 00", "LSS", "change the bit rate in 1000 ms"),
    (0x7E5, "17 00 00 00 00 00 00 00", "LSS", "store"),
    (0x7E4, "17 02 00 00 00 00 00 00", "LSS", "store: no access to the storage media"),
    (0x7E5, "42 78 56 34 12 00 00 00", "LSS", "select revision number 0x12345678"),
    (0x7E4, "44 00 00 00 00 00 00 00", "LSS", "selected"),
    (0x7E5, "49 78 56 34 12 00 00 00", "LSS", "identify highest revision number 0x12345678"),
    (0x7E5, "4C 00 00 00 00 00 00 00", "LSS", "identify devices without a node-ID"),
    (0x7E4, "4F 00 00 00 00 00 00 00", "LSS", "a device is there"),
    (0x7E4, "50 00 00 00 00 00 00 00", "LSS", "a device without a node-ID is there"),
    (0x7E5, "51 00 00 00 00 80 00 00", "LSS", "fastscan: is a device without a node-ID there?"),
    (0x7E5, "51 78 56 34 12 1F 00 01", "LSS", "vendor-ID 0x12345678 down to bit 31, then product code"),
    (0x7E5, "5D 00 00 00 00 00 00 00", "LSS", "inquire serial number"),
    (0x7E4, "5D 78 56 34 12 00 00 00", "LSS", "serial number 0x12345678"),
    (0x7E5, "5E 00 00 00 00 00 00 00", "LSS", "inquire node-ID"),
    (0x7E4, "5E 05 00 00 00 00 00 00", "LSS", "node-ID 5"),
    (0x7E5, "77 01 00 00 00 00 00 00", "LSS", "request 0x77, 01 00 00 00 00 00 00"),
    # block transfers, by themselves
    (0x602, "C6 50 1F 01 00 10 00 00", "SDO", "lift, write 0x1F50:01 in blocks, 4096 bytes"),
    (0x582, "A2 7F 7F 00 00 00 00 00", "SDO", "lift, block taken up to segment 127"),
    (0x582, "C1 34 12 00 00 00 00 00", "SDO", "lift, end of blocks"),
    # a node without a dictionary, and a value of a length that its type does not have
    (0x610, "2B 17 10 00 E8 03 00 00", "SDO", "node 16, write 0x1017:00 = e8 03"),
    (0x602, "2F 17 10 00 05 00 00 00", "SDO", "lift, write 0x1017:00 Producer heartbeat time = 05"),
]


BROADCAST = [
    # SYNC with and without counter, TIME at both ends of a day, and none
    (0x080, "", "SYNC", ""),
    (0x080, "07", "SYNC", "counter 7"),
    (0x100, "00 00 00 00 00 00", "TIME", "1984-01-01 00:00:00.000"),
    (0x100, "FF 5B 26 F5 C8 3C", "TIME", "2026-08-08 23:59:59.999"),  # the four reserved bits do not count
    (0x100, "FF 5B 26 05 C8 3C 00 00", "TIME", "2026-08-08 23:59:59.999"),  # as real devices fill it up
    (0x100, "00 5C 26 05 01 00", "TIME", "no time: 00 5c 26 05 01 00"),
    # safety, flying masters
    (0x001, "", "GFC", "all devices into their safe state"),
    (0x071, "01 02", "Flying master", "the active master is node 2, priority 1"),
    (0x072, "", "Flying master", "negotiation of a new master"),
    (0x073, "", "Flying master", "who is the active master?"),
    (0x076, "01", "Flying master", "negotiation of a new master is forced, 01"),
]
"""Services that every device may use."""


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return plant.decoder()


@rows("cob_id, data, name, text", SERVICES)
def test_texts_of_services(decoder: Decoder, cob_id: int, data: str, name: str, text: str) -> None:
    meaning = decoder(Frame(cob_id, bytes.fromhex(data)))
    assert (meaning.name, meaning.group, meaning.defects) == (name, "CANopen", ())
    assert text in meaning.text


@pytest.mark.parametrize(("cob_id", "data", "name", "text"), BROADCAST)
def test_texts_of_broadcast_services(cob_id: int, data: str, name: str, text: str) -> None:
    meaning = Decoder(())(Frame(cob_id, bytes.fromhex(data)))
    assert (meaning.name, meaning.group, meaning.text, meaning.defects) == (name, "CANopen", text, ())


@pytest.mark.parametrize(
    ("cob_id", "data"),
    [(0x000, "01"), (0x7E5, "04 01"), (0x701, ""), (0x701, "05 05"), (0x082, "10 82 11"), (0x602, "40 17 10 00")],
)
def test_a_service_of_another_length(decoder: Decoder, cob_id: int, data: str) -> None:
    (defect,) = decoder(Frame(cob_id, bytes.fromhex(data))).defects
    assert defect.damage is Damage.WRONG_LENGTH


def test_a_remote_frame_asks_for_the_frame_of_its_identifier(decoder: Decoder) -> None:
    found = [decoder(RemoteFrame(cob_id)) for cob_id in (0x702, 0x602, 0x202, 0x7FE)]
    assert [(each.name, each.text, bool(each.defects)) for each in found] == [
        ("Node guarding", "lift, remote frame: asks for it", False),
        ("SDO", "lift, remote frame: asks for it", False),
        ("Move To", "remote frame: asks for it", False),
        ("", "7FE#R", True),
    ]


def test_a_remote_frame_is_not_kept_as_the_data_frame_of_its_bytes(decoder: Decoder) -> None:
    """A boot-up is one byte 0, as which a remote frame of length 1 is kept."""
    following = TrackingDecoder(decoder)
    names = [following(0.0, "", each).name for each in (Frame(0x710, b"\0"), RemoteFrame(0x710, b"\0"))]
    assert names == ["Heartbeat", "Node guarding"]


def test_answers_to_a_guarding_master(decoder: Decoder) -> None:
    following = TrackingDecoder(decoder)
    frames = [RemoteFrame(0x702), Frame(0x702, b"\x05"), Frame(0x702, b"\x85"), Frame(0x702, b"\x05")]
    assert [(each.name, each.text) for each in (following(0.0, "", frame) for frame in frames[1:])] == [
        ("Heartbeat", "lift, operational"),  # nobody has asked
        ("Node guarding", "lift, operational, toggle 1"),  # heartbeats have no such bit
        ("Heartbeat", "lift, operational"),
    ]
    asked = [following(0.0, "", frame).text for frame in frames[:2]]
    assert asked == ["lift, remote frame: asks for it", "lift, operational, toggle 0"]


@pytest.mark.parametrize(
    ("cob_id", "data", "expected"), [(0x080, "01 02", "0 or 1"), (0x100, "00", "6 or 8"), (1, "0", "0")]
)
def test_a_broadcast_service_of_another_length(cob_id: int, data: str, expected: str) -> None:
    (defect,) = Decoder(())(Frame(cob_id, bytes.fromhex(data.zfill(2)))).defects
    assert defect.damage is Damage.WRONG_LENGTH
    assert defect.text.endswith(f"expected {expected}")


def test_a_message_goes_before_the_service_of_node_64() -> None:
    text = DEVICE_TYPE + variable("2000", "Speed", "INTEGER16", "0") + pdo(0x1800, "0x20000010", cob_id="0x0C0")
    decoder = Decoder([Dictionary.read(text.encode(), Path("arm.eds"), 5)])
    assert (decoder(Frame(0x0C0, bytes(2))).name, Decoder(())(Frame(0x0C0, bytes(8))).name) == ("arm.TPDO1", "EMCY")


SENDERS = (
    record(0x1280, "SDO client", (1, "UNSIGNED32", "0x640"), (2, "UNSIGNED32", "0x5C0"), (3, "UNSIGNED8", "6"))
    + variable("1005", "COB-ID SYNC", "UNSIGNED32", "0x40000080")
    + variable("1012", "COB-ID TIME", "UNSIGNED32", "0xC0000101")
)


@pytest.mark.parametrize(
    ("frame", "sender"),
    [
        (Frame(0x000, b"\1\0"), "PC"),
        (Frame(0x7E5, bytes(8)), "PC"),
        (Frame(0x7E4, bytes(8)), ""),  # whichever device is selected
        (Frame(0x606, bytes(8)), "PC"),
        (Frame(0x586, bytes(8)), "io"),
        (Frame(0x640, bytes(8)), "plc"),  # a channel of its own to the same server
        (Frame(0x5C0, bytes(8)), "io"),
        (Frame(0x606), "PC"),  # of a wrong length
        (Frame(0x706, b"\5"), "io"),
        (RemoteFrame(0x706), "PC"),  # node guarding
        (Frame(0x709, b"\5"), "node 9"),
        (Frame(0x080), "plc"),  # it says that it produces them
        (Frame(0x101, bytes(6)), "plc"),
        (Frame(0x100, bytes(6)), "PC"),  # where nobody produces it
        (Frame(0x185), "io"),
        (RemoteFrame(0x185), ""),  # whoever wants it
        (Frame(0x205), ""),
        (Frame(0x285), "node 5"),  # guesses
        (Frame(0x305), ""),
    ],
)
def test_senders_of_services(frame: Frame, sender: str) -> None:
    io = DEVICE_TYPE + variable("2000", "Speed", "INTEGER16", "0") + pdo(0x1800, "0x20000010", cob_id="0x185")
    devices = [
        Dictionary.read(text.encode(), Path(f"{name}.eds"), node_id)
        for node_id, name, text in (
            (6, "io", io + pdo(0x1400, "0x20000010", cob_id="0x205")),
            (7, "plc", DEVICE_TYPE + SENDERS),
        )
    ]
    assert Decoder(devices, master="PC")(frame).sender == sender


def test_without_a_name_it_is_the_master() -> None:
    assert Decoder(())(Frame(0x080)).sender == "master"
