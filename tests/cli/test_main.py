"""The two programs themselves: their overview, their exit statuses, and that help costs nothing."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import is_dataclass
from importlib.metadata import PackageNotFoundError
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, cast, get_type_hints

import pytest

from eurobot_od import cli
from eurobot_od.cli.signature import Command, Forms, Hint, Parser, parameter_help
from eurobot_od.errors import BusError, DictionaryError, NoAnswer, StateError, UnknownName, WorldError
from eurobot_od.loading import ROBOTS
from tests.cli.console import run
from tests.kit import plant


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_the_overview_names_every_command(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    said = run(capsys, *words)
    assert said.status == 0
    for command, text in cli.COMMANDS.items():
        assert f"  {command} " in said.out
        assert text in said.out


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["nonsense"], "unknown command 'nonsense'; known: show, node, "),
        (["decod", "a.log"], "unknown command 'decod'; did you mean decode?"),
        (["Nmt"], "unknown command 'Nmt'; did you mean nmt?"),
        (["--nonsense"], "error: the following arguments are required: COMMAND"),
    ],
)
def test_an_unknown_command_is_wrong_usage(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    said = run(capsys, *words)
    assert said.status == 2
    assert said.complaint.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1


def test_the_version_includes_python_s(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "--version")
    assert (said.status, said.err) == (0, "")
    assert re.fullmatch(r"eurobot-od [0-9.]+(rc[0-9]+)?, Python 3\.[0-9.]+\S*\n", said.out)


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_explains_itself(capsys: pytest.CaptureFixture[str], command: str) -> None:
    said = run(capsys, command, "--help")
    assert said.status == 0
    assert said.out.startswith(f"usage: eurobot-od {command}")


NAMED = [
    # what is typed after `canopen-workbench`, and the line that names it
    (["--version"], "canopen-workbench 1."),
    (["--help"], "`canopen-workbench COMMAND --help` explains it."),
    (["show", "--help"], "usage: canopen-workbench show "),
    (
        ["show", "--nonsense"],
        "canopen-workbench show: error: unrecognized arguments: --nonsense; its options: ",
    ),
    (["nonsense"], "canopen-workbench: unknown command 'nonsense'"),
    (["--robot"], "canopen-workbench: error: argument --robot: expected one argument"),
    (["decode", "nowhere.log"], "canopen-workbench: nowhere.log: No such file"),
    (["show"], "canopen-workbench: which devices? Name them by --eds or --network, or a robot by --robot"),
    (["node"], "canopen-workbench: which node?"),
    (["check"], "canopen-workbench: which suites? "),
    (["show", "--robot", "nobody"], "canopen-workbench: unknown robot 'nobody'; known: eurobot2014"),
]


@pytest.mark.parametrize(("words", "named"), NAMED)
def test_messages_name_the_started_program(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [cli.WORKBENCH])
    monkeypatch.delenv(ROBOTS.variable, raising=False)
    said = run(capsys, *words)
    assert any(line.startswith(named) for line in (said.out + said.err).splitlines()), said
    assert "eurobot-od" not in (said.out + said.err).replace("eurobot-od.yaml", "")


@pytest.mark.parametrize(
    ("error", "status", "complaint"),
    [
        (NoAnswer("m.CheckLiftRequest", "m.CheckLiftResponse", 2, 0.5), 1, "no m.CheckLiftResponse after"),
        (UnknownName("message", "Gotto"), 2, "unknown message 'Gotto'"),
        (StateError("not now"), 2, "not now"),
        (DictionaryError("panel.eds", 0x1800, "broken"), 2, "panel.eds: 0x1800: broken"),
        (BusError("the bus failed"), 3, "the bus failed"),
        (WorldError("the world does not answer"), 3, "the world does not answer"),
        (FileNotFoundError(2, "No such file", "a.log"), 3, "a.log: No such file"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_an_error_becomes_one_line_and_an_exit_status(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    status: int,
    complaint: str,
) -> None:
    def doctor() -> None:
        raise error

    monkeypatch.setattr("eurobot_od.cli.installation.doctor", doctor)
    said = run(capsys, "doctor")
    assert said.status == status
    assert said.err.startswith(f"eurobot-od: {complaint}" if complaint else "")
    assert said.err.count("\n") == bool(complaint)


def test_an_unexpected_error_shows_its_traceback(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.cli.installation.doctor", lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        run(capsys, "doctor")


def python(code: str) -> str:
    """Run a program in a Python of its own, where no robot is named, and return what it printed."""
    environment = {name: value for name, value in os.environ.items() if name != ROBOTS.variable}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60, env=environment)
    return done.stdout.strip()


def test_help_imports_nothing_heavy_unless_the_command_is_about_objects_of_devices() -> None:
    code = """
