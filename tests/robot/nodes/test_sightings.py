"""Where another robot is believed to be: what is unknown changes nothing, what is impossible is doubted."""

from __future__ import annotations

from eurobot_od.robot.model.messages import Enemy1PositionResponse
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.sightings import SPREAD, TOP_SPEED, Sighting, Track
from tests.rows import rows

Place = tuple[int | None, int | None]
UNKNOWN: Place = (None, None)
HERE, NEAR, FAR, FAR_TOO = (1000, 1000), (1000 + int(SPREAD), 1000), (2500, 300), (2510, 300)
DRIVEN = (1000 + int(SPREAD + 0.5 * TOP_SPEED), 1000)

CASES: list[tuple[list[Place], Place | None, float, str]] = [
    ([], None, 0.0, "never seen"),
    ([UNKNOWN], None, 0.0, "not seen"),
    ([FAR], FAR, 0.0, "the first place: there is none to doubt it by"),
    ([HERE, UNKNOWN], HERE, 0.0, "not seen now, but a moment ago"),
    ([HERE, DRIVEN], DRIVEN, 0.5, "as far as a robot can have driven"),
    ([HERE, (DRIVEN[0] + 1, 1000)], HERE, 0.0, "further than that"),
    ([HERE, FAR, NEAR], NEAR, 1.0, "an outlier, and it is seen again"),
    ([HERE, FAR, FAR_TOO], FAR_TOO, 1.0, "two that agree: it was put there"),
    ([HERE, FAR, UNKNOWN, FAR_TOO], FAR_TOO, 1.5, "unknown between them"),
    ([HERE, FAR, HERE, FAR], HERE, 1.0, "a good one between two outliers: the doubt has ended"),
]


@rows("places, expected, time, why", CASES)
def test_where_a_robot_is_believed_to_be(places: list[Place], expected: Place | None, time: float, why: str) -> None:
    track = Track()
    for number, (x, y) in enumerate(places):
        track.saw(Sighting(Enemy1PositionResponse(x, y, None, Source.ENEMY_1), 0.5 * number))
    assert track.last == (None if expected is None else (expected, time)), why
