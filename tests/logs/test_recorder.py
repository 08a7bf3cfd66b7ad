"""Log files: every frame given is in the file, in every format, and an old file is replaced."""

from __future__ import annotations

from pathlib import Path

import can
import pytest
from can.io.logger import MESSAGE_WRITERS

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.logs.recorder import recording

FORMATS = sorted(set(MESSAGE_WRITERS) - {".mf4"})  # .mf4 needs a package of its own
MANY = [(number / 100, Frame(number % 0x700, bytes([number % 256] * (number % 9)))) for number in range(3000)]
"""More frames than any writer keeps before it writes."""


def record(file: Path | None, frames: list[tuple[float, Frame]]) -> None:
    with recording(file) as write:
        for time, frame in frames:
            write(time, frame)


def recorded(file: Path) -> list[Frame]:
    """Read a log with python-can, which reads all it writes but text."""
    with can.LogReader(file) as reader:
        return [Frame(message.arbitration_id, bytes(message.data)) for message in reader]


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_frame_is_in_the_file(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"match{suffix}"
    record(file, MANY)
    if suffix == ".txt":
        assert len(file.read_text().splitlines()) == len(MANY)
    else:
        assert recorded(file) == [frame for _, frame in MANY]


@pytest.mark.parametrize("suffix", sorted(set(FORMATS) - {".txt"}))
def test_an_old_file_is_replaced(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"match{suffix}"
    for frames in (MANY[:20], MANY[5:8]):
        record(file, frames)
    assert recorded(file) == [frame for _, frame in MANY[5:8]]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_missing_folder_is_an_error(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(FileNotFoundError):
        record(tmp_path / "missing" / f"match{suffix}", [])


@pytest.mark.parametrize("name", ["match.md", "match", "match.mf4.md", "match.gz"])
def test_an_unknown_format_is_an_error_and_touches_nothing(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.write_text("precious")
    with pytest.raises(LocalError, match=f"{name}: "):
        record(file, [])
    assert file.read_text() == "precious"


def test_times_are_those_given(tmp_path: Path) -> None:
    file = tmp_path / "match.log"
    record(file, [(0.000256, Frame(0x701, b"\0")), (93.25, Frame(0x004))])
    assert [line.split()[0] for line in file.read_text().splitlines()] == ["(0.000256)", "(93.250000)"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_frames_that_the_database_did_not_take_are_an_error(tmp_path: Path) -> None:
    file = tmp_path / "match.db"
    with pytest.raises(OSError, match="frames could not be written"), recording(file) as write:
        write(0.0, Frame(0x7FFF_FFFF_FFFF_FFFF_FF))  # no identifier, and no number that SQLite takes


def test_without_a_file_nothing_is_written() -> None:
    record(None, MANY[:1])


def test_an_error_while_recording_comes_out_and_the_file_is_closed(tmp_path: Path) -> None:
    file = tmp_path / "match.log"

    def give_up() -> None:
        with recording(file) as write:
            write(*MANY[1])
            raise LocalError("the match was given up")

    with pytest.raises(LocalError, match="given up"):
        give_up()
    assert recorded(file) == [MANY[1][1]]
