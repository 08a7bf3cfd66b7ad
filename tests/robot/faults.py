"""Faults of the robot's nodes that prove the shipped suites: wrong fields, places, times, and what is not acted on.

Those that help whoever tests a strategy or a node are in `eurobot_od.robot.faults`; `PLUGINS` has both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, partial
from typing import Any, ClassVar

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import Caught, FrameChange, Mixin, Wrong, leaving, words
from eurobot_od.device.node import Node
from eurobot_od.device.timers import Call
from eurobot_od.errors import FieldError, FrameLengthError, Refused
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.plugin import Faults, Plugins
from eurobot_od.robot import faults as shipped
from eurobot_od.robot.faults import (
    CONFIGURATION,
    GOTO,
    LOCATION,
    NODE_CHECK,
    OUR_PLACE,
    POSITION_UNKNOWN,
    STATE_UNKNOWN,
    message_faults,
)
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    Enemy2PositionResponse,
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
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Barriers, GotoFault, Obstacle, Passage, RobotError, Source, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.estimate import Estimate
from eurobot_od.robot.nodes.node import Objects
from eurobot_od.robot.plugin import ROBOT
from eurobot_od.robot.protocol import EurobotProtocol

WITHOUT_BARRIERS = 6
"""Bytes of a Goto XY that ends after the speed."""

JUMP = 7000
"""By how many ms a time jumps."""

GLANCE = 0.01
"""Time between two checks whether the drive stands, in s."""

SCATTER = 150
"""How far a bad beacon is off, mm."""

DRIVE_THERE = f"{NODE_CHECK}: the drive is there"
ANGLE_REACHED = "1 and 2.1 Goto: the angle is reached, counted counter-clockwise"
START_PLACE = "2.3 Start Configuration Set: the robot is at its team's start place"
"""Steps that find several faults: the first ones that look at an answer, at an angle, and at a place."""

UNREADABLE = (FrameLengthError, FieldError)
"""What a frame with a wrong length, or a message with a value out of range, raises: such a frame stays as it is."""


# Hooks, besides those of any device


def frozen(which: type[Message], anew: type[Message]) -> Mixin:
    """Return a node that sends its first frame again and again, until a message comes that starts all over."""

    def again(node: Node, frame: Frame) -> Iterable[Frame]:
        """Send the first frame again and again, until a message comes that restarts the node."""
        return [vars(node).setdefault("first", frame)]

    def forget(node: Node, message: Message, healthy: Callable[[Message], None]) -> None:
        vars(node).pop("first", None)
        healthy(message)

    return both(hooks.handling(anew, forget), hooks.leaving(which, again))


def both(one: Mixin, other: Mixin) -> Mixin:
    """Combine two faults."""
    return type("Both", (one, other), {})


def meaning(change: Callable[[Any], Any]) -> FrameChange:
    """Change what a frame says: `change` gets its message and returns another one."""

    def changed(node: Node, frame: Frame) -> Iterable[Frame]:
        protocol = node.device.protocol
        try:
            return [protocol.encode(change(protocol.decode(*frame)))]
        except UNREADABLE:
            return [frame]

    return changed


def field(name: str, change: Callable[[Any], Any]) -> FrameChange:
    """Change one field of a message unless it is unknown."""

    def changed(message: Any) -> Any:
        value = getattr(message, name)
        # There is nothing to calculate with; who wants an unknown position wrong takes `unknown_as`.
        return message if value is None else message._replace(**{name: change(value)})

    return meaning(changed)


def unknown_as(coordinate: int) -> FrameChange:
    """Change an unknown position to a known one, x and y the same, at 0 degrees."""
    return meaning(lambda place: place if place.x is not None else place._replace(x=coordinate, y=coordinate, angle=0))


def _unknown_as_255(drive: Drive, position: Any, healthy: Callable[[Any], None]) -> None:
    if position.x is None:
        # As a drive without a filter: ours does not believe a place so far from its own.
        drive.estimate = Estimate(drive.tuning, Pose(255, 255, 0))
    else:
        healthy(position)


def exchanged(one: str, other: str) -> FrameChange:
    """Exchange the raw values of two fields; what grows too wide is cut."""
    return _raw_values(lambda values: {one: values[other], other: values[one]})


def raw(**changes: Callable[[int], int]) -> FrameChange:
    """Change raw values of a message's fields, whatever they mean; what grows too wide is cut."""
    return _raw_values(lambda values: {name: change(values[name]) for name, change in changes.items()})


