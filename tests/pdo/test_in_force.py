"""What a bus shows of its devices' parameters counts more than their files; nothing else does."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import canopen
import pytest
from interop_rows.bench import new_channel, open_bus

from eurobot_od.bus.live import Live
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Value
from eurobot_od.pdo.in_force import InForce, made
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.meaning import Decoder, Meaning

SERVO = Dictionary.load(Path("docs/servo.eds"), 1)
WITHOUT_A_FILE = "velocity_actual_value=1000"
VELOCITY = f"{WITHOUT_A_FILE} rpm"

OFF, NONE = "601#2300180181010080 581#6000180100000000", "601#2F001A0000000000 581#60001A0000000000"
MAPPED = (
    "601#23001A0120006C60 581#60001A0100000000 601#23001A0210004160 581#60001A0200000000 "
    "601#2F001A0002000000 581#60001A0000000000"
)
ON = "601#2300180181010000 581#6000180100000000"
REMAP = f"{OFF} {NONE} {MAPPED} {ON}"
SAVE = "601#2310100173617665 581#6010100100000000"
LOAD = "601#231110016C6F6164 581#6011100100000000"
FRAME = "181#E80300003702"


def decoded(lines: str, *devices: Dictionary, channels: str = "") -> list[Meaning]:
    """Decode frames a millisecond apart; the last as many as `channels` says are on these."""
    following, frames = TrackingDecoder(Decoder(devices)), lines.split()
    names = ["a"] * (len(frames) - len(channels)) + list(channels)
    pairs = (each.split("#") for each in frames)
    return [
        following(number / 1000, name, Frame(int(cob_id, 16), bytes.fromhex(data)))
        for number, (name, (cob_id, data)) in enumerate(zip(names, pairs))
    ]


SHOWN = {
    "a remap by writes": f"{REMAP} {FRAME}",
    "the answers to reads": (
        "601#40001A0000000000 581#4F001A0002000000 601#40001A0100000000 581#43001A0120006C60 "
        f"601#40001A0200000000 581#43001A0210004160 {FRAME}"
    ),
    "written segment by segment": (
        f"{OFF} {NONE} 601#21001A0104000000 581#60001A0100000000 601#0720006C60000000 581#2000000000000000 "
        f"601#23001A0210004160 581#60001A0200000000 601#2F001A0002000000 581#60001A0000000000 {ON} {FRAME}"
    ),
    "written in a block": (
        f"{OFF} {NONE} 601#C2001A0104000000 581#A0001A017F000000 601#8120006C60000000 581#A2017F0000000000 "
        f"601#CD00000000000000 581#A100000000000000 "
        f"601#23001A0210004160 581#60001A0200000000 601#2F001A0002000000 581#60001A0000000000 {ON} {FRAME}"
    ),
    "stored, then a boot-up": f"{REMAP} {SAVE} 701#00 {FRAME}",
    "a reset of another node": f"{REMAP} 000#8102 {FRAME}",
    "restored, but not started anew": f"{REMAP} {SAVE} {LOAD} {FRAME}",
}

NOT_SHOWN = {
    "nothing": FRAME,
    "a boot-up after it": f"{REMAP} 701#00 {FRAME}",
    "a reset of the node": f"{REMAP} 000#8101 {FRAME}",
    "a reset of all nodes' communication": f"{REMAP} 000#8200 {FRAME}",
    "writes that the device refuses": (
        "601#2F001A0001000000 581#80001A0011000906 601#23001A0120006C60 581#80001A0122000008 " + FRAME
    ),
    "restored and started anew": f"{REMAP} {SAVE} {LOAD} 701#00 {FRAME}",
}


@pytest.mark.parametrize("lines", SHOWN.values(), ids=SHOWN)
def test_an_observed_mapping_is_used(lines: str) -> None:
    last = decoded(lines, SERVO)[-1]
    assert last.text == f"{VELOCITY}, statusword=567 (Operation enabled)"
    assert last.defects == ()


@pytest.mark.parametrize("lines", NOT_SHOWN.values(), ids=NOT_SHOWN)
def test_the_file_applies_without_observation_and_after_reset(lines: str) -> None:
    assert decoded(lines, SERVO)[-1].text == decoded(FRAME, SERVO)[-1].text != ""
    assert VELOCITY not in decoded(lines, SERVO)[-1].text


def test_an_unconfirmed_write_makes_the_entry_unknown() -> None:
    last = decoded("601#2F001A0001000000 601#23001A0120006C60 " + FRAME, SERVO)[-1]
    assert last.text == "mapped_object_1=unknown, mapped_object_2=unknown"


def test_a_moved_pdo_leaves_its_old_identifier() -> None:
    moved = "601#2300180190010000 581#6000180100000000"
    *_, new, old = decoded(f"{moved} 190#E80300003702 {FRAME}", SERVO)
    assert (new.name, old.message) == ("servo.TPDO1", None)
    assert old.defects


def test_channels_have_separate_devices() -> None:
    here, there = decoded(f"{REMAP} {FRAME} {FRAME}", SERVO, channels="ab")[-2:]
    assert VELOCITY in here.text
    assert VELOCITY not in there.text


def test_emcy_and_sync_move_with_their_objects() -> None:
    moved = "601#2314100091000000 581#6014100000000000"
    lines = f"{moved} 601#2305100092000000 581#6005100000000000 091#0010010000000000 092#"
    emcy, sync = decoded(lines, SERVO)[-2:]
    assert (emcy.name, sync.name) == ("EMCY", "SYNC")


def test_without_a_file_fields_are_named_by_profile_or_index() -> None:
    assert decoded(f"{REMAP} {FRAME}")[-1].text == f"{WITHOUT_A_FILE}, statusword=567"
    own = REMAP.replace("0120006C60", "0120012021")  # 0x2120:01
    last = decoded(f"{own} {FRAME}")[-1]
    assert (last.name, last.text) == ("node 1.TPDO1", "field_0x2120_01=1000, statusword=567")
    assert decoded(f"{own} {FRAME} 701#00 {FRAME}")[-1].name == "PDO 0x181, 6 bytes"


def test_other_pdos_without_files_keep_their_meaning() -> None:
    last = decoded(f"{REMAP} {FRAME} 182#01")[-1]
    assert (last.name, last.defects) == ("PDO 0x182, 1 byte", ())


def test_only_values_that_change_frames_are_reported_as_changes() -> None:
    shown = InForce([SERVO])
    cob_id = SERVO.number((0x1800, 1)) or 0
    assert not shown.show(1, (0x1800, 1), cob_id.to_bytes(4, "little"))
    assert not shown.show(1, (0x1018, 1), bytes(4))
    assert not shown.show(1, (0x1017, 0), b"\x10\0")
    assert shown.described[0].number((0x1017, 0)) == 16
    assert shown.show(1, (0x1800, 1), (cob_id | 1 << 31).to_bytes(4, "little"))
    assert shown.start(1)
    assert not shown.start(0)


def test_a_device_without_a_file_has_one_dictionary_for_each_pdo(monkeypatch: pytest.MonkeyPatch) -> None:
    """At each of the writes that map a PDO, 64 PDOs took half a minute."""
    made: list[Dictionary] = []
    read = Dictionary.read

    def counted(*of: Any) -> Dictionary:
        made.append(read(*of))
        return made[-1]

    monkeypatch.setattr(Dictionary, "read", counted)
    shown = InForce([])
    for number in range(8):
        for address, value in (
            ((0x1800 + number, 1), 0x80000000),
            ((0x1A00 + number, 0), 0),
            ((0x1A00 + number, 1), 0x20000110 + (number << 16)),
            ((0x1A00 + number, 2), 0x20000210 + (number << 16)),
            ((0x1A00 + number, 0), 2),
            ((0x1800 + number, 1), 0x181 + number),
        ):
            is_news = shown.show(1, address, value.to_bytes(4, "little"))
        assert is_news
    assert len(made) == 8
    assert shown.show(1, (0x1A00, 0), b"\xff\xff\xff\xff")  # more than was shown of it: its mapping is not known


LEARNED: dict[tuple[int, int], Value] = {
    (0x1800, 1): 0x191,
    (0x1A00, 0): 1,
    (0x1A00, 1): 0x606C0020,
    (0x1801, 1): 0x281,
    (0x1A01, 0): 0xFE,
    (0x1014, 0): 0x91,
}
"""What a device without a file has answered: a TPDO, one that is multiplexed, and where its EMCY is."""


def test_answers_of_a_device_without_a_file_are_kept_after_reset() -> None:
    following = TrackingDecoder(Decoder((), learned=made(1, LEARNED)))
    frames = [Frame(0x191, b"\xe8\3\0\0"), *map(Frame.parse, REMAP.replace("601", "602").replace("581", "582").split())]
    frames += [frames[0], Frame(0x701, b"\0"), frames[0], Frame(0x091, bytes(8))]
    meanings = [following(0, "a", each) for each in frames]
    first, again, after_a_start, emcy = meanings[0], meanings[-4], meanings[-2], meanings[-1]
    assert (first.name, first.text) == ("node 1.TPDO1", WITHOUT_A_FILE)
    assert again[1:3] == after_a_start[1:3] == first[1:3]
    assert again.text == after_a_start.text == WITHOUT_A_FILE
    assert emcy.name == "EMCY"


TYPE, STATE = "601#4000100000000000 581#4300100092010200", "601#4041680000000000 581#4B41680037060000"
MODE = "601#4061680000000000 581#4F61680001000000"
NO_MODE = "601#4061680000000000 581#8061680000000206"
MAPS_STATE = MAPPED.replace("4160", "4168")
IN_WORDS = "0x6841:00 Statusword (axis 2) = 1591 (Operation enabled, target reached)"

UNDERVOLTAGE = "0x3220 DC link undervoltage"

PROFILES = {
    "by 0x1000": (f"{TYPE} {STATE}", f"node 1, value of {IN_WORDS}"),
    "by the objects that it has answered for": (f"{STATE} {MODE} {STATE}", f"node 1, value of {IN_WORDS}"),
    "not by one of them": (f"{STATE} {NO_MODE} {STATE}", "node 1, value of 0x6841:00 = 37 06"),
    "not another node": (f"{TYPE} 582#4B41680037060000", "node 2, value of 0x6841:00 = 37 06"),
    "of a PDO": (f"{TYPE} {MAPS_STATE} {ON} {FRAME}", f"{WITHOUT_A_FILE}, statusword_axis_2=567 (Operation enabled)"),
    "by what its PDO maps": (f"{MAPS_STATE} {ON} {MODE} {STATE}", f"node 1, value of {IN_WORDS}"),
    "of an emergency": (f"{TYPE} 081#2032010102030405", f"node 1, {UNDERVOLTAGE}, register 0x01, 01 02 03 04 05"),
    "after a start": (f"{TYPE} 701#00 {STATE}", f"node 1, value of {IN_WORDS}"),
}


@pytest.mark.parametrize(("lines", "text"), PROFILES.values(), ids=PROFILES)
def test_objects_without_a_file_are_named_by_the_observed_profile(lines: str, text: str) -> None:
    assert decoded(lines)[-1].text.partition(", 2 bytes")[0] == text


def test_the_observed_profile_is_kept() -> None:
    following = TrackingDecoder(Decoder((), learned=made(1, {}, 402)))
    assert "Statusword (axis 2)" in following(0.0, "", Frame(0x581, bytes.fromhex("4B41680037060000"))).text


@contextmanager
def stopping(what: Any) -> Iterator[None]:
    """Stop a thread's owner at the end, whatever happens."""
    try:
        yield
    finally:
        what.stop()


