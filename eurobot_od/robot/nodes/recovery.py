"""After a node was lost: is the drive where it was seen last, or does it only believe in its start place?

A drive that has booted says "unknown", and after its configuration its team's start place, wherever it stands. Driven
from there, it would be off by as much as it had come since the start. So the navigation has to see it first.
"""

from __future__ import annotations

from eurobot_od.device.flow import Pause, Script
from eurobot_od.errors import StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place, is_near
from eurobot_od.robot.nodes.goto import drive_position
from eurobot_od.robot.nodes.node import CoreSettings

ANY_ANGLE = 180.0
"""Two headings are never further apart, degrees."""

AT_START = 50.0
"""A drive so near its start place, mm, after its configuration may not have been seen by the navigation since."""

LOOKS = 3
"""How often the navigation is asked for a drive that has booted, which believes it when two positions agree: one of
them may be unknown, or wrong."""

LOST_PLACE = "the drive has lost its place"


class PlaceLost(StateError):
    """A drive that is not where it was seen last; it has to be put at its start place, and the start configured."""


def find_place(core: CoreSettings, there: Place | None, start: Place) -> Script[messages.KalmanPositionResponse]:
    """Have the navigation look where the drive is, and see that it is where it was seen last; `there`, if it was.

    Raises PlaceLost if it is elsewhere, or so near its `start` place that nobody may have seen it there; NoAnswer.
    """
    for _ in range(LOOKS):
        core.offer(messages.NaviPositionRequest())
        # The drive hears the answers itself (document 4.2.2 Navigation), so there is nothing to wait for here.
        yield Pause(core.state_request_period)
    here = yield from drive_position(core)
    if there is None:
        return here
    moved = not is_near(there, here[:3], core.displacement, ANY_ANGLE)
    unseen = is_near(start, here[:3], AT_START, ANY_ANGLE) and not is_near(start, there, AT_START, ANY_ANGLE)
    if moved or unseen:
        text = f"it was last seen at {there[:2]}, and is at {here[:2]} now; configure the start"
        raise PlaceLost(f"{LOST_PLACE}: {text}")
    return here
