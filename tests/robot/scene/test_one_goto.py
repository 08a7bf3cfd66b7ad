"""The picture of one goto: few lines, a sentence, and a legend of what is in it."""

from __future__ import annotations

from xml.etree import ElementTree

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import GotoXY, KalmanPositionResponse
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.scene.one_goto import longest, picture
from eurobot_od.robot.scene.recording import PathPoint, RecordedGoto, Recording

FACTS = robot_file.read()
WAY = [PathPoint(time, 100.0 + 100.0 * time, 1000.0, 0.0) for time in range(10)]
SHORT = RecordedGoto(1, 0.0, GotoXY(300, 1000, 0, 50), 2.0, Outcome.ARRIVED)
LONG = RecordedGoto(2, 2.0, GotoXY(900, 1000, 90, 75), 8.0, Outcome.ARRIVED)
FAILED = RecordedGoto(3, 8.0, GotoXY(3000, 2000, 0, 50), 9.0, Outcome.STOPPED)


def test_the_longest_goto_that_was_reached_is_the_one() -> None:
    assert longest([SHORT, LONG, FAILED], WAY) is LONG
    assert longest([FAILED], WAY) is None
    assert longest([SHORT], []) is None


def test_the_picture_has_a_sentence_the_way_and_a_legend() -> None:
    recording = Recording(paths={KalmanPositionResponse: WAY}, gotos=[SHORT, LONG, FAILED], end=9.0)
    drawn = ElementTree.fromstring(picture(recording, FACTS, LONG))
    texts = [each.text for each in drawn.iter("{http://www.w3.org/2000/svg}text")]
    assert "Goto 2: to x 900 mm, y 1000 mm, 90 deg, with 75 % speed; arrived after 6.0 s" in texts
    assert {"our robot", "the rest of the match", "where it began, and the way", "fire", "tree"} <= set(texts)
    assert "task: points at most, or f: fruit" in texts
    assert not any(text and text.startswith("barrier") for text in texts), "this goto has none"
    ways = [each.get("points", "").split() for each in drawn.iter("{http://www.w3.org/2000/svg}polyline")]
    assert sorted(map(len, ways)) == [7, 10]  # 2.0 to 8.0 s, and all of it