class Witness(SimulatedDevice):
    """A drive that measures something else at each SYNC, and notes what it had when it sent a frame."""

    def __init__(self, file: Dictionary, addresses: Sequence[tuple[int, int]]) -> None:
        super().__init__(file)
        self._mapped, self._chance = addresses, random.Random(50)
        self.sent: list[tuple[Frame, tuple[object, ...]]] = []

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == 0x080:
            for address in self._mapped:
                bits = 16 if address[0] in (0x6041, 0x6077) else 32
                low = 0 if address[0] == 0x6041 else -1 << bits - 1
                self.set_value(address, self._chance.randrange(low, low + (1 << bits)))
        answers = super().receive(frame, now)
        values = tuple(self.value(each) for each in self._mapped)
        self.sent += [(each, values) for each in answers if each.cob_id == 0x391]
        return answers


def remapped_live(log: Path, count: int) -> list[tuple[Frame, tuple[object, ...]]]:
    """Remap TPDO 2 of a drive at boot by canopen's own master, and return some frames and their meanings."""
    objects = [(0x6077, 0), (0x606C, 0), (0x6041, 0)]
    channel = new_channel()
    drive, master = Witness(SERVO, objects), canopen.Network()
    with (
        stopping(Live.node(open_bus(channel), drive).start()),
        open_bus(channel) as ears,
        can.CanutilsLogWriter(log, channel="can0") as writer,
        stopping(can.Notifier(ears, [writer])),
    ):
        master.connect(interface="virtual", channel=channel)
        try:
            node: Any = master.add_node(1, str(SERVO.file))
            pdo = node.tpdo[2]
            node.tpdo.read()
            pdo.clear()
            for address in objects:
                pdo.add_variable(*address)
            pdo.cob_id, pdo.trans_type, pdo.enabled = 0x391, 1, True
            pdo.save()
            node.nmt.send_command(1)
            node.sdo.upload(0x1017, 0)  # when it has answered, it has had the command
            for _ in range(count):
                master.sync.transmit()
                pdo.wait_for_reception(1.0)
        finally:
            master.disconnect()
    return drive.sent


