"""Laws of reading logs: nothing raises, nothing is lost, and every form of reading gives the same frames."""

from __future__ import annotations

import io
from functools import cache
from pathlib import Path

import can
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from eurobot_od.errors import FrameLengthError, UnknownIdentifier
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import flagged_fields
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import CsvOutput, Decoding, JsonOutput, Output, TextOutput
from eurobot_od.traffic.entries import Damage, Foreign, Raw, shortened
from eurobot_od.traffic.meaning import Decoder
from tests.kit import lift

FRAMES = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))
LINES = st.binary(max_size=80).map(lambda line: line.replace(b"\n", b""))
WORDS = st.sampled_from(
    ["(1.000000)", "(1.5)", "can0", "108", "#", "00", "205#1B796C2008", "10C#", " ", "\n", "(", ")", "R"]
)
LOGS = st.lists(
    st.one_of(
        FRAMES.map(lambda frame: f"(1396.123456) can0 {frame}\n"),
        st.just("(1396.123456) can0 205#1B796C2008\n"),
        WORDS,
    ),
    max_size=12,
).map("".join)


@cache
def decoder(dialect: str) -> Decoder:
    return Decoder(lift.dictionaries(dialect), lift.CATALOGUE)


def read(content: bytes, form: str) -> list[Raw]:
    return [raw for *_, raw in formats.read(io.BytesIO(content), form)]


@pytest.mark.parametrize("form", sorted(formats.FORMATS.keys() - formats.BY_NAME))
@given(content=st.binary(max_size=400))
@example(content=b"\0\t\r\0")
def test_any_bytes_are_read_without_an_error(form: str, content: bytes) -> None:
    assert all(isinstance(raw, (Frame, Foreign)) for raw in read(content, form))


@given(st.lists(LINES))
def test_every_line_of_a_candump_log_is_an_entry_unless_it_is_empty_or_a_comment(lines: list[bytes]) -> None:
    entries = formats.read(io.BytesIO(b"\n".join(lines)), "log")
    assert [line for line, *_ in entries] == [
        n for n, line in enumerate(lines, 1) if line.strip() and not line.strip().startswith(b"#")
    ]


@given(log=LOGS)
def test_every_entry_is_a_line_of_text_and_damage_is_counted(log: str) -> None:
    log = f"(0.5) can0 700#00\n{log}"  # without a frame that can be read a log is refused
    decoding = Decoding(decoder(lift.DIALECT), TextOutput())
    lines = "".join(decoding.lines(io.BytesIO(log.encode()), "x", "log")).splitlines()
    assert len(lines) == sum(1 for line in log.split("\n") if line.strip() and line.strip()[0] != "#")
    assert decoding.damage.total >= sum("! " in line for line in lines)


@given(st.lists(FRAMES))
def test_a_candump_log_gives_the_frames_that_were_written(frames: list[Frame]) -> None:
    text = "".join(f"({n}.5) can0 {frame}\n" for n, frame in enumerate(frames))
    assert read(text.encode(), "log") == frames


@pytest.mark.parametrize("form", ["log", "asc", "csv", "trc", "blf"])
@given(frames=st.lists(FRAMES, min_size=1, max_size=8))
def test_logs_written_by_python_can_are_read_unchanged(
    tmp_path_factory: pytest.TempPathFactory, form: str, frames: list[Frame]
) -> None:
    file = Path(tmp_path_factory.getbasetemp()) / f"written.{form}"
    with can.Logger(file) as logger:
        for n, (cob_id, data) in enumerate(frames):
            logger(can.Message(timestamp=float(n), arbitration_id=cob_id, data=data, is_extended_id=False))
    assert read(file.read_bytes(), form) == frames


@given(frames=st.lists(FRAMES, min_size=1, max_size=8), cut=st.integers(0, 400))
def test_a_blf_file_that_is_cut_off_gives_a_beginning_of_its_frames(
    tmp_path_factory: pytest.TempPathFactory, frames: list[Frame], cut: int
) -> None:
    file = Path(tmp_path_factory.getbasetemp()) / "cut.blf"
    with can.Logger(file) as logger:
        for cob_id, data in frames:
            logger(can.Message(timestamp=1.0, arbitration_id=cob_id, data=data, is_extended_id=False))
    found = [raw for raw in read(file.read_bytes()[:cut], "blf") if isinstance(raw, Frame)]
    assert found == frames[: len(found)]


@pytest.mark.parametrize("dialect", [lift.DIALECT, lift.REVERSED])
@given(frame=FRAMES)
def test_any_frame_has_a_meaning_and_it_is_the_protocols(dialect: str, frame: Frame) -> None:
    decode = decoder(dialect)
    meaning = decode(frame)
    try:
        message = decode.protocol.decode(*frame)
    except (UnknownIdentifier, FrameLengthError):
        assert meaning.message is None
    else:
        assert meaning.message == message
        assert bool(meaning.defects) >= bool(flagged_fields(message))


@pytest.mark.parametrize(
    "output",
    [TextOutput(), JsonOutput(), CsvOutput(["height", "time", "building"])],
    ids=lambda each: type(each).__name__,
)
@given(raw=st.one_of(FRAMES, st.builds(Foreign, st.sampled_from(list(Damage)), st.text().map(shortened))))
def test_any_meaning_is_one_line(output: Output, raw: Raw) -> None:
    row = output.row(decoder(lift.DIALECT)(raw))
    assert output.line_writer("bus.log")(1, 2.0, "can0", row).splitlines(keepends=True)[1:] == []
