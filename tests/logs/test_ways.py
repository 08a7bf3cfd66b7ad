"""The short ways from a log to text (tables, many lines at once) give what the long way gives, to the byte."""

from __future__ import annotations

import io
import random
from collections.abc import Iterator

import pytest

from eurobot_od.logs import bulk, formats
from eurobot_od.logs.batch import Batches
from eurobot_od.logs.decoding import Decoding
from eurobot_od.logs.filters import Window
from eurobot_od.logs.meaning import Decoder
from eurobot_od.logs.output import Text, TextOfSeveral, showing, written
from eurobot_od.logs.rows import MARK, from_tables, rows_of
from eurobot_od.logs.statistics import Tally
from eurobot_od.pdo.protocol import Binding, Protocol
from eurobot_od.robot import dialects

FRAMES = 3_000
HEARTBEAT, SDO = "701#05", "582#4B18100300000200"


class Blocks(io.BytesIO):
    """A file that gives few bytes at a time, as a pipe does."""

    def __init__(self, content: bytes, most: int) -> None:
        super().__init__(content)
        self._most = most

    def read1(self, size: int | None = -1) -> bytes:
        return super().read1(min(size or 0, self._most))


def way(decoder: Decoder, log: bytes, output: Text, name: str) -> tuple[str, list[str]]:
    """Give the text of a log by one of the ways, and the report on what is wrong in it."""
    tally, show = Tally(), showing(decoder, None, output)
    entries = formats.read(io.BytesIO(log), "log")
    if name == "long":
        text = "".join(written(entries, show, "x", output, tally))
    elif name == "batches":
        rows = rows_of(decoder.protocol, output)
        text = "".join(Batches(rows, show, output, "x", tally, float).texts(entries))
    else:
        decoding = Decoding(decoder, output)
        text, tally = "".join(decoding.texts(Blocks(log, int(name)), "x", "log")), decoding.tally
    return text, list(tally.report())


def random_lines(protocol: Protocol) -> Iterator[str]:
    """Yield lines with regular frames, spoilt ones, and some that are no frames of the protocol."""
    chance = random.Random(7)
    for number in range(FRAMES):
        binding = chance.choice(protocol.bindings)
        data = chance.choice((regular, random_bits, unknown, short))(binding, chance)
        identifier = f"{binding.cob_id:03X}" if chance.random() < 0.9 else f"{chance.getrandbits(11):03x}"
        text = f"({number / 7:.6f}) can{number % 2} {identifier}#{data.hex()}"
        yield text[: chance.choice((None, None, None, -1))] + "\n"


def regular(binding: Binding, chance: random.Random) -> bytes:
    return binding.pack({field: chance.randint(*limits) for field, limits in binding.limits.items()})


def random_bits(binding: Binding, chance: random.Random) -> bytes:
    return chance.randbytes(binding.layout.length)


def unknown(binding: Binding, chance: random.Random) -> bytes:
    values = {field: getattr(kind, "UNKNOWN", 0) for field, kind in binding.kinds.items() if field in binding.limits}
    return binding.pack(values | {field: chance.choice((0, value)) for field, value in values.items()})


def short(_: Binding, chance: random.Random) -> bytes:
    return bytes(chance.randint(0, 8))


@pytest.mark.parametrize("dialect", dialects.names())
@pytest.mark.parametrize("output", [Text(), TextOfSeveral()], ids=["one log", "several"])
def test_all_ways_write_and_count_the_same(dialect: str, output: Text) -> None:
    decoder = Decoder(dialects.outlines(dialect))
    log = "".join(random_lines(decoder.protocol)).encode()
    expected = way(decoder, log, output, "long")
    assert expected[0].count("\n") == FRAMES
    for name in ("batches", "100", "5000", "1000000"):
        assert way(decoder, log, output, name) == expected


