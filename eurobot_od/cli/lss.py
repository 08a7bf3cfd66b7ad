"""The command `lss`: find CANopen devices before they have a node-ID, and configure them (CiA 305)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.options import BusOptions, Seconds
from eurobot_od.cli.signature import Option
from eurobot_od.client import lss as services
from eurobot_od.client.description import Identity
from eurobot_od.client.lss import LssSteps, perform
from eurobot_od.client.master import Master
from eurobot_od.errors import LocalError
from eurobot_od.od.lss import UNCONFIGURED, LssState
from eurobot_od.od.values import parse_number
from eurobot_od.support import durations
from eurobot_od.support.progress import SHORT, Unit, bar

REQUESTS = Unit("requests", "requests/s")

NUMBERS = 4
"""Numbers of an identity: vendor-ID, product code, revision and serial number."""


def _identity(text: str) -> Identity:
    """Read an identity; raises LocalError."""
    numbers = [parse_number(part) for part in text.split(":")]
    values = [each.value for each in numbers if each and not each.relative and 0 <= each.value < 1 << 32]
    if not len(values) == len(numbers) == NUMBERS:
        raise LocalError(f"{text!r} is not vendor:product:revision:serial, four numbers of 32 bits")
    return Identity(*values)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a device is to be given; None for what it keeps.

    node_id: set: 1..127, or 255 for none
    bit_rate: set: 1000, 800, 500, 250, 125, 50, 20 or 10
    store: set: have the device store its new settings
    activate: set: delay before the bit rate changes
    """

    node_id: Annotated[int | None, Option(metavar="N")] = None
    bit_rate: Annotated[int | None, Option(metavar="KBIT/S")] = None
    store: bool = False
    activate: Seconds | None = None

    def services(self) -> Iterator[tuple[LssSteps[None], str]]:
        """Give the services that set it, each with what it has done; raises LocalError."""
        if self.node_id is not None:
            yield services.configure_node_id(self.node_id), _node_id(self.node_id)
        if self.bit_rate is not None:
            yield services.configure_bit_rate(self.bit_rate), f"{self.bit_rate} kbit/s"
        if self.store:
            yield services.store(), "stored"
        if self.activate is not None:
            yield services.activate_bit_rate(self.activate), f"bit rate changes in {durations.text(self.activate)}"


def lss(
    action: Literal["find", "set"],
    *,
    identity: Annotated[
        Identity | None, Option(metavar="VENDOR:PRODUCT:REVISION:SERIAL", read=_identity, either="device")
    ] = None,
    alone: Annotated[bool, Option(either="device")] = False,
    settings: Settings,
    timeout: Seconds = 0.1,
    bus: BusOptions,
) -> ExitStatus:
    """Find CANopen devices that have no node-ID yet by LSS, and set node-ID and bit rate (CiA 305).

    `find` lists the devices without a node-ID, or prints the node-ID of the one with --identity. `set` is for that one,
    for the only device on the bus (--alone), or else for the first without a node-ID. Exit status 1 if there is no such
    device.

    identity: the device with this identity (0x1018)
    alone: the device is the only one on the bus
    timeout: longest wait for an answer (100 ms)
    """
    wanted = list(settings.services())  # checked before the first frame goes out
    if action == "set" and not wanted:
        raise LocalError("nothing to set: give --node-id, --bit-rate, --store or --activate")
    steps = _find(identity, alone) if action == "find" else _set(identity, alone, wanted)
    with Master(bus.open(), timeout) as master:
        try:
            with bar(f"lss {action}", unit=REQUESTS, after=SHORT) as progress:
                lines = perform(master, steps, timeout, progress)
        finally:
            # A device left in configuration state would obey the next command, whichever device that is for.
            perform(master, services.switch(LssState.WAITING))
    print("\n".join(lines) or "no device without a node-ID answers")
    return ExitStatus.FINE if lines else ExitStatus.FOUND


def _find(identity: Identity | None, alone: bool) -> LssSteps[list[str]]:
    if not (identity or alone):
        found = yield from services.find_all()
        return [f"{each}  no node-ID" for each in found]
    device = yield from _selected(identity, alone)
    node_id = yield from services.inquire_node_id()
    return [f"{device}  {_node_id(node_id)}"]


def _set(identity: Identity | None, alone: bool, wanted: Sequence[tuple[LssSteps[None], str]]) -> LssSteps[list[str]]:
    device = yield from _selected(identity, alone)
    for service, _ in wanted:
        yield from service
    return [f"{device}  {', '.join(done for _, done in wanted)}"]


def _selected(identity: Identity | None, alone: bool) -> LssSteps[str]:
    found = yield from services.chosen(identity, alone)
    return str(found or "the only device")


def _node_id(number: int) -> str:
    return "no node-ID" if number == UNCONFIGURED else f"node-ID {number}"
