"""The command line of a typed function: what each kind of parameter takes, and what is said of a wrong word."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from eurobot_od.cli.options import assigned, positive, whole
from eurobot_od.cli.signature import NOTHING, Chosen, Forms, HelpGroup, Hint, Option, Parser, describe, summary
from eurobot_od.support import texts


class Colour(Enum):
    RED = 1
    DARK_BLUE = 2


Seconds = Annotated[float, Option(metavar="TIME", read=texts.seconds)]


@dataclass(frozen=True, kw_only=True)
class Bus:
    """Where to."""

    GROUP = HelpGroup("bus", "default: the first one")

    channel: Annotated[str | None, Option("-c"), "channel, 100 % of it"] = None
    bitrate: Annotated[int, Option("-b", read=whole(1000, 2000))] = 500


@dataclass(frozen=True)
class Target:
    """A node on it."""

    node: Annotated[str, Option(metavar="NODE"), "whom"]
    _: KW_ONLY
    bus: Bus


def robots(parser: Parser) -> Hint:
    return Hint(int) if parser.robot else NOTHING


def everything(
    target: Target,
    files: Annotated[Sequence[Path], "which files"] = (),
    *,
    colour: Colour = Colour.RED,
    level: Literal[1, 2] | None = None,
    speed: Annotated[float, Option(choices={"slow": 0.5, "fast": 2.0})] = 1.0,
    verbose: Annotated[bool, Option("-v")] = False,
    span: Annotated[Seconds, Option("--for")] = 9.0,
    given: Annotated[Sequence[tuple[str, str]], Option("--set"), assigned("NAME=VALUE")] = (),
    number: int | None = None,
    share: float = 0.5,
    objects: Annotated[str | None, Option(bare="all")] = None,
    pair: Annotated[Sequence[Annotated[float, Option(read=positive)]], Option(nargs="+")] = (),
    one: Annotated[bool, Option(either="form")] = False,
    other: Annotated[bool, Option(either="form")] = False,
    wings: Annotated[Any, Chosen(robots)] = None,
) -> dict[str, Any]:
    """Do it all.

    And more.
    """
    return locals()


def called(*words: str, robot: str | None = None) -> dict[str, Any]:
    parser = Parser("do", robot=robot)
    call = describe(parser, everything)
    found: dict[str, Any] = call(parser.parse_intermixed_args(words))
    return found


PLAIN = everything(Target("5", bus=Bus()))
GIVEN = [
    # words after the node, and the parameters that are not as in the signature then
    ("", {}),
    ("a.log b.log", {"files": (Path("a.log"), Path("b.log"))}),
    ("a.log -v b.log", {"files": (Path("a.log"), Path("b.log")), "verbose": True}),
    ("--colour dark_blue", {"colour": Colour.DARK_BLUE}),
    ("--level 2", {"level": 2}),
    ("--speed fast", {"speed": 2.0}),
    ("--for 2min", {"span": 120.0}),
    ("--set a=b=c --set d=", {"given": (("a", "b=c"), ("d", ""))}),
    ("--number -3 --share .25", {"number": -3, "share": 0.25}),
    ("--objects", {"objects": "all"}),
    ("--objects x", {"objects": "x"}),
    ("--pair 1 2", {"pair": (1.0, 2.0)}),
    ("--other", {"other": True}),
    ("-c can0 --bitrate 1000", {"target": Target("5", bus=Bus(channel="can0", bitrate=1000))}),
]


@pytest.mark.parametrize(("words", "changed"), GIVEN)
def test_a_function_gets_the_options_values(words: str, changed: dict[str, Any]) -> None:
    assert called("5", *words.split()) == {**PLAIN, **changed}


WRONG = [
    ("", "the following arguments are required: NODE; write do NODE FILES"),
    ("5 --colour blue", "argument --colour: unknown value 'blue'; did you mean dark_blue?"),
    ("5 --level 3", "argument --level: unknown value '3'; known: 1, 2"),
    ("5 --speed fasst", "argument --speed: unknown value 'fasst'; did you mean fast?"),
    ("5 --for 2h", "argument --for: '2h' is not a duration; write a number and one of us, ms, s, min, such as 500 ms"),
    ("5 --set a", "argument --set: a: write NAME=VALUE"),
    ("5 --number 1.5", "argument --number: 1.5 is not a whole number"),
    ("5 --share half", "argument --share: half is not a number"),
    ("5 -b 9", "argument -b/--bitrate: 9 is not in 1000..2000"),
    ("5 --pair 0", "argument --pair: 0 is not a positive number"),
    ("5 --one --other", "argument --other: not allowed with argument --one"),
    (
        "5 --wings=2",
        "unrecognized arguments: --wings=2; its options: --channel, --bitrate, --colour, --level, --speed, --verbose, "
        "--for, --set, --number, --share, --objects, --pair, --one, --other",
    ),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG)
def test_a_wrong_word_is_one_line_with_the_options_name(
    words: str, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        called(*words.split())
    assert (end.value.code, capsys.readouterr().err) == (2, f"do: error: {complaint}; see do --help\n")


def test_a_robot_can_add_a_parameter() -> None:
    assert called("5", "--wings", "2", robot="bird")["wings"] == 2


def test_the_help_has_groups_metavars_choices_and_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    parser = Parser("do", description=summary(everything))
    describe(parser, everything)
    lines = parser.format_help().splitlines()
    assert {
        "Do it all.",
        "  NODE                  whom",
        "  --for TIME",
        "  --colour {red,dark_blue}",
        "  --set NAME=VALUE",
        "bus:",
        "  default: the first one",
        "                        channel, 100 % of it",
    } <= set(lines)


def test_an_option_that_two_groups_have_is_one() -> None:
    def twice(first: Target, *, bus: Bus) -> tuple[Bus, Bus]:
        return first.bus, bus

    parser = Parser("do")
    call = describe(parser, twice)
    assert call(parser.parse_args(["5", "-c", "can0"])) == (Bus(channel="can0"), Bus(channel="can0"))


def test_known_arguments_apply_to_each_form() -> None:
    def form(*, channel: str = "") -> str:
        return channel

    parser = Parser("do")
    call = describe(parser, Forms("Write it.", {"short": form, "long": form}))
    assert call(parser.parse_args(["long"], Namespace(**{"--channel": "can0"}))) == "can0"
    assert call(parser.parse_args(["long", "--channel", "can1"])) == "can1"
