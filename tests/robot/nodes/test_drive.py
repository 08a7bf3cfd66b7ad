"""The drive node: gotos, stops, the safe state, and what it knows about its own place."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message, MessageT, OutOfRange
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
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
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Barriers, Direction, GotoFault, Obstacle, Passage, Route, Source, TeamColour
from eurobot_od.robot.nodes.drive import Drive
from eurobot_od.robot.nodes.estimate import PUSHED, Estimate
from eurobot_od.robot.nodes.motion import AT_REST, Odometry, WheelCommand
from eurobot_od.robot.protocol import EurobotProtocol
from tests.kit.bench import put
from tests.robot.nodes.harness import DICTIONARIES, RED, TUNING, Wheels
from tests.rows import rows

FACTS = robot_file.read()

YELLOW = RED._replace(team_colour=TeamColour.YELLOW)
START = FACTS.start(TeamColour.RED)
GOTO = GotoXY(1500, 1000, 90, 100)
DT = 0.01
"""The control period, s."""
FORCED_POOLS = Barriers.of({7: Passage.FORCED, 8: Passage.FORCED})


class TrueWheels(Wheels):
    """Wheels that are off by as much as real ones: `path` is where the robot truly was."""

    def __init__(self, chance: random.Random, noise: float) -> None:
        super().__init__()
        self._chance = chance
        self._random = noise
        self._scale, self._bias = chance.gauss(1.0, noise / 2), chance.gauss(1.0, noise / 5)
        self.path = [START]

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        distance, turned = super().advance(command, dt)
        distance *= self._scale * self._chance.gauss(1.0, self._random)
        self.path.append(self.path[-1].moved(distance, turned * self._bias * self._chance.gauss(1.0, self._random)))
        return Odometry(command.speed * dt, command.turn * dt)


def sighted(pose: Pose, noise: float, share: float, chance: random.Random) -> NaviPositionResponse:
    """Return what beacons say that are off by `noise` mm, and by 1 degree where wheels are off at all."""
    x, y, angle = (chance.gauss(value, by) for value, by in zip(pose, (noise, noise, 50 * share)))
    return NaviPositionResponse(round(x), round(y), round(angle) % 360, Source.INTERNAL)


class Seat:
    """A drive with wheels that remember, called whenever it wants to be; every frame it sends is kept."""

    def __init__(self, dialect: str | None = None, wheels: Wheels | None = None) -> None:
        dictionary = dialects.load("drive", dialect) if dialect else DICTIONARIES["drive"]
        self.protocol = EurobotProtocol.of(dictionary)
        self.wheels = wheels or Wheels()
        self.drive = Drive(dictionary, self.wheels)
        self.now = 0.0
        self.frames = self.drive.start(0.0)

    def say(self, *messages: Message | Frame) -> Seat:
        for each in messages:
            frame = each if isinstance(each, Frame) else self.protocol.encode(each)
            self.frames += self.drive.receive(frame, self.now)
        return self

    def run(self, seconds: float) -> Seat:
        end = self.now + seconds
        while (wakeup := self.drive.next_wakeup) <= end:
            self.now = wakeup
            self.frames += self.drive.tick(wakeup)
        self.now = end
        return self

    def ask(self, question: Message, answer: type[MessageT]) -> MessageT:
        """Ask, and return the answer, which has to be the only frame that the question brings."""
        (frame,) = self.drive.receive(self.protocol.encode(question), self.now)
        message = self.protocol.decode(*frame)
        assert isinstance(message, answer)
        return message

    @property
    def remaining(self) -> int | GotoFault | None:
        return self.ask(GotoStateRequest(), GotoStateResponse).time

    @property
    def confirms(self) -> int:
        cob_id = self.protocol.cob_id(GotoConfirm)
        return sum(frame.cob_id == cob_id for frame in self.frames)

    @property
    def pose(self) -> Pose:
        assert self.drive.estimate.pose is not None
        return self.drive.estimate.pose

    def write(self, setting: str, value: int) -> Seat:
        """Write a value into a setting."""
        objects = self.drive.device.objects
        objects.put(objects.dictionary.address(setting), value)
        return self

    def read(self, name: str) -> int:
        """Read an object as SDO does."""
        objects = self.drive.device.objects
        return int.from_bytes(objects.read(objects.dictionary.address(name)), "little")


def configured(dialect: str | None = None) -> Seat:
    """Return a drive at the red team's start place."""
    return Seat(dialect).say(RED)


