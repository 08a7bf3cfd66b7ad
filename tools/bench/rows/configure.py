"""Configuring a live node, compared with stock canopen that writes the same objects one by one.

Both have the same node on the same in-process bus, with the same values beforehand. Our time includes reading for the
difference, reading back, storing, reset and verifying.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path

import can
import canopen

from bench.measure import Claim, Contender, Figures, Quantity, Scale, Series, Way
from bench.shared import new_bus, new_channel
from eurobot_od.bus.live import Live
from eurobot_od.client.configure import all_writes, configure, parameters
from eurobot_od.client.master import Master
from eurobot_od.od import dcf
from eurobot_od.od.dcf import Write
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, default_of, limits
from eurobot_od.od.values import Address, Value, pdo_of
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import ROLES

NODE = 2
BITRATE = 500
FEW = {(0x1403, 1): 0x18, (0x1603, 5): 0x20000602, (0x2101, 1): 900, (0x1017, 0): 333}
"""Goto XY under another COB-ID and with fewer reserved bits, a speed, and the heartbeat."""

TRANSMISSION_TYPE = 2
EVENT_DRIVEN = 255
"""Transmission type of each PDO that differs."""

SAME = (0x1016, 0x1029, 0x1F80, 0x210C)
"""Objects for which a node accepts only few values, and the match clock, which runs; they stay as delivered."""


def descriptions(folder: Path) -> dict[str, Dictionary]:
    """Write and read three DCFs with all parameters of the drive: as delivered, few different, all different."""
    eds = dialects.folder() / "drive.eds"
    dictionary = Dictionary.load(eds)
    delivered = {address_of(each): default_of(each) for each in parameters(dictionary)}
    kinds: dict[str, Mapping[Address, Value]] = {"delivered": {}, "few": FEW, "all": dict(other_values(dictionary))}
    files = {name: folder / f"{name}.dcf" for name in kinds}
    for name, file in files.items():
        file.write_text(dcf.with_values(dictionary.device, {**delivered, **kinds[name]}, NODE, "drive", BITRATE))
    return {name: Dictionary.load(file) for name, file in files.items()}


def other_values(dictionary: Dictionary) -> Iterator[tuple[Address, int]]:
    """Yield another value for each parameter that can have one; PDOs get another transmission type."""
    for each in parameters(dictionary):
        address = address_of(each)
        value = default_of(each)
        range_ = limits(each)
        if address == dictionary.device.node_id_address or each.index in SAME:
            continue
        if not isinstance(value, int) or range_ is None:
            continue
        if pdo_of(address[0]) is None:
            yield address, value + 1 if value < range_.high else int(range_.low)
        elif pdo_of(address[0]) == each.index and each.subindex == TRANSMISSION_TYPE:
            yield address, EVENT_DRIVEN


def stock(bus: can.BusABC, writes: Sequence[Write]) -> float:
    """Return the seconds in which stock canopen writes objects one by one."""
    network = canopen.Network(bus)
    network.NOTIFIER_CYCLE = 0.01
    network.connect()
    node = network.add_node(NODE, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    started = time.perf_counter()
    for (index, subindex), data in writes:
        node.sdo.download(index, subindex, data)
    seconds = time.perf_counter() - started
    network.disconnect()
    return seconds


def ours(bus: can.BusABC, description: Dictionary) -> float:
    """Return the seconds of a whole configuration."""
    with Master(bus) as master:
        started = time.perf_counter()
        configure(master.node(NODE), description, datetime(2014, 5, 28))
        return time.perf_counter() - started


@contextmanager
def opened(kind: str, _: Scale) -> Iterator[Mapping[str, Contender]]:
    """Run the drive, and yield both masters; the node has its delivered values before each measurement."""
    channel = new_channel()
    node = ROLES["drive"](dialects.load("drive"))
    with tempfile.TemporaryDirectory() as folder, Live.node(new_bus(channel), node):
        found = descriptions(Path(folder))
        delivered, writes = all_writes(found["delivered"]), all_writes(found[kind])

        def by_stock() -> Figures:
            stock(new_bus(channel), delivered)
            return {Quantity.TIME: stock(new_bus(channel), writes)}

        def by_ours() -> Figures:
            stock(new_bus(channel), delivered)
            return {Quantity.TIME: ours(new_bus(channel), found[kind])}

        yield {"stock": by_stock, "ours": by_ours}


def _series(kind: str) -> Series:
    name = f"configure, {kind} parameters differ"
    return Series(
        "configure", name, partial(opened, kind), (Claim(f"{name}: stock canopen", "ours", "stock", Way.RATIO, 1.2),)
    )


SERIES = (_series("few"), _series("all"))
