"""A lift: a network of three devices with PDOs between them, its messages, and nodes of a few lines each.

`panel` (node 1) commands `cabin` (2) and `door` (3). `lift.yaml` has identifiers and bits. The messages have what
messages can have: no field, an enum, a tail that may be left out, numbers with codes, values that are unknown together.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from enum import IntEnum
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Annotated, Any, ClassVar, NamedTuple, TypeAlias

from eurobot_od.device.bound import BoundObject, period, seconds, setting
from eurobot_od.device.node import Node
from eurobot_od.device.timers import START, Ask, Call, Flow, Pause, Script
from eurobot_od.errors import Cause, NoAnswer, Refused, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.make import Table, read_table
from eurobot_od.od.make.text import make_files, write_files
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Catalogue, Choice, Kind, Message, OutOfRange, Quantity, words_of
from eurobot_od.pdo.protocol import Protocol
from tests.eds_text import with_entry

TABLE = Path(__file__).with_suffix(".yaml")
DIALECT, REVERSED = "plain", "reversed"


# Values


class Ride(IntEnum):
    NORMAL, SERVICE, FIRE = range(3)


class Trouble(IntEnum):
    OVERLOAD, OBSTACLE = range(2)


class Building(IntEnum):
    OFFICE, HOSPITAL = range(2)


class Doors(IntEnum):
    CLOSED, OPEN = range(2)


class Sensor(IntEnum):
    NONE, MAGNET, CAMERA, BELT = range(4)


class NoTime(IntEnum):
    """What a remaining time is while there is none."""

    UNKNOWN = 0x0FFFFF
    JAMMED = 0xFFFFFF


class LiftError(IntEnum):
    """Emergency error codes of the lift's own."""

    EMERGENCY_OFF = 0xFF01
    CONFIGURATION_REFUSED = 0xFF02


class Part(Kind):
    """A part of a place: unknown only together with the other parts, as its code is a plain value, too."""

    unknown_as_a_whole = 0x0FF


class TurnPart(Kind):
    """The turn of a place, in degrees: its code is no plain value, so that it may also be unknown alone."""

    unknown_as_a_whole = 0x3FF

    def measured(self, limits: Limits) -> Limits:
        return Limits(0, 359)

    def read(self, raw: int, limits: Limits) -> Any:
        return None if raw == self.unknown_as_a_whole else super().read(raw, self.measured(limits))

    def write(self, value: Any, limits: Limits) -> int:
        return self.unknown_as_a_whole if value is None else super().write(value, self.measured(limits))

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, self.unknown_as_a_whole)


# Messages

CATALOGUE = Catalogue({code.value: words_of(code) for code in (ErrorCode.VALUE_OUT_OF_RANGE, *LiftError)})
MOTION, PLACES, GENERAL = "MOTION", "PLACES", "GENERAL"
"""Groups of messages."""

Height: TypeAlias = Annotated["int | None", Part("mm")]
Turn: TypeAlias = Annotated["int | None", TurnPart("deg")]


class AnyPlace(NamedTuple):
    """A place, which has its sensor and may be unknown as a whole."""

    height: Height
    sway: Height
    turn: Turn
    sensor: Annotated[Sensor | OutOfRange, Choice(Sensor)]


@CATALOGUE.message(MOTION, always=True)
class EmergencyOff(NamedTuple):
    """To both: stand until the next configuration."""


@CATALOGUE.message(MOTION, always=True)
class Brake(NamedTuple):
    """To the cabin: brake because of trouble."""

    trouble: Annotated[Trouble | OutOfRange, Choice(Trouble)]


@CATALOGUE.message(MOTION, always=True)
class Halt(NamedTuple):
    """To the cabin: brake."""


@CATALOGUE.message(MOTION)
class MoveTo(NamedTuple):
    """To the cabin: move to a height, and wait there; `pause` may be left out, and one dialect alone has `doors`."""

    height: Annotated[int, Kind("mm")]
    ride: Annotated[Ride | OutOfRange, Choice(Ride)]
    speed: Annotated[int, Kind("%")]
    pause: Annotated[int, Kind("s")] = 0
    doors: Annotated[Doors | OutOfRange, Choice(Doors)] = Doors.CLOSED