# Its place


def test_how_uncertain_its_place_is_can_be_read_in_mm_and_tenths_of_a_degree() -> None:
    names = [f"Position deviation.{part} deviation" for part in ("X", "Y", "Heading")]
    seat = Seat()
    assert [seat.read(each) for each in names] == [0xFFFF] * 3, "before it knows its place"
    seat.say(RED).say(GOTO).run(5.0)
    deviations = seat.drive.estimate.deviations
    assert deviations is not None
    x, y, heading = (seat.read(each) for each in names)
    assert (x, y, heading) == (round(deviations.x), round(deviations.y), round(deviations.heading * 10))
    assert 5 < x < y < 100
    assert 10 < heading < 100
    lost = Seat().write("Estimate.Placement deviation", 0xFFFF).say(RED)
    assert lost.read(names[0]) == 0xFFFE, "as uncertain as it can say"


# Gotos


@pytest.mark.parametrize(
    ("goto", "why"),
    [
        (GOTO, "nothing in the way"),
        (GotoXY(1500, 400, 0, 80, FORCED_POOLS), "round the pools"),
        (GotoXY(200, 1800, 180, 50), "a turn on the spot"),
        (GotoXY(200, 1800, 0, 50), "there already"),
        (GotoXY(1500, 900, 270, 60, Barriers(0xFFFF)), "every barrier forced"),
    ],
)
def test_a_goto_is_confirmed_and_arrives_within_the_tolerances(goto: GotoXY, why: str) -> None:
    seat = configured().say(goto)
    assert seat.confirms == 1
    seat.run(30.0)
    assert seat.remaining == 0, why
    assert seat.pose.distance(Pose(goto.x, goto.y, 0).point) <= 5
    assert abs((seat.pose.angle - goto.angle + 180) % 360 - 180) <= 1
    assert not seat.drive.moving
    assert seat.wheels.commands[-1] == AT_REST


def test_a_new_goto_replaces_the_old_one() -> None:
    seat = configured().say(GOTO).run(0.5).say(GotoXY(600, 1800, 0, 50)).run(20.0)
    assert seat.confirms == 2
    assert seat.remaining == 0
    assert seat.pose.distance(Pose(600, 1800, 0).point) <= 5


def test_the_same_goto_again_is_confirmed_again_and_changes_nothing() -> None:
    once, again = configured().say(GOTO).run(0.2), configured().say(GOTO).run(0.2)
    again.say(GOTO)
    assert again.confirms == 2
    assert again.run(20.0).pose.distance(once.run(20.0).pose.point) < 10


@pytest.mark.parametrize(
    ("speed", "expected"),
    [(100, 800.0), (50, 400.0), (1, 8.0)],
)
def test_speed_is_percent_of_the_maximum(speed: int, expected: float) -> None:
    seat = configured().say(GotoXY(2800, 1800, 0, speed)).run(3.0)
    assert max(command.speed for command in seat.wheels.commands) == pytest.approx(expected)


def test_at_speed_0_the_robot_stays_and_the_goto_is_not_possible() -> None:
    seat = configured().say(GOTO._replace(speed=0)).run(5.0)
    assert (seat.confirms, seat.remaining) == (1, GotoFault.NOT_POSSIBLE)
    assert seat.pose.distance(START.point) < 1e-6


@pytest.mark.parametrize(
    ("goto", "why"),
    [
        (GotoXY(900, 900, 0, 50, FORCED_POOLS), "the goal lies in a forced barrier"),
        (GotoXY(900, 1500, 0, 50, Barriers.of({1: Passage.FORCED})), "and so does this one"),
        (GotoXY(900, 1190, 0, 50, FORCED_POOLS), "the robot's edge would touch the pool"),
        (GotoXY(0, 0, 0, 50), "the robot does not fit into a corner"),
        (GotoXY(1500, 139, 0, 50), "nor so near to an edge"),
        (GotoXY(1500, 1861, 0, 50), "or to this one"),
    ],
)
def test_a_goto_that_is_not_possible_is_confirmed_and_says_so(goto: GotoXY, why: str) -> None:
    seat = configured().say(goto)
    assert (seat.confirms, seat.remaining) == (1, GotoFault.NOT_POSSIBLE), why
    assert seat.run(3.0).pose == START