def test_pdos_mapped_by_a_master_at_boot_are_decoded(tmp_path: Path) -> None:
    sent = remapped_live(tmp_path / "bus.log", 100)
    following = TrackingDecoder(Decoder([SERVO]))
    with (tmp_path / "bus.log").open("rb") as file:
        meanings = [following(time, channel, raw) for _, time, channel, raw in formats.read(file)]
    found = [(each.raw, tuple(each.message or ())) for each in meanings if each.raw[0] == 0x391]
    assert len(sent) == 100
    assert found == sent
    assert [each.defects for each in meanings if each.defects] == []


# LSS


def identity(product: int, vendor: int = 0) -> str:
    """An EDS with an identity, and a TPDO at the usual place."""
    parts = "".join(
        f"[1018sub{sub}]\nParameterName={sub}\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue={number}\n"
        for sub, number in enumerate((2, vendor, product))
    )
    return f"[1018]\nParameterName=Identity\nObjectType=9\nSubNumber=3\n{parts}"


def of_product(name: str, node_id: int, product: int, vendor: int = 0) -> Dictionary:
    return Dictionary.read(identity(product, vendor).encode(), Path(f"{name}.eds"), node_id, name)


MOTOR, OTHER = of_product("motor", 5, product=7, vendor=9), of_product("other", 6, product=8)
SELECTED = "7E5#4009000000000000 7E5#4107000000000000 7E5#4200000000000000 7E5#4301000000000000 7E4#4400000000000000"
SCANNED = "7E5#5109000000000001 7E4#4F00000000000000 7E5#5107000000000102 7E4#4F00000000000000"
INQUIRED = "7E5#0401000000000000 7E5#5A00000000000000 7E4#5A09000000000000 7E5#5B00000000000000 7E4#5B07000000000000"
SET, TAKEN, REFUSED = "7E5#1122000000000000", "7E4#1100000000000000", "7E4#1101000000000000"
BOOTED = "722#00"
READ = "622#4018100200000000"
AS_MOTOR, AS_ANY = "motor_34, read 0x1018:02 Identity, 2", "node 34, read 0x1018:02"