import contextlib, io, sys
from eurobot_od import cli
HEAVY = ("check", "new_device", "node", "objects", "parameters")
light = [each for each in cli.COMMANDS if cli.MODULES.get(each, each) not in HEAVY]
with contextlib.redirect_stdout(io.StringIO()):
    for words in [[], *([command, "--help"] for command in light)]:
        with contextlib.suppress(SystemExit):
            cli.main(words)
print(sorted({"can", "canopen", "numpy", "yaml"} & set(sys.modules)))
"""
    assert python(code) == "[]"


@pytest.mark.parametrize(
    ("words", "without"),
    [
        ("show", "yaml rich eurobot_od.bus.live eurobot_od.client.master"),  # messages, from the EDS files alone
        ("decode -", "rich eurobot_od.bus.live eurobot_od.client.master"),  # a log needs no bus
        ("monitor --plain --speed max -", "rich eurobot_od.client.configure"),  # plain lines, and nothing is asked
    ],
)
def test_a_command_imports_only_what_it_needs(words: str, without: str) -> None:
    code = f"""
import contextlib, io, sys
from eurobot_od import cli
sys.stdin = io.TextIOWrapper(io.BytesIO())
with contextlib.redirect_stdout(io.StringIO()):
    cli.main({words.split()!r})
print(sorted(set({without.split()!r}) & set(sys.modules)))
"""
    assert python(code) == "[]"


def test_the_package_runs_as_a_program() -> None:
    done = subprocess.run([sys.executable, "-m", "eurobot_od", "show"], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("COB-ID  message")
    assert len(done.stdout.splitlines()) == 1 + len(plant.protocol().bindings)


@pytest.mark.long
def test_a_closed_pipe_is_no_error() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "eurobot_od", "show"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 0


SERVO = Path(__file__).parents[2] / "docs" / "servo.eds"
INTERRUPTED_IMPORT = """
import sys
class Interrupt:
    module = sys.argv.pop(1)
    def find_spec(self, name, *_):
        if name == self.module:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
