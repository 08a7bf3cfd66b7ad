"""LSS slave: a device is identified by LSS, and its node-ID and bit rate are configured (CiA 305).

There is no clock and no bus in this module: input is the data of requests and the time in s, output is the data of
answers. A malformed request, or one that the state does not allow, has no answer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from math import inf
from typing import Final, NamedTuple

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import ANY_BIT, BIT_RATES, LENGTH, LSS_IDENTITY, UNCONFIGURED, Lss, LssState
from eurobot_od.od.values import NODE_IDS

KBIT = {index: kbit for kbit, index in BIT_RATES.items()}
"""Bit rates in kbit/s by index in the standard table."""

OK = b"\0"
REFUSED = b"\1"
"""Error code for an unsupported node-ID or bit rate."""
NOT_STORED = b"\2"
"""Error code for a failed storage."""

BITS = range(32)
PARTS = range(len(LSS_IDENTITY))


class Commissioning(NamedTuple):
    """Values that LSS configures: node-ID, 255 for none, and bit rate in kbit/s."""

    node_id: int = UNCONFIGURED
    kbit: int = 500


class LssSlave:
    """LSS slave of a device; `identity` is vendor-ID, product code, revision and serial number.

    `stored` are the values after power-on, `pending` the configured ones, `active` the present ones. `supported` are
    the bit rates in kbit/s. `store` stores a commissioning, and returns whether that succeeded. Until `silent_until`,
    in s, the device changes its bit rate, and neither sends nor receives.
    """

    def __init__(
        self,
        identity: tuple[int, ...],
        commissioning: Commissioning,
        supported: Collection[int] = tuple(BIT_RATES),
    ) -> None:
        self.identity, self.supported = identity, supported
        self.stored = self.pending = self.active = commissioning
        self.store: Callable[[Commissioning], bool] = lambda _: True
        self.state = LssState.WAITING
        self.silent_until = -inf
        self._now = 0.0
        self._selected = self._identified = self._position = 0

    @classmethod
    def of(cls, dictionary: Dictionary, commissioning: Commissioning, serial: int | None = None) -> LssSlave:
        """Return the LSS slave of a device with its file's identity and bit rates.

        `serial` replaces the serial number.
        """
        said = dictionary.device.document.text
        supported = [kbit for kbit in BIT_RATES if said("deviceinfo", f"baudrate_{kbit}") == "1"]
        *kind, own = Identity.of(dictionary)
        return cls((*kind, own if serial is None else serial), commissioning, supported or tuple(BIT_RATES))

    @property
    def needs_boot(self) -> bool:
        """Whether a device has got its first node-ID, and its configuration has ended, so that it boots."""
        is_new = self.active.node_id == UNCONFIGURED != self.pending.node_id
        return is_new and self.state is LssState.WAITING

    def power_on(self) -> None:
        """Use the stored values, as a reset of the node does."""
        self.pending = self.stored
        self.activate()

    def activate(self) -> None:
        """Use the pending node-ID, as a reset of the communication does."""
        self.active = self.active._replace(node_id=self.pending.node_id)

    def receive(self, data: bytes, now: float) -> bytes | None:
        """Handle the data of a request, and return the data of the answer, or None."""
        self._now = now
        service = SERVICES.get(data[0]) if len(data) == LENGTH else None
        if service is None or self.state not in service.states:
            return None
        answer = service.act(self, data[0], data[1:])
        return None if answer is None else answer.ljust(LENGTH, b"\0")

    # Switching

    def _switch(self, _: int, rest: bytes) -> None:
        if rest[0] in set(LssState):
            self.state = LssState(rest[0])
            self._selected = self._position = 0

    def _select(self, command: int, rest: bytes) -> bytes | None:
        """Enter the configuration state once all four parts of the identity have come in order."""
        self._selected = self._agreed(self._selected, command - Lss.SELECT, _number(rest), self.identity)
        if self._selected < len(self.identity):
            return None
        self.state = LssState.CONFIGURATION
        self._selected = 0
        return bytes([Lss.SELECTED])

    def _fastscan(self, _: int, rest: bytes) -> bytes | None:
        """Confirm the bits of an identity part from the highest down to the given one, and note the next part."""
        number = _number(rest)
        (bit, part, then) = rest[4:7]
        is_meant = self.active.node_id == self.pending.node_id == UNCONFIGURED
        if not is_meant or not {part, then} <= {*PARTS}:
            return None
        if bit == ANY_BIT:
            self._position = 0
        elif part != self._position or bit not in BITS or number >> bit != self.identity[part] >> bit:
            return None
        elif bit == 0:
            self._position = then
            if then < part:  # the whole identity was confirmed
                self.state = LssState.CONFIGURATION
        return bytes([Lss.IDENTIFY_SLAVE])

    # Identifying

    def _identify(self, command: int, rest: bytes) -> bytes | None:
        """Confirm vendor, product, and ranges of revision and serial number that have come in order."""
        part = command - Lss.IDENTIFY
        number = _number(rest)
        vendor, product, revision, serial = self.identity
        # A limit agrees if the device's number is within it.
        within = min(number, revision), max(number, revision), min(number, serial), max(number, serial)
        wanted = vendor, product, *within
        self._identified = self._agreed(self._identified, part, number, wanted)
        if self._identified < len(wanted):
            return None
        self._identified = 0
        return bytes([Lss.IDENTIFY_SLAVE])

    @staticmethod
    def _agreed(before: int, part: int, number: int, wanted: tuple[int, ...]) -> int:
        """Return the number of parts that have agreed; a part out of order restarts the count."""
        if part == 0:
            before = 0
        return before + 1 if part == before and number == wanted[part] else 0

    def _identify_unconfigured(self, _: int, rest: bytes) -> bytes | None:
        is_without = self.pending.node_id == UNCONFIGURED
        return bytes([Lss.UNCONFIGURED_SLAVE]) if is_without else None

    # Configuring

    def _configure_node_id(self, command: int, rest: bytes) -> bytes:
        if rest[0] not in (*NODE_IDS, UNCONFIGURED):
            return bytes([command]) + REFUSED
        self.pending = self.pending._replace(node_id=rest[0])
        return bytes([command]) + OK

    def _configure_bit_timing(self, command: int, rest: bytes) -> bytes:
        table, index = rest[0], rest[1]
        if table != 0 or KBIT.get(index) not in self.supported:
            return bytes([command]) + REFUSED
        self.pending = self.pending._replace(kbit=KBIT[index])
        return bytes([command]) + OK

    def _activate_bit_timing(self, _: int, rest: bytes) -> None:
        delay = int.from_bytes(rest[:2], "little") / 1000
        # Twice the delay: until all devices have stopped sending, and until all have the new bit rate.
        self.silent_until = self._now + 2 * delay
        self.active = self.active._replace(kbit=self.pending.kbit)

    def _store(self, command: int, rest: bytes) -> bytes:
        if not self.store(self.pending):
            return bytes([command]) + NOT_STORED
        self.stored = self.pending
        return bytes([command]) + OK

    # Inquiring

    def _inquire(self, command: int, rest: bytes) -> bytes:
        return bytes([command]) + self.identity[command - Lss.INQUIRE].to_bytes(4, "little")

    def _inquire_node_id(self, command: int, rest: bytes) -> bytes:
        return bytes([command, self.active.node_id])


class LssService(NamedTuple):
    """A service of the slave: its function, and the states in which it is available."""

    act: Callable[[LssSlave, int, bytes], bytes | None]
    states: Collection[LssState] = (LssState.CONFIGURATION,)


_ALWAYS = tuple(LssState)
_WAITING = (LssState.WAITING,)

SERVICES: Final[Mapping[int, LssService]] = {
    Lss.SWITCH_GLOBAL: LssService(LssSlave._switch, _ALWAYS),
    **{Lss.SELECT + part: LssService(LssSlave._select, _WAITING) for part in PARTS},
    **{Lss.IDENTIFY + part: LssService(LssSlave._identify, _ALWAYS) for part in range(6)},
    Lss.IDENTIFY_UNCONFIGURED: LssService(LssSlave._identify_unconfigured, _ALWAYS),
    Lss.FASTSCAN: LssService(LssSlave._fastscan, _WAITING),
    Lss.CONFIGURE_NODE_ID: LssService(LssSlave._configure_node_id),
    Lss.CONFIGURE_BIT_TIMING: LssService(LssSlave._configure_bit_timing),
    Lss.ACTIVATE_BIT_TIMING: LssService(LssSlave._activate_bit_timing),
    Lss.STORE: LssService(LssSlave._store),
    **{Lss.INQUIRE + part: LssService(LssSlave._inquire) for part in PARTS},
    Lss.INQUIRE_NODE_ID: LssService(LssSlave._inquire_node_id),
}
"""Services by command specifier of the request (CiA 305)."""


def _number(rest: bytes) -> int:
    return int.from_bytes(rest[:4], "little")
