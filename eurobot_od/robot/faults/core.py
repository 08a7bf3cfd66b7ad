"""Faults of the core: startup, gotos, polling, stops; among them those of the 2014 robot."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import (
    MOVED,
    NOT_SENT,
    REVERSED,
    TWICE,
    Caught,
    Fault,
    FrameChange,
    Wrong,
    arriving,
    leaving,
    lost,
    sent_late,
    words,
)
from eurobot_od.device.node import Node
from eurobot_od.device.timers import Call
from eurobot_od.frame import Frame
from eurobot_od.pdo.catalogue import Message
from eurobot_od.robot.model.messages import (
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
from eurobot_od.robot.model.values import Barriers, GotoFault, Obstacle, RobotError
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.flows import GotoReport
from eurobot_od.robot.protocol import EurobotProtocol

DRIVES_ON = Wrong("drives on after {}", lambda message: arriving(message, lost))


def replaced_by(other: Message) -> Wrong:
    """Return what is wrong with a message that another node's is sent for."""
    return Wrong(f"sends {words(type(other))} for {{}}", lambda message: leaving(message, foreign(other)))


def foreign(message: Message) -> FrameChange:
    """Send a message of another node in a frame's place."""
    # The node's own EDS lacks that message, so all files of the folder are read, once.
    load = cache(EurobotProtocol.load)

    def changed(node: Node, _frame: Frame) -> Iterable[Frame]:
        return [load(node.device.dictionary.file.parent).encode(message)]

    return changed


def message_faults(suite: str, *rows: tuple[str, Wrong, type[Message], str]) -> dict[str, Fault]:
    """Make faults that steps of one suite find; a row has the fault's name, what is wrong, with what, and the step."""
    return {
        name: Caught(suite, step).fault(wrong.text.format(words(message)), wrong.mixin(message))
        for name, wrong, message, step in rows
    }


class ShutdownForgotten(Core):
    """Drives on after an Emergency Shutdown."""

    def goto(self, *place: Any, **how: Any) -> Call[GotoReport]:
        """Send the drive to a place whatever has been."""
        self.shut_down = False
        return super().goto(*place, **how)


class MatchWithoutEnd(Core):
    """Leaves the end of the match to the strategy."""

    def start_match(self, duration: float | None = None) -> None:
        """Start no clock."""


class SourceUnseen(Core):
    """Takes every position for that of the robot it asked for."""

    def doubt(self, message: Message) -> int | None:
        code = super().doubt(message)
        return None if code == RobotError.WRONG_SOURCE else code


def _ask_on(core: Core, stop: Frame) -> Iterable[Frame]:
    """Send a stop, and go on asking for the state of the goto as if there had been none."""
    for count in range(1, 15):
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

