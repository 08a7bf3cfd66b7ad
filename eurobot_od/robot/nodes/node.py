"""What the three nodes of the robot have in common: they speak the messages of the document's Table 5."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeAlias

from eurobot_od.device.bound import Application, BoundObject
from eurobot_od.device.flow import Ask
from eurobot_od.device.node import Node
from eurobot_od.device.objects import out_of_limits
from eurobot_od.device.settings import period, seconds, setting
from eurobot_od.device.storage import Store
from eurobot_od.errors import Cause, DictionaryError, Refused
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import Address, Limits, Value
from eurobot_od.pdo.message import Message
from eurobot_od.robot.model import messages, robot_file
from eurobot_od.robot.model.facts import Facts
from eurobot_od.robot.model.values import RobotError

Handlers: TypeAlias = Mapping[type[Message], Callable[[Any, Any], "Message | None"]]
"""What a node does with each message: a function of the node and the message; it returns the answer, or None."""

Objects: TypeAlias = Mapping[str, BoundObject]
"""What a node's objects, by their ParameterNames, are read from and mean when they are written."""


class RobotNode(Node):
    """A node of the robot; `facts` are those of the robot and its match, by default of the file beside the EDS.

    `FACTS` has the settings that are such facts: they count in place of the EDS's defaults, but not of what was stored,
    or what a DCF says. Raises DictionaryError for one that is outside of the setting's limits.
    """

    CATALOGUE = messages.CATALOGUE
    FACTS: ClassVar[Mapping[str, Callable[[Facts], int]]] = {}

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None, facts: Facts | None = None) -> None:
        self.facts = robot_file.read(robot_file.file_for(dictionary.file)) if facts is None else facts
        self._coordinates: dict[str, tuple[Limits, Limits]] = {}
        super().__init__(dictionary, store=store)

    def coordinates(self, record: str) -> tuple[Limits, Limits]:
        """Return the limits of x and y that the EDS gives a record such as `Kalman position`, mm."""
        if record not in self._coordinates:
            dictionary, limits = self.device.dictionary, []
            for name in (f"{record}.X position", f"{record}.Y position"):
                variable = dictionary.variable(dictionary.address(name))
                assert variable is not None  # it has an address
                type_, low, high = data_type(variable), variable.min, variable.max
                # Without limits of its own an object has those of its data type.
                limits.append(Limits(type_.low if low is None else low, type_.high if high is None else high))
            self._coordinates[record] = limits[0], limits[1]
        return self._coordinates[record]

    def _application(self, dictionary: Dictionary) -> Application:
        """Return what the application gives the objects: also the facts of the robot's file."""
        given: dict[Address, Value] = {}
        for name, fact in self.FACTS.items():
            address, value = dictionary.address(name), fact(self.facts)
            variable = dictionary.variable(address)
            # Only a DCF has a ParameterValue: somebody has configured this very device, which counts for more.
            if variable is None or variable.value is not None:
                continue
            if out_of_limits(variable, value):
                what = f"{name} = {value}, as the robot's file says, is not in {variable.min}..{variable.max}"
                raise DictionaryError(dictionary.file, address[0], what)
            given[address] = value
        return super()._application(dictionary)._replace(given=given)

    def check_configuration(self, configuration: messages.StartConfigurationSet) -> None:
        """Raise Refused, and report it by EMCY until a good one comes, if a start configuration contradicts itself."""
        wrong = configuration.contradiction()
        if wrong is not None:
            # Refused as a whole: nobody knows which of two contradictory fields is the wrong one.
            self.raise_error(RobotError.CONFIGURATION_REFUSED, messages.StartConfigurationSet)
            raise Refused(Cause.VALUES, str(wrong))
        self.clear_error(messages.StartConfigurationSet)

    def doubt(self, message: Message) -> int | None:
        """Return the error code for a message that cannot be believed: a position of another robot is none of ours."""
        code, source = super().doubt(message), messages.SOURCES.get(type(message))
        if code is None and source is not None and getattr(message, "source", None) is not source:
            return RobotError.WRONG_SOURCE
        return code


class CoreSettings(RobotNode):
    """The settings of the core, for its scripts; what a master writes holds from the next question on."""

    check_wait = seconds("Node check.Check wait")
    check_attempts = setting("Node check.Check attempts")
    identity_wait = seconds("Node check.Identity wait")
    configuration_wait = seconds("Configuration handshake.Configuration confirm wait")
    configuration_transmissions = setting("Configuration handshake.Configuration transmissions")
    confirm_wait = seconds("Goto handshake.Confirm wait")
    transmissions = setting("Goto handshake.Transmissions")
    first_state_request = seconds("Goto handshake.First state request")
    state_request_period = period("Goto handshake.State request period")
    state_answer_wait = seconds("Goto handshake.State answer wait")
    goto_timeout = setting("Goto handshake.Time-out")  # s
    lost_after = setting("Goto handshake.Lost after")
    arrival_distance = setting("Arrival.Position tolerance")  # mm
    arrival_angle = setting("Arrival.Angle tolerance")
    polling_period = period("Position polling.Polling period")
    polling_start_delay = seconds("Position polling.Start delay")
    match_duration = setting("Match.Match duration")  # s
    stop_distance = setting("Obstacle.Stop distance")  # mm
    sensing_period = period("Obstacle.Sensing period")
    stop_period = period("Standstill.Stop period")
    standstill_wait = seconds("Standstill.Standstill wait")
    standstill_distance = setting("Standstill.Standstill distance")  # mm
    standstill_turn = setting("Standstill.Standstill turn")
    displacement = setting("Recovery.Displacement")  # mm

    def ask_drive(self, request: Message, answer: type[Message]) -> Ask:
        """Ask the drive as often, and for as long, as the settings of the goto handshake say."""
        return Ask(request, answer, self.state_answer_wait, self.transmissions)


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
        self.configuration, self.safe = None, False

    def configure(self, configuration: messages.StartConfigurationSet) -> Message:
        """Take over a start configuration (document 2.3); raises Refused for one that contradicts itself."""
        self.check_configuration(configuration)
        self.configuration, self.safe = configuration, False
        self.clear_error(messages.EmergencyShutdown)
        return messages.StartConfigurationConfirm()

    def shut_down(self, _: messages.EmergencyShutdown) -> None:
        """Hold the safe state (document 4.2.2 Emergency mushroom)."""
        self.safe = True
        self.raise_error(RobotError.EMERGENCY_SHUTDOWN, messages.EmergencyShutdown)

    COMMANDS: ClassVar[Handlers] = {
        messages.StartConfigurationSet: lambda node, configuration: node.configure(configuration),
        messages.EmergencyShutdown: lambda node, shutdown: node.shut_down(shutdown),
    }


def make(kind: type[Node], dictionary: Dictionary, store: Store | None, facts: Facts | None) -> Node:
    """Make a node of any class; one of the robot gets the facts."""
    if issubclass(kind, RobotNode):
        return kind(dictionary, store=store, facts=facts)
    return kind(dictionary, store=store)
