"""SYNC and TIME of a device, sent and received (CiA 301, 7.2.5 and 7.2.6)."""

from __future__ import annotations

from eurobot_od.device import broadcasts
from eurobot_od.device.nmt import NmtStates
from eurobot_od.device.objects import Objects
from eurobot_od.device.pdo_service import PdoService
from eurobot_od.device.reaction import FrameHandler, Reaction
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.values import BASE_IDENTIFIER
from eurobot_od.pdo.kinds import Message


class SyncAndTime:
    """SYNC and TIME of a device from one reset to the next, by 0x1005, 0x1006, 0x1012 and 0x1019; times are in s.

    `clock` is set by TIME; no reset changes it.
    """

    def __init__(self, objects: Objects, nmt: NmtStates, pdo: PdoService, clock: broadcasts.Clock) -> None:
        self._objects, self._nmt, self._pdo, self._clock = objects, nmt, pdo, clock
        self._sync = broadcasts.SyncProducer()

    @property
    def produced(self) -> set[int]:
        """COB-IDs of SYNC and TIME that the device sends (bit 30: CiA 301, 7.5.2.5 and 7.5.2.15)."""
        both = self._objects.raw(standard.TIME), self._objects.raw(standard.SYNC)
        return {each & BASE_IDENTIFIER for each in both if each & broadcasts.TIME_PRODUCER}

    @property
    def handlers(self) -> dict[int | None, FrameHandler]:
        """Handlers by COB-ID; None for a service that is not received."""
        time = self._objects.raw(standard.TIME)
        consumed = time & BASE_IDENTIFIER if time & broadcasts.TIME_CONSUMER else None
        return {consumed: self._receive_time, self._pdo.pdos.sync_cob_id: self._pdo.sync}

    def restart(self, now: float) -> None:
        """Start sending SYNC and TIME, if configured and allowed by the NMT state (CiA 301, Table 36)."""
        pdos, reports = self._pdo.pdos, self._nmt.reports
        self._sync.restart(pdos.sync_period if reports else 0.0, pdos.sync_counter, now)
        time = self._objects.raw(standard.TIME)
        sends = reports and time & broadcasts.TIME_PRODUCER and time & BASE_IDENTIFIER
        self._clock.restart(broadcasts.TIME_PERIOD if sends else 0.0, now)

    @property
    def next(self) -> float:
        """Time at which SYNC or TIME is due, infinite if neither is sent."""
        return min(self._sync.next, self._clock.next)

    def due(self, now: float) -> Reaction:
        """Send SYNC and TIME at their times; the device's own SYNC acts like any other."""
        frames = [Frame(self._objects.raw(standard.TIME) & BASE_IDENTIFIER, data) for data in self._clock.due(now)]
        messages: tuple[Message, ...] = ()
        for data in self._sync.due(now):
            sync = Frame(self._objects.raw(standard.SYNC) & BASE_IDENTIFIER, data)
            # A CAN controller does not receive its own frames.
            followed = self._pdo.sync(sync, now)
            frames += [sync, *followed.frames]
            messages += followed.synchronous
        return Reaction(frames, synchronous=messages)

    def _receive_time(self, frame: Frame, now: float) -> Reaction:
        self._clock.receive(frame.data, now)
        return Reaction([])
