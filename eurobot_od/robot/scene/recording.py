"""A match according to its messages: paths, gotos with their outcomes, stops with their reasons.

Messages out of range are ignored, as by the nodes.
"""

from __future__ import annotations

import hashlib
import json
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, get_args

from eurobot_od.errors import FileError, LocalError
from eurobot_od.pdo.kinds import Message, is_flagged, kinds
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import FAULT_OUTCOME, Caption, GotoFault, Outcome, Score, TeamColour
from eurobot_od.support.files import UNREADABLE, read_whole, write_whole


class PathPoint(NamedTuple):
    """A place at a time in s: x and y in mm, heading in degrees or None."""

    time: float
    x: float
    y: float
    angle: float | None


@dataclass(frozen=True)
class RecordedGoto:
    """A goto with its number from 1, when it was first sent, and when and how it ended; times in s.

    While it is under way, `ended` and `outcome` are None.
    """

    number: int
    sent: float
    message: messages.GotoXY
    ended: float | None = None
    outcome: Outcome | None = None

    @property
    def words(self) -> str:
        """The goto as text."""
        asked = self.message
        return f"goto {self.number} to {asked.x}, {asked.y} mm, {asked.angle} deg, {asked.speed} %"

    @property
    def ending(self) -> str:
        """The outcome as text."""
        return "under way" if self.outcome is None else self.outcome.value


@dataclass(frozen=True)
class RecordedStop:
    """A stop: its letter (A, B, ...), time in s, kind and reason, and the robot's place, if it is known."""

    letter: str
    time: float
    what: str
    place: PathPoint | None

    @property
    def words(self) -> str:
        """The stop as text."""
        return f"{self.letter}: {self.what}"


class TouchMark(NamedTuple):
    """A contact of two bodies: time in s, place, text, and whether our robot drove into the other."""

    time: float
    place: Point
    words: str
    at_fault: bool


class Truth(NamedTuple):
    """What the bus does not show, with times by the bus's clock: true poses, touches, points, and strategies' texts."""

    path: Sequence[PathPoint] = ()
    touches: Sequence[TouchMark] = ()
    scores: Sequence[Score] = ()
    captions: Sequence[Caption] = ()

    def later(self, by: float) -> Truth:
        """Return the same with all times `by` s later."""
        parts: Iterable[Sequence[Any]] = self
        return Truth(*([each._replace(time=each.time + by) for each in part] for part in parts))


NOTHING = Truth()


@dataclass
class Recording:
    """A match; times in s since the first message.

    `paths` are the sightings by message type. `truth` is that of a simulated world; empty for a log without it.
    """

    configuration: messages.StartConfigurationSet | None = None
    paths: dict[type[messages.PositionResponse], list[PathPoint]] = field(default_factory=dict)
    truth: Truth = NOTHING
    gotos: list[RecordedGoto] = field(default_factory=list)
    stops: list[RecordedStop] = field(default_factory=list)
    end: float = 0.0

    @property
    def path(self) -> list[PathPoint]:
        """The estimated path of our robot."""
        return self.paths.get(messages.KalmanPositionResponse, [])

    @property
    def team(self) -> TeamColour | None:
        """Our colour, None if it is unknown or invalid."""
        colour = None if self.configuration is None else self.configuration.team_colour
        return colour if isinstance(colour, TeamColour) else None


def record(events: Iterable[tuple[float, Message]], truth: Truth = NOTHING) -> Recording:
    """Return a match from its messages with times in s, and its truth by the same clock."""
    recorder = Recorder()
    for time, message in events:
        recorder.take(time, message)
    start = recorder.start or 0.0
    recording = recorder.recording
    known = recording.truth = truth.later(-start)
    times = [each.time for each in known.touches] + [each.time for each in known.scores]
    recording.end = max([recording.end, *times])
    return recording


