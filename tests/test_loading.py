"""The door for robots: which one is meant, what is said about one that is not as it should be, and that data runs none.

Robots are installed here as a wheel does it: a package, and its entry point in a `.dist-info` beside it.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, cast

import pytest

from eurobot_od import cli, loading
from eurobot_od.cli.devices import Devices
from eurobot_od.errors import LocalError, RobotWarning, UnknownName
from eurobot_od.loading import ROBOTS, find
from eurobot_od.plugin import NOTHING
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import Said, run

if TYPE_CHECKING:
    from eurobot_od.pdo.kinds import Message

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


def forget() -> None:
    """Search installed plug-ins again."""
    for each in (loading._entry_points, loading._installed, loading._packages):
        each.cache_clear()


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(ROBOTS.variable, raising=False)


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
    monkeypatch.setattr(loading, "ROBOTS", ROBOTS._replace(group="these.robots"))
    forget()

    def add(entry: str, **modules: str) -> None:
        for name, text in modules.items():
            (site / f"{name}.py").write_text(text)
            monkeypatch.delitem(sys.modules, name, raising=False)  # another of that name, such as one of the tools
        package = site / f"{entry.partition(' ')[0]}-1.0.dist-info"
        package.mkdir()
        (package / "entry_points.txt").write_text(
            f"[console_scripts]\nx = y:z\n[these.robots]\n{entry}\n\n[z]\na = b\n"
        )
        forget()

    yield add
    forget()
    for name in set(sys.modules) - before:
        if Path(getattr(sys.modules[name], "__file__", None) or "/").parent == site:
            del sys.modules[name]


# Which one is meant


def test_the_shipped_robot_is_installed_by_entry_point() -> None:
    assert ROBOTS.installed()["eurobot2014"].target == "eurobot_od.robot.plugin:ROBOT"
    assert find() is find("eurobot2014") is find("eurobot_od.robot.plugin") is ROBOT


def test_a_robot_is_named_by_the_caller_before_the_environment_before_the_network_file(
    mine: Path, monkeypatch: pytest.MonkeyPatch, install: Install
) -> None:
    install("arms = arms", arms=MINE.replace("Mine", "Arms"))
    install(OURS)
    Path("eurobot-od.yaml").write_text("robot: eurobot2014\n")
    assert find() is find(alone=True) is ROBOT
    assert find(network=mine / "eurobot-od.yaml").name == "Arms", "there is no such file"
    monkeypatch.setenv(ROBOTS.variable, str(mine))
    assert find().name == "Mine"
    assert find("arms").name == "Arms"
    assert find("none") is NOTHING


def test_without_a_name_another_robot_comes_before_the_shipped_one(install: Install) -> None:
    assert find() is NOTHING
    install(OURS)
    assert (find(), find(alone=True)) == (ROBOT, NOTHING)
    install("theirs = theirs:OTHER [extra]", theirs=MINE.replace("ROBOT", "OTHER").replace("Mine", "Theirs"))
    assert find().name == "Theirs"


def test_two_matching_robots_are_an_error_that_names_both(install: Install, capsys: pytest.CaptureFixture[str]) -> None:
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
    "class Mute(Exception):\n    __str__ = None\nraise Mute": ("/site/wrecked.py:3: ", "Mute: what it says cannot"),
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


def test_a_package_removed_by_hand_is_named_by_its_entry_point(install: Install) -> None:
    install("gone = no_such_package.robot:ROBOT")
    with pytest.warns(RobotWarning, match=r"gone: .*/gone-1.0.dist-info/entry_points.txt: ModuleNotFoundError"):
        assert find() is NOTHING


def test_ctrl_c_while_a_robot_is_loaded_ends_the_program(install: Install) -> None:
    install("slow = slow:ROBOT", slow="raise KeyboardInterrupt")
    assert cli.main(["faults"]) == cli.ExitStatus.INTERRUPTED


def test_output_of_a_robot_while_it_loads_is_dropped(install: Install, capsys: pytest.CaptureFixture[str]) -> None:
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
def test_an_error_in_a_folder_is_one_line_with_its_place(
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
def test_an_unknown_robot_is_an_error_that_lists_the_installed_ones(name: str) -> None:
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
def test_a_file_that_names_no_installed_robot_gives_the_option_to_use(name: str, tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "robot.py").write_text("raise SystemExit('this must not run')")
    Path("eurobot-od.yaml").write_text(f"robot: {name.format(folder=tmp_path.name)}\n")
    with pytest.warns(RobotWarning, match="eurobot-od.yaml: robot: .*a file runs no code") as told:
        assert find() is NOTHING
    assert str(told[0].message).endswith(f"type {WRITTEN[name].format(folder=tmp_path.name)}")


@pytest.mark.parametrize("command", [*ROBOT.commands, "wave"])
def test_a_network_file_that_names_a_folder_runs_none_of_its_code(
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
def test_commands_of_a_robot_have_the_same_names_wherever_it_is_chosen(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "wave", "--times", "2", *words).out == "wave wave \n"
    assert run(capsys, *words, "wave").out == "wave \n"
    assert "\nMine:\n  wave        wave a hand\n" in run(capsys, "--help", *words).out
    assert "wave a hand" not in run(capsys, "--help").out


# What a device package raises


RAISING = """
from eurobot_od.plugin import Command, Plugin
from eurobot_od.check.steps import SuiteAction
from eurobot_od.client.program import DownloadProcedure
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.traffic.dbc import ForeignMessage
from eurobot_od.traffic.diagnosis.incidents import Watcher
from eurobot_od.web.page import Panel
from typing import NamedTuple

