"""The playing field on the page: the growing scene, and the match as events.

`recording` finds out what the messages say about the match, `scene` makes the drawings, and `field.js` paints them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from threading import Event as Signal
from typing import Any, ClassVar

from eurobot_od.pdo.kinds import Message, describe, kinds
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.model import messages, robot_file
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import OURS, Outcome, Route
from eurobot_od.robot.nodes.estimate import SPREAD, TOP_SPEED
from eurobot_od.robot.nodes.motion import Clearances, find_route
from eurobot_od.robot.nodes.node import NODES
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.recording import RecordedGoto, RecordedStop, Recorder, Truth, at, read_truth
from eurobot_od.robot.scene.scene import LAYERS, Explained, Item, Look, MatchScene, ground, legend, looks, way_mark
from eurobot_od.support import svg
from eurobot_od.web.events import PageEvent
from eurobot_od.web.page import Beside, Control, Panel

HERE = Path(__file__).parent

AROUND = (200, 50, 80, 100)
"""Room around the field for the numbers of its axes, in mm: left, above, right, below."""

SPEED = 50
"""Default speed of a goto from the page, in percent of the drive's maximum."""

POSE_UNITS = {"x": "mm", "y": "mm", "angle": "deg"}

PATIENCE = 1.0
"""Maximum time for a node's answer before a goto from the page, in s."""

KEPT = 1000
"""Number of sightings of each robot that are kept here, to find where a goto began."""


class FieldPanel(Panel):
    """The playing field of one source, with the facts of the robot's file."""

    name: ClassVar[str] = "field"
    title: ClassVar[str] = "Field"
    script: ClassVar[str] = (HERE / "field.js").read_text(encoding="utf-8")
    style: ClassVar[str] = style.style_sheet() + (HERE / "field.css").read_text(encoding="utf-8")
    stop: ClassVar[str] = "Stop Drive"
    plan: ClassVar[str] = "Goto XY"
    orders: ClassVar[Mapping[str, str]] = {"Goto XY": "Goto XY", "Start Configuration Set": "Start configuration"}

    def __init__(self) -> None:
        self._recorder = Recorder()
        self._scene = MatchScene(self.facts())
        # Without a margin; the drive adds one for the uncertainty of its place.
        self._clearances = Clearances.of(self.facts(), self.facts().body.radius, 0.0)
        self._routes: dict[int, list[Point]] = {}
        self._heard: defaultdict[type[Message], Signal] = defaultdict(Signal)
        self._place_known = self._shut_down = False

    @classmethod
    def facts(cls) -> Facts:
        """Return the facts of the robot: those of the shipped one, or of `field_panel`."""
        return robot_file.read()

    @classmethod
    def fits(cls, protocol: Protocol) -> bool:
        """Return whether a network has the messages for the field."""
        return {messages.KalmanPositionResponse, messages.GotoXY} <= {each.type for each in protocol.bindings}

    @classmethod
    def of(cls, protocol: Protocol) -> type[Panel]:
        """Return the panel of a network's robot."""
        return field_panel(robot_file.read(robot_file.file_for(protocol.bindings[0].file)))

    @classmethod
    def beside(cls, log: Path) -> Beside:
        truth = read_truth(log)
        return Beside(list(truth_events(truth, cls.facts())), true_path(truth))

    @classmethod
    def setup(cls) -> Mapping[str, Any]:
        facts = cls.facts()
        left, above, right, below = AROUND
        width, height = facts.field.width, facts.field.height
        return {
            "width": width,
            "height": height,
            "view": f"{-left} {-above} {left + width + right:g} {above + height + below:g}",
            "ground": ground(facts),
            "layers": LAYERS,
            "robots": _as_data(looks(facts, None)),
            "legend": [*legend(facts), *PAGE_LEGEND],
            "speed": SPEED,
            "reach": {"speed": TOP_SPEED, "spread": SPREAD},
        }

    def objection(self, message: Message, control: Control) -> str:
        """Return why the page cannot send a goto, as it has no core that has checked and configured the nodes."""
        if not isinstance(message, messages.GotoXY):
            return ""
        if self._shut_down:
            return "no goto: an Emergency Shutdown has ended all of them until a Start Configuration Set"
        for node, part in NODES.items():
            if part.check is None or part.answer is None or not self._answers(part.check, part.answer, control):
                return f"no goto: the {node} does not answer its check"
            if not control.is_as_in_its_file(node):
                return f"no goto: the {node} speaks another dialect than the page's EDS files"
        if not self._answers(messages.KalmanPositionRequest(), messages.KalmanPositionResponse, control):
            return "no goto: the drive does not say where it is"
        return "" if self._place_known else "no goto: the drive's place is unknown; send Start Configuration Set first"

    def _answers(self, request: Message, answer: type[Message], control: Control) -> bool:
        # A new one for each request, so that earlier answers do not count.
        heard = self._heard[answer] = Signal()
        control.send_message(request)
        return heard.wait(PATIENCE)

    def take(self, time: float, message: Message) -> Iterable[PageEvent]:
        if isinstance(message, messages.KalmanPositionResponse):
            self._place_known = message.x is not None
        if isinstance(message, (messages.EmergencyShutdown, messages.StartConfigurationSet)):
            self._shut_down = isinstance(message, messages.EmergencyShutdown)
        if type(message) in self._heard:
            self._heard[type(message)].set()
        news = self._recorder.take(time, message)
        for path in self._recorder.recording.paths.values():
            # Many at once, as deleting at the front is slow.
            if len(path) > 2 * KEPT:
                del path[:KEPT]
        if isinstance(message, messages.StartConfigurationSet):
            text = f"Start Configuration Set: {describe(message, kinds(messages.StartConfigurationSet))}"
            robots = _as_data(looks(self.facts(), message))
            yield PageEvent(f"start {time}", "start", time, text, data={"robots": robots})
        for each in news:
            yield self._goto(each) if isinstance(each, RecordedGoto) else self._stop(each)

    def _goto(self, goto: RecordedGoto) -> PageEvent:
        text = f"{goto.words}: {goto.ending}"
        name = f"goto {goto.number}"
        end = goto.ended
        wrong = goto.outcome not in (None, Outcome.ARRIVED, Outcome.REPLACED)
        items = self._scene.goto(goto, self._route(goto))
        return self._event(PageEvent(name, "goto", goto.sent, text, end, str(goto.number), wrong), items)

    def _stop(self, stop: RecordedStop) -> PageEvent:
        event = PageEvent(f"stop {stop.letter}", "stop", stop.time, stop.words, mark=stop.letter, wrong=True)
        return self._event(event, self._scene.stop(stop))

    def _event(self, event: PageEvent, items: Iterable[Item]) -> PageEvent:
        """Return an event of the recording with its drawings, by the page's clock."""
        start = self._recorder.start or 0.0
        end = None if event.end is None else event.end + start
        return event._replace(time=event.time + start, end=end, data=_drawn(each.later(start) for each in items))

    def _route(self, goto: RecordedGoto) -> list[Point]:
        """Return the way points of a goto as the drive may plan them, from where the robot was when it was sent."""
        if goto.number not in self._routes:  # cached, as it is needed at each message during the goto
            message = goto.message
            start = at(self._recorder.recording.path, goto.sent)
            here, there = start and Point(start.x, start.y), Point(message.x, message.y)
            planned: Sequence[Point] | None = None
            if here and message.route is Route.PLANNED:
                planned = find_route(here, there, message.barriers, self._clearances)
            # Without a route, a straight line is drawn.
            self._routes[goto.number] = [*([here] if here else []), *(planned or (there,))]
        return self._routes[goto.number]


