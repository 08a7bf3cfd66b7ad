"""Every command and every example of the documentation runs as it stands, and prints what the page says.

A block with a comment `<!-- not run: why -->` before it is left out, one with `<!-- exit status 0 or 1 -->` ends so. A
block with a title is a file. What follows a command is what it prints, `...` standing for any lines or the rest of one;
a command that nothing follows may print what it likes. Commands run in a folder that has the checkout's, and on a bus
inside the process, whatever bus they name. What would go on for ever is interrupted at its first line. A command with
`&` at its end is a process of its own, on the bus that it names, up to the end of its page.
"""

from __future__ import annotations

import io
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest
import run
from canopen.sdo.client import SdoClient
from interop_rows.bench import PATIENCE, live, open_bus

from eurobot_od import cli
from eurobot_od.bus.live import Live
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.simulated import SimulatedDevice
from tests.processes import free_port, process

ROOT = Path(__file__).parents[1]
PAGES = {
    str(file.relative_to(ROOT)): file.read_text(encoding="utf-8")
    for pattern in ("*.md", "docs/*.md", "tools/**/*.md")
    for file in sorted(ROOT.glob(pattern))
}
BLOCK = re.compile(r'^(?:<!-- (.*?) -->\n)?```(\w+)(?: title="(.*?)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)
COMMENT = re.compile(r"|exit status \d( or \d)*|not run: .{8,}")
PRINTED = re.compile(r"^ *print\(.*\)  # (.*)$", re.MULTILINE)

STAND_INS = (
    # (what a page says, what is run): a drive whose core is off; no comment; a bus of this process; short matches, and
    # few; any free port
    (r"(.*) can0  # .*core.* off", r"\1 can2"),
    (r"\s+# .*", ""),
    (r"socketcan", "virtual"),
    (r"-i remote -c ws://\S+", "-i virtual -c can0"),
    (r"--seeds \d+", "--seeds 2 --jobs 1"),
    (r"(eurobot-od match\b(?!.*--(?:duration|emergency-at)))", r"\1 --for 5"),
    (r"((?:eurobot-od|canopen-workbench) serve.*)", r"\1 --listen 127.0.0.1:0"),
)
ENDLESS = ("node", "monitor", "serve")
READY = {"python": "Server listening", "eurobot-od": "Ctrl-C ends it"}
"""What a program says when others may rely on it."""

PORT = "54701"
"""The port of a page's bus server: it may be taken."""


class Block(NamedTuple):
    """A fenced block: the comment before it, its language, the file that it is, and its text."""

    comment: str
    language: str
    title: str
    text: str

    @property
    def runs(self) -> bool:
        return self.language in ("console", "python") and not self.comment.startswith("not run: ")


BLOCKS = {page: [Block(*found) for found in BLOCK.findall(text)] for page, text in PAGES.items()}


class Command(NamedTuple):
    """A line after `$`, and the lines that it prints, none if the page does not say."""

    line: str
    printed: tuple[str, ...]


def commands(text: str) -> Iterator[Command]:
    """Yield the commands of a block."""
    for each in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        line, *printed = each.rstrip("\n").split("\n")
        yield Command(line, tuple(printed))


def agrees(printed: Sequence[str], lines: Sequence[str]) -> bool:
    """Return whether lines are what a page says; its lines `...` stand for any number of them."""
    if not printed:
        return not lines
    first, *rest = printed
    if first.strip() == "...":
        return any(agrees(rest, lines[skipped:]) for skipped in range(len(lines) + 1))
    begin, cut, _ = first.partition("...")
    if not lines or not (lines[0].rstrip() == first or (cut and lines[0].startswith(begin))):
        return False
    return agrees(rest, lines[1:])


class Terminal(io.TextIOWrapper):
    """What a command writes to; at the first line of an endless one somebody presses Ctrl-C."""

    def __init__(self, endless: bool) -> None:
        self.written = io.BytesIO()
        super().__init__(self.written, encoding="utf-8", write_through=True)
        self._waits = endless

    def write(self, text: str) -> int:
        if self._waits and "\n" in text:
            self._waits = False
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        return super().write(text)


class Shell:
    """Runs the commands of a page."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, leaving: ExitStack) -> None:
        self._monkeypatch, self._leaving = monkeypatch, leaving
        self._port = str(free_port())

    def with_free_port(self, text: str) -> str:
        """Return what a block says, with a port that nobody uses."""
        return text.replace(PORT, self._port)

    def run(self, line: str) -> tuple[int, list[str]]:
        """Run a command; give its exit status, and the lines that it printed."""
        if line.endswith(" &"):
            return self._beside(*shlex.split(self.with_free_port(line.removesuffix(" &"))))
        for pattern, instead in STAND_INS:
            line = re.sub(pattern, instead, line)
        program, *words = self._globbed(shlex.split(line))
        if (program, words[0]) == ("python3", "tools/run.py"):
            program = words.pop(0)
        if "mine" in words:  # a robot's own modules are imported into a process of its own
            return self._elsewhere(words)
        if program == "tools/run.py":
            program, *words = words if words[0] in run.PROGRAMS else (cli.PROGRAM, *words)
        if program in run.PROGRAMS:
            return self._called(program, words)
        {"export": self._export, "cp": self._cp, "rm": self._rm, "cd": self._cd}[program](words)
        return 0, []

    def _beside(self, program: str, *words: str) -> tuple[int, list[str]]:
        """Run a program beside the page, once it is ready."""
        module = () if program == "python" else ("-m", "eurobot_od")
        running = self._leaving.enter_context(process(sys.executable, *module, *words))
        running.line(READY[program])
        return 0, []

    def _globbed(self, words: list[str]) -> Iterator[str]:
        for word in words:
            yield from sorted(map(str, Path().glob(word))) if word.startswith("*") else [word]

    def _called(self, program: str, words: list[str]) -> tuple[int, list[str]]:
        self._monkeypatch.setattr(sys, "argv", [program])
        endless = words[0] in ENDLESS
        terminal = Terminal(endless)
        with redirect_stdout(terminal), redirect_stderr(terminal):
            try:
                status = cli.main(words)
            except SystemExit as end:
                status = int(end.code or 0)
        if endless and status == cli.ExitStatus.INTERRUPTED:
            status = 0
        return status, terminal.written.getvalue().decode().splitlines()

    def _elsewhere(self, words: list[str]) -> tuple[int, list[str]]:
        line = [sys.executable, "-m", "eurobot_od", *words]
        done = subprocess.run(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
        return done.returncode, done.stdout.splitlines()

    def _rm(self, words: list[str]) -> None:
        for word in words:
            Path(word).unlink()

    def _export(self, words: list[str]) -> None:
        for word in words:
            self._monkeypatch.setenv(*word.split("=", 1))

    def _cd(self, words: list[str]) -> None:
        self._monkeypatch.chdir(*words)

    def _cp(self, words: list[str]) -> None:
        shutil.copy(*words)


@pytest.fixture(scope="module")
def bus() -> Iterator[None]:
    """The robot and a motor on can0, a drive on can1, the robot's drive alone on can2, for all of this process."""
    with ExitStack() as stack:
        for role in ("core", "drive", "navigation"):
            stack.enter_context(live(role, open_bus("can0")))
        stack.enter_context(live("drive", open_bus("can2")))
        motor = SimulatedDevice.load(ROOT / "docs" / "motor.eds", node_id=5, given={"Motor.Speed": 1200})
        stack.enter_context(Live.node(open_bus("can0"), motor))
        servo = SimulatedDrive.load(ROOT / "docs" / "servo.eds", node_id=5)
        stack.enter_context(Live.node(open_bus("can1"), servo))
        yield


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shell]:
    """A shell in a folder with the checkout's folders, and EDS files."""
    for name in ("docs", "eds", "eurobot_od"):
        (tmp_path / name).symlink_to(ROOT / name)
    for file in (ROOT / "docs" / "motor.eds", *(ROOT / "eds" / "canopen").iterdir()):
        shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    for name in ("CAN_INTERFACE", "CAN_CHANNEL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(SdoClient, "RESPONSE_TIMEOUT", PATIENCE)
    with ExitStack() as leaving:
        yield Shell(monkeypatch, leaving)


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize("page", [page for page, blocks in BLOCKS.items() if any(each.runs for each in blocks)])
def test_a_page_runs_as_it_stands(page: str, shell: Shell, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": page}
    for block in BLOCKS[page]:
        if block.title:
            Path(block.title).parent.mkdir(parents=True, exist_ok=True)
            Path(block.title).write_text(block.text, encoding="utf-8")
        elif block.runs and block.language == "python":
            capsys.readouterr()
            exec(compile(shell.with_free_port(block.text), page, "exec"), names)
            assert agrees(PRINTED.findall(block.text), capsys.readouterr().out.splitlines()), block.text
        elif block.runs:
            wanted = set(map(int, re.findall(r"\d+", block.comment))) or {0}
            for line, printed in commands(block.text):
                status, lines = shell.run(line)
                assert status in wanted, (line, lines[-8:])
                assert not printed or agrees(printed, lines), (line, lines[:40])


WORKFLOW = ".github/workflows/device.yml"


@pytest.mark.parametrize("page", ["docs/checks.md"])
def test_the_commands_of_a_page_s_workflow_are_green(page: str, shell: Shell) -> None:
    files = {each.title: each.text for each in BLOCKS[page] if each.title}
    for name in ("motor-values.yaml",):
        Path(name).write_text(files[name], encoding="utf-8")
    lines = re.findall(r"- run: (canopen-workbench .*)", files[WORKFLOW])
    assert [(line, shell.run(line)[0]) for line in lines] == [(line, 0) for line in lines]
    assert len(lines) == 3


def test_the_names_that_a_class_of_ours_has_are_listed() -> None:
    listed = PAGES["docs/python.md"].partition("These names are ours.")[2].partition("###")[0]
    assert set(re.findall(r"`(\w+)`", listed)) == {name for name in dir(SimulatedDevice) if name[0] != "_"}


def test_every_page_is_listed() -> None:
    listed = re.findall(r"\]\(([^)]+)\)", PAGES["docs/pages.md"])
    pages = {each for each in PAGES if each.startswith("docs/")}
    assert pages - {"docs/pages.md"} <= {f"docs/{each}" for each in listed}


def test_every_command_is_in_the_table_of_first_steps() -> None:
    table = PAGES["docs/first-steps.md"].partition("## All commands")[2].partition("\n## ")[0]
    assert [each for each in cli.COMMANDS if f"`{each}`" not in table] == []


def test_few_blocks_cannot_run_and_each_says_why() -> None:
    blocks = [each for page in BLOCKS.values() for each in page if each.language in ("console", "python")]
    assert sum(not each.runs for each in blocks) <= 0.25 * len(blocks)
    assert [each.comment for each in blocks if not COMMENT.fullmatch(each.comment)] == []


AGREE = [
    # (what the page says, what came, whether that is the same)
    (["a", "b"], ["a", "b"], True),
    (["a"], ["a", "b"], False),
    (["a", "..."], ["a", "b", "c"], True),
    (["...", "c"], ["a", "b", "c"], True),
    (["...", "b"], ["a", "b", "c"], False),
    (["a..."], ["abc"], True),
    (["a..."], ["bc"], False),
    ([], ["a"], False),
]


@pytest.mark.parametrize(("printed", "lines", "same"), AGREE)
def test_printed_output_is_compared(printed: list[str], lines: list[str], same: bool) -> None:
    assert agrees(printed, lines) is same
