"""Dialects: the folders of `eds/`, how one is named, and what a new one takes."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.errors import DictionaryError, UnknownName
from eurobot_od.od import DIALECT_VARIABLE
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import GotoXY, KalmanPositionResponse
from eurobot_od.robot.model.values import Barriers, Direction, Source
from eurobot_od.robot.protocol import EurobotProtocol, decoder
from tests.robot.document import NAMES

ROOT = Path(__file__).parents[2]
EDS = ROOT / "eds"

# Other identifiers, other widths, other bit orders, and a field of the newer kind: as foreign as a dialect can be.
MADE_UP = """\
  made_up:
    revision_number: 0x00040000
    fields:
      Goto XY:
        Direction: {bits: 3, range: [0, 1], codes: {forward: 0, backward: 1}, default: forward}
    widths:
      Goto XY: {Speed: 7, Angle: 9}
      Kalman position: {X position: 14}
    most_significant_first: [Goto state, Kalman position]
"""


@pytest.fixture
def made_up(tmp_path: Path) -> Path:
    """The folder of a made-up dialect; it differs from the others in `protocol.yaml` and in nothing else."""
    source = tmp_path / "eds" / "protocol.yaml"
    source.parent.mkdir()
    table = (EDS / "protocol.yaml").read_text() + MADE_UP
    source.write_text(re.sub(r"identifier: (0x[0-9A-F]{3})", lambda m: f"identifier: {int(m[1], 0) + 0x20:#x}", table))
    assert cli.main(["make-eds", str(source), "-o", str(source.parent)]) == 0
    return source.parent / "made_up"


def test_names_are_those_of_the_folders() -> None:
    assert dialects.names() == sorted(path.name for path in EDS.iterdir() if path.is_dir())
    assert dialects.DEFAULT in dialects.names()


@pytest.mark.parametrize("dialect", dialects.names())
def test_the_decoder_of_a_dialect_reads_its_bits(dialect: str) -> None:
    goto = GotoXY(1234, 567, 89, 75)
    assert decoder(dialect).protocol.decode(*EurobotProtocol.load(dialect).encode(goto)) == goto


def test_default_is_the_one_of_the_standard(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DIALECT_VARIABLE, raising=False)
    assert dialects.folder() == EDS / "canopen"


@pytest.mark.parametrize("name", dialects.names())
def test_dialect_is_named_by_caller_or_environment(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(DIALECT_VARIABLE, name)
    assert dialects.folder() == EDS / name
    monkeypatch.setenv(DIALECT_VARIABLE, "nothing")
    assert dialects.folder(name) == EDS / name
    assert dialects.folder(EDS / name) == EDS / name
    assert dialects.folder(str(EDS / name)) == EDS / name


@pytest.mark.parametrize("name", ["canopne", "protocol.yaml", ".", "/nowhere"])
def test_unknown_dialect_is_told_with_the_known_ones(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownName, match=r"canopen"):
        dialects.folder(name)


def test_unknown_dialect_in_the_environment_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(DIALECT_VARIABLE, "nothing")
    with pytest.raises(UnknownName, match="unknown dialect 'nothing'"):
        dialects.load("drive")


def test_loads_a_node_by_its_name() -> None:
    drive = dialects.load("drive", node_id=9)
    assert (drive.name, drive.node_id) == ("drive", 9)


@pytest.mark.parametrize("node", ["wheel", "", "drive.eds"])
def test_unknown_node_is_told_with_the_known_ones(node: str) -> None:
    with pytest.raises(UnknownName, match=r"unknown node .* core, drive, navigation"):
        dialects.load(node)


def test_loads_all_nodes_by_node_id() -> None:
    assert [each.name for each in dialects.load_all()] == ["core", "drive", "navigation"]


def test_two_files_with_one_node_id_are_refused(spoil_eds: Callable[..., Path]) -> None:
    folder = spoil_eds(("navigation", "2100sub1", "DefaultValue", "2"))
    with pytest.raises(DictionaryError) as error:
        dialects.load_all(folder)
    assert str(error.value) == f"{folder / 'navigation.eds'}: node-ID 2 is taken by drive.eds"


def test_a_new_dialect_needs_no_python(made_up: Path) -> None:
    protocol = EurobotProtocol.load(made_up)
    assert protocol.cob_id(GotoXY) == 0x028
    assert protocol.binding(GotoXY).layout.widths == {
        "x": 12,
        "y": 12,
        "angle": 9,
        "speed": 7,
        "barriers": 16,
        "direction": 3,
    }
    goto = GotoXY(3000, 2000, 359, 100, Barriers(0xA5C3), Direction.BACKWARD)
    assert protocol.decode(*protocol.encode(goto)) == goto
    place = KalmanPositionResponse(0x123, 0x456, 0x079, Source.ENEMY_1)
    assert protocol.encode(place).data == (0x123 << 26 | 0x456 << 14 | 0x079 << 4 | 2).to_bytes(5, "big")
    assert protocol.decode(*protocol.encode(place)) == place


@pytest.mark.long
def test_a_new_dialect_is_found_and_plays_a_match(made_up: Path) -> None:
    shutil.copytree(
        ROOT / "eurobot_od", made_up.parents[1] / "eurobot_od", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copy(dialects.eds_folder() / "robot.yaml", made_up.parent)
    command = [sys.executable, "-m", "eurobot_od", "match", "--dialect", "made_up", "--for", "4", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=made_up.parents[1])
    assert (done.returncode, done.stderr) == (0, "")
    match = json.loads(done.stdout)
    assert match["timeline"][0]["text"].endswith("EDS files: made_up")
    assert [name for name in NAMES if not match["summary"]["frames"][name]] == ["Emergency Shutdown"]
