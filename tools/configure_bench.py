"""Measures what configuring a node costs, against stock canopen writing the same objects one by one.

Rule of this file: both have the same node on the same in-process bus, turn by turn, from the same former values; the
median of the turns counts. Reading for the difference, reading back, storing, reset and verifying are all in.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

import can
import canopen

from eurobot_od import dcf, dialects, runtime
from eurobot_od.cli.export_cdcf import concise
from eurobot_od.client.configure import configure, settings
from eurobot_od.client.description import Description, from_file
from eurobot_od.client.master import Master
from eurobot_od.client.objects import integer_range
from eurobot_od.client.pdo_order import Step, pdo_of
from eurobot_od.client.reading import parameters
from eurobot_od.dictionary import NODE_ID, Address
from eurobot_od.nodes import ROLES

CHANNEL = "configure bench"
NODE = 2
BITRATE = 500
FEW = {(0x1403, 1): 0x18, (0x1603, 1): 0x20000110, (0x2101, 1): 900, (0x1017, 0): 333}
"""Goto XY under another COB-ID and with 16 bits for x, a speed, and the heartbeat."""

TRANSMISSION_TYPE = 2
EVENT_DRIVEN = 255
"""Of every PDO that differs."""

SAME = (0x1016, 0x1029, 0x1F80)
"""Objects that have few values that a node takes."""


def bus() -> can.BusABC:
    """Open one end of the in-process bus."""
    return can.Bus(interface="virtual", channel=CHANNEL)


def descriptions(folder: Path) -> dict[str, Description]:
    """Write and read three DCFs with all parameters of the drive: as delivered, few different, all different."""
    eds = dialects.folder() / "drive.eds"
    dictionary = from_file(eds).dictionary
    delivered = {thing.address: dictionary.default(thing.address) for thing in parameters(dictionary)}
    kinds = {"delivered": {}, "few": FEW, "all": dict(other_values(from_file(eds)))}
    files = {name: folder / f"{name}.dcf" for name in kinds}
    for name, file in files.items():
        file.write_text(dcf.with_values(eds.read_text(), delivered | kinds[name], NODE, "drive", BITRATE))
    return {name: from_file(file) for name, file in files.items()}


def other_values(description: Description) -> Iterator[tuple[Address, int]]:
    """Give another value to every parameter that can have any; PDOs another transmission type."""
    for thing in parameters(description.dictionary):
        value = description.dictionary.default(thing.address)
        if thing.address == NODE_ID or thing.address[0] in SAME or thing.variable is None or not isinstance(value, int):
            continue
        if pdo_of(thing.address) is None:
            low, high = integer_range(thing.variable)
            yield thing.address, value + 1 if value < high else low
        elif pdo_of(thing.address) == thing.address[0] and thing.address[1] == TRANSMISSION_TYPE:
            yield thing.address, EVENT_DRIVEN


def stock(writes: Sequence[Step]) -> float:
    """Return the seconds in which stock canopen writes objects one by one."""
    network = canopen.Network(bus())
    network.NOTIFIER_CYCLE = 0.01
    network.connect()
    node = network.add_node(NODE, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    started = time.perf_counter()
    for (index, subindex), data in writes:
        node.sdo.download(index, subindex, data)
    seconds = time.perf_counter() - started
    network.disconnect()
    return seconds


def ours(description: Description) -> float:
    """Return the seconds of a whole configuration."""
    with Master(bus()) as master:
        started = time.perf_counter()
        configure(master.node(NODE), description, datetime(2014, 5, 28))
        return time.perf_counter() - started


def measure(turns: int, found: dict[str, Description]) -> None:
    """Print the medians and their ratio, for few and for all objects different."""
    print(f"{len(settings(found['all']))} parameters")
    writes = {name: concise(description) for name, description in found.items()}
    for name in ("few", "all"):
        times: dict[str, list[float]] = {"stock": [], "ours": []}
        for _ in range(turns):
            stock(writes["delivered"])
            times["stock"].append(stock(writes[name]))
            stock(writes["delivered"])
            times["ours"].append(ours(found[name]))
        theirs, own = (statistics.median(times[side]) * 1000 for side in ("stock", "ours"))
        print(f"{name} differ: stock canopen {theirs:.1f} ms, configure {own:.1f} ms, ratio {own / theirs:.2f}")


def main() -> None:
    """Run the bench."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--turns", type=int, default=15, metavar="N", help="how often each is measured (15)")
    turns: int = parser.parse_args().turns
    node = ROLES["drive"](dialects.load("drive"))
    with tempfile.TemporaryDirectory() as folder, runtime.Live.node(bus(), node):
        measure(turns, descriptions(Path(folder)))


if __name__ == "__main__":
    main()