FAULTS = {
    **message_faults(
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
        (
            "stop-under-wrong-identifier",
            MOVED,
            StopDrive,
            "2.1 Goto ACK: and then stopped, as the drive may have heard it",
        ),
        ("mushroom-not-told", NOT_SENT, EmergencyShutdown, "4.2.2 Emergency mushroom: Emergency Shutdown"),
        ("mushroom-late", sent_late(3.0), EmergencyShutdown, "4.2.2 Emergency mushroom: Emergency Shutdown"),
    ),
    # Startup (document 2.3, 5.1)
    "either-check-satisfies": Caught(
        "core", "2.3 Node Check Response: the navigation's answer is not the drive's"
    ).fault("takes either node's check answer for both (2014 robot)", hooks.handling(CheckNaviResponse, _either)),
    "check-asked-once": Caught("core", "5.1 Startup: a node that does not answer is asked again").fault(
        "asks for the drive once and gives up", hooks.preset("Node check.Check attempts", 1)
    ),
    "checks-not-awaited": Caught("core", "5.1 Startup: a node that does not answer blocks the startup").fault(
        "goes on with the startup without the nodes' answers",
        hooks.both(
            hooks.leaving(CheckDriveRequest, hooks.unawaited(CheckDriveResponse())),
            hooks.leaving(CheckNaviRequest, hooks.unawaited(CheckNaviResponse())),
        ),
    ),
    "navigation-not-checked": Caught("core", "2.3 Node Check Request: the navigation").fault(
        "configures the start when the drive has answered",
        hooks.both(
            hooks.leaving(CheckNaviRequest, hooks.lost),
            hooks.leaving(CheckNaviRequest, hooks.unawaited(CheckNaviResponse())),
        ),
    ),
    "configuration-sent-once": Caught("core", "2.3 Start Configuration Set: again without a confirm").fault(
        "does not send the start configuration again (2014 robot)",
        hooks.preset("Configuration handshake.Configuration transmissions", 1),
    ),
    "configuration-confirm-not-awaited": Caught("core", "2.3 Start Configuration Set: again without a confirm").fault(
        "does not wait for the start configuration's confirm (2014 robot)",
        hooks.leaving(StartConfigurationSet, hooks.unawaited(StartConfigurationConfirm())),
    ),
    "configuration-confirm-unheard": Caught("core", "2.3 Start Configuration Confirm: confirmed once is enough").fault(
        "sends the start configuration on and on, confirmed or not",
        hooks.arriving(StartConfigurationConfirm, hooks.lost),
    ),
    "configuration-diameters-mixed-up": Caught("core", CONFIGURATION).fault(
        "sends enemy 1's diameter as enemy 2's",
        hooks.leaving(StartConfigurationSet, hooks.exchanged("enemy_1_diameter", "enemy_2_diameter")),
    ),
    "configuration-diameter-in-millimetres": Caught("core", CONFIGURATION).fault(
        "sends the enemies' diameters in millimetres, as far as they fit",
        hooks.leaving(
            StartConfigurationSet, hooks.raw(enemy_1_diameter=lambda d: d * 10, enemy_2_diameter=lambda d: d * 10)
        ),
    ),
    "configuration-colour-wrong": Caught("core", CONFIGURATION).fault(
        "sends yellow for red", hooks.leaving(StartConfigurationSet, hooks.raw(team_colour=lambda colour: 1 - colour))
    ),
    # Position polling (document 2.2, 4.2.2, 5.2)
    "absent-enemy-polled": Caught(
        "core", "2.3 Start Configuration Set: nobody asks for an enemy that is not there"
    ).fault(
        "asks for an enemy that the start configuration does not have",
        # The core's programme in a check never has an enemy 2.
        hooks.every(0.6, lambda core: core.offer(Enemy2PositionRequest()) if core.configuration else None),
    ),
    "polling-period-wraps": Caught("core", "5.2 Match: positions are asked for every 600 ms").fault(
        "asks for positions every 655 ms because a counter wraps (2014 robot)",
        hooks.preset("Position polling.Polling period", 655),
    ),
    "polling-before-configuration": Caught("core", "5.1 Startup: no positions before the start configuration").fault(
        "asks for positions from the beginning on", hooks.every(0.3, lambda core: core.offer(KalmanPositionRequest()))
    ),
    # Goto (document 2.1)
    "goto-sent-swapped": Caught("core", GOTO).fault(
        "sends x as y and y as x", hooks.leaving(GotoXY, hooks.exchanged("x", "y"))
    ),
    "goto-sent-clockwise": Caught("core", GOTO).fault(
        "sends the angle of a goto clockwise", hooks.leaving(GotoXY, hooks.field("angle", lambda angle: -angle))
    ),
    "goto-speed-as-byte": Caught("core", GOTO).fault(
        "sends a speed of 255 for 100 percent", hooks.leaving(GotoXY, hooks.raw(speed=lambda speed: speed * 255 // 100))
    ),
    "goto-barriers-one-off": Caught("core", GOTO).fault(
        "numbers the barriers from 0 instead of 1",
        hooks.leaving(GotoXY, hooks.field("barriers", lambda flags: Barriers(flags << 2 & 0xFFFF))),
    ),
    "goto-sent-once": Caught("core", "2.1 Goto ACK: a goto that is not confirmed is sent again").fault(
        "does not send a goto again that is not confirmed", hooks.preset("Goto handshake.Transmissions", 1)
    ),
    "goto-sent-for-ever": Caught("core", "2.1 Goto ACK: a goto is sent six times at most").fault(
        "never gives up a goto that is not confirmed", hooks.preset("Goto handshake.Transmissions", 200)
    ),
    "goto-impatient": Caught("core", "2.1 Goto ACK: 500 ms between two transmissions").fault(
        "waits 50 ms for a goto's confirm", hooks.preset("Goto handshake.Confirm wait", 50)
    ),
    "goto-confirm-unheard": Caught("core", "2.1 Goto ACK: a confirmed goto is not sent again").fault(
        "sends a goto again although it is confirmed", hooks.arriving(GotoConfirm, hooks.lost)
    ),
    "state-asked-too-often": Caught("core", "2.1 State Request: time for other messages in between").fault(
        "asks for the drive's state every 5 ms", hooks.preset("Goto handshake.State request period", 5)
    ),
    "state-asked-once": Caught("core", "2.1 State Request: asked again while the drive is under way").fault(
        "asks for the drive's state and does not ask again after the first answer",
        hooks.arriving(GotoStateResponse, hooks.meaning(lambda _: GotoStateResponse(0))),
    ),
    "unknown-time-as-arrival": Caught("core", "Table 1 State Response: an unknown time is not an arrival").fault(
        "takes an unknown remaining time for the arrival",
        hooks.arriving(GotoStateResponse, hooks.meaning(lambda state: GotoStateResponse(state.time or 0))),
    ),
    "arrival-unheard": Caught("core", "2.1 State Response: 0 is believed when the drive is at the place").fault(
        "goes on asking after the drive has arrived",
        hooks.arriving(GotoStateResponse, hooks.field("time", lambda time: time or 1)),
    ),
    "impossible-unheard": Caught("core", "2.1 State Response: a goto that is not possible ends (2014 robot)").fault(
        "goes on asking when the drive says that a goto is not possible",
        hooks.arriving(
            GotoStateResponse, hooks.field("time", lambda time: None if isinstance(time, GotoFault) else time)
        ),
    ),
    # Stops (document 2.1, 4.2.2)
    "obstacle-reason-wrong": Caught("core", "4.2.2 Obstacle: Emergency Stop for an enemy").fault(
        "says that every obstacle is a thing",
        hooks.leaving(EmergencyStop, hooks.field("obstacle", lambda _: Obstacle.OBJECT)),
    ),
    "obstacle-bits-unmasked": Caught("core", "4.2.2 Obstacle: Emergency Stop for a thing, in one bit").fault(
        "sends more than the obstacle's bit (2014 robot)",
        hooks.leaving(EmergencyStop, hooks.data(lambda data: bytes([data[0] | 0xF6]))),
    ),
    "state-asked-after-stop": Caught("core", "2.1 Stop: no more questions when the robot stands").fault(
        "goes on asking for the state of a goto that was stopped", hooks.leaving(EmergencyStop, _ask_on)
    ),
    "goto-after-shutdown": Caught("core", "4.2.2 Emergency mushroom: no goto after it").fault(
        "sends gotos after an Emergency Shutdown", ShutdownForgotten
    ),
    # What is lost on the bus
    "stop-sent-once": Caught("core", "2.1 Stop: a stop is sent again while the drive knows of a goto").fault(
        "sends a stop once and takes it for heard", hooks.preset("Standstill.Stop period", 60_000)
    ),
    "standstill-not-watched": Caught(
        "core", "4.2.2 Emergency mushroom: a robot that is not seen to stand is reported by EMCY"
    ).fault("never says that the robot does not stop", hooks.preset("Standstill.Standstill wait", 60_000)),
    "unconfirmed-goto-left": Caught("core", "2.1 Goto ACK: and then stopped, as the drive may have heard it").fault(
        "gives up a goto that is not confirmed without stopping the drive",
        hooks.numbered(StopDrive, lambda number: hooks.lost if number <= 5 else hooks.kept),
    ),
    "late-confirm-ignored": Caught("core", "2.1 Stop: a goto that is confirmed after its end is stopped again").fault(
        "does not stop a goto that is confirmed after its end",
        hooks.handling(GotoConfirm, lambda core, confirm, healthy: healthy(confirm) if core.is_commanding else None),
    ),
    "lost-goto-unseen": Caught("core", "2.1 State Response: a goto that the drive has lost is stopped").fault(
        "goes on asking when the drive knows of no goto", hooks.preset("Goto handshake.Lost after", 200)
    ),
    "one-confirm-believed": Caught(
        "core", "2.3 Start Configuration Confirm: anybody's confirm does not prove it, the drive is checked again"
    ).fault(
        "takes one confirm of the start configuration for both nodes'",
        hooks.numbered(
            CheckDriveRequest, lambda number: hooks.kept if number <= 3 else hooks.unawaited(CheckDriveResponse())
        ),
    ),
    "foreign-position-believed": Caught(
        "core", "2.2 Estimated Location response: a position of another robot is not ours"
    ).fault("takes a position for ours whoever's it is", SourceUnseen),
    "arrival-unproved": Caught("core", "2.1 State Response: a drive that is elsewhere has not arrived").fault(
        "takes 0 for the arrival wherever the drive is", hooks.preset("Arrival.Position tolerance", 5000)
    ),
    "match-without-end": Caught("core", "5.2 Match: the drive is stopped when the match is over").fault(
        "drives on when the match is over", MatchWithoutEnd
    ),
}
