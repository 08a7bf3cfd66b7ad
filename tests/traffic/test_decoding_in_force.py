"""What the bus accepted counts, whatever a device's file says; and what a log cannot know is unknown, and so said.

The same logs as text, as data, one by one as the page and `monitor` take them, as a season, and in `diagnose`.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import NOTHING
from eurobot_od.season.archive import Archiver, DecodedNetwork
from eurobot_od.season.season import Season
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import CsvOutput, Decoding, JsonOutput, TextOutput, TrackingDecoder
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.meaning import Decoder, Meaning

SERVO = Dictionary.load(Path("docs/servo.eds"), 1)
BOOT, START = "701#00", "000#0101"


def write(index: int, sub: int, value: int, size: int = 4, node: int = 1) -> str:
    """Return an expedited write of a master, and the device's answer."""
    place = (index.to_bytes(2, "little") + bytes([sub])).hex()
    data = value.to_bytes(4, "little").hex()
    return f"{0x600 + node:03X}#{0x23 | 4 - size << 2:02X}{place}{data} {0x580 + node:03X}#60{place}00000000".upper()


def mapped(*entries: int, index: int = 0x1800, cob_id: int = 0x181) -> str:
    """Return how a master maps objects into a PDO: off, none, each entry, their number, on."""
    record = index + 0x200
    each = [write(record, sub, entry) for sub, entry in enumerate(entries, 1)]
    off, none = write(index, 1, 1 << 31 | cob_id), write(record, 0, 0, 1)
    return " ".join([off, none, *each, write(record, 0, len(entries), 1), write(index, 1, cob_id)])


VELOCITY, STATUSWORD, OWN = 0x606C0020, 0x60410010, 0x29990110
REMAPPED = mapped(VELOCITY, STATUSWORD)
FRAME = "181#E80300003702"
SWAPPED = "velocity_actual_value=1000 rpm, statusword=567 (Operation enabled)"


def log_of(lines: str) -> bytes:
    """Return frames a millisecond apart as a log of candump."""
    return "".join(f"({1 + number / 1000:.6f}) can0 {line}\n" for number, line in enumerate(lines.split())).encode()


def last(lines: str, *devices: Dictionary) -> Meaning:
    """Decode frames one by one; return what the last one means."""
    following = TrackingDecoder(Decoder(devices or (SERVO,)))
    entries = formats.read(io.BytesIO(log_of(lines)), "log")
    *_, meaning = [following(time, channel, raw, line) for line, time, channel, raw in entries]
    return meaning


ACCEPTED = {
    "an object that the EDS lacks": (
        f"{BOOT} {mapped(OWN, STATUSWORD)} 181#E8033702",
        "field_0x2999_01=1000, statusword=567 (Operation enabled)",
    ),
    "more bits than the EDS has": (f"{BOOT} {mapped(0x60410020)} 181#E8030100", "statusword=66536"),
    "a sub-index that the EDS lacks": (f"{BOOT} {mapped(0x60410510)} 181#E803", "statusword_05=1000"),
    "a PDO that the EDS lacks": (
        f"{BOOT} {mapped(VELOCITY, index=0x1804, cob_id=0x1F1)} 1F1#E8030000",
        "velocity_actual_value=1000 rpm",
    ),
    "objects and a PDO that the EDS lacks": (
        f"{BOOT} {mapped(OWN, index=0x1807, cob_id=0x391)} 391#E803",
        "field_0x2999_01=1000",
    ),
    "a PDO that is stored": (
        f"{BOOT} {mapped(VELOCITY, index=0x1804, cob_id=0x1F1)} {write(0x1010, 1, 0x65766173)} {BOOT} 1F1#E8030000",
        "velocity_actual_value=1000 rpm",
    ),
}


@pytest.mark.parametrize(("lines", "text"), ACCEPTED.values(), ids=ACCEPTED)
def test_accepted_writes_change_decoding(lines: str, text: str) -> None:
    found = last(lines)
    assert (found.text.partition(" (Operation")[0], found.defects) == (text.partition(" (Operation")[0], ())