@pytest.mark.parametrize(
    ("goto", "why"),
    [
        (GotoXY(140, 1860, 0, 50), "it just fits between the edges: goals have no margin there"),
        (GotoXY(900, 900, 0, 50, Barriers.of({7: Passage.NORMAL})), "a normal barrier is only avoided"),
        (GotoXY(900, 500, 0, 50, FORCED_POOLS), "far enough off the pool"),
    ],
)
def test_a_goto_to_where_the_robot_fits_is_possible(goto: GotoXY, why: str) -> None:
    assert isinstance(configured().say(goto).remaining, int), why


@pytest.mark.parametrize(
    ("setting", "value", "margin"),
    [
        ("Body.Robot radius", 140, 0.0),
        ("Body.Robot radius", 100, -40.0),
        ("Body.Safety margin", 30, 30.0),
        ("Body.Position margin", 0, -25.0),  # 2.5 times the 10 mm within which it was put down
        ("Body.Position margin", 40, 15.0),
        ("Arrival.Position tolerance", 25, 15.0),  # who is allowed to deviate more has to stay clear by more
    ],
)
def test_the_clearance_of_a_goal_follows_from_the_body(setting: str, value: int, margin: float) -> None:
    """A forced pool is avoided by its radius of 150 mm, our own, 10 mm of motion and 25 mm of uncertainty."""
    clear = 900 + round(150 + 140 + 10 + 25 + margin)
    seat = configured().write(setting, value)
    assert seat.say(GotoXY(900, clear - 1, 0, 50, FORCED_POOLS)).remaining is GotoFault.NOT_POSSIBLE
    assert isinstance(seat.say(GotoXY(900, clear, 0, 50, FORCED_POOLS)).remaining, int)


def room(path: list[Pose], barriers: Barriers) -> float:
    """Return how much was left at least between the robot's body and the forced barriers, mm."""
    forced = [barrier for barrier in FACTS.barriers if barriers.passage(barrier.number) is Passage.FORCED]
    return min(pose.distance(Point(each.x, each.y)) - each.kind.radius - 140 for pose in path for each in forced)


@rows(
    "noise, beacons, seed",
    [(*errors, seed) for errors in ((0.0, 0.0), (0.02, 5.0), (0.02, 30.0)) for seed in range(20)],
    sample=15,
)
def test_the_robot_never_touches_a_forced_barrier(noise: float, beacons: float, seed: int) -> None:
    """Gotos at random, many of which replace one under way, with wheels and beacons at random."""
    chance = random.Random(seed)
    wheels = TrueWheels(chance, noise)
    seat = Seat(wheels=wheels).write("Estimate.Navigation deviation", round(beacons))
    seat.write("Estimate.Largest deviation", 0xFFFF)  # without noise it goes without the navigation
    seat.write("Estimate.Navigation latency", 0).say(RED)
    barriers = Barriers.of({7: Passage.FORCED, 8: Passage.FORCED, chance.randint(1, 6): Passage.FORCED})
    for _ in range(8):
        goal = (chance.randint(140, 2860), chance.randint(140, 1860), chance.randrange(360))
        seat.say(GotoXY(*goal, chance.choice([40, 70, 100]), barriers))
        for _ in range(chance.choice([1, 2, 4, 8])):
            seat.say(sighted(wheels.path[-1], beacons, noise, chance)).run(0.6)
    assert math.dist(wheels.path[0].point, wheels.path[-1].point) > 1.0
    assert room(wheels.path, barriers) > 0.0


