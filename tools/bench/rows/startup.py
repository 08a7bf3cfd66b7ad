"""Start-up of each command that runs without a bus partner, as whole processes, beside canopen loading the same files.

The table says which EDS files a command needs; the peer is canopen's `import_od` of just those. The files that a
command opens beyond them are counted too.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import canopen

from bench.eds import make_eds
from bench.measure import ONCE, Claim, Contender, Figures, Quantity, Scale, Series, Way
from bench.process import OURS, PROGRAMS, PYTHON, run, until_first_line
from bench.traffic import recorded_traffic, write_candump
from eurobot_od.client.configure import parameters
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of
from eurobot_od.robot import dialects

NODE = "drive"
"""The node whose files are used where a command wants one."""

ALL = ("core", NODE, "navigation")


class Command(NamedTuple):
    """A command by name, and the nodes whose EDS files it needs; `{...}` among its words are files of `made_files`.

    One that `goes_on` until it is ended is measured until its first line. `wanted` is the limit of its ratio to
    canopen's time.
    """

    name: str
    needs: tuple[str, ...]
    words: str
    wanted: float | None = None
    goes_on: bool = False

    def line(self, files: Mapping[str, Path]) -> list[str]:
        """Return its words; `_` within a word is a space."""
        return [word.replace("_", " ").format(**files) for word in self.words.split()]


COMMANDS = (
    Command("show", ALL, "show", 1.25),
    Command("show NAME", ALL, "show Goto_XY", 1.25),
    Command("decode, empty log", ALL, "decode {empty}", 1.25),
    Command("export dbc", ALL, "export dbc -o {output}"),
    Command("export cdcf", (NODE,), "export cdcf {dcf} -o {output}"),
    Command("diff of a file with itself", (NODE,), "diff {eds} {eds}"),
    Command("lint of a node's file", (NODE,), "lint {eds}"),
    Command("check --list of a suite", ALL, "check --list {suite}", 1.25),
    Command("faults", (), "faults"),
    Command("field, short log", ALL, "field {short} -o {picture}", 1.4),
    Command("monitor, short log", ALL, "monitor --speed max {short}"),
    Command("send on the in-process bus", ALL, "send Goto_XY x=1 y=1 angle=1 speed=1 -i virtual"),
    Command("match, until it begins", ALL, "match", 1.4, goes_on=True),
    Command("node, until it runs", (NODE,), f"node {NODE} -i virtual", 1.4, goes_on=True),
)
ENDING = (
    *(command for command in COMMANDS if not command.goes_on),
    Command("match of 1 s", ALL, "match --for 1"),
)
LOADING = "import sys, canopen\nfor file in sys.argv[1:]: canopen.import_od(file)"
MINIMAL_OBJECTS = 4
SHORT_LOG = 45
SUITE = f"""\
spec: 1
name: one step
node: {NODE}
steps:
  - send: Check Drive Request
"""

FILES = {
    "empty": "empty.log",
    "short": "short.log",
    "dcf": "drive.dcf",
    "minimal": "minimal.eds",
    "suite": "suite.yaml",
    "output": "output",
    "picture": "field.svg",
}
"""Makes the text of each file, by its name."""


@contextmanager
def made_files() -> Iterator[dict[str, Path]]:
    """Make the files that the commands read."""
    eds = dialects.folder() / f"{NODE}.eds"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = {key: folder / file for key, file in FILES.items()}
        files["empty"].touch()
        write_candump(files["short"], recorded_traffic(SHORT_LOG))
        files["dcf"].write_text(_dcf(eds))
        files["minimal"].write_text(make_eds(MINIMAL_OBJECTS, 0))
        files["suite"].write_text(SUITE)
        yield files | {"eds": eds}


def _dcf(eds: Path) -> str:
    dictionary = Dictionary.load(eds)
    values = {address_of(thing): dictionary.default(address_of(thing)) for thing in parameters(dictionary)}
    return dcf.with_values(dictionary.device, values, dictionary.node_id, NODE, 500)


def eds_files(nodes: Sequence[str]) -> list[Path]:
    """Return the EDS files of nodes."""
    return [dialects.folder() / f"{node}.eds" for node in nodes]


def peer(nodes: Sequence[str]) -> str:
    """Return the name of the contender that loads the EDS files of nodes with canopen."""
    return f"canopen, {len(nodes)} EDS"


# Times


@contextmanager
def bare(_: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield the commands that need no canopen, and a Python that does nothing."""
    with made_files() as files:
        yield {
            "pass": partial(run, [PYTHON, "-c", "pass"]),
            "--help": partial(run, [*OURS, "--help"]),
            "lint": partial(run, [*OURS, "lint", files["minimal"]]),
        }


