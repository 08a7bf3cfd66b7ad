"""Compares the PDO variables of stock canopen, `node.tpdo[4]["Goto XY.Speed"].raw`, with our bits.

Every PDO of every node is read, from the EDS files as they are; raw values are compared, since rounding could hide a
bit.
"""

from __future__ import annotations

import logging
import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import canopen

from eurobot_od.od.pdos import RESERVED
from eurobot_od.pdo.binding import Binding
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol
from interop_rows.row import Answer, agree

FRAMES = 200
"""Random frames for each PDO."""


def by_stock_pdos(_: Path) -> Answer:
    """Read random frames through canopen's PDO variables, and write their values into others."""
    found = list(stock_pdos(dialects.folder(dialects.DEFAULT)))
    for binding, pdo in found:
        compare(binding, pdo, FRAMES)
    said = f"{len(found)} PDOs of 3 nodes: {FRAMES} random frames of each read and written as by us"
    return Answer(f"{said}, those that leave out what is optional, too")


def compare(binding: Binding, pdo: Any, count: int) -> None:
    """Check that canopen reads and writes `count` frames of a message as we do; raises Differs."""
    for data in frames(binding, count):
        read(binding, pdo, data)
        write(binding, pdo, data)


def stock_pdos(folder: Path) -> Iterator[tuple[Binding, Any]]:
    """Yield every PDO of every node as we and as canopen have it; one without data has no variables."""
    protocol = EurobotProtocol.load(folder)
    for file in sorted(folder.glob("*.eds")):
        node: Any = canopen.Network().add_node(1, canopen.import_od(str(file), node_id=1))
        for pdos in (node.rpdo, node.tpdo):
            pdos.read(from_od=True)
            yield from ((protocol.binding_of(each.cob_id), each) for each in pdos.values())


def frames(binding: Binding, count: int) -> Iterator[bytes]:
    """Yield random frames of a message, of each permitted length in turn."""
    chance = random.Random(binding.name)
    for number in range(count):
        yield chance.randbytes(binding.lengths[number % len(binding.lengths)])


def read(binding: Binding, pdo: Any, data: bytes) -> None:
    """Check that canopen reads the same values, none for the fields that a short frame leaves out; raises Differs."""
    pdo.on_message(pdo.cob_id, bytearray(data), 0.0)
    left_out = binding.optional if len(data) < binding.layout.length else ()
    ours = [value for field, value in binding.unpack(data).items() if field not in left_out]
    theirs = [each.raw for each in _carrying(pdo)[: len(ours)]]
    agree(f"values of {binding.name} {data.hex()}", theirs, ours)


def write(binding: Binding, pdo: Any, data: bytes) -> None:
    """Check that canopen makes the frame `data` from its values, set in any order; raises Differs."""
    ours = binding.unpack(data)
    values = dict.fromkeys((each.name for each in pdo.map), 0)
    values |= zip((each.name for each in _carrying(pdo)), ours.values())
    pdo.data = bytearray(((1 << binding.layout.bits) - 1).to_bytes(binding.layout.length, "little"))
    with _without_warnings():
        for variable in random.Random(data).sample(pdo.map, len(pdo.map)):
            variable.raw = values[variable.name]
    agree(f"bytes of {binding.name} {ours}", bytes(pdo.data), binding.pack(ours))


def _carrying(pdo: Any) -> list[Any]:
    return [each for each in pdo.map if not each.name.endswith(f".{RESERVED}")]


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Switch off canopen's warning for each value over its limit."""
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