def test_the_way_of_a_rolling_robot_begins_where_it_comes_to_stand() -> None:
    """Straight from where it is, nothing is in the way; from where it stands a second later, the pool is."""
    wheels = TrueWheels(random.Random(0), noise=0.0)
    seat = Seat(wheels=wheels).write("Motion.Braking", 300).write("Estimate.Largest deviation", 0xFFFF)
    seat.say(RED, GotoXY(2800, 1800, 0, 100)).run(1.6)
    assert 1000 < seat.pose.x < 1300
    seat.say(GotoXY(1600, 300, 0, 100, FORCED_POOLS)).run(15.0)
    assert seat.remaining == 0
    assert room(wheels.path, FORCED_POOLS) > 0


def test_a_goto_that_is_not_possible_stops_the_one_before() -> None:
    seat = configured().say(GOTO).run(1.0).say(GotoXY(900, 900, 0, 50, FORCED_POOLS)).run(1.0)
    assert not seat.drive.moving
    assert seat.remaining is GotoFault.NOT_POSSIBLE


class HeldWheels(Wheels):
    """Wheels that something holds."""

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        return super().advance(command._replace(speed=command.speed * 0.3), dt)


class SlippingWheels(Wheels):
    """Wheels that are held again and again, and roll in each so manieth step."""

    def __init__(self, every: int) -> None:
        super().__init__()
        self._steps = 0
        self._every = every

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        self._steps += 1
        moved = super().advance(command, dt)
        return moved if self._steps % self._every == 0 else Odometry(0.0, 0.0)


@pytest.mark.parametrize(("every", "fault"), [(8, None), (1000, GotoFault.BLOCKED)])
def test_wheels_that_slip_for_moments_are_not_blocked_however_often(every: int, fault: GotoFault | None) -> None:
    seat = Seat(wheels=SlippingWheels(every)).say(RED, GOTO).run(1.0)
    assert (seat.drive.fault, seat.drive.moving) == (fault, fault is None)


def test_a_small_correction_does_not_make_the_remaining_time_rise() -> None:
    seat = configured().say(GOTO).run(1.5)
    told, (x, y, angle) = seat.remaining, seat.pose
    seat.say(NaviPositionResponse(round(x) - 15, round(y) + 10, round(angle), Source.INTERNAL))
    assert seat.pose.x < x - 1
    assert seat.remaining == told


def test_a_robot_that_ran_into_something_knows_its_place_worse() -> None:
    free, held = (Seat(wheels=wheels).say(RED, GOTO).run(1.0) for wheels in (Wheels(), HeldWheels()))
    assert held.drive.estimate.spread > PUSHED > free.drive.estimate.spread


def test_a_goto_is_not_possible_while_the_place_is_unknown() -> None:
    seat = Seat().say(GOTO)
    assert (seat.confirms, seat.remaining) == (1, GotoFault.NOT_POSSIBLE)
    assert set(seat.run(1.0).wheels.commands) <= {AT_REST}


def test_a_goto_is_not_possible_while_the_place_is_less_certain_than_the_setting() -> None:
    seat = configured()
    put(seat.drive, "Estimate.Largest deviation", 1)
    assert seat.drive.estimate.spread > 1
    assert seat.say(GOTO).remaining is GotoFault.NOT_POSSIBLE


def test_direction_and_route_of_the_2014_robot() -> None:
    behind = GotoXY(600, 1800, 0, 50, direction=Direction.BACKWARD)
    seat = configured("firmware2014").say(behind).run(10.0)
    assert seat.remaining == 0
    assert min(command.speed for command in seat.wheels.commands) < -100
    in_the_way = GotoXY(1600, 900, 0, 50, FORCED_POOLS, route=Route.DIRECT)
    seat = configured("firmware2014").say(GotoXY(300, 900, 0, 80)).run(10.0).say(in_the_way)
    assert seat.remaining is GotoFault.NOT_POSSIBLE
    assert isinstance(seat.say(in_the_way._replace(route=Route.PLANNED)).remaining, int)


# The remaining time


def test_the_remaining_time_is_told_at_once_and_comes_true() -> None:
    seat = configured().say(GOTO)
    times = [seat.run(0.1).remaining for _ in range(60)]
    arrival = times.index(0)
    numbers = [time for time in times[:arrival] if isinstance(time, int)]
    assert len(numbers) == arrival
    assert sorted(numbers, reverse=True) == numbers
    assert numbers[0] == pytest.approx(arrival * 100, abs=300)
    assert set(times[arrival:]) == {0}


