"""What the core's parts share: its settings, and the conditions for a goto."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from eurobot_od.device.bound import period, seconds, setting
from eurobot_od.device.timers import Ask, Flow
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model import messages
from eurobot_od.robot.nodes.core.calls import CallingNode
from eurobot_od.robot.nodes.node import KEEP_PLACE, NODES, Actuators, Component, DistanceSensor


class Readiness:
    """The conditions for the first goto: all `nodes` checked, a start configuration confirmed.

    `checked` has the nodes that have answered in the dialect of this core, and have neither booted nor been lost since.
    `configured` tells whether the latest start configuration was confirmed, `confirms` by which messages of a team's
    own nodes. `absent` are the nodes lost in a match without which the robot goes on, each with the flow that asks for
    it. `lost` is the reason why the next goto begins with a recovery, '' if it does not.
    """

    def __init__(self, nodes: Iterable[str]) -> None:
        self.nodes = tuple(nodes)
        self.checked: set[str] = set()
        self.confirms: set[type[Message]] = set()
        self.configured = False
        self.absent: dict[str, Flow[None]] = {}
        self.lost = ""

    def missing(self) -> str:
        """Return what is missing and which call provides it, '' if nothing is."""
        unchecked = [f"the {node}" for node in self.nodes if node not in {*self.checked, *self.absent}]
        texts = [f"{' and '.join(unchecked)} must answer a check: call check_nodes()"] if unchecked else []
        texts += [] if self.configured else ["a start configuration must be confirmed: call configure_start()"]
        return "; ".join(texts)


class CoreSettings(CallingNode):
    """What the core's parts and scripts share: its settings, and the conditions for a goto.

    A setting that a master writes applies from the next question on. `COMPONENTS` are a team's own nodes that are part
    of the start, by the names of their EDS files. `configuration` is the start configuration, None before the first was
    confirmed; `readiness` has the conditions for a goto. `sensor` and `actuators` are the robot's equipment besides the
    bus, None if it has none.
    """

    readiness: Readiness
    configuration: messages.StartConfigurationSet | None
    sensor: DistanceSensor | None
    actuators: Actuators | None

    COMPONENTS: ClassVar[Mapping[str, Component]] = {}

    check_wait = seconds("Node check.Check wait")
    check_attempts = setting("Node check.Check attempts")
    identity_wait = seconds("Node check.Identity wait")
    trusts_without_sdo = setting("Node check.Nodes without SDO")
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
    keeps_place = setting(KEEP_PLACE)

    @property
    def without(self) -> tuple[str, ...]:
        """The nodes lost in a match, without which the robot goes on until they answer again."""
        return tuple(sorted(self.readiness.absent))

    @property
    def parts(self) -> Mapping[str, Component]:
        """All nodes that are part of the start, in the order in which they are checked."""
        return {**NODES, **self.COMPONENTS}

    def confirming(self) -> list[tuple[str, type[Message]]]:
        """Return a team's own nodes that have to confirm the start configuration, and by which message."""
        own = ((node, part.confirm) for node, part in self.COMPONENTS.items() if node not in self.readiness.absent)
        return [(node, confirm) for node, confirm in own if confirm is not None]

    def ask_drive(self, request: Message, answer: type[Message]) -> Ask:
        """Return the question to the drive, with number and wait from the settings of the goto handshake."""
        return Ask(request, answer, self.state_answer_wait, self.transmissions)
