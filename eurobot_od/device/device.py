"""One CANopen device, made from its EDS: it joins its parts, and each part has its clauses of CiA 301.

| part | clauses |
|---|---|
| `nmt.NmtStates` | NMT states and their services: 7.3.2.2 |
| `error_control.ErrorControl` | heartbeats, node guarding: 7.2.8.2.2 |
| `pdo_service.PdoService` | PDOs: 7.2.2 |
| `sync_time.SyncAndTime` | SYNC, TIME: 7.2.5, 7.2.6 |
| `broadcasts.Emergencies` | EMCY: 7.2.7 |
| `storage.Storage` | stored values: 7.5.2.13, 7.5.2.14 |
| `sdo.server.SdoServer` | SDO: 7.2.4 |
| `lss.LssSlave` | LSS: CiA 305 |

There is no clock and no bus in here: frames and the time in seconds go in, frames and typed messages come out. What a
peer sends wrong becomes an EMCY, an SDO abort and a count, never an exception.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from eurobot_od.controller import Stay
from eurobot_od.device import broadcasts, nmt
from eurobot_od.device.bound import NO_APPLICATION, Application, BoundObjects
from eurobot_od.device.error_control import ErrorControl
from eurobot_od.device.lss import LssSlave
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.device.objects import Objects, OnRead, OnWrite, Store, predefined
from eurobot_od.device.pdo_service import PdoService
from eurobot_od.device.reaction import Ear, Reaction
from eurobot_od.device.storage import Storage
from eurobot_od.device.sync_time import SyncAndTime
from eurobot_od.device.timers import Plan
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
        self._storage = Storage(dictionary, store, lss)
        self._nmt, self.plan, self.time_of_day = nmt.NmtStates(), Plan(), broadcasts.Clock()
        self._now, self._silent_until = 0.0, -inf
        self._load(dict(self._storage.values))

    @property
    def refused(self) -> tuple[str, ...]:
        """A sentence for each stored value that cannot be used."""
        return self._storage.refused

    @property
    def state(self) -> NmtState:
        """The NMT state."""
        return self._nmt.state

    @state.setter
    def state(self, state: NmtState) -> None:
        self._nmt.state = state

    @property
    def operational(self) -> bool:
        """Whether the NMT state allows PDOs."""
        return self._nmt.operational

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
        self._pdo = PdoService(self.objects, self._catalogue, self._nmt, self.emergencies)
        self.pdos = self._pdo.pdos
        self._error_control = ErrorControl(self.objects, self._nmt, self.emergencies, self.node_id)
        self._sync_and_time = SyncAndTime(self.objects, self._nmt, self._pdo, self.time_of_day)
        self._server = SdoServer(self.objects)
        self._connect(readers, writers)
        self._configure()

    def _connect(self, readers: dict[int, OnRead], writers: dict[int, OnWrite]) -> None:
        """Enter what reads and writes the objects that are more than a value."""
        bound = BoundObjects(self.objects, self._catalogue, self._application, self._command)
        stored = partial(self._storage.write, self.objects, self.emergencies, self.node_id)
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
            **dict.fromkeys((standard.STORE, standard.RESTORE), stored),
            standard.CONSUMED_HEARTBEATS: self._followed(self._error_control.watch),
            standard.HEARTBEAT_TIME[0]: lambda address, time: self._error_control.set_period(address, time, self._now),
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
        self._error_control.configure()
        self.sdo_requests, self.sdo_answers = SdoChannel.of(self.dictionary)
        self._periodic = self._sync_and_time.produced | {self._error_control.own}
        # Sub-index 2 of 0x1280 and following: where a server answers this device as its client (7.5.2.34).
        clients = [index for index in standard.SDO_CLIENTS if index in self.dictionary.members]
        answers = {self.objects.cob_id((index, 2)) for index in clients}
        # Where a file gives two services the same identifier, the later one in this table gets it: NMT is never lost.
        ears: dict[int | None, Ear] = {
            **dict.fromkeys(self._own_identifiers(), self._overhear),
            **self._error_control.ears,
            **dict.fromkeys(answers, lambda frame, _: Reaction([], answer=frame)),
            **dict.fromkeys(self.pdos.received, self._pdo.receive),
            **self._sync_and_time.ears,
            self.sdo_requests: self._receive_sdo,
            NMT_COB_ID: self._receive_command,
        }
        self._ears = {cob_id: ear for cob_id, ear in ears.items() if cob_id is not None}
        self._remote_ears: dict[int, Ear] = {
            **dict.fromkeys(self.pdos.requestable, self._pdo.requested),
            **self._error_control.remote_ears,
        }
        if self.node_id == standard.UNCONFIGURED:
            self._ears, self._remote_ears = {}, {}
        if self._lss:
            self._ears[standard.REQUESTS] = self._receive_lss
        self.identifiers = sorted({*self._ears, *self._remote_ears})
        self._pdo.restart(self._now)
        self._sync_and_time.restart(self._now)

    def _own_identifiers(self) -> list[int]:
        """Return the identifiers that nobody else may use, if the application wants to hear of those who do."""
        sent = (each.cob_id for each in self.pdos.sent.values())
        return [] if self._application.overheard is None else [*sent, ERROR_CONTROL_BASE + self.node_id]

    def _overhear(self, frame: Frame, _: float) -> Reaction:
        if self._application.overheard is not None:
            self._application.overheard(frame)
        return Reaction([])

    @property
    def service_identifiers(self) -> list[int]:
        """The present COB-IDs of all services of the device except its PDOs."""
        said = (self.objects.cob_id(standard.EMCY), self.pdos.sync_cob_id, self.objects.raw(standard.TIME))
        broadcast = [each & BASE_IDENTIFIER for each in said if each]
        return [NMT_COB_ID, self.sdo_requests, self.sdo_answers, self._error_control.own, *broadcast]

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
        self._pdo.settle()

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

    # NMT

    def start(self, now: float) -> list[Frame]:
        """Boot: send the boot-up message and enter the state given by NMT startup 0x1F80 (CiA 301, 7.3.2.2)."""
        self._now = now
        if self.node_id == standard.UNCONFIGURED:
            self._nmt.listens = True  # to LSS alone
            return []
        self._error_control.start(now)
        # By EMCY as well: when a device boots with defaults, nobody may be looking at a console.
        if self.refused:
            self.emergencies.raised(ErrorCode.DATA_SET, Store)
        self._enter(nmt.boot_state(self.objects.value(standard.NMT_STARTUP)))
        return [nmt.error_control(self.node_id, NmtState.INITIALISING)]

    def _enter(self, state: NmtState) -> None:
        reported, self.state = self._nmt.reports, state
        self._pdo.enter(self._now)
        # SYNC and TIME run in PRE-OPERATIONAL and OPERATIONAL: a change between them must not shift their periods.
        if reported is not self._nmt.reports:
            self._sync_and_time.restart(self._now)
        if state is NmtState.STOPPED:  # no SDO there, not even an abort after a time-out
            self._server.forget()

    def first_heartbeat(self) -> list[Frame]:
        """Return a heartbeat to send now, if there are heartbeats and none has been sent since the boot-up.

        For a node that others have to miss from now on: they watch it from its first heartbeat.
        """
        return self._error_control.first_heartbeat()

    def restart(self, now: float) -> Reaction:
        """Do what an NMT command to reset the node does."""
        self._now = now
        return self._reset(NmtCommand.RESET_NODE)

    def _reset(self, command: NmtCommand) -> Reaction:
        """Restore what was stored, except for a new node-ID, which takes effect now (CiA 301, 7.3.2.2.3)."""
        if self._lss:
            (self._lss.power_on if command is NmtCommand.RESET_NODE else self._lss.activate)()
        self._load(self._storage.after(command, self.objects))
        return Reaction(self.start(self._now), reset=True)

    # Time

    @property
    def next_wakeup(self) -> float:
        """Time at which to call `tick`, infinite if nothing is planned."""
        if self._now < self._silent_until:
            return self._silent_until
        # Whatever the NMT state holds back must not wake anybody: `tick` would do nothing, and be called again at once.
        soonest = min(self._error_control.next, self._pdo.next, self._server.deadline)
        if self._nmt.reports:
            soonest = min(soonest, self._sync_and_time.next, self.emergencies.next)
        return soonest

    def tick(self, now: float) -> Reaction:
        """Do what is due: send heartbeat and TPDOs at their times, and notice nodes that have fallen silent."""
        self._now = now
        if now < self.next_wakeup:  # the application has set a timer: most ticks of a node that moves
            return Reaction([])
        self._nmt.listens = True  # again, if it has changed its bit rate
        frames = self._error_control.due(now)
        own = self._sync_and_time.due(now)
        frames += [*own.frames, *self._pdo.due(now)]
        frames += self._sdo_frames(self._server.tick(now))
        lost = self._lose(now)
        return Reaction(frames + self.emergency_frames(now), lost=lost, synchronous=own.synchronous)

    def _lose(self, now: float) -> tuple[int, ...]:
        """Notice nodes that have fallen silent, and a silent master that guards this one (CiA 301, 7.5.2.32)."""
        lost, unguarded = self._error_control.overdue(now)
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
        if not self._nmt.reports:
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
        if ear is None or not self._nmt.listens:
            return Reaction([])
        self._now = now
        reaction = ear(frame, now)
        # Every frame comes through here, and errors are rare: a flag is cheaper than a call.
        if not self.emergencies.quiet:
            reaction.frames.extend(self.emergency_frames(now))
        if reaction.message is None:  # a message for the application plans nothing here
            self.plan.at(self.next_wakeup)
        return reaction

    def _receive_command(self, frame: Frame, _: float) -> Reaction:
        command = nmt.command_in(frame, self.node_id)
        if command in nmt.TARGET:
            self._enter(nmt.TARGET[command])
        return Reaction([]) if command is None or command in nmt.TARGET else self._reset(command)

    def _receive_lss(self, frame: Frame, now: float) -> Reaction:
        """Answer a request of LSS, which a device at work has not; boot once a node-ID is given."""
        if self._lss is None or self.operational:
            return Reaction([])
        answer = self._lss.receive(frame.data, now)
        if self._lss.needs_boot:
            return self._reset(NmtCommand.RESET_COMMUNICATION)
        if self._lss.silent_until > now:
            self._silent_until, self._nmt.listens = self._lss.silent_until, False
        return Reaction([] if answer is None else [Frame(standard.ANSWERS, answer)])

    def _receive_sdo(self, frame: Frame, now: float) -> Reaction:
        if not self._nmt.serves:
            return Reaction([])
        self._pdo.settle()  # first, so that a read gives the values of the latest PDO
        return Reaction(self._sdo_frames(self._server.receive(frame.data, now)))

    def _sdo_frames(self, answers: list[bytes]) -> list[Frame]:
        return [Frame(self.sdo_answers, data) for data in answers]

    # Messages

    def transmit(self, message: Message) -> Frame:
        """Return the frame of a message as this device would send it.

        Raises StateError if it is not one of its TPDOs or if its NMT state does not allow it, FieldError for a value.
        """
        return self._pdo.sendable(message).encode(message)

    def check_received(self, message: type[Message]) -> None:
        """Raise StateError if no RPDO carries a message."""
        self._pdo.check_received(message)

    def send(self, message: Message, now: float) -> list[Frame]:
        """Return the frame of a message to send now; none if it has to wait for SYNC or for its inhibit time.

        Raises the errors of `transmit`.
        """
        frames = self._pdo.send(message, now)
        if not frames:
            self.plan.at(self._pdo.next)
        return frames

    def changed(self, now: float, may_go: Callable[[Binding], bool] | None = None) -> list[Frame]:
        """Return the event-driven TPDOs whose values have changed since this was last asked.

        It is for a device whose application sends nothing by itself. Each TPDO counts as changed when the device
        becomes OPERATIONAL. One that goes with the next SYNC waits for it (transmission type 0), an inhibited one is
        held back, and one that `may_go` refuses is passed over until its next change.
        """
        frames = self._pdo.changed(now, may_go)
        self.plan.at(self._pdo.next)
        return frames
