"""Lost nodes: those that stop the robot, and those without which it goes on in a match.

In a match the robot goes on without the navigation as long as it can: the drive computes its place from its wheels, and
stops by itself when that is too uncertain. Meanwhile a flow asks for the navigation, and uses it again when it answers.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from eurobot_od.device.timers import START, Ask, Script
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.agreement import NodeMismatch, SdoClientParameter
from eurobot_od.robot.nodes.core.match_clock import MATCH_OVER, MatchClock
from eurobot_od.robot.nodes.core.settings import CoreSettings, SingleFlow
from eurobot_od.robot.nodes.core.stops import Stops
from eurobot_od.robot.nodes.node import Loss

SILENCE, QUESTIONS = 2.0, 3
"""In a match, after SILENCE seconds without a word the navigation is asked QUESTIONS times whether it is there: even if
it hangs it may still send heartbeats."""


class Lost(NamedTuple):
    """A team's own node was lost: the answer to flows that wait for it."""

    node: str


class Losses:
    """Decides how a match goes on when a node is lost."""

    def __init__(self, core: CoreSettings, stops: Stops, clock: MatchClock) -> None:
        self._core = core
        self._stops = stops
        self._clock = clock
        self._readiness = core.readiness
        self._heard = 0.0
        self._missing: SingleFlow[None] = SingleFlow(core, is_called=False)

    @property
    def is_in_match(self) -> bool:
        """Whether a match is under way in which the robot may go on."""
        return self._clock.is_running and not self._stops.shut_down and self._core.configuration is not None

    def await_loss(self) -> Script[str]:
        """Wait for the loss of a team's own node, or its reboot; return the node's name."""
        yield START
        lost: Lost = yield Ask(None, Lost, inf, 1)
        return lost.node

    def silent(self, node_id: int) -> None:
        """Stop the drive if its heartbeat is missing, or that of the navigation before the match."""
        why = f"node {node_id} has fallen silent"
        if not self._goes_on_without(node_id, why):
            self._stops.lose(why)

    def booted(self, node_id: int) -> None:
        """Configure a node that has booted before the next goto; a drive that has booted has lost its goto."""
        why = f"node {node_id} has booted"
        if self._goes_on_without(node_id, why):
            return
        self._readiness.lost = why
        # A booting navigation forgets nothing that the drive needs; a drive forgets goto, place and configuration, and
        # a team's own node its configuration.
        if self._stops.is_commanding and self._node(node_id) not in ("", "navigation"):
            self._stops.lose(why)

    def _node(self, node_id: int) -> str:
        """Return the name of a node that is part of the start; '' for any other."""
        for node in self._core.parts:
            # Only the EDS says which node has which ID: its SDO client parameters (CiA 301, 7.5.2.34).
            channel = SdoClientParameter.to(node, self._core.device)
            if channel is not None and channel.node_id == node_id:
                return node
        return ""

    def _goes_on_without(self, node_id: int, why: str) -> bool:
        """End the check of a node and the calls that wait for its loss; return whether the robot goes on without it."""
        node = self._node(node_id)
        self._readiness.checked.discard(node)
        if node in self._core.COMPONENTS:
            self._core.answered(Lost(node))
        if not node or not self.is_in_match or self._core.parts[node].loss is not Loss.GO_ON:
            return False
        self._do_without(node, why)
        return True

    def _do_without(self, node: str, why: str) -> None:
        configuration = self._core.configuration
        if node not in self._readiness.absent and configuration is not None:
            # Stopping would cost the rest of the match; the drive stops by itself when its place is too uncertain.
            how = "by its wheels" if node == "navigation" else "without it"
            self._core.alarm(f"the {node} is lost, and the robot goes on {how}: {why}")
            taking_back = self._core.begin(self._take_back(node, configuration), is_called=False)
            self._readiness.absent[node] = taking_back

    def _take_back(self, node: str, configuration: messages.StartConfigurationSet) -> Script[None]:
        try:
            yield from flows.take_back(self._core, node, configuration)
            self.heard_navigation()  # its time of silence begins again
            self._core.alarm(f"the {node} answers again")
        except NodeMismatch as error:
            self._core.alarm(str(error))
            # A node that maps differently is of no use: the next goto begins with the checks, which report that.
            self._readiness.lost = str(error)
        finally:
            self._readiness.absent.pop(node, None)

    def match_ended(self) -> None:
        """Stop asking for absent nodes; the next goto recovers the navigation first."""
        if "navigation" in self._readiness.absent:
            self._readiness.lost = "the navigation is lost"
        for flow in tuple(self._readiness.absent.values()):
            self._core.end(flow, StateError(MATCH_OVER))

    # The navigation, which may hang and still send heartbeats

    def heard_navigation(self) -> None:
        """Note the time of the navigation's last message, from which SILENCE counts."""
        self._heard = self._core.now

    def look_for_navigation(self) -> None:
        """Ask a navigation that has been silent for long during a match whether it is there."""
        is_silent = self.is_in_match and self._core.now - self._heard >= SILENCE
        if is_silent and "navigation" not in self._readiness.absent and self._missing.call is None:
            self._missing.begin(self.ask_navigation())

    def ask_navigation(self) -> Script[None]:
        """Ask the navigation whether it is there, and do without it if it does not answer."""
        yield START
        try:
            yield Ask(messages.CheckNaviRequest(), messages.CheckNaviResponse, self._core.check_wait, QUESTIONS)
            self.heard_navigation()
        except NoAnswer:
            self._readiness.checked.discard("navigation")
            self._do_without("navigation", "it does not answer")
