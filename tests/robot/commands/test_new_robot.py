"""A new robot as a newcomer has it: written, played, checked, exported, tested; and with what they get wrong."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.cli.console import run

PATIENCE = 120
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("EUROBOT_OD_")}


def command(
    folder: Path, words: Sequence[str], program: str = "eurobot_od", **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, in a process of its own: a robot's modules are imported into it."""
    line = [sys.executable, "-m", program, *words]
    environment = ENVIRONMENT | variables
    return subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("newcomer")
    said = command(folder, ["new-robot", "mine", "--name", "My robot"], PATH="")
    assert (said.returncode, said.stderr) == (0, "")
    # As it can be typed: there is no program on the PATH.
    assert f"  {shlex.join([sys.executable, '-m', 'eurobot_od'])} match --field match.svg --robot .\n" in said.stdout
    return folder / "mine"


@pytest.fixture
def mine(made: Path, tmp_path: Path) -> Path:
    """A copy, to be spoiled."""
    return Path(shutil.copytree(made, tmp_path / "mine"))


WORKS = [
    # what is typed beside the folder, and what is printed
    (["match", "--for", "10", "--log", "a.log", "--field", "a.svg"], "Lift State Response "),
    (["decode", "a.log"], "height=167 mm, speed=100 %"),
    (["field", "a.log", "-o", "b.svg"], ""),
    (["check", "--simulate"], "1 suite: 22 ok"),
    (["check", "--conformance", "--simulate", "--tag", "emcy"], "4 suites"),
    (["lint"], "4 files: "),
    (["lint", "--network"], "Lift State Response"),
    (["show", "Lift State Response"], "motion"),
    (["faults", "lift"], "lift:\n  lift-stop-not-heard "),
    (["faults", "core"], "lift-set-not-sent"),
    (["load"], "Lift Set"),
    (["export", "docs"], "Lift State Response"),
    (["node", "lift", "-i", "virtual", "--for", "100 ms"], "lift (node-ID 4)"),
    (["make-eds", "{files}/eds/protocol.yaml", "-o", "{files}/eds", "--check"], "as the table says"),
    (["--help"], "\nMy robot:\n  match"),
]


def works(folder: Path, files: str, *options: str, **variables: str) -> None:
    for words, printed in WORKS:
        said = command(folder, [*(each.format(files=files) for each in words), *options], **variables)
        assert (said.returncode, said.stderr) == (0, ""), words
        assert printed in said.stdout, words


@pytest.mark.long
def test_the_commands_of_a_newcomer_work(made: Path) -> None:
    works(made.parent, "mine", "--robot", "mine")


@pytest.mark.long
def test_pytest_finds_its_checks_in_its_folder(made: Path) -> None:
    said = command(made, ["-q", "-p", "no:cacheprovider"], "pytest")
    assert (said.returncode, "23 passed" in said.stdout) == (0, True), said.stdout


WITH_GAIN = "          Maximum speed: {bits: 16, range: [1, 1000], default: 100, unit: mm/s}\n"
GAIN = "          Gain: {bits: 32, type: REAL32, default: 1.5}\n"
STATE = "senders: [lift], receivers: [core], object: Lift state"
CHANGES = {
    "eds/protocol.yaml": [(WITH_GAIN, WITH_GAIN + GAIN), (STATE, f"{STATE}, event_timer: 100")],
    "lift.py": [
        ("maximum_speed = setting", 'gain = setting("Lift drive.Gain")\n    maximum_speed = setting'),
        ("round(self.height)", "round(self.height * self.gain)"),
    ],
}


def test_a_real32_setting_and_a_periodic_message(mine: Path) -> None:
    for name, changes in CHANGES.items():
        text = (mine / name).read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (mine / name).write_text(text)
    assert command(mine, ["make-eds", "eds/protocol.yaml", "-o", "eds", "--robot", "."]).returncode == 0
    played = ["match", "--robot", ".", "--for", "10", "--log", "a.log", "--set", "lift.Lift drive.Gain=0.5"]
    said = command(mine, played)
    assert (said.returncode, said.stderr) == (0, "")
    assert said.stdout.startswith("    0.000 s  start      My robot: core, drive, navigation, lift at 500 kbit/s")
    logged = command(mine, ["decode", "a.log", "--robot", ".", "--message", "Lift State Response"]).stdout
    assert len(logged.splitlines()) > 80  # ten a second, and as answers
    assert max(int(each) for each in re.findall(r"height=(\d+)", logged)) == 90  # half of where it goes


