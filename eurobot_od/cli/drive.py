"""The command `drive`: enable, home and move a drive of CiA 402 over SDO."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import ExitStatus, remote
from eurobot_od.cli import options as shared
from eurobot_od.cli.remote import Target
from eurobot_od.errors import LocalError
from eurobot_od.support import durations
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from eurobot_od.client.drive402 import Drive402, DriveStatus

LOOK = 0.5
"""Seconds from one line of `jog` to the next."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("action", choices=tuple(ACTIONS), help="what the drive is to do; Ctrl-C stops a motion")
    parser.add_argument("value", nargs="?", type=int, help="move: the position; jog: the velocity; in drive units")
    parser.add_argument("--velocity", type=int, metavar="V", help="move: profile velocity (default: as it is set)")
    parser.add_argument("--relative", action="store_true", help="move: by a way instead of to a position")
    parser.add_argument("--method", type=int, metavar="N", help="home: homing method (default: as it is set)")
    parser.add_argument("--axis", type=shared.whole(1, 8, what="an axis"), default=1, metavar="N", help="axis (1)")
    parser.add_argument(
        "--within", type=durations.seconds, default=60.0, metavar="TIME", help="longest wait for a motion (60 s)"
    )
    parser.add_argument("--for", dest="span", type=durations.seconds, metavar="TIME", help="jog: halt after this time")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> ExitStatus | None:
    """Do what is to be done, and print how the drive is then. Raises DriveError, NodeRefused, NoAnswer, BusError."""
    from eurobot_od.client.drive402 import Drive402

    _check(arguments)
    target = Target.of(arguments)
    with target.opened() as node:
        described = target.named_description(node)
        drive = Drive402(node, described.dictionary if described else None, arguments.axis)
        ACTIONS[arguments.action](drive, arguments)
        status = drive.status
    print(json.dumps(as_data(status)) if arguments.json else one_line(f"node {node.node_id}: {as_text(status)}"))
    return None


MOVING = {"move": "a position", "jog": "a velocity"}
"""The actions that need a value."""

OPTIONS = {"velocity": "move", "relative": "move", "method": "home", "span": "jog"}
"""The options that one action alone has."""


def _check(arguments: argparse.Namespace) -> None:
    action = arguments.action
    if (arguments.value is None) is (action in MOVING):
        raise LocalError(f"drive {action} needs {MOVING[action]}" if action in MOVING else f"{action} takes no value")
    for option, owner in OPTIONS.items():
        given = getattr(arguments, option)
        if given is not None and given is not False and action != owner:
            raise LocalError(f"--{'for' if option == 'span' else option} is for `drive {owner}`")


def _jog(drive: Drive402, arguments: argparse.Namespace) -> None:
    """Turn until Ctrl-C, or the end of its time, and halt; print where it is meanwhile."""
    end = None if arguments.span is None else time.monotonic() + arguments.span
    try:
        drive.velocity = arguments.value
        while end is None or time.monotonic() < end:
            print(one_line(as_text(drive.status)), flush=True)
            time.sleep(LOOK if end is None else max(0.0, min(LOOK, end - time.monotonic())))
    finally:
        drive.halt()


def _move(drive: Drive402, arguments: argparse.Namespace) -> None:
    drive.move_to(arguments.value, arguments.velocity, relative=arguments.relative, within=arguments.within)


ACTIONS: Mapping[str, Callable[[Drive402, argparse.Namespace], object]] = {
    "status": lambda *_: None,
    "enable": lambda drive, _: drive.enable(),
    "disable": lambda drive, _: drive.disable(),
    "home": lambda drive, arguments: drive.home(arguments.method, arguments.within),
    "move": _move,
    "jog": _jog,
    "stop": lambda drive, _: drive.quick_stop(),
    "reset": lambda drive, _: drive.fault_reset(),
}
"""What a drive can be told to do."""


def as_data(status: DriveStatus) -> dict[str, Any]:
    """Return how a drive is as plain data."""
    from eurobot_od.profiles.cia402 import MODE_WORDS

    state = status.state.words if status.state else None
    return {**status._asdict(), "state": state, "mode": MODE_WORDS.get(status.mode, f"mode {status.mode}")}


def as_text(status: DriveStatus) -> str:
    """Write how a drive is on one line."""
    data = as_data(status)
    fault = f", error code 0x{status.error_code:04X}" if status.error_code else ""
    place = f"position {status.position}, velocity {status.velocity}"
    return f"{data['state'] or 'no state'}{fault}, {data['mode']}, {place} (statusword 0x{status.statusword:04X})"
