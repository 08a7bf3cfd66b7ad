"""The drive node: it moves the robot, one goto at a time of which the newest wins, and estimates the robot's pose.

The wheels move only during a motion, and a stop replaces any motion. One timer, `_control`, steps the motion; it is set
only while there is something to do. A message does not command the wheels directly: it replaces the motion, which the
next control step follows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, ClassVar

from eurobot_od.device.bound import Application, BoundObject, combined, period, scaled, seconds, setting
from eurobot_od.device.objects import Store
from eurobot_od.device.timers import Timer
from eurobot_od.errors import Cause, DictionaryError, Refused
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.meanings import NO_MEANING
from eurobot_od.od.values import Value
from eurobot_od.pdo.kinds import Message, OutOfRange
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import (
    Barriers,
    Direction,
    GotoFault,
    Obstacle,
    Passage,
    RobotError,
    Route,
    Source,
    TeamColour,
)
from eurobot_od.robot.nodes.estimate import Estimate, Tuning
from eurobot_od.robot.nodes.motion import (
    AT_REST,
    Braking,
    Chassis,
    Clearances,
    IdealChassis,
    Motion,
    MotionLimits,
    WheelCommand,
    find_route,
)
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.nodes.node import (
    DEVIATION,
    KEEP_PLACE,
    NO_MATCH,
    PLACE_AGE,
    START_STATE,
    TIME_LEFT,
    UNKNOWN,
    FollowingNode,
    Handlers,
    KeepPlace,
    Objects,
    StartState,
    age,
    milliseconds_until,
)

LATE = 0.1
"""Maximum delay of a control step that is caught up, in s; a busy computer may take this long."""

UNSURER = 10.0
"""Growth of the place's spread, in mm, after which the route is planned again; pauses of the navigation add less."""

HELD = 0.1
"""Time after which wheels that fall short are hindered, not just accelerating, in s."""

PUSHED_AWAY = 2.0
"""The reported remaining time rises by more than this, in s, or not at all; repeating the last millimetres takes less.
"""