def test_files_that_do_not_belong_together_are_told(mine: Path) -> None:
    table = mine / "eds" / "protocol.yaml"
    table.write_text(table.read_text().replace("range: [0, 200]", "range: [0, 190]"))
    said = command(mine, ["lint", "--robot", "."])
    assert said.returncode == 1
    assert "eds/canopen/core.eds: differs first in line " in said.stderr
    assert "`make-eds eds/protocol.yaml -o eds` writes it anew" in said.stderr
    assert (
        "eds/canopen/core.eds: differs first in line " in command(mine, ["match", "--robot", ".", "--for", "1"]).stderr
    )
    (mine / "robot.py").write_text((mine / "robot.py").read_text().replace('"lift": Lift', '"lfit": Lift'))
    assert "unknown node with an EDS file 'lfit'; did you mean lift?" in command(mine, ["show", "--robot", "."]).stderr


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of a robot, entered as pip does it: `tools/wheel.py` has pip do it."""
    folder = tmp_path_factory.mktemp("package")
    said = command(folder, ["new-robot", "ours", "--name", "My robot", "--package"])
    assert (said.returncode, said.stderr) == (0, "")
    assert "\n  pip install -e .\n  eurobot-od match --field" in said.stdout
    _, _, entries = (folder / "ours" / "pyproject.toml").read_text().partition('[project.entry-points."')
    entered = folder / "site" / "my_robot-0.1.0.dist-info"
    entered.mkdir(parents=True)
    (entered / "entry_points.txt").write_text("[" + entries.partition("\n\n")[0].replace('"', ""))
    return folder / "ours"


@pytest.mark.long
def test_a_package_needs_no_name_once_it_is_installed_and_pytest_finds_its_checks(package: Path) -> None:
    installed = {"PYTHONPATH": os.pathsep.join((str(package), str(package.parent / "site")))}
    works(package, "my_robot", **installed)
    assert "robot      my_robot loads: my_robot.robot:ROBOT" in command(package, ["doctor"], **installed).stdout
    said = command(package, ["-q", "-p", "no:cacheprovider"], "pytest", **installed)
    assert (said.returncode, "23 passed" in said.stdout) == (0, True), said.stdout


def test_a_package_that_is_not_installed_prints_its_install_command(package: Path) -> None:
    said = command(package, ["show"])
    assert said.returncode == 2
    assert "robot: my_robot is not an installed robot, and a file runs no code; " in said.stderr


NAMES = [
    # a name, and why it cannot be a package's
    ("2027", "begins with a letter"),
    ("class", "is not a word of Python"),
    ("...", "begins with a letter"),
    ("CAN", "there is a module can already: "),
    ("json", "there is a module json already: "),
]


@pytest.mark.parametrize(("name", "complaint"), NAMES)
def test_a_package_takes_no_name_that_python_cannot_import(
    name: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "new-robot", str(tmp_path / "new"), "--name", name, "--package")
    assert (said.status, said.err.count("\n"), complaint in said.err) == (2, 1, True)
    assert not (tmp_path / "new").exists()


def test_ruff_finds_nothing_in_a_new_robot(made: Path, package: Path) -> None:
    for folder in (made, package):
        rules = ["check", "--isolated", "--line-length", "120", "--select", "E,F,W,I,B,SIM,UP", "."]
        said = command(folder, rules, "ruff")
        assert (said.returncode, said.stdout) == (0, "All checks passed!\n")


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
def test_its_c_header_compiles_and_packs_its_messages(made: Path, tmp_path: Path) -> None:
    said = command(made, ["export", "c", "-o", str(tmp_path / "mine.h"), "--name", "mine", "--robot", "."])
    assert said.returncode == 0, said.stderr
    (tmp_path / "main.c").write_text(
        '#include "mine.h"\n#include <stdio.h>\n'
        "int main(void) {\n"
        "    uint8_t data[8] = {0}; mine_lift_set_t order = {.height = 150, .speed = 60};\n"
        "    size_t length = mine_lift_set_pack(data, sizeof data, &order);\n"
        '    printf("%zu %02X %02X", length, data[0], data[1]);\n}\n'
    )
    subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", "main.c", "-o", "main"], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "main"], capture_output=True, text=True).stdout == "2 96 3C"


def test_a_folder_that_is_not_empty_is_left_alone(made: Path) -> None:
    before = sorted(made.rglob("*"))
    said = command(made.parent, ["new-robot", "mine"])
    assert (said.returncode, said.stderr) == (2, "eurobot-od: mine: it is there, and not empty; name a new folder\n")
    assert sorted(made.rglob("*")) == before


FAULTS = [
    # a fault of one of its messages, and what is said about it
    ("lift-confirm-not-sent", "no Lift Confirm within 200 ms"),
    ("lift-confirm-sent-twice", "Lift Confirm"),
    ("lift-state-response-reversed", "Lift State Response"),
    ("lift-set-not-heard", "no Lift Confirm within 200 ms"),
    ("lift-stop-not-heard", "Lift State Response"),
]


@pytest.mark.long
@pytest.mark.parametrize(("fault", "printed"), FAULTS)
def test_its_checks_find_the_faults_of_its_messages(fault: str, printed: str, made: Path) -> None:
    said = command(made, ["check", "lift", "--simulate", "--fault", fault, "--robot", "."])
    assert (said.returncode, said.stderr) == (1, "")
    assert printed in said.stdout


@pytest.mark.long
def test_a_match_goes_on_without_a_faulty_lift_and_says_so(made: Path) -> None:
    said = command(made, ["match", "--for", "3", "--fault", "lift-confirm-not-sent", "--robot", "."])
    assert (said.returncode, said.stderr) == (0, "")
    assert "without the lift: no LiftConfirm within 500 ms after LiftSet\n" in said.stdout


MISTAKES = [
    # (a file, what is changed in it to what, what is typed, what is said)
    (
        "lift.py",
        "LiftStop: stop",
        "LiftConfirm: stop",
        ["match"],
        "lift.py:56: Lift handles LiftConfirm without an RPDO for it in mine/eds/canopen/lift.eds; it sends it",
    ),
    (
        "lift.py",
        '"Lift state":',
        '"Lift stat":',
        ["match"],
        "lift.py:53: Lift binds 'Lift stat', which is not an object in mine/eds/canopen/lift.eds; did you mean Lift",
    ),
    ("lift.py", "class Lift(Node):", "class Lift(Nod):", ["match"], "mine/lift.py:18: NameError"),
    (
        "own_messages.py",
        "height: Annotated",
        "hight: Annotated",
        ["match"],
        "core.eds: 0x1A06: Lift Set maps height, speed; the fields of class LiftSet are hight, speed",
    ),
    ("robot.py", "from lift", "from lft", ["show"], "mine/robot.py:7: ModuleNotFoundError"),
    ("eds/protocol.yaml", "0x020", "0x010", ["make-eds", "mine/eds/protocol.yaml", "-o", "eds"], "identifier 0x010 is"),
    ("eds/protocol.yaml", "object: Lift}", "object: Lft}", ["make-eds", "mine/eds/protocol.yaml", "-o", "eds"], "Lft"),
    ("eds/protocol.yaml", "eurobot2014", "eurobt", ["make-eds", "mine/eds/protocol.yaml", "-o", "eds"], "eurobt"),
    ("strategy.py", "LiftSet(height, speed=100)", "messages.GotoXY(1, 2, 3, 4)", ["match"], "NameError"),
]


@pytest.mark.parametrize(("file", "old", "new", "words", "complaint"), MISTAKES)
def test_a_mistake_is_one_line_with_its_place(
    file: str, old: str, new: str, words: list[str], complaint: str, mine: Path
) -> None:
    text = (mine / file).read_text()
    assert old in text
    (mine / file).write_text(text.replace(old, new, 1))
    said = command(mine.parent, [*words, "--robot", "mine"])
    assert said.returncode in (1, 2)
    assert "eurobot_od/" not in said.stderr
    assert complaint in said.stderr
    assert len(said.stderr.splitlines()) == (1 if file != "strategy.py" else 5)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ("9999", "lift.py:18: FieldError: Lift State Response: height = 9999 is not allowed"),
        ("1 // 0", "lift.py:51: ZeroDivisionError"),
    ],
)
def test_an_error_of_its_node_in_a_match_names_the_place(wrong: str, complaint: str, mine: Path) -> None:
    text = (mine / "lift.py").read_text()
    (mine / "lift.py").write_text(text.replace("round(self.height)", wrong, 1))
    one, many = (command(mine.parent, ["match", "--robot", "mine", *more]) for more in ([], ["--seeds", "1"]))
    first, last = one.stderr.splitlines()
    assert (one.returncode, many.returncode) == (1, 1)
    assert complaint in first
    assert "no LiftStateResponse after" in last
    (row,) = [line for line in many.stdout.splitlines() if line.startswith("seed 1: ")]
    assert complaint in row
    assert "; no LiftStateResponse after" in row


def test_a_dialect_without_a_core_is_no_keyerror(made: Path, tmp_path: Path) -> None:
    (tmp_path / "few").mkdir()
    shutil.copy(made / "eds/canopen/lift.eds", tmp_path / "few")
    said = command(made, ["match", "--dialect", str(tmp_path / "few"), "--robot", "."])
    assert (said.returncode, len(said.stderr.splitlines())) == (2, 1)
    assert "a match needs a core" in said.stderr