def field_panel(facts: Facts) -> type[FieldPanel]:
    """Return the panel class of a robot with other facts."""
    return type(FieldPanel.__name__, (FieldPanel,), {"facts": classmethod(lambda _: facts)})


def _as_data(robots: Iterable[Look]) -> list[dict[str, Any]]:
    return [each._asdict() for each in robots]


def _drawn(items: Iterable[Item]) -> Mapping[str, Any]:
    return {"items": [*items]}


PAGE_LEGEND = (
    Explained("way to the goto", way_mark([(-45, 20), (0, -20), (45, 20)])),
    Explained("seen where it cannot be", svg.circle(style.CENTRE, 22, fill=style.PALE, fill_opacity=0.5)),
    Explained(
        "not seen for longer than twice its period",
        svg.circle(style.CENTRE, 36, fill="none", stroke=style.PALE, stroke_width=9, stroke_dasharray="30 14"),
    ),
)
"""Marks that are shown for a moment only."""


# Truth of a simulated match


def truth_events(truth: Truth, facts: Facts) -> Iterator[PageEvent]:
    """Yield touches and points as events, with times of the page."""
    scene = MatchScene(facts)
    for number, touch in enumerate(truth.touches):
        name = f"touch {number}"
        data = _drawn([scene.touch(touch)])
        yield PageEvent(name, "touch", touch.time, touch.words, None, "✶", touch.at_fault, data)
    for number, score in enumerate(truth.scores):
        text = f"{score.robot}: {score.task} +{score.points}"
        made = {"robot": score.robot, "points": score.points}
        yield PageEvent(f"points {number}", "points", score.time, text, mark=f"+{score.points}", data=made)
    for number, said in enumerate(truth.captions):
        yield PageEvent(f"said {number}", "said", said.time, f"{said.robot}: {said.words}")


def true_path(truth: Truth) -> list[dict[str, Any]]:
    """Return our robot's true path as a row of the page; empty if it is unknown."""
    path = [each for each in truth.path if each.time >= 0]
    if not path:
        return []
    row: dict[str, Any] = {
        "id": None,
        "name": "True position",
        "group": "world",
        "nodes": [OURS],
        "times": [round(each.time, 4) for each in path],
        "values": [[round(each, 1) for each in values] for values in list(zip(*path))[1:]],
        "texts": [],
        "wrong": {},
        "bits": 0,
        "fields": [{"name": name, "unit": unit, "words": {}} for name, unit in POSE_UNITS.items()],
    }
    return [row]
