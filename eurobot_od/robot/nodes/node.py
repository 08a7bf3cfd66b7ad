"""The common part of the robot's nodes, which exchange the messages of the document's Table 5.

Also: the core's instruments, a team's own nodes in the start, and nodes that follow the core's commands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from enum import Enum, IntEnum
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias

from eurobot_od.controller import Reporter
from eurobot_od.device.bound import Application, BoundObject
from eurobot_od.device.node import Node
from eurobot_od.device.objects import Store, out_of_limits
from eurobot_od.errors import Cause, DictionaryError, Refused
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import Range, data_type, limits
from eurobot_od.od.values import Address, Value
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model import messages, robot_file
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import Obstacle, RobotError


class Detection(NamedTuple):
    """An obstacle ahead: its kind, its distance in mm from edge to edge, and its bearing in degrees, left positive."""

    obstacle: Obstacle
    distance: float
    bearing: float


class DistanceSensor(Protocol):
    """A sensor that looks ahead of the robot, real or simulated."""

    def look(self, now: float) -> Detection | None:
        """Return what is ahead; None if there is nothing."""


class Actuators(Protocol):
    """Arms, grippers, launchers for the robot's tasks, real or simulated."""

    def begin(self, task: str) -> float:
        """Begin a task where the robot stands; return its duration in s. Raises UnknownName."""

    def finish(self, task: str) -> int:
        """Finish a task; return the result in points, or in pieces of fruit."""


class Approach:
    """Detects that the robot drives into an obstacle, which is near and comes nearer.

    A robot that turns in front of an obstacle, or moves away from it, need not stop.
    """

    def __init__(self) -> None:
        self._distances: deque[float | None] = deque(maxlen=READINGS)

    def meets(self, detection: Detection | None, stop_distance: float) -> bool:
        """Add a reading; return whether the robot drives into an obstacle nearer than `stop_distance` mm."""
        self._distances.append(None if detection is None else detection.distance)
        if detection is None or detection.distance > stop_distance:
            return False
        # Compared with the oldest reading, as the change exceeds the noise over a longer time.
        first = next(each for each in self._distances if each is not None)
        return first - detection.distance >= CLOSING


READINGS = 3
"""Number of readings that are compared; one that misses the obstacle does not hide it."""

CLOSING = 12.0
"""Minimum approach in these readings, in mm; less may be noise of the sensor."""


Handlers: TypeAlias = Mapping[type[Message], Callable[[Any, Any], "Message | None"]]
"""The handler of each message: called with the node and the message, it returns the answer, or None."""

Objects: TypeAlias = Mapping[str, BoundObject]
"""Bindings of a node's objects, by their ParameterNames."""


class Loss(Enum):
    """What the core does when a team's own node is lost in a match; `await core.loss()` informs the strategy."""

    STOP = "stop"
    """The goto ends as LOST; the next one begins with a check of the node, and is not sent without an answer."""
    GO_ON = "go on"
    """The robot goes on without it, and polls it; once it answers, it is configured again."""


class Component(NamedTuple):
    """A team's own node as a part of the start (document 5.1: a component that deviates blocks the system).

    It has to answer `check` with `answer`; without such a message, by SDO. In either case its fingerprints of the
    messages are compared with the core's. It answers the start configuration with `confirm`; None: it gets none.
    """

    check: Message | None = None
    answer: type[Message] | None = None
    confirm: type[Message] | None = None
    loss: Loss = Loss.STOP


NODES: Mapping[str, Component] = {
    "drive": Component(messages.CheckDriveRequest(), messages.CheckDriveResponse),
    "navigation": Component(messages.CheckNaviRequest(), messages.CheckNaviResponse, loss=Loss.GO_ON),
}
"""The two nodes of every core, in the order in which they are checked (2014 robot: drive first)."""


