"""CANopen services: what one frame says, by the dictionaries of the nodes."""

from __future__ import annotations

import pytest

from eurobot_od.frame import Frame
from eurobot_od.logs.entries import Damage
from eurobot_od.logs.meaning import Decoder
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import decoder as robot_decoder

SERVICES = [
    # NMT: to all, to a known node, to another one, an unknown command
    (0x000, "01 00", "NMT", "start, all nodes"),
    (0x000, "81 02", "NMT", "reset, drive"),
    (0x000, "80 7F", "NMT", "pre-operational, node 127"),
    (0x000, "07 02", "NMT", "command 7, drive"),
    # boot-up, heartbeat, a state that CiA 301 does not have
    (0x702, "00", "Heartbeat", "drive, boot-up"),
    (0x701, "05", "Heartbeat", "core, operational"),
    (0x703, "7F", "Heartbeat", "navigation, pre-operational"),
    (0x710, "04", "Heartbeat", "node 16, stopped"),
    (0x701, "09", "Heartbeat", "core, state 9"),
    # EMCY: ours by name, CiA 301's by its class, one that is gone
    (0x082, "10 82 11 08 00 03 00 00", "EMCY", "drive, 0x8210 pdo too short, register 0x11, 08 00 03 00 00"),
    (0x085, "30 81 11 00 00 00 00 00", "EMCY", "node 5, 0x8130 "),
    (0x082, "00 00 00 00 00 00 00 00", "EMCY", "drive, 0x0000 no error, register 0x00"),
    # SDO: expedited write and read with names and values, refused, segments, blocks
    (0x602, "2B 17 10 00 E8 03 00 00", "SDO", "drive, write 0x1017:00 Producer heartbeat time = 1000"),
    (0x582, "60 17 10 00 00 00 00 00", "SDO", "drive, written 0x1017:00 Producer heartbeat time"),
    (0x602, "40 17 10 00 00 00 00 00", "SDO", "drive, read 0x1017:00 Producer heartbeat time"),
    (0x582, "4B 17 10 00 E8 03 00 00", "SDO", "drive, value of 0x1017:00 Producer heartbeat time = 1000"),
    (0x582, "41 08 10 00 14 00 00 00", "SDO", "drive, value of 0x1008:00 Manufacturer device name, 20 bytes"),
    (0x582, "80 99 99 01 00 00 02 06", "SDO", "drive, abort 0x9999:01: 0x06020000 Object does not exist"),
    (0x582, "80 17 10 00 01 00 00 00", "SDO", "0x00000001 unknown code"),
    (0x602, "60 00 00 00 00 00 00 00", "SDO", "drive, next segment"),
    (0x582, "05 45 75 72 6F 62 00 00", "SDO", "drive, segment of 5 bytes, the last"),
    (0x602, "A0 21 10 00 7F 00 00 00", "SDO", "drive, read 0x1021:00"),
    (0x602, "E0 00 00 00 00 00 00 00", "SDO", "drive, command 7"),
    # words for an error code that is the devices' own
    (0x082, "02 FF 81 00 00 00 00 00", "EMCY", "drive, 0xFF02 drive blocked"),
    # a node without a dictionary, and a value of a length that its type does not have
    (0x610, "2B 17 10 00 E8 03 00 00", "SDO", "node 16, write 0x1017:00 = e8 03"),
    (0x602, "2F 17 10 00 05 00 00 00", "SDO", "drive, write 0x1017:00 Producer heartbeat time = 05"),
]


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return robot_decoder(dialects.DEFAULT)


@pytest.mark.parametrize(("cob_id", "data", "name", "text"), SERVICES)
def test_what_a_service_says(decoder: Decoder, cob_id: int, data: str, name: str, text: str) -> None:
    meaning = decoder(Frame(cob_id, bytes.fromhex(data)))
    assert (meaning.name, meaning.group, meaning.defects) == (name, "CANopen", ())
    assert text in meaning.text


@pytest.mark.parametrize(
    ("cob_id", "data"), [(0x000, "01"), (0x701, ""), (0x701, "05 05"), (0x082, "10 82 11"), (0x602, "40 17 10 00")]
)
def test_a_service_of_another_length(decoder: Decoder, cob_id: int, data: str) -> None:
    (defect,) = decoder(Frame(cob_id, bytes.fromhex(data))).defects
    assert defect.damage is Damage.WRONG_LENGTH


def test_a_message_goes_before_the_service_of_node_64(decoder: Decoder) -> None:
    assert decoder(Frame(0x0C0)).name == "Kalman Position Request"
