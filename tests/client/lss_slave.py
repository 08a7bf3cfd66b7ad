"""The device's side of LSS as a station of its own, without the rest of a device; and slaves that do it otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from types import MappingProxyType

from eurobot_od.device.lss import Commissioning, LssSlave
from eurobot_od.frame import Frame
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import BIT_RATES, LssState

WAITING, CONFIGURATION = LssState
ANSWERS, REQUESTS = 0x7E4, 0x7E5


class LssStation:
    """A station; `errors` are what it answers to commands that it refuses.

    One that is `always_scanned` says yes to every fastscan while it is being configured, as CANopenNode's does.
    """

    next_wakeup = inf

    def __init__(
        self,
        identity: Identity,
        node_id: int = 255,
        errors: Mapping[int, tuple[int, int]] = MappingProxyType({}),
        always_scanned: bool = False,
    ) -> None:
        self.identity, self.errors, self.always_scanned = identity, errors, always_scanned
        self.slave = LssSlave(identity, Commissioning(node_id, 500), tuple(BIT_RATES))

    @property
    def state(self) -> LssState:
        return self.slave.state

    @property
    def node_id(self) -> int:
        return self.slave.active.node_id

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        answer = self._answer(frame.data, now) if frame.cob_id == REQUESTS else None
        if self.slave.needs_boot:
            self.slave.activate()
        return [] if answer is None else [Frame(ANSWERS, answer.ljust(8, b"\0"))]

    def _answer(self, data: bytes, now: float) -> bytes | None:
        command, is_configured = data[0], self.state == CONFIGURATION
        if is_configured and command in self.errors:
            return bytes([command, *self.errors[command]])
        if is_configured and command == 0x51 and self.always_scanned:
            return b"\x4f"
        return self.slave.receive(data, now)

    def tick(self, now: float) -> list[Frame]:
        return []


class StatelessStation(LssStation):
    """Compares one part of its identity alone, whatever the others were: it keeps no position."""

    def _answer(self, data: bytes, now: float) -> bytes | None:
        if data[0] == 0x51:
            self.slave._position = data[6]
        return super()._answer(data, now)