class RobotNode(Node):
    """A node of the robot.

    `FACTS` are the settings that come from facts: they replace the EDS's defaults, but not stored values or those of a
    DCF.

    Args:
        dictionary: the node's EDS
        store: keeps the settings over a restart
        facts: the robot and its match; default: the file beside the EDS

    Raises:
        DictionaryError: the setting cannot hold a fact
    """

    CATALOGUE = messages.CATALOGUE
    FACTS: ClassVar[Mapping[str, Callable[[Facts], float]]] = {}

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None, facts: Facts | None = None) -> None:
        self.facts = robot_file.read(robot_file.file_for(dictionary.file)) if facts is None else facts
        self._coordinates: dict[str, tuple[Range, Range]] = {}
        super().__init__(dictionary, store=store)

    def controller(self, report: Reporter | None, clock: Callable[[], float]) -> Gatekeeper:
        """Return a gatekeeper with the sizes in the node's Transmit settings, otherwise with those of 2014."""
        try:
            sizes: dict[str, Any] = {
                "table_size": self.setting("Transmit.Listener table size"),
                "mailboxes": self.setting("Transmit.Mailboxes"),
                "mailbox_wait": self.setting("Transmit.Mailbox wait") / 1000,
            }
        except DictionaryError:
            sizes = {}
        return Gatekeeper(self.device.protocol, report=report, clock=clock, **sizes)

    def coordinates(self, record: str) -> tuple[Range, Range]:
        """Return the limits of x and y in the EDS for a record such as `Kalman position`, in mm."""
        if record not in self._coordinates:
            dictionary = self.device.dictionary
            found = (dictionary.variable(dictionary.address(f"{record}.{side} position")) for side in "XY")
            x, y = (range_ for each in found if each and (range_ := limits(each)))
            self._coordinates[record] = x, y
        return self._coordinates[record]

    def _application(self, dictionary: Dictionary) -> Application:
        """Return the application's values for objects, including the facts in the robot's file."""
        given: dict[Address, Value] = {}
        for name, fact in self.FACTS.items():
            address = dictionary.address(name)
            value = fact(self.facts)
            variable = dictionary.variable(address)
            # A ParameterValue comes from a DCF for this device, which takes precedence.
            if variable is None or variable.value is not None:
                continue
            is_integer = data_type(variable).is_integer
            if out_of_limits(variable, value) or (is_integer and not isinstance(value, int)):
                allowed = f"not {'a whole number ' if is_integer else ''}in {variable.min}..{variable.max}"
                what = f"{name} = {value}, as the robot's file says, is {allowed}"
                raise DictionaryError(dictionary.file, address[0], what)
            given[address] = value
        return super()._application(dictionary)._replace(given=given)

    def check_configuration(self, configuration: messages.StartConfigurationSet) -> None:
        """Check that a start configuration does not contradict itself; raises Refused.

        A contradictory one is also reported by EMCY, until a good one comes.
        """
        wrong = configuration.contradiction()
        if wrong is not None:
            # Refused as a whole, as either of the contradictory fields may be wrong.
            self.raise_error(RobotError.CONFIGURATION_REFUSED, messages.StartConfigurationSet)
            raise Refused(Cause.VALUES, str(wrong))
        self.clear_error(messages.StartConfigurationSet)

    def doubt(self, message: Message) -> int | None:
        """Return the error code for a message that must be ignored, such as a position from another source."""
        code = super().doubt(message)
        source = messages.SOURCES.get(type(message))
        if code is None and source is not None and getattr(message, "source", None) is not source:
            return RobotError.WRONG_SOURCE
        return code


KEEP_PLACE = "Place.Keep place"
"""The object by which the core tells the drive to keep its place at the next start configuration."""


class KeepPlace(IntEnum):
    """Values of the object `KEEP_PLACE`, for the next start configuration only."""

    BY_MATCH = 0
    """The drive begins at its start place, unless it has had a goto in the current match."""
    KEEP = 1
    START_OVER = 2
    """The drive begins at its start place, as the robot was put there, even in a match."""


START_STATE = "Start state.State"
"""The object by which the drive tells a restarted core whether it has a start configuration."""


class StartState(IntEnum):
    """Values of the object `START_STATE`."""

    UNCONFIGURED = 0
    CONFIGURED = 1
    SHUT_DOWN = 2
    """Configured or not, the drive holds its safe state."""


PLACE_AGE = "Start state.Place age"
"""The object with the time since a navigation position last agreed with the drive's place, in ms."""


def age(then: float | None, now: float) -> int:
    """Return the value of the object `PLACE_AGE`; `then` is None if there was none."""
    return UNKNOWN if then is None else min(round((now - then) * 1000), UNKNOWN - 1)


TIME_LEFT, NO_MATCH = "Match clock.Time left", 0xFFFF_FFFF
"""The object with the time to the end of the match, in ms, and its value without a match."""


def milliseconds_until(end: float | None, now: float) -> int:
    """Return the value of the object `TIME_LEFT`; `end` is the end of the match, None without one."""
    return NO_MATCH if end is None else max(round((end - now) * 1000), 0)


DEVIATION, UNKNOWN = "Arrival deviation.Deviation", 0xFFFF
"""The object with the deviation of the drive's place, in mm, and its value while the place is unknown."""


class FollowingNode(RobotNode):
    """A node that the core commands.

    `configuration` is the start configuration, None before the first. `safe` is True after an Emergency Shutdown until
    a new start configuration or an NMT reset.
    """

    configuration: messages.StartConfigurationSet | None = None
    safe = False

    def reset(self) -> None:
        """Forget the start configuration, as after power-on."""
        super().reset()
        self.configuration = None
        self.safe = False

    def configure(self, configuration: messages.StartConfigurationSet) -> Message:
        """Accept a start configuration (document 2.3); raises Refused for a contradictory one."""
        self.check_configuration(configuration)
        self.configuration = configuration
        self.safe = False
        self.clear_error(messages.EmergencyShutdown)
        return messages.StartConfigurationConfirm()

    def shut_down(self, _: messages.EmergencyShutdown) -> None:
        """Enter the safe state (document 4.2.2 Emergency mushroom)."""
        self.safe = True
        self.raise_error(RobotError.EMERGENCY_SHUTDOWN, messages.EmergencyShutdown)

    COMMANDS: ClassVar[Handlers] = {
        messages.StartConfigurationSet: lambda node, configuration: node.configure(configuration),
        messages.EmergencyShutdown: lambda node, shutdown: node.shut_down(shutdown),
    }


def make(kind: type[Node], dictionary: Dictionary, store: Store | None, facts: Facts | None) -> Node:
    """Return a node of any class; one of the robot's gets the facts."""
    if issubclass(kind, RobotNode):
        return kind(dictionary, store=store, facts=facts)
    return kind(dictionary, store=store)
