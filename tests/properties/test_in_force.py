"""Text, single frames and a season say the same of random traffic in which masters change what is in force."""

from __future__ import annotations

import io
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl
from hypothesis import example, given, settings
from hypothesis import strategies as st

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import NOTHING, plain
from eurobot_od.season.archive import Archiver, DecodedNetwork
from eurobot_od.season.season import SCHEMAS, Season
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import Decoding, TextOutput, TrackingDecoder
from eurobot_od.traffic.meaning import Decoder, Meaning

SERVO = Dictionary.load(Path("docs/servo.eds"), 1)
NODES = st.sampled_from([1, 1, 1, 7])
ENTRIES = st.sampled_from([0x606C0020, 0x60410010, 0x60610008, 0x29990110, 0x60770010, 0x00050008])
PDOS = st.sampled_from([(0x1800, 0x181), (0x1801, 0x281), (0x1804, 0x1F1)])


def access(node: int, index: int, sub: int, value: int, size: int, way: str) -> list[str]:
    """Return frames of an expedited transfer: written, read, refused, or one of its two frames alone."""
    place, data = (index.to_bytes(2, "little") + bytes([sub])).hex(), value.to_bytes(4, "little").hex()
    short = 4 - size << 2
    request, answer = f"{0x600 + node:03X}#{0x23 | short:02X}{place}{data}", f"{0x580 + node:03X}#60{place}00000000"
    if way == "read":
        request, answer = f"{0x600 + node:03X}#40{place}00000000", f"{0x580 + node:03X}#{0x43 | short:02X}{place}{data}"
    if way == "refused":
        answer = f"{0x580 + node:03X}#80{place}22000008"
    both = {"request": [request], "answer": [answer]}
    return both.get(way, [request, answer])


@st.composite
def remaps(draw: Any) -> list[str]:
    """Return a mapping as a master does it, of which the log may lack, or the device refuse, anything."""
    node, (index, cob_id) = draw(NODES), draw(PDOS)
    entries, record = draw(st.lists(ENTRIES, max_size=3)), index + 0x200
    steps = [(index, 1, 1 << 31 | cob_id, 4), (record, 0, 0, 1)]
    steps += [(record, sub, entry, 4) for sub, entry in enumerate(entries, 1)]
    steps += [(record, 0, len(entries), 1), (index, 1, cob_id, 4)]
    way = st.sampled_from(["written"] * 8 + ["request", "answer", "refused", "read"])
    return [frame for each in steps for frame in access(node, *each, draw(way))]


@st.composite
def frames_of_pdos(draw: Any) -> list[str]:
    (_, cob_id), data = draw(PDOS), draw(st.binary(max_size=8))
    return [f"{cob_id:03X}#{data.hex()}"] * draw(st.integers(1, 3))


SECOND_SERVER = [*access(1, 0x1201, 1, 0x641, 4, "written"), *access(1, 0x1201, 2, 0x5C1, 4, "written")]
BY_IT = [each.replace("601#", "641#").replace("581#", "5C1#") for each in access(1, 0x1A00, 0, 1, 1, "written")]
OTHERS = st.sampled_from(
    [
        ["701#00"],
        ["701#05"],
        ["701#85"],
        ["707#00"],
        ["000#8201"],
        ["000#8200"],
        ["080#"],
        ["181#R6"],
        ["601#2310100173617665", "581#6010100100000000"],
        SECOND_SERVER,
        BY_IT,
        ["641#4017100000000000", "5C1#4B171000E8030000"],
    ]
)
TRAFFIC = st.lists(
    st.tuples(st.sampled_from("aab"), st.one_of(remaps(), frames_of_pdos(), frames_of_pdos(), OTHERS)), max_size=12
)


def log_of(traffic: list[tuple[str, list[str]]]) -> bytes:
    frames = [("a", "7F5#00"), *((channel, frame) for channel, frames in traffic for frame in frames)]
    return "".join(f"({n / 8:.6f}) {channel} {frame.upper()}\n" for n, (channel, frame) in enumerate(frames)).encode()


def one_by_one(log: bytes) -> list[tuple[int, float, str, Meaning]]:
    following = TrackingDecoder(Decoder([SERVO]))
    entries = formats.read(io.BytesIO(log), "log")
    return [(n, time, channel, following(time, channel, raw, n)) for n, time, channel, raw in entries]


@example([("a", SECOND_SERVER), ("a", BY_IT), ("a", ["181#3702"]), ("b", ["181#3702"])])
@given(TRAFFIC)
def test_frames_decoded_together_say_what_each_says_by_itself(traffic: list[tuple[str, list[str]]]) -> None:
    output, log = TextOutput(), log_of(traffic)
    write = output.line_writer("x")
    expected = "".join(write(n, time, channel, output.row(meaning)) for n, time, channel, meaning in one_by_one(log))
    assert "".join(Decoding(Decoder([SERVO]), TextOutput()).lines(io.BytesIO(log), "x", "log")) == expected


def rows_of(season: Season) -> dict[int, dict[str, Any]]:
    """Return the columns of each line that is in a message's table."""
    found: dict[int, dict[str, Any]] = {}
    for table in season.files.keys() - SCHEMAS.keys():
        for row in season.frames(table).collect().iter_rows(named=True):
            found[row["line"]] = row
    return found


def defects_of(season: Season) -> set[tuple[int, str, str]]:
    return set(season.frames("damage").select(pl.col("line"), pl.col("kind").cast(pl.String), "text").collect().rows())


@example([("a", SECOND_SERVER), ("a", BY_IT), ("a", ["181#3702"]), ("b", ["181#3702"])])
@given(TRAFFIC)
@settings(max_examples=settings().max_examples // 4)
def test_a_season_has_the_values_and_the_damage_of_single_frames(traffic: list[tuple[str, list[str]]]) -> None:
    log = log_of(traffic)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "x.log"
        file.write_bytes(log)
        Archiver(Path(folder) / "season", DecodedNetwork((SERVO,), NOTHING))(file)
        season = Season.open(Path(folder) / "season")
        rows, damage = rows_of(season), defects_of(season)
    single = one_by_one(log)
    expected = {line: plain(meaning.message) for line, _, _, meaning in single if meaning.message is not None}
    assert rows.keys() == expected.keys()
    for line, fields in expected.items():
        values = {field: None if rows[line].get(f"{field}_flag") else value for field, value in fields.items()}
        assert {field: rows[line][field] for field in fields} == values, line
        assert {field for field, value in fields.items() if value is None} == {
            field for field in fields if rows[line].get(f"{field}_flag") == "unknown"
        }
    assert damage == {(n, each.damage.value, each.text) for n, _, _, meaning in single for each in meaning.defects}