@CATALOGUE.message(MOTION)
class MoveConfirm(NamedTuple):
    """From the cabin: it moves."""


@CATALOGUE.message(MOTION)
class StateRequest(NamedTuple):
    """To the cabin: how long until it is there?"""


@CATALOGUE.message(MOTION)
class StateResponse(NamedTuple):
    """From the cabin: the remaining time."""

    time: Annotated[int | NoTime | OutOfRange, Quantity("ms", within=(0, 60000), codes=NoTime)]


@CATALOGUE.message(PLACES)
class FloorRequest(NamedTuple):
    """To the door: what does it see?"""


@CATALOGUE.message(PLACES)
class FloorResponse(AnyPlace):
    """From the door to the cabin: the place that it sees."""

    __slots__ = ()


@CATALOGUE.message(PLACES)
class PlaceRequest(NamedTuple):
    """To the cabin: where is it?"""


@CATALOGUE.message(PLACES)
class PlaceResponse(AnyPlace):
    """From the cabin: where it is."""

    __slots__ = ()


@CATALOGUE.message(GENERAL)
class Configure(NamedTuple):
    """To both: what the building is like."""

    building: Annotated[Building | OutOfRange, Choice(Building)]
    doors: Annotated[int, Kind()]
    basements: Annotated[int, Kind()]
    load: Annotated[int, Kind("kg")]


@CATALOGUE.message(GENERAL)
class ConfigureConfirm(NamedTuple):
    """From either: it is configured."""


@CATALOGUE.message(GENERAL)
class CheckDoorRequest(NamedTuple):
    """To the door: is it there?"""


@CATALOGUE.message(GENERAL)
class CheckDoorResponse(NamedTuple):
    """From the door: it is there."""


@CATALOGUE.message(GENERAL)
class CheckCabinRequest(NamedTuple):
    """To the cabin: is it there?"""


@CATALOGUE.message(GENERAL)
class CheckCabinResponse(NamedTuple):
    """From the cabin: it is there."""


OFFICE = Configure(Building.OFFICE, 2, 1, 30)
"""A configuration that all accept."""


# Files


class LiftProtocol(Protocol):
    """The lift's messages, as `of` finds them in its files."""

    CATALOGUE = CATALOGUE


@cache
def table() -> Table:
    """Read the table."""
    return read_table(TABLE.read_text(encoding="utf-8"), TABLE)


@cache
def texts() -> dict[str, str]:
    """Return the files of the table: `DIALECT/NODE.eds`, and `network.yaml`."""
    return make_files(table())


NAMES = ("panel", "cabin", "door")


def dictionary(node: str, dialect: str = DIALECT, more: str = "") -> Dictionary:
    """Return a node's dictionary; `more` is text at the end of its EDS."""
    path = f"{dialect}/{node}.eds"
    return Dictionary.read((texts()[path] + more).encode(), Path(path))


def dictionaries(dialect: str = DIALECT) -> list[Dictionary]:
    """Return the dictionaries of all nodes."""
    return [dictionary(each, dialect) for each in NAMES]


@cache
def protocol(dialect: str = DIALECT) -> LiftProtocol:
    """Return the lift's messages as a dialect maps them."""
    return LiftProtocol.of_devices(dictionaries(dialect), CATALOGUE)


@cache
def files() -> Path:
    """Write the files where they stay until the end of the tests; return the folder of both dialects."""
    folder = Path(mkdtemp(prefix="lift-"))
    atexit.register(rmtree, folder)
    write(folder)
    return folder


def spoilt(folder: Path, *changes: tuple[str, str, str, str | None]) -> Path:
    """Write the files of the plain dialect, and change entries: node, section, key, value; return their folder."""
    plain = write(folder)
    for node, section, key, value in changes:
        file = plain / f"{node}.eds"
        file.write_text(with_entry(file.read_text(), section, key, value))
    return plain


def write(folder: Path) -> Path:
    """Write the files into a folder; return that of the plain dialect, beside which `network.yaml` is."""
    write_files(texts(), folder)
    return folder / DIALECT


# Nodes


