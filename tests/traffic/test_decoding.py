"""Logs to lines: what is not regular in a log costs no other line; pieces, several logs, windows of time, filters."""

from __future__ import annotations

import csv
import io
import json
import random
from collections.abc import Iterator
from typing import Any

import pytest

from eurobot_od.frame import EXTENDED, Frame
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import (
    SERVICE_FIELDS,
    CsvOutput,
    Decoding,
    JsonOutput,
    Output,
    TextOutput,
    TrackingDecoder,
)
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.traffic.filters import Window, by_name
from eurobot_od.traffic.meaning import Decoder
from tests.client.servo import SERVO as FILE
from tests.kit import plant

FIRST, SECOND, THIRD = LINES = (
    "(1396.001356) can0 382#1B796C2008\n",
    "(1396.005961) can0 302#\n",
    "(1396.013890) vcan1 282#730903\n",
)
REGULAR = "".join(LINES)
TEXT = """\
  1396.001356  can0  Place Response                x=2331 mm, y=1735 mm, angle=32 deg, source=laser
  1396.005961  can0  Move State Request
  1396.013890  vcan1  Move State Response           time=199027 ms
"""
UNREADABLE = "unreadable"


class Pieces(io.RawIOBase):
    """A file that gives at most `most` bytes at a time, as a pipe does."""

    def __init__(self, content: bytes, most: int) -> None:
        self._content, self._most = io.BytesIO(content), most

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        data = self._content.read(min(self._most, len(buffer)))
        buffer[: len(data)] = data
        return len(data)


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return plant.decoder()


def decoded(decoding: Decoding, log: str, name: str = "bus.log") -> str:
    return "".join(decoding.lines(io.BytesIO(log.encode()), name, "log"))


def one_by_one(decoder: Decoder, log: str) -> str:
    """Decode a log as a bus is decoded, and write each line by itself."""
    output, following = TextOutput(), TrackingDecoder(decoder)
    write = output.line_writer("bus.log")
    entries = formats.read(io.BytesIO(log.encode()), "log")
    return "".join(write(n, time, ch, output.row(following(time, ch, raw))) for n, time, ch, raw in entries)


def made_up(decoder: Decoder, seed: int) -> Iterator[str]:
    """Yield lines with frames of all messages and lengths, services, guarding, and what is not a frame."""
    chance = random.Random(seed)
    for number in range(3000):
        known = chance.choice(decoder.protocol.bindings)
        length = chance.choice([known.layout.length] * 9 + [*range(9)])
        message = f"{known.cob_id:03X}#{chance.randbytes(length).hex().upper()}"
        state = chance.choice(["00", "05", "7F", "85", "05", "R1"] if number > 2000 else ["05"])
        others = [f"70{chance.choice('123')}#{state}"] * 2 + ["602#4018100100000000", "7FE#01"]
        text = chance.choice([message] * 12 + others)
        yield f"({number / 8:.6f}) {chance.choice(['can0', 'can1'])} {text}\n" if number % 500 else "not a frame\n"


@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_frames_that_are_decoded_together_say_what_each_says_by_itself(dialect: str) -> None:
    decoder = plant.decoder(dialect)
    for log in ("".join(made_up(decoder, 1)), "".join(made_up(decoder, 2)).replace("can1", "can0")):
        decoding = Decoding(decoder, TextOutput())
        assert decoded(decoding, log) == one_by_one(decoder, log)
        assert decoding.damage.counts[Damage.UNREADABLE].number == 6


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        (REGULAR, "all regular"),
        (f"{FIRST}\n{SECOND}\n{THIRD}\n", "empty lines"),
        (REGULAR[:-1], "no end of the last line"),
        (REGULAR.replace("\n", " R\n"), "the direction, as python-can writes it"),
        (REGULAR.replace("\n", " T\n", 2), "a direction at some of them"),
        (REGULAR.replace("\n", "\r\n"), "line ends of Windows"),
        (REGULAR.replace(" ", "  "), "more space"),
        (REGULAR.replace(" ", "\t"), "other space"),
        (REGULAR.replace("382#1B796C2008", "382#1b796c2008"), "small letters"),
        (REGULAR.replace("(1396.", "(0001396."), "zeros before a time"),
        (REGULAR.replace("1396.005961", "1396.0059610"), "more decimals"),
    ],
)
def test_regular_lines_in_any_of_their_forms(decoder: Decoder, log: str, reason: str) -> None:
    decoding = Decoding(decoder, TextOutput())
    assert decoded(decoding, log) == TEXT, reason
    assert decoding.damage.total == 0