def broken(*_):
    return 1 / 0  # line 12

async def broken_step(*_):
    broken()

class Keys(NamedTuple):
    below: int

class Watching(Watcher):
    def listener(self, cob_id, meaning):
        return self.take

    def take(self, time, meaning):
        broken()

class Failing(SimulatedDevice):
    def reset(self):
        super().reset()
        self.at(self.now + 0.01, broken)

class Listening(Watcher):
    def listener(self, cob_id, meaning):
        return broken

class View(Panel):
    name, title, script, style = "own", "Own", "", ""
    @classmethod
    def fits(cls, protocol):
        return True
    def take(self, time, message):
        yield broken()

class Unfit(View):
    fits = setup = classmethod(broken)

class Unmade(View):
    of = classmethod(broken)

def frames(device):
    return {0x6E0: ForeignMessage("Beacon", ("gripper",), {"uptime": "s"}, broken)}

DEVICE = Plugin("gripper", (0, 5), PART)
"""
MOTOR = Path(__file__).parents[1] / "docs" / "motor.eds"
SUITE = "spec: 1\nname: own\nsteps:\n- sdo: {read: Device type}\n- own: {below: 5}\n"
PARTS: dict[str, tuple[str, tuple[str, ...], int, str]] = {
    # the part, a command that asks for it, its exit status, and what it prints all the same
    "frames": ("frames=broken", ("decode", "a.log"), 0, "speed=7"),
    "a frame": ("frames=frames", ("decode", "a.log"), 0, "speed=7"),
    "watchers": ("watchers=broken", ("diagnose", "a.log"), 1, "frames"),
    "a watcher": ("watchers=lambda: [Watching]", ("diagnose", "a.log"), 1, "frames"),
    "a watcher's listener": ("watchers=lambda: [Listening]", ("diagnose", "a.log"), 1, "frames"),
    "actions": ("actions=broken", ("check", "plain.yaml", "--simulate"), 0, "1 ok"),
    "a step": (
        "actions=lambda: {'own': SuiteAction(Keys, broken_step)}",
        ("check", "own.yaml", "--simulate", "--keep-going"),
        1,
        "1 FAILED",
    ),
    "the simulated device": ("device=broken", ("check", "plain.yaml", "--simulate"), 0, "1 ok"),
    "its timer": ("device=lambda: Failing", ("check", "plain.yaml", "--simulate"), 1, "1 FAILED"),
}


@pytest.mark.parametrize(("part", "words", "status", "printed"), PARTS.values(), ids=PARTS)
def test_an_error_in_a_device_package_is_one_line_with_its_place(
    part: str, words: tuple[str, ...], status: int, printed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    forget()
    Path("gripper").mkdir()
    Path("gripper/device.py").write_text(RAISING.replace("PART", part))
    Path("a.log").write_text("(0.0) can0 185#0700000000000000\n(0.1) can0 6E0#00\n(0.2) can0 6E0#00\n")
    Path("own.yaml").write_text(SUITE)
    Path("plain.yaml").write_text(SUITE.rpartition("- own")[0])
    said = run(capsys, *words, "--eds", f"5={MOTOR}", "--package", "gripper")
    told = [line for line in (said.out + said.err).splitlines() if "ZeroDivisionError" in line]
    assert said.status == status, said
    assert "Traceback" not in said.err
    assert len(told) == 1, said
    assert "device.py:12: ZeroDivisionError: division by zero" in told[0]
    assert printed in said.out


@pytest.mark.parametrize(("panel", "is_shown"), [("View", True), ("Unfit", False), ("Unmade", True)])
def test_a_panel_of_a_device_package_that_raises_is_one_warning_and_the_page_goes_on(
    panel: str, is_shown: bool
) -> None:
    forget()
    Path("gripper").mkdir()
    Path("gripper/device.py").write_text(RAISING.replace("PART", f"panels=lambda: [{panel}]"))
    devices = Devices(eds=[f"5={MOTOR}"], package=["gripper"])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        decoder = devices.decoder()
        panels = devices.panels(decoder)
        for each in panels:
            assert list(each().take(0.0, cast("Message", ()))) == []
            assert each.setup() == {}
        devices.panels(decoder)
    assert len(panels) == is_shown
    assert ["device.py:12: ZeroDivisionError" in str(each.message) for each in told] == [True] * len(told)
    assert len(told) == 1