class LiftNode(Node):
    """What the lift's nodes have in common; `configuration` is the one that counts, None before the first."""

    CATALOGUE = CATALOGUE
    configuration: Configure | None = None
    is_off = False

    def reset(self) -> None:
        super().reset()
        self.configuration, self.is_off = None, False

    def configure(self, configuration: Configure) -> Message:
        """Take over a configuration; raises Refused for a load without doors."""
        if configuration.load and not configuration.doors:
            self.raise_error(LiftError.CONFIGURATION_REFUSED, Configure)
            raise Refused(Cause.VALUES, "a load without doors")
        self.clear_error(Configure)
        self.clear_error(EmergencyOff)
        self.configuration, self.is_off = configuration, False
        return ConfigureConfirm()

    def switch_off(self, _: EmergencyOff) -> None:
        """Stand until the next configuration."""
        self.is_off = True
        self.raise_error(LiftError.EMERGENCY_OFF, EmergencyOff)


Handlers: TypeAlias = Mapping[type[Message], Callable[[Any, Any], "Message | None"]]

FOLLOWS: Handlers = {
    Configure: lambda node, configuration: node.configure(configuration),
    EmergencyOff: lambda node, off: node.switch_off(off),
}


class Cabin(LiftNode):
    """The cabin: it moves at once at its speed, and stands where it is told to or when the panel is lost.

    `height` is in mm, `target` is what it moves to, None while it stands; `stopped_by` is the latest stop.
    """

    height = 0.0
    target: MoveTo | None = None
    stopped_by: Message | None = None
    seen: FloorResponse | None = None

    maximum_speed = setting("Motion.Maximum speed")  # mm/s
    control_period = period("Motion.Control period")

    @property
    def moving(self) -> bool:
        """Whether it moves."""
        return self.target is not None

    def reset(self) -> None:
        super().reset()
        self.target = self.stopped_by = self.seen = None

    def _control(self, now: float) -> None:
        if self.target is None:
            return
        step = self.maximum_speed * self.target.speed / 100 * self.control_period
        self.height += max(-step, min(step, self.target.height - self.height))
        if self.height == self.target.height:
            self.target = None
        else:
            self.at(now + self.control_period, self._control)

    def move(self, target: MoveTo) -> Message:
        """Begin to move; raises Refused while it is switched off."""
        if self.is_off:
            raise Refused(Cause.STATE, "it is switched off")
        if self.target is None:
            self.at(self.now + self.control_period, self._control)
        self.target, self.stopped_by = target, None
        return MoveConfirm()

    def stop(self, why: Message) -> None:
        """Stand."""
        self.target, self.stopped_by = None, why

    def switch_off(self, off: EmergencyOff) -> None:
        super().switch_off(off)
        self.stop(off)

    def halted(self) -> None:
        self.stop(Halt())

    def heartbeat_lost(self, node_id: int) -> None:
        self.stop(Halt())

    def state(self) -> StateResponse:
        """Return the remaining time, in ms."""
        if self.target is None:
            return StateResponse(0)
        speed = self.maximum_speed * self.target.speed / 100
        return StateResponse(round(abs(self.target.height - self.height) / speed * 1000) if speed else NoTime.UNKNOWN)

    def place(self) -> PlaceResponse:
        """Return where it is."""
        return PlaceResponse(round(self.height), 0, 0, Sensor.BELT)

    def see(self, floor: FloorResponse) -> None:
        """Take in what the door sees."""
        self.seen = floor
        if floor.height is not None:
            self.height = float(floor.height)

    HANDLERS: ClassVar[Handlers] = {
        **FOLLOWS,
        MoveTo: lambda cabin, target: cabin.move(target),
        Halt: lambda cabin, why: cabin.stop(why),
        Brake: lambda cabin, why: cabin.stop(why),
        StateRequest: lambda cabin, _: cabin.state(),
        PlaceRequest: lambda cabin, _: cabin.place(),
        FloorResponse: lambda cabin, floor: cabin.see(floor),
        CheckCabinRequest: lambda *_: CheckCabinResponse(),
    }
    OBJECTS: ClassVar = {
        "Place": BoundObject(read=place),
        "State": BoundObject(read=state),
        "Move to": BoundObject(write=MoveTo),
        "Configuration": BoundObject(write=Configure),
    }
    MEASURED: ClassVar = {"Motor.Temperature": lambda cabin: 20 + cabin.moving}


