"""One CANopen device, made from its EDS: NMT, SDO server, PDOs, SYNC, TIME, heartbeats, emergencies, stored values.

There is no clock and no bus in here: frames and the time in seconds go in, frames and typed messages come out. What a
peer sends wrong becomes an EMCY, an SDO abort and a count, never an exception.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import NamedTuple

from eurobot_od.controller import Stay
from eurobot_od.device import broadcasts, nmt
from eurobot_od.device.bound import NO_APPLICATION, Application, BoundObjects
from eurobot_od.device.lss import Commissioning, LssSlave
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.device.objects import COMMUNICATION_PROFILE, Objects, OnRead, OnWrite, Store, predefined, refused
from eurobot_od.device.pdo import Pacing, Pdos, ProcessData
from eurobot_od.device.timers import Deadlines, Plan, caught_up
from eurobot_od.errors import DamagedFile, DictionaryError, FrameLengthError, StateError
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.dictionary import Dictionary, SdoChannel
from eurobot_od.od.objects import data_type
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import BASE_IDENTIFIER, ERROR_CONTROL_BASE, NMT_COB_ID, RESTRICTED, Address, Value, owner
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import NOTHING, Catalogue, Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import Abort, Reason

ON_COMMUNICATION_ERROR: Mapping[int, NmtCommand | None] = {
    0: NmtCommand.ENTER_PRE_OPERATIONAL,
    1: None,
    2: NmtCommand.STOP,
}
"""What an operational device does when a heartbeat is lost, by its error behaviour 0x1029:1 (CiA 301, 7.5.2.32)."""


class Reaction(NamedTuple):
    """What a frame, or the time, did to a device.

    The `frames` to send, the `message` for the application, whether it was `reset`, the node-IDs whose heartbeats were
    `lost`, an SDO `answer` to the device as a client, the node-ID of a watched node that has `booted`, and the
    `synchronous` messages, which had waited for SYNC.
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
    objects are bound to. `operational` tells whether its NMT `state` allows PDOs. `objects` has its values, `pdos` its
    PDOs and `protocol` their messages as they are mapped now, `identifiers` the COB-IDs of all frames that it listens
    to, including remote frames; both are replaced as a whole when a master changes them. `time_of_day` is its clock,
    which no reset changes. `sdo_requests` and `sdo_answers` are the COB-IDs of its SDO server; a master cannot change
    them (CiA 301, 7.5.2.33: ro). `plan` has what frames have made it plan, and `next_wakeup` everything. `refused` has
    a sentence for each stored value that cannot be used: the default takes its place, and an EMCY says so at each start
    until the device stores again. With `lss` it is found and given its node-ID by LSS; without a node-ID, `node_id` is
    255, and it has no other service.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        store: Store | None = None,
        catalogue: Catalogue = NOTHING,
        application: Application = NO_APPLICATION,
        lss: LssSlave | None = None,
    ) -> None:
        self._file, self._catalogue, self._application, self._lss = dictionary, catalogue, application, lss
        if lss:
            lss.store = self._store_commissioning
        self._store, self.plan, self.time_of_day = store, Plan(), broadcasts.Clock()
        self.refused: tuple[str, ...] = ()
        values: dict[Address, Value] = {}
        try:
            values |= store.load() if store else {}
        except DamagedFile as error:
            self.refused = (f"{error}; the defaults are taken",)
        # One by one: if a newer file has narrowed one range, all other stored values must survive.
        wrong = dict(refused(dictionary, values))
        self.refused += tuple(f"stored value refused: {what}" for what in wrong.values())
        self._stored = {address: value for address, value in values.items() if address not in wrong}
        self.state = NmtState.INITIALISING
        self._now, self._silent_until = 0.0, -inf
        self._load(dict(self._stored))

    @property
    def state(self) -> NmtState:
        """The NMT state."""
        return self._state

    @state.setter
    def state(self, state: NmtState) -> None:
        self._state = state
        self._listens, self._reports, self._serves, self.operational = nmt.SERVICES[state]

    def _load(self, values: dict[Address, Value]) -> None:
        """Make everything from these values, as after power-on or a reset."""
        own = self._file.node_id_address
        if own and self._lss:
            values[own] = self._lss.active.node_id
        number = values.setdefault(own, self._file.node_id) if own else self._file.node_id
        self.node_id = number if isinstance(number, int) else self._file.node_id
        if self._lss:
            self.node_id = self._lss.active.node_id
        if self.node_id == standard.UNCONFIGURED:  # it stays there, and has no service but LSS
            self.state = NmtState.INITIALISING
        # Values with $NODEID in them, above all identifiers, follow a new node-ID (CiA 306-1).
        is_of_file = self.node_id in (self._file.node_id, standard.UNCONFIGURED)
        self.dictionary = self._file if is_of_file else self._file.renumbered(self.node_id)
        # Functions, because a master may change 0x1014 and 0x1015 at any time; the inhibit time counts 100 µs.
        self.emergencies = broadcasts.Emergencies(
            lambda: self.objects.cob_id(standard.EMCY), lambda: self.objects.raw(standard.EMCY_INHIBIT_TIME) / 10_000
        )
        readers: dict[int, OnRead] = {}  # filled by _connect: what reads an object is made from the objects
        writers: dict[int, OnWrite] = {}
        given = {**predefined(self.dictionary), **self._application.given}
        self.objects = Objects(self.dictionary, readers, writers, given, self._application.told)
        self.objects.values = values
        self.pdos = Pdos(self.objects, self._catalogue)
        bound = BoundObjects(self.objects, self._catalogue, self._application, self._command)
        self._connect(bound, readers, writers)
        self._process = ProcessData(self.objects)
        self._pacing = Pacing(self.pdos.inhibit_time, self.pdos.event_timer)
        self._synchronous = broadcasts.Synchronous(self.pdos.sync_type, self.pdos.sync_start)
        self._sync = broadcasts.SyncProducer()
        self._deadlines = Deadlines[Binding]()
        self._sampled: dict[Binding, Frame] = {}
        self._guarding = nmt.NodeGuarding()
        self._server = SdoServer(self.objects)
        self._consumer = nmt.HeartbeatConsumer()
        self._next_heartbeat = inf
        self._beating = False
        self._configure()

    def _connect(self, bound: BoundObjects, readers: dict[int, OnRead], writers: dict[int, OnWrite]) -> None:
        """Enter what reads and writes the objects that are more than a value."""
        eds = self.dictionary.variable(standard.STORED_EDS)
        # In some files 0x1021 is a number, of a fixed size that no EDS has: then it keeps its value like any other
        # object.
        serves_eds = eds is not None and not data_type(eds).size
        readers |= {
            **bound.readers(),
            standard.ERROR_REGISTER[0]: lambda _: self.emergencies.register,
            standard.ERROR_FIELD: self.emergencies.read_field,
            **({standard.STORED_EDS[0]: lambda _: self.dictionary.content} if serves_eds else {}),
        }
        writers |= {
            **bound.writers(),
            standard.ERROR_FIELD: self.emergencies.clear_field,
            **dict.fromkeys((standard.STORE, standard.RESTORE), self._keep),
            standard.CONSUMED_HEARTBEATS: self._consume,
            standard.HEARTBEAT_TIME[0]: self._produce,
            **dict.fromkeys(
                (standard.GUARD_TIME[0], standard.LIFE_TIME_FACTOR[0], standard.TIME[0]),
                self._followed(self.objects.put),
            ),
            **{index: self._followed(write) for index, write in self.pdos.writers().items()},
        }
        for index, _ in (standard.SYNC, standard.TIME, standard.EMCY):
            writers[index] = self._unrestricted(writers.get(index, self.objects.put))

    def _configure(self) -> None:
        """Listen to the services as they are configured now."""
        self._consumer.configure(self._consumed())
        self._guarding.configure(self._life_time())
        self.sdo_requests, self.sdo_answers = SdoChannel.of(self.dictionary)
        time, sync = self.objects.raw(standard.TIME), self.objects.raw(standard.SYNC)
        # Bit 30 of 0x1005 and 0x1012: the device itself sends SYNC or TIME (CiA 301, 7.5.2.5 and 7.5.2.15).
        produced = {each & BASE_IDENTIFIER for each in (time, sync) if each & broadcasts.TIME_PRODUCER}
        self._periodic = produced | {ERROR_CONTROL_BASE + self.node_id}
        # Sub-index 2 of 0x1280 and following: where a server answers this device as its client (7.5.2.34).
        clients = [index for index in standard.SDO_CLIENTS if index in self.dictionary.members]
        answers = {self.objects.cob_id((index, 2)) for index in clients}
        # Where a file gives two services the same identifier, the later one in this table gets it: NMT is never lost.
        ears: dict[int | None, Ear] = {
            **dict.fromkeys(self._consumer.identifiers, self._receive_heartbeat),
            **dict.fromkeys(answers, lambda frame: Reaction([], answer=frame)),
            **dict.fromkeys(self.pdos.received, self._receive_pdo),
            time & BASE_IDENTIFIER if time & broadcasts.TIME_CONSUMER else None: self._receive_time,
            self.pdos.sync_cob_id: self._receive_sync,
            self.sdo_requests: self._receive_sdo,
            NMT_COB_ID: self._receive_command,
        }
        self._ears = {cob_id: ear for cob_id, ear in ears.items() if cob_id is not None}
        self._remote_ears: dict[int, Ear] = dict.fromkeys(self.pdos.requestable, self._send_requested)
        if standard.GUARD_TIME[0] in self.dictionary.members:
            self._remote_ears[ERROR_CONTROL_BASE + self.node_id] = self._answer_guard
        if self.node_id == standard.UNCONFIGURED:
            self._ears, self._remote_ears = {}, {}
        if self._lss:
            self._ears[standard.REQUESTS] = self._receive_lss
        self.identifiers = sorted({*self._ears, *self._remote_ears})
        self._restart_pdos()
        self._restart_broadcasts()

    def _restart_pdos(self) -> None:
        self._pacing.restart(self.pdos.sent.values(), self._now)
        self._synchronous.restart(self.pdos.sent.values(), self.pdos.received.values())
        # They belong to a SYNC before the change, and must not answer a remote frame.
        self._sampled.clear()
        # Decided here and not at each SYNC, which would ask hundreds of PDOs of many devices in each period.
        self._at_sync = [each for each in self.pdos.requestable.values() if self.pdos.is_sampled(each)]
        self._following = [each for each in self.pdos.sent.values() if self.pdos.follows_changes(each)]
        for binding in self._deadlines.missed:  # nobody would report them as back: the watch starts over
            self.emergencies.cleared((Deadlines, binding.name))
        received = self.pdos.received.values()
        self._deadlines.restart({each: time for each in received if (time := self.pdos.deadline(each))})

    def _restart_broadcasts(self) -> None:
        """Send SYNC and TIME from now on, if they are configured and the NMT state allows them (CiA 301, Table 36)."""
        self._sync.restart(self.pdos.sync_period if self._reports else 0.0, self.pdos.sync_counter, self._now)
        time = self.objects.raw(standard.TIME)
        sends = self._reports and time & broadcasts.TIME_PRODUCER and time & BASE_IDENTIFIER
        self.time_of_day.restart(broadcasts.TIME_PERIOD if sends else 0.0, self._now)

    @property
    def service_identifiers(self) -> list[int]:
        """The present COB-IDs of all services of the device except its PDOs."""
        said = (self.objects.cob_id(standard.EMCY), self.pdos.sync_cob_id, self.objects.raw(standard.TIME))
        broadcast = [each & BASE_IDENTIFIER for each in said if each]
        return [NMT_COB_ID, self.sdo_requests, self.sdo_answers, ERROR_CONTROL_BASE + self.node_id, *broadcast]

    @property
    def protocol(self) -> Protocol:
        """The messages of the PDOs that are valid now."""
        return self.pdos.protocol

    def stay(self, frame: Frame) -> Stay:
        """Return how long a frame of this device waits to be sent."""
        if frame.cob_id == self.sdo_answers:
            return Stay.TRANSFER
        if frame.cob_id in self.pdos.always_sent:
            return Stay.LASTING
        if frame.cob_id not in self._periodic:
            return Stay.SHORT
        # Without its boot-up message, which is sent only once, a master does not learn that the node is there, or has
        # forgotten everything.
        return Stay.LASTING if frame == nmt.error_control(self.node_id, NmtState.INITIALISING) else Stay.PERIODIC

    # Values

    def number(self, address: Address) -> int:
        """Return an object's present value as a number; raises DictionaryError if it has none."""
        return self.objects.number(address)

    @property
    def aborted(self) -> Abort | None:
        """Why the device last aborted an SDO transfer; None if it has not since it was switched on or reset."""
        return self._server.aborted

    def settle(self) -> None:
        """Store in the objects what PDOs have brought."""
        self._process.settle()

    # Objects that do more than keep a value

    def _followed(self, write: OnWrite) -> OnWrite:
        """Return a function that writes an object and then reconfigures what the device listens to."""

        def written(address: Address, value: Value) -> None:
            write(address, value)
            self._configure()

        return written

    def _unrestricted(self, write: OnWrite) -> OnWrite:
        """Return a function that gives a service no new COB-ID that another one has for good (CiA 301, 7.3.5)."""

        def written(address: Address, value: Value) -> None:
            cob_id = value & BASE_IDENTIFIER if isinstance(value, int) else 0
            is_new = cob_id and cob_id != self.objects.raw(address) & BASE_IDENTIFIER
            if is_new and owner(cob_id, RESTRICTED):
                raise Abort(Reason.COB_ID_TAKEN)
            write(address, value)

        return written

    def _command(self, binding: Binding, message: Message) -> None:
        """Have the application act on a message that was written by SDO; raises Abort or Refused if it does not."""
        if not self.operational and not binding.always:
            raise Abort(Reason.WRONG_STATE, f"{self.dictionary.name} is {self.state.name}")
        self._application.act(message)

    def _keep(self, address: Address, signature: Value) -> None:
        """Store the present values, or restore the file's from the next reset on (CiA 301, 7.5.2.13, 7.5.2.14)."""
        # Spelt out, as `save` and `load`, so that no stray write stores or restores anything.
        if signature != int.from_bytes(standard.SIGNATURES[address[0]], "little"):
            raise Abort(Reason.SIGNATURE)
        values = self.objects.configuration() if address[0] == standard.STORE else {}
        own = self._file.node_id_address
        try:
            if self._store and self._lss:
                self._store.save(values, *self._lss.stored)
            elif self._store:
                self._store.save(values, self.objects.number(own) if own else self.node_id)
        except (OSError, DictionaryError) as error:
            raise Abort(Reason.NOT_STORED, str(error)) from error
        # The values refused at the start have been overwritten: there is nothing left to complain about.
        self._stored, self.refused = values, ()
        self.emergencies.cleared(Store)
        if own and address[0] == standard.RESTORE:
            self.objects.values.pop(own, None)  # a reset keeps the present node-ID

    def _store_commissioning(self, commissioning: Commissioning) -> bool:
        """Store node-ID and bit rate beside the values that are stored already; return whether that was possible."""
        try:
            if self._store:
                self._store.save(self._stored, *commissioning)
        except (OSError, DictionaryError):
            return False
        return True

    def _consumed(self) -> list[int]:
        count = self.objects.raw((standard.CONSUMED_HEARTBEATS, 0))
        return [self.objects.raw((standard.CONSUMED_HEARTBEATS, subindex)) for subindex in range(1, count + 1)]

    def _consume(self, address: Address, value: Value) -> None:
        """Watch another node's heartbeat; no node may be watched twice (CiA 301, 7.5.2.19)."""
        node_id, time = nmt.heartbeat_entry(value if isinstance(value, int) else 0)
        others = [
            nmt.heartbeat_entry(entry) for subindex, entry in enumerate(self._consumed(), 1) if subindex != address[1]
        ]
        # With two times, one node would be lost by one of them and still there by the other.
        if time and any(node_id == other and others_time for other, others_time in others):
            raise Abort(Reason.WATCHED_TWICE)
        self.objects.put(address, value)
        self._configure()

    def _produce(self, address: Address, value: Value) -> None:
        self.objects.put(address, value)
        # From now on, not when the rest of the old period is over, which may take a minute.
        self._plan_heartbeat(self._now)
        self._guarding.configure(self._life_time())

    def _life_time(self) -> float:
        """Return how long a guarding master may be silent; 0.0 for ever, or if heartbeats are used instead."""
        factor = 0 if self.objects.raw(standard.HEARTBEAT_TIME) else self.objects.raw(standard.LIFE_TIME_FACTOR)
        return self.objects.raw(standard.GUARD_TIME) / 1000 * factor

    # NMT

    def start(self, now: float) -> list[Frame]:
        """Boot: send the boot-up message and enter the state given by NMT startup 0x1F80 (CiA 301, 7.3.2.2)."""
        self._now = now
        self._beating = False
        if self.node_id == standard.UNCONFIGURED:
            self._listens = True  # to LSS alone
            return []
        self._plan_heartbeat(now)
        # By EMCY as well: when a device boots with defaults, nobody may be looking at a console.
        if self.refused:
            self.emergencies.raised(ErrorCode.DATA_SET, Store)
        self._enter(nmt.boot_state(self.objects.value(standard.NMT_STARTUP)))
        return [nmt.error_control(self.node_id, NmtState.INITIALISING)]

    def _enter(self, state: NmtState) -> None:
        reported, self.state = self._reports, state
        self._restart_pdos()
        self._process.seen.clear()  # every PDO counts as changed
        # SYNC and TIME run in PRE-OPERATIONAL and OPERATIONAL: a change between them must not shift their periods.
        if reported is not self._reports:
            self._restart_broadcasts()
        if state is NmtState.STOPPED:  # no SDO there, not even an abort after a time-out
            self._server.forget()

    def _plan_heartbeat(self, now: float) -> None:
        period = self.objects.raw(standard.HEARTBEAT_TIME)
        self._next_heartbeat = now + period / 1000 if period else inf

    def first_heartbeat(self) -> list[Frame]:
        """Return a heartbeat to send now, if there are heartbeats and none has been sent since the boot-up.

        For a node that others have to miss from now on: they watch it from its first heartbeat.
        """
        if self._beating or self._next_heartbeat == inf:
            return []
        self._beating = True
        return [nmt.error_control(self.node_id, self.state)]

    def restart(self, now: float) -> Reaction:
        """Do what an NMT command to reset the node does."""
        self._now = now
        return self._reset(NmtCommand.RESET_NODE)

    def _reset(self, command: NmtCommand) -> Reaction:
        """Restore what was stored, except for a new node-ID, which takes effect now (CiA 301, 7.3.2.2.3)."""
        if self._lss:
            (self._lss.power_on if command is NmtCommand.RESET_NODE else self._lss.activate)()
        values = dict(self._stored)
        if command is NmtCommand.RESET_COMMUNICATION:
            # Only 0x1000 to 0x1FFF go back to what was stored; the application keeps its parameters as they are.
            values = {a: value for a, value in values.items() if a[0] in COMMUNICATION_PROFILE}
            values |= {a: v for a, v in self.objects.values.items() if a[0] not in COMMUNICATION_PROFILE}
        if self._file.node_id_address:
            values[self._file.node_id_address] = self.objects.value(self._file.node_id_address)
        self._load(values)
        return Reaction(self.start(self._now), reset=True)

    # Time

    @property
    def next_wakeup(self) -> float:
        """Time at which to call `tick`, infinite if nothing is planned."""
        if self._now < self._silent_until:
            return self._silent_until
        soonest = min(self._next_heartbeat, self._server.deadline, self._consumer.next, self._guarding.next)
        # Whatever the NMT state holds back must not wake anybody: `tick` would do nothing, and be called again at once.
        if self.operational:
            soonest = min(soonest, self._pacing.next, self._deadlines.next)
        if self._reports:
            soonest = min(soonest, self._sync.next, self.time_of_day.next, self.emergencies.next)
        return soonest

    def tick(self, now: float) -> Reaction:
        """Do what is due: send heartbeat and TPDOs at their times, and notice nodes that have fallen silent."""
        self._now = now
        if now < self.next_wakeup:  # the application has set a timer: most ticks of a node that moves
            return Reaction([])
        self._listens = True  # again, if it has changed its bit rate
        frames = []
        if now >= self._next_heartbeat:
            # From its planned time, or each late call would put off all later heartbeats.
            self._plan_heartbeat(caught_up(self._next_heartbeat, now))
            self._beating = True
            frames.append(nmt.error_control(self.node_id, self.state))
        own = self._broadcast(now)
        frames += own.frames
        if self.operational:
            # These come first: what an inhibit time has held back is older than what an event timer sends now.
            frames += self._pacing.released(now)
            frames += [self._process.frame(binding) for binding in self._pacing.due(now)]
            for binding in self._deadlines.overdue(now):
                cob_id = binding.cob_id.to_bytes(2, "little")
                self.emergencies.raised(ErrorCode.PDO_MISSING, (Deadlines, binding.name), cob_id)
        frames += self._sdo_frames(self._server.tick(now))
        lost = self._lose(now)
        return Reaction(frames + self.emergency_frames(now), lost=lost, synchronous=own.synchronous)

    def _broadcast(self, now: float) -> Reaction:
        """Send SYNC and TIME at their times; the device's own SYNC does what another's would."""
        frames = [Frame(self.objects.raw(standard.TIME) & BASE_IDENTIFIER, data) for data in self.time_of_day.due(now)]
        messages: tuple[Message, ...] = ()
        for data in self._sync.due(now):
            sync = Frame(self.objects.raw(standard.SYNC) & BASE_IDENTIFIER, data)
            # A CAN controller does not receive its own frames, so PDOs would miss the device's own SYNC.
            followed = self._receive_sync(sync)
            frames += [sync, *followed.frames]
            messages += followed.synchronous
        return Reaction(frames, synchronous=messages)

    def _lose(self, now: float) -> tuple[int, ...]:
        """Notice nodes that have fallen silent, and a silent master that guards this one (CiA 301, 7.5.2.32)."""
        lost, unguarded = tuple(self._consumer.overdue(now)), self._guarding.overdue(now)
        for node_id in lost:
            self.emergencies.raised(ErrorCode.HEARTBEAT_LOST, (nmt.HeartbeatConsumer, node_id), bytes([node_id]))
        if unguarded:
            self.emergencies.raised(ErrorCode.HEARTBEAT_LOST, nmt.NodeGuarding)
        # 0x1029 counts only for a device at work: in other states there are no PDOs to be stopped.
        command = ON_COMMUNICATION_ERROR.get(self.objects.raw(standard.COMMUNICATION_ERROR))
        if (lost or unguarded) and command is not None and self.operational:
            self._enter(nmt.TARGET[command])
        return lost

    def bus_lost(self) -> None:
        """Give up the SDO transfer that is under way, as its client will."""
        self._server.forget()

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
        return self._hear(self._ears.get(frame.cob_id), frame, now)

    def requested(self, cob_id: int, now: float) -> Reaction:
        """Take in one remote frame, which asks for a TPDO or whether the device is there."""
        return self._hear(self._remote_ears.get(cob_id), Frame(cob_id), now)

    def _hear(self, ear: Ear | None, frame: Frame, now: float) -> Reaction:
        if ear is None or not self._listens:
            return Reaction([])
        self._now = now
        reaction = ear(frame)
        # Every frame comes through here, and errors are rare: a flag is cheaper than a call.
        if not self.emergencies.quiet:
            reaction.frames.extend(self.emergency_frames(now))
        if reaction.message is None:  # a message for the application plans nothing here
            self.plan.at(self.next_wakeup)
        return reaction

    def _receive_command(self, frame: Frame) -> Reaction:
        command = nmt.command_in(frame, self.node_id)
        if command in nmt.TARGET:
            self._enter(nmt.TARGET[command])
        return Reaction([]) if command is None or command in nmt.TARGET else self._reset(command)

    def _receive_lss(self, frame: Frame) -> Reaction:
        """Answer a request of LSS, which a device at work has not; boot once a node-ID is given."""
        if self._lss is None or self.operational:
            return Reaction([])
        answer = self._lss.receive(frame.data, self._now)
        if self._lss.needs_boot:
            return self._reset(NmtCommand.RESET_COMMUNICATION)
        if self._lss.silent_until > self._now:
            self._silent_until, self._listens = self._lss.silent_until, False
        return Reaction([] if answer is None else [Frame(standard.ANSWERS, answer)])

    def _receive_heartbeat(self, frame: Frame) -> Reaction:
        node_id = frame.cob_id - ERROR_CONTROL_BASE
        boot_up = frame == nmt.error_control(node_id, NmtState.INITIALISING)
        if (self._consumer.booted if boot_up else self._consumer.heard)(node_id, self._now):
            self.emergencies.cleared((nmt.HeartbeatConsumer, node_id))
        return Reaction([], booted=node_id if boot_up else None)

    def _answer_guard(self, _: Frame) -> Reaction:
        """Answer that the device is there; a device that sends heartbeats is not guarded (CiA 301, 7.2.8.2.2)."""
        if self.objects.raw(standard.HEARTBEAT_TIME):
            return Reaction([])
        if self._guarding.missed:
            self.emergencies.cleared(nmt.NodeGuarding)
        return Reaction([self._guarding.answer(self.node_id, self.state, self._now)])

    def _send_requested(self, frame: Frame) -> Reaction:
        """Send a TPDO that was asked for; a sampled one has the values of the last SYNC."""
        binding = self.pdos.requestable[frame.cob_id]
        if not self.operational:
            return Reaction([])
        return Reaction([self._sampled.get(binding) or self._process.frame(binding)])

    def _receive_time(self, frame: Frame) -> Reaction:
        self.time_of_day.hear(frame.data, self._now)
        return Reaction([])

    def _receive_sdo(self, frame: Frame) -> Reaction:
        if not self._serves:
            return Reaction([])
        self._process.settle()  # first, so that a read gives the values of the latest PDO
        return Reaction(self._sdo_frames(self._server.receive(frame.data, self._now)))

    def _sdo_frames(self, answers: list[bytes]) -> list[Frame]:
        return [Frame(self.sdo_answers, data) for data in answers]

    def _receive_pdo(self, frame: Frame) -> Reaction:
        binding = self.pdos.received[frame.cob_id]
        if not self.operational and not binding.always:
            return Reaction([])
        try:
            message = binding.decode(frame.data)
        except FrameLengthError:  # too short is not processed, too long as far as it is mapped (CiA 301, Table 26)
            self._raise_length(ErrorCode.PDO_TOO_SHORT, binding, frame)
            return Reaction([])
        if len(frame.data) > binding.layout.length:
            self._raise_length(ErrorCode.PDO_TOO_LONG, binding, frame)
        # The length is right again: the end of an error is reported as well, by the error code 0x0000.
        elif binding.name in self.emergencies.errors:
            self.emergencies.cleared(binding.name)
        if self._deadlines.heard(binding, self._now):
            self.emergencies.cleared((Deadlines, binding.name))
        if binding in self._synchronous:
            self._synchronous.hold(broadcasts.Arrival(binding, frame.data, message))
            return Reaction([])
        if binding.layout.length:
            self._process.note(binding, frame.data)
        return Reaction([], message)

    def _receive_sync(self, sync: Frame) -> Reaction:
        """Send what goes with this SYNC, with the present values; then let what waited for it take effect."""
        if not self.operational:
            return Reaction([])
        # In this order: a TPDO carries the values at the SYNC, not those that the SYNC lets in.
        number = sync.data[0] if sync.data else None
        frames = [self._process.frame(binding) for binding in self._synchronous.due(number)]
        self._sampled = {binding: self._process.frame(binding) for binding in self._at_sync}
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
        binding = self.pdos.sent.get(type(message))
        if binding is None:
            raise StateError(f"{self.dictionary.name} has no TPDO for {type(message).__name__}; {self._has('send')}")
        if not self.operational and not binding.always:
            raise StateError(f"{self.dictionary.name} is {self.state.name}: only stops may be sent")
        return binding

    def check_received(self, message: type[Message]) -> None:
        """Raise StateError if no RPDO carries a message."""
        if message not in {each.type for each in self.pdos.received.values()}:
            raise StateError(f"{self.dictionary.name} has no RPDO for {message.__name__}; {self._has('receive')}")

    def _has(self, way: str) -> str:
        return f"{self.dictionary.file} says what it can {way}"

    def send(self, message: Message, now: float) -> list[Frame]:
        """Return the frame of a message to send now; none if it has to wait for SYNC or for its inhibit time.

        Raises the errors of `transmit`.
        """
        binding = self.pdos.sent.get(type(message)) if self.operational else None
        if binding is None:
            binding = self._sendable(message)  # a stop, or the error says what is wrong
        frame = binding.encode(message)
        if frame.data:  # into the objects as well: an SDO, a SYNC or a remote frame has to find what was sent last
            self._process.note(binding, frame.data)
        if binding in self._synchronous:
            self._synchronous.ask(binding)
            return []
        frames = self._pacing.admit(binding, frame, now)
        if not frames:
            self.plan.at(self._pacing.next)
        return frames

    def changed(self, now: float, may_go: Callable[[Binding], bool] | None = None) -> list[Frame]:
        """Return the event-driven TPDOs whose values have changed since this was last asked.

        It is for a device whose application sends nothing by itself. Each TPDO counts as changed when the device
        becomes OPERATIONAL. One that goes with the next SYNC waits for it (transmission type 0), an inhibited one is
        held back, and one that `may_go` refuses is passed over until its next change.
        """
        self._process.settle()
        frames: list[Frame] = []
        for binding, frame in self._process.changed(self._following) if self.operational else ():
            if may_go is not None and not may_go(binding):
                continue
            if binding in self._synchronous:
                self._synchronous.ask(binding)
            else:
                frames += self._pacing.admit(binding, frame, now)
        self.plan.at(self._pacing.next)
        return frames