@pytest.mark.parametrize(
    ("log", "damage", "text"),
    [
        # words that are not where they should be
        (SECOND.replace(" 302#", " 010 #"), UNREADABLE, ""),
        (SECOND.replace(" can0 302#", "#can0 010 "), UNREADABLE, ""),
        (SECOND.replace(" 302#", "#010"), UNREADABLE, ""),
        (SECOND.replace(" can0", "\x1ccan0"), UNREADABLE, ""),
        (SECOND.replace(" can0", "\ncan0"), UNREADABLE, ""),
        (SECOND.replace("\n", " ") + THIRD, UNREADABLE, ""),
        (SECOND.replace("\n", " X\n"), UNREADABLE, ""),
        # times
        (SECOND.replace("(1396.005961)", "1396.005961"), UNREADABLE, ""),
        (SECOND.replace("(", "(("), UNREADABLE, ""),
        (SECOND.replace("(", "(1.5)("), UNREADABLE, ""),
        (SECOND.replace("1396.", "1.5396."), UNREADABLE, ""),
        (SECOND.replace("1396.", "-396."), UNREADABLE, ""),
        (SECOND.replace("1396.", "100000000000."), UNREADABLE, ""),
        # identifiers and data
        (SECOND.replace("302#", "10#"), UNREADABLE, ""),
        (SECOND.replace("302#", "XYZ#"), UNREADABLE, ""),
        (SECOND.replace("302#", "302#0"), UNREADABLE, ""),
        (FIRST.replace("#1B", "#GG"), UNREADABLE, ""),
        ("x" * 50_000 + "\n", UNREADABLE, "xxx..."),
        # frames of another kind, of no message, of another length
        (SECOND.replace("302#", "20000080#"), "error frame", "20000080#"),
        (SECOND.replace("302#", "7FE#"), "unknown identifier", "7FE#"),
        (SECOND.replace("302#", "302#00"), "wrong length", "1 bytes of data, expected 0; read all the same"),
        (FIRST.replace("#1B", "#"), "wrong length", "4 bytes of data, expected 5"),
    ],
)
def test_a_defect_affects_only_its_own_line(decoder: Decoder, log: str, damage: str, text: str) -> None:
    decoding = Decoding(decoder, TextOutput())
    before, *wrong, after = decoded(decoding, FIRST + log + THIRD).splitlines(keepends=True)
    assert (before, after) == (TEXT.splitlines(keepends=True)[0], TEXT.splitlines(keepends=True)[2])
    assert len(wrong) == log.count("\n")
    assert all(f"! {damage}: " in line and text in line for line in wrong)
    assert decoding.damage.total == len(wrong)


def test_a_log_that_ends_within_a_line(decoder: Decoder) -> None:
    decoding = Decoding(decoder, TextOutput())
    assert decoded(decoding, REGULAR[:-8]).endswith("! cut off: (1396.013890) vcan1 282\n")
    assert [report.split(" first at ")[1] for report in decoding.damage.report()] == [
        "bus.log:3: (1396.013890) vcan1 282"
    ]


@pytest.mark.parametrize("most", [1, 37, 100_000])
def test_the_pieces_of_a_pipe_do_not_matter(decoder: Decoder, most: int) -> None:
    log = (REGULAR * 30).encode()
    lines = Decoding(decoder, TextOutput()).lines(io.BufferedReader(Pieces(log, most), 64), "-", "log")
    assert "".join(lines) == TEXT * 30