class Recorder:
    """Adds one message after the other to `recording`; `start` is the first message's time in s."""

    def __init__(self) -> None:
        self.recording = Recording()
        self.start: float | None = None
        self._running: RecordedGoto | None = None
        self._stopped: set[bool] = set()  # since the last goto; whether each stop was a shutdown
        self._news: list[RecordedGoto | RecordedStop] = []

    def take(self, time: float, message: Message) -> list[RecordedGoto | RecordedStop]:
        """Add a message; return the gotos and stops that are new or have ended."""
        self.start = time if self.start is None else self.start
        # Times in a log may go back a little.
        now = self.recording.end = max(time - self.start, self.recording.end)
        # The drive stops even for an unknown obstacle (Table 1), so this is shown.
        if is_flagged(message) and type(message) not in messages.CATALOGUE.always:
            return []
        self._news = []
        handle = HANDLERS.get(type(message))
        if handle is not None:
            handle(self, now, message)
        return self._news

    def configure(self, _: float, configuration: messages.StartConfigurationSet) -> None:
        self.recording.configuration = configuration

    def see(self, now: float, seen: messages.PositionResponse) -> None:
        if seen.x is not None and seen.y is not None:
            path = self.recording.paths.setdefault(type(seen), [])
            path.append(PathPoint(now, seen.x, seen.y, seen.angle))

    def goto(self, now: float, goto: messages.GotoXY) -> None:
        """Add a goto; the same one during the goto is a repetition after a lost confirm."""
        if self._running is not None and self._running.message == goto:
            return
        self._end(now, Outcome.REPLACED)
        self._running = RecordedGoto(len(self.recording.gotos) + 1, now, goto)
        self._stopped = set()
        self.recording.gotos.append(self._running)
        self._news.append(self._running)

    def state(self, now: float, state: messages.GotoStateResponse) -> None:
        if state.time == 0:
            self._end(now, Outcome.ARRIVED)
        elif isinstance(state.time, GotoFault):
            self._end(now, FAULT_OUTCOME[state.time])

    def stop(self, now: float, stop: messages.StopMessage) -> None:
        """Add a stop, unless it repeats one since the last goto; only a shutdown is more than any other stop.

        A stop is repeated until the robot stands, and an Emergency Stop may be followed by a Stop Drive.
        """
        is_shutdown = isinstance(stop, messages.EmergencyShutdown)
        if is_shutdown in self._stopped:
            return
        self._stopped.add(is_shutdown)
        self._end(now, Outcome.STOPPED)
        letter = _letter(len(self.recording.stops))
        place = at(self.recording.path, now)
        what = "Emergency Shutdown: mushroom" if is_shutdown else "Stop Drive: commanded"
        if isinstance(stop, messages.EmergencyStop):
            what = f"Emergency Stop: {kinds(messages.EmergencyStop)['obstacle'].text(stop.obstacle)}"
        self.recording.stops.append(RecordedStop(letter, now, what, place))
        self._news.append(self.recording.stops[-1])

    def _end(self, now: float, outcome: Outcome) -> None:
        if self._running is not None:
            self.recording.gotos[-1] = replace(self._running, ended=now, outcome=outcome)
            self._news.append(self.recording.gotos[-1])
            self._running = None


HANDLERS: Mapping[type[Message], Callable[[Recorder, float, Any], None]] = {
    messages.StartConfigurationSet: Recorder.configure,
    **{each.response: Recorder.see for each in messages.POSITIONS if each.record != "Navi position"},
    messages.GotoXY: Recorder.goto,
    messages.GotoStateResponse: Recorder.state,
    **dict.fromkeys(get_args(messages.StopMessage), Recorder.stop),
}


def _letter(number: int) -> str:
    """Return A, B, ..., Z, AA, AB, ... for 0, 1, ..."""
    return (_letter(number // 26 - 1) if number >= 26 else "") + chr(ord("A") + number % 26)


def at(path: list[PathPoint], time: float) -> PathPoint | None:
    """Return where the robot was at a time, interpolated between two sightings; None without any."""
    after = bisect_right(path, time, key=lambda sighting: sighting.time)
    if not path:
        return None
    if after == 0:
        return path[0]
    if after == len(path):
        return path[-1]
    one, two = path[after - 1], path[after]
    # Not 0, as the time is between the two.
    share = (time - one.time) / (two.time - one.time)
    return PathPoint(time, one.x + share * (two.x - one.x), one.y + share * (two.y - one.y), one.angle)


BEGINNING = 1 << 16
"""Number of bytes of a log that are hashed to recognise it."""


def truth_file(log: Path) -> Path:
    """Return the file of a log's truth."""
    return log.with_name(f"{log.name}.truth.json")


def _digest(log: Path) -> str:
    with log.open("rb") as file:
        return hashlib.sha256(file.read(BEGINNING)).hexdigest()


def write_truth(log: Path, truth: Truth, start: float) -> None:
    """Write the truth of a match beside its log, whose first frame came at `start`; raises OSError.

    Nothing is written for a pipe or device.
    """
    if not log.is_file():
        return
    known = truth.later(-start)
    rounded = [[round(each, 3) for each in place if each is not None] for place in known.path]
    data = {"log": _digest(log), **known._asdict(), "path": rounded}
    write_whole(truth_file(log), json.dumps(data).encode())


def read_truth(log: Path, start: float = 0.0) -> Truth:
    """Return the truth of a log whose first frame came at `start`, NOTHING if there is no file.

    Raises LocalError for a damaged file, and for another log's.
    """
    file = truth_file(log)
    if not file.is_file():
        return NOTHING
    try:
        data = json.loads(read_whole(file))
        if data["log"] == _digest(log):
            return _truth(data).later(start)
    except (FileError, *UNREADABLE, TypeError, AttributeError) as error:
        raise LocalError(f"{file}: not what `match --log` writes: {error}") from error
    raise LocalError(f"{file}: of another log than {log.name}; its points are left out")


def _truth(data: Any) -> Truth:
    return Truth(
        [PathPoint(*map(float, place)) for place in data["path"]],
        [TouchMark(float(time), Point(*place), str(words), bool(ours)) for time, place, words, ours in data["touches"]],
        [Score(float(time), str(robot), str(task), int(points)) for time, robot, task, points in data["scores"]],
        [Caption(float(time), str(robot), str(words)) for time, robot, words in data.get("captions", ())],
    )
