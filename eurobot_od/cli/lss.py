"""Find CANopen devices by LSS, and give them node-ID and bit rate (CiA 305): before they have any.

`find` lists the devices without a node-ID, or tells the node-ID of the one with --identity. `set` is for that one, for
the only device on the bus (--alone), or else for the first without a node-ID.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.cli.progress import SHORT, Unit, bar
from eurobot_od.errors import LocalError, RemoteError
from eurobot_od.od.values import parse_number
from eurobot_od.support import durations

if TYPE_CHECKING:
    from eurobot_od.client.description import Identity
    from eurobot_od.client.lss import LssSteps

REQUESTS = Unit("requests", "requests/s", 1)

NUMBERS = 4
"""Of an identity: vendor-ID, product code, revision and serial number."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("action", choices=("find", "set"))
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--identity", type=_identity, metavar="VENDOR:PRODUCT:REVISION:SERIAL", help="as in 0x1018")
    which.add_argument("--alone", action="store_true", help="the device is the only one on the bus")
    parser.add_argument("--node-id", type=int, metavar="N", help="set: 1..127, or 255 for none")
    parser.add_argument("--bit-rate", type=int, metavar="KBIT/S", help="set: 1000, 800, 500, 250, 125, 50, 20 or 10")
    parser.add_argument("--store", action="store_true", help="set: have the device keep what it was given")
    parser.add_argument(
        "--activate", type=durations.seconds, metavar="TIME", help="set: change to the bit rate after this time"
    )
    parser.add_argument(
        "--timeout", type=durations.seconds, default=0.1, metavar="TIME", help="longest wait for an answer (100 ms)"
    )
    shared.add_bus(parser)


def _identity(text: str) -> tuple[int, ...]:
    numbers = [parse_number(part) for part in text.split(":")]
    values = tuple(each.value for each in numbers if each and not each.relative and 0 <= each.value < 1 << 32)
    if not len(values) == len(numbers) == NUMBERS:
        raise argparse.ArgumentTypeError(f"{text!r} is not vendor:product:revision:serial, four numbers of 32 bits")
    return values


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Find or set; 1 if there is no such device."""
    from eurobot_od.client.lss import LssState, perform, switch
    from eurobot_od.client.master import Master

    action = ACTIONS[arguments.action](arguments)
    with Master(shared.open_bus(arguments), arguments.timeout) as master:
        try:
            with bar(f"lss {arguments.action}", unit=REQUESTS, after=SHORT) as progress:
                lines = perform(master, action, arguments.timeout, progress)
        finally:
            perform(master, switch(LssState.WAITING))
    print("\n".join(lines) or "no device without a node-ID answers")
    return ExitStatus.FINE if lines else ExitStatus.FOUND


def _find(arguments: argparse.Namespace) -> LssSteps[list[str]]:
    from eurobot_od.client.lss import find_all, inquire_node_id

    if not (arguments.identity or arguments.alone):
        found = yield from find_all()
        return [f"{_words(each)}  no node-ID" for each in found]
    who = yield from _chosen(arguments)
    node_id = yield from inquire_node_id()
    return [f"{who}  {_node_id(node_id)}"]


def _set(arguments: argparse.Namespace) -> LssSteps[list[str]]:
    """Return the services that are asked for, checked before the first frame goes out."""
    from eurobot_od.client import lss

    services = {
        "node_id": lss.configure_node_id,
        "bit_rate": lss.configure_bit_rate,
        "store": lambda _: lss.store(),
        "activate": lss.activate_bit_rate,
    }
    given = {name: getattr(arguments, name) for name in services}
    wanted = {name: value for name, value in given.items() if value is not None and value is not False}
    if not wanted:
        raise LocalError("nothing to set: give --node-id, --bit-rate, --store or --activate")
    return _all_set(arguments, [services[name](value) for name, value in wanted.items()], ", ".join(_done(wanted)))


def _all_set(arguments: argparse.Namespace, services: list[LssSteps[None]], done: str) -> LssSteps[list[str]]:
    who = yield from _chosen(arguments)
    for each in services:
        yield from each
    return [f"{who}  {done}"]


ACTIONS = {"find": _find, "set": _set}


def _done(wanted: dict[str, float]) -> Iterator[str]:
    if "node_id" in wanted:
        yield _node_id(int(wanted["node_id"]))
    if "bit_rate" in wanted:
        yield f"{wanted['bit_rate']} kbit/s"
    if "store" in wanted:
        yield "stored"
    if "activate" in wanted:
        yield f"bit rate changes in {durations.text(wanted['activate'])}"


def _chosen(arguments: argparse.Namespace) -> LssSteps[str]:
    """Put the device that is meant into configuration state and say which it is; raises RemoteError without one."""
    from eurobot_od.client.description import Identity
    from eurobot_od.client.lss import LssState, fastscan, select, switch

    if arguments.alone:
        yield from switch(LssState.CONFIGURATION)
        return "the only device"
    if arguments.identity:
        identity = Identity(*arguments.identity)
        found = identity if (yield from select(identity)) else None
        missing = f"no device has the identity {_words(identity)}"
    else:
        yield from switch(LssState.WAITING)
        found, missing = (yield from fastscan()), "no device without a node-ID answers"
    if found is None:
        raise RemoteError(missing)
    return _words(found)


def _words(identity: Identity) -> str:
    return ":".join(f"0x{number:08X}" for number in identity)


def _node_id(number: int) -> str:
    from eurobot_od.client.lss import UNCONFIGURED

    return "no node-ID" if number == UNCONFIGURED else f"node-ID {number}"