def test_several_logs_have_their_names_before_their_lines(decoder: Decoder) -> None:
    decoding = Decoding(decoder, TextOutput(several=True))
    text = decoded(decoding, SECOND, "one.log") + decoded(decoding, "x\n" + SECOND, "two.log")
    assert [line.split(":")[0] for line in text.splitlines()] == ["one.log", "two.log", "two.log"]
    assert [report.split(" first at ")[1] for report in decoding.damage.report()] == ["two.log:1: x"]


@pytest.mark.parametrize(
    ("window", "shown"),
    [
        (Window(), ["1396.001356", "1396.005961", "1396.013890"]),
        (Window(since=1396.005, until=1396.01), ["1396.005961"]),
        (Window(relative=True), ["0.000000", "0.004605", "0.012534"]),
        (Window(since=0.001, relative=True), ["0.004605", "0.012534"]),
    ],
)
def test_windows_of_time_begin_anew_with_each_log(decoder: Decoder, window: Window, shown: list[str]) -> None:
    decoding = Decoding(decoder, TextOutput(), window=window)
    for _ in range(2):
        assert [line.split()[0] for line in decoded(decoding, REGULAR).splitlines()] == shown


def test_defects_of_unwanted_entries_are_counted(decoder: Decoder) -> None:
    decoding = Decoding(decoder, TextOutput(), by_name(["Move State Request"], decoder))
    assert decoded(decoding, f"{REGULAR}x\n") == TEXT.splitlines(keepends=True)[1]
    assert decoding.damage.total == 1


DECODER = plant.decoder()
PLACE = {"log": 'a "log", 1', "line": 7, "channel": "can,0"}
ENTRIES: list[tuple[Raw, dict[str, Any]]] = [
    (Frame(0x282, b"\xfd\xff\xff"), {"id": "0x282", "data": "FDFFFF", "fields": {"time": None}}),
    (Frame(0x282, b"\xfe\xff\xff"), {"message": "Move State Response", "fields": {"time": "blocked"}}),
    (Frame(0x702, b"\0"), {"message": "Heartbeat", "protocol": "CANopen", "text": "lift, boot-up"}),
    (Frame(0x7FE), {"id": "0x7FE", "text": "7FE#", "damage": [{"kind": "unknown identifier", "text": "7FE#"}]}),
    (Foreign(Damage.FD, "202##1AA"), {"message": "CAN FD, 1 byte", "text": "202##1AA"}),
    (Frame(EXTENDED | 0x10), {"message": "29-bit frame, 0 bytes", "text": "00000010#"}),
]


def line(output: Output, raw: Raw) -> str:
    return output.line_writer('a "log", 1')(7, 1.5, "can,0", output.row(DECODER(raw)))


@pytest.mark.parametrize(("raw", "expected"), ENTRIES)
def test_json(raw: Raw, expected: dict[str, Any]) -> None:
    found = json.loads(line(JsonOutput(), raw))
    assert found | PLACE | {"time": 1.5} | expected == found


@pytest.mark.parametrize(
    ("name", "written"), [("für.log", '"für.log"'), ("a\x9bb", '"a\\u009bb"'), ("a\nb", '"a\\nb"')]
)
def test_json_is_for_people_unless_a_terminal_might_act_on_it(name: str, written: str) -> None:
    output = JsonOutput()
    assert written in output.line_writer(name)(7, 1.5, "can0", output.row(DECODER(Frame(0x182))))


@pytest.mark.parametrize(("raw", "expected"), ENTRIES)
def test_csv(raw: Raw, expected: dict[str, Any]) -> None:
    output = CsvOutput(["x", "time"])
    (found,) = csv.DictReader([output.header, line(output, raw)])
    assert (found["log"], found["line"], found["timestamp"], found["channel"]) == (
        'a "log", 1',
        "7",
        "1.500000",
        "can,0",
    )
    assert found["damage"] == "; ".join(f"{each['kind']}: {each['text']}" for each in expected.get("damage", []))
    assert found["time"] == (expected.get("fields", {}).get("time") or "")
    assert found["x"] == ""


