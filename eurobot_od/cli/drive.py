"""The command `drive`: enable, home and move a drive of CiA 402 over SDO."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import Annotated, Any, NamedTuple

from eurobot_od.cli.devices import Target
from eurobot_od.cli.options import Json, Seconds, whole
from eurobot_od.cli.signature import Option
from eurobot_od.client.drive402 import Drive402, DriveStatus
from eurobot_od.errors import LocalError
from eurobot_od.od.cia402 import MODE_WORDS
from eurobot_od.support.texts import one_line

LOOK = 0.5
"""Seconds from one line of `jog` to the next."""


class MotionRequest(NamedTuple):
    """What a drive is asked for, in its own units; `value` is a position or a velocity, times are in seconds."""

    value: int
    velocity: int | None
    relative: bool
    method: int | None
    within: float
    span: float | None


def _jog(drive: Drive402, asked: MotionRequest) -> None:
    """Turn until Ctrl-C, or the end of its time, and halt; print where it is meanwhile."""
    end = None if asked.span is None else time.monotonic() + asked.span
    try:
        drive.velocity = asked.value
        while end is None or time.monotonic() < end:
            print(one_line(as_text(drive.status)), flush=True)
            time.sleep(LOOK if end is None else max(0.0, min(LOOK, end - time.monotonic())))
    finally:
        drive.halt()


ACTIONS: Mapping[str, Callable[[Drive402, MotionRequest], object]] = {
    "status": lambda *_: None,
    "enable": lambda drive, _: drive.enable(),
    "disable": lambda drive, _: drive.disable(),
    "home": lambda drive, asked: drive.home(asked.method, asked.within),
    "move": lambda drive, asked: drive.move_to(
        asked.value, asked.velocity, relative=asked.relative, within=asked.within
    ),
    "jog": _jog,
    "stop": lambda drive, _: drive.quick_stop(),
    "reset": lambda drive, _: drive.fault_reset(),
}
"""What a drive can be told to do."""


def drive(
    target: Target,
    action: Annotated[str, Option(choices=ACTIONS.keys())],
    value: int | None = None,
    *,
    velocity: Annotated[int | None, Option(metavar="V")] = None,
    relative: bool = False,
    method: Annotated[int | None, Option(metavar="N")] = None,
    axis: Annotated[int, Option(metavar="N", read=whole(1, 8, what="an axis"))] = 1,
    within: Seconds = 60.0,
    span: Annotated[Seconds | None, Option("--for")] = None,
    as_json: Json = False,
) -> None:
    """Enable, home and move a drive of CiA 402 over SDO, and print how it is then.

    Raises DriveError, NodeRefused, NoAnswer, BusError.

    action: what the drive is to do; Ctrl-C stops a motion
    value: move: the position; jog: the velocity; in drive units
    velocity: move: profile velocity (default: as it is set)
    relative: move: by a distance instead of to a position
    method: home: homing method (default: as it is set)
    axis: axis (1)
    within: longest wait for a motion (60 s)
    span: jog: halt after this time

    $ drive 5 status -i socketcan -c can1
    $ drive 5 move 4000 --velocity 500 -i socketcan -c can1
    """
    _check(action, value, {"velocity": velocity, "relative": relative, "method": method, "span": span})
    with target.opened() as node:
        described = target.named_description(node)
        found = Drive402(node, described.dictionary if described else None, axis)
        ACTIONS[action](found, MotionRequest(value or 0, velocity, relative, method, within, span))
        status = found.status
    print(json.dumps(as_data(status)) if as_json else one_line(f"node {node.node_id}: {as_text(status)}"))


MOVING = {"move": "a position", "jog": "a velocity"}
"""The actions that need a value."""

OPTIONS = {"velocity": "move", "relative": "move", "method": "home", "span": "jog"}
"""The options that one action alone has."""


def _check(action: str, value: int | None, given: Mapping[str, object]) -> None:
    """Raise LocalError for a value that is missing or too much, and for an option of another action."""
    if (value is None) is (action in MOVING):
        raise LocalError(f"drive {action} needs {MOVING[action]}" if action in MOVING else f"{action} takes no value")
    for name, owner in OPTIONS.items():
        # A velocity or method of 0 has been given, too: not so what is None, or a switch that is off.
        if given[name] is not None and given[name] is not False and action != owner:
            raise LocalError(f"--{'for' if name == 'span' else name} is for `drive {owner}`")


def as_data(status: DriveStatus) -> dict[str, Any]:
    """Return how a drive is as plain data."""
    state = status.state.words if status.state else None
    return {**status._asdict(), "state": state, "mode": MODE_WORDS.get(status.mode, f"mode {status.mode}")}


def as_text(status: DriveStatus) -> str:
    """Write how a drive is on one line."""
    data = as_data(status)
    fault = f", error code 0x{status.error_code:04X}" if status.error_code else ""
    place = f"position {status.position}, velocity {status.velocity}"
    return f"{data['state'] or 'no state'}{fault}, {data['mode']}, {place} (statusword 0x{status.statusword:04X})"
