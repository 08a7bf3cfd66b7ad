"""Faults of the core: startup, gotos, polling, stops; among them those of the 2014 robot.

Rule of this file: a row says what is wrong, how, and which step of which suite finds it. The faulty core is the core
with one thing changed.
"""

from __future__ import annotations

from typing import Any

from eurobot_od.device.flow import START, Pause, Script
from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.faults.hooks import (
    arriving,
    data,
    every,
    exchanged,
    field,
    handling,
    late,
    leaving,
    lost,
    meaning,
    moved,
    preset,
    raw,
    twice,
)
from eurobot_od.robot.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
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
from eurobot_od.robot.values import Barriers, GotoFault, Obstacle, Outcome


class NodesNotAwaited(Core):
    """Asks both nodes whether they are there and goes on without their answers."""

    def _check_nodes(self) -> Script[dict[str, float]]:
        yield START
        for request in (CheckDriveRequest(), CheckNaviRequest()):
            self.offer(request)
            yield Pause(0.1)
        return {}


class NavigationUnchecked(Core):
    """Goes on when the drive has answered."""

    def _check_nodes(self) -> Script[dict[str, float]]:
        script = super()._check_nodes()
        now = yield next(script)
        answer = yield script.send(now)
        script.close()
        return {"drive": 0.0, "navigation": 0.0} if answer else {}


class ConfirmNotAwaited(Core):
    """Sends the start configuration once and does not wait for the confirm (2014 robot)."""

    def _configure(self, configuration: StartConfigurationSet) -> Script[float]:
        yield START
        self.offer(configuration)
        self.configuration = configuration
        self._start_polling(self.now + self.seconds("Position polling.Start delay"))
        return 0.0


class EveryonePolled(Core):
    """Asks for two enemies and a confederate whoever is there."""

    def _start_polling(self, start: float) -> None:
        configured = self.configuration
        if configured is not None:
            self.configuration = configured._replace(enemies=2, confederates=1)
        super()._start_polling(start)
        self.configuration = configured


class StopsForgotten(Core):
    """Sends stops and goes on as if it had not."""

    def _end_driving(self, outcome: Outcome) -> None:
        if outcome is not Outcome.STOPPED:
            super()._end_driving(outcome)


class ShutdownForgotten(Core):
    """Drives on after an Emergency Shutdown."""

    def emergency_shutdown(self) -> None:
        """Send Emergency Shutdown, and think nothing of it."""
        super().emergency_shutdown()
        self.shut_down = False


def _either(_: Core, answer: CheckNaviResponse, healthy: Any) -> None:
    """Take either node's check answer for both (2014 robot)."""
    healthy(CheckDriveResponse())
    healthy(answer)