from eurobot_od.__main__ import run, workbench
sys.exit({run}())
"""


@pytest.mark.parametrize("program", ["run", "workbench"])
@pytest.mark.parametrize("module", ["eurobot_od.cli", "eurobot_od.cli.show", "eurobot_od.od.values", "canopen"])
def test_ctrl_c_during_an_import_gives_no_traceback(program: str, module: str) -> None:
    code = INTERRUPTED_IMPORT.replace("{run}", program)
    words = [module, "show", "--eds", f"5={SERVO}"]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


# Standard streams


NO_SPACE = "eurobot-od: [Errno 28] No space left on device\n"
STREAMS = [
    ("decode <&-", 2, "eurobot-od: standard input is closed\n"),
    ("show >&-", 3, "eurobot-od: standard output is closed\n"),
    ("decode nowhere.log 2>&-", 2, ""),
    ("decode nowhere.log 2>/dev/full", 2, ""),
    *((f"{words} >/dev/full", 3, NO_SPACE) for words in ("--help", "show --help", "--version", "completion bash")),
]


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a shell, and a device that is always full")
@pytest.mark.parametrize(("words", "status", "said"), STREAMS)
def test_a_closed_or_full_stream_is_one_line_and_no_traceback(words: str, status: int, said: str) -> None:
    done = subprocess.run(f"{sys.executable} -m eurobot_od {words}", shell=True, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", said)


def test_characters_that_a_stream_cannot_write_are_escaped(tmp_path: Path) -> None:
    file = tmp_path / "name\udc80.log"
    file.write_text("(1.0) can0 182#\n")
    words = [sys.executable, "-m", "eurobot_od", "decode", str(file), str(file)]
    environment = os.environ | {"PYTHONIOENCODING": "ascii:strict"}
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.startswith(str(tmp_path) + "/name\\udc80.log:")


HUGE = [
    (["send", "Move To", f"x=0x{'F' * 5000}"], "is not allowed; allowed: 0..3000 mm"),
    (["read", "9" * 4400, "0x1000", "-i", "virtual"], "is not in 1..127"),
    (["node", "panel", "--for", "9" * 4400 + " s"], "is not a duration"),
]


@pytest.mark.parametrize(("words", "what"), HUGE)
def test_numbers_of_thousands_of_digits_are_refused_in_one_line(
    words: list[str], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, *words)
    assert (said.status, what in said.err, said.err.count("\n")) == (2, True, 1)


def functions_of(command: Command) -> Iterable[Callable[..., Any]]:
    """Yield the functions of a command, one for each of its forms."""
    return command.functions.values() if isinstance(command, Forms) else [command]


def options(function: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """Yield the help and the default of each option of a function, those of its groups too."""
    hints = get_type_hints(function, include_extras=True)
    texts = parameter_help(function)
    for name, parameter in signature(function).parameters.items():
        hint = Hint.of(hints[name], Parser("of"))
        if is_dataclass(hint.kind):
            yield from options(cast(type, hint.kind))
        else:
            yield texts.get(name, hint.text or ""), parameter.default


FORMS = [form for name in (*cli.COMMANDS, "match", "world") for form in functions_of(cli.find(name))]
UNITS = {"ms": 0.001, "s": 1.0, "": 1}
DEFAULT = re.compile(r"\((?:default: )?(0x[0-9A-F]+|[\d.]+) ?(ms|s|)\)$")


def test_every_option_has_a_help(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(ROBOTS.variable)  # `node` has the options of the robot that is installed, where FORMS are made
    assert [function.__name__ for function in FORMS for text, _ in options(function) if not text] == []


def test_defaults_are_those_in_the_help() -> None:
    given = [each for function in FORMS for each in options(function) if each[1] not in (None, Parameter.empty)]
    said = [(found, default) for text, default in given if (found := DEFAULT.search(text))]
    numbers = [
        (int(found[1], 0) if found[1].startswith("0x") else float(found[1]) * UNITS[found[2]], default)
        for found, default in said
    ]
    assert len(numbers) > 30
    assert [each for each in numbers if each[0] != each[1]] == []


@pytest.mark.parametrize(("words", "said"), [
    (["-v", "lint", "docs/motor.eds"], ""),
    (["-v", "nmt", "5", "start", "-i", "virtual", "-c", "verbose"], "eurobot_od.nmt: node 5: command start"),
    (["-vv", "read", "5", "0x1000", "-i", "virtual", "-c", "verbose"], "eurobot_od.sdo: node 5: read 0x"),
    (["read", "5", "0x1000", "-i", "virtual", "-c", "verbose"], ""),
])  # fmt: skip
def test_v_before_a_command_logs_its_work(capsys: pytest.CaptureFixture[str], words: list[str], said: str) -> None:
    cli.main(words)
    logged = [line for line in capsys.readouterr().err.splitlines() if " eurobot_od." in line]
    assert any(said in line for line in logged) if said else not logged
    assert not logging.getLogger("eurobot_od").handlers


def test_where_it_is_not_installed_the_version_says_where_it_lies(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: str) -> str:
        raise PackageNotFoundError

    monkeypatch.setattr("importlib.metadata.version", missing)
    python = ".".join(map(str, sys.version_info[:3]))
    assert cli.version().endswith(f", not installed, from {cli.__file__}, Python {python}")
