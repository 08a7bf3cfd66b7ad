"""Makes the command line of a typed function from its parameters.

A positional parameter is an argument, a keyword-only one an option: `node_id` is `--node-id`. Without a default it is
required. `bool` is a switch, `Sequence` takes any number of values, a `Literal` or an `Enum` has its choices, and a
dataclass is a group of options, its fields. `Annotated` adds what name and type do not say: an `Option`, or a
`HelpGroup`. The help is the docstring: its first line is about the command, and each parameter has a line.

    def sync(*, count: Annotated[int | None, Option(metavar="N")] = None, bus: BusOptions) -> None:
        '''Send SYNC messages until Ctrl-C or --count.

        count: end after N messages
        '''
"""

from __future__ import annotations

import os
import re
import sys
import typing
from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError, HelpFormatter, Namespace, _ActionsContainer
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from functools import partial
from inspect import Parameter, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, NoReturn, TypeAlias, Union, cast

from eurobot_od.errors import LocalError, UnknownName, look_up, meant

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

    from eurobot_od.plugin import Plugins

Call: TypeAlias = Callable[[Namespace], Any]
"""Calls a function with the values of a command line."""


# Annotations


class Option(NamedTuple):
    """Details of an option or argument; several are merged.

    `flag` is a short form, `-o`, or a long one instead of the parameter's name, `--for`. `read` parses a word, or
    raises LocalError. `choices` are the allowed words; with a mapping, the function gets the word's value. `bare` is
    the value of an option without one; `nargs` is argparse's. Options with the same `either` exclude each other. A
    shell suggests what `suggest` returns for the plug-ins, or files if `is_file`. With `is_output` the file is written,
    and may be none of those that are read.
    """

    flag: str = ""
    metavar: str | None = None
    read: Callable[[str], Any] | None = None
    choices: Iterable[Any] = ()
    bare: str | None = None
    nargs: str | None = None
    either: str = ""
    suggest: Callable[[Plugins], Iterable[str]] | None = None
    is_file: bool = False
    is_output: bool = False

    def __or__(self, other: Option) -> Option:
        """Return both merged; the other one takes precedence."""
        return self._replace(**{name: it for name, it in other._asdict().items() if it != self._field_defaults[name]})

    def __hash__(self) -> int:
        return id(self)  # `typing` hashes annotations, but choices may be unhashable

    @property
    def words(self) -> Mapping[str, Any]:
        """The values of the allowed words; empty if any word is allowed."""
        return self.choices if isinstance(self.choices, Mapping) else {str(each): each for each in self.choices}


class HelpGroup(NamedTuple):
    """The heading of a group in the help: the `GROUP` of a dataclass, or an annotation of a parameter."""

    title: str
    description: str | None = None


class Chosen(NamedTuple):
    """Makes the hint of a parameter that depends on the robot or the command line; NOTHING removes the parameter."""

    hint: Callable[[Parser], Hint]


class Hint(NamedTuple):
    """The parts of an annotation: the type of a value, whether there may be several, and the details.

    `text` is help that several parameters share; the docstring takes precedence.
    """

    kind: Any
    several: bool = False
    option: Option = Option()
    text: str | None = None
    group: HelpGroup | None = None

    @classmethod
    def of(cls, annotation: Any, parser: Parser) -> Hint:
        """Parse an annotation; outer details take precedence."""
        origin = typing.get_origin(annotation)
        inside = typing.get_args(annotation)
        if origin in (Union, UnionType):
            (only,) = (each for each in inside if each is not NoneType)
            return cls.of(only, parser)
        if origin is Sequence:
            return cls.of(inside[0], parser)._replace(several=True)
        if origin is Literal:
            return cls(type(inside[0]), option=Option(choices=inside))
        if isinstance(annotation, type) and issubclass(annotation, Enum):
            return cls(annotation, option=Option(choices={each.name.lower(): each for each in annotation}))
        if origin is not Annotated:
            return cls(annotation, option=Option(is_file=annotation is Path), group=getattr(annotation, "GROUP", None))
        hint = cls.of(inside[0], parser)
        for each in inside[1:]:
            if isinstance(each, Option):
                hint = hint._replace(option=hint.option | each)
            elif isinstance(each, HelpGroup):
                hint = hint._replace(group=each)
            elif isinstance(each, Chosen):
                hint = each.hint(parser)
            else:
                hint = hint._replace(text=each)
        return hint