SWITCHED = {
    "off": (write(0x1800, 1, 0x80000181), "181#3702E8030000", "TPDO 1 of servo, switched off by SDO at line 2"),
    "off without its identifier": (write(0x1800, 1, 1 << 31), "181#00", "switched off by SDO at line 2"),
    "moved": (write(0x1800, 1, 0x190), "181#3702E8030000", "TPDO 1 of servo, moved to 0x190 by SDO at line 2"),
}


@pytest.mark.parametrize(("lines", "frame", "why"), SWITCHED.values(), ids=SWITCHED)
def test_a_pdo_that_a_master_has_switched_off_or_moved_is_not_off_in_its_file(lines: str, frame: str, why: str) -> None:
    (defect,) = last(f"{BOOT} {lines} {frame}").defects
    assert why in defect.text
    assert "EDS" not in defect.text


def test_after_a_boot_up_a_pdo_that_was_switched_off_is_as_its_file_says() -> None:
    assert last(f"{BOOT} {write(0x1800, 1, 0x80000181)} {BOOT} 181#3702E8030000").defects == ()


def test_a_second_sdo_server_made_by_sdo_is_one() -> None:
    made = f"{write(0x1201, 1, 0x641)} {write(0x1201, 2, 0x5C1)}"
    found = last(f"{BOOT} {made} 641#4017100000000000 5C1#4B17100064000000")
    assert found.nodes == ("servo",)
    assert "0x1017:00" in found.text
    assert last(f"{BOOT} {made} 641#23001A0120006C60 5C1#60001A0100000000").nodes == ("servo",)


def cut_logs() -> Iterator[str]:
    """Yield the remap from each of its lines on: the log begins in the middle."""
    lines = REMAPPED.split()
    for number in range(1, len(lines) - 1):
        yield " ".join([*lines[number:], START, FRAME])


def test_a_log_that_begins_in_a_remap_has_no_wrong_value() -> None:
    right = {"velocity_actual_value": 1000, "statusword": 0x237}
    for lines in cut_logs():
        found = last(lines)
        assert found.message is not None
        values = {field: value for field, value in found.message._asdict().items() if value is not None}
        assert values.items() <= right.items(), lines
        assert values == right or [each.damage.value for each in found.defects] == ["unknown mapping"], lines


UNKNOWN = {
    "the answer to one entry alone": (
        f"{write(0x1A00, 1, 0).split()[1]} {write(0x1A00, 2, VELOCITY)} {write(0x1A00, 0, 2, 1)} 181#FEFFE8030000",
        "mapped_object_1=unknown, velocity_actual_value=1000 rpm",
    ),
    "another length: those behind it have no known place": (
        f"{write(0x1A00, 1, 0).split()[1]} {write(0x1A00, 2, VELOCITY)} {write(0x1A00, 0, 2, 1)} 181#FEE8030000",
        "mapped_object_1=unknown, velocity_actual_value=unknown",
    ),
    "those before it are known": (
        f"{write(0x1A00, 1, VELOCITY)} {write(0x1A00, 2, 0).split()[1]} {write(0x1A00, 0, 2, 1)} 181#E803000001",
        "velocity_actual_value=1000 rpm, mapped_object_2=unknown",
    ),
    "no answer, but one to what was asked next": (
        f"{BOOT} {write(0x1A00, 1, VELOCITY).split()[0]} {write(0x1A00, 0, 2, 1)} 181#0102E8030000",
        "mapped_object_1=unknown, velocity_actual_value=1000 rpm",
    ),
    "requests alone": (
        f"{BOOT} {' '.join(REMAPPED.split()[::2])} {FRAME}",
        "mapped_object_1=unknown, mapped_object_2=unknown",
    ),
    "requests alone, with a write of one entry and a read": (
        f"{BOOT} {write(0x1A00, 2, VELOCITY).split()[0]} 601#4000100000000000 181#3702E8030000",
        "statusword=567 (Operation enabled), mapped_object_2=unknown",
    ),
    "one request alone": (
        f"{BOOT} {write(0x1A00, 1, VELOCITY).split()[0]} 181#0102E8030000",
        "mapped_object_1=unknown, velocity_actual_value=1000 rpm",
    ),
    "one request alone, in a log that begins anywhere": (
        f"{write(0x1A00, 2, VELOCITY).split()[0]} 181#0102E8030000",
        "mapped_object_1=unknown, mapped_object_2=unknown",
    ),
    "one request that its client gives up": (
        f"{BOOT} {write(0x1A00, 1, VELOCITY).split()[0]} 601#80001A0100000405 181#0102E8030000",
        "mapped_object_1=unknown, velocity_actual_value=1000 rpm",
    ),
    "the device answers with another mapping than its file's": (
        "601#40001A0100000000 581#43001A0110004160 601#40001A0100000000 581#43001A0108006160 181#01E8030000",
        "modes_of_operation_display=1 (profile position), mapped_object_2=unknown",
    ),
}