def told_and_true(seed: int, noise: float, beacons: float) -> Iterator[list[tuple[float, float]]]:
    """Drive to random places; yield for each the remaining times reported every 100 ms, and the true ones, in s."""
    chance = random.Random(seed)
    wheels = TrueWheels(chance, noise)
    seat = Seat(wheels=wheels).write("Estimate.Navigation deviation", round(beacons))
    seat.write("Estimate.Largest deviation", 0xFFFF)  # without noise it goes without the navigation
    seat.write("Estimate.Navigation latency", 0).say(RED)
    for _ in range(4):
        seat.say(GotoXY(chance.randint(150, 2850), chance.randint(150, 1850), chance.randrange(360), 100))
        told = []
        while seat.drive.moving:
            remaining = seat.remaining
            assert isinstance(remaining, int)
            told.append(remaining / 1000)
            if noise and len(told) % 6 == 1:
                seat.say(sighted(wheels.path[-1], beacons, noise, chance))
            begun = len(seat.wheels.commands)
            seat.run(0.1)
        end = 0.1 * len(told) - 0.1 + DT * (len(seat.wheels.commands) - begun)
        yield [(seconds, end - 0.1 * number) for number, seconds in enumerate(told)]


@pytest.mark.long
@pytest.mark.parametrize(
    ("noise", "beacons", "least"),
    [
        (0.0, 0.0, 1.0),
        (0.02, 5.0, 0.95),
        (0.02, 30.0, 0.65),  # corrections just before the goal have the robot drive the last centimetres again
    ],
)
def test_the_remaining_time_is_within_ten_percent_or_a_tenth_of_a_second(
    noise: float, beacons: float, least: float
) -> None:
    """So many of the answers at `least`; none is more than the one before, but for the first of a goto."""
    gotos = [each for seed in range(10) for each in told_and_true(seed, noise, beacons)]
    good = [told == pytest.approx(true, rel=0.1, abs=0.1) for goto in gotos for told, true in goto]
    assert sum(good) / len(good) >= least
    assert [goto for goto in gotos if goto != sorted(goto, reverse=True)] == []


@pytest.mark.parametrize(
    ("before", "why"),
    [
        ([], "no goto yet"),
        ([GOTO, StopDrive()], "a stop forgets the goto"),
        ([GOTO, EmergencyStop(Obstacle.ENEMY)], "and so does an emergency stop"),
        ([GOTO, EmergencyShutdown()], "and an emergency shutdown"),
        ([GOTO, RED], "and a new start configuration"),
    ],
)
def test_without_a_goto_the_remaining_time_is_unknown(before: list[Message], why: str) -> None:
    assert configured().say(*before).run(1.0).remaining is None, why


# Stops


@pytest.mark.parametrize("stop", [StopDrive(), EmergencyStop(Obstacle.OBJECT), EmergencyShutdown()])
def test_a_stop_brakes_to_rest_and_forgets_the_goto(stop: Message) -> None:
    seat = configured().say(GOTO).run(1.2)
    before = len(seat.wheels.commands)
    speed = seat.wheels.commands[-1].speed
    assert speed > 400
    seat.say(stop).run(1.0)
    braking = [command.speed for command in seat.wheels.commands[before:]]
    assert braking == sorted(braking, reverse=True)
    assert len(braking) == pytest.approx(speed / 24, abs=2)  # 2400 mm/s2 in steps of 10 ms
    assert seat.wheels.commands[-1] == AT_REST
    assert (seat.drive.goto, seat.drive.moving, seat.drive.stopped_by) == (None, False, stop)


@pytest.mark.parametrize(
    ("stops", "reason"),
    [
        ([EmergencyStop(Obstacle.OBJECT)], Obstacle.OBJECT),
        ([EmergencyStop(Obstacle.ENEMY)], Obstacle.ENEMY),
        ([EmergencyStop(Obstacle.ENEMY), EmergencyStop(Obstacle.OBJECT)], Obstacle.OBJECT),
        ([StopDrive()], None),
        ([EmergencyStop(Obstacle.ENEMY), StopDrive()], Obstacle.ENEMY),  # it tells a stopped drive nothing new
        ([EmergencyStop(Obstacle.ENEMY), GOTO], None),  # it drives again
    ],
)
def test_an_emergency_stop_keeps_its_reason(stops: list[Message], reason: Obstacle | None) -> None:
    assert configured().say(GOTO, *stops).drive.obstacle is reason