NOTHING = Hint(NoneType)

# From a function to its parser


OTHERWISE_CALLED = (
    (("--duration", "--seconds", "--time"), "--for"),
    (("--from", "--start", "--begin", "--after"), "--since"),
    (("--to", "--end", "--before"), "--until"),
    (("--port", "--host", "--bind", "--address"), "--listen"),
    (("--record", "--write"), "--log"),
    (("--id", "--set-node", "--nodeid"), "--node-id"),
    (("--id", "--cob-id", "--can-id"), "--filter"),
    (("--id", "--cob-id", "--can-id"), "--message"),
    (("--interval", "--cycle", "--rate", "--frequency"), "--period"),
    (("--reset",), "--clear"),
    (("--out",), "-o"),
    (("-k",), "--step"),
    (("--disable",), "--ignore"),
    (("--rule",), "--select"),
    (("scan", "search", "fastscan"), "find"),
    (("operational", "op", "run"), "start"),
    (("reset-node", "reset_node", "reboot"), "reset"),
    (("reset-comm", "reset_comm", "reset_communication"), "reset-communication"),
    (("preop", "preoperational", "pre_operational"), "pre-operational"),
    (("stopped",), "stop"),
    (("speed", "velocity", "turn"), "jog"),
    (("delete", "del"), "remove"),
)
"""Options and words of other programs, with our name; the first that a command has counts."""

ARGUMENTS = (
    (("node-id", "nodeid", "id", "n"), "node"),
    (("index", "object", "obj"), "objects"),
    (("suite", "suites"), "files"),
    (("log", "input", "file"), "logs"),
    (("eds", "dcf", "input"), "file"),
    (("eds", "dcf"), "files"),
    (("network",), "path"),
)
"""Options of other programs that are arguments here."""

NOT_NEEDED = {
    "scan": (("node", "nodes", "id", "ids", "node-id", "range"), "it asks every node-ID from 1 to 127"),
    **dict.fromkeys(
        ("decode", "compare", "archive"),
        (("i", "c", "interface", "channel"), "it reads logs: monitor, diagnose and serve take a bus"),
    ),
    "check": (("timeout", "within"), "a suite has `timeout:`, a step `within:`"),
    "drive": (("mode",), "the command sets the mode: move and jog, or home"),
}
"""By command: options of other programs that it does without, and why."""

CHANNELS = {r"v?can\d+": "socketcan", r"(?i:com\d+)|/dev/tty\S+": "slcan", r"PCAN_\w+": "pcan"}
"""Patterns of the channels of interfaces."""

MOST_LISTED = 300
"""Maximum length of a list of a command's options in an error."""

OPTIONS_ALIKE = 0.7
"""Similarity from which an option is suggested; lower than for other names, because options are few."""

DEVICE_FILES = (".eds", ".dcf", ".xdd", ".xdc")


class Forms(NamedTuple):
    """A command with several forms: its description, and the function of each form."""

    text: str
    functions: Mapping[str, Callable[..., Any]]


Command: TypeAlias = Callable[..., Any] | Forms


