"""Faults of the robot's nodes, besides those of any device, for testing a strategy or a node.

Most are one wrong message, a row of a table each; the others are faults of the 2014 robot. A fault names the step of
the shipped suite that finds it. Faults that only prove the suites are in the tests' kit; `tools/fault_matrix.py` tries
all.
"""

from __future__ import annotations

from typing import Any

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import (
    MOVED,
    NOT_ANSWERED,
    NOT_SENT,
    READ_REVERSED,
    REVERSED,
    TWICE,
    Caught,
    Fault,
    Wrong,
    sent_late,
)
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.plugin import Faults
from eurobot_od.robot.model import messages
from eurobot_od.robot.nodes import Core, Drive, Navigation

DRIVES_ON = Wrong("drives on after {}", lambda message: hooks.arriving(message, hooks.lost))


def message_faults(suite: str, *rows: tuple[str, Wrong, type[Message], str]) -> dict[str, Fault]:
    """Return faults that steps of one suite find.

    A row has the fault's name, what is wrong with which message, and the step.
    """
    return {
        name: Caught(suite, step).fault(wrong.text.format(hooks.words(message)), wrong.mixin(message))
        for name, wrong, message, step in rows
    }


class DeafWhenStopped(Node):
    """Accepts emergencies and stops only in OPERATIONAL, like any other message."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        always = {self.device.protocol.cob_id(each) for each in self.CATALOGUE.always if each in self.HANDLERS}
        if self.device.state is not NmtState.OPERATIONAL and frame.cob_id in always:
            return []
        return super().receive(frame, now)


class Padded(Node):
    """Pads short messages with left-over bytes, and acts on them (2014 robot)."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        lengths = {each.cob_id: each.layout.length for each in self.device.protocol.bindings}
        return super().receive(Frame(frame.cob_id, frame.data.ljust(lengths.get(frame.cob_id, 0), b"\x01")), now)


class MatchWithoutEnd(Core):
    """Does not end the match."""

    def start_match(self, duration: float | None = None) -> None:
        """Start no clock."""


def _either(_: Core, answer: Message, healthy: Any) -> None:
    """Accept either node's check answer for both (2014 robot)."""
    healthy(messages.CheckDriveResponse())
    healthy(answer)


# Groups of steps, and steps that find several faults, as they are the first to check an answer or all its fields
ASKED, LOCATION = "2.2 Estimated Location request", "2.2 Estimated Location response"
NODE_CHECK, CONFIRM = "2.3 Node Check Response", "2.3 Start Configuration Confirm"
CONFIGURATION = "2.3 Start Configuration Set: colour, numbers and diameters"
RECONFIGURED = "2.3 Start Configuration Set: again without a confirm"
GOTO, CONFIRMED = "2.1 Goto: place, angle, speed and barriers", "2.1 Goto ACK: a goto is confirmed"
STATE_UNKNOWN = "2.1 State Response: time unknown without a goto"
POSITION_UNKNOWN, OUR_PLACE = f"{LOCATION}: unknown before the start configuration", f"{LOCATION}: our robot's place"
OBSTACLE, MUSHROOM = "4.2.2 Obstacle: Emergency Stop for a thing, in one bit", "4.2.2 Emergency mushroom"

OF_THE_CORE = {
    **message_faults(
        "core",
        ("drive-not-checked", NOT_SENT, messages.CheckDriveRequest, "2.3 Node Check Request: the drive"),
        ("configuration-byte-order", REVERSED, messages.StartConfigurationSet, CONFIGURATION),
        ("navigation-not-polled", NOT_SENT, messages.NaviPositionRequest,
         "4.2.2 Navigation: the raw position is asked for"),
        ("position-not-polled", NOT_SENT, messages.KalmanPositionRequest,
         "4.2.2 Position: the filtered position is asked for"),
        ("enemy-not-polled", NOT_SENT, messages.Enemy1PositionRequest, f"{ASKED}: enemy 1 is asked for"),
        ("confederate-not-polled", NOT_SENT, messages.ConfederatePositionRequest,
         f"{ASKED}: the confederate is asked for"),
        ("goto-not-sent", NOT_SENT, messages.GotoXY, GOTO),
        ("goto-sent-twice", TWICE, messages.GotoXY, "2.1 Goto ACK: 500 ms between two transmissions"),
        ("goto-sent-reversed", REVERSED, messages.GotoXY, GOTO),
        ("state-not-asked", NOT_SENT, messages.GotoStateRequest,
         "2.1 State Request: the drive's state is asked for"),
        ("obstacle-not-told", NOT_SENT, messages.EmergencyStop, OBSTACLE),
        ("stop-under-wrong-identifier", MOVED, messages.StopDrive,
         "2.1 Goto ACK: and then stopped, as the drive may have heard it"),
        ("mushroom-not-told", NOT_SENT, messages.EmergencyShutdown, f"{MUSHROOM}: Emergency Shutdown"),
        ("mushroom-late", sent_late(3.0), messages.EmergencyShutdown, f"{MUSHROOM}: Emergency Shutdown"),
    ),
    "either-check-satisfies": Caught("core", f"{NODE_CHECK}: the navigation's answer is not the drive's").fault(
        "takes either node's check answer for both (2014 robot)", hooks.handling(messages.CheckNaviResponse, _either)
    ),
    "configuration-sent-once": Caught("core", RECONFIGURED).fault(
        "does not send the start configuration again (2014 robot)",
        hooks.preset("Configuration handshake.Configuration transmissions", 1),
    ),
    "configuration-confirm-not-awaited": Caught("core", RECONFIGURED).fault(
        "does not wait for the start configuration's confirm (2014 robot)",
        hooks.leaving(messages.StartConfigurationSet, hooks.unawaited(messages.StartConfigurationConfirm())),
    ),
    "polling-period-wraps": Caught("core", "5.2 Match: positions are asked for every 600 ms").fault(
        "asks for positions every 655 ms because a counter wraps (2014 robot)",
        hooks.preset("Position polling.Polling period", 655),
    ),
    "obstacle-bits-unmasked": Caught("core", OBSTACLE).fault(
        "sends more than the obstacle's bit (2014 robot)",
        hooks.leaving(messages.EmergencyStop, hooks.data(lambda data: bytes([data[0] | 0xF6]))),
    ),
    "match-without-end": Caught("core", "5.2 Match: the drive is stopped when the match is over").fault(
        "drives on when the match is over", MatchWithoutEnd
    ),
}  # fmt: skip

