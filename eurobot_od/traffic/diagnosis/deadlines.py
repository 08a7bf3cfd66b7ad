"""Watches PDOs that their receivers expect in time, by event timer or emergency (CiA 301, 7.5.2.35)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from eurobot_od.client.watch import LATE_AFTER
from eurobot_od.frame import identifier_text
from eurobot_od.od import values
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import PdoDirection
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Watcher, brief
from eurobot_od.traffic.diagnosis.pdos import LEAST_SILENCE, StreamWatcher
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.services import EMCY_NAME

RPDO_BASES = values.DEFAULT_PDO_BASES[PdoDirection.RPDO]
"""COB-IDs of the first RPDOs, without the node-ID (CiA 301, 7.3.3)."""


class Deadline(NamedTuple):
    """An RPDO with an event timer: its receiver, its name, and the timer in s."""

    receiver: ObservedNode
    name: str
    timer: float


class DeadlineWatcher(Watcher):
    """Watches PDOs with a deadline; `streams` has the time of the last frame of each."""

    SERVICES = (EMCY_NAME,)

    def __init__(self, bus: ObservedBus, streams: StreamWatcher) -> None:
        super().__init__(bus)
        self._streams = streams
        self._decoder: Decoder | None = None
        self._expected: dict[int, Deadline] = {}
        self._late: set[int] = set()

    def take(self, time: float, meaning: Meaning) -> None:
        said = meaning.fields
        if said.get("code") != ErrorCode.PDO_MISSING:
            return
        node = self.bus.node(said["node"])
        for cob_id, name, last, period in self._streams.silent(time):
            if cob_id in self._identifiers(node):
                text = f"{name} is not refreshed: it came every {brief(period)} (observed), and last at {last:.3f} s"
                self._report(cob_id, node, text)

    def _identifiers(self, node: ObservedNode) -> set[int]:
        """Return the COB-IDs of a node's RPDOs from its file, or else the predefined ones."""
        bindings = self.bus.decoder.protocol.bindings
        known = {each.cob_id for each in bindings if node.name in each.receivers}
        return known or {base + node.node_id for base in RPDO_BASES}

    def _report(self, cob_id: int, node: ObservedNode, text: str) -> None:
        if cob_id not in self._late:
            self._late.add(cob_id)
            self.bus.found(BusRule.PDO_DEADLINE, node.name, text, cob_id)

    def tick(self, time: float) -> None:
        if self._decoder is not self.bus.decoder:
            self._decoder = self.bus.decoder
            self._expected = dict(self._timers())
        for cob_id, (receiver, name, timer) in self._expected.items():
            last = self._streams.last(cob_id)
            if last is None or time - last < max(LATE_AFTER * timer, LEAST_SILENCE):
                self._late.discard(cob_id)
            elif receiver.is_operational and self.bus.commanded < last:
                text = f"{name} (0x{identifier_text(cob_id)}) is not refreshed: event timer {brief(timer)}"
                self._report(cob_id, receiver, f"{text}, last at {last:.3f} s")

    def _timers(self) -> Iterator[tuple[int, Deadline]]:
        """Yield the RPDOs with an event timer by COB-ID."""
        for device in (*self.bus.decoder.dictionaries, *self.bus.decoder.learned):
            for pdo in device.read_pdos(device.default, lambda _: None, listening=True):
                if pdo.direction is PdoDirection.RPDO and pdo.valid and pdo.event_timer:
                    node = self.bus.node(device.node_id)
                    yield pdo.cob_id, Deadline(node, f"{node.name}.{pdo.key}", pdo.event_timer / 1000)
