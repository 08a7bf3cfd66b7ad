"""Whole matches in simulated time: what is on the bus, that it repeats to the byte, and how it ends."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import can
import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.match import EventKind, MatchEvent, MatchOptions, Summary, rehearse
from eurobot_od.robot.match.stage import EdsFiles, cast_for, play_simulated
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import EmergencyShutdown, GotoXY, StartConfigurationSet
from eurobot_od.robot.model.values import OURS, Outcome, TeamColour
from eurobot_od.robot.nodes import Core, Drive
from eurobot_od.robot.nodes.motion import WheelCommand
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import RIVAL
from tests.robot.document import NAMES

FACTS = robot_file.read()

PROTOCOL = EurobotProtocol.load()


class Match(NamedTuple):
    """A match that was played."""

    events: list[MatchEvent]
    frames: list[tuple[float, Frame]]
    summary: Summary
    world: World

    def told(self, kind: EventKind) -> list[MatchEvent]:
        return [event for event in self.events if event.kind is kind]

    @property
    def begin(self) -> float:
        """When the match began, s since power-on."""
        return self.told(EventKind.MATCH)[0].time


@cache
def play(options: MatchOptions) -> Match:
    """Play a match, each kind once for all tests."""
    events: list[MatchEvent] = []
    frames: list[tuple[float, Frame]] = []
    summary, world = play_simulated(options, events.append, lambda time, frame: frames.append((time, frame)))
    return Match(events, frames, summary, world)


NORMAL = MatchOptions()
EMERGENCY = MatchOptions(emergency_at=40.0)
SHORT = MatchOptions(duration=8.0)


# A whole match


@pytest.mark.long
def test_a_normal_match_sends_all_messages_but_the_emergency_shutdown() -> None:
    summary = play(NORMAL).summary
    assert [name for name in NAMES if not summary.frames[name]] == ["Emergency Shutdown"]
    assert summary.messages_sent == sum(count > 0 for count in summary.frames.values())


def test_a_match_lasts_as_long_as_the_core_says() -> None:
    match = play(NORMAL)
    end = match.told(EventKind.STOP)[-1]
    assert end.text == "stop drive: the match is over"
    assert end.time - match.begin == pytest.approx(90.0, abs=0.05)


def test_nothing_is_lost_and_the_summary_counts_every_frame() -> None:
    match = play(NORMAL)
    assert match.summary.reports == []
    assert sum(match.summary.frames.values()) + sum(match.summary.others.values()) == len(match.frames)
    assert match.summary.others == {
        "Boot-up": 3,
        "SDO": 14 + 2 * len(match.summary.errors),  # fingerprints of two nodes, and what the core asks the drive
        "Heartbeat": pytest.approx(559, abs=6),
    }


def test_gotos_are_confirmed_answered_and_reach_their_places() -> None:
    match = play(NORMAL)
    frames = match.summary.frames
    assert frames["Goto XY"] == frames["Goto Confirm"] == len(match.told(EventKind.GOTO))
    assert frames["Goto State Request"] == frames["Goto State Response"]
    assert len(match.told(EventKind.ARRIVED)) >= 10
    assert max(match.summary.errors) < 30


def test_the_robot_stays_on_the_field_and_stands_still_at_the_end() -> None:
    match = play(NORMAL)
    assert all(0 <= pose.x <= FACTS.field.width and 0 <= pose.y <= FACTS.field.height for _, pose in match.world.path)
    assert match.told(EventKind.END)[0].data["moved"] == 0


def test_events_come_in_the_order_of_startup_and_match() -> None:
    kinds = [event.kind for event in play(NORMAL).events]
    assert kinds[:6] == [
        EventKind.START,
        EventKind.CHECK,
        EventKind.CONFIGURE,
        EventKind.POSITION,
        EventKind.MATCH,
        EventKind.GOTO,
    ]
    assert kinds[-1] is EventKind.END
    times = [event.time for event in play(NORMAL).events]
    assert times == sorted(times)


@pytest.mark.parametrize(("name", "begins"), [("", "core, "), ("mine", "mine: core, ")], ids=["ours", "a team's"])
def test_the_first_line_names_a_robot_that_is_not_ours(name: str, begins: str) -> None:
    options, events = MatchOptions(duration=0.1), list[MatchEvent]()
    play_simulated(options, events.append, lambda *_: None, EdsFiles.read(options)._replace(robot=name))
    assert events[0].text.startswith(begins)


@pytest.mark.long
def test_the_confirms_of_drive_and_navigation_are_two_frames_or_merge_with_the_seed() -> None:
    matches = [play(MatchOptions(seed=seed, duration=0.1)) for seed in range(1, 21)]
    assert {match.summary.frames["Start Configuration Confirm"] for match in matches} == {1, 2}


# The mushroom


@pytest.mark.long
def test_an_emergency_sends_the_last_message_too() -> None:
    match = play(EMERGENCY)
    assert all(match.summary.frames[name] for name in NAMES)
    (emergency,) = match.told(EventKind.EMERGENCY)
    assert emergency.time - match.begin == pytest.approx(40.0, abs=0.001)


def test_after_an_emergency_nothing_moves() -> None:
    match = play(EMERGENCY)
    rest = [pose for time, pose in match.world.path if time > match.begin + 41.0]
    assert {pose.point for pose in rest} <= {match.world.robot.point}
    goto, shutdown = PROTOCOL.cob_id(GotoXY), PROTOCOL.cob_id(EmergencyShutdown)
    ids = [frame.cob_id for _, frame in match.frames]
    assert goto not in ids[ids.index(shutdown) :]
    assert match.told(EventKind.END)[0].data["moved"] == 0


def test_an_emergency_in_the_moment_of_an_arrival_is_not_missed() -> None:
    first = play(SHORT).told(EventKind.ARRIVED)[0]
    moment = first.time - 0.0002 - play(SHORT).begin
    match = play(MatchOptions(duration=8.0, emergency_at=moment))
    assert match.summary.frames["Emergency Shutdown"] == 1
    assert len(match.told(EventKind.EMERGENCY)) == 1


@pytest.mark.parametrize(
    ("duration", "emergency_at"),
    [
        (10.0, 10.0),
        (10.0, 40.0),
        (None, 90.0),  # the core's match duration
    ],
)
def test_an_emergency_after_the_match_is_refused(duration: float | None, emergency_at: float) -> None:
    with pytest.raises(LocalError, match=r"an emergency at \d+ s is not within the match of \d+ s"):
        play(MatchOptions(duration=duration, emergency_at=emergency_at))


# One seed


def test_the_same_seed_gives_the_same_frames_to_the_byte() -> None:
    again = play.__wrapped__(SHORT)
    assert again.frames == play(SHORT).frames
    assert again.events == play(SHORT).events


def test_another_seed_gives_other_frames() -> None:
    assert play(MatchOptions(duration=8.0, seed=2)).frames != play(SHORT).frames


# Who plays


@pytest.mark.parametrize("team", TeamColour)
@pytest.mark.parametrize(("enemies", "confederates"), [(0, 0), (1, 0), (2, 1)])
def test_only_those_who_play_are_on_the_bus(team: TeamColour, enemies: int, confederates: int) -> None:
    match = play(MatchOptions(team, enemies, confederates, duration=5.0))
    frames = match.summary.frames
    asked = {name: frames[f"{name} Position Request"] > 0 for name in ("Enemy 1", "Enemy 2", "Confederate")}
    assert asked == {"Enemy 1": enemies >= 1, "Enemy 2": enemies >= 2, "Confederate": confederates >= 1}
    set_start = PROTOCOL.cob_id(StartConfigurationSet)
    (start,) = {PROTOCOL.decode(*frame) for _, frame in match.frames if frame.cob_id == set_start}
    assert isinstance(start, StartConfigurationSet)
    assert start[:3] == (team, enemies, confederates)


@pytest.mark.parametrize("dialect", dialects.names())
def test_every_dialect_plays(dialect: str) -> None:
    match = play(MatchOptions(duration=8.0, dialect=dialect))
    assert dialect in match.events[0].text
    assert len(match.told(EventKind.ARRIVED)) >= 1
    assert match.summary.reports == []


def test_dialects_differ_on_the_wire_and_not_in_what_happens() -> None:
    one, other = (play(MatchOptions(duration=8.0, dialect=dialect)) for dialect in ("canopen", "firmware2014"))
    assert one.frames != other.frames
    assert [event.kind for event in one.events] == [event.kind for event in other.events]


def test_the_instruments_of_two_robots_err_each_in_its_own_way() -> None:
    def rolled(name: str) -> float:
        """Return how far a robot comes that is told 300 mm."""
        world = World(MatchOptions(enemies=1), lambda: 0.0, rival=True)
        _, (_, drive, _) = cast_for(MatchOptions(enemies=1), EdsFiles.read(MatchOptions()), world, name)
        before = world.robots[name].pose
        assert isinstance(drive, Drive)
        drive.chassis.advance(WheelCommand(300.0, 0.0), 1.0)
        return world.robots[name].pose.distance(before.point)

    assert rolled(OURS) == rolled(OURS)
    assert rolled(OURS) != pytest.approx(rolled(RIVAL), abs=0.01)


ALONE = MatchOptions(enemies=0, confederates=0)


async def drive(core: Core) -> Outcome:
    await core.check_nodes()
    await core.configure_start(TeamColour.RED)
    return (await core.goto(600, 1800, 0, 20)).outcome


async def fail(core: Core) -> None:
    await drive(core)
    raise ValueError("no plan")


def test_the_result_is_the_strategys() -> None:
    assert rehearse(drive, ALONE) is Outcome.ARRIVED


def test_log_and_picture_are_those_of_a_match(tmp_path: Path) -> None:
    log, picture = tmp_path / "mine.log", str(tmp_path / "mine.svg")
    rehearse(drive, ALONE, log=log, picture=picture)
    goto = EurobotProtocol.load().cob_id(GotoXY)
    with can.LogReader(log) as reader:
        assert [message.arbitration_id for message in reader].count(goto) == 1
    text = Path(picture).read_text()
    assert "1 of 1 goto reached" in text
    assert "our path, as it really was" in text


def test_log_and_picture_are_written_when_the_strategy_raises(tmp_path: Path) -> None:
    log, picture = tmp_path / "mine.log", tmp_path / "mine.svg"
    with pytest.raises(ValueError, match="no plan"):
        rehearse(fail, ALONE, log=log, picture=picture)
    assert log.stat().st_size > 0
    assert "1 of 1 goto reached" in picture.read_text()


@pytest.mark.parametrize(("files", "error"), [({"log": "mine.md"}, LocalError), ({"picture": "mine.gif"}, UnknownName)])
def test_an_unknown_suffix_is_an_error_before_anything_is_written(
    tmp_path: Path, files: dict[str, str], error: type[Exception]
) -> None:
    kind, name = files.popitem()
    with pytest.raises(error):
        rehearse(drive, ALONE, log=tmp_path / (name if kind == "log" else "mine.log"), picture=tmp_path / name)
    assert list(tmp_path.iterdir()) == []
