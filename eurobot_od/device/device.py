"""One CANopen device from its EDS: NMT slave, SDO server, PDOs gated by state, heartbeats, emergencies, stored values.

Rule of this file: no clock and no bus. Frames and the time in seconds go in, frames and typed messages come out;
what a peer sends wrong becomes an EMCY, an SDO abort and a count, never an exception.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import NamedTuple

from eurobot_od.device.bound import NO_APPLICATION, Application, BoundObjects
from eurobot_od.device.emergency import Emergencies, ErrorCode
from eurobot_od.device.heartbeat import HeartbeatConsumer, split
from eurobot_od.device.nmt import SERVICES, TARGET, NmtCommand, NmtState, boot_state, command_in, error_control
from eurobot_od.device.objects import EMCY_COB_ID, Objects, OnRead, OnWrite
from eurobot_od.device.pdo import Pacing, Pdos, ProcessData
from eurobot_od.device.plan import Plan
from eurobot_od.device.storage import Store
from eurobot_od.device.sync import Arrival, Synchronous
from eurobot_od.errors import Cause, DictionaryError, FrameLengthError, Refused, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, Address, Value
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.catalogue import NOTHING, Catalogue
from eurobot_od.pdo.message import Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import Abort, AbortCode

ERROR_REGISTER = 0x1001
ERROR_FIELD = 0x1003
STORE = 0x1010
RESTORE = 0x1011
STORED_EDS = 0x1021
EMCY_INHIBIT: Address = (0x1015, 0)
CONSUMED_HEARTBEATS = 0x1016
HEARTBEAT_TIME: Address = (0x1017, 0)
COMMUNICATION_ERROR: Address = (0x1029, 1)
SDO_RECEIVE: Address = (0x1200, 1)
SDO_TRANSMIT: Address = (0x1200, 2)
SDO_CLIENTS = range(0x1280, 0x1300)
NMT_STARTUP: Address = (0x1F80, 0)

SAVE = int.from_bytes(b"save", "little")
LOAD = int.from_bytes(b"load", "little")
"""Signatures that 0x1010 and 0x1011 want to see (CiA 301, 7.5.2.13 and 7.5.2.14)."""

COMMUNICATION_PROFILE = range(0x1000, 0x2000)
"""Indices that a reset of the communication restores (CiA 301, 7.3.2.2.3)."""

ON_COMMUNICATION_ERROR: Mapping[int, NmtCommand | None] = {
    0: NmtCommand.ENTER_PRE_OPERATIONAL,
    1: None,
    2: NmtCommand.STOP,
}
"""What an operational device does when a heartbeat is lost, by error behaviour 0x1029:1 (CiA 301, 7.5.2.32)."""

REFUSAL: Mapping[Cause, AbortCode] = {Cause.STATE: AbortCode.STATE, Cause.VALUES: AbortCode.INCOMPATIBLE}
"""How a command written over SDO is refused, by why the application does not act on it."""


class Reaction(NamedTuple):
    """What a frame, or the time, did to a device.

    `frames` to send, the `message` for the application, whether it was `reset`, the node-IDs whose heartbeat was
    `lost`, an SDO `answer` to the device as a client, the node-ID of a watched node that has `booted`, and the messages
    that waited for SYNC and are `synchronous`.
    """

    frames: list[Frame]
    message: Message | None = None
    reset: bool = False
    lost: tuple[int, ...] = ()
    answer: Frame | None = None
    booted: int | None = None
    synchronous: tuple[Message, ...] = ()


Ear = Callable[[Frame], Reaction]
"""What a device does with the frames of one COB-ID."""


class Device:
    """The CANopen side of a node, made from its `dictionary`.

    `store` keeps what 0x1010 saves over power-off, `catalogue` has its message types, and `application` is what its
    objects are bound to. `operational` tells whether its NMT `state` allows PDOs. `objects` has its values, `protocol`
    its messages as they are mapped now, `identifiers` the COB-IDs of all frames it listens to. Both are replaced as a
    whole when a master changes them. `sdo_requests` and `sdo_answers` are the COB-IDs of its SDO server, None without
    one; no master changes them (CiA 301, 7.5.2.33: ro). `plan` has what frames have made it plan, and `next_wakeup`
    everything.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        store: Store | None = None,
        catalogue: Catalogue = NOTHING,
        application: Application = NO_APPLICATION,
    ) -> None:
        self._file, self._catalogue, self._application = dictionary, catalogue, application
        self._store, self.plan = store, Plan()
        self._stored = store.load() if store else {}
        self.state = NmtState.INITIALISING
        self._now = 0.0
        self._load(dict(self._stored))

    @property
    def state(self) -> NmtState:
        """The NMT state."""
        return self._state

    @state.setter
    def state(self, state: NmtState) -> None:
        self._state = state
        self._listens, self._reports, self._serves, self.operational = SERVICES[state]

    def _load(self, values: dict[Address, Value]) -> None:
        """Make everything anew from these values, as after power-on or a reset."""
        own = self._file.node_id_address
        number = values.setdefault(own, self._file.node_id) if own else self._file.node_id
        self.node_id = number if isinstance(number, int) else self._file.node_id
        self.dictionary = self._file if self.node_id == self._file.node_id else self._file.renumbered(self.node_id)
        self.emergencies = Emergencies(
            lambda: self.objects.cob_id(EMCY_COB_ID), lambda: self.objects.raw(EMCY_INHIBIT) / 10_000
        )
        readers: dict[int, OnRead] = {}
        writers: dict[int, OnWrite] = {}
        self.objects = Objects(self.dictionary, readers, writers)
        self.objects.values = values
        self._pdos = Pdos(self.objects, self._catalogue)
        bound = BoundObjects(self.objects, self._catalogue, self._application, self._command)
        readers |= {
            **bound.readers(),
            ERROR_REGISTER: lambda _: self.emergencies.register,
            ERROR_FIELD: self.emergencies.read_field,
            STORED_EDS: self._read_eds,
        }
        writers |= {
            **bound.writers(),
            ERROR_FIELD: self.emergencies.clear_field,
            STORE: self._save,
            RESTORE: self._restore,
            CONSUMED_HEARTBEATS: self._consume,
            HEARTBEAT_TIME[0]: self._produce,
            **{index: self._followed(write) for index, write in self._pdos.writers().items()},
        }
        self._process = ProcessData(self.objects)
        self._pacing = Pacing(self._pdos.inhibit_time, self._pdos.event_timer)
        self._synchronous = Synchronous(self._pdos.sync_type)
        self._server = SdoServer(self.objects)
        self._consumer = HeartbeatConsumer()
        self._next_heartbeat = inf
        self._beating = False
        self._configure()

    def _configure(self) -> None:
        """Listen to what is configured now."""
        self._consumer.configure(self._consumed())
        self.sdo_requests = self._sdo_cob_id(SDO_RECEIVE, SDO_REQUEST_BASE)
        self.sdo_answers = self._sdo_cob_id(SDO_TRANSMIT, SDO_RESPONSE_BASE)
        answers = {self.objects.cob_id((index, 2)) for index in SDO_CLIENTS}
        # Where a file gives two services one identifier, the later of these has it: NMT is never lost.
        ears: dict[int | None, Ear] = {
            **dict.fromkeys(self._consumer.identifiers, self._receive_heartbeat),
            **dict.fromkeys(answers, lambda frame: Reaction([], answer=frame)),
            **dict.fromkeys(self._pdos.received, self._receive_pdo),
            self._pdos.sync_cob_id: self._receive_sync,
            self.sdo_requests: self._receive_sdo,
            NMT_COB_ID: self._receive_command,
        }
        self._ears = {cob_id: ear for cob_id, ear in ears.items() if cob_id is not None}
        self.identifiers = sorted(self._ears)
        self._restart_pdos()

    def _restart_pdos(self) -> None:
        self._pacing.restart(self._pdos.sent.values(), self._now)
        self._synchronous.restart(self._pdos.sent.values(), self._pdos.received.values())

    @property
    def protocol(self) -> Protocol:
        """The messages of the PDOs that are valid now."""
        return self._pdos.protocol

    @property
    def always_sent(self) -> set[int]:
        """The COB-IDs of the messages that this device sends in every NMT state: its stops."""
        return self._pdos.always_sent

    # Values

    def number(self, address: Address) -> int:
        """Return an object's present value as a number; raises DictionaryError if it has none."""
        return self.objects.number(address)

    def setting(self, name: str) -> int:
        """Return the value of a setting by its ParameterNames, `Goto handshake.Confirm wait`.

        Raises DictionaryError.
        """
        return self.objects.number(self.dictionary.address(name))

    def _sdo_cob_id(self, address: Address, base: int) -> int | None:
        """Return an identifier of the SDO server; one without 0x1200 is the default one (CiA 301, 7.5.2.33)."""
        return self.objects.cob_id(address) if address[0] in self.dictionary.members else base + self.node_id

    # Objects that do more than keep a value

    def _followed(self, write: OnWrite) -> OnWrite:
        """Return what writes an object and then has the device listen to what is configured now."""

        def written(address: Address, value: Value) -> None:
            write(address, value)
            self._configure()

        return written

    def _command(self, binding: Binding, message: Message) -> None:
        """Have the application act on what was written as on a PDO; raises Abort with the reason if it does not."""
        if not self.operational and not binding.always:
            raise Abort(AbortCode.STATE, f"{self.dictionary.name} is {self.state.name}")
        try:
            self._application.act(message)
        except Refused as refused:
            raise Abort(REFUSAL[refused.cause], str(refused)) from refused

    def _read_eds(self, _: int) -> Value:
        try:
            return self.dictionary.content
        except DictionaryError as error:
            raise Abort(AbortCode.HARDWARE, str(error)) from error

    def _save(self, _: Address, signature: Value) -> None:
        if signature != SAVE:
            raise Abort(AbortCode.NOT_TRANSFERRED)
        self._keep(self.objects.configuration())

    def _restore(self, _: Address, signature: Value) -> None:
        """Have the file's values back with the next reset (CiA 301, 7.5.2.14)."""
        if signature != LOAD:
            raise Abort(AbortCode.NOT_TRANSFERRED)
        self._keep({})
        if self._file.node_id_address:
            self.objects.values.pop(self._file.node_id_address, None)

    def _keep(self, values: dict[Address, Value]) -> None:
        try:
            own = self._file.node_id_address
            if self._store:
                self._store.save(values, self.objects.number(own) if own else self.node_id)
        except (OSError, DictionaryError) as error:
            raise Abort(AbortCode.HARDWARE, str(error)) from error
        self._stored = values

    def _consumed(self) -> list[int]:
        count = self.objects.raw((CONSUMED_HEARTBEATS, 0))
        return [self.objects.raw((CONSUMED_HEARTBEATS, subindex)) for subindex in range(1, count + 1)]

    def _consume(self, address: Address, value: Value) -> None:
        """Watch other nodes' heartbeats, each but once (CiA 301, 7.5.2.19)."""
        node_id, time = split(value if isinstance(value, int) else 0)
        others = [split(entry) for subindex, entry in enumerate(self._consumed(), 1) if subindex != address[1]]
        if time and any(node_id == other and others_time for other, others_time in others):
            raise Abort(AbortCode.INCOMPATIBLE)
        self.objects.put(address, value)
        self._configure()

    def _produce(self, address: Address, value: Value) -> None:
        self.objects.put(address, value)
        self._plan_heartbeat(self._now)

    # NMT

    def start(self, now: float) -> list[Frame]:
        """Boot: send the boot-up message and enter the state that NMT startup 0x1F80 says (CiA 301, 7.3.2.2)."""
        self._now = now
        self._beating = False
        self._plan_heartbeat(now)
        self._enter(boot_state(self.objects.value(NMT_STARTUP)))
        return [error_control(self.node_id, NmtState.INITIALISING)]

    def _enter(self, state: NmtState) -> None:
        self.state = state
        self._restart_pdos()
        if state is NmtState.STOPPED:
            self._server.forget()

    def _plan_heartbeat(self, now: float) -> None:
        period = self.objects.raw(HEARTBEAT_TIME)
        self._next_heartbeat = now + period / 1000 if period else inf

    def first_heartbeat(self) -> list[Frame]:
        """Return a heartbeat to send now if there has been none since the boot-up, and if there will be any.

        For a node that others have to miss from now on: they watch it from its first heartbeat.
        """
        if self._beating or self._next_heartbeat == inf:
            return []
        self._beating = True
        return [error_control(self.node_id, self.state)]

    def _reset(self, command: NmtCommand) -> Reaction:
        """Restore what was stored, but for a new node-ID, which takes effect now (CiA 301, 7.3.2.2.3)."""
        values = dict(self._stored)
        if command is NmtCommand.RESET_COMMUNICATION:
            values = {a: value for a, value in values.items() if a[0] in COMMUNICATION_PROFILE}
            values |= {a: v for a, v in self.objects.values.items() if a[0] not in COMMUNICATION_PROFILE}
        if self._file.node_id_address:
            values[self._file.node_id_address] = self.objects.value(self._file.node_id_address)
        self._load(values)
        return Reaction(self.start(self._now), reset=True)

    # Time

    @property
    def next_wakeup(self) -> float:
        """When to call `tick`, infinite if nothing is planned."""
        pdo = self._pacing.next if self.operational else inf
        emcy = self.emergencies.next if self._reports else inf
        return min(self._next_heartbeat, self._consumer.next, self._server.deadline, pdo, emcy)

    def tick(self, now: float) -> Reaction:
        """Do what is due: heartbeat and TPDOs at their times, and notice who has fallen silent."""
        self._now = now
        frames = []
        if now >= self._next_heartbeat:
            # From the time it was due, not from now: a late call must not make every later heartbeat late as well.
            self._plan_heartbeat(self._next_heartbeat)
            self._beating = True
            frames.append(error_control(self.node_id, self.state))
        if self.operational:
            frames += self._pacing.released(now)
            frames += [self._process.frame(binding) for binding in self._pacing.due(now)]
        frames += self._sdo_frames(self._server.tick(now))
        lost = tuple(self._consumer.overdue(now))
        for node_id in lost:
            self.emergencies.raised(ErrorCode.HEARTBEAT_LOST, (HeartbeatConsumer, node_id), bytes([node_id]))
        command = ON_COMMUNICATION_ERROR.get(self.objects.raw(COMMUNICATION_ERROR))
        if lost and command is not None and self.operational:
            self._enter(TARGET[command])
        return Reaction(frames + self.emergency_frames(now), lost=lost)

    def bus_error(self, code: int, now: float) -> None:
        """Note what the CAN controller reports; `tick` sends the EMCY."""
        self.emergencies.happened(code, now)

    def emergency_frames(self, now: float) -> list[Frame]:
        """Return the EMCY frames that may go now; in STOPPED they wait (CiA 301, 7.3.2.2.4)."""
        if not self._reports:
            return []
        frames = self.emergencies.due(now)
        self.plan.at(self.emergencies.next)
        return frames

    # Frames

    def receive(self, frame: Frame, now: float) -> Reaction:
        """Take in one frame from the bus; before `start` a device hears nothing."""
        ear = self._ears.get(frame.cob_id)
        if ear is None or not self._listens:
            return Reaction([])
        self._now = now
        reaction = ear(frame)
        if not self.emergencies.quiet:
            reaction.frames.extend(self.emergency_frames(now))
        if reaction.message is None:  # a message for the application plans nothing here
            self.plan.at(self.next_wakeup)
        return reaction

    def _receive_command(self, frame: Frame) -> Reaction:
        command = command_in(frame, self.node_id)
        if command in TARGET:
            self._enter(TARGET[command])
        return Reaction([]) if command is None or command in TARGET else self._reset(command)

    def _receive_heartbeat(self, frame: Frame) -> Reaction:
        node_id = frame.cob_id - ERROR_CONTROL_BASE
        boot_up = frame == error_control(node_id, NmtState.INITIALISING)
        if self._consumer.heard(node_id, self._now, boot_up=boot_up):
            self.emergencies.cleared((HeartbeatConsumer, node_id))
        return Reaction([], booted=node_id if boot_up else None)

    def _receive_sdo(self, frame: Frame) -> Reaction:
        if not self._serves:
            return Reaction([])
        self._process.settle()  # first, so that a read gives what the latest PDO has brought
        return Reaction(self._sdo_frames(self._server.receive(frame.data, self._now)))

    def _sdo_frames(self, answers: list[bytes]) -> list[Frame]:
        return [Frame(self.sdo_answers, data) for data in answers] if self.sdo_answers is not None else []

    def _receive_pdo(self, frame: Frame) -> Reaction:
        binding = self._pdos.received[frame.cob_id]
        if not self.operational and not binding.always:
            return Reaction([])
        try:
            message = binding.decode(frame.data)
        except FrameLengthError:
            self._raise_length(ErrorCode.PDO_TOO_SHORT, binding, frame)
            return Reaction([])
        if len(frame.data) > binding.layout.length:
            self._raise_length(ErrorCode.PDO_TOO_LONG, binding, frame)
        elif binding.name in self.emergencies.errors:
            self.emergencies.cleared(binding.name)
        if binding in self._synchronous:
            self._synchronous.hold(Arrival(binding, frame.data, message))
            return Reaction([])
        if binding.layout.length:
            self._process.note(binding, frame.data)
        return Reaction([], message)

    def _receive_sync(self, _: Frame) -> Reaction:
        """Send what goes with this SYNC, with the values of now, and let take effect what has waited for it."""
        if not self.operational:
            return Reaction([])
        frames = [self._process.frame(binding) for binding in self._synchronous.due()]
        arrived = self._synchronous.arrived()
        for each in arrived:
            self._process.note(each.binding, each.data)
        return Reaction(frames, synchronous=tuple(each.message for each in arrived))

    def _raise_length(self, code: ErrorCode, binding: Binding, frame: Frame) -> None:
        self.emergencies.raised(code, binding.name, frame.cob_id.to_bytes(2, "little") + bytes([len(frame.data)]))

    def transmit(self, message: Message) -> Frame:
        """Return the frame of a message as this device would send it.

        Raises StateError if it is not one of its TPDOs or if its NMT state does not allow it, FieldError for a value.
        """
        return self._sendable(message).encode(message)

    def _sendable(self, message: Message) -> Binding:
        binding = self._pdos.sent.get(type(message))
        if binding is None:
            raise StateError(f"{self.dictionary.name} has no TPDO for {type(message).__name__}")
        if not self.operational and not binding.always:
            raise StateError(f"{self.dictionary.name} is {self.state.name}: only stops may be sent")
        return binding

    def send(self, message: Message, now: float) -> list[Frame]:
        """Return the frame of a message to send now, none if it has to wait for SYNC or for its inhibit time.

        Raises as `transmit`.
        """
        binding = self._pdos.sent.get(type(message)) if self.operational else None
        if binding is None:
            binding = self._sendable(message)  # a stop, or it says what is wrong
        frame = binding.encode(message)
        if frame.data:
            self._process.note(binding, frame.data)
        if binding in self._synchronous:
            self._synchronous.ask(binding)
            return []
        frames = self._pacing.admit(binding, frame, now)
        if not frames:
            self.plan.at(self._pacing.next)
        return frames