class Parser(ArgumentParser):
    """Reports errors of a command line on one line; its help fits the terminal and ends with examples.

    `words` are the command line without `--robot`, whose value is `robot`, which decides on the options. `described`
    has the details of each option and argument, by name.
    """

    def __init__(
        self,
        prog: str,
        kind: type[HelpFormatter] = HelpFormatter,
        words: Sequence[str] = (),
        robot: str | None = None,
        **settings: Any,
    ) -> None:
        self.words = words
        self.robot = robot
        self.described = dict[str, Option]()
        self.examples: Sequence[str] = ()
        try:  # otherwise argparse imports `shutil` with three compression libraries
            width = int(os.environ.get("COLUMNS", 0)) or os.get_terminal_size().columns
        except (ValueError, OSError):  # no number; no terminal
            width = 80
        # No abbreviations: a command without `--for` would read it as `--format`.
        super().__init__(prog, formatter_class=partial(kind, width=width - 2), allow_abbrev=False, **settings)

    @property
    def known(self) -> Namespace:
        """The values that are known before the command line is read."""
        return Namespace(**{"--robot": self.robot})

    def read(self) -> Namespace:
        """Read the command line; exits if it is wrong."""
        # Needed for an option between positional arguments, of which one is optional.
        parse = self.parse_args if self._subparsers else self.parse_intermixed_args
        return parse(self.words, self.known)

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Write the help; raises OSError, which argparse would hide."""
        (file or sys.stdout).write(self.format_help())
        sys.stdout.flush()

    def format_help(self) -> str:
        """Return the help."""
        program = self.prog.partition(" ")[0]
        examples = "".join(f"  {program} {each}\n" for each in self.examples)
        return super().format_help() + (examples and f"\nexamples:\n{examples}")

    def error(self, message: str) -> NoReturn:
        """Exit with an error, with the order of positional arguments if one of them is wrong; raises SystemExit."""
        places = [each.dest for each in self._get_positional_actions()]
        order = f"; write {self.prog} {' '.join(places).upper()}"
        unknown = re.match(r"unrecognized arguments: (\S+)", message)
        # An unknown option's value looks like an argument, and a misplaced one is an error of its own.
        strange = next((each for each in self.words if each[:2] == "--" and not self._knows(each)), None)
        if strange and not unknown:
            message = f"unrecognized arguments: {strange}"
            better = self._instead(strange, places, order)
        elif unknown:
            better = self._instead(unknown[1], places, order)
        else:
            is_of_order = re.match(r"argument [^-]" if len(places) > 1 else "$", message) or re.search(
                r" required: (?!-)", message
            )
            better = order if places and is_of_order else ""
        self.exit(2, f"{self.prog}: error: {message}{better}; see {self.prog} --help\n")

    def _knows(self, word: str) -> bool:
        return word == "--" or word.partition("=")[0] in self._option_string_actions

    def _instead(self, unknown: str, places: Sequence[str], order: str) -> str:
        """Return what to write instead of an unknown word or option."""
        if places == ["command"]:
            return f"; the command comes first: {self.prog} COMMAND {unknown} ..."
        options = [*self._option_string_actions]
        word = unknown.partition("=")[0]
        if word[:1] != "-":
            alone = f"; {self.prog.rpartition(' ')[2]} takes options only{self._listed()}"
            if word.isdecimal() and "--node-id" in options:
                return f"; did you mean --node-id {word}?"
            return _instead(word, options) or (f"{order}; a value with spaces needs quotes" if places else alone)
        plain = word.lstrip("-")
        arguments = {ours for theirs, ours in ARGUMENTS if plain in theirs} or {plain.replace("-", "_")}
        words = {word for each in places if each in self.described for word in self.described[each].words}
        if arguments & {*places} or plain in words:
            return f"; that is an argument here, not an option{order}"
        needless, why = NOT_NEEDED.get(self.prog.rpartition(" ")[2], ((), ""))
        if plain in needless:
            return f"; {why}"
        if better := _instead(word, options):
            return better
        if "node" in arguments and any(each.lower().endswith(DEVICE_FILES) and "=" not in each for each in self.words):
            return "; a node-ID stands before the file, as in 5=motor.eds"
        if word in ("--output", "-o"):
            return "; it prints: write > FILE at the end"
        return self._listed()

    def _listed(self) -> str:
        """Return the command's own options, empty if there are too many."""
        named = (each.option_strings[-1] for each in self._actions if each.option_strings)
        known = ", ".join(each for each in named if each not in ("--help", "--robot"))
        if not known:
            return f"; {self.prog.rpartition(' ')[2]} takes none"
        return f"; its options: {known}" if len(known) < MOST_LISTED else ""


class FormParser(Parser):
    """Reports unknown words itself, as it knows its options; argparse leaves that to the command's parser."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse the words; exits if one is unknown."""
        self.words = args
        given, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return given, unknown


