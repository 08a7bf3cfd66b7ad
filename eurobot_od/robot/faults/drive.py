"""Faults of the drive: gotos, stops, positions, start configuration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.faults.hooks import (
    arriving,
    data,
    every,
    exchanged,
    field,
    frozen,
    handling,
    kept,
    leaving,
    lost,
    meaning,
    numbered,
    only,
    preset,
    raw,
)
from eurobot_od.robot.faults.message_faults import (
    DRIVES_ON,
    MOVED,
    NOT_ANSWERED,
    NOT_SENT,
    READ_REVERSED,
    REVERSED,
    TWICE,
    message_faults,
    replaced_by,
    sent_late,
)
from eurobot_od.robot.messages import (
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
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.values import Barriers, GotoFault, Obstacle, Passage, Source, TeamColour

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


def _once_standing(drive: Drive, action: Callable[[], object]) -> None:
    """Do something as soon as the drive does not move."""
    if drive.moving:
        drive.at(drive.now + GLANCE, lambda _: _once_standing(drive, action))
    else:
        action()


def _begin(drive: Drive, goto: GotoXY) -> None:
    """Begin a goto without confirming it."""
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


def _later(time: Any) -> Any:
    return time + JUMP if _under_way(time) else time


def _while_driving(drive: Drive, goto: GotoXY, healthy: Any) -> None:
    """Confirm a goto and go on with the one before."""
    if drive.moving:
        drive.offer(GotoConfirm())
    else:
        healthy(goto)


def _resumed(drive: Drive, stop: StopDrive, healthy: Any) -> None:
    """Stop, and go on after two seconds."""
    goto = drive.goto
    healthy(stop)
    if goto is not None:
        drive.at(drive.now + 2, lambda _: _begin(drive, goto))


def _not_held(drive: Drive, shutdown: EmergencyShutdown, healthy: Any) -> None:
    healthy(shutdown)
    drive.safe = False


def _held_for_ever(drive: Drive, configuration: StartConfigurationSet, healthy: Any) -> None:
    safe = drive.safe
    healthy(configuration)
    drive.safe = safe


def _only_first(drive: Drive, configuration: StartConfigurationSet, healthy: Any) -> None:
    if drive.configuration is None:
        healthy(configuration)
    else:
        drive.offer(StartConfigurationConfirm())


def _in_centimetres(position: KalmanPositionResponse) -> KalmanPositionResponse:
    if position.x is None or position.y is None:
        return position
    return position._replace(x=position.x // 10, y=position.y // 10)


def _swapped(flags: int) -> int:
    """Exchange the two bits of each barrier."""
    return (flags & 0x5555) << 1 | (flags & 0xAAAA) >> 1


def _without(flags: Barriers, passage: Passage, instead: Passage) -> Barriers:
    return Barriers.of({n: instead if p is passage else p for n, p in flags.set_barriers()})


FAULTS = (
    *message_faults(
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
    *message_faults(
        "emergency",
        ("emergency-stop-ignored", DRIVES_ON, EmergencyStop, "4.2.2 Obstacle: the goto is dropped at once"),
        ("shutdown-ignored", DRIVES_ON, EmergencyShutdown, "4.2.2 Emergency mushroom: the goto is dropped"),
    ),
    # Goto (document 2.1)
    Fault(
        "goto-confirmed-on-arrival",
        "takes Goto Confirm for the arrival",
        handling(GotoXY, _confirmed_on_arrival),
        Caught("drive", "2.1 Goto ACK: a goto is confirmed"),
    ),
    Fault(
        "goto-confirmed-not-driven",
        "confirms a goto and stays where it is",
        handling(GotoXY, lambda drive, *_: drive.offer(GotoConfirm())),
        Caught("drive", "2.1 State Response: a goto has a remaining time"),
    ),
    Fault(
        "goto-not-replaced",
        "confirms a new goto but goes on with the one before",
        handling(GotoXY, _while_driving),
        Caught("drive", "2.1 Goto: the goto before is dropped"),
    ),
    Fault(
        "goto-queued",
        "drives to the first goto's place before it takes the second one",
        handling(GotoXY, _queued),
        Caught("drive", "2.1 Goto: the goto before is dropped"),
    ),
    Fault(
        "goto-place-swapped",
        "takes x for y and y for x",
        arriving(GotoXY, meaning(lambda goto: goto._replace(x=min(goto.y, 3000), y=min(goto.x, 2000)))),
        Caught("drive", "2.1 Goto: the place is reached"),
    ),
    Fault(
        "goto-x-one-bit-off",
        "reads x one bit too low, so that it is halved",
        arriving(GotoXY, raw(x=lambda x: x >> 1)),
        Caught("drive", "2.1 Goto: the place is reached"),
    ),
    Fault(
        "goto-angle-ignored",
        "arrives looking wherever it came from",
        arriving(GotoXY, field("angle", lambda _: 0)),
        Caught("drive", "1 and 2.1 Goto: the angle is reached, counted counter-clockwise"),
    ),
    Fault(
        "goto-angle-clockwise",
        "takes the angle of a goto for clockwise",
        arriving(GotoXY, field("angle", lambda angle: -angle)),
        Caught("drive", "1 and 2.1 Goto: the angle is reached, counted counter-clockwise"),
    ),
    Fault(
        "goto-speed-ignored",
        "drives at full speed whatever the goto says",
        arriving(GotoXY, field("speed", lambda _: 100)),
        Caught("drive", "Table 1 Goto: a third of the speed takes longer"),
    ),
    Fault(
        "goto-30-mm-too-far",
        "drives to a place 30 mm off the one it is told",
        arriving(GotoXY, raw(x=lambda x: x + 30)),
        Caught("drive", "2.1 Goto: the place is reached"),
    ),
    Fault(
        "forced-barrier-ignored",
        "takes forced barriers for no barriers",
        arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.FORCED, Passage.FREE))),
        Caught("barriers", "2.1 Barriers: no way past a forced barrier"),
    ),
    Fault(
        "forced-barrier-as-normal",
        "passes a forced barrier if there is no other way",
        arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.FORCED, Passage.NORMAL))),
        Caught("barriers", "2.1 Barriers: no way past a forced barrier"),
    ),
    Fault(
        "normal-barrier-ignored",
        "takes normal barriers for no barriers",
        arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.NORMAL, Passage.FREE))),
        Caught("barriers", "2.1 Barriers: a way round a normal barrier takes longer"),
    ),
    Fault(
        "normal-barrier-as-forced",
        "does not drive to a place that only a normal barrier is on",
        arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.NORMAL, Passage.FORCED))),
        Caught("barriers", "2.1 Barriers: a normal barrier is passed if need be"),
    ),
    Fault(
        "barrier-bits-swapped",
        "exchanges the two bits of each barrier",
        arriving(GotoXY, field("barriers", lambda flags: Barriers(_swapped(flags)))),
        Caught("barriers", "2.1 Barriers: no way past a forced barrier"),
    ),
    Fault(
        "barriers-in-reverse-order",
        "counts the barriers from the other end of the flags",
        arriving(GotoXY, field("barriers", lambda f: Barriers(int(f"{_swapped(f):016b}"[::-1], 2)))),
        Caught("barriers", "2.1 Barriers: no way past a forced barrier"),
    ),
    Fault(
        "barriers-demanded",
        "refuses a goto that leaves out the optional barriers",
        arriving(GotoXY, only(lambda data: len(data) != WITHOUT_BARRIERS)),
        Caught("bytes", "Table 1 Goto: barriers are optional"),
    ),
    Fault(
        "half-of-barriers-taken",
        "takes a goto with half of the barriers",
        arriving(GotoXY, data(lambda data: data.ljust(8, b"\0") if len(data) > WITHOUT_BARRIERS else data)),
        Caught("bytes", "Table 1 Goto: half of the barriers is refused"),
    ),
    Fault(
        "places-outside-taken",
        "drives to the edge when it is sent beyond it",
        arriving(GotoXY, raw(x=lambda x: min(x, 3000), y=lambda y: min(y, 2000))),
        Caught("bytes", "Table 1 Goto: x = 4000 is refused"),
    ),
    Fault(
        "angle-360-taken",
        "takes 360 degrees for 0",
        arriving(GotoXY, raw(angle=lambda angle: angle % 360)),
        Caught("bytes", "Table 1 Goto: an angle of 360 degrees is refused"),
    ),
    Fault(
        "speed-above-100-taken",
        "takes 101 percent for 100",
        arriving(GotoXY, raw(speed=lambda speed: min(speed, 100))),
        Caught("bytes", "Table 1 Goto: a speed of 101 percent is refused"),
    ),
    Fault(
        "three-enemies-taken",
        "takes three enemies for two",
        arriving(StartConfigurationSet, raw(enemies=lambda enemies: min(enemies, 2))),
        Caught("bytes", "Table 3: three enemies are refused"),
    ),
    # Stops (document 2.1, 4.2.2)
    Fault(
        "stop-on-arrival",
        "heeds Stop Drive only when it has arrived",
        handling(StopDrive, lambda drive, stop, healthy: _once_standing(drive, lambda: healthy(stop))),
        Caught("drive", "2.1 Stop: the goto is dropped"),
    ),
    Fault(
        "goto-resumed-after-stop",
        "stops for two seconds and goes on with the goto",
        handling(StopDrive, _resumed),
        Caught("drive", "2.1 Stop: the robot stays where it stopped"),
    ),
    Fault(
        "brakes-do-not-hold",
        "takes ten times as long to stop as it should",
        preset("Motion.Braking", 60),
        Caught("drive", "2.1 Stop: the robot stands after a second"),
    ),
    Fault(
        "emergency-stop-late",
        "is busy for 800 ms before it looks at an Emergency Stop",
        handling(EmergencyStop, lambda drive, stop, healthy: drive.at(drive.now + 0.8, lambda _: healthy(stop))),
        Caught("emergency", "4.2.2 Obstacle: the goto is dropped at once"),
    ),
    Fault(
        "emergency-stop-for-things-ignored",
        "stops for enemies but not for things",
        handling(EmergencyStop, lambda _, stop, healthy: healthy(stop) if stop.obstacle is Obstacle.ENEMY else None),
        Caught("emergency", "4.2.2 Obstacle: a thing stops the drive as well"),
    ),
    Fault(
        "unknown-obstacle-ignored",
        "drives on when it does not know the obstacle that it is stopped for",
        arriving(EmergencyStop, only(lambda data: data[:1] in (b"\0", b"\1"))),
        Caught("bytes", "Table 1 Extended Stop: an obstacle nobody knows stops as well"),
    ),
    Fault(
        "obstacle-reason-lost",
        "forgets whether it was stopped for an enemy or a thing",
        arriving(EmergencyStop, field("obstacle", lambda _: Obstacle.OBJECT)),
        Caught("canopen", "2.1 Extended Stop: the reason is kept"),
    ),
    Fault(
        "shutdown-not-held",
        "accepts the next goto after an Emergency Shutdown",
        handling(EmergencyShutdown, _not_held),
        Caught("emergency", "4.2.2 Emergency mushroom: no goto is confirmed"),
    ),
    Fault(
        "shutdown-held-for-ever",
        "stays in its safe state after a new start configuration",
        handling(StartConfigurationSet, _held_for_ever),
        Caught("emergency", "4.2.2 Emergency mushroom: a new start configuration ends it"),
    ),
    Fault(
        "mute-after-shutdown",
        "answers no node check after an Emergency Shutdown",
        handling(CheckDriveRequest, lambda drive, request, healthy: None if drive.safe else healthy(request)),
        Caught("emergency", "4.2.2 Emergency mushroom: the drive still answers node checks"),
    ),
    # State (document 2.1, Table 1)
    Fault(
        "state-unasked",
        "sends Goto State Response by itself every 50 ms",
        every(0.05, lambda drive: drive.offer(GotoStateResponse(drive.remaining()))),
        Caught("drive", "2.1 State Request: no answer without a request"),
    ),
    Fault(
        "state-short",
        "sends a remaining time of 16 bits instead of 24",
        leaving(GotoStateResponse, data(lambda data: data[:2])),
        Caught("drive", STATE_UNKNOWN),
    ),
    Fault(
        "state-long",
        "sends a remaining time of 32 bits instead of 24",
        leaving(GotoStateResponse, data(lambda data: data + b"\x01")),
        Caught("drive", STATE_UNKNOWN),
    ),
    Fault(
        "time-unknown-as-zero",
        "says 0 where the remaining time is unknown",
        leaving(GotoStateResponse, meaning(lambda state: GotoStateResponse(state.time or 0))),
        Caught("drive", STATE_UNKNOWN),
    ),
    Fault(
        "time-in-hundredths",
        "counts the remaining time in hundredths of a second",
        leaving(
            GotoStateResponse, meaning(lambda s: GotoStateResponse(s.time // 10 if _under_way(s.time) else s.time))
        ),
        Caught("drive", "Table 1 State Response: 1 bit is 1 ms"),
    ),
    Fault(
        "time-never-falls",
        "says the same remaining time until it arrives",
        leaving(GotoStateResponse, field("time", lambda time: 5000 if _under_way(time) else time)),
        Caught("drive", "2.1 State Response: the time falls"),
    ),
    Fault(
        "time-jumps",
        "says a remaining time that goes up and down",
        numbered(GotoStateResponse, lambda number: kept if number % 2 else field("time", _later)),
        Caught("drive", "2.1 State Response: the time goes on falling"),
    ),
    Fault(
        "arrival-not-said",
        "says 1 ms when it has arrived",
        leaving(GotoStateResponse, field("time", lambda time: time or 1)),
        Caught("drive", "2.1 State Response: 0 when the place is reached"),
    ),
    Fault(
        "arrival-said-at-once",
        "says that it has arrived as soon as it has a goto",
        leaving(GotoStateResponse, field("time", lambda time: 0 if _under_way(time) else time)),
        Caught("drive", "2.1 State Response: a goto has a remaining time"),
    ),
    Fault(
        "impossible-as-unknown",
        "says that the time is unknown when there is no way",
        leaving(GotoStateResponse, meaning(lambda s: s._replace(time=None) if isinstance(s.time, GotoFault) else s)),
        Caught("barriers", "2.1 Barriers: no way past a forced barrier"),
    ),
    # Filtered position (document 2.2, 4.2.2)
    Fault(
        "position-swapped",
        "sends x as y and y as x",
        leaving(KalmanPositionResponse, exchanged("x", "y")),
        Caught("drive", "2.3 Start Configuration Set: the robot is at its team's start place"),
    ),
    Fault(
        "position-in-centimetres",
        "sends its position in centimetres",
        leaving(KalmanPositionResponse, meaning(_in_centimetres)),
        Caught("drive", "2.3 Start Configuration Set: the robot is at its team's start place"),
    ),
    Fault(
        "position-y-one-bit-off",
        "sends y one bit too low, so that it is halved",
        leaving(KalmanPositionResponse, field("y", lambda y: y >> 1)),
        Caught("drive", "2.3 Start Configuration Set: the robot is at its team's start place"),
    ),
    Fault(
        "position-angle-clockwise",
        "sends its angle clockwise",
        leaving(KalmanPositionResponse, field("angle", lambda angle: -angle)),
        Caught("drive", "1 and 2.1 Goto: the angle is reached, counted counter-clockwise"),
    ),
    Fault(
        "position-source-wrong",
        "says that its position comes from the confederate",
        leaving(KalmanPositionResponse, field("source", lambda _: Source.CONFEDERATE)),
        Caught("drive", f"{LOCATION}: the source is our robot itself"),
    ),
    Fault(
        "position-unknown-as-zero",
        "says 0, 0 before it knows where it is",
        leaving(KalmanPositionResponse, meaning(lambda p: p if p.x is not None else p._replace(x=0, y=0, angle=0))),
        Caught("drive", POSITION_UNKNOWN),
    ),
    Fault(
        "position-frozen",
        "goes on saying the first position since the start configuration",
        frozen(KalmanPositionResponse, StartConfigurationSet),
        Caught("drive", "2.1 Goto: the place is reached"),
    ),
    Fault(
        "navigation-ignored",
        "takes no navigation position into its estimate",
        arriving(NaviPositionResponse, lost),
        Caught("drive", "4.2.2 Navigation: the drive takes the position into its estimate"),
    ),
    Fault(
        "unknown-navigation-taken",
        "takes an unknown navigation position for the place 255, 255",
        arriving(NaviPositionResponse, meaning(lambda p: p if p.x is not None else p._replace(x=255, y=255, angle=0))),
        Caught("drive", "Table 2: an unknown position changes nothing"),
    ),
    # Node check and start configuration (document 2.3)
    Fault(
        "check-needs-configuration",
        "answers node checks only after the start configuration, so that the startup blocks",
        handling(CheckDriveRequest, lambda drive, request, healthy: healthy(request) if drive.configuration else None),
        Caught("drive", DRIVE_THERE),
    ),
    Fault(
        "drive-configuration-not-applied",
        "confirms the start configuration and forgets it",
        handling(StartConfigurationSet, lambda drive, *_: drive.offer(StartConfigurationConfirm())),
        Caught("drive", "2.3 Start Configuration Set: the robot is at its team's start place"),
    ),
    Fault(
        "team-colours-swapped",
        "takes red for yellow and yellow for red",
        arriving(StartConfigurationSet, field("team_colour", lambda colour: TeamColour(1 - colour))),
        Caught("drive", "2.3 Start Configuration Set: the robot is at its team's start place"),
    ),
    Fault(
        "team-colour-ignored",
        "starts upper left whatever the team colour",
        arriving(StartConfigurationSet, field("team_colour", lambda _: TeamColour.RED)),
        Caught("drive", "2.3 Start Configuration Set: yellow starts upper right"),
    ),
    Fault(
        "configuration-once",
        "takes the first start configuration, and confirms later ones without taking them",
        handling(StartConfigurationSet, _only_first),
        Caught("drive", "2.3 Start Configuration Set: yellow starts upper right"),
    ),
)
