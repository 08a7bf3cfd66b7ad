"""Faults of the core: startup, gotos, polling, stops; among them those of the 2014 robot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from eurobot_od.frame import Frame
from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.faults.hooks import (
    arriving,
    both,
    data,
    every,
    exchanged,
    field,
    handling,
    leaving,
    lost,
    meaning,
    preset,
    raw,
    unawaited,
)
from eurobot_od.robot.faults.message_faults import MOVED, NOT_SENT, REVERSED, TWICE, message_faults, sent_late
from eurobot_od.robot.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
    Enemy2PositionRequest,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    NaviPositionRequest,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.values import Barriers, GotoFault, Obstacle


class ShutdownForgotten(Core):
    """Drives on after an Emergency Shutdown."""

    def emergency_shutdown(self) -> None:
        """Send Emergency Shutdown, and think nothing of it."""
        super().emergency_shutdown()
        self.shut_down = False


def _poll_absent(core: Core) -> None:
    """Ask for enemy 2, which the core's programme never has."""
    if core.configuration is not None:
        core.offer(Enemy2PositionRequest())


def _ask_on(core: Core, stop: Frame) -> Iterable[Frame]:
    """Send a stop, and go on asking for the state of the goto as if there had been none."""
    for count in range(1, 4):
        core.at(core.now + count * 0.1, lambda _: core.offer(GotoStateRequest()))
    return [stop]


def _either(_: Core, answer: CheckNaviResponse, healthy: Any) -> None:
    """Take either node's check answer for both (2014 robot)."""
    healthy(CheckDriveResponse())
    healthy(answer)


CONFIGURATION = "2.3 Start Configuration Set: colour, numbers and diameters"
GOTO = "2.1 Goto: place, angle, speed and barriers"
"""Steps that find several faults: they look at every field of a message."""

ASKED = "2.2 Estimated Location request"
"""A group of steps."""

