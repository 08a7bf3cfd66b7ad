"""The set-up of an environment: when it is done, what it runs, and what a failure says."""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from typing import Any

import environment
import pytest
import run

# A stand-in for pip in the new environment: it keeps what it is asked for, and fails if told to.
PIP = """\
import os, pathlib, sys
with pathlib.Path({calls!r}).open("a") as calls:
    print(*sys.argv[1:], file=calls)
print("Collecting canopen>=2.4\\n  Using cached canopen.whl\\nInstalling collected packages: canopen")
if {status}:
    print("ERROR: " + {error!r}, file=sys.stderr)
sys.exit({status})
"""


class Checkout:
    """A repository with a pyproject.toml and a virtual environment that has the pip above."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.calls = root / "calls"
        self.calls.touch()
        self.change("one")
        venv.create(environment.FOLDER, with_pip=False)
        self.pip(0)

    def change(self, text: str) -> None:
        (self.root / "pyproject.toml").write_text(text)

    def pip(self, status: int, error: str = "no room") -> None:
        """Make pip end with this status, with a message if it is an error."""
        packages = next(environment.FOLDER.rglob("site-packages"))
        (packages / "pip.py").write_text(PIP.format(calls=str(self.calls), status=status, error=error))

    def installed(self) -> list[str]:
        """Return what pip was asked to install."""
        return [line.split(" --editable ")[1] for line in self.calls.read_text().splitlines()]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Checkout:
    folder = tmp_path / ".venv"
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")  # pip changes within a second, by no byte of its length
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "FOLDER", folder)
    monkeypatch.setattr(environment, "PYTHON", folder / environment.PYTHON.relative_to(environment.PYTHON.parents[1]))
    return Checkout(tmp_path)


@pytest.mark.parametrize(("ci", "is_locked"), [("true", True), ("", False)])
def test_only_ci_installs_the_locked_versions(checkout: Checkout, ci: str, is_locked: bool, monkeypatch: Any) -> None:
    monkeypatch.setenv("CI", ci)
    environment.prepare()
    assert (f"--constraint {environment.LOCK}" in checkout.calls.read_text()) is is_locked


def test_the_lock_has_what_pyproject_names_and_no_path() -> None:
    lines = environment.LOCK.read_text(encoding="utf-8").splitlines()
    assert all(re.fullmatch(r"[a-z0-9][a-z0-9._-]*==[^ @/]+( ; .*)?", each) for each in lines)
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {re.split(r"[^A-Za-z0-9_.-]", each)[0].lower() for each in wanted}
    assert names <= {each.partition("==")[0] for each in lines}


@pytest.mark.parametrize(
    ("words", "extras"),
    [
        (["canopen-workbench", "serve", "--control"], "[web]"),
        (["serve", "-i", "remote", "-c", "ws://127.0.0.1:54701/"], "[remote,web]"),
        (["node", "drive", "--share", "54701"], "[remote]"),
        (["match"], ""),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, list) else each,
)
def test_a_command_gets_the_extras_that_it_needs(checkout: Checkout, words: list[str], extras: str) -> None:
    program, *_ = run.command(words)
    assert Path(program).name in run.PROGRAMS
    assert checkout.installed() == [f"{checkout.root}{extras}"]
    run.command(["match"])
    assert len(checkout.installed()) == 1


def test_an_extra_that_is_there_is_not_installed(checkout: Checkout) -> None:
    (next(environment.FOLDER.rglob("site-packages")) / "aiohttp").mkdir()
    run.command(["serve"])
    assert checkout.installed() == [str(checkout.root)]


def test_sets_up_once(checkout: Checkout) -> None:
    assert environment.prepare() == environment.prepare() == environment.PYTHON
    assert checkout.installed() == [str(checkout.root)]


def test_sets_up_again_when_the_project_has_changed(checkout: Checkout) -> None:
    environment.prepare()
    checkout.change("two")
    environment.prepare()
    assert checkout.installed() == [str(checkout.root)] * 2


def test_sets_up_extras_apart(checkout: Checkout) -> None:
    environment.prepare()
    environment.prepare("test")
    environment.prepare("test")
    assert checkout.installed() == [str(checkout.root), f"{checkout.root}[test]"]


def test_sets_up_again_when_the_environment_is_gone(checkout: Checkout, monkeypatch: pytest.MonkeyPatch) -> None:
    environment.prepare()
    made: list[Path] = []

    def create(folder: Path, *, with_pip: bool) -> None:
        assert with_pip
        made.append(folder)
        real(folder, with_pip=False)
        checkout.pip(0)

    real = venv.create
    environment.PYTHON.unlink()
    monkeypatch.setattr(venv, "create", create)
    environment.prepare()
    assert made == [environment.FOLDER]


def test_an_unfinished_environment_is_made_anew(checkout: Checkout, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(folder: Path, **_: object) -> None:
        real(folder, with_pip=False)
        raise subprocess.CalledProcessError(1, "ensurepip")

    def create(folder: Path, **_: object) -> None:
        real(folder, with_pip=False)
        checkout.pip(0)

    real = venv.create
    environment.PYTHON.unlink()
    monkeypatch.setattr(venv, "create", fail)
    with pytest.raises(SystemExit, match="could not be made: Command 'ensurepip' returned non-zero exit status 1"):
        environment.prepare()
    left = environment.FOLDER / "left over"
    left.touch()
    monkeypatch.setattr(venv, "create", create)
    environment.prepare()
    assert not left.exists()
    assert not (environment.FOLDER / environment.UNFINISHED).exists()


def test_an_environment_without_pip_is_one_line(checkout: Checkout) -> None:
    next(environment.FOLDER.rglob("pip.py")).unlink()
    with pytest.raises(SystemExit) as ended:
        environment.prepare()
    assert ended.value.code == f"{environment.FOLDER} has no pip; remove it and try again"
    assert checkout.installed() == []


@pytest.mark.usefixtures("checkout")
@pytest.mark.parametrize("module", ["venv", "ensurepip"])
def test_a_python_that_cannot_make_environments_is_one_line_with_a_remedy(
    module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(environment, "find_spec", lambda name: None if name == module else object())
    environment.PYTHON.unlink()
    with pytest.raises(SystemExit) as ended:
        environment.prepare()
    said = str(ended.value.code)
    assert said.startswith(f"this Python has no {module}, which makes environments; ")
    assert "sudo apt install python3-venv" in said
    assert "\n" not in said


@pytest.mark.usefixtures("checkout")
def test_a_set_up_says_what_takes_so_long_and_an_environment_that_is_current_says_nothing(
    capfd: pytest.CaptureFixture[str],
) -> None:
    environment.prepare()
    steps = "  Collecting canopen>=2.4\n  Installing collected packages: canopen\n"
    assert capfd.readouterr() == ("", f"setting up .venv, once: what pip does follows ...\n{steps}")
    environment.prepare()
    assert capfd.readouterr() == ("", "")


def test_a_set_up_that_fails_says_why_and_is_tried_again(checkout: Checkout) -> None:
    checkout.pip(1)
    with pytest.raises(SystemExit) as ended:
        environment.prepare()
    assert ended.value.code == "pip could not install what is needed:\nERROR: no room"
    checkout.pip(0)
    environment.prepare()
    assert len(checkout.installed()) == 2


def test_a_set_up_without_a_network_is_one_line(checkout: Checkout) -> None:
    checkout.pip(1, "Retrying after connection broken by 'NewConnectionError(...)'\n" * 20)
    with pytest.raises(SystemExit) as ended:
        environment.prepare()
    assert ended.value.code == "pip reaches no package index, which it needs once to fill .venv: connect, and try again"


def test_a_set_up_that_is_interrupted_is_no_traceback(checkout: Checkout, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(environment, "_told", interrupted)
    with pytest.raises(SystemExit) as ended:
        environment.prepare()
    assert ended.value.code == 130
    assert checkout.installed() == []


def test_an_old_python_is_one_line(checkout: Checkout, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "OLDEST", (4, 0))
    with pytest.raises(SystemExit, match=r"^Python 4\.0 or newer is needed, this is 3\."):
        environment.prepare()
    assert checkout.installed() == []


def test_the_oldest_python_is_the_one_of_the_project() -> None:
    project = (environment.ROOT / "pyproject.toml").read_text()
    assert f'requires-python = ">={".".join(map(str, environment.OLDEST))}"' in project


@pytest.mark.usefixtures("checkout")
def test_the_stamp_is_the_projects_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)  # there it is that of the locked versions, too
    environment.prepare("test")
    wanted = hashlib.sha256(b"one").hexdigest()
    assert (environment.FOLDER / "installed-test").read_text() == wanted


@pytest.mark.parametrize("status", [0, 1, 3])
def test_call_gives_the_commands_exit_status(status: int) -> None:
    assert environment.call(Path(sys.executable), "-c", f"raise SystemExit({status})") == status


def test_call_passes_words_as_they_are(tmp_path: Path) -> None:
    file = tmp_path / "words"
    code = "import pathlib, sys; pathlib.Path(sys.argv[1]).write_text(sys.argv[2])"
    assert environment.call(sys.executable, "-c", code, file, "Goto XY; $HOME") == 0
    assert file.read_text() == "Goto XY; $HOME"


def test_an_interrupted_call_returns_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess, "run", interrupted)
    assert environment.call("true") == 130


def test_tools_need_nothing_but_the_standard_library() -> None:
    for tool in ("environment", "run", "test"):
        command = [sys.executable, "-I", "-S", "-c", f"import sys; sys.path.insert(0, 'tools'); import {tool}"]
        assert subprocess.run(command, cwd=environment.ROOT, check=False).returncode == 0, tool


def test_a_module_that_the_set_up_does_not_bring_is_asked_for_once(
    checkout: Checkout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys; sys.path[:0] = {[str(Path(environment.__file__).parent)]}\n"
        f"import environment, pathlib; environment.ROOT = pathlib.Path({str(tmp_path)!r})\n"
        f"environment.FOLDER = pathlib.Path({str(environment.FOLDER)!r})\n"
        f"environment.PYTHON = pathlib.Path({str(environment.PYTHON)!r})\n"
        "environment.ensure('no_such_module')\n"
    )
    monkeypatch.delenv(environment.ENSURED, raising=False)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "no module 'no_such_module'" in done.stderr.splitlines()[-1]
    assert checkout.installed() == [str(checkout.root)]
