"""The door for robots: which one is meant, what is said about one that is not as it should be, and that data runs none.

Robots are installed here as a wheel does it: a package, and its entry point in a `.dist-info` beside it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from eurobot_od import cli, plugin
from eurobot_od.errors import LocalError, RobotWarning, UnknownName
from eurobot_od.plugin import NO_ROBOT, Plugin, find
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import Said, run

MINE = """
from eurobot_od.plugin import Command, Plugin
ROBOT = Plugin("Mine", commands={"wave": Command("wave a hand", "waving_hands")})
"""
WAVE = '''
def wave(*, times: int = 1) -> None:
    """Wave a hand, once."""
    print(times * "wave ")
'''
OURS = "eurobot2014 = eurobot_od.robot.plugin:ROBOT"

Install = Callable[..., None]


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


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install modules, and the entry points of robots, in an environment where there are no others."""
    site, before = tmp_path / "site", set(sys.modules)
    site.mkdir()
    monkeypatch.syspath_prepend(site)
    monkeypatch.setattr(plugin, "GROUP", "these.robots")
    plugin.installed.cache_clear()

    def add(entry: str, **modules: str) -> None:
        for name, text in modules.items():
            (site / f"{name}.py").write_text(text)
            monkeypatch.delitem(sys.modules, name, raising=False)  # another of that name, such as one of the tools
        package = site / f"{entry.partition(' ')[0]}-1.0.dist-info"
        package.mkdir()
        (package / "entry_points.txt").write_text(
            f"[console_scripts]\nx = y:z\n[{plugin.GROUP}]\n{entry}\n\n[z]\na = b\n"
        )
        plugin.installed.cache_clear()

    yield add
    plugin.installed.cache_clear()
    for name in set(sys.modules) - before:
        if Path(getattr(sys.modules[name], "__file__", None) or "/").parent == site:
            del sys.modules[name]


# Which one is meant


def test_ours_is_installed_like_anybody_s() -> None:
    assert plugin.installed()["eurobot2014"].target == "eurobot_od.robot.plugin:ROBOT"
    assert find() is find("eurobot2014") is find("eurobot_od.robot.plugin") is ROBOT


def test_a_robot_is_named_by_the_caller_before_the_environment_before_the_network_file(
    mine: Path, monkeypatch: pytest.MonkeyPatch, install: Install
) -> None:
    install("arms = arms", arms=MINE.replace("Mine", "Arms"))
    install(OURS)
    Path("eurobot-od.yaml").write_text("robot: eurobot2014\n")
    assert find() is find(alone=True) is ROBOT
    assert find(network=mine / "eurobot-od.yaml").name == "Arms", "there is no such file"
    monkeypatch.setenv(plugin.VARIABLE, str(mine))
    assert find().name == "Mine"
    assert find("arms").name == "Arms"
    assert find("none") is NO_ROBOT


def test_without_a_name_it_is_somebody_else_s_before_ours_and_none_alone(install: Install) -> None:
    assert find() is NO_ROBOT
    install(OURS)
    assert (find(), find(alone=True)) == (ROBOT, NO_ROBOT)
    install("theirs = theirs:OTHER [extra]", theirs=MINE.replace("ROBOT", "OTHER").replace("Mine", "Theirs"))
    assert find().name == "Theirs"


