"""Where a robot is found, and what is said about one that is not as it should be."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od import plugin
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.plugin import NO_ROBOT, Plugin, find
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run

MINE = """
from eurobot_od.plugin import Command, Plugin
ROBOT = Plugin("Mine", commands={"wave": Command("wave a hand", "waving_hands")})
"""
WAVE = '''"""Wave a hand, once."""

def add_arguments(parser):
    parser.add_argument("--times", type=int, default=1)

def run(arguments):
    print(arguments.times * "wave ")
'''


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(plugin.VARIABLE, raising=False)


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "robot.py").write_text(MINE)
    (folder / "waving_hands.py").write_text(WAVE)
    return folder


def test_ours_is_installed_like_anybody_s() -> None:
    assert plugin.installed()["eurobot2014"] == "eurobot_od.robot.plugin:ROBOT"
    assert find() is find("eurobot2014") is find("eurobot_od.robot.plugin") is ROBOT


def test_a_folder_is_named_by_the_caller_the_environment_or_the_network_file(
    mine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find(str(mine)).name == "Mine"
    Path("eurobot-od.yaml").write_text("robot: mine\n")
    assert find().name == "Mine"
    assert find("eurobot2014") is ROBOT
    assert find(folder=mine) is ROBOT, "there is no network file in it"
    monkeypatch.setenv(plugin.VARIABLE, "eurobot2014")
    assert find() is ROBOT


INSTALLED = [
    # (what the entry points of an environment name, whose robot it is)
    ({}, ""),
    ({"ours": "eurobot_od.robot.plugin:ROBOT", "theirs": "theirs:OTHER"}, "Theirs"),
    ({"gone": "no_such_package.robot:ROBOT", "ours": "eurobot_od.robot.plugin:ROBOT"}, "Eurobot 2014"),
    ({"gone": "eurobot_od.no_robot.plugin:ROBOT"}, ""),
]


@pytest.mark.parametrize(("entered", "name"), INSTALLED)
def test_of_several_it_is_one_of_another_package(
    entered: dict[str, str], name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "theirs.py").write_text(MINE.replace("ROBOT", "OTHER").replace("Mine", "Theirs"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(plugin, "installed", lambda: entered)
    assert find().name == name


def test_entry_points_are_read_as_packages_have_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = tmp_path / "team-1.0.dist-info"
    said.mkdir()
    (said / "entry_points.txt").write_text(
        "[console_scripts]\nx = y:z\n[eurobot_od.robots]\nteam = team.robot:ROBOT\n\n[z]\na = b\n"
    )
    (tmp_path / "bare.dist-info").mkdir()
    monkeypatch.setattr("sys.path", [str(tmp_path), str(tmp_path / "nothing")])
    assert plugin.installed.__wrapped__() == {"team": "team.robot:ROBOT"}


WRONG = {
    # what robot.py has, and what is said about it
    "x = 1\n": r"robot.py: no `ROBOT` in it",
    "ROBOT = 5\n": r"robot.py: no `ROBOT` in it",
    "\n\nimport nothing_at_all\n": r"robot.py:3: ModuleNotFoundError: No module named 'nothing_at_all'",
    "def f(:\n": r"robot.py:1: SyntaxError",
}


@pytest.mark.parametrize(("text", "complaint"), WRONG.items())
def test_what_is_wrong_with_a_folder_is_one_line_with_its_place(
    text: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "wrong"
    folder.mkdir()
    (folder / "robot.py").write_text(text)
    with pytest.raises(LocalError, match=complaint):
        find(str(folder))
    said = run(capsys, "show", "--robot", str(folder))
    assert said.status == 2
    assert len(said.err.splitlines()) == 1


@pytest.mark.parametrize("name", ["nobody", "no.such.module"])
def test_an_unknown_robot_is_told_with_those_that_are_installed(name: str) -> None:
    with pytest.raises(UnknownName, match=r"unknown robot .*eurobot2014"):
        find(name)


@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize("words", [["--robot", "mine"], ["--robot=mine"]])
def test_its_commands_are_called_as_others_wherever_it_is_named(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "wave", "--times", "2", *words).out == "wave wave \n"
    assert run(capsys, *words, "wave").out == "wave \n"
    assert "\nMine:\n  wave        wave a hand\n" in run(capsys, "--help", *words).out
    assert "wave a hand" not in run(capsys, "--help").out


def test_a_robot_without_anything_is_the_workbench_alone() -> None:
    assert Plugin() == NO_ROBOT
    assert NO_ROBOT.dialects.names() == []
    with pytest.raises(LocalError, match="which devices"):
        NO_ROBOT.dialects.load_all()
    assert NO_ROBOT.fault_names() == [name for name in ROBOT.fault_names() if name in NO_ROBOT.fault_names()]
