"""The programs `eurobot-od` and `canopen-workbench`: find the module of a command, run it, turn errors into one line.

They differ only in the robot that is used if none is named: the installed one, or none. Plug-ins (see `plugin`) may
have further commands.

A command is a typed function of the same name, whose parameters are its options (`signature`). It calls a typed
function of a lower layer, prints, and returns an `ExitStatus`, or None if everything is fine. Its module is imported
when the command is called.
"""

from __future__ import annotations

import errno
import gc
import os
import sys
from argparse import Action, ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import IntEnum
from importlib import import_module
from io import TextIOWrapper
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeAlias

from eurobot_od import errors
from eurobot_od.cli.signature import Command, Option, Parser, bus_named, describe, summary
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    from eurobot_od.loading import PluginKind
    from eurobot_od.plugin import Plugin, Plugins

COMMANDS = {
    "show": "show the messages as the EDS files map them, or one message's bits",
    "node": "run one device on a CAN bus",
    "send": "send a message, and wait for an answer",
    "check": "check nodes, real or simulated, with suites of steps in YAML",
    "faults": "list the faults that simulated nodes can be given",
    "decode": "decode logs: candump, ASC, BLF, CSV, TRC, SQLite, MF4, pcap, pcapng, or standard input",
    "archive": "put logs into a season: Parquet files of frames, messages and damage",
    "query": "query a season by SQL, or by a ready report, with pictures",
    "compare": "compare two logs: what differs, is missing, is late",
    "replay": "replay a log onto a bus with its recorded timing",
    "diagnose": "say what is wrong on a bus, or in a log, and what to do",
    "monitor": "watch a bus, or a log, as a live table, and record it",
    "serve": "show a bus, or logs, in a browser",
    "load": "compute how full a bus is, and how late each message can be",
    "lint": "check EDS, DCF and XDD files, one by one or as a network",
    "diff": "compare two EDS, DCF or XDD files, or one with a live node",
    "edit": "change an EDS or DCF: set, add, rename, remove, map, insert a profile",
    "export": "turn EDS, DCF and XDD files into other forms, such as the C of CANopenNode",
    "make-eds": "make EDS files from a table of a device or a network, or check them",
    "devices": "list the library of device files, or add files to it",
    "scan": "list the CANopen nodes of a bus",
    "read": "read objects of a CANopen node, by number or name",
    "write": "write one object of a CANopen node",
    "dump": "print all objects of a CANopen node, or write its DCF",
    "pdo": "list the PDOs that a CANopen node has now, map objects into one, switch one on or off",
    "configure": "configure a CANopen node from a DCF",
    "store": "have a CANopen node store its parameters",
    "restore": "have a CANopen node restore the defaults of its parameters",
    "lss": "find CANopen devices by LSS, and set node-ID and bit rate",
    "program": "download a program into a CANopen node, verify and start it",
    "drive": "enable, home and move a drive of CiA 402",
    "emcy": "print the errors that a CANopen node remembers, or clear them",
    "boot": "start a network as CiA 302-2 says: identity, configuration, heartbeat, start",
    "nmt": "start, stop or reset a CANopen node",
    "watch": "print when CANopen nodes boot, are lost and come back",
    "sync": "send SYNC messages at a fixed period",
    "time": "send the time as CANopen's TIME message",
    "new-device": "write a new device: table, EDS, suite, CI; or a maker's device package",
    "doctor": "print what is installed, the CAN interfaces, and how to fix what is wrong",
    "completion": "print the completion script of a shell",
}


MODULES = {
    **dict.fromkeys(("scan", "boot", "nmt", "watch", "sync", "time", "lss"), "bus"),
    **dict.fromkeys(("read", "write", "dump", "pdo", "emcy", "drive"), "objects"),
    **dict.fromkeys(("configure", "store", "restore", "program"), "objects"),
    "archive": "season",
    **dict.fromkeys(("export", "make-eds"), "files"),
    **dict.fromkeys(("doctor", "completion"), "installation"),
    **dict.fromkeys(("compare", "replay"), "decode"),
    "new-device": "new_device",
    "diff": "lint",
    "devices": "library",
    "faults": "node",
}
"""Modules of commands, where the name differs."""