def test_an_emergency_stop_for_an_unknown_obstacle_stops_as_well() -> None:
    seat = configured("firmware2014").say(GOTO).run(1.0).say(Frame(0x002, b"\x07")).run(1.0)
    assert not seat.drive.moving
    assert isinstance(seat.drive.obstacle, OutOfRange)


def test_a_stop_at_rest_is_kept_and_moves_nothing() -> None:
    seat = configured().say(StopDrive()).run(1.0)
    assert seat.drive.stopped_by == StopDrive()
    assert set(seat.wheels.commands) <= {AT_REST}


# The safe state


def shut_down() -> Seat:
    """Return a drive after an emergency shutdown."""
    return configured().say(GOTO).run(0.5).say(EmergencyShutdown()).run(1.0)


def test_after_a_shutdown_gotos_are_not_confirmed_and_nothing_moves() -> None:
    seat = shut_down()
    confirms = seat.confirms
    steps = len(seat.wheels.commands)
    seat.say(GOTO).run(2.0)
    assert (seat.confirms, len(seat.wheels.commands)) == (confirms, steps)
    assert seat.drive.goto is None


def test_after_a_shutdown_checks_state_and_position_are_still_answered() -> None:
    seat = shut_down()
    assert seat.ask(CheckDriveRequest(), CheckDriveResponse) == CheckDriveResponse()
    assert seat.remaining is None
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse).x is not None


@pytest.mark.parametrize(
    ("release", "why"),
    [
        (YELLOW, "a new start configuration"),
        (Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 0])), "an NMT reset of all nodes"),
        (Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 2])), "an NMT reset of this node"),
    ],
)
def test_the_safe_state_ends_with(release: Message | Frame, why: str) -> None:
    seat = shut_down().say(release)
    assert not seat.drive.safe, why
    confirms = seat.confirms
    assert seat.say(YELLOW, GOTO).confirms == confirms + 1


@pytest.mark.parametrize(
    "other",
    [
        StopDrive(),
        EmergencyStop(Obstacle.OBJECT),
        GOTO,
        Frame(NMT_COB_ID, bytes([NmtCommand.ENTER_PRE_OPERATIONAL, 0])),
        Frame(NMT_COB_ID, bytes([NmtCommand.START, 0])),
        Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 3])),  # another node
        Frame(0x2C0, bytes.fromhex("0600")),  # a start configuration with three enemies
    ],
)
def test_the_safe_state_does_not_end_with(other: Message | Frame) -> None:
    assert shut_down().say(other).drive.safe


def test_a_shutdown_is_reported_once_and_its_end_too() -> None:
    seat = shut_down().say(EmergencyShutdown(), YELLOW)
    codes = [int.from_bytes(frame.data[:2], "little") for frame in seat.frames if frame.cob_id == 0x082]
    assert codes == [0xFF01, 0x0000]