@contextmanager
def beside_canopen(_: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield canopen that loads the files, and the commands."""
    needs = dict.fromkeys(command.needs for command in COMMANDS)
    loading = {peer(nodes): partial(run, [PYTHON, "-c", LOADING, *eds_files(nodes)]) for nodes in needs}
    with made_files() as files:
        yield loading | {command.name: partial(started, command, files) for command in COMMANDS}


def started(command: Command, files: Mapping[str, Path]) -> Figures:
    """Measure a command."""
    words = [*OURS, *command.line(files)]
    return until_first_line(words) if command.goes_on else run(words)


# A library

LIBRARY = 500
"""Files of a library."""

SCANNED = "".join(
    f"({sub}.0) can0 601#401810{sub:02X}00000000\n({sub}.1) can0 581#431810{sub:02X}01000000\n" for sub in (1, 2, 3)
)
"""A log in which node 1 answers that its vendor-ID, product code and revision are 1."""


@contextmanager
def library(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield a log decoded with a named file, and with the same file from a library, whose index is made beforehand."""
    with tempfile.TemporaryDirectory() as name, variable_set("XDG_CACHE_HOME", name):
        makers, log = Path(name, "makers"), Path(name, "scan.log")
        makers.mkdir()
        log.write_text(SCANNED)
        device = make_eds(MINIMAL_OBJECTS, 0)
        for product in range(1, scale.of(LIBRARY, 20) + 1):
            text = device.replace("[1018sub2]\n", f"[1018sub2]\nParameterValue={product}\n")
            (makers / f"{product}.eds").write_text(text)
        words: list[str | Path] = [*OURS, "decode", log, "--robot", "none"]
        run([*words, "--library", makers])
        yield {
            "named": partial(run, [*words, "--eds", f"1={makers / '1.eds'}"]),
            "library": partial(run, [*words, "--library", makers]),
        }


@contextmanager
def variable_set(name: str, value: str) -> Iterator[None]:
    """Set an environment variable, which started programs inherit."""
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        os.environ.pop(name)
        os.environ.update({name: before} if before is not None else {})


# A file, within a program that has both


@contextmanager
def loading(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield both readers of an EDS file."""
    file = eds_files([NODE])[0]
    times = scale.of(10, 1)
    yield {
        "ours": partial(timed, partial(Dictionary.load, file), times),
        "import_od": partial(timed, partial(canopen.import_od, str(file)), times),
    }


def timed(load: Callable[[], object], times: int) -> Figures:
    """Load a file a number of times, and return the time of one."""
    begin = time.perf_counter()
    for _ in range(times):
        load()
    return {Quantity.TIME: (time.perf_counter() - begin) / times}


# Files


@contextmanager
def opening(_: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield for each command the count of EDS and DCF files that it opens beyond those it needs or was given."""
    with made_files() as files:
        yield {each.name: partial(not_needed, each, files) for each in ENDING}


def not_needed(command: Command, files: Mapping[str, Path]) -> Figures:
    """Count the files that a command opens and does not need."""
    allowed = {str(each.resolve()) for each in _allowed(command, files)}
    return {Quantity.COUNT: len(opened(command, files) - allowed)}


def _allowed(command: Command, files: Mapping[str, Path]) -> list[Path]:
    return [*eds_files(command.needs), *(file for key, file in files.items() if f"{{{key}}}" in command.words)]


def opened(command: Command, files: Mapping[str, Path]) -> set[str]:
    """Return the names of the EDS and DCF files that a command opens."""
    report = files["output"].with_suffix(".opened")
    run([PYTHON, PROGRAMS / "opened.py", report, *command.line(files)])
    return set(report.read_text().split("\n")) - {""}


BARE_PYTHONS = 8.0
"""How many times as long as a bare Python (11 ms) a command may take that starts without canopen: 80 ms more."""

SERIES = (
    Series(
        "startup",
        "start without canopen",
        bare,
        tuple(Claim(f"{name}: python -c pass", name, "pass", Way.RATIO, BARE_PYTHONS) for name in ("--help", "lint")),
    ),
    Series(
        "startup",
        "start of commands",
        beside_canopen,
        tuple(
            Claim(f"start of {each.name}: {peer(each.needs)}", each.name, peer(each.needs), Way.RATIO, each.wanted)
            for each in COMMANDS
        ),
    ),
    Series(
        "startup",
        "a library of devices",
        library,
        (Claim(f"decode by a library of {LIBRARY} files: by a named file", "library", "named", Way.DIFFERENCE, 0.020),),
    ),
    Series(
        "startup",
        "load an EDS file",
        loading,
        (Claim("load a node's file: canopen's import_od", "ours", "import_od", Way.RATIO, 1.6),),
        often=3,
    ),
    Series(
        "startup",
        "EDS files opened",
        opening,
        tuple(
            Claim(f"EDS files that {each.name} opens without need", each.name, None, Way.ALONE, 0, Quantity.COUNT)
            for each in ENDING
        ),
        often=ONCE,
    ),
)
