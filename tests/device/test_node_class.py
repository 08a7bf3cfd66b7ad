"""What a class of a node is told about its mistakes: when it is made, when a node is made, when it starts."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from eurobot_od.device.node import Node
from eurobot_od.errors import LocalError
from eurobot_od.support import extras
from tests.kit import lift

HEAD = """\
from typing import NamedTuple

from eurobot_od.device.bound import BoundObject, setting
from eurobot_od.device.node import Node
from tests.kit.lift import CATALOGUE, Cabin, Configure, ConfigureConfirm, FloorResponse, MoveConfirm, MoveTo
from tests.kit.lift import PlaceRequest, PlaceResponse, Sensor


class MoveTwo(NamedTuple):
    height: int


class Lift(Node):
    CATALOGUE = CATALOGUE

    def go(self, order):
        return MoveConfirm()

    def place(self):
        return PlaceResponse(1, 0, 0, Sensor.BELT)

"""
FIRST_LINE = HEAD.count("\n") + 1

ASYNC = "async def go(self, order): ...\nHANDLERS = {MoveTo: go}"

WHEN_MADE = [
    # (what is written behind the head, its line with the mistake, what is said)
    ("HANDLERS = {'Move to': go}", 0, "a handler for 'Move to', which is a text and no message; did you mean MoveTo?"),
    ("HANDLERS = {MoveTo(1, 1, 1): go}", 0, "which is no message; did you mean MoveTo?"),
    ("HANDLERS = {\n    MoveTwo: go\n}", 1, "MoveTwo, which is not in its CATALOGUE; did you mean MoveTo?"),
    ("HANDLERS = {MoveTo: lambda self: None}", 0, "for MoveTo with the arguments (self); it is called with (self, mes"),
    ("HANDLERS = {MoveTo: place}", 0, "`def name(self, message)` is meant"),
    ("HANDLERS = {MoveTo: 'go'}", 0, "a handler for MoveTo that cannot be called, 'go'"),
    (ASYNC, 1, "that is asynchronous or a generator, go; nobody would run it"),
    ("HANDLERS = [(MoveTo, go)]", 0, "HANDLERS of type list; a table is meant: HANDLERS = {...}"),
    ("READERS = {'Place': 5}", 0, "has in READERS for 'Place' a function that cannot be called, 5"),
    ("HANDLER = {MoveTo: go}", 0, "a table HANDLER, which no node reads; did you mean HANDLERS?"),
    ("OBJECTS = {'Move to': MoveTo}", 0, "binds 'Move to' to MoveTo; BoundObject(write=MoveTo) is meant"),
    (
        "OBJECTS = {'Place': BoundObject(read=go)}",
        0,
        "reads 'Place' by a function with the arguments (self, order)",
    ),
    (
        "OBJECTS = {'Move to': BoundObject(write=MoveTwo)}",
        0,
        "writing of 'Move to' to MoveTwo, which is not in its",
    ),
    ("MEASURED = {'Motor.Temperature': 20}", 0, "measures 'Motor.Temperature' by a function that cannot be called, 20"),
    (
        "READERS = {'Place': lambda: 20}",
        0,
        "has in READERS for 'Place' a function with the arguments (); it is called with",
    ),
    ("WRITERS = {'Place': lambda word: 20}", 0, "has in WRITERS for 'Place' a function with the arguments (word); it"),
    ("def tick(self, now): return []", 0, "a method tick that does not call super().tick(...), without which the node"),
    (
        "def stop(self): ...\ndef send(self): ...",
        1,
        "a method send(self), which hides Node.send(self, message",
    ),
    ("def at(self, time): ...\nHANDLERS = {MoveTo: at}", 0, "a handler named at, which hides Node.at; give it"),
    ("start = setting('Motion.Maximum speed')", 0, "a setting named start, which hides the method Node.start; give it"),
]

WITH_ITS_FILE = [
    # the same, when a node is made with the EDS of the cabin
    (
        "HANDLERS = {FloorResponse: go, ConfigureConfirm: go}",
        0,
        "handles ConfigureConfirm without an RPDO for it in",
    ),
    (
        "OBJECTS = {'Plce': BoundObject(read=place)}",
        0,
        "binds 'Plce', which is not an object in plain/cabin.eds; did you mean",
    ),
    ("MEASURED = {'Motor.Temprature': place}", 0, "which is not a value in plain/cabin.eds; did you mean Motor."),
    (
        "speed = setting('Motion.Maximum sped')",
        0,
        "names 'Motion.Maximum sped', which is not a value in plain/cabin.eds",
    ),
]

WHEN_STARTED = [
    (
        "def reset(self):\n    super().reset()\n    self.start = 0",
        2,
        "sets self.start, which hides the method",
    ),
]


def write(folder: Path, text: str) -> Path:
    file = folder / "lift.py"
    file.write_text(HEAD + textwrap.indent(text, "    ") + "\n", encoding="utf-8")
    return file


def told(folder: Path, text: str, use: Callable[[ModuleType], object], line: int) -> str:
    """Return what is said of a class, which has to be one line with the place of the mistake."""
    file = write(folder, text)
    with pytest.raises(LocalError) as caught:
        use(extras.load(file))
    place, _, what = str(caught.value).partition(": ")
    assert place == f"{file}:{FIRST_LINE + line}"
    assert "\n" not in what
    return what


def cabin(module: ModuleType) -> Node:
    node: Node = module.Lift(lift.dictionary("cabin"))
    return node


@pytest.mark.parametrize(("text", "line", "what"), WHEN_MADE)
def test_a_class_with_a_mistake_is_told_when_it_is_made(text: str, line: int, what: str, tmp_path: Path) -> None:
    assert what in told(tmp_path, text, lambda _: None, line)


@pytest.mark.parametrize(("text", "line", "what"), WITH_ITS_FILE)
def test_a_class_that_does_not_fit_its_file_is_told_with_the_file(
    text: str, line: int, what: str, tmp_path: Path
) -> None:
    assert what in told(tmp_path, text, cabin, line)


@pytest.mark.parametrize(("text", "line", "what"), WHEN_STARTED)
def test_a_node_that_hides_a_method_is_told_when_it_starts(text: str, line: int, what: str, tmp_path: Path) -> None:
    assert what in told(tmp_path, text, lambda module: cabin(module).start(0.0), line)


FINE = [
    # (what is written behind the head, why it is no mistake)
    ("HANDLERS = {MoveTo: go, PlaceRequest: lambda *_: None}", "a handler may take anything"),
    ("def tick(self, now):\n    return Node.tick(self, now)", "the base class may be named"),
    ("def heartbeat_lost(self, node_id): ...", "a hook is there to be replaced"),
    ("def reset(self, hard=False):\n    super().reset()", "more arguments that need not be given"),
    (
        "MEASURED = {'Motor.Temperature': lambda self: 20}\nspeed = setting('Motion.Maximum speed')",
        "values it has",
    ),
    ("limits = {'low': 1}", "a table of its own"),
]


@pytest.mark.parametrize(("text", "why"), FINE)
def test_a_class_without_a_mistake_runs(text: str, why: str, tmp_path: Path) -> None:
    assert cabin(extras.load(write(tmp_path, text))).start(0.0), why
