"""The match as events of the page."""

from __future__ import annotations

import json
import re

from eurobot_od.pdo.kinds import Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.model.messages import (
    EmergencyStop,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationSet,
)
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import OURS, Barriers, Obstacle, Passage, Score, Source, TeamColour
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.scene.panel import KEPT, FieldPanel, true_path, truth_events
from eurobot_od.robot.scene.recording import PathPoint, TouchMark, Truth
from eurobot_od.web.events import PageEvent

HERE = KalmanPositionResponse(200, 1800, 0, Source.INTERNAL)
GOTO = GotoXY(1000, 500, 90, 80, Barriers.of({7: Passage.FORCED}))


def events(*messages: tuple[float, Message]) -> list[PageEvent]:
    panel = FieldPanel()
    return [event for time, message in messages for event in panel.take(time, message)]


def layers(event: PageEvent) -> dict[str, list[tuple[float, float | None]]]:
    """Return the times of an event's drawings by their layers."""
    found: dict[str, list[tuple[float, float | None]]] = {}
    for item in event.data["items"]:
        found.setdefault(item.layer, []).append((item.begin, item.end))
    return found


def way(event: PageEvent) -> list[str]:
    """Return the points of the way to a goto, on paper."""
    (drawing,) = (item.drawing for item in event.data["items"] if item.layer == "routes")
    return re.findall(r"[0-9.]+,[0-9.]+", drawing)


def test_a_goto_is_told_when_it_is_sent_and_when_it_ends() -> None:
    sent, ended = events(
        (2.0, HERE), (3.0, GOTO), (3.1, GOTO), (6.0, GotoStateResponse(500)), (7.0, GotoStateResponse(0))
    )
    assert (sent.key, sent.time, sent.end, sent.text) == (
        "goto 1", 3.0, None, "goto 1 to 1000, 500 mm, 90 deg, 80 %: under way",
    )  # fmt: skip
    assert (ended.key, ended.end, ended.wrong) == ("goto 1", 7.0, False)
    assert layers(sent) == {
        "rings": [(3.0, None)],
        "routes": [(3.0, None)],
        "targets": [(3.0, None)],
        "marks": [(3.0, None)],
    }
    assert layers(ended)["rings"] == [(3.0, 7.0)]
    assert layers(ended)["marks"] == [(3.0, 7.0), (7.0, None)], "under way, and reached"


def test_the_way_goes_round_what_is_not_to_be_crossed() -> None:
    (straight,) = events((0.0, HERE), (1.0, GotoXY(1800, 200, 0, 50)))
    (round_about,) = events((0.0, HERE), (1.0, GotoXY(1600, 200, 0, 50, Barriers.of({7: Passage.FORCED}))))
    assert way(straight) == ["200,200", "1800,1800"]
    assert len(way(round_about)) > 2


def test_without_a_place_the_way_is_the_goal() -> None:
    (goto,) = events((0.0, GOTO))
    assert way(goto) == ["1000,1500"]


def test_a_stop_ends_the_goto_and_stands_where_the_robot_was() -> None:
    _, ended, stop = events((0.0, HERE), (1.0, GOTO), (2.0, EmergencyStop(Obstacle.ENEMY)))
    assert (ended.end, ended.wrong) == (2.0, True)
    assert stop.text == "A: Emergency Stop: enemy"
    (sign,) = stop.data["items"]
    assert sign.drawing.startswith('<g transform="translate(200 200)">')


def test_a_start_configuration_is_an_event() -> None:
    (event,) = events((1.5, StartConfigurationSet(TeamColour.RED, 2, 0, 36, 0)))
    assert event.text.startswith("Start Configuration Set: team_colour=red")
    robots = {each["name"]: each for each in event.data["robots"]}
    assert robots[OURS]["colour"] == "var(--robot-red)"
    assert (robots["enemy 1"]["radius"], robots["enemy 2"]["radius"]) == (180, 150), "the second as the facts say"


def test_a_long_bus_does_not_fill_the_memory() -> None:
    panel = FieldPanel()
    for time in range(3 * KEPT):
        assert list(panel.take(float(time), HERE)) == []
    assert len(panel._recorder.recording.path) <= 2 * KEPT


def test_the_panel_fits_networks_with_a_place_and_a_goto() -> None:
    assert FieldPanel.fits(EurobotProtocol.load())
    assert not FieldPanel.fits(Protocol([]))


def test_the_needs_of_the_panels_script_are_data() -> None:
    setup = json.loads(json.dumps(FieldPanel.setup()))
    assert [each["name"] for each in setup["robots"]] == [OURS, "raw position", "enemy 1", "enemy 2", "confederate"]
    assert setup["view"] == "-200 -50 3280 2150"
    assert setup["legend"][0][0] == "place and angle of a goto"


def test_touches_and_points_of_the_truth_are_events() -> None:
    truth = Truth(
        [PathPoint(-1.0, 1, 2, 3), PathPoint(1.0, 200, 1800, 0)],
        [TouchMark(2.0, Point(620, 1400), "ours touched fire 1", True)],
        [Score(4.0, OURS, "frescos", 6)],
    )
    touch, points = truth_events(truth, FieldPanel.facts())
    assert (touch.time, touch.wrong, touch.mark, layers(touch)) == (2.0, True, "✶", {"marks": [(2.0, None)]})
    assert (points.time, points.text) == (4.0, "ours: frescos +6")
    (row,) = true_path(truth)
    assert (row["times"], row["values"]) == ([1.0], [[200], [1800], [0]])
    assert true_path(Truth()) == []
