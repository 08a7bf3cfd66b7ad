"""Faults of the drive: gotos, stops, positions, start configuration."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any, ClassVar

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import (
    MOVED,
    NOT_ANSWERED,
    NOT_SENT,
    READ_REVERSED,
    REVERSED,
    TWICE,
    Caught,
    sent_late,
)
from eurobot_od.device.node import Node
from eurobot_od.errors import Refused
from eurobot_od.frame import Frame
from eurobot_od.pdo.catalogue import Message
from eurobot_od.robot.faults.core import DRIVES_ON, message_faults, replaced_by
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviResponse,
    EmergencyShutdown,
    EmergencyStop,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Barriers, GotoFault, Obstacle, Passage, Source, TeamColour
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.nodes.node import Objects

WITHOUT_BARRIERS = 6
"""Bytes of a Goto XY that ends after the speed."""

JUMP = 7000
"""By how many ms a time jumps."""

GLANCE = 0.01
"""Seconds from one look whether the drive stands to the next."""

LOCATION = "2.2 Estimated Location response"
NODE_CHECK = "2.3 Node Check Response"
"""Groups of steps."""

STATE_UNKNOWN = "2.1 State Response: time unknown without a goto"
POSITION_UNKNOWN = f"{LOCATION}: unknown before the start configuration"
DRIVE_THERE = f"{NODE_CHECK}: the drive is there"
CONFIRMED = "2.3 Start Configuration Confirm: the drive confirms"
"""Steps that find several faults: the first ones that look at an answer at all."""

ANGLE_REACHED = "1 and 2.1 Goto: the angle is reached, counted counter-clockwise"
START_PLACE = "2.3 Start Configuration Set: the robot is at its team's start place"
"""Steps that find several faults: the first ones that look at an angle, and at a place."""


class CoreUnwatched(Drive):
    """Drives on when the core has fallen silent."""

    def heartbeat_lost(self, node_id: int) -> None:
        """Do nothing."""


class CoreBootIgnored(Drive):
    """Drives on when the core has booted."""

    def booted(self, node_id: int) -> None:
        """Do nothing."""


class CommandsStored(Drive):
    """Keeps what is written to the object of a command, and does nothing else."""

    OBJECTS: ClassVar[Objects] = {name: each._replace(write=None) for name, each in Drive.OBJECTS.items()}


class MeasurementsKept(Drive):
    """Has in its objects what it sent last, not what it measures."""

    OBJECTS: ClassVar[Objects] = {name: each._replace(read=None) for name, each in Drive.OBJECTS.items()}


class RefusalsSwallowed(Drive):
    """Says nothing of what it does not act on."""

    def _act(self, message: Message) -> None:
        with suppress(Refused):
            super()._act(message)


class DriveTakesAnyStart(Drive):
    """Takes any start configuration."""

    def check_configuration(self, configuration: StartConfigurationSet) -> None:
        """Find nothing wrong."""


def _once_standing(drive: Drive, action: Callable[[], object]) -> None:
    """Do something as soon as the drive does not move."""
    if drive.moving:
        drive.at(drive.now + GLANCE, lambda _: _once_standing(drive, action))
    else:
        action()


def _begin(drive: Drive, goto: GotoXY) -> None:
    """Begin a goto without confirming it: the answer is not sent."""
    with suppress(Refused):
        drive.answer_to(goto)


def _confirmed_on_arrival(drive: Drive, goto: GotoXY, _: Any) -> None:
    _begin(drive, goto)
    _once_standing(drive, lambda: drive.offer(GotoConfirm()))


def _queued(drive: Drive, goto: GotoXY, healthy: Any) -> None:
    """Confirm a goto at once, and begin it when the one before has ended."""
    if drive.moving:
        drive.offer(GotoConfirm())
        _once_standing(drive, lambda: _begin(drive, goto))
    else:
        healthy(goto)


def _under_way(time: object) -> bool:
    return isinstance(time, int) and not isinstance(time, GotoFault) and time > 0


def _resumed(drive: Drive, stop: StopDrive, healthy: Any) -> None:
    """Stop, and go on after two seconds."""
    goto = drive.goto
    healthy(stop)
    if goto is not None:
        drive.at(drive.now + 2, lambda _: _begin(drive, goto))


def _safe_as_before(drive: Drive, message: Message, healthy: Any) -> None:
    """Act on a message, but neither enter nor leave the safe state by it."""
    safe = drive.safe
    healthy(message)
    drive.safe = safe


def _swapped(flags: int) -> int:
    """Exchange the two bits of each barrier."""
    return (flags & 0x5555) << 1 | (flags & 0xAAAA) >> 1


def _place_swapped(node: Node, frame: Frame) -> Iterable[Frame]:
    limits = node.device.protocol.binding_of(frame.cob_id).limits
    x, y = limits["x"].high, limits["y"].high
    return hooks.meaning(lambda goto: goto._replace(x=min(goto.y, x), y=min(goto.x, y)))(node, frame)


def _place_at_the_edge(node: Node, frame: Frame) -> Iterable[Frame]:
    limits = node.device.protocol.binding_of(frame.cob_id).limits
    return hooks.raw(x=partial(min, limits["x"].high), y=partial(min, limits["y"].high))(node, frame)


def _without(flags: Barriers, passage: Passage, instead: Passage) -> Barriers:
    return Barriers.of({n: instead if p is passage else p for n, p in flags.set_barriers()})


FAULTS = {
    **message_faults(
        "drive",
        ("goto-not-confirmed", NOT_SENT, GotoConfirm, "2.1 Goto ACK: a goto is confirmed"),
        ("goto-confirmed-late", sent_late(0.6), GotoConfirm, "2.1 Goto ACK: a goto is confirmed"),
        ("goto-confirmed-twice", TWICE, GotoConfirm, "2.1 Goto ACK: one confirm for one goto"),
        ("goto-confirmed-under-wrong-identifier", MOVED, GotoConfirm, "2.1 Goto ACK: a goto is confirmed"),
        ("goto-byte-order", READ_REVERSED, GotoXY, "2.1 Goto ACK: a goto is confirmed"),
        ("stop-ignored", DRIVES_ON, StopDrive, "2.1 Stop: the goto is dropped"),
        ("state-not-answered", NOT_ANSWERED, GotoStateRequest, STATE_UNKNOWN),
        ("state-answered-late", sent_late(0.3), GotoStateResponse, "2.1 State Response: follows directly"),
        ("state-answered-twice", TWICE, GotoStateResponse, "2.1 State Response: one answer for one request"),
        ("time-byte-order", REVERSED, GotoStateResponse, STATE_UNKNOWN),
        ("position-not-answered", NOT_ANSWERED, KalmanPositionRequest, POSITION_UNKNOWN),
        ("position-answered-late", sent_late(0.3), KalmanPositionResponse, f"{LOCATION}: follows directly"),
        ("position-answered-twice", TWICE, KalmanPositionResponse, f"{LOCATION}: one answer for one request"),
        ("position-byte-order", REVERSED, KalmanPositionResponse, POSITION_UNKNOWN),
        ("drive-check-not-answered", NOT_ANSWERED, CheckDriveRequest, DRIVE_THERE),
        ("drive-check-answered-for-navigation", replaced_by(CheckNaviResponse()), CheckDriveResponse, DRIVE_THERE),
        ("drive-check-answered-twice", TWICE, CheckDriveResponse, f"{NODE_CHECK}: one answer for one request"),
        ("drive-configuration-not-confirmed", NOT_SENT, StartConfigurationConfirm, CONFIRMED),
    ),
    **message_faults(
        "emergency",
        ("emergency-stop-ignored", DRIVES_ON, EmergencyStop, "4.2.2 Obstacle: the goto is dropped at once"),
        ("shutdown-ignored", DRIVES_ON, EmergencyShutdown, "4.2.2 Emergency mushroom: the goto is dropped"),
    ),
    # Goto (document 2.1)
    "goto-confirmed-on-arrival": Caught("drive", "2.1 Goto ACK: a goto is confirmed").fault(
        "takes Goto Confirm for the arrival", hooks.handling(GotoXY, _confirmed_on_arrival)
    ),
    "goto-confirmed-not-driven": Caught("drive", "2.1 State Response: a goto has a remaining time").fault(
        "confirms a goto and stays where it is", hooks.handling(GotoXY, lambda drive, *_: drive.offer(GotoConfirm()))
    ),
    "goto-not-replaced": Caught("drive", "2.1 Goto: the goto before is dropped").fault(
        "confirms a new goto but goes on with the one before",
        hooks.handling(
            GotoXY, lambda drive, goto, healthy: drive.offer(GotoConfirm()) if drive.moving else healthy(goto)
        ),
    ),
    "goto-queued": Caught("drive", "2.1 Goto: the goto before is dropped").fault(
        "drives to the first goto's place before it takes the second one", hooks.handling(GotoXY, _queued)
    ),
    "goto-place-swapped": Caught("drive", "2.1 Goto: the place is reached").fault(
        "takes x for y and y for x",
        hooks.arriving(GotoXY, _place_swapped),
    ),
    "goto-x-one-bit-off": Caught("drive", "2.1 Goto: the place is reached").fault(
        "reads x one bit too low, so that it is halved", hooks.arriving(GotoXY, hooks.raw(x=lambda x: x >> 1))
    ),
    "goto-angle-ignored": Caught("drive", ANGLE_REACHED).fault(
        "arrives looking wherever it came from", hooks.arriving(GotoXY, hooks.field("angle", lambda _: 0))
    ),
    "goto-angle-clockwise": Caught("drive", ANGLE_REACHED).fault(
        "takes the angle of a goto for clockwise", hooks.arriving(GotoXY, hooks.field("angle", lambda angle: -angle))
    ),
    "goto-speed-ignored": Caught("drive", "Table 1 Goto: a third of the speed takes longer").fault(
        "drives at full speed whatever the goto says", hooks.arriving(GotoXY, hooks.field("speed", lambda _: 100))
    ),
    "goto-30-mm-too-far": Caught("drive", "2.1 Goto: the place is reached").fault(
        "drives to a place 30 mm off the one in the goto", hooks.arriving(GotoXY, hooks.raw(x=lambda x: x + 30))
    ),
    "forced-barrier-ignored": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "takes forced barriers for no barriers",
        hooks.arriving(GotoXY, hooks.field("barriers", lambda flags: _without(flags, Passage.FORCED, Passage.FREE))),
    ),
    "forced-barrier-as-normal": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "passes a forced barrier if there is no other way",
        hooks.arriving(GotoXY, hooks.field("barriers", lambda flags: _without(flags, Passage.FORCED, Passage.NORMAL))),
    ),
    "normal-barrier-ignored": Caught("barriers", "2.1 Barriers: a way round a normal barrier takes longer").fault(
        "takes normal barriers for no barriers",
        hooks.arriving(GotoXY, hooks.field("barriers", lambda flags: _without(flags, Passage.NORMAL, Passage.FREE))),
    ),
    "normal-barrier-as-forced": Caught("barriers", "2.1 Barriers: a normal barrier is passed if need be").fault(
        "does not drive to a place that only a normal barrier is on",
        hooks.arriving(GotoXY, hooks.field("barriers", lambda flags: _without(flags, Passage.NORMAL, Passage.FORCED))),
    ),
    "barrier-bits-swapped": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "exchanges the two bits of each barrier",
        hooks.arriving(GotoXY, hooks.field("barriers", lambda flags: Barriers(_swapped(flags)))),
    ),
    "barriers-in-reverse-order": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "counts the barriers from the other end of the flags",
        hooks.arriving(GotoXY, hooks.field("barriers", lambda f: Barriers(int(f"{_swapped(f):016b}"[::-1], 2)))),
    ),
    "barriers-demanded": Caught("bytes", "Table 1 Goto: barriers are optional").fault(
        "refuses a goto that leaves out the optional barriers",
        hooks.arriving(GotoXY, hooks.only(lambda data: len(data) != WITHOUT_BARRIERS)),
    ),
    "half-of-barriers-taken": Caught("bytes", "Table 1 Goto: half of the barriers is refused").fault(
        "takes a goto with half of the barriers",
        hooks.arriving(GotoXY, hooks.data(lambda data: data.ljust(8, b"\0") if len(data) > WITHOUT_BARRIERS else data)),
    ),
    "places-outside-taken": Caught("bytes", "Table 1 Goto: x = 4000 is refused").fault(
        "drives to the edge when it is sent beyond it",
        hooks.arriving(GotoXY, _place_at_the_edge),
    ),
    "angle-360-taken": Caught("bytes", "Table 1 Goto: an angle of 360 degrees is refused").fault(
        "takes 360 degrees for 0", hooks.arriving(GotoXY, hooks.raw(angle=lambda angle: angle % 360))
    ),
    "speed-above-100-taken": Caught("bytes", "Table 1 Goto: a speed of 101 percent is refused").fault(
        "takes 101 percent for 100", hooks.arriving(GotoXY, hooks.raw(speed=lambda speed: min(speed, 100)))
    ),
    "three-enemies-taken": Caught("bytes", "Table 3: three enemies are refused").fault(
        "takes three enemies for two",
        hooks.arriving(StartConfigurationSet, hooks.raw(enemies=lambda enemies: min(enemies, 2))),
    ),
    # Stops (document 2.1, 4.2.2)
    "stop-on-arrival": Caught("drive", "2.1 Stop: the goto is dropped").fault(
        "heeds Stop Drive only when it has arrived",
        hooks.handling(StopDrive, lambda drive, stop, healthy: _once_standing(drive, lambda: healthy(stop))),
    ),
    "goto-resumed-after-stop": Caught("drive", "2.1 Stop: the robot stays where it stopped").fault(
        "stops for two seconds and goes on with the goto", hooks.handling(StopDrive, _resumed)
    ),
    "brakes-do-not-hold": Caught("drive", "2.1 Stop: the robot stands after a second").fault(
        "takes ten times as long to stop as it should", hooks.preset("Motion.Braking", 60)
    ),
    "emergency-stop-late": Caught("emergency", "4.2.2 Obstacle: the goto is dropped at once").fault(
        "is busy for 800 ms before it looks at an Emergency Stop",
        hooks.handling(EmergencyStop, lambda drive, stop, healthy: drive.at(drive.now + 0.8, lambda _: healthy(stop))),
    ),
    "emergency-stop-for-things-ignored": Caught("emergency", "4.2.2 Obstacle: a thing stops the drive as well").fault(
        "stops for enemies but not for things",
        hooks.handling(
            EmergencyStop, lambda _, stop, healthy: healthy(stop) if stop.obstacle is Obstacle.ENEMY else None
        ),
    ),
    "unknown-obstacle-ignored": Caught("bytes", "Table 1 Extended Stop: an obstacle nobody knows stops as well").fault(
        "drives on when it does not know the obstacle that it is stopped for",
        hooks.arriving(EmergencyStop, hooks.only(lambda data: data[:1] in (b"\0", b"\1"))),
    ),
    "obstacle-reason-lost": Caught("canopen", "2.1 Extended Stop: the reason is kept").fault(
        "forgets whether it was stopped for an enemy or a thing",
        hooks.arriving(EmergencyStop, hooks.field("obstacle", lambda _: Obstacle.OBJECT)),
    ),
    "shutdown-not-held": Caught("emergency", "4.2.2 Emergency mushroom: no goto is confirmed").fault(
        "accepts the next goto after an Emergency Shutdown", hooks.handling(EmergencyShutdown, _safe_as_before)
    ),
    "shutdown-held-for-ever": Caught("emergency", "4.2.2 Emergency mushroom: a new start configuration ends it").fault(
        "stays in its safe state after a new start configuration",
        hooks.handling(StartConfigurationSet, _safe_as_before),
    ),
    "mute-after-shutdown": Caught("emergency", "4.2.2 Emergency mushroom: the drive still answers node checks").fault(
        "answers no node check after an Emergency Shutdown",
        hooks.handling(CheckDriveRequest, lambda drive, request, healthy: None if drive.safe else healthy(request)),
    ),
    "core-unwatched": Caught("canopen", "7.2.8.3.2 Heartbeat: the robot brakes when the core falls silent").fault(
        "drives on when the core's heartbeat is lost", CoreUnwatched
    ),
    "core-boot-ignored": Caught("canopen", "7.2.8.3.3 NMT: the robot brakes when the core boots").fault(
        "drives on when the core has booted and forgotten the goto", CoreBootIgnored
    ),
    "speed-0-accepted": Caught("bytes", "Table 1 Goto: at a speed of 0 no place is ever reached").fault(
        "takes a goto at no speed for one that takes very long",
        hooks.arriving(GotoXY, hooks.field("speed", lambda speed: speed or 1)),
    ),
    # State (document 2.1, Table 1)
    "state-unasked": Caught("drive", "2.1 State Request: no answer without a request").fault(
        "sends Goto State Response by itself every 50 ms",
        hooks.every(0.05, lambda drive: drive.offer(GotoStateResponse(drive.remaining()))),
    ),
    "state-short": Caught("drive", STATE_UNKNOWN).fault(
        "sends a remaining time of 16 bits instead of 24",
        hooks.leaving(GotoStateResponse, hooks.data(lambda data: data[:2])),
    ),
    "state-long": Caught("drive", STATE_UNKNOWN).fault(
        "sends a remaining time of 32 bits instead of 24",
        hooks.leaving(GotoStateResponse, hooks.data(lambda data: data + b"\x01")),
    ),
    "time-unknown-as-zero": Caught("drive", STATE_UNKNOWN).fault(
        "says 0 where the remaining time is unknown",
        hooks.leaving(GotoStateResponse, hooks.meaning(lambda state: GotoStateResponse(state.time or 0))),
    ),
    "time-in-hundredths": Caught("drive", "Table 1 State Response: 1 bit is 1 ms").fault(
        "counts the remaining time in hundredths of a second",
        hooks.leaving(
            GotoStateResponse,
            hooks.meaning(lambda s: GotoStateResponse(s.time // 10 if _under_way(s.time) else s.time)),
        ),
    ),
    "time-never-falls": Caught("drive", "2.1 State Response: the time falls").fault(
        "says the same remaining time until it arrives",
        hooks.leaving(GotoStateResponse, hooks.field("time", lambda time: 5000 if _under_way(time) else time)),
    ),
    "time-jumps": Caught("drive", "2.1 State Response: the time goes on falling").fault(
        "says a remaining time that goes up and down",
        hooks.numbered(
            GotoStateResponse,
            lambda number: (
                hooks.kept
                if number % 2
                else hooks.field("time", lambda time: time + JUMP if _under_way(time) else time)
            ),
        ),
    ),
    "arrival-not-said": Caught("drive", "2.1 State Response: 0 when the place is reached").fault(
        "says 1 ms when it has arrived", hooks.leaving(GotoStateResponse, hooks.field("time", lambda time: time or 1))
    ),
    "arrival-said-at-once": Caught("drive", "2.1 State Response: a goto has a remaining time").fault(
        "says that it has arrived as soon as it has a goto",
        hooks.leaving(GotoStateResponse, hooks.field("time", lambda time: 0 if _under_way(time) else time)),
    ),
    "impossible-as-unknown": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "says that the time is unknown when there is no way",
        hooks.leaving(
            GotoStateResponse, hooks.meaning(lambda s: s._replace(time=None) if isinstance(s.time, GotoFault) else s)
        ),
    ),
    # Filtered position (document 2.2, 4.2.2)
    "position-swapped": Caught("drive", START_PLACE).fault(
        "sends x as y and y as x", hooks.leaving(KalmanPositionResponse, hooks.exchanged("x", "y"))
    ),
    "position-in-centimetres": Caught("drive", START_PLACE).fault(
        "sends its position in centimetres",
        # Not when it is unknown: other steps look at that.
        hooks.leaving(
            KalmanPositionResponse,
            hooks.meaning(lambda p: p if p.x is None else p._replace(x=p.x // 10, y=p.y // 10)),
        ),
    ),
    "position-y-one-bit-off": Caught("drive", START_PLACE).fault(
        "sends y one bit too low, so that it is halved",
        hooks.leaving(KalmanPositionResponse, hooks.field("y", lambda y: y >> 1)),
    ),
    "position-angle-clockwise": Caught("drive", ANGLE_REACHED).fault(
        "sends its angle clockwise", hooks.leaving(KalmanPositionResponse, hooks.field("angle", lambda angle: -angle))
    ),
    "position-source-wrong": Caught("drive", f"{LOCATION}: the source is our robot itself").fault(
        "says that its position comes from the confederate",
        hooks.leaving(KalmanPositionResponse, hooks.field("source", lambda _: Source.CONFEDERATE)),
    ),
    "position-unknown-as-zero": Caught("drive", POSITION_UNKNOWN).fault(
        "says 0, 0 before it knows where it is", hooks.leaving(KalmanPositionResponse, hooks.unknown_as(0))
    ),
    "position-frozen": Caught("drive", "2.1 Goto: the place is reached").fault(
        "goes on saying the first position since the start configuration",
        hooks.frozen(KalmanPositionResponse, StartConfigurationSet),
    ),
    "navigation-ignored": Caught("drive", "4.2.2 Navigation: the drive takes the position into its estimate").fault(
        "takes no navigation position into its estimate", hooks.arriving(NaviPositionResponse, hooks.lost)
    ),
    "unknown-navigation-taken": Caught("drive", "Table 2: an unknown position changes nothing").fault(
        "takes an unknown navigation position for the place 255, 255",
        hooks.arriving(NaviPositionResponse, hooks.unknown_as(255)),
    ),
    # Node check and start configuration (document 2.3)
    "check-needs-configuration": Caught("drive", DRIVE_THERE).fault(
        "answers node checks only after the start configuration, so that the startup blocks",
        hooks.handling(
            CheckDriveRequest, lambda drive, request, healthy: healthy(request) if drive.configuration else None
        ),
    ),
    "drive-configuration-not-applied": Caught("drive", START_PLACE).fault(
        "confirms the start configuration and forgets it",
        hooks.handling(StartConfigurationSet, lambda drive, *_: drive.offer(StartConfigurationConfirm())),
    ),
    "team-colours-swapped": Caught("drive", START_PLACE).fault(
        "takes red for yellow and yellow for red",
        hooks.arriving(StartConfigurationSet, hooks.field("team_colour", lambda colour: TeamColour(1 - colour))),
    ),
    "team-colour-ignored": Caught("drive", "2.3 Start Configuration Set: yellow starts upper right").fault(
        "starts upper left whatever the team colour",
        hooks.arriving(StartConfigurationSet, hooks.field("team_colour", lambda _: TeamColour.RED)),
    ),
    "configuration-once": Caught("drive", "2.3 Start Configuration Set: yellow starts upper right").fault(
        "takes the first start configuration, and confirms later ones without taking them",
        hooks.handling(
            StartConfigurationSet,
            lambda drive, start, healthy: (
                drive.offer(StartConfigurationConfirm()) if drive.configuration else healthy(start)
            ),
        ),
    ),
    "contradictions-taken": Caught("sdo-commands", "Table 3 by SDO: no enemy, but a diameter, is refused").fault(
        "takes a start configuration that contradicts itself", DriveTakesAnyStart
    ),
    # Commands and measurements over SDO
    "sdo-commands-ignored": Caught(
        "sdo-commands", "2.3 Start configuration by SDO: the last value is the command"
    ).fault("stores what is written to the object of a command, and does not carry it out", CommandsStored),
    "sdo-refusals-swallowed": Caught(
        "sdo-commands", "4.2.2 Emergency mushroom: a goto by SDO is refused in the safe state"
    ).fault("confirms a command by SDO that it does not carry out", RefusalsSwallowed),
    "measurements-frozen": Caught(
        "sdo-commands", "2.2 Kalman position by SDO: the robot is at its team's start place"
    ).fault("has in its objects what it sent last, not where it is", MeasurementsKept),
}
