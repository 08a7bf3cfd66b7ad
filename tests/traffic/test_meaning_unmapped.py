"""Frames of PDOs that are not messages: switched off, multiplexed, with 29 bits, or in no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import MappingError
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder, Defect, Meaning
from tests.eds_text import DEVICE_TYPE, pdo, record, variable

SPEED, WIDE = 0x20000010, 0x30000020
OBJECTS = (
    DEVICE_TYPE
    + variable("2000", "Speed", "INTEGER16", "0")
    + variable("3000", "Position", "INTEGER32", "0")
    + variable("3001", "Offset", "INTEGER24", "0")
)
OFF, ON = "0x80000285", "0x285"


def multiplexed(index: int, cob_id: str, mode: str) -> str:
    """A PDO whose frames name their object: sub-index 0 of its mapping says so, and there is no other."""
    communication = record(index, "PDO", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", cob_id), (2, "UNSIGNED8", "254"))
    return communication + record(index + 0x200, "PDO mapping", (0, "UNSIGNED8", mode))


TEXT = (
    OBJECTS
    + pdo(0x1800, hex(SPEED), cob_id="0x185")
    + pdo(0x1801, hex(WIDE), cob_id=OFF)
    + pdo(0x1802, hex(WIDE), hex(SPEED), cob_id="0x38FF0005")  # bit 29, and 29 bits
    + multiplexed(0x1803, "0x485", "0xFE")
    + multiplexed(0x1400, "0x205", "0xFF")
)


def dictionary(text: str = TEXT, node_id: int = 5, name: str = "epos4") -> Dictionary:
    return Dictionary.read(text.encode(), Path(f"{name}.eds"), node_id)


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return Decoder([dictionary(), dictionary(OBJECTS, 6, "io")])


def said(meaning: Meaning) -> tuple[str, str, list[tuple[Damage, str]]]:
    return meaning.name, meaning.text, [each[:2] for each in meaning.defects]


def test_a_pdo_that_is_off_in_its_file_is_named(decoder: Decoder) -> None:
    assert said(decoder(Frame(0x285, b"\x01\x02"))) == (
        "TPDO 2",
        "01 02",
        [(Damage.SWITCHED_OFF, "285#0102: TPDO 2 of epos4, off in its EDS")],
    )


def test_a_pdo_with_a_29_bit_identifier_is_a_message(decoder: Decoder) -> None:
    meaning = decoder(Frame(EXTENDED | 0x18FF0005, bytes.fromhex("FFFFFFFF 0100")))
    assert (meaning.name, meaning.text, meaning.defects) == ("epos4.TPDO3", "position=-1, speed=1", ())


def test_an_11_bit_identifier_is_another_one(decoder: Decoder) -> None:
    other = decoder(Frame(EXTENDED | 0x185, bytes(2)))
    assert (other.name, other.text, other.defects) == ("29-bit frame, 2 bytes", "00000185#0000", ())
    assert decoder(Frame(0x185, bytes(2))).defects == ()


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        # whose the object is (SAM): by the sender's file, in its type; a node or an object that no file has
        (Frame(0x485, bytes.fromhex("05 0020 00 FEFF 0000")), "0x2000:00 Speed of epos4 = -2"),
        (Frame(0x485, bytes.fromhex("05 0030 00 FEFFFFFF")), "0x3000:00 Position of epos4 = -2"),
        (Frame(0x485, bytes.fromhex("05 0130 00 FEFFFF 00")), "0x3001:00 Offset of epos4 = -2"),
        (Frame(0x485, bytes.fromhex("09 0020 01 01020304")), "0x2000:01 of node 9 = 01 02 03 04"),
        (Frame(0x485, bytes.fromhex("05 0040 01 01020304")), "0x4000:01 of epos4 = 01 02 03 04"),
        # who is meant (DAM): one node, or all
        (Frame(0x205, bytes.fromhex("86 0020 00 0500 0000")), "0x2000:00 Speed to io = 5"),
        (Frame(0x205, bytes.fromhex("80 0020 00 01020304")), "0x2000:00 to all nodes = 01 02 03 04"),
    ],
)
def test_multiplexed_pdos(decoder: Decoder, frame: Frame, text: str) -> None:
    assert (decoder(frame).text, decoder(frame).defects) == (text, ())


def test_a_multiplexed_pdo_of_another_length_is_damage(decoder: Decoder) -> None:
    meaning = decoder(Frame(0x205, bytes(3)))
    assert (meaning.name, meaning.defects) == (
        "epos4.RPDO1",
        (Defect(Damage.WRONG_LENGTH, "epos4.RPDO1 (0x205): 3 bytes of data, expected 8"),),
    )
    assert decoder(RemoteFrame(0x205)).defects == ()


@pytest.mark.parametrize(
    ("cob_id", "name", "node", "words"),
    [
        (0x186, "TPDO 1", "io", "TPDO 1 of io"),
        (0x3FF, "TPDO 3", "node 127", "TPDO 3 of node 127"),
        (0x501, "RPDO 4", "node 1", "RPDO 4 of node 1"),
    ],
)
def test_a_guess_is_called_one(decoder: Decoder, cob_id: int, name: str, node: str, words: str) -> None:
    meaning = decoder(Frame(cob_id, b"\x01"))
    assert (meaning.name, meaning.nodes, meaning.text) == (name, (node,), "01")
    (defect,) = meaning.defects
    assert defect[:2] == (
        Damage.UNKNOWN_IDENTIFIER,
        f"{cob_id:03X}#01: in no file; a guess by its identifier: {words}",
    )


@pytest.mark.parametrize(("cob_id", "whose"), [(0x101, "safety (SRDO)"), (0x6E1, "extensions of CiA")])
def test_reserved_identifiers_have_no_name(decoder: Decoder, cob_id: int, whose: str) -> None:
    meaning = decoder(Frame(cob_id))
    assert meaning.name == ""
    assert meaning.defects[0].text == f"{cob_id:03X}#: in no file; its identifier is reserved for {whose}"


def test_remote_frames_for_them(decoder: Decoder) -> None:
    assert said(decoder(RemoteFrame(0x485))) == ("epos4.TPDO4", "remote frame: asks for it", [])
    assert decoder(RemoteFrame(0x285)).defects[0].text == "285#R: TPDO 2 of epos4, off in its EDS"


def test_only_who_listens_has_them() -> None:
    """A device of ours sends no such PDO, and says why."""
    refused: list[MappingError] = []
    device = dictionary()
    found = device.read_pdos(device.default, refused.append)
    assert [each.title for each in found] == ["TPDO 1", "TPDO 2"]
    assert [(each.index, each.what) for each in refused] == [
        (0x1600, "RPDO 1 is a multiplexed PDO (destination address mode)"),
        (0x1802, "COB-ID 0x38FF0005 asks for a 29-bit identifier"),
        (0x1A03, "TPDO 4 is a multiplexed PDO (source address mode)"),
    ]


def test_a_mapping_of_more_objects_than_bits_says_so() -> None:
    refused: list[MappingError] = []
    device = dictionary(OBJECTS + multiplexed(0x1800, "0x185", "0xFD"))
    device.read_pdos(device.default, refused.append)
    assert [each.what for each in refused] == ["TPDO: sub 0 says that it maps 253 objects; a PDO has 64 bits"]


# Identifiers that a file moves

SRDO = {0: "6", 1: "1", 5: "0x109", 6: "0x10A"}

MOVED = (
    OBJECTS
    + variable("1005", "COB-ID SYNC", "UNSIGNED32", "0x40000070")  # bit 30: the device sends it
    + variable("1012", "COB-ID TIME", "UNSIGNED32", "0x800000F0")  # bit 31: it is consumed
    + variable("1014", "COB-ID EMCY", "UNSIGNED32", "0x7B0")
    + record(0x1200, "Server SDO", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x6C0"), (2, "UNSIGNED32", "0x5C0"))
    + record(0x1201, "Second", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x6E0"), (2, "UNSIGNED32", "0x5E0"))
    + record(0x1202, "Off", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x80000001"), (2, "UNSIGNED32", "0x80000002"))
    + record(0x1301, "SRDO", *((sub, "UNSIGNED32", number) for sub, number in SRDO.items()))
)  # fmt: skip


@pytest.mark.parametrize(
    ("cob_id", "data", "name", "text"),
    [
        (0x070, "", "SYNC", ""),
        (0x080, "", "SYNC", ""),  # of other devices it is where it was
        (0x0F0, "000000000000", "TIME", "1984-01-01 00:00:00.000"),
        (0x7B0, "1081010000000000", "EMCY", "epos4, 0x8110 overrun, register 0x01, 00 00 00 00 00"),
        (0x6C0, "4000200000000000", "SDO", "epos4, read 0x2000:00 Speed"),
        (0x5C0, "4B00200005000000", "SDO", "epos4, value of 0x2000:00 Speed = 5"),
        (0x6E0, "4000200000000000", "SDO", "epos4, read 0x2000:00 Speed"),
        (0x109, "0102", "SRDO", "epos4, 01 02"),
        (0x10A, "FEFD", "SRDO", "epos4, inverted 01 02"),
    ],
)
def test_services_are_where_the_file_puts_them(cob_id: int, data: str, name: str, text: str) -> None:
    meaning = Decoder([dictionary(MOVED)])(Frame(cob_id, bytes.fromhex(data)))
    assert (meaning.name, meaning.text, meaning.defects) == (name, text, ())


def test_a_service_says_what_it_says_as_data_too() -> None:
    meaning = Decoder([dictionary(MOVED)])(Frame(0x7B0, bytes.fromhex("1081010000000000")))
    assert meaning.fields == {"node": 5, "code": 0x8110, "register": 1, "words": "overrun", "info": bytes(5)}


@pytest.mark.parametrize("cob_id", [0x001, 0x002])
def test_a_channel_that_is_off_is_none(cob_id: int) -> None:
    assert Decoder([dictionary(MOVED)])(Frame(cob_id)).name != "SDO"


def test_a_client_names_the_server_of_another_node() -> None:
    client = OBJECTS + record(
        0x1280, "Client SDO", (0, "UNSIGNED8", "3"), (1, "UNSIGNED32", "0x6A0"), (2, "UNSIGNED32", "0x5A0"),
        (3, "UNSIGNED8", "6"),
    )  # fmt: skip
    decoder = Decoder([dictionary(client), dictionary(OBJECTS, 6, "io")])
    assert decoder(Frame(0x6A0, bytes.fromhex("4000200000000000"))).text == "io, read 0x2000:00 Speed"
