"""`--dbc` and `--emcy`, and `dbc:` and `emcy:` of the network file, for every command that decodes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import FrameNames
from tests.cli.console import run
from tests.kit.devices import MOTOR

pytest.importorskip("cantools")
pytest.importorskip("polars")

DBC = """VERSION ""
NS_ :
BS_:
BU_: Body
BO_ 291 Lights: 2 Body
 SG_ Brightness : 0|8@1+ (0.5,0) [0|100] "%" Vector__XXX
 SG_ Mode : 8|8@1+ (1,0) [0|3] "" Vector__XXX
VAL_ 291 Mode 0 "off" 1 "dimmed" ;
"""
LOG = "(0.000000) can0 123#C801\n(0.100000) can0 085#01FF010000000000\n(0.200000) can0 185#0000000000000000\n"
OTHER = LOG.replace("C801", "6401")
SUITE = "spec: 1\nname: own\nsteps:\n- emcy: 0x1234\n"
NETWORK = f"dbc: lights.dbc\nemcy: words.yaml\nnodes:\n  motor: {{file: {MOTOR}, node_id: 5}}\n"

BY_OPTION = ("--eds", f"5={MOTOR}", "--dbc", "lights.dbc", "--emcy", "5=words.yaml")
BY_FILE = ("--network", "network.yaml")


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files = {"lights.dbc": DBC, "run.log": LOG, "other.log": OTHER, "network.yaml": NETWORK, "own.yaml": SUITE}
    for name, text in {**files, "words.yaml": "0xFF01: probe broken\n"}.items():
        Path(name).write_text(text)


def _archived(table: str, column: str) -> tuple[str, ...]:
    return ("query", "season", f"SELECT {column} FROM {table}", "--csv")


LIGHTS, PROBE = "Brightness=100.0 %", "probe broken"
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    # a command, and what it prints of both frames
    "decode": (("decode", "run.log"), (LIGHTS, "Mode=dimmed", PROBE)),
    "decode --json": (("decode", "run.log", "--json"), ('"Brightness": 100.0', PROBE)),
    "decode --csv": (("decode", "run.log", "--csv"), ("Brightness", PROBE)),
    "decode --statistics": (("decode", "run.log", "--statistics"), ("Lights",)),
    "monitor": (("monitor", "run.log", "--plain", "--speed", "max"), (LIGHTS, PROBE)),
    "compare": (("compare", "run.log", "other.log"), ("Lights",)),
    "diagnose": (("diagnose", "run.log"), (PROBE,)),
}


@pytest.mark.parametrize("options", [BY_OPTION, BY_FILE], ids=["option", "network file"])
@pytest.mark.parametrize(("words", "printed"), COMMANDS.values(), ids=COMMANDS)
def test_a_command_names_frames_and_error_codes(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], printed: tuple[str, ...], options: tuple[str, ...]
) -> None:
    said = run(capsys, *words, *options)
    assert said.status in (0, 1), said.err
    assert [each for each in printed if each not in said.out] == [], said.out


@pytest.mark.parametrize(("options", "jobs"), [(BY_OPTION, "1"), (BY_FILE, "2")], ids=["option", "network file"])
def test_the_archive_has_a_table_of_foreign_frames_and_words_of_errors(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...], jobs: str
) -> None:
    assert run(capsys, "archive", "run.log", "other.log", "-o", "season", "--jobs", jobs, *options).status == 0
    assert run(capsys, "query", "season", "SELECT Brightness, Mode_flag FROM lights ORDER BY 1", "--csv").out == (
        "Brightness,Mode_flag\n50.0,dimmed\n100.0,dimmed\n"
    )
    assert PROBE in run(capsys, "query", "season", "SELECT words FROM emcy", "--csv").out
    assert "123#" not in run(capsys, "query", "season", "SELECT text FROM damage", "--csv").out


def test_the_unit_of_a_foreign_signal_is_in_the_metadata(capsys: pytest.CaptureFixture[str]) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    run(capsys, "archive", "run.log", "-o", "season", *BY_OPTION)
    (file,) = Path("season/lights").glob("*.parquet")
    assert pq.read_schema(file).field("Brightness").metadata[b"unit"] == b"%"


def test_a_log_is_archived_again_with_other_names(capsys: pytest.CaptureFixture[str]) -> None:
    words = "archive", "run.log", "-o", "season", *BY_OPTION
    assert "known" not in run(capsys, *words).out
    assert "known" in run(capsys, *words).out
    Path("lights.dbc").write_text(DBC.replace("(0.5,0)", "(0.25,0)"))
    assert "known" not in run(capsys, *words).out
    Path("words.yaml").write_text("0xFF01: probe lost\n")
    assert "known" not in run(capsys, *words).out


def test_mcap_has_a_channel_of_foreign_frames(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcap")
    assert run(capsys, "export", "mcap", "run.log", "-o", "run.mcap", *BY_FILE).status == 0
    assert b"Brightness" in Path("run.mcap").read_bytes()


PAGES: dict[str, Callable[[], Devices]] = {
    "option": lambda: Devices(eds=[f"5={MOTOR}"]),
    "network file": lambda: Devices(network="network.yaml"),
}


@pytest.mark.parametrize("form", PAGES)
def test_the_page_and_suites_have_the_same_decoder(form: str) -> None:
    names = FrameNames(dbc=["lights.dbc"], emcy=["5=words.yaml"]) if form == "option" else FrameNames()
    devices = PAGES[form]()
    for decoder in (devices.decoder(names), devices.decoder_with(names)(devices.load())):
        assert decoder.others[0x123].name == "Lights"
        assert decoder.errors.of(5)(0xFF01) == PROBE


def test_a_red_step_says_frames_as_decode_does(capsys: pytest.CaptureFixture[str]) -> None:
    package = "from eurobot_od.plugin import Plugin\nfrom eurobot_od.device.simulated import SimulatedDevice\n"
    package += "class Faulty(SimulatedDevice):\n    def start(self, now):\n        self.raise_error(0xFF01, 'probe')\n"
    package += "        return super().start(now)\nDEVICE = Plugin('faulty', (0, 5), device=lambda: Faulty)\n"
    Path("device.py").write_text(package)
    said = run(capsys, "check", "own.yaml", "--simulate", "--package", "device.py", *BY_OPTION)
    assert said.status == 1
    assert PROBE in said.out