FAULTS = (
    # Startup (document 2.3, 5.1)
    Fault(
        "drive-not-checked",
        "checks the navigation only",
        leaving(CheckDriveRequest, lost),
        Caught("core", "2.3 Node Check Request: the drive"),
    ),
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
        NodesNotAwaited,
        Caught("core", "5.1 Startup: a node that does not answer blocks the startup"),
    ),
    Fault(
        "navigation-not-checked",
        "configures the start when the drive has answered",
        NavigationUnchecked,
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
        ConfirmNotAwaited,
        Caught("core", "2.3 Start Configuration Set: again without a confirm"),
    ),
    Fault(
        "configuration-confirm-unheard",
        "sends the start configuration on and on, confirmed or not",
        arriving(StartConfigurationConfirm, lost),
        Caught("core", "2.3 Start Configuration Confirm: confirmed once is enough"),
    ),
    Fault(
        "configuration-byte-order",
        "sends the bytes of the start configuration the wrong way round",
        leaving(StartConfigurationSet, data(lambda data: data[::-1])),
        Caught("core", "2.3 Start Configuration Set: colour, numbers and diameters"),
    ),
    Fault(
        "configuration-diameters-mixed-up",
        "sends enemy 1's diameter as enemy 2's",
        leaving(StartConfigurationSet, exchanged("enemy_1_diameter", "enemy_2_diameter")),
        Caught("core", "2.3 Start Configuration Set: colour, numbers and diameters"),
    ),
    Fault(
        "configuration-diameter-in-millimetres",
        "sends the enemies' diameters in millimetres, as far as they fit",
        leaving(StartConfigurationSet, raw(enemy_1_diameter=lambda d: d * 10, enemy_2_diameter=lambda d: d * 10)),
        Caught("core", "2.3 Start Configuration Set: colour, numbers and diameters"),
    ),
    Fault(
        "configuration-colour-wrong",
        "sends yellow for red",
        leaving(StartConfigurationSet, raw(team_colour=lambda colour: 1 - colour)),
        Caught("core", "2.3 Start Configuration Set: colour, numbers and diameters"),
    ),
    # Position polling (document 2.2, 4.2.2, 5.2)
    Fault(
        "navigation-not-polled",
        "sends no Navi Position Request",
        leaving(NaviPositionRequest, lost),
        Caught("core", "4.2.2 Navigation: the raw position is asked for"),
    ),
    Fault(
        "position-not-polled",
        "sends no Kalman Position Request",
        leaving(KalmanPositionRequest, lost),
        Caught("core", "4.2.2 Position: the filtered position is asked for"),
    ),
    Fault(
        "enemy-not-polled",
        "sends no Enemy 1 Position Request",
        leaving(Enemy1PositionRequest, lost),
        Caught("core", "2.2 Estimated Location request: enemy 1 is asked for"),
    ),
    Fault(
        "confederate-not-polled",
        "sends no Confederate Position Request",
        leaving(ConfederatePositionRequest, lost),
        Caught("core", "2.2 Estimated Location request: the confederate is asked for"),
    ),
    Fault(
        "absent-enemy-polled",
        "asks for an enemy that the start configuration does not have",
        EveryonePolled,
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
        "goto-not-sent",
        "sends no Goto XY",
        leaving(GotoXY, lost),
        Caught("core", "2.1 Goto: place, angle, speed and barriers"),
    ),
    Fault(
        "goto-sent-reversed",
        "sends the bytes of Goto XY the wrong way round",
        leaving(GotoXY, data(lambda data: data[::-1])),
        Caught("core", "2.1 Goto: place, angle, speed and barriers"),
    ),
    Fault(
        "goto-sent-swapped",
        "sends x as y and y as x",
        leaving(GotoXY, exchanged("x", "y")),
        Caught("core", "2.1 Goto: place, angle, speed and barriers"),
    ),
    Fault(
        "goto-sent-clockwise",
        "sends the angle of a goto clockwise",
        leaving(GotoXY, field("angle", lambda angle: -angle)),
        Caught("core", "2.1 Goto: place, angle, speed and barriers"),
    ),
    Fault(
        "goto-speed-as-byte",
        "sends a speed of 255 for 100 percent",
        leaving(GotoXY, raw(speed=lambda speed: speed * 255 // 100)),
        Caught("core", "2.1 Goto: place, angle, speed and barriers"),
    ),
    Fault(
        "goto-barriers-one-off",
        "numbers the barriers from 0 instead of 1",
        leaving(GotoXY, field("barriers", lambda flags: Barriers(flags << 2 & 0xFFFF))),
        Caught("core", "2.1 Goto: place, angle, speed and barriers"),
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
        "goto-sent-twice",
        "sends every goto two times",
        leaving(GotoXY, twice),
        Caught("core", "2.1 Goto ACK: 500 ms between two transmissions"),
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
        "state-not-asked",
        "sends no Goto State Request",
        leaving(GotoStateRequest, lost),
        Caught("core", "2.1 State Request: the drive's state is asked for"),
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
        "obstacle-not-told",
        "sends no Emergency Stop",
        leaving(EmergencyStop, lost),
        Caught("core", "4.2.2 Obstacle: Emergency Stop for a thing, in one bit"),
    ),
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
        "stop-under-wrong-identifier",
        "sends Stop Drive under an identifier that nobody listens to",
        leaving(StopDrive, moved(1)),
        Caught("core", "2.1 Stop: Stop Drive"),
    ),
    Fault(
        "state-asked-after-stop",
        "goes on asking for the state of a goto that was stopped",
        StopsForgotten,
        Caught("core", "2.1 Stop: the goto's state is not asked for any more"),
    ),
    Fault(
        "mushroom-not-told",
        "sends no Emergency Shutdown",
        leaving(EmergencyShutdown, lost),
        Caught("core", "4.2.2 Emergency mushroom: Emergency Shutdown"),
    ),
    Fault(
        "mushroom-late",
        "sends Emergency Shutdown three seconds after the mushroom was hit",
        late(EmergencyShutdown, 3.0),
        Caught("core", "4.2.2 Emergency mushroom: Emergency Shutdown"),
    ),
    Fault(
        "goto-after-shutdown",
        "sends gotos after an Emergency Shutdown",
        ShutdownForgotten,
        Caught("core", "4.2.2 Emergency mushroom: no goto after it"),
    ),
)
