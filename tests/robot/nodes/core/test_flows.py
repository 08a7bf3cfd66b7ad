"""Why a goto is not possible, as far as the core can tell."""

from __future__ import annotations

import pytest

from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import GotoXY
from eurobot_od.robot.model.values import Barriers, Passage
from eurobot_od.robot.nodes.core.flows import why_not_possible

FACTS = robot_file.read(robot_file.file_for(dialects.load("drive").file))
FORCED_POOL = Barriers.of({7: Passage.FORCED})
REASONS = {
    "speed": (GotoXY(900, 900, 0, 0), "at speed 0 no place is reached"),
    "field": (GotoXY(900, 2001, 0, 50), "(900, 2001) is outside the field of 3000 x 2000 mm"),
    "barrier": (GotoXY(900, 900, 0, 50, FORCED_POOL), "(900, 900) is inside pool 1, which is forced"),
    "a barrier that may be crossed": (GotoXY(900, 900, 0, 50, Barriers.of({7: Passage.NORMAL})), "no way there"),
    "a place beside a barrier": (GotoXY(900, 1060, 0, 50, FORCED_POOL), "no way there"),
}


@pytest.mark.parametrize(("goto", "why"), REASONS.values(), ids=REASONS.keys())
def test_a_goto_that_is_not_possible_has_a_reason(goto: GotoXY, why: str) -> None:
    assert why_not_possible(FACTS, goto).startswith(why)
