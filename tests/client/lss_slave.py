"""The device's side of LSS as a station of its own, without the rest of a device; and slaves that do it otherwise."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from itertools import cycle
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


class OtherIdentityStation(LssStation):
    """Says another serial number than the one that it is found by."""

    def _answer(self, data: bytes, now: float) -> bytes | None:
        answer = super()._answer(data, now)
        return b"\x5d\x09" if data[0] == 0x5D and answer else answer


class UnreliableStation(LssStation):
    """Delays its answers by `delays` in s, in turn; None is an answer that is lost."""

    def __init__(self, identity: Identity, delays: Iterable[float | None]) -> None:
        super().__init__(identity)
        self._delays, self._late = cycle(delays), deque[tuple[float, Frame]]()

    @property
    def next_wakeup(self) -> float:  # type: ignore[override]
        return self._late[0][0] if self._late else inf

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        answers = super().receive(frame, now)
        for each in answers:
            delay = next(self._delays)
            if delay == 0:
                return answers
            if delay is not None:
                self._late.append((now + delay, each))
        return []

    def tick(self, now: float) -> list[Frame]:
        return [self._late.popleft()[1] for due, _ in [*self._late] if due <= now]