def test_two_that_fit_are_an_error_that_names_both_and_what_to_type(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install(OURS)
    install("wings = wings", wings=MINE)
    install("arms = arms", arms=MINE)
    what = "eurobot-od: several robots are installed: name one by --robot: arms, wings\n"
    for words in (["faults"], ["match"], ["decode", "a.log"]):
        assert run(capsys, *words)[::2] == (2, what), words
    said = run(capsys, "--help")
    assert (said.status, said.err, "  decode " in said.out, "wave" in said.out) == (0, what, True, False)
    assert "wave" in run(capsys, "--help", "--robot", "arms").out
    said = run(capsys, "completion", "bash")
    assert (said.status, said.err, "decode" in said.out, "wave" in said.out) == (0, what, True, False)
    install("twin = twin", twin="from eurobot_od.robot.plugin import ROBOT")
    assert run(capsys, "check", "bytes", "--simulate", "--robot", "twin").status == 0, (
        "its world is the one that is named"
    )


# What is wrong with one

BROKEN = {
    # what a robot's module has; where, and what is said about it
    "def f(:\n": ("/site/wrecked.py:1: ", "SyntaxError: invalid syntax"),
    "\n\nimport nothing_at_all\n": ("/site/wrecked.py:3: ", "ModuleNotFoundError: No module named 'nothing_at_all'"),
    "def f():\n    1 / 0\nf()\n": ("/site/wrecked.py:2: ", "ZeroDivisionError: division by zero"),
    "import json\njson.loads('')": (
        "/site/wrecked.py:2: ",
        "JSONDecodeError: Expecting value: line 1 column 1 (char 0)",
    ),
    "raise SystemExit('good\\nbye')": ("/site/wrecked.py:1: ", "SystemExit: good bye"),
    "import pytest\npytest.skip('no arms', allow_module_level=True)": ("/site/wrecked.py:2: ", "Skipped: no arms"),
    "def __getattr__(name):\n    raise OSError(name)\n": ("/site/wrecked.py:2: ", "OSError: "),
    "ROBOT = 5\n": ("entry_points.txt: ", "no `wrecked:ROBOT` there that is an eurobot_od.plugin.Plugin"),
}


@pytest.mark.parametrize("text", BROKEN)
def test_a_robot_that_cannot_be_loaded_is_one_warning_and_the_rest_goes_on(
    text: str, install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("wrecked = wrecked:ROBOT", wrecked=text)
    install(OURS)
    where, what = BROKEN[text]
    for words in (["--help"], ["show"], ["check", "--list"], ["faults"]):
        said = run(capsys, *words)
        assert (said.status, said.err.count("\n")) == (0, 1), words
        assert said.err.startswith("eurobot-od: robot wrecked: ")
        assert where in said.err
        assert what in said.err
        assert said.err.endswith("; going on without it\n")
    assert "  match " in run(capsys, "--help").out, "ours is there all the same"
    named = run(capsys, "--help", "--robot", "wrecked")
    assert (named.status, named.out, named.err.count("\n")) == (2, "", 1)
    doctor = run(capsys, "doctor")
    assert (doctor.status, doctor.err) == (1, "")
    assert "robot      wrecked does not load: wrecked:ROBOT" in doctor.out
    assert "robot      eurobot2014 loads: eurobot_od.robot.plugin:ROBOT" in doctor.out
    assert "pip uninstall wrecked" in " ".join(doctor.out.split())


def test_a_package_that_was_removed_by_hand_is_told_by_its_entry_point(install: Install) -> None:
    install("gone = no_such_package.robot:ROBOT")
    with pytest.warns(RobotWarning, match=r"gone: .*/gone-1.0.dist-info/entry_points.txt: ModuleNotFoundError"):
        assert find() is NO_ROBOT


def test_ctrl_c_while_a_robot_is_loaded_ends_the_program(install: Install) -> None:
    install("slow = slow:ROBOT", slow="raise KeyboardInterrupt")
    assert cli.main(["faults"]) == cli.ExitStatus.INTERRUPTED


def test_what_a_robot_prints_while_it_is_loaded_is_in_no_output(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("loud = loud", loud=f"print('hello')\n{MINE}")
    assert run(capsys, "faults", "--json").out.startswith("[")


def test_a_command_of_a_robot_that_cannot_be_loaded_is_one_line(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("mine = mine", mine=MINE, waving_hands="import nothing_at_all")
    said = run(capsys, "wave")
    assert said.status == 2
    assert "/site/waving_hands.py:1: ModuleNotFoundError" in said.err
    assert said.err.count("\n") == 1


LATE = """
from eurobot_od.plugin import Plugin
def broken(*_):
    import nothing_at_all
ROBOT = Plugin("Late", catalogue=broken, nodes={"core": broken}, faults=broken, reports=broken)
"""
NEEDS = {
    # what a command asks of a robot
    ("faults",): "its faults",
    ("decode", "a.log"): "its messages",
    ("query", "season", "--report", "any"): "its reports",
}


@pytest.mark.parametrize("words", NEEDS, ids=" ".join)
@pytest.mark.parametrize("form", ["installed", "folder"])
def test_a_part_that_cannot_be_loaded_when_it_is_needed_is_one_line_with_its_place(
    form: str, words: tuple[str, ...], install: Install, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.log").write_text("(0.0) can0 123#\n")
    (tmp_path / "late").mkdir()
    (tmp_path / "late" / "robot.py").write_text(LATE)
    if form == "installed":
        install("late = late_robot:ROBOT", late_robot=LATE)
    said = run(capsys, *words, *([] if form == "installed" else ["--robot", "late"]))
    assert (said.status, said.err.count("\n")) == (2, 1), said
    assert f"{'late_robot' if form == 'installed' else 'late/robot'}.py:4: ModuleNotFoundError" in said.err


WRONG = {
    # what robot.py has, and what is said about it
    "x = 1\n": r"robot.py: no `ROBOT` in it",
    "ROBOT = 5\n": r"robot.py: no `ROBOT` in it",
    "\n\nimport nothing_at_all\n": r"robot.py:3: ModuleNotFoundError: No module named 'nothing_at_all'",
    "def f(:\n": r"robot.py:1: SyntaxError",
    "raise GeneratorExit": r"robot.py:1: GeneratorExit",
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


@pytest.mark.parametrize("name", ["nobody", "no.such.module", "../nowhere", "a b"])
def test_an_unknown_robot_is_told_with_those_that_are_installed(name: str) -> None:
    with pytest.raises(UnknownName, match=r"unknown robot .*eurobot2014"):
        find(name)


# Data runs no code


WRITTEN = {
    # `robot:` of a network file that came with somebody's logs, and what is to be typed for it
    "./x": "--robot x",
    "x": "--robot x",
    "../{folder}/x": "--robot ../{folder}/x",
    "x.robot": "--robot x.robot",
    "no such": "--robot 'no such'",
}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_file_that_names_no_installed_robot_is_told_what_to_type(name: str, tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "robot.py").write_text("raise SystemExit('this must not run')")
    Path("eurobot-od.yaml").write_text(f"robot: {name.format(folder=tmp_path.name)}\n")
    with pytest.warns(RobotWarning, match="eurobot-od.yaml: robot: .*a file runs no code") as told:
        assert find() is NO_ROBOT
    assert str(told[0].message).endswith(f"type {WRITTEN[name].format(folder=tmp_path.name)}")


@pytest.mark.parametrize("command", [*ROBOT.commands, "wave"])
def test_no_command_of_a_robot_runs_what_a_file_names(
    command: str, mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (mine / "robot.py").write_text(f"from pathlib import Path\nPath('it ran').touch()\n{MINE}")
    Path("eurobot-od.yaml").write_text("robot: ./mine\n")
    said = run(capsys, command, "new")
    assert said.status == 2
    assert said.err.splitlines()[0].endswith("to run it, set EUROBOT_OD_ROBOT, or type --robot mine")
    assert [each.name for each in Path().iterdir() if each.name not in ("mine", "eurobot-od.yaml")] == []


@pytest.mark.parametrize("program", [cli.PROGRAM, cli.WORKBENCH])
def test_a_table_extends_an_installed_robot_s_only(
    program: str, mine: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (mine / "robot.py").write_text("from pathlib import Path\nPath('ran').touch()\n")
    monkeypatch.setattr(sys, "argv", [program])
    Path("table.yaml").write_text("extends: ./mine\n")
    said = run(capsys, "make-eds", "table.yaml", "-o", "eds")
    assert said == Said(2, "", f"{program}: unknown installed robot './mine'; known: eurobot2014\n")
    assert not Path("ran").exists()


# Its commands


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


def test_a_suite_has_the_name_of_its_file_and_a_program_of_that_name_is_no_suite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("lift.check.yaml", "arm.yaml", "notes.txt"):
        (tmp_path / name).touch()
    robot = Plugin(suites=tmp_path)
    assert robot.shipped_suites() == {"arm": tmp_path / "arm.yaml", "lift": tmp_path / "lift.check.yaml"}
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    (here / "lift").touch()  # compiled
    assert robot.suite("lift") == tmp_path / "lift.check.yaml"
    assert robot.suite("./lift") == Path("lift")
    with pytest.raises(UnknownName, match="unknown suite 'lft'"):
        robot.suite("lft")