OF_THE_DRIVE = {
    **message_faults(
        "drive",
        ("goto-not-confirmed", NOT_SENT, messages.GotoConfirm, CONFIRMED),
        ("goto-confirmed-late", sent_late(0.6), messages.GotoConfirm, CONFIRMED),
        ("goto-confirmed-twice", TWICE, messages.GotoConfirm, "2.1 Goto ACK: one confirm for one goto"),
        ("goto-confirmed-under-wrong-identifier", MOVED, messages.GotoConfirm, CONFIRMED),
        ("goto-byte-order", READ_REVERSED, messages.GotoXY, CONFIRMED),
        ("stop-ignored", DRIVES_ON, messages.StopDrive, "2.1 Stop: the goto is dropped"),
        ("state-not-answered", NOT_ANSWERED, messages.GotoStateRequest, STATE_UNKNOWN),
        ("state-answered-late", sent_late(0.3), messages.GotoStateResponse, "2.1 State Response: follows directly"),
        ("state-answered-twice", TWICE, messages.GotoStateResponse,
         "2.1 State Response: one answer for one request"),
        ("time-byte-order", REVERSED, messages.GotoStateResponse, STATE_UNKNOWN),
        ("position-not-answered", NOT_ANSWERED, messages.KalmanPositionRequest, POSITION_UNKNOWN),
        ("position-answered-late", sent_late(0.3), messages.KalmanPositionResponse, f"{LOCATION}: follows directly"),
        ("position-answered-twice", TWICE, messages.KalmanPositionResponse,
         f"{LOCATION}: one answer for one request"),
        ("position-byte-order", REVERSED, messages.KalmanPositionResponse, POSITION_UNKNOWN),
        ("drive-check-not-answered", NOT_ANSWERED, messages.CheckDriveRequest, f"{NODE_CHECK}: the drive is there"),
        ("drive-check-answered-twice", TWICE, messages.CheckDriveResponse,
         f"{NODE_CHECK}: one answer for one request"),
        ("drive-configuration-not-confirmed", NOT_SENT, messages.StartConfigurationConfirm,
         f"{CONFIRM}: the drive confirms"),
    ),
    **message_faults(
        "emergency",
        ("emergency-stop-ignored", DRIVES_ON, messages.EmergencyStop,
         "4.2.2 Obstacle: the goto is dropped at once"),
        ("shutdown-ignored", DRIVES_ON, messages.EmergencyShutdown, f"{MUSHROOM}: the goto is dropped"),
    ),
}  # fmt: skip

OF_THE_NAVIGATION = message_faults(
    "navigation",
    ("navi-not-answered", NOT_ANSWERED, messages.NaviPositionRequest, OUR_PLACE),
    ("navi-answered-late", sent_late(0.3), messages.NaviPositionResponse, f"{LOCATION}: follows directly"),
    ("navi-answered-twice", TWICE, messages.NaviPositionResponse, f"{LOCATION}: one answer for one request"),
    ("navi-byte-order", REVERSED, messages.NaviPositionResponse, OUR_PLACE),
    ("enemy-not-answered", NOT_ANSWERED, messages.Enemy2PositionRequest, f"{LOCATION}: enemy 2"),
    ("confederate-not-answered", NOT_ANSWERED, messages.ConfederatePositionRequest, f"{LOCATION}: the confederate"),
    ("navi-check-not-answered", NOT_ANSWERED, messages.CheckNaviRequest, f"{NODE_CHECK}: the navigation is there"),
    ("navi-check-answered-twice", TWICE, messages.CheckNaviResponse, f"{NODE_CHECK}: one answer for one request"),
    ("navi-configuration-not-confirmed", NOT_SENT, messages.StartConfigurationConfirm,
     f"{CONFIRM}: the navigation confirms"),
)  # fmt: skip

OF_ANY_NODE = {
    "deaf-when-stopped": Caught("canopen", f"{MUSHROOM}: acts in every NMT state").fault(
        "heeds stops and shutdowns only in OPERATIONAL", DeafWhenStopped
    ),
    "short-frame-filled-up": Caught("canopen", "7.2.7 EMCY: a frame that is too short").fault(
        "fills up short messages with left-over bytes and acts on them (2014 robot)", Padded
    ),
}

FAULTS: Faults = {Core: OF_THE_CORE, Drive: OF_THE_DRIVE, Navigation: OF_THE_NAVIGATION, Node: OF_ANY_NODE}
"""Faults by name, by the class of nodes that can have them."""