def _instead(word: str, options: Sequence[str]) -> str:
    """Return a suggestion for an unknown word, empty if there is none."""
    if usual := usual_name(word, options):
        return f"; here that is {usual}"
    if "-c" in options and (bus := bus_named(word)):
        return f"; {bus}"
    if f"--{word}" in options:
        return f"; did you mean --{word}?"
    if "-o" in options and word.lower().endswith(DEVICE_FILES) and not os.path.exists(word):  # noqa: PTH110
        return f"; the file to write is -o {word}"
    if word.lower().endswith(DEVICE_FILES) and "--eds" in options:
        return f"; the file of a device is --eds {word}"
    return meant(word, options, OPTIONS_ALIKE) if word.startswith("--") else ""


def usual_name(word: str, known: Collection[str]) -> str:
    """Return which of the known names another program's word stands for; empty if none."""
    return next((ours for theirs, ours in OTHERWISE_CALLED if word in theirs and ours in known), "")


def bus_named(word: str) -> str | None:
    """Return the options of the bus that a word names, in a clause; None if it is no channel."""
    interfaces = (interface for pattern, interface in CHANNELS.items() if re.fullmatch(pattern, word))
    return next((f"the bus is -i {each} -c {word}" for each in interfaces), None)


def summary(command: Command) -> str:
    """Return the description of a command, for a function the first line of its docstring."""
    return command.text if isinstance(command, Forms) else (command.__doc__ or "").partition("\n")[0]


PARAMETER_HELP = re.compile(r"^( *)(\w+): (.+(?:\n\1 +\S.*)*)", re.MULTILINE)
"""A parameter's line in a docstring, with further lines that are indented more."""


EXAMPLE = re.compile(r"^ *\$ (.+)", re.MULTILINE)
"""An example in a command's docstring, without the program's name."""


def parameter_help(function: Callable[..., Any]) -> dict[str, str]:
    """Return the help of parameters from the docstring of a function, or of a dataclass and its bases."""
    docstrings = "\n".join(each.__doc__ or "" for each in reversed(getattr(function, "__mro__", (function,))))
    return {name: " ".join(text.split()) for _, name, text in PARAMETER_HELP.findall(docstrings)}


def describe(parser: Parser, command: Command) -> Call:
    """Add a command's options to its parser; return what calls it."""
    if not isinstance(command, Forms):
        call = _describe(parser, parser, command)
        parser.examples = EXAMPLE.findall(command.__doc__ or "")

        def checked(given: Namespace) -> Any:
            keep_inputs(parser.described, given)
            return call(given)

        return checked
    if parser.words and parser.words[0][:1] != "-" and parser.words[0] not in command.functions:
        if parser.words[0].lower().endswith(DEVICE_FILES):
            raise LocalError(f"the form comes first: {parser.prog} FORM --eds {parser.words[0]}")
        raise UnknownName("form", parser.words[0], command.functions)
    forms = parser.add_subparsers(dest="form", metavar="FORM", required=True, parser_class=FormParser)
    calls = dict[str, Call]()
    for name, each in command.functions.items():
        form = forms.add_parser(name, help=summary(each), description=summary(each))
        if not parser.words or parser.words[0] == name:  # only this form is needed
            calls[name] = describe(form, each)
    return lambda given: calls[given.form](given)


def keep_inputs(described: Mapping[str, Option], given: Namespace) -> None:
    """Check that no output option names a file that is read; raises LocalError."""
    inputs = [name for name, option in described.items() if option.is_file and not option.is_output]
    words = [word for name in inputs for word in _several(getattr(given, name, None))]
    for name, option in described.items():
        outputs = _several(getattr(given, name, None)) if option.is_output else []
        for output in outputs:
            for read in (each.rpartition("=")[2] for each in words):  # `5=drive.eds`
                if os.path.isfile(output) and os.path.exists(read) and os.path.samefile(output, read):  # noqa: PTH110, PTH113, PTH121
                    raise LocalError(f"{option.flag or name} {output} is a file that is read: name another one")


def _several(given: object) -> list[str]:
    """Return the words of an option that was given once, several times or not at all."""
    if given is None:
        return []
    return [str(each) for each in given] if isinstance(given, Sequence) and not isinstance(given, str) else [str(given)]


def ahead(parser: Parser, function: Callable[..., Any]) -> Any:
    """Call a function with its part of a command line, before the parser knows all options."""
    early = Parser(parser.prog, robot=parser.robot, add_help=False)
    call = describe(early, function)
    return call(early.parse_known_args(parser.words, parser.known)[0])