class Drive(FollowingNode):
    """The drive node (document 2.1 to 2.3, 4.2.2).

    `goto` is the current or last goto, None after a stop. `stopped_by` is the last stop, with the obstacle as its
    reason. `safe` is True after an Emergency Shutdown until a new start configuration or NMT reset.

    Args:
        dictionary: the drive's EDS
        chassis: its wheels; default: ideal ones
        store: keeps the settings over a restart
        facts: the robot and its match; default: the file beside the EDS
    """

    limits = combined(
        MotionLimits,
        maximum_speed=setting("Motion.Maximum speed"),
        acceleration=setting("Motion.Acceleration"),
        braking=setting("Motion.Braking"),
        turn_rate=setting("Motion.Turn rate"),
        turn_acceleration=setting("Motion.Turn acceleration"),
        position_tolerance=setting("Arrival.Position tolerance"),
        angle_tolerance=setting("Arrival.Angle tolerance"),
    )
    control_period = period("Motion.Control period")
    blocked_time = seconds("Motion.Blocked time")
    robot_radius = setting("Body.Robot radius")
    safety_margin = setting("Body.Safety margin")
    position_margin = setting("Body.Position margin")
    tuning = combined(
        Tuning,
        navigation=scaled("Estimate.Navigation deviation", 1.0),
        navigation_angle=scaled("Estimate.Navigation angle deviation", 0.1),
        latency=scaled("Estimate.Navigation latency", 0.001),
        gate=scaled("Estimate.Gate", 0.001),
        placement=scaled("Estimate.Placement deviation", 1.0),
        placement_angle=scaled("Estimate.Placement angle deviation", 0.1),
        scale=scaled("Estimate.Scale deviation", 0.001),
        distance=scaled("Estimate.Distance deviation", 0.1),
        drift=scaled("Estimate.Drift deviation", 0.1),
        turning=scaled("Estimate.Turning deviation", 0.1),
    )
    largest_deviation = setting("Estimate.Largest deviation")
    keep_place = setting(KEEP_PLACE)

    def __init__(
        self,
        dictionary: Dictionary,
        chassis: Chassis | None = None,
        *,
        store: Store | None = None,
        facts: Facts | None = None,
    ) -> None:
        super().__init__(dictionary, store=store, facts=facts)
        self.chassis: Chassis = chassis or IdealChassis()
        size = self.facts.field.width, self.facts.field.height
        for side, length, limits in zip("XY", size, self.coordinates("Kalman position")):
            if length > limits.high:
                what = f"the robot's file has a field of {length:g} mm along {side}, positions end at {limits.high} mm"
                raise DictionaryError(self.device.dictionary.file, None, what)
        self._forget()

    def _forget(self) -> None:
        self.estimate = Estimate(self.tuning)
        self.goto: messages.GotoXY | None = None
        self.fault: GotoFault | None = None
        self.stopped_by: messages.StopMessage | None = None
        # Time in s for which the wheels were blocked, and for which they were hindered; spread at the last planning.
        self._stuck = self._held = self._planned = 0.0
        self._told = math.inf
        self._motion: Motion | Braking | None = None
        self._control: Timer | None = None
        self._match_end: float | None = None
        self._has_driven = False

    def _application(self, dictionary: Dictionary) -> Application:
        """Return the application's part of the objects; the core starts the match clock by a write."""
        told = {dictionary.address(TIME_LEFT): self._start_clock}
        return super()._application(dictionary)._replace(told=told)

    def _start_clock(self, time_left: Value) -> None:
        self._match_end = None
        if isinstance(time_left, int) and time_left != NO_MATCH:
            self._match_end = self.now + time_left / 1000

    def reset(self) -> None:
        """Stop at once and forget everything, as after power-on."""
        super().reset()
        self.chassis.advance(AT_REST, 0.0)
        self._forget()

    @property
    def obstacle(self) -> Obstacle | OutOfRange | None:
        """The obstacle of the last Emergency Stop; None if the last stop was another one."""
        return self.stopped_by.obstacle if isinstance(self.stopped_by, messages.EmergencyStop) else None

    @property
    def moving(self) -> bool:
        """Whether the wheels are commanded to move."""
        return self._control is not None

    # Goto

    def _accept(self, goto: messages.GotoXY) -> Message:
        """Accept a goto and drop the previous one (document 2.1). Raises Refused in the safe state."""
        if self.safe:
            raise Refused(Cause.STATE, "the safe state is held until a new start configuration")
        self.goto = goto
        self.stopped_by = None
        self._has_driven = True
        self._forget_obstruction()
        self._set_out(goto)
        return messages.GotoConfirm()

    def _set_out(self, goto: messages.GotoXY) -> None:
        """Plan the route of a goto and start it; the wheels may already be rolling."""
        self._planned = self.estimate.spread
        self._told = math.inf
        way = self._way(goto) if goto.speed else None  # at speed 0 no place is reached
        self.fault = None if way else GotoFault.NOT_POSSIBLE
        if way is None:
            self._brake()
        else:
            backward = goto.direction is Direction.BACKWARD
            self._move(Motion(self.limits, way, goto.angle, goto.speed, backward, self._rolling))

    def _way(self, goto: messages.GotoXY) -> tuple[Point, ...] | None:
        """Return the way points of a goto; None if the place is unreachable or our own place is unknown."""
        if self.estimate.pose is None or self._is_unsure():
            return None
        # A rolling robot brakes first, so the route begins where it comes to rest.
        start = self.limits.standing(self.estimate.pose, self._rolling).point
        goal = Point(goto.x, goto.y)
        if goto.route is Route.PLANNED:
            return find_route(start, goal, goto.barriers, self._clearances())
        # Without planning, the robot drives straight through normal barriers; forced ones still stop it.
        forced = {n: passage for n, passage in goto.barriers.set_barriers() if passage is Passage.FORCED}
        direct = find_route(start, goal, Barriers.of(forced), self._clearances())
        # Any other answer is a detour, which the goto excludes.
        return direct if direct == (goal,) else None

    def _clearances(self) -> Clearances:
        """Return the minimum distances: our radius, plus possible errors of place and motion."""
        deviations = self.estimate.deviations
        # The largest deviation of the place; the setting is in tenths of it.
        unsure = deviations.worst * self.position_margin / 10 if deviations else 0.0
        margin = self.safety_margin + self.limits.deviation + unsure
        return Clearances.of(self.facts, self.robot_radius, margin)

    def remaining(self) -> int | GotoFault | None:
        """Return the remaining time of a goto in ms: 0 arrived, None unknown or no goto, or a fault."""
        if self.fault is not None:
            return self.fault
        if not isinstance(self._motion, Motion) or self.estimate.pose is None:
            return None
        if self._motion.arrived:
            return 0
        seconds = self._motion.remaining(self.estimate.pose)
        if not math.isfinite(seconds):
            return None
        # A small correction must not raise the time; a robot that was pushed away needs much longer.
        self._told = seconds if seconds > self._told + PUSHED_AWAY else min(seconds, self._told)
        # Not 0, which means arrived, and below the codes.
        return min(max(round(self._told * 1000), 1), self._longest_time)

    @cached_property
    def _longest_time(self) -> int:
        """The longest remaining time that is not a code, in ms."""
        dictionary = self.device.dictionary
        said = dictionary.meanings.get(dictionary.address("Goto state.Time"), NO_MEANING)
        return said.plain.high if said.plain else 0

    def _state(self) -> messages.GotoStateResponse:
        return messages.GotoStateResponse(self.remaining())

    # Stops

    def _stop(self, stop: messages.StopMessage) -> None:
        """Brake and forget the goto; keep the reason of an Emergency Stop (document 2.1).

        If the drive is already stopped, a plain stop does not change the reason.
        """
        # The core repeats a stop with a Stop Drive, which must not replace the reason of an Emergency Stop.
        again = self.goto is None and self.stopped_by is not None and isinstance(stop, messages.StopDrive)
        self.goto = None
        self.fault = None
        self.stopped_by = self.stopped_by if again else stop
        self._forget_obstruction()
        self._brake()

    def shut_down(self, shutdown: messages.EmergencyShutdown) -> None:
        """Stop and enter the safe state (document 4.2.2 Emergency mushroom)."""
        self._stop(shutdown)
        super().shut_down(shutdown)

    def halted(self) -> None:
        """Brake when a master takes the node out of OPERATIONAL, where its state cannot be requested."""
        self._stop(messages.StopDrive())

    def heartbeat_lost(self, node_id: int) -> None:
        """Brake when the core's heartbeat is lost, as the core could not stop the robot; a new goto moves it again."""
        self._stop(messages.StopDrive())
        self._start_over_next()

    def booted(self, node_id: int) -> None:
        """Brake when the core has booted, as it has forgotten the goto."""
        self._stop(messages.StopDrive())
        self._start_over_next()

    # Motion

    @property
    def _rolling(self) -> WheelCommand:
        return self._motion.command if self._motion else AT_REST

    def _brake(self) -> None:
        self._move(Braking(self.limits, self._rolling))

    def _move(self, motion: Motion | Braking) -> None:
        self._motion = motion
        if self._control is None:
            self._control = self.at(self.now, self._step)

    def _step(self, now: float) -> None:
        """Do one control step: get the command of the motion, send it to the wheels, update the estimate."""
        motion = self._motion
        pose = self.estimate.pose
        dt = self.control_period
        command = AT_REST if motion is None else motion.step(pose or Pose(0, 0, 0), dt)
        # The estimate follows the odometry, not the command, as the wheels may be hindered.
        rolled = self.chassis.advance(command, dt)
        self.estimate.moved(rolled, now)
        self._held = self._held + dt if rolled.falls_short(command, dt) else 0.0
        # An obstacle may turn the robot without a trace in the odometry.
        if self._held >= HELD:
            self.estimate.bumped(now)
        if isinstance(motion, Motion):
            self._watch_wheels(rolled.follows(command, dt), dt)
            if self._is_unsure():
                self.fault = GotoFault.NOT_POSSIBLE
                self.raise_error(RobotError.PLACE_UNSURE, Estimate)
                self._brake()
            elif self.goto and not motion.arrived and self.estimate.spread > self._planned + UNSURER:
                self._set_out(self.goto)  # with a larger distance to forced barriers
        # If the wheels are blocked, the motion has been replaced by braking, and has not arrived.
        done = motion.arrived if isinstance(motion, Motion) else command == AT_REST
        # Short delays are caught up; the steps that a hanging node has missed are skipped.
        following = max(now, self.now - LATE) + dt
        self._control = None if done else self.at(following, self._step)

    def _watch_wheels(self, followed: bool, dt: float) -> None:
        """End the goto when the wheels have been blocked for the blocked time (2014 robot: blocked)."""
        self._stuck = 0.0 if followed else self._stuck + dt
        if self._stuck >= self.blocked_time:
            self.fault = GotoFault.BLOCKED
            self.raise_error(RobotError.DRIVE_BLOCKED, GotoFault.BLOCKED)
            self._brake()

    def _is_unsure(self) -> bool:
        """Return whether the place is too uncertain to drive; without the navigation, uncertainty grows."""
        return self.estimate.spread > self.largest_deviation

    def _forget_obstruction(self) -> None:
        self._stuck = 0.0
        self.clear_error(GotoFault.BLOCKED)

    # Position

    def _correct(self, position: messages.NaviPositionResponse) -> None:
        """Correct the estimate by a navigation position (document 4.2.2 Navigation)."""
        if position.x is None or position.y is None:
            return
        # Read for each position, so that a master's write takes effect at once.
        self.estimate.tuning = self.tuning
        self.estimate.corrected(Fix(position.x, position.y, position.angle), self.now)
        if not self._is_unsure():
            self.clear_error(Estimate)

    def _deviation(self, part: str, unit: float) -> int:
        """Return one of the estimate's standard deviations as the value of its object, in `unit` mm or degrees."""
        deviations = self.estimate.deviations
        return UNKNOWN if deviations is None else min(round(getattr(deviations, part) / unit), UNKNOWN - 1)

    def _position(self) -> messages.KalmanPositionResponse:
        pose = self.estimate.pose
        if pose is None:
            return messages.KalmanPositionResponse(None, None, None, Source.INTERNAL)
        limits = self.coordinates("Kalman position")
        # The estimate may be slightly outside the field, which Table 2 cannot express.
        x, y = (round(min(max(value, each.low), each.high)) for value, each in zip(pose.point, limits))
        return messages.KalmanPositionResponse(x, y, round(pose.angle) % 360, Source.INTERNAL)

    def configure(self, configuration: messages.StartConfigurationSet) -> Message:
        """Start over from the team's start place (document 2.3); raises Refused for a contradictory configuration.

        In a match, this only applies before the first goto, as the robot has left the place since. The core can change
        that by the object 0x210A: the place is kept outside of a match as well, or the robot was put back.
        """
        confirm = super().configure(configuration)
        self._stop(messages.StopDrive())
        # The stop was a part of configuring, and not a reason.
        self.stopped_by = None
        if not self._keeps_place() or self.estimate.pose is None:
            self.estimate = Estimate(self.tuning, self.facts.start(configuration.team_colour))
            self.clear_error(Estimate)
            self._has_driven = False
        self._start_over_next()
        return confirm

    def _keeps_place(self) -> bool:
        """Return whether the next start configuration keeps the known place."""
        if self.keep_place == KeepPlace.BY_MATCH:
            return self._has_driven and self._match_end is not None and self.now < self._match_end
        return self.keep_place == KeepPlace.KEEP

    def _start_over_next(self) -> None:
        # The core's request has been carried out, or the core is lost.
        self.device.objects.put(self.device.dictionary.address(KEEP_PLACE), KeepPlace.BY_MATCH)

    def _start_state(self) -> StartState:
        if self.safe:
            return StartState.SHUT_DOWN
        return StartState.UNCONFIGURED if self.configuration is None else StartState.CONFIGURED

    FACTS: ClassVar[Mapping[str, Callable[[Facts], float]]] = {
        "Body.Robot radius": lambda facts: math.ceil(facts.body.radius),
    }
    OBJECTS: ClassVar[Objects] = {
        "Goto XY": BoundObject(write=messages.GotoXY),
        "Emergency stop": BoundObject(write=messages.EmergencyStop),
        "Goto state": BoundObject(read=_state),
        "Navi position": BoundObject(write=messages.NaviPositionResponse),
        "Kalman position": BoundObject(read=_position),
        "Start configuration": BoundObject(
            read=lambda self: self.configuration or messages.StartConfigurationSet(TeamColour.YELLOW, 0, 0, 0, 0),
            write=messages.StartConfigurationSet,
        ),
    }
    MEASURED: ClassVar[Mapping[str, Callable[[Any], int]]] = {
        "Position deviation.X deviation": lambda self: self._deviation("x", 1.0),
        "Position deviation.Y deviation": lambda self: self._deviation("y", 1.0),
        DEVIATION: lambda self: self._deviation("worst", 1.0),
        "Position deviation.Heading deviation": lambda self: self._deviation("heading", 0.1),
        START_STATE: lambda self: self._start_state(),
        PLACE_AGE: lambda self: age(self.estimate.seen_at, self.now),
        TIME_LEFT: lambda self: milliseconds_until(self._match_end, self.now),
    }
    HANDLERS: ClassVar[Handlers] = {
        messages.GotoXY: _accept,
        messages.StopDrive: _stop,
        messages.EmergencyStop: _stop,
        messages.GotoStateRequest: lambda self, _: self._state(),
        messages.KalmanPositionRequest: lambda self, _: self._position(),
        messages.NaviPositionResponse: _correct,
        **FollowingNode.COMMANDS,
        messages.CheckDriveRequest: lambda *_: messages.CheckDriveResponse(),
    }
