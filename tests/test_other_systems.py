"""Windows and macOS: the package as it runs there, as far as Linux can show it.

`like_windows` takes from the package what Windows does not have. What it cannot show: another file system, console
and scheduler; for those the tests run in public CI on all three systems.
"""

from __future__ import annotations

import ast
import errno
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.support import files, progress
from tests.cli.console import Terminal
from tests.like_windows import MODULES, NAMES, Lacking

ROOT = Path(__file__).parents[1]
MOTOR = ("--eds", "5=motor.eds")
LOG = "(0.000000) can0 605#4000100000000000\n(0.000400) can0 585#4300100092010200\n"

COMMANDS = [
    # (command line, exit status, what it says)
    (("match", "--for", "5", "--log", "match.log"), 0, "points: ours"),
    (("match", "--for", "5", "--seeds", "2", "--jobs", "2"), 0, "2 matches"),
    (("match", "--for", "2", "--speed", "real"), 0, "points: ours"),
    (("lint", "motor.eds"), 0, "W442"),
    (("lint", "moto*.eds"), 0, "W442"),  # which a shell of Windows hands over as it is
    (("decode", "motor.log", *MOTOR), 0, "0x1000"),
    (("decode", "motor.log", *MOTOR, "--statistics"), 0, "605"),
    (("check", "drive", "--simulate", "--step", "check request"), 0, "11 ok"),
    (("check", "--conformance", "--simulate", "--tag", "emcy", *MOTOR), 0, "motor"),
    (("node", *MOTOR, "-i", "virtual", "-c", "can0", "--for", "100 ms", "--store", "kept.dcf"), 0, "node-ID 5"),
    (("monitor", "motor.log", "--statistics", *MOTOR), 0, "605"),
    (("archive", "mot*.log", "-o", "season", *MOTOR), 0, "motor.log"),
    (("query", "season", "SELECT count(*) AS n FROM frames"), 0, "2"),
    (("export", "mcap", "motor.log", "-o", "motor.mcap", *MOTOR), 0, ""),
    (("lint", "--fix", "motor.eds"), 0, ""),
    (("scan", "-i", "socketcan", "-c", "can0"), 3, "SocketCAN is a part of Linux"),
    (("doctor",), None, "eurobot-od "),
    (("completion", "bash"), 0, "eurobot"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("like_windows")
    (folder / "motor.eds").write_bytes((ROOT / "docs" / "motor.eds").read_bytes())
    (folder / "motor.log").write_text(LOG)
    return folder


@pytest.mark.long
@pytest.mark.parametrize(("words", "status", "says"), COMMANDS)
def test_a_command_runs_without_what_only_posix_has(
    words: tuple[str, ...], status: int | None, says: str, folder: Path
) -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "like_windows.py"), *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "CAN_INTERFACE": ""},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert status in (done.returncode, None), done.stderr
    assert says in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_modules_of_posix_only_are_not_imported_with_the_package() -> None:
    assert [(str(file), name) for file in sorted((ROOT / "eurobot_od").rglob("*.py")) for name in at_once(file)] == []


def at_once(file: Path) -> Iterator[str]:
    """Yield the modules that only POSIX has among those that a file imports when it is imported itself."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names if each.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield str(node.module)


@pytest.mark.posix
def test_the_package_is_shown_what_linux_has_and_windows_has_not() -> None:
    # or else the commands above would have been run with everything there
    here = {"os": os, "signal": signal, "socket": socket}
    for name, module in here.items():
        lacking = Lacking(module, NAMES[name], {})
        shown = [each for each in NAMES[name] if hasattr(module, each)]
        assert shown, name
        assert not any(hasattr(lacking, each) for each in shown)


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the modules of this file's tests see a system that is called "nt"."""
    for module in (cli, files, progress):
        monkeypatch.setattr(module, "os", Lacking(os, NAMES["os"], {"name": "nt"}))


@pytest.mark.usefixtures("windows")
def test_a_pattern_stands_for_files_where_the_shell_leaves_it_to_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("b.log", "a.log", "c.txt"):
        Path(name).touch()
    cases = {
        ("archive", "*.log"): ["archive", "a.log", "b.log"],
        ("archive", "*.blf"): ["archive", "*.blf"],  # nothing fits: the command says so by its name
        ("query", "SELECT * FROM runs"): ["query", "SELECT * FROM runs"],
        ("lint", "c.txt"): ["lint", "c.txt"],
    }
    for words, expanded in cases.items():
        assert cli.expanded(words) == expanded


def test_where_the_shell_expands_patterns_they_are_left_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if os.name == "nt":
        pytest.skip("this is Windows")
    monkeypatch.chdir(tmp_path)
    Path("a.log").touch()
    assert cli.expanded(("archive", "*.log")) == ["archive", "*.log"]


CLOSED = [
    # (what the operating system raises, on Windows, whether the reader of standard output has left)
    (BrokenPipeError(errno.EPIPE, "Broken pipe"), True, True),
    (BrokenPipeError(errno.EPIPE, "Broken pipe"), False, True),
    (OSError(errno.EINVAL, "Invalid argument"), True, True),
    (OSError(errno.EINVAL, "Invalid argument"), False, False),
    (OSError(errno.EINVAL, "Invalid argument", "a?.log"), True, False),  # a file's name, which is none there
    (OSError(errno.ENOSPC, "No space left on device"), True, False),
]


@pytest.mark.parametrize(("error", "on_windows", "closed"), CLOSED)
def test_a_closed_pipe_is_recognised(
    error: OSError, on_windows: bool, closed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "os", Lacking(os, set(), {"name": "nt" if on_windows else "posix"}))
    assert cli.is_closed_pipe(error) is closed


COLOURED = [
    # (variables, whether there are colours)
    ({}, False),  # the old console prints the sequences as they are
    ({"WT_SESSION": "0"}, True),
    ({"TERM": "xterm"}, True),  # Git's bash, ssh
    ({"TERM": "dumb"}, False),
    ({"WT_SESSION": "0", "NO_COLOR": "1"}, False),
]


@pytest.mark.usefixtures("windows")
@pytest.mark.parametrize(("variables", "coloured"), COLOURED)
def test_colours_are_for_terminals_that_know_them(
    variables: dict[str, str], coloured: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (*progress.WITH_COLOURS, "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert progress.in_colour(Terminal()) is coloured


@pytest.mark.usefixtures("windows")
@pytest.mark.parametrize("refusals", [0, 3])
def test_a_file_that_somebody_reads_is_replaced_once_they_have_read_it(
    refusals: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, left = Path.replace, [PermissionError(errno.EACCES, "somebody reads it")] * refusals

    def refused(beside: Path, target: Path) -> Path:
        if left:
            raise left.pop()
        return replace(beside, target)

    monkeypatch.setattr(Path, "replace", refused)
    (tmp_path / "kept.dcf").write_bytes(b"old")
    files.write_whole(tmp_path / "kept.dcf", b"new")
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"new"]


@pytest.mark.usefixtures("windows")
def test_a_file_that_is_read_for_ever_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Path) -> Path:
        raise PermissionError(errno.EACCES, "somebody reads it")

    monkeypatch.setattr(Path, "replace", refused)
    monkeypatch.setattr(files, "LONGEST_WAIT", 0.02)
    (tmp_path / "kept.dcf").write_bytes(b"old")
    with pytest.raises(PermissionError, match=r"kept\.dcf"):
        files.write_whole(tmp_path / "kept.dcf", b"new")
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"old"]
