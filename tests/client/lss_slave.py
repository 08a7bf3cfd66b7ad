"""An LSS slave, the least that a master can be tried on (CiA 305)."""

from __future__ import annotations

from math import inf

from eurobot_od.client.description import Identity
from eurobot_od.frame import Frame

WAITING, CONFIGURATION = 0, 1
ANSWERS, REQUESTS = 0x7E4, 0x7E5


class LssSlave:
    """A station; `stored` is what it has stored, `errors` are what it answers to commands that it refuses.

    One that is `always_scanned` says yes to every fastscan while it is being configured, as CANopenNode's does.
    """

    next_wakeup = inf

    def __init__(
        self,
        identity: Identity,
        node_id: int = 255,
        errors: dict[int, tuple[int, int]] | None = None,
        always_scanned: bool = False,
    ) -> None:
        self.identity, self.node_id, self.errors, self.always_scanned = identity, node_id, errors or {}, always_scanned
        self.state, self.bit_rate, self.stored, self.delay = WAITING, 2, (node_id, 2), 0
        self._position = 0
        self._selected = 0

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id != REQUESTS or len(frame.data) != 8:
            return []
        answer = self._answer(frame.data[0], frame.data)
        return [] if answer is None else [Frame(ANSWERS, answer.ljust(8, b"\0"))]

    def tick(self, now: float) -> list[Frame]:
        return []

    def _answer(self, command: int, data: bytes) -> bytes | None:
        if command == 0x04:
            self.state, self._selected = data[1], 0
        elif 0x40 <= command <= 0x43:
            return self._select(command - 0x40, int.from_bytes(data[1:5], "little"))
        elif command == 0x51 and self.state == WAITING and self.node_id == 255:
            return self._fastscan(int.from_bytes(data[1:5], "little"), *data[5:8])
        elif command == 0x51 and self.always_scanned and self.state == CONFIGURATION:
            return b"\x4f"
        elif self.state == CONFIGURATION:
            return self._configure(command, data)
        return None

    def _select(self, part: int, number: int) -> bytes | None:
        matches = part == self._selected and number == self.identity[part]
        self._selected = part + 1 if matches else 0
        if self._selected < 4:
            return None
        self.state = CONFIGURATION
        return b"\x44"

    def _fastscan(self, number: int, bit: int, part: int, then: int) -> bytes | None:
        if bit == 128:
            self._position = 0
            return b"\x4f"
        if part != self._position or number >> bit != self.identity[part] >> bit:
            return None
        if bit == 0:
            self._position = then
            if then < part:
                self.state = CONFIGURATION
        return b"\x4f"

    def _configure(self, command: int, data: bytes) -> bytes | None:
        if command in self.errors:
            return bytes([command, *self.errors[command]])
        if command == 0x11:
            self.node_id = data[1]
        elif command == 0x13:
            self.bit_rate = data[2]
        elif command == 0x15:
            self.delay = int.from_bytes(data[1:3], "little")
            return None
        elif command == 0x17:
            self.stored = self.node_id, self.bit_rate
        elif command == 0x5E:
            return bytes([command, self.node_id])
        else:
            return None
        return bytes([command])