def _describe(parser: Parser, container: _ActionsContainer, function: Callable[..., Any]) -> Call:
    """Add the parameters of a function, or the fields of a dataclass, to a parser; return what calls it."""
    values = dict[str, Call]()
    apart = dict[str, _ActionsContainer]()
    hints = typing.get_type_hints(function, include_extras=True)
    texts = parameter_help(function)
    for name, parameter in signature(function).parameters.items():
        hint = Hint.of(hints[name], parser)
        hint, either = hint._replace(text=texts.get(name, hint.text)), hint.option.either
        if is_dataclass(hint.kind):
            inner = parser.add_argument_group(*hint.group) if hint.group else container
            values[name] = _describe(parser, inner, cast(type, hint.kind))
        elif hint.kind is not NoneType:
            if either and either not in apart:
                apart[either] = container.add_mutually_exclusive_group()
            values[name] = _add(parser, apart.get(either, container), parameter, hint)

    def call(given: Namespace) -> Any:
        found = {name: value(given) for name, value in values.items()}
        return function(**{name: each for name, each in found.items() if each is not None})

    return call


def _add(parser: Parser, container: _ActionsContainer, parameter: Parameter, hint: Hint) -> Call:
    """Add an option or argument, unless another parameter has added it; return what reads its value."""
    flag = hint.option.flag
    is_option = parameter.kind is Parameter.KEYWORD_ONLY
    long = flag if flag.startswith("--") else f"--{parameter.name.replace('_', '-')}"
    name = long if is_option else parameter.name
    if name not in parser.described:
        parser.described[name] = hint.option
        names = dict.fromkeys((flag or long, long)) if is_option else (name,)
        container.add_argument(*names, **_settings(name, hint, is_needed=parameter.default is Parameter.empty))

    def value(given: Namespace) -> Any:
        found = getattr(given, name, None)
        return tuple(found) or None if hint.several and found is not None else found

    return value


NARGS = {(False, False): "?", (False, True): None, (True, False): "*", (True, True): "+"}
"""Number of words of an argument, by whether several are allowed and one is required."""


def _settings(name: str, hint: Hint, is_needed: bool) -> dict[str, Any]:
    """Return argparse's settings of an option, whose name begins with a hyphen, or of an argument."""
    option, is_option = hint.option, name.startswith("-")
    settings: dict[str, Any] = {"help": hint.text and hint.text.replace("%", "%%")}
    if is_option:
        settings |= {"dest": name, "default": SUPPRESS, "required": is_needed}
        if hint.kind is bool:
            return {**settings, "action": "store_true"}
        if option.nargs or option.bare is not None:
            settings |= {"nargs": option.nargs or "?", "const": option.bare}
        elif hint.several:
            settings["action"] = "append"
    else:
        settings |= {"nargs": NARGS[hint.several, is_needed], "default": None}  # otherwise "*" would be required
    metavar = name[2:].upper() if is_option else None
    if option.words:
        metavar = f"{{{','.join(option.words)}}}"
    return {**settings, "metavar": option.metavar or metavar, "type": partial(_read, hint)}


def _read(hint: Hint, word: str) -> Any:
    """Parse a word; raises ArgumentTypeError, which argparse reports with the option's name."""
    words = hint.option.words
    try:
        read = hint.option.read or READERS.get(hint.kind, hint.kind)
        return look_up("value", word, words) if words else read(word)
    except LocalError as error:
        usual = usual_name(word, words)
        # Without a similar word, which would be another command: `operational` is not like `start`.
        unlike = str(error).partition("; did you mean")[0]
        raise ArgumentTypeError(f"{unlike}; here that is {usual}" if usual else str(error)) from None


def _numeral(kind: Callable[[str], Any], what: str) -> Callable[[str], Any]:
    def read(word: str) -> Any:
        try:
            return kind(word)
        except ValueError:
            raise LocalError(f"{word} is not {what}") from None

    return read


READERS: Mapping[Any, Callable[[str], Any]] = {int: _numeral(int, "a whole number"), float: _numeral(float, "a number")}
"""Parsers of types whose own errors are not for users."""