class Door(LiftNode):
    """The door: it sees what a test puts into `floor`."""

    floor = FloorResponse(None, None, None, Sensor.NONE)

    HANDLERS: ClassVar[Handlers] = {
        **FOLLOWS,
        FloorRequest: lambda door, _: door.floor,
        CheckDoorRequest: lambda *_: CheckDoorResponse(),
    }


class Panel(LiftNode):
    """The panel, which has calls; `lost` are the nodes whose heartbeats it misses, `places` what the cabin has said."""

    check_wait = seconds("Check.Check wait")
    check_attempts = setting("Check.Check attempts")
    polling_period = seconds("Polling.Polling period")

    def __init__(self, dictionary: Dictionary, **options: Any) -> None:
        self._flows: list[Flow[Any]] = []
        self.lost: list[int] = []
        self.places: list[PlaceResponse] = []
        super().__init__(dictionary, **options)

    def reset(self) -> None:
        self._end_all("the panel was reset")
        super().reset()
        if self.polling_period:
            self.at(self.now + self.polling_period, self._poll)

    def _poll(self, now: float) -> None:
        self.offer(PlaceRequest())
        self.at(now + self.polling_period, self._poll)

    def switched_off(self) -> None:
        with self.guard:
            self._end_all("the panel is being switched off")

    def _end_all(self, why: str) -> None:
        for flow in list(self._flows):
            flow.fail(StateError(why), self.now)

    def heartbeat_lost(self, node_id: int) -> None:
        self.lost.append(node_id)

    def _act(self, message: Message) -> None:
        super()._act(message)
        self.answered(message)

    def answered(self, answer: Message | Frame) -> None:
        for flow in list(self._flows):
            flow.heard(answer, self.now)

    def begin(self, script: Script[Any]) -> Call[Any]:
        """Begin a flow; return its call."""

        def send(request: Message | Frame) -> None:
            self.put(request) if isinstance(request, Frame) else self.offer(request)

        def settled(call: Future[Any]) -> None:
            if call.cancelled():  # this is the caller's thread, and only the node's may close the script
                with self.guard:
                    self.soon(flow.go_on)

        flow = Flow(script, self._timers, send, self._flows.remove)
        with self.guard:
            self._flows.append(flow)
            self.soon(flow.go_on)
        flow.call.add_done_callback(settled)
        return flow.call

    def ask(self, request: Message, answer: type[Message]) -> Call[Any]:
        """Send a request up to `check_attempts` times; the call gives the answer, or raises NoAnswer."""

        def script() -> Script[Any]:
            yield START
            return (yield Ask(request, answer, self.check_wait, self.check_attempts))

        return self.begin(script())

    def check(self) -> Call[list[str]]:
        """Ask both nodes whether they are there; the call gives the names of those that are."""

        def script() -> Script[list[str]]:
            yield START
            for request, answer in CHECKS.values():
                yield Ask(request, answer, self.check_wait, self.check_attempts)
            return list(CHECKS)

        return self.begin(script())

    def move(self, target: MoveTo) -> Call[None]:
        """Move the cabin; the call ends when it has arrived, and one that ends before halts it."""

        def script() -> Script[None]:
            yield START
            try:
                yield Ask(target, MoveConfirm, 0.5, self.check_attempts)
                while (yield Ask(StateRequest(), StateResponse, 0.1, self.check_attempts)).time != 0:
                    yield Pause(0.1)
            except (GeneratorExit, NoAnswer, StateError):
                self.offer(Halt())
                raise

        return self.begin(script())

    HANDLERS: ClassVar[Handlers] = {PlaceResponse: lambda panel, place: panel.places.append(place)}


CHECKS: dict[str, tuple[Message, type[Message]]] = {
    "cabin": (CheckCabinRequest(), CheckCabinResponse),
    "door": (CheckDoorRequest(), CheckDoorResponse),
}
"""How the panel asks whether a node is there."""

ROLES: dict[str, type[Node]] = {"panel": Panel, "cabin": Cabin, "door": Door}
"""The class of each node."""


def node(name: str) -> Node:
    """Make a node of its class."""
    return ROLES[name](dictionary(name))