PROGRAM = "eurobot-od"
WORKBENCH = "canopen-workbench"
"""Name of the program without a robot; `__main__.workbench` puts it into `sys.argv`."""

VERBOSE = {"-v": "INFO", "-vv": "DEBUG"}
"""Words before a command that turn on logging, with the level."""

ALLOCATIONS = 50_000
"""Number of new objects before Python's garbage collection runs; its default is 700."""


class ExitStatus(IntEnum):
    """The exit status of a command."""

    FINE = 0
    FOUND = 1
    """Findings, differences, failed checks; a node that refused or did not answer."""
    WRONG_INPUT = 2
    """Wrong usage of the command line, or a faulty file."""
    TROUBLE = 3
    """Failures of the bus, the file system, a node's hardware, or a simulated robot's world."""
    INTERRUPTED = 130


FROM_FILES = ("field", "message", "node")
"""Kinds of names that the devices' files bring."""

STATUS_OF = {
    errors.WorldError: ExitStatus.TROUBLE,
    errors.ProgramFailed: ExitStatus.FOUND,
    errors.RemoteError: ExitStatus.FOUND,
    errors.BusError: ExitStatus.TROUBLE,
    errors.NodeFailed: ExitStatus.TROUBLE,
    errors.EurobotError: ExitStatus.WRONG_INPUT,
    OSError: ExitStatus.TROUBLE,
}
"""The exit status of an error, by the first class that matches."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = expanded(sys.argv[1:] if arguments is None else arguments)
    try:
        _open_streams()
        with _plugin_warnings(), _logged(words) as words:
            return _run(words)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    except (errors.EurobotError, OSError) as error:
        if is_closed_pipe(error):  # `| head` has read enough, which is no error
            fall_silent()
            return ExitStatus.FINE
        if isinstance(error, errors.YamlError):
            # One line per problem, each beginning with its place, for editors.
            print(error, file=sys.stderr)
            if advice := log_instead(error.file):
                complain(f"{error.file}: {advice}")
            return ExitStatus.WRONG_INPUT
        what = str(error)
        if isinstance(error, OSError) and error.filename is not None:
            what = f"{error.filename}: {error.strerror}"  # the file first, as in our own errors
        complain("; ".join(filter(None, [what, _advice(error), *getattr(error, "__notes__", ())])))
        return next(status for kind, status in STATUS_OF.items() if isinstance(error, kind))


def _advice(error: Exception) -> str:
    """Return what to do about an error that a lower layer cannot know; empty if nothing."""
    if isinstance(error, errors.UnknownName) and error.kind == "node" and (bus := bus_named(str(error.name))):
        return bus
    if isinstance(error, errors.UnknownName) and not error.known and error.kind in FROM_FILES:
        return "names come from the devices' files: --eds or --network"
    if not isinstance(error, errors.DictionaryError) or not error.what.startswith("not an EDS"):
        return ""
    return "it is a DBC: --dbc names it" if error.file.lower().endswith(".dbc") else log_instead(error.file)


def log_instead(file: str) -> str:
    """Return what to do with a file that is a log and no EDS; empty if it is neither."""
    from eurobot_od.traffic.formats import is_log  # here, as most commands read no log

    return "it is a log: decode shows it, diagnose judges it" if is_log(file) else ""


def expanded(words: Sequence[str]) -> list[str]:
    """Return a command line with patterns such as `*.log` replaced by file names, which Windows leaves to programs."""
    if os.name != "nt" or not any("*" in each for each in words):
        return list(words)
    from glob import glob

    return [name for each in words for name in ("*" in each and sorted(glob(each))) or [each]]  # noqa: PTH207


def is_closed_pipe(error: Exception) -> bool:
    """Return whether an error means that the reader of standard output has closed it."""
    if os.name == "nt" and isinstance(error, OSError) and error.errno == errno.EINVAL:
        return error.filename is None
    return isinstance(error, BrokenPipeError)


def fall_silent() -> None:
    """Discard all further standard output."""
    # Python flushes standard output at its end, and would report the closed pipe.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def complain(what: str) -> None:
    """Print an error or warning on standard error, on one line."""
    with suppress(OSError):  # it may be on a full disk, too
        print(one_line(f"{program()}: {what}"), file=sys.stderr)


def program() -> str:
    """Return the name of the program that was started."""
    return WORKBENCH if is_alone() else PROGRAM


def is_alone() -> bool:
    """Return whether the program was started without a robot."""
    return sys.argv[:1] == [WORKBENCH]


@contextmanager
def _plugin_warnings() -> Iterator[None]:
    """Print warnings about plug-ins that are left out as one line each."""
    import warnings

    with warnings.catch_warnings():  # so that Python shows each warning again
        show = warnings.showwarning

        def warn(what: Warning | str, kind: type[Warning], file: str, line: int, *others: Any) -> None:
            if issubclass(kind, errors.RobotWarning):
                complain(str(what))
            else:
                show(what, kind, file, line, *others)

        warnings.simplefilter("default", errors.RobotWarning)
        warnings.showwarning = warn  # type: ignore[assignment]  # Python passes everything by position
        yield


@contextmanager
def _logged(words: list[str]) -> Iterator[list[str]]:
    """Yield the words without a leading `-v` or `-vv`; with one, log to standard error meanwhile."""
    level = VERBOSE.get(words[0]) if words else None
    if level is None:
        yield words
        return
    import logging  # here, as most commands do not log

    logger = logging.getLogger("eurobot_od")
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s.%(msecs)03d %(name)s: %(message)s", "%H:%M:%S"))
    logger.addHandler(handler)
    logger.setLevel(level)
    try:
        yield words[1:]
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)


def _open_streams() -> None:
    """Make standard output escape characters that it cannot encode. Raises OSError if it is closed."""
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115  # as long as the program
    if sys.stdout is None:
        raise OSError("standard output is closed")
    if isinstance(sys.stdout, TextIOWrapper):  # in tests it may be any text stream
        sys.stdout.reconfigure(errors="backslashreplace")


def _run(words: list[str]) -> int:
    words, robot = _robot_in(words)
    command = words[0] if words else "--help"
    if command.startswith("-"):
        _overview(robot_of_help(robot)).parse_args(words or [command])
        return ExitStatus.WRONG_INPUT
    # Imported modules and EDS files are ten thousand objects that stay in memory. Garbage collection among them took a
    # fifth of a quick command's time, so it is off while importing, and rare afterwards.
    gc.disable()
    try:
        found = find(command, robot)
        parser = Parser(f"{program()} {command}", description=summary(found), words=words[1:], robot=robot)
        describe(parser, with_robot)
        call = describe(parser, found)
        given = parser.read()
    finally:
        gc.freeze()
        gc.set_threshold(ALLOCATIONS)
        gc.enable()
    status = call(given)
    sys.stdout.flush()  # here, where a closed pipe is not an error
    return status or ExitStatus.FINE


def _robot_in(words: list[str]) -> tuple[list[str], str | None]:
    """Return the command line without `--robot`, and its value, which decides on commands and options."""
    if not any(each.partition("=")[0] == "--robot" for each in words):
        return words, None  # without a parser, whose help formatter imports three compression libraries
    finder = Parser(program(), add_help=False)
    finder.add_argument("--robot")  # never abbreviated, as a command may have an option that begins like it
    found, others = finder.parse_known_args(words)
    return others, found.robot


def _find(robot: str | None) -> Plugin:
    from eurobot_od import loading  # here, as most commands need no robot

    return loading.find(robot, alone=is_alone())


def _with_packages(robot: Plugin) -> Plugins:
    from eurobot_od.loading import packages
    from eurobot_od.plugin import Plugins

    return Plugins(robot, packages())


def robot_of_help(robot: str | None) -> Plugin:
    """Return the robot to use for help, none if several are installed and none is named."""
    try:
        return _find(robot)
    except errors.LocalError as error:
        if robot is not None:
            raise
        complain(str(error))
        return _find("none")


RobotName: TypeAlias = Annotated[
    str | None, Option("--robot", metavar="ROBOT", is_file=True), "robot to use: a name, a folder, a module, or none"
]


def with_robot(*, robot_name: RobotName = None) -> None:
    """Describe the options of every command."""


OTHERWISE_CALLED = {
    **dict.fromkeys(("candump", "sniff", "listen"), "monitor"),
    **dict.fromkeys(("record", "log", "capture"), "monitor --log FILE"),
    **dict.fromkeys(("convert", "transcode"), "monitor LOG --speed max --log FILE"),
    **dict.fromkeys(("validate", "verify"), "lint FILE, or check for a device"),
    **dict.fromkeys(("simulate", "slave"), "node"),
    **dict.fromkeys(("test", "run", "suites"), "check"),
    **dict.fromkeys(("statistics", "stats"), "decode --statistics"),
    **{each: f"drive NODE {each}" for each in ("enable", "disable", "home", "move", "jog")},
    **{each: f"export {each}" for each in ("canopennode", "cdcf", "dbc", "dcf", "docs", "mcap", "wireshark", "xdd")},
    "conformance": "check --conformance",
    "profile": "check --profile 401, or 402",
    "suite": "check FILE, or export suite for one of a log",
    "junit": "check --junit FILE",
    "report": "check --report FILE, or diagnose --report FILE",
    "fix": "lint --fix FILE",
    "map": "pdo NODE map",
    "cansend": "send",
    "upload": "read",
    "download": "write",
    "sdo": "read, or write",
    "discover": "scan",
    "heartbeat": "watch NODE, or write NODE 0x1017 MS for its period",
    "help": "COMMAND --help",
    "version": "--version",
}
"""Our commands for those of other programs, and for words that only options and actions have."""


def find(command: str, robot: str | None = None) -> Command:
    """Import a command of the workbench or the robot; raises UnknownName, and as `loading.find`."""
    found: Command = getattr(_module(command, robot), command.replace("-", "_"))
    return found


def _of_a_robot(command: str, robots: PluginKind) -> str:
    """Return which installed robot has a command, and how to call it; empty if none has."""
    for name in robots.installed():
        if command in robots.load(name).commands:
            return (
                f"{command} is a command of {name}: write {PROGRAM} {command}, or {program()} --robot {name} {command}"
            )
    return ""


def _module(command: str, robot: str | None) -> ModuleType:
    if command in COMMANDS:  # first, as a robot cannot replace these
        return import_module(f"eurobot_od.cli.{MODULES.get(command, command)}")
    from eurobot_od.loading import ROBOTS, blaming

    own = _with_packages(_find(robot)).commands()
    if command not in own:
        unknown = errors.UnknownName("command", command, [*COMMANDS, *own])
        if command in OTHERWISE_CALLED:
            raise errors.LocalError(f"unknown command {command!r}; here that is {OTHERWISE_CALLED[command]}")
        raise unknown if own else errors.LocalError(f"{_of_a_robot(command, ROBOTS) or unknown}")
    name = own[command].module
    with blaming(f"command {command}", name, name):
        return import_module(name)


class Version(Action):
    """Prints the version, which takes 40 ms to find."""

    def __call__(self, parser: ArgumentParser, *_: object) -> NoReturn:
        print(version())
        parser.exit()


def version() -> str:
    """Return the versions of this package and of Python."""
    from importlib import metadata  # this import takes the 40 ms

    try:
        return f"{program()} {metadata.version('eurobot-od')}, Python {sys.version.split()[0]}"
    except metadata.PackageNotFoundError:
        return f"{program()}, not installed, from {__file__}, Python {sys.version.split()[0]}"


def _overview(robot: Plugin) -> ArgumentParser:
    own = {name: each.text for name, each in _with_packages(robot).commands().items()}
    width = max(map(len, (*COMMANDS, *own)))

    def listed(commands: Mapping[str, str]) -> list[str]:
        return [f"  {name:{width}}  {text}" for name, text in commands.items()]

    ours = ["", f"{robot.name or 'device packages'}:", *listed(own)] if own else []
    explained = f"`{program()} COMMAND --help` explains it. Without an adapter `node NODE --share PORT` makes a bus."
    parser = Parser(
        program(),
        description="A CANopen workbench for any device's EDS, and for robots that are plugged in.",
        epilog="\n".join(["commands:", *listed(COMMANDS), *ours, "", explained]),
        kind=RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", metavar="COMMAND", help="one of the commands below")
    describe(parser, with_robot)
    parser.add_argument(
        "-v", action="store_true", help="before a command: log what it sends and hears (-vv: all of it)"
    )
    parser.add_argument("--version", action=Version, nargs=0, help="print the version and exit")
    return parser
