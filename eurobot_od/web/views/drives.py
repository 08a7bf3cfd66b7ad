"""Requests of the view Drives, which orders drives of CiA 402."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from eurobot_od.client.motion import GIVE_UP, AxisAddress
from eurobot_od.errors import DriveError, LocalError
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of, whole_of
from eurobot_od.web.desk import Desk
from eurobot_od.web.drives import LOOK, STALE, STOPS


def _axis(desk: Desk, said: Arguments) -> AxisAddress:
    return desk.drives.axis(desk.node_id(text_of(said, "node")), said.get("axis"))


async def drive(desk: Desk, said: Arguments) -> str | None:
    """Carry out a command of a drive; a stop returns when the axis stands."""
    numbers = {name: whole_of(said, name) for name in ("position", "distance", "velocity", "method") if name in said}
    command = text_of(said, "command")
    axis = _axis(desk, said)
    if command in STOPS:
        return await _stop_axis(desk, axis, command)
    missing = {"move": "position", "move by": "distance"}.get(command)
    if missing and missing not in numbers:
        raise LocalError(f"{missing} is missing")
    await _order(desk, said, axis, partial(desk.drives.command, axis, command, numbers, said["who"]))
    return None


async def _stop_axis(desk: Desk, axis: AxisAddress, command: str) -> str:
    desk.drives.stop(axis, STOPS[command])
    begun = desk.session.now
    while (stop := desk.drives.stopping(axis)) is not None and desk.session.now < begun + GIVE_UP:
        await asyncio.sleep(LOOK)
    if stop is not None:
        raise DriveError(f"{command}: not known to stand: {stop.text(desk.session.now)}")
    return f"{command}: it stands"


async def _order(desk: Desk, said: Arguments, axis: AxisAddress, order: Callable[..., None]) -> None:
    """Carry out an order in its turn; one that comes too late, or after a stop, is refused."""
    seen = said.get("seen")
    if isinstance(seen, (int, float)) and desk.session.now - seen > STALE:
        raise LocalError(f"the page was {desk.session.now - seen:.1f} s behind the bus: not carried out")
    await desk.in_turn([axis], order)


async def jog(desk: Desk, said: Arguments) -> None:
    """Turn a drive as long as the page reports the button as held."""
    target = "torque" if "torque" in said else "velocity"
    axis = _axis(desk, said)
    value = whole_of(said, target)
    desk.drives.hold(axis, said["who"])
    await _order(desk, said, axis, partial(desk.drives.jog, axis, value, target, said["who"]))


def hold(desk: Desk, said: Arguments) -> None:
    """Prolong a motion: the button of a jog is held, the page of a move is visible."""
    desk.drives.hold(_axis(desk, said), said["who"])


def hidden(desk: Desk, said: Arguments) -> None:
    """Stop the drives that a page moves, as it is hidden."""
    desk.drives.left(said["who"])


def accept(desk: Desk, said: Arguments) -> None:
    """Accept that a drive goes on if this program fails."""
    desk.drives.accept(_axis(desk, said).node_id)


REQUESTS = {
    "drive": PageRequest(drive, Way.ORDERS, acts=True),
    "jog": PageRequest(jog, Way.ORDERS, acts=True),
    "accept": PageRequest(accept, Way.AT_ONCE, acts=True),
    "hidden": PageRequest(hidden, Way.AT_ONCE, acts=True),
    "hold": PageRequest(hold, Way.AT_ONCE, acts=True),
}