@pytest.mark.parametrize(
    ("lines", "expected"),
    {
        f"{SELECTED} {SET} {TAKEN} {BOOTED}": AS_MOTOR,
        f"{SCANNED} {SET} {TAKEN} {BOOTED}": AS_MOTOR,
        f"{INQUIRED} {SET} {TAKEN} {BOOTED}": AS_MOTOR,
        f"{SELECTED} {SET} {TAKEN}": AS_ANY,  # it has its node-ID from the boot-up on
        f"{SELECTED} {SET} {REFUSED} {BOOTED}": AS_ANY,
        f"{SELECTED} 7E5#0401000000000000 {SET} {TAKEN} {BOOTED}": AS_ANY,  # nobody says who is there
        f"{SELECTED.replace('4107', '4106')} {SET} {TAKEN} {BOOTED}": AS_ANY,
        f"{SELECTED.replace('4009', '4008')} {SET} {TAKEN} {BOOTED}": AS_ANY,
    }.items(),
)
def test_a_device_with_node_id_by_lss_uses_the_file_for_its_identity(lines: str, expected: str) -> None:
    assert decoded(f"{lines} {READ}", MOTOR, OTHER)[-1].text == expected


def test_the_file_for_a_device_with_node_id_by_lss_is_reported_once() -> None:
    found = decoded(f"{SELECTED} {SET} {TAKEN} {BOOTED} {READ} {BOOTED}", MOTOR, OTHER)
    words = "; by LSS it is motor_34, read by motor.eds"
    assert [each.text for each in found if words in each.text] == [f"node 34, boot-up{words}"]


def test_a_file_for_the_node_id_has_priority_over_lss() -> None:
    given = of_product("given", 34, product=1)
    last = decoded(f"{SELECTED} {SET} {TAKEN} {BOOTED} {READ}", MOTOR, given)[-1]
    assert last.text == "given, read 0x1018:02 Identity, 2"


def test_two_files_for_one_product_are_not_used_after_lss() -> None:
    last = decoded(f"{SELECTED} {SET} {TAKEN} {BOOTED} {READ}", MOTOR, of_product("rival", 6, product=7))[-1]
    assert last.text == AS_ANY