def _raw_values(change: Callable[[dict[str, int]], dict[str, int]]) -> FrameChange:
    def changed(node: Node, frame: Frame) -> Iterable[Frame]:
        binding = node.device.protocol.binding_of(frame.cob_id)
        try:
            values = binding.unpack(frame.data)
        except UNREADABLE:
            return [frame]
        widths = binding.layout.widths
        # Cut as a firmware does that masks and shifts; a wider value would reach into the next field's bits.
        cut = {name: value & (1 << widths[name]) - 1 for name, value in change(values).items()}
        return [Frame(frame.cob_id, binding.pack(values | cut))]

    return changed


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


# The core


class ShutdownForgotten(Core):
    """Drives on after an Emergency Shutdown."""

    def goto(self, *place: Any, **how: Any) -> Call[GotoReport]:
        """Send the drive to a place whatever has been."""
        self._stops.shut_down = False
        return super().goto(*place, **how)


class SourceUnseen(Core):
    """Takes every position for that of the robot it asked for."""

    def doubt(self, message: Message) -> int | None:
        code = super().doubt(message)
        return None if code == RobotError.WRONG_SOURCE else code


def _ask_on(core: Core, stop: Frame) -> Iterable[Frame]:
    """Send a stop, and keep asking for the state of the goto."""
    for count in range(1, 15):
        core.at(core.now + count * 0.1, lambda _: core.offer(GotoStateRequest()))
    return [stop]


