"""The PDO service of a running device, and SYNC and TIME, sent and received (CiA 301, 7.2.2, 7.2.5 and 7.2.6).

`device.pdo` has the configuration and timing of PDOs.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from eurobot_od.device import broadcasts
from eurobot_od.device.broadcasts import Emergencies
from eurobot_od.device.nmt import NmtStates
from eurobot_od.device.objects import Objects
from eurobot_od.device.pdo import Pacing, Pdos, ProcessData
from eurobot_od.device.reaction import FrameHandler, Reaction
from eurobot_od.device.timers import Deadlines, Plan
from eurobot_od.errors import FrameLengthError, StateError
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import BASE_IDENTIFIER
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Catalogue, Message


class PdoService:
    """The PDOs of a device from one reset to the next; all times are in s.

    `pdos` are the PDOs as presently configured; `nmt` determines whether they may be sent and received. Later times are
    in the device's `plan`.
    """

    def __init__(
        self, objects: Objects, catalogue: Catalogue, nmt: NmtStates, emergencies: Emergencies, plan: Plan
    ) -> None:
        self._dictionary = objects.dictionary
        self._nmt = nmt
        self._emergencies = emergencies
        self._plan = plan
        self.pdos = Pdos(objects, catalogue)
        self._process = ProcessData(objects)
        self._pacing = Pacing(self.pdos.inhibit_time, self.pdos.event_timer)
        self._synchronous = broadcasts.Synchronous(self.pdos.sync_type, self.pdos.sync_start)
        self._deadlines = Deadlines[Binding]()
        self._sampled: dict[Binding, Frame] = {}
        self._at_sync: list[Binding] = []
        self._following: list[Binding] = []

    def restart(self, now: float) -> None:
        """Start over with the present configuration."""
        self._pacing.restart(self.pdos.sent.values(), now)
        self._synchronous.restart(self.pdos.sent.values(), self.pdos.received.values())
        # Values of a SYNC before the change must not be sent.
        self._sampled.clear()
        # Here and not at each SYNC, because a device may have hundreds of PDOs.
        self._at_sync = [each for each in self.pdos.requestable.values() if self.pdos.is_sampled(each)]
        self._following = [each for each in self.pdos.sent.values() if self.pdos.follows_changes(each)]
        for binding in self._deadlines.missed:  # supervision starts over
            self._emergencies.cleared((Deadlines, binding.name))
        received = self.pdos.received.values()
        self._deadlines.restart({each: time for each in received if (time := self.pdos.deadline(each))})

    def enter(self, now: float) -> None:
        """Start over in a new NMT state, in which every TPDO counts as changed."""
        self.restart(now)
        self._process.seen.clear()

    def settle(self) -> None:
        """Store the values of received PDOs in the objects."""
        self._process.settle()

    # Time

    @property
    def next(self) -> float:
        """Time of the next action, infinite if there is none."""
        return min(self._pacing.next, self._deadlines.next) if self._nmt.operational else inf

    def due(self, now: float) -> list[Frame]:
        """Return the due TPDOs, and report overdue RPDOs."""
        if not self._nmt.operational:
            return []
        # Frames that waited for the inhibit time are older than those of event timers.
        frames = self._pacing.released(now)
        frames += [self._process.frame(binding) for binding in self._pacing.due(now)]
        for binding in self._deadlines.overdue(now):
            cob_id = binding.cob_id.to_bytes(2, "little")
            self._emergencies.raised(ErrorCode.PDO_MISSING, (Deadlines, binding.name), cob_id)
        return frames

    # Receiving

    def receive(self, frame: Frame, now: float) -> Reaction:
        """Handle an RPDO: pass its message to the application, now or at the next SYNC."""
        binding = self.pdos.received[frame.cob_id]
        if not self._nmt.operational and not binding.always:
            return Reaction([])
        try:
            message = binding.decode(frame.data)
        except FrameLengthError:  # too short; a longer frame is processed as far as it is mapped (CiA 301, Table 26)
            self._raise_length(ErrorCode.PDO_TOO_SHORT, binding, frame)
            return Reaction([])
        if len(frame.data) > binding.layout.length:
            self._raise_length(ErrorCode.PDO_TOO_LONG, binding, frame)
        # The length is right again, which an EMCY with error code 0x0000 reports.
        elif binding.name in self._emergencies.errors:
            self._emergencies.cleared(binding.name)
        if self._deadlines.heard(binding, now):
            self._emergencies.cleared((Deadlines, binding.name))
        if binding in self._synchronous:
            self._synchronous.hold(broadcasts.Arrival(binding, frame.data, message))
            return Reaction([])
        if binding.layout.length:
            self._process.note(binding, frame.data)
        return Reaction([], message)

    def _raise_length(self, code: ErrorCode, binding: Binding, frame: Frame) -> None:
        self._emergencies.raised(code, binding.name, frame.cob_id.to_bytes(2, "little") + bytes([len(frame.data)]))

    def sync(self, frame: Frame, _: float) -> Reaction:
        """Send the TPDOs for this SYNC with the present values; then apply the waiting RPDOs."""
        if not self._nmt.operational:
            return Reaction([])
        # In this order, because TPDOs have the values before the SYNC.
        number = frame.data[0] if frame.data else None
        frames = [self._process.frame(binding) for binding in self._synchronous.due(number)]
        self._sampled = {binding: self._process.frame(binding) for binding in self._at_sync}
        arrived = self._synchronous.arrived()
        for each in arrived:
            self._process.note(each.binding, each.data)
        return Reaction(frames, synchronous=tuple(each.message for each in arrived))

    def requested(self, frame: Frame, _: float) -> Reaction:
        """Send a TPDO that a remote frame requests; a sampled one has the values of the last SYNC."""
        binding = self.pdos.requestable[frame.cob_id]
        if not self._nmt.operational:
            return Reaction([])
        return Reaction([self._sampled.get(binding) or self._process.frame(binding)])

    def check_received(self, message: type[Message]) -> None:
        """Check that an RPDO carries a message; raises StateError."""
        if message not in {each.type for each in self.pdos.received.values()}:
            raise StateError(f"{self._dictionary.name} has no RPDO for {message.__name__}; {self._has('receive')}")

    # Sending

    def transmit(self, message: Message) -> Frame:
        """Return the frame of a message as this device would send it.

        Raises StateError if it has no such TPDO or its NMT state does not allow it, FieldError for a value.
        """
        return self._sendable(message).encode(message)

    def _sendable(self, message: Message) -> Binding:
        binding = self.pdos.sent.get(type(message))
        if binding is None:
            raise StateError(f"{self._dictionary.name} has no TPDO for {type(message).__name__}; {self._has('send')}")
        if not self._nmt.operational and not binding.always:
            raise StateError(f"{self._dictionary.name} is {self._nmt.state.name}: only stops may be sent")
        return binding

    def _has(self, way: str) -> str:
        return f"{self._dictionary.file} says what it can {way}"

    def send(self, message: Message, now: float) -> list[Frame]:
        """Return the frame of a message to send now, in a list; empty if it waits for SYNC or its inhibit time.

        Raises as `transmit`.
        """
        binding = self._sendable(message)
        frame = binding.encode(message)
        if frame.data:  # the objects have the last sent values
            self._process.note(binding, frame.data)
        frames = self._admit(binding, frame, now)
        if not frames:
            self._plan.at(self.next)
        return frames

    def changed(self, now: float, may_go: Callable[[Binding], bool] | None = None) -> list[Frame]:
        """Return the event-driven TPDOs whose values have changed since the last call, for devices without application.

        Each TPDO counts as changed when the device becomes OPERATIONAL. One with transmission type 0 waits for SYNC, an
        inhibited one waits for its time, and one that `may_go` refuses is skipped until its next change.
        """
        self._process.settle()
        if not self._nmt.operational:
            return []
        frames: list[Frame] = []
        for binding, frame in self._process.changed(self._following):
            if may_go is None or may_go(binding):
                frames += self._admit(binding, frame, now)
        self._plan.at(self.next)
        return frames

    def _admit(self, binding: Binding, frame: Frame, now: float) -> list[Frame]:
        """Return the frame if it may be sent now; a synchronous TPDO waits for SYNC."""
        if binding in self._synchronous:
            self._synchronous.ask(binding)
            return []
        return self._pacing.admit(binding, frame, now)


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