@pytest.mark.parametrize("reset", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_an_nmt_reset_tells_the_wheels_to_stop_and_forgets_everything(reset: NmtCommand) -> None:
    seat = configured().say(GOTO).run(1.0).say(Frame(NMT_COB_ID, bytes([reset, 2])))
    assert seat.wheels.commands[-1] == AT_REST
    assert (seat.drive.goto, seat.drive.configuration, seat.drive.estimate.pose) == (None, None, None)
    steps = len(seat.wheels.commands)
    assert len(seat.run(1.0).wheels.commands) == steps


@pytest.mark.parametrize("command", [NmtCommand.STOP, NmtCommand.ENTER_PRE_OPERATIONAL])
def test_a_drive_taken_out_of_operational_brakes_and_forgets_the_goto(command: NmtCommand) -> None:
    seat = configured().say(GOTO).run(1.0).say(Frame(NMT_COB_ID, bytes([command, 2]))).run(1.0)
    assert (seat.drive.goto, seat.drive.moving, seat.wheels.commands[-1]) == (None, False, AT_REST)


# The start configuration


@pytest.mark.parametrize("colour", TeamColour)
def test_a_start_configuration_puts_the_robot_at_its_teams_place(colour: TeamColour) -> None:
    seat = Seat()
    answer = seat.ask(RED._replace(team_colour=colour), StartConfigurationConfirm)
    assert answer == StartConfigurationConfirm()
    assert seat.pose == FACTS.start(colour)


def test_a_new_start_configuration_drops_a_goto() -> None:
    seat = configured().say(GOTO).run(0.5).say(YELLOW).run(1.0)
    assert (seat.drive.goto, seat.drive.stopped_by, seat.drive.moving) == (None, None, False)


def test_a_start_configuration_set_twice_is_confirmed_twice() -> None:
    seat = Seat()
    again: list[StartConfigurationSet] = [RED, RED]
    assert [seat.ask(each, StartConfigurationConfirm) for each in again] == [StartConfigurationConfirm()] * 2


# Its own place


def test_an_unknown_place_is_told_as_unknown() -> None:
    assert Seat().ask(KalmanPositionRequest(), KalmanPositionResponse) == KalmanPositionResponse(
        None, None, None, Source.INTERNAL
    )


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ((1000, 1000, 90), (1000, 1000, 90)),  # the first position is believed
        ((1000, 1000, None), (None, None, None)),  # but not without a heading
        ((None, None, None), (None, None, None)),
    ],
)
def test_a_first_navigation_position_sets_the_place(
    position: tuple[int | None, int | None, int | None], expected: tuple[int | None, int | None, int | None]
) -> None:
    seat = Seat().say(NaviPositionResponse(*position, Source.INTERNAL))
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse)[:3] == expected


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ((210, 1800, 0), (204, 1800, 0)),  # the start place was measured before, twice as well
        ((200, 1800, 3), (200, 1800, 1)),
        ((210, 1800, None), (204, 1800, 0)),  # the heading stays
        ((None, None, None), (200, 1800, 0)),  # not seen
        ((1500, 1000, 0), (200, 1800, 0)),  # an outlier
    ],
)
def test_navigation_positions_correct_the_estimate(
    position: tuple[int | None, int | None, int | None], expected: tuple[int, int, int]
) -> None:
    seat = configured()
    for each in ((200, 1800, 0), position):
        seat.say(NaviPositionResponse(*each, Source.INTERNAL))
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse)[:3] == expected


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ((1500, 1000, 90), (200, 1800, 0)),  # it may be wrong: a robot that is sent off by it drives into anything
        ((210, 1800, 0), (208, 1800, 0)),  # beacons are more exact than who puts the robot down
        ((210, 1800, None), (208, 1800, 0)),
        ((None, None, None), (200, 1800, 0)),
    ],
)
def test_the_first_position_corrects_the_start_place(
    position: tuple[int | None, int | None, int | None], expected: tuple[int, int, int]
) -> None:
    seat = configured().say(NaviPositionResponse(*position, Source.INTERNAL))
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse)[:3] == expected


def test_two_first_positions_that_agree_take_the_place_of_the_start_place() -> None:
    seat = configured()  # nothing has measured it: the drive may have rebooted
    for position in ((700, 300, 10), (1500, 1000, 90), (1500, 1000, 90)):
        seat.say(NaviPositionResponse(*position, Source.INTERNAL)).run(0.1)
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse)[:3] == (1500, 1000, 90)


def test_an_angle_that_rounds_to_360_is_0() -> None:
    seat = configured()
    seat.drive.estimate = Estimate(TUNING, Pose(100, 100, 359.7))
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse).angle == 0


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        (Pose(-4.0, 2003.0, 0), (0, 2000)),  # dead reckoning may leave the field, the message may not
        (Pose(3001.0, -1.0, 0), (3000, 0)),
        (Pose(255.0, 255.0, 10), (255, 255)),  # a real place: the angle is known
    ],
)
def test_a_place_is_told_inside_the_field(pose: Pose, expected: tuple[int, int]) -> None:
    seat = configured()
    seat.drive.estimate = Estimate(TUNING, pose)
    assert seat.ask(KalmanPositionRequest(), KalmanPositionResponse)[:2] == expected