REGULAR = "(1396.001356) can0 180#1B796C2008\n(1396.005961) can0 010#\n(1396.013890) vcan1 014#730903\n" * 30


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        (REGULAR, "all regular"),
        ("", "nothing"),
        ("\n", "an empty line"),
        (REGULAR + "\n" + REGULAR, "an empty line between regular ones"),
        (REGULAR[:-1], "no end of the last line"),
        (REGULAR[:-5], "cut off in the last line"),
        (REGULAR.replace("\n", " R\n"), "the direction, as python-can writes it"),
        (REGULAR.replace("\n", " T\n", 5), "a direction at some of them"),
        (REGULAR.replace("\n", "\r\n"), "line ends of Windows"),
        (REGULAR.replace(" ", "  "), "more space"),
        (REGULAR.replace(" ", "\t"), "other space"),
        (REGULAR.replace(" can0", "\x1ccan0"), "space for str, not for bytes"),
        (REGULAR.replace("#", " #"), "space before the data"),
        (REGULAR.replace(" can0 010#", "#can0 010 "), "a # elsewhere"),
        (REGULAR.replace(" 010#", "#010"), "a # before the identifier"),
        (REGULAR.replace("can0", "ca(0"), "a bracket in a channel"),
        (REGULAR.replace("can0", "c#n0"), "a # in a channel"),
        (REGULAR.replace("can0", "cän0"), "letters beyond ASCII"),
        (REGULAR.replace("can0", "c\0n0"), "the very mark that the tables use"),
        (REGULAR.replace("\n", " ", 1) + "\n", "a lost line end, and an empty line"),
        (REGULAR.replace(" can0", "\ncan0", 1).replace("\n(", " (", 1), "a line end elsewhere"),
        (REGULAR.replace("180#", f"{HEARTBEAT}\n(1396.001400) can0 180#"), "services"),
        (REGULAR.replace("180#", f"{SDO}\n(1396.001400) can0 180#"), "services with objects' names"),
        (REGULAR.replace("010#", "010#R"), "remote frames"),
        (REGULAR.replace("010#", "010##1"), "FD frames"),
        (REGULAR.replace("010#", "20000080#"), "error frames"),
        (REGULAR.replace("010#", "00000010#"), "extended frames"),
        (REGULAR.replace("010#", "XYZ#"), "no identifier"),
        (REGULAR.replace("010#", "7FE#"), "an unknown identifier"),
        (REGULAR.replace("010#", "010#0"), "half a byte"),
        (REGULAR.replace("010#", "010#00"), "too long"),
        (REGULAR.replace("180#1B", "180#"), "too short"),
        (REGULAR.replace("180#1B796C2008", "180#GG796C2008"), "no data"),
        (REGULAR.replace("180#1B796C2008", "180#1b796c2008"), "small letters"),
        (REGULAR.replace("180#", "c0#"), "an identifier of two digits"),
        (REGULAR.replace("1396.", "999."), "fewer digits"),
        (REGULAR.replace("1396.005961", "0.5"), "a time in another form"),
        (REGULAR.replace("1396.", "0001396."), "zeros before a time"),
        (REGULAR.replace("1396.", "0."), "one zero before the point"),
        (REGULAR.replace("1396.", "1700000000."), "seconds since 1970"),
        (REGULAR.replace("1396.", "8700000000."), "more digits than a float tells apart"),
        (REGULAR.replace("1396.", "99999999999."), "the latest time that is read"),
        (REGULAR.replace("1396.", "100000000000."), "later than that"),
        (REGULAR.replace("1396.", "-396."), "a time before the start"),
        (REGULAR.replace("(1396.005961)", "1396.005961"), "no brackets"),
        (REGULAR.replace("(1396.005961)", "((1396.005961)"), "too many brackets"),
        ("(1.5)(1396.123456) can0 180#1B796C2008\n", "two times in one word"),
        ("(1.5396.123456) can0 180#1B796C2008\n", "two points in a time"),
        (REGULAR.replace("(1396.005961)", "(1396.00596)").replace("013890", "0138900"), "decimals in another number"),
        ("x" * 5000 + "\n" + REGULAR, "a long line at the beginning"),
        (REGULAR + "x" * 50_000 + "\n", "a very long line at the end"),
    ],
)
@pytest.mark.parametrize("name", ["37", "100000", "batches"])
def test_what_is_not_regular_is_read_as_ever(log: str, reason: str, name: str) -> None:
    decoder, content = Decoder(dialects.outlines(dialects.DEFAULT)), log.encode()
    assert way(decoder, content, Text(), name) == way(decoder, content, Text(), "long"), reason


def test_a_regular_piece_does_not_go_the_long_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(bulk, "read_lines")
    decoder = Decoder(dialects.outlines(dialects.DEFAULT))
    text, report = way(decoder, REGULAR.encode(), Text(), "100000")
    assert text.count("\n") == REGULAR.count("\n")
    assert report == []


@pytest.mark.parametrize("dialect", dialects.names())
def test_regular_frames_are_in_the_tables(dialect: str) -> None:
    protocol, chance = Protocol.load(dialect), random.Random(1)
    rows = rows_of(protocol, Text())
    for binding in protocol.bindings:
        values = {field: chance.randint(limits.low, min(limits.high, 300)) for field, limits in binding.limits.items()}
        (row,) = rows[binding.cob_id].of_data([binding.pack(values)])
        assert row.startswith(binding.name)
        assert MARK not in row


@pytest.mark.parametrize(
    ("cob_id", "data", "reason"),
    [
        (0x008, "", "too short"),
        (0x008, "D27423592C0D9702FF", "too long"),
        (0x00C, "00", "data where there is none"),
        (0x008, "FFFFFFFFFFFFFFFF", "out of range"),
        (0x014, "FFFF0F", "a time that is unknown"),
        (0x400, "FFF00FFF03", "a position that is unknown"),
        (0x7FE, "", "an unknown identifier"),
    ],
)
def test_other_frames_are_left_to_the_long_way(cob_id: int, data: str, reason: str) -> None:
    rows = rows_of(Protocol.load(dialects.DEFAULT), Text())
    (row,) = from_tables({key: each.of_hex for key, each in rows.items()}, [cob_id], [f"#{data}"])
    assert MARK in row, reason
    (row,) = from_tables({key: each.of_data for key, each in rows.items()}, [cob_id], [bytes.fromhex(data)])
    assert MARK in row, reason


@pytest.mark.parametrize("dialect", dialects.names())
def test_a_time_window_is_heeded_in_batches(dialect: str) -> None:
    decoder = Decoder(dialects.outlines(dialect))
    log = "".join(random_lines(decoder.protocol)).encode()
    window, tally = Window(since=10.0, until=50.0, relative=True), Tally()
    show, entries = showing(decoder, None, Text()), formats.read(io.BytesIO(log), "log")
    expected = "".join(written(entries, show, "x", Text(), tally, window.clock()))
    decoding = Decoding(decoder, Text(), None, window)
    assert "".join(decoding.texts(io.BytesIO(log), "x", "log")) == expected != ""
    assert list(decoding.tally.report()) == list(tally.report())
