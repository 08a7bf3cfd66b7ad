"""The servo drive of the documentation, as a test wants it: in simulated time, or on a bus inside the process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from interop_rows.bench import new_channel, open_bus

from eurobot_od.bus.live import Live
from eurobot_od.client.network import SimulatedNetwork, simulated
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary

DOCS = Path(__file__).parents[2] / "docs"
EDS, DCF = DOCS / "servo.eds", DOCS / "servo.dcf"
SERVO = Dictionary.load(EDS, 5)


@contextmanager
def servo(**options: Any) -> Iterator[SimulatedNetwork]:
    """Run the drive as node 5 in simulated time."""
    with simulated(SERVO, **options) as network:
        yield network


@contextmanager
def live_servos(*node_ids: int) -> Iterator[str]:
    """Run drives on a bus inside the process; gives its channel."""
    channel = new_channel()
    lives = [Live.node(open_bus(channel), SimulatedDevice(SERVO.renumbered(node_id))).start() for node_id in node_ids]
    try:
        yield channel
    finally:
        for each in lives:
            each.stop()
