"""A bus of several makers' devices with everything that CANopen has: each frame is named, and nothing is damage."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.frame import Frame
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.services import NAMES, SRDO
from tests.traffic.mixed_bus import BLOCK, FILES, dictionaries, log_text, recorded

EDS = [word for node_id, file in FILES.items() for word in ("--eds", f"{node_id}={file}")]


@pytest.fixture(scope="module")
def frames() -> list[tuple[float, Frame]]:
    return recorded()


@pytest.fixture(scope="module")
def meanings(frames: list[tuple[float, Frame]]) -> list[Meaning]:
    following = TrackingDecoder(Decoder(dictionaries()))
    return [following(time, "can0", frame) for time, frame in frames]


def test_every_frame_has_a_name_and_none_is_damage(meanings: list[Meaning]) -> None:
    assert [str(each.raw) for each in meanings if not each.name or each.defects] == []


def test_every_service_is_there(meanings: list[Meaning]) -> None:
    counts = Counter(each.name for each in meanings if each.message is None)
    assert set(counts) == set(NAMES) - {SRDO}
    assert sum(each.message is not None for each in meanings) > 50


def test_transfers_end_as_they_did(meanings: list[Meaning]) -> None:
    ended = [each.transfer for each in meanings if each.transfer]
    assert {each.how for each in ended} == {"expedited", "segmented", "in blocks"}
    assert {each.lost for each in ended} == {0}
    assert {each.aborted for each in ended} >= {None, 0x06020000, 0x06010002, 0x05040000}
    assert sum(each.size == len(BLOCK) and each.how == "in blocks" for each in ended) == 2
    assert sum("CRC" in each.text and "is right" in each.text for each in meanings) > 2


def test_errors_are_said_by_the_devices_profiles(meanings: list[Meaning]) -> None:
    texts = [each.text for each in meanings if each.name == "EMCY"]
    assert any(text.startswith("servo_5, 0x7310 speed, ") for text in texts)
    assert any(text.startswith("crlf_io_module_7, 0x2330 load dump at the outputs, ") for text in texts)


@pytest.fixture
def log(tmp_path: Path, frames: list[tuple[float, Frame]]) -> str:
    file = tmp_path / "mixed.log"
    file.write_text(log_text(frames))
    return str(file)


def test_a_strict_decode_of_its_log_finds_nothing(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", "--strict", *EDS, log]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.count("\n") == len(Path(log).read_text().splitlines())


def test_statistics_count_its_transfers(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", "--statistics", *EDS, log]) == 0
    out = capsys.readouterr().out
    assert "SDO transfers: 22 reads, 17 writes; " in out
    assert " x abort 0x06020000 Object does not exist\n" in out
    assert "  longest: 0x1F22:01 Concise DCF" in out


def test_a_makers_words_go_before_the_profiles(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = tmp_path / "maker.yaml"
    words.write_text("0x7310: speed beyond what the motor bears\n")
    assert cli.main(["decode", "--message", "EMCY", *EDS, "--emcy", f"5={words}", log]) == 0
    assert "servo, 0x7310 speed beyond what the motor bears, " in capsys.readouterr().out
    assert cli.main(["decode", "--message", "EMCY", *EDS, "--emcy", f"6={words}", log]) == 0
    assert "servo, 0x7310 speed, " in capsys.readouterr().out