@pytest.mark.parametrize(("lines", "text"), UNKNOWN.values(), ids=UNKNOWN)
def test_values_missing_in_the_log_are_unknown(lines: str, text: str) -> None:
    found = last(lines)
    assert found.text == text
    assert [each.damage.value for each in found.defects] == ["unknown mapping"]


KNOWN_AGAIN = {
    "written once more": f"{write(0x1A00, 1, 0).split()[1]} {REMAPPED} {FRAME}",
    "read": f"{write(0x1A00, 1, 0).split()[1]} 601#40001A0100000000 581#43001A0120006C60 "
    f"601#40001A0200000000 581#43001A0210004160 601#40001A0000000000 581#4F001A0002000000 {FRAME}",
}


def test_a_request_that_the_device_refuses_changes_nothing() -> None:
    asked = write(0x1A00, 1, VELOCITY).split()[0]
    assert last(f"{asked} 181#3702E8030000").defects
    assert last(f"{asked} 581#80001A0111000906 181#3702E8030000").defects == ()


@pytest.mark.parametrize("lines", KNOWN_AGAIN.values(), ids=KNOWN_AGAIN)
def test_unknown_mappings_are_known_once_seen(lines: str) -> None:
    found = last(lines)
    assert (found.text, found.defects) == (SWAPPED, ())


def test_after_a_boot_up_nothing_is_unknown() -> None:
    found = last(f"{write(0x1A00, 1, 0).split()[1]} {BOOT} 181#3702E8030000")
    assert found.message is not None
    assert found.defects == ()


def test_a_pdo_that_only_its_cob_id_switches_on_is_as_its_file_says() -> None:
    """Its mapping is that of the file unless the log shows otherwise."""
    assert last(f"{write(0x1800, 1, 0x80000181)} {write(0x1800, 1, 0x181)} 181#3702E8030000").defects == ()


@pytest.mark.parametrize("frame", ["181#3702E803", "181#3702E80300000000"])
def test_a_wrong_length_prints_no_field_of_the_wrong_mapping(frame: str) -> None:
    found = last(f"{BOOT} {frame}")
    assert (found.message, [each.damage.value for each in found.defects]) == (None, ["wrong length"])
    assert "statusword" not in found.text


ONE_WAY = {
    "requests": (" ".join(REMAPPED.split()[::2]), "no answers in this log: settings are as the files say"),
    "answers": (" ".join(REMAPPED.split()[1::2]), "no requests in this log: of what was written nobody knows what"),
}


@pytest.mark.parametrize(("lines", "note"), ONE_WAY.values(), ids=ONE_WAY)
def test_a_log_of_one_direction_is_said_once(lines: str, note: str) -> None:
    decoding = Decoding(Decoder([SERVO]), TextOutput())
    list(decoding.lines(io.BytesIO(log_of(lines)), "some.log", "log"))
    assert [each for each in decoding.damage.report() if note in each] == [f"some.log: {decoding.damage.notes[0][10:]}"]
    both = Decoding(Decoder([SERVO]), TextOutput())
    list(both.lines(io.BytesIO(log_of(REMAPPED)), "some.log", "log"))
    assert both.damage.notes == []


BEGINS_IN_REMAP = f"{UNKNOWN['the answer to one entry alone'][0]} {START}"