@pytest.mark.parametrize(
    ("written", "confirmed", "frame", "meaning"),
    [
        ("23141000A5000000", "6014100000000000", "0A5#0010010000000000", "EMCY node 5, 0x1000 generic error"),
        ("23051000A0000000", "6005100000000000", "0A0#", "SYNC"),
        ("23121000A1000000", "6012100000000000", "0A1#000000000000", "TIME 1984-01-01"),
        ("23001201A6060000", "6000120100000000", "6A6#4017100000000000", "SDO node 5, read 0x1017:00"),
    ],
)
def test_a_service_that_is_moved_on_the_bus_is_followed_without_a_file(
    written: str, confirmed: str, frame: str, meaning: str
) -> None:
    frames = (f"605#{written}", f"585#{confirmed}", frame, "705#00", frame)
    log = "".join(f"({number}.0) can0 {each}\n" for number, each in enumerate(frames))
    *_, moved, _, back = decoded(Decoding(Decoder(()), TextOutput()), log).splitlines()
    assert " ".join(moved.split()[2:]).startswith(meaning)
    assert not " ".join(back.split()[2:]).startswith(meaning)


SERVO = Decoder([FILE])
WRITTEN = {
    "node": 5,
    "direction": "write",
    "index": "0x1017",
    "subindex": 0,
    "content": "F401",
    "size": 2,
    "value": 500,
}
ABORTED = {"node": 5, "index": "0x6060", "subindex": 0, "abort": "0x06090030"}
ABORTED |= {"abort_name": "Value range of parameter exceeded"}
STRING = {"node": 5, "direction": "read", "index": "0x1008", "subindex": 0}
ERROR = {"node": 5, "code": "0x2312", "register": "0x05", "info": "0000000001"}


@pytest.mark.parametrize(
    ("frames", "fields"),
    [
        (["605#2B171000F4010000"], WRITTEN),
        (["605#2B171000F4010000", "585#6017100000000000"], WRITTEN | {"how": "expedited", "seconds": 0.1}),
        (["585#8060600030000906"], ABORTED),  # of a transfer that began before the log
        (
            ["605#2F60600063000000", "585#8060600030000906"],
            ABORTED | {"direction": "write", "how": "expedited", "seconds": 0.1, "size": 1},
        ),
        (["605#4008100000000000"], STRING),
        (["605#4008100000000000", "585#4108100003000000"], STRING | {"size": 3}),
        (["605#4008100000000000", "585#4108100003000000", "605#6000000000000000"], {"node": 5}),
        (
            ["605#4008100000000000", "585#4108100003000000", "605#6000000000000000", "585#0961626300000000"],
            STRING | {"how": "segmented", "seconds": 0.3, "size": 3, "content": "616263", "value": "abc"},
        ),
        (["605#C6001F01E8030000"], {"node": 5, "direction": "write", "index": "0x1F00", "subindex": 1, "size": 1000}),
        (["605#C6001F01E8030000", "585#A4001F017F000000", "605#4000000000000000"], None),  # a segment, and not a read
        (["605#4018100000000000", "605#4008100000000000"], STRING),  # and not the one that got no answer
        (["085#1223050000000001"], ERROR | {"words": "continuous overcurrent at the output, no. 2"}),
        (["085#122305"], None),  # too short
        (["705#7F"], {"node": 5, "state": "pre-operational"}),
        (["705#R1", "705#85"], {"node": 5, "state": "operational"}),  # guarded
        (["705#R1"], None),
        (["000#8200"], {"node": 0, "command": "reset communication"}),
        (["000#0105"], {"node": 5, "command": "start"}),
    ],
)
def test_services_as_data(frames: list[str], fields: dict[str, Any] | None) -> None:
    log = "".join(f"({number / 10:.6f}) can0 {each}\n" for number, each in enumerate(frames))
    *_, last = decoded(Decoding(SERVO, JsonOutput()), log).splitlines()
    assert json.loads(last).get("fields") == fields
    output = CsvOutput([])
    *_, row = csv.DictReader([output.header, *decoded(Decoding(SERVO, output), log).splitlines()])
    known = {name: text for name, text in row.items() if text and name in SERVICE_FIELDS}
    assert known == {name: str(value) for name, value in (fields or {}).items()}
