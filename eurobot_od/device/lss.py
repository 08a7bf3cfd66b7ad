"""The device's side of the layer setting services: it is found by its identity, and given node-ID and bit rate.

CiA 305. There is no clock and no bus in here: the data of requests and the time in seconds go in, the data of answers
comes out. A request that CiA 305 does not allow in the present state, and one that is malformed, has no answer.
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
"""Bit rate in kbit/s by its index in the standard table."""

OK = b"\0"
REFUSED = b"\1"
"""Error code for a node-ID or a bit rate that the device cannot have."""
NOT_STORED = b"\2"
"""Error code of a device that cannot access its storage."""

BITS = range(32)
PARTS = range(len(LSS_IDENTITY))


class Commissioning(NamedTuple):
    """What LSS configures: the node-ID, 255 for none, and the bit rate in kbit/s."""

    node_id: int = UNCONFIGURED
    kbit: int = 500


class LssSlave:
    """A device as LSS sees it, with an `identity` of vendor-ID, product code, revision and serial number.

    `stored` is what it has after power-on, `pending` what was configured since, `active` what is in force. `supported`
    are its bit rates in kbit/s. `store` keeps a commissioning over power-off, and returns whether it could. Until
    `silent_until`, in s, the device changes its bit rate, and neither sends nor hears anything.
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
        """Return the slave of a device with a file: its identity, with another `serial` unless None, and bit rates."""
        said = dictionary.device.document.text
        supported = [kbit for kbit in BIT_RATES if said("deviceinfo", f"baudrate_{kbit}") == "1"]
        *kind, own = Identity.of(dictionary)
        return cls((*kind, own if serial is None else serial), commissioning, supported or tuple(BIT_RATES))

    @property
    def needs_boot(self) -> bool:
        """Whether a device without a node-ID has been given one, and configuring it has ended: now it boots."""
        is_new = self.active.node_id == UNCONFIGURED != self.pending.node_id
        return is_new and self.state is LssState.WAITING

    def power_on(self) -> None:
        """Take over what was stored, as a reset of the node does."""
        self.pending = self.stored
        self.activate()

    def activate(self) -> None:
        """Take over the pending node-ID, as a reset of the communication does."""
        self.active = self.active._replace(node_id=self.pending.node_id)

    def receive(self, data: bytes, now: float) -> bytes | None:
        """Take in the data of a request, and return those of the answer; None if there is none."""
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
        """Enter configuration state once all four parts of the identity have come in their order."""
        self._selected = self._agreed(self._selected, command - Lss.SELECT, _number(rest), self.identity)
        if self._selected < len(self.identity):
            return None
        self.state, self._selected = LssState.CONFIGURATION, 0
        return bytes([Lss.SELECTED])

    def _fastscan(self, _: int, rest: bytes) -> bytes | None:
        """Confirm that the bits from the highest down to the named one are ours, and note which part is asked next."""
        number, (bit, part, then) = _number(rest), rest[4:7]
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
        """Confirm vendor, product, and ranges of revision and serial number that have come in their order."""
        part, number = command - Lss.IDENTIFY, _number(rest)
        vendor, product, revision, serial = self.identity
        # A bound agrees if the device's number is within it, so the number itself is then what is wanted.
        within = min(number, revision), max(number, revision), min(number, serial), max(number, serial)
        wanted = vendor, product, *within
        self._identified = self._agreed(self._identified, part, number, wanted)
        if self._identified < len(wanted):
            return None
        self._identified = 0
        return bytes([Lss.IDENTIFY_SLAVE])

    @staticmethod
    def _agreed(before: int, part: int, number: int, wanted: tuple[int, ...]) -> int:
        """Return how many parts have agreed, now that one more has come; a part out of order starts over."""
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
        # The delay twice: until everybody has stopped sending, and until everybody has the new rate.
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
    """A service of the slave: what it does with a command and the bytes after it, and the states that have it."""

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
"""The slave's services by the command specifiers of their requests (CiA 305)."""


def _number(rest: bytes) -> int:
    return int.from_bytes(rest[:4], "little")