FAULTS = (
    *message_faults(
        "core",
        ("drive-not-checked", NOT_SENT, CheckDriveRequest, "2.3 Node Check Request: the drive"),
        ("configuration-byte-order", REVERSED, StartConfigurationSet, CONFIGURATION),
        ("navigation-not-polled", NOT_SENT, NaviPositionRequest, "4.2.2 Navigation: the raw position is asked for"),
        ("position-not-polled", NOT_SENT, KalmanPositionRequest, "4.2.2 Position: the filtered position is asked for"),
        ("enemy-not-polled", NOT_SENT, Enemy1PositionRequest, f"{ASKED}: enemy 1 is asked for"),
        ("confederate-not-polled", NOT_SENT, ConfederatePositionRequest, f"{ASKED}: the confederate is asked for"),
        ("goto-not-sent", NOT_SENT, GotoXY, GOTO),
        ("goto-sent-twice", TWICE, GotoXY, "2.1 Goto ACK: 500 ms between two transmissions"),
        ("goto-sent-reversed", REVERSED, GotoXY, GOTO),
        ("state-not-asked", NOT_SENT, GotoStateRequest, "2.1 State Request: the drive's state is asked for"),
        ("obstacle-not-told", NOT_SENT, EmergencyStop, "4.2.2 Obstacle: Emergency Stop for a thing, in one bit"),
        ("stop-under-wrong-identifier", MOVED, StopDrive, "2.1 Stop: Stop Drive"),
        ("mushroom-not-told", NOT_SENT, EmergencyShutdown, "4.2.2 Emergency mushroom: Emergency Shutdown"),
        ("mushroom-late", sent_late(3.0), EmergencyShutdown, "4.2.2 Emergency mushroom: Emergency Shutdown"),
    ),
    # Startup (document 2.3, 5.1)
    Fault(
        "either-check-satisfies",
        "takes either node's check answer for both (2014 robot)",
        handling(CheckNaviResponse, _either),
        Caught("core", "2.3 Node Check Response: the navigation's answer is not the drive's"),
    ),
    Fault(
        "check-asked-once",
        "asks for the drive once and gives up",
        preset("Node check.Check attempts", 1),
        Caught("core", "5.1 Startup: a node that does not answer is asked again"),
    ),
    Fault(
        "checks-not-awaited",
        "goes on with the startup without the nodes' answers",
        both(
            leaving(CheckDriveRequest, unawaited(CheckDriveResponse())),
            leaving(CheckNaviRequest, unawaited(CheckNaviResponse())),
        ),
        Caught("core", "5.1 Startup: a node that does not answer blocks the startup"),
    ),
    Fault(
        "navigation-not-checked",
        "configures the start when the drive has answered",
        both(leaving(CheckNaviRequest, lost), leaving(CheckNaviRequest, unawaited(CheckNaviResponse()))),
        Caught("core", "2.3 Node Check Request: the navigation"),
    ),
    Fault(
        "configuration-sent-once",
        "does not send the start configuration again (2014 robot)",
        preset("Configuration handshake.Configuration transmissions", 1),
        Caught("core", "2.3 Start Configuration Set: again without a confirm"),
    ),
    Fault(
        "configuration-confirm-not-awaited",
        "does not wait for the start configuration's confirm (2014 robot)",
        leaving(StartConfigurationSet, unawaited(StartConfigurationConfirm())),
        Caught("core", "2.3 Start Configuration Set: again without a confirm"),
    ),
    Fault(
        "configuration-confirm-unheard",
        "sends the start configuration on and on, confirmed or not",
        arriving(StartConfigurationConfirm, lost),
        Caught("core", "2.3 Start Configuration Confirm: confirmed once is enough"),
    ),
    Fault(
        "configuration-diameters-mixed-up",
        "sends enemy 1's diameter as enemy 2's",
        leaving(StartConfigurationSet, exchanged("enemy_1_diameter", "enemy_2_diameter")),
        Caught("core", CONFIGURATION),
    ),
    Fault(
        "configuration-diameter-in-millimetres",
        "sends the enemies' diameters in millimetres, as far as they fit",
        leaving(StartConfigurationSet, raw(enemy_1_diameter=lambda d: d * 10, enemy_2_diameter=lambda d: d * 10)),
        Caught("core", CONFIGURATION),
    ),
    Fault(
        "configuration-colour-wrong",
        "sends yellow for red",
        leaving(StartConfigurationSet, raw(team_colour=lambda colour: 1 - colour)),
        Caught("core", CONFIGURATION),
    ),
    # Position polling (document 2.2, 4.2.2, 5.2)
    Fault(
        "absent-enemy-polled",
        "asks for an enemy that the start configuration does not have",
        every(0.6, _poll_absent),
        Caught("core", "2.3 Start Configuration Set: nobody asks for an enemy that is not there"),
    ),
    Fault(
        "polling-period-wraps",
        "asks for positions every 655 ms because a counter wraps (2014 robot)",
        preset("Position polling.Polling period", 655),
        Caught("core", "5.2 Match: positions are asked for every 600 ms"),
    ),
    Fault(
        "polling-before-configuration",
        "asks for positions from the beginning on",
        every(0.3, lambda core: core.offer(KalmanPositionRequest())),
        Caught("core", "5.1 Startup: no positions before the start configuration"),
    ),
    # Goto (document 2.1)
    Fault(
        "goto-sent-swapped",
        "sends x as y and y as x",
        leaving(GotoXY, exchanged("x", "y")),
        Caught("core", GOTO),
    ),
    Fault(
        "goto-sent-clockwise",
        "sends the angle of a goto clockwise",
        leaving(GotoXY, field("angle", lambda angle: -angle)),
        Caught("core", GOTO),
    ),
    Fault(
        "goto-speed-as-byte",
        "sends a speed of 255 for 100 percent",
        leaving(GotoXY, raw(speed=lambda speed: speed * 255 // 100)),
        Caught("core", GOTO),
    ),
    Fault(
        "goto-barriers-one-off",
        "numbers the barriers from 0 instead of 1",
        leaving(GotoXY, field("barriers", lambda flags: Barriers(flags << 2 & 0xFFFF))),
        Caught("core", GOTO),
    ),
    Fault(
        "goto-sent-once",
        "does not send a goto again that is not confirmed",
        preset("Goto handshake.Transmissions", 1),
        Caught("core", "2.1 Goto ACK: a goto that is not confirmed is sent again"),
    ),
    Fault(
        "goto-sent-for-ever",
        "never gives up a goto that is not confirmed",
        preset("Goto handshake.Transmissions", 200),
        Caught("core", "2.1 Goto ACK: a goto is sent six times at most"),
    ),
    Fault(
        "goto-impatient",
        "waits 50 ms for a goto's confirm",
        preset("Goto handshake.Confirm wait", 50),
        Caught("core", "2.1 Goto ACK: 500 ms between two transmissions"),
    ),
    Fault(
        "goto-confirm-unheard",
        "sends a goto again although it is confirmed",
        arriving(GotoConfirm, lost),
        Caught("core", "2.1 Goto ACK: a confirmed goto is not sent again"),
    ),
    Fault(
        "state-asked-too-often",
        "asks for the drive's state every 5 ms",
        preset("Goto handshake.State request period", 5),
        Caught("core", "2.1 State Request: time for other messages in between"),
    ),
    Fault(
        "state-asked-once",
        "asks for the drive's state and does not ask again after the first answer",
        arriving(GotoStateResponse, meaning(lambda _: GotoStateResponse(0))),
        Caught("core", "2.1 State Request: asked again while the drive is under way"),
    ),
    Fault(
        "unknown-time-as-arrival",
        "takes an unknown remaining time for the arrival",
        arriving(GotoStateResponse, meaning(lambda state: GotoStateResponse(state.time or 0))),
        Caught("core", "Table 1 State Response: an unknown time is no arrival"),
    ),
    Fault(
        "arrival-unheard",
        "goes on asking after the drive has arrived",
        arriving(GotoStateResponse, field("time", lambda time: time or 1)),
        Caught("core", "2.1 State Response: 0 ends the goto"),
    ),
    Fault(
        "impossible-unheard",
        "goes on asking when the drive says that a goto is not possible",
        arriving(GotoStateResponse, field("time", lambda time: None if isinstance(time, GotoFault) else time)),
        Caught("core", "2.1 State Response: a goto that is not possible ends (2014 robot)"),
    ),
    # Stops (document 2.1, 4.2.2)
    Fault(
        "obstacle-reason-wrong",
        "says that every obstacle is a thing",
        leaving(EmergencyStop, field("obstacle", lambda _: Obstacle.OBJECT)),
        Caught("core", "4.2.2 Obstacle: Emergency Stop for an enemy"),
    ),
    Fault(
        "obstacle-bits-unmasked",
        "sends more than the obstacle's bit (2014 robot)",
        leaving(EmergencyStop, data(lambda data: bytes([data[0] | 0xF6]))),
        Caught("core", "4.2.2 Obstacle: Emergency Stop for a thing, in one bit"),
    ),
    Fault(
        "state-asked-after-stop",
        "goes on asking for the state of a goto that was stopped",
        leaving(EmergencyStop, _ask_on),
        Caught("core", "2.1 Stop: the goto's state is not asked for any more"),
    ),
    Fault(
        "goto-after-shutdown",
        "sends gotos after an Emergency Shutdown",
        ShutdownForgotten,
        Caught("core", "4.2.2 Emergency mushroom: no goto after it"),
    ),
)
