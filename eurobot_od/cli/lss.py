"""The command `lss`: find CANopen devices before they have a node-ID, and configure them (CiA 305)."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.table import BUS, CommandRow, Parameter, option
from eurobot_od.errors import LocalError
from eurobot_od.od.values import parse_number
from eurobot_od.support import durations
from eurobot_od.support.progress import SHORT, Unit, bar

if TYPE_CHECKING:
    from eurobot_od.bus.live.connection import Opener
    from eurobot_od.client.description import Identity
    from eurobot_od.client.lss import LssSteps

REQUESTS = Unit("requests", "requests/s")

NUMBERS = 4
"""Of an identity: vendor-ID, product code, revision and serial number."""


def lss(
    action: str, identity: Identity | None, alone: bool, timeout: float, open_bus: Opener, **settings: Any
) -> ExitStatus:
    """Find CANopen devices that have no node-ID yet by LSS, and set node-ID and bit rate (CiA 305).

    `find` lists the devices without a node-ID, or prints the node-ID of the one with --identity. `set` is for that one,
    for the only device on the bus (--alone), or else for the first without a node-ID. Exit status 1 if there is no such
    device.
    """
    from eurobot_od.client.lss import perform, switch
    from eurobot_od.client.master import Master
    from eurobot_od.od.lss import LssState

    steps = _find(identity, alone) if action == "find" else _set(identity, alone, settings)
    with Master(open_bus(), timeout) as master:
        try:
            with bar(f"lss {action}", unit=REQUESTS, after=SHORT) as progress:
                lines = perform(master, steps, timeout, progress)
        finally:
            # A device left in configuration state would obey the next command, whichever device that is for.
            perform(master, switch(LssState.WAITING))
    print("\n".join(lines) or "no device without a node-ID answers")
    return ExitStatus.FINE if lines else ExitStatus.FOUND


def _find(identity: Identity | None, alone: bool) -> LssSteps[list[str]]:
    from eurobot_od.client.lss import find_all, inquire_node_id

    if not (identity or alone):
        found = yield from find_all()
        return [f"{each}  no node-ID" for each in found]
    device = yield from _selected(identity, alone)
    node_id = yield from inquire_node_id()
    return [f"{device}  {_node_id(node_id)}"]


def _set(identity: Identity | None, alone: bool, settings: Mapping[str, Any]) -> LssSteps[list[str]]:
    """Return the services that are asked for, checked before the first frame goes out."""
    from eurobot_od.client import lss

    services: dict[str, tuple[Callable[[Any], LssSteps[None]], Callable[[Any], str]]] = {
        "node_id": (lss.configure_node_id, _node_id),
        "bit_rate": (lss.configure_bit_rate, "{} kbit/s".format),
        "store": (lambda _: lss.store(), lambda _: "stored"),
        "activate": (lss.activate_bit_rate, lambda delay: f"bit rate changes in {durations.text(delay)}"),
    }
    # False is --store that is not given; 0 is a value, such as a bit rate that changes at once.
    wanted = {name: value for name in services if (value := settings[name]) is not None and value is not False}
    if not wanted:
        raise LocalError("nothing to set: give --node-id, --bit-rate, --store or --activate")
    steps = [services[name][0](value) for name, value in wanted.items()]
    # A generator of its own, as this function has to raise before a bus is opened.
    return _all_set(identity, alone, steps, ", ".join(services[name][1](value) for name, value in wanted.items()))


def _all_set(
    identity: Identity | None, alone: bool, services: Sequence[LssSteps[None]], done: str
) -> LssSteps[list[str]]:
    device = yield from _selected(identity, alone)
    for each in services:
        yield from each
    return [f"{device}  {done}"]


def _selected(identity: Identity | None, alone: bool) -> LssSteps[str]:
    from eurobot_od.client.lss import chosen

    found = yield from chosen(identity, alone)
    return str(found or "the only device")


def _node_id(number: int) -> str:
    from eurobot_od.od.lss import UNCONFIGURED

    return "no node-ID" if number == UNCONFIGURED else f"node-ID {number}"


def _identity(text: str) -> Identity:
    from eurobot_od.client.description import Identity

    numbers = [parse_number(part) for part in text.split(":")]
    values = [each.value for each in numbers if each and not each.relative and 0 <= each.value < 1 << 32]
    if not len(values) == len(numbers) == NUMBERS:
        raise argparse.ArgumentTypeError(f"{text!r} is not vendor:product:revision:serial, four numbers of 32 bits")
    return Identity(*values)


def _add_device(parser: argparse.ArgumentParser) -> None:
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--identity",
        type=_identity,
        metavar="VENDOR:PRODUCT:REVISION:SERIAL",
        help="the device with this identity (0x1018)",
    )
    which.add_argument("--alone", action="store_true", help="the device is the only one on the bus")


COMMANDS = {
    "lss": CommandRow(
        lss,
        option("action", choices=("find", "set")),
        Parameter("identity", _add_device, lambda arguments: arguments.identity),
        Parameter("alone", lambda _: None, lambda arguments: arguments.alone),
        option("--node-id", type=int, metavar="N", help="set: 1..127, or 255 for none"),
        option("--bit-rate", type=int, metavar="KBIT/S", help="set: 1000, 800, 500, 250, 125, 50, 20 or 10"),
        option("--store", action="store_true", help="set: have the device store its new settings"),
        option("--activate", type=durations.seconds, metavar="TIME", help="set: delay before the bit rate changes"),
        option(
            "--timeout", type=durations.seconds, default=0.1, metavar="TIME", help="longest wait for an answer (100 ms)"
        ),
        BUS,
    )
}
