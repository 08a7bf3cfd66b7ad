"""Words that the network file names once: `emcy:` for error codes, `dbc:` for frames of other protocols."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.console import run
from tests.kit.library import device_text, library_of

ALONE = "--robot", "none"
DBC = 'BO_ 291 Lights: 2 Body\n SG_ Brightness : 0|8@1+ (0.5,0) [0|100] "%" Vector__XXX\n'
LOG = "(1.0) can0 123#C800\n(2.0) can0 085#0073810000000000\n(3.0) can0 086#0073810000000000\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a log, two files of words, and a device's file."""
    (tmp_path / "run.log").write_text(LOG)
    (tmp_path / "other.log").write_text("(1.0) can0 123#6400\n")
    library_of(tmp_path / "words", motor=device_text())
    (tmp_path / "words" / "engine.dbc").write_text(DBC)
    (tmp_path / "words" / "all.yaml").write_text("0x7300: any encoder\n")
    (tmp_path / "words" / "five.yaml").write_text("0x7300: encoder of the lift\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


ALL = "emcy: all.yaml\nlibrary: .\n"
FIVE = "nodes: {lift: {file: motor.eds, node_id: 5, emcy: five.yaml}}\nemcy: [all.yaml]\n"

EMCY = [
    (ALL, [], "any encoder", "any encoder"),
    (FIVE, [], "encoder of the lift", "any encoder"),
    (FIVE, ["--emcy", "6=words/five.yaml"], "encoder of the lift", "encoder of the lift"),
    (ALL, ["--emcy", "words/five.yaml"], "encoder of the lift", "encoder of the lift"),  # what is typed wins
]


@pytest.mark.parametrize(("network", "words", "of_five", "of_six"), EMCY)
def test_error_codes_of_a_network_are_named_once(
    capsys: pytest.CaptureFixture[str], network: str, words: list[str], of_five: str, of_six: str
) -> None:
    Path("words/net.yaml").write_text(network)
    said = run(capsys, "decode", "run.log", "--network", "words/net.yaml", *words, *ALONE)
    _, five, six = said.out.splitlines()
    assert of_five in five
    assert of_six in six


# A command, and what it prints of a frame that only the DBC names.
OF_DBC = [
    (["decode", "run.log"], "Lights                        Brightness=100.0 %"),
    (["monitor", "--plain", "--speed", "max", "run.log"], "Brightness=100.0 %"),
    (["compare", "run.log", "other.log"], "Lights"),
    (["diagnose", "run.log", "--json"], "verdict"),
    (["export", "mcap", "run.log", "-o", "run.mcap"], "run.mcap: "),
]


@pytest.mark.parametrize(("words", "printed"), OF_DBC)
@pytest.mark.parametrize("way", ["typed", "network file", "file of the folder"])
def test_frames_of_other_protocols_are_named_once(
    capsys: pytest.CaptureFixture[str], way: str, words: list[str], printed: str
) -> None:
    pytest.importorskip("cantools")
    pytest.importorskip("mcap")
    Path("words/net.yaml").write_text("library: .\ndbc: engine.dbc\n")
    options = {"typed": ["--dbc", "words/engine.dbc"], "network file": ["--network", "words/net.yaml"]}
    if way == "file of the folder":
        Path("eurobot-od.yaml").write_text("library: words\ndbc: words/engine.dbc\n")
    said = run(capsys, *words, *options.get(way, []), *ALONE)
    assert printed in said.out
    assert "unknown identifier" not in said.err
    if "mcap" in words:
        assert b"/Lights" in Path("run.mcap").read_bytes()


def test_a_file_of_words_that_is_not_there_is_told_with_its_place(capsys: pytest.CaptureFixture[str]) -> None:
    Path("words/net.yaml").write_text("library: .\nemcy: nowhere.yaml\n")
    said = run(capsys, "decode", "run.log", "--network", "words/net.yaml", *ALONE)
    line = f"eurobot-od: {Path('words/nowhere.yaml')}: No such file or directory; in this folder: "
    assert said.status == 2
    assert said.err.startswith(line)


UNITS = """
nodes:
  lift:
    file: motor.eds
    node_id: 5
    units: {Speed: {unit: mm/s, factor: 0.5}, Speed limit: mm/s}
    words: {Speed: {0: at rest}}
"""


@pytest.mark.parametrize(("data", "said"), [("C800", "speed=100 mm/s"), ("0000", "at rest")])
def test_units_and_words_of_a_node_stand_in_the_network_file(
    capsys: pytest.CaptureFixture[str], data: str, said: str
) -> None:
    Path("words/net.yaml").write_text(UNITS)
    Path("speed.log").write_text(f"(1.0) can0 185#{data}\n")
    assert said in run(capsys, "decode", "speed.log", "--network", "words/net.yaml", *ALONE).out


def test_words_of_an_object_that_the_device_lacks_are_one_warning(capsys: pytest.CaptureFixture[str]) -> None:
    Path("words/net.yaml").write_text(UNITS.replace("words: {Speed:", "words: {Sped:"))
    said = run(capsys, "decode", "run.log", "--network", "words/net.yaml", *ALONE)
    assert said.status == 0
    assert said.err.count("Sped") == 1
    assert "network file:7: " in said.err


def test_a_node_has_a_file_or_a_node_id(capsys: pytest.CaptureFixture[str]) -> None:
    Path("words/net.yaml").write_text("nodes: {lift: {units: {Speed: rpm}}}\n")
    said = run(capsys, "decode", "run.log", "--network", "words/net.yaml", *ALONE)
    assert said.status == 2
    assert said.complaint == "eurobot-od: words/net.yaml: node lift has neither `file` nor `node_id`"