CORE = {
    "check-asked-once": Caught("core", "5.1 Startup: a node that does not answer is asked again").fault(
        "asks for the drive once and gives up", hooks.preset("Node check.Check attempts", 1)
    ),
    "checks-not-awaited": Caught("core", "5.1 Startup: a node that does not answer blocks the startup").fault(
        "goes on with the startup without the nodes' answers",
        both(
            hooks.leaving(CheckDriveRequest, hooks.unawaited(CheckDriveResponse())),
            hooks.leaving(CheckNaviRequest, hooks.unawaited(CheckNaviResponse())),
        ),
    ),
    "navigation-not-checked": Caught("core", "2.3 Node Check Request: the navigation").fault(
        "configures the start when the drive has answered",
        both(
            hooks.leaving(CheckNaviRequest, hooks.lost),
            hooks.leaving(CheckNaviRequest, hooks.unawaited(CheckNaviResponse())),
        ),
    ),
    "configuration-confirm-unheard": Caught("core", "2.3 Start Configuration Confirm: confirmed once is enough").fault(
        "sends the start configuration on and on, confirmed or not",
        hooks.arriving(StartConfigurationConfirm, hooks.lost),
    ),
    "configuration-diameters-mixed-up": Caught("core", CONFIGURATION).fault(
        "sends enemy 1's diameter as enemy 2's",
        hooks.leaving(StartConfigurationSet, exchanged("enemy_1_diameter", "enemy_2_diameter")),
    ),
    "configuration-diameter-in-millimetres": Caught("core", CONFIGURATION).fault(
        "sends the enemies' diameters in millimetres, as far as they fit",
        hooks.leaving(StartConfigurationSet, raw(enemy_1_diameter=lambda d: d * 10, enemy_2_diameter=lambda d: d * 10)),
    ),
    "configuration-colour-wrong": Caught("core", CONFIGURATION).fault(
        "sends yellow for red", hooks.leaving(StartConfigurationSet, raw(team_colour=lambda colour: 1 - colour))
    ),
    # Position polling (document 2.2, 4.2.2, 5.2)
    "absent-enemy-polled": Caught(
        "core", "2.3 Start Configuration Set: nobody asks for an enemy that is not there"
    ).fault(
        "asks for an enemy that the start configuration does not have",
        # The core's programme in a check never has an enemy 2.
        hooks.every(0.6, lambda core: core.offer(Enemy2PositionRequest()) if core.configuration else None),
    ),
    "polling-before-configuration": Caught("core", "5.1 Startup: no positions before the start configuration").fault(
        "asks for positions from the beginning on", hooks.every(0.3, lambda core: core.offer(KalmanPositionRequest()))
    ),
    # Goto (document 2.1)
    "goto-sent-swapped": Caught("core", GOTO).fault(
        "sends x as y and y as x", hooks.leaving(GotoXY, exchanged("x", "y"))
    ),
    "goto-sent-clockwise": Caught("core", GOTO).fault(
        "sends the angle of a goto clockwise", hooks.leaving(GotoXY, field("angle", lambda angle: -angle))
    ),
    "goto-speed-as-byte": Caught("core", GOTO).fault(
        "sends a speed of 255 for 100 percent", hooks.leaving(GotoXY, raw(speed=lambda speed: speed * 255 // 100))
    ),
    "goto-barriers-one-off": Caught("core", GOTO).fault(
        "numbers the barriers from 0 instead of 1",
        hooks.leaving(GotoXY, field("barriers", lambda flags: Barriers(flags << 2 & 0xFFFF))),
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
        hooks.arriving(GotoStateResponse, meaning(lambda _: GotoStateResponse(0))),
    ),
    "unknown-time-as-arrival": Caught("core", "Table 1 State Response: an unknown time is not an arrival").fault(
        "takes an unknown remaining time for the arrival",
        hooks.arriving(GotoStateResponse, meaning(lambda state: GotoStateResponse(state.time or 0))),
    ),
    "arrival-unheard": Caught("core", "2.1 State Response: 0 is believed when the drive is at the place").fault(
        "goes on asking after the drive has arrived",
        hooks.arriving(GotoStateResponse, field("time", lambda time: time or 1)),
    ),
    "impossible-unheard": Caught("core", "2.1 State Response: a goto that is not possible ends (2014 robot)").fault(
        "goes on asking when the drive says that a goto is not possible",
        hooks.arriving(GotoStateResponse, field("time", lambda time: None if isinstance(time, GotoFault) else time)),
    ),
    # Stops (document 2.1, 4.2.2)
    "obstacle-reason-wrong": Caught("core", "4.2.2 Obstacle: Emergency Stop for an enemy").fault(
        "says that every obstacle is a thing",
        hooks.leaving(EmergencyStop, field("obstacle", lambda _: Obstacle.OBJECT)),
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
}


# The drive


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


LATER = field("time", lambda time: time + JUMP if _under_way(time) else time)
"""Add JUMP to the time that is left, while the robot drives."""


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
    return meaning(lambda goto: goto._replace(x=min(goto.y, x), y=min(goto.x, y)))(node, frame)


def _place_at_the_edge(node: Node, frame: Frame) -> Iterable[Frame]:
    limits = node.device.protocol.binding_of(frame.cob_id).limits
    return raw(x=partial(min, limits["x"].high), y=partial(min, limits["y"].high))(node, frame)


def _without(flags: Barriers, passage: Passage, instead: Passage) -> Barriers:
    return Barriers.of({n: instead if p is passage else p for n, p in flags.set_barriers()})


DRIVE = {
    **message_faults(
        "drive",
        ("drive-check-answered-for-navigation", replaced_by(CheckNaviResponse()), CheckDriveResponse, DRIVE_THERE),
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
        "reads x one bit too low, so that it is halved", hooks.arriving(GotoXY, raw(x=lambda x: x >> 1))
    ),
    "goto-angle-ignored": Caught("drive", ANGLE_REACHED).fault(
        "arrives looking wherever it came from", hooks.arriving(GotoXY, field("angle", lambda _: 0))
    ),
    "goto-angle-clockwise": Caught("drive", ANGLE_REACHED).fault(
        "takes the angle of a goto for clockwise", hooks.arriving(GotoXY, field("angle", lambda angle: -angle))
    ),
    "goto-speed-ignored": Caught("drive", "Table 1 Goto: a third of the speed takes longer").fault(
        "drives at full speed whatever the goto says", hooks.arriving(GotoXY, field("speed", lambda _: 100))
    ),
    "goto-30-mm-too-far": Caught("drive", "2.1 Goto: the place is reached").fault(
        "drives to a place 30 mm off the one in the goto", hooks.arriving(GotoXY, raw(x=lambda x: x + 30))
    ),
    "forced-barrier-ignored": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "takes forced barriers for no barriers",
        hooks.arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.FORCED, Passage.FREE))),
    ),
    "forced-barrier-as-normal": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "passes a forced barrier if there is no other way",
        hooks.arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.FORCED, Passage.NORMAL))),
    ),
    "normal-barrier-ignored": Caught("barriers", "2.1 Barriers: a way round a normal barrier takes longer").fault(
        "takes normal barriers for no barriers",
        hooks.arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.NORMAL, Passage.FREE))),
    ),
    "normal-barrier-as-forced": Caught("barriers", "2.1 Barriers: a normal barrier is passed if need be").fault(
        "does not drive to a place that only a normal barrier is on",
        hooks.arriving(GotoXY, field("barriers", lambda flags: _without(flags, Passage.NORMAL, Passage.FORCED))),
    ),
    "barrier-bits-swapped": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "exchanges the two bits of each barrier",
        hooks.arriving(GotoXY, field("barriers", lambda flags: Barriers(_swapped(flags)))),
    ),
    "barriers-in-reverse-order": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "counts the barriers from the other end of the flags",
        hooks.arriving(GotoXY, field("barriers", lambda f: Barriers(int(f"{_swapped(f):016b}"[::-1], 2)))),
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
        "takes 360 degrees for 0", hooks.arriving(GotoXY, raw(angle=lambda angle: angle % 360))
    ),
    "speed-above-100-taken": Caught("bytes", "Table 1 Goto: a speed of 101 percent is refused").fault(
        "takes 101 percent for 100", hooks.arriving(GotoXY, raw(speed=lambda speed: min(speed, 100)))
    ),
    "three-enemies-taken": Caught("bytes", "Table 3: three enemies are refused").fault(
        "takes three enemies for two",
        hooks.arriving(StartConfigurationSet, raw(enemies=lambda enemies: min(enemies, 2))),
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
        hooks.arriving(EmergencyStop, field("obstacle", lambda _: Obstacle.OBJECT)),
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
        hooks.arriving(GotoXY, field("speed", lambda speed: speed or 1)),
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
        hooks.leaving(GotoStateResponse, meaning(lambda state: GotoStateResponse(state.time or 0))),
    ),
    "time-in-hundredths": Caught("drive", "Table 1 State Response: 1 bit is 1 ms").fault(
        "counts the remaining time in hundredths of a second",
        hooks.leaving(
            GotoStateResponse,
            meaning(lambda s: GotoStateResponse(s.time // 10 if _under_way(s.time) else s.time)),
        ),
    ),
    "time-never-falls": Caught("drive", "2.1 State Response: the time falls").fault(
        "says the same remaining time until it arrives",
        hooks.leaving(GotoStateResponse, field("time", lambda time: 5000 if _under_way(time) else time)),
    ),
    "time-jumps": Caught("drive", "2.1 State Response: the time goes on falling").fault(
        "says a remaining time that goes up and down",
        hooks.numbered(
            GotoStateResponse,
            lambda number: hooks.kept if number % 2 else LATER,
        ),
    ),
    "arrival-not-said": Caught("drive", "2.1 State Response: 0 when the place is reached").fault(
        "says 1 ms when it has arrived", hooks.leaving(GotoStateResponse, field("time", lambda time: time or 1))
    ),
    "arrival-said-at-once": Caught("drive", "2.1 State Response: a goto has a remaining time").fault(
        "says that it has arrived as soon as it has a goto",
        hooks.leaving(GotoStateResponse, field("time", lambda time: 0 if _under_way(time) else time)),
    ),
    "impossible-as-unknown": Caught("barriers", "2.1 Barriers: no way past a forced barrier").fault(
        "says that the time is unknown when there is no way",
        hooks.leaving(
            GotoStateResponse, meaning(lambda s: s._replace(time=None) if isinstance(s.time, GotoFault) else s)
        ),
    ),
    # Filtered position (document 2.2, 4.2.2)
    "position-swapped": Caught("drive", START_PLACE).fault(
        "sends x as y and y as x", hooks.leaving(KalmanPositionResponse, exchanged("x", "y"))
    ),
    "position-in-centimetres": Caught("drive", START_PLACE).fault(
        "sends its position in centimetres",
        # Not when it is unknown: other steps look at that.
        hooks.leaving(
            KalmanPositionResponse,
            meaning(lambda p: p if p.x is None else p._replace(x=p.x // 10, y=p.y // 10)),
        ),
    ),
    "position-y-one-bit-off": Caught("drive", START_PLACE).fault(
        "sends y one bit too low, so that it is halved",
        hooks.leaving(KalmanPositionResponse, field("y", lambda y: y >> 1)),
    ),
    "position-angle-clockwise": Caught("drive", ANGLE_REACHED).fault(
        "sends its angle clockwise", hooks.leaving(KalmanPositionResponse, field("angle", lambda angle: -angle))
    ),
    "position-source-wrong": Caught("drive", f"{LOCATION}: the source is our robot itself").fault(
        "says that its position comes from the confederate",
        hooks.leaving(KalmanPositionResponse, field("source", lambda _: Source.CONFEDERATE)),
    ),
    "position-unknown-as-zero": Caught("drive", POSITION_UNKNOWN).fault(
        "says 0, 0 before it knows where it is", hooks.leaving(KalmanPositionResponse, unknown_as(0))
    ),
    "position-frozen": Caught("drive", "2.1 Goto: the place is reached").fault(
        "goes on saying the first position since the start configuration",
        frozen(KalmanPositionResponse, StartConfigurationSet),
    ),
    "navigation-ignored": Caught("drive", "4.2.2 Navigation: the drive takes the position into its estimate").fault(
        "takes no navigation position into its estimate", hooks.arriving(NaviPositionResponse, hooks.lost)
    ),
    "unknown-navigation-taken": Caught("drive", "Table 2: an unknown position changes nothing").fault(
        "takes an unknown navigation position for the place 255, 255",
        hooks.handling(NaviPositionResponse, _unknown_as_255),
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
        hooks.arriving(StartConfigurationSet, field("team_colour", lambda colour: colour.other)),
    ),
    "team-colour-ignored": Caught("drive", "2.3 Start Configuration Set: yellow starts upper right").fault(
        "starts upper left whatever the team colour",
        hooks.arriving(StartConfigurationSet, field("team_colour", lambda _: TeamColour.RED)),
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


# The navigation


class NavigationTakesAnyStart(Navigation):
    """Takes any start configuration."""

    def check_configuration(self, configuration: StartConfigurationSet) -> None:
        """Find nothing wrong."""


NAVIGATION = {
    **message_faults(
        "navigation",
        (
            "navi-check-answered-for-drive",
            replaced_by(CheckDriveResponse()),
            CheckNaviResponse,
            f"{NODE_CHECK}: the navigation is there",
        ),
    ),
    "navi-swapped": Caught("navigation", OUR_PLACE).fault(
        "sends x as y and y as x", hooks.leaving(NaviPositionResponse, exchanged("x", "y"))
    ),
    "navi-in-centimetres": Caught("navigation", OUR_PLACE).fault(
        "sends our robot's place in centimetres",
        hooks.leaving(NaviPositionResponse, raw(x=lambda x: x // 10, y=lambda y: y // 10)),
    ),
    "navi-short": Caught("navigation", OUR_PLACE).fault(
        "sends our robot's place without the byte with the source",
        hooks.leaving(NaviPositionResponse, hooks.data(lambda data: data[:4])),
    ),
    "navi-angle-clockwise": Caught("flows", "1 Navigation: angles count counter-clockwise").fault(
        "sends our robot's angle clockwise",
        hooks.leaving(NaviPositionResponse, field("angle", lambda angle: -angle)),
    ),
    "navi-source-wrong": Caught("navigation", "Table 2: the source of our robot's place is our robot itself").fault(
        "says that our robot's place comes from enemy 1",
        hooks.leaving(NaviPositionResponse, field("source", lambda _: Source.ENEMY_1)),
    ),
    "navi-scattered": Caught("navigation", OUR_PLACE).fault(
        "measures our robot's place 150 mm off, here or there",
        # To either side, by the noise in the last bit: a single offset would only be a bias, and with a random
        # generator the frames would not follow from the match's seed alone.
        hooks.leaving(
            NaviPositionResponse,
            field("x", lambda x: x + (SCATTER if x % 2 else -SCATTER)),
        ),
    ),
    "navi-frozen": Caught("flows", "4.2.2 Navigation: the navigation follows our robot").fault(
        "goes on saying the first place that it saw", frozen(NaviPositionResponse, StartConfigurationSet)
    ),
    "enemy-source-wrong": Caught("navigation", "Table 2: the source of enemy 1's place is enemy 1").fault(
        "says that enemy 1's place is our robot's",
        hooks.leaving(Enemy1PositionResponse, field("source", lambda _: Source.INTERNAL)),
    ),
    "enemies-mixed-up": Caught("navigation", f"{LOCATION}: enemy 1").fault(
        "answers for enemy 1 under the identifier of enemy 2",
        hooks.handling(
            Enemy1PositionRequest,
            lambda navigation, request, _: navigation.offer(Enemy2PositionResponse(*navigation.answer_to(request))),
        ),
    ),
    "enemy-unknown-as-zero": Caught("navigation", "Table 2: an enemy that is not there is unknown").fault(
        "says 0, 0 for an enemy that is not there", hooks.leaving(Enemy2PositionResponse, unknown_as(0))
    ),
    "enemy-invented": Caught("navigation", "Table 2: an enemy that is not there is unknown").fault(
        "finds an enemy that the start configuration does not have",
        hooks.arriving(StartConfigurationSet, raw(enemies=lambda _: 2, confederates=lambda _: 1)),
    ),
    "enemy-angle-invented": Caught("navigation", "Table 2: an angle that is not measured is unknown").fault(
        "says 0 degrees for an enemy's angle, which it cannot measure",
        hooks.leaving(Enemy1PositionResponse, meaning(lambda p: p._replace(angle=0) if p.x is not None else p)),
    ),
    "navi-configuration-not-applied": Caught("navigation", "Table 2: an enemy that is not there is unknown").fault(
        "confirms the start configuration and forgets it",
        hooks.handling(StartConfigurationSet, lambda navigation, *_: navigation.offer(StartConfigurationConfirm())),
    ),
    "navi-contradictions-taken": Caught("navigation", "Table 3: no enemy, but a diameter, is reported by EMCY").fault(
        "takes a start configuration that contradicts itself", NavigationTakesAnyStart
    ),
    "navi-mute-after-shutdown": Caught(
        "navigation", "4.2.2 Emergency mushroom: the navigation still answers node checks"
    ).fault(
        "answers no node check after an Emergency Shutdown",
        hooks.handling(CheckNaviRequest, lambda node, request, healthy: None if node.safe else healthy(request)),
    ),
}


# All


def all_faults() -> Faults:
    """Return the faults of the robot's nodes, those of the package among them, by the class that can have them."""
    proving = {Core: CORE, Drive: DRIVE, Navigation: NAVIGATION}
    return {owner: {**rows, **proving.get(owner, {})} for owner, rows in shipped.FAULTS.items()}


PLUGINS = Plugins(ROBOT._replace(faults=all_faults))