def test_the_mark_is_one_word_in_all_outputs(tmp_path: Path) -> None:
    log, word = log_of(BEGINS_IN_REMAP), "unknown mapping"
    (tmp_path / "some.log").write_bytes(log)
    decoder = Decoder([SERVO])
    fields = (field for each in decoder.protocol.bindings for field in each.kinds)
    text, as_json, as_csv = (
        "".join(Decoding(decoder, output).lines(io.BytesIO(log), "some.log", "log")).splitlines()[-2]
        for output in (TextOutput(), JsonOutput(), CsvOutput(fields))
    )
    data = json.loads(as_json)
    assert f"! {word}: " in text
    assert data["fields"] == {"mapped_object_1": None, "velocity_actual_value": 1000}
    assert [each["kind"] for each in data["damage"]] == [word]
    assert f",{word}: " in as_csv.replace('"', "")

    Archiver(tmp_path / "season", DecodedNetwork((SERVO,), NOTHING))(tmp_path / "some.log")
    season = Season.open(tmp_path / "season")
    found = season.sql("SELECT mapped_object_1, mapped_object_1_flag, velocity_actual_value FROM servo_tpdo1")
    assert found.rows() == [(None, "unknown", 1000)]
    assert season.sql("SELECT kind FROM damage").rows() == [(word,)]

    diagnosis = Diagnosis(decoder)
    diagnosis.begin("some.log")
    for line, time, channel, raw in formats.read(io.BytesIO(log), "log"):
        diagnosis.take(time, channel, raw, line)
    diagnosis.end()
    assert [each.title for each in diagnosis.incidents.sorted() if each.rule.id == "pdo-mapping-unknown"] == [
        f"servo: {word}: servo.TPDO1: its mapping was written before the log begins, or the log does not have what was "
        "written, or the answer"
    ]


def test_a_second_sdo_server_of_a_device_without_a_file_is_its_own() -> None:
    lines = " ".join([write(0x1201, 1, 0x641), write(0x1201, 2, 0x5C1), "641#2B40600000000000"])
    following = TrackingDecoder(Decoder([]))
    *_, meaning = [following(t, c, raw, n) for n, t, c, raw in formats.read(io.BytesIO(log_of(lines)), "log")]
    assert meaning.nodes == ("node 1",)


def test_lss_to_all_of_two_devices_with_one_file_renumbers_neither() -> None:
    two = [SERVO.renumbered(node).named(f"servo_{node}") for node in (1, 2)]
    configured = "7E5#0401000000000000 7E5#1109000000000000 7E4#1100000000000000 7E5#0400000000000000"
    assert last(f"701#00 702#00 {configured} 709#00 189#3702E8030000", *two).message is None


MAPPED_OTHERWISE: dict[str, tuple[str, str, list[str]]] = {
    "moved": (
        f"{write(0x1800, 1, 0x80000181)} {write(0x1800, 1, 0x195)}",
        "195#3702E8030000",
        ["servo: servo.TPDO1 is sent under 0x195; its file says 0x181"],
    ),
    "moved to where another one was": (
        f"{write(0x1801, 1, 0x80000281)} {write(0x1800, 1, 0x80000181)} {write(0x1800, 1, 0x281)}",
        "281#3702E8030000",
        ["servo: servo.TPDO1 is sent under 0x281; its file says 0x181"],
    ),
    "not known": (write(0x1A00, 1, VELOCITY).split()[1], FRAME, []),
}


@pytest.mark.parametrize(("lines", "frame", "titles"), MAPPED_OTHERWISE.values(), ids=MAPPED_OTHERWISE)
def test_diagnose_compares_a_pdo_with_the_same_one_in_its_file(lines: str, frame: str, titles: list[str]) -> None:
    diagnosis = Diagnosis(Decoder([SERVO]))
    for line, time, channel, raw in formats.read(io.BytesIO(log_of(f"{lines} {frame}")), "log"):
        diagnosis.take(time, channel, raw, line)
    diagnosis.end()
    assert [each.title for each in diagnosis.incidents.sorted() if each.rule.id == "pdo-mapped-otherwise"] == titles


@pytest.mark.parametrize(("lines", "note"), ONE_WAY.values(), ids=ONE_WAY)
def test_a_log_of_one_direction_is_said_by_the_archive(tmp_path: Path, lines: str, note: str) -> None:
    (tmp_path / "some.log").write_bytes(log_of(lines))
    made = Archiver(tmp_path / "season", DecodedNetwork((SERVO,), NOTHING))(tmp_path / "some.log")
    assert [note in each for each in made.notes] == [True]
