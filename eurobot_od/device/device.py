"""One CANopen device, made from its EDS: it joins its parts, and each part has its clauses of CiA 301.

| part | clauses |
|---|---|
| `nmt.NmtStates` | NMT states and their services: 7.3.2.2 |
| `error_control.ErrorControl` | heartbeats, node guarding: 7.2.8.2.2 |
| `pdo_service.PdoService` | PDOs: 7.2.2 |
| `sync_time.SyncAndTime` | SYNC, TIME: 7.2.5, 7.2.6 |
| `broadcasts.Emergencies` | EMCY: 7.2.7 |
| `storage.Storage` | stored values: 7.5.2.13, 7.5.2.14 |
| `sdo_service.SdoService` | SDO: 7.2.4 |
| `lss.LssSlave` | LSS: CiA 305 |

There is no clock and no bus in here: frames and the time in seconds go in, frames and typed messages come out. What a
peer sends wrong becomes an EMCY, an SDO abort and a count, never an exception.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import inf

from eurobot_od.controller import Stay
from eurobot_od.device import broadcasts, nmt
from eurobot_od.device.bound import NO_APPLICATION, Application, BoundObjects
from eurobot_od.device.error_control import ErrorControl
from eurobot_od.device.lss import LssSlave
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.device.objects import Objects, OnRead, OnWrite, Store, predefined, unrestricted
from eurobot_od.device.pdo_service import PdoService
from eurobot_od.device.reaction import Ear, Reaction
from eurobot_od.device.sdo_service import SdoService
from eurobot_od.device.storage import Storage
from eurobot_od.device.sync_time import SyncAndTime
from eurobot_od.device.timers import Plan
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import BASE_IDENTIFIER, NMT_COB_ID, Address, Value
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import NOTHING, Catalogue, Message
from eurobot_od.pdo.protocol import Protocol
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
    which no reset changes. `plan` has what frames have made it plan, and `next_wakeup` everything. A stored value that
    cannot be used is among those that its `storage` has refused: the default takes its place, and an EMCY says so at
    each start until the device stores again. With `lss` it is found and given its node-ID by LSS; without a node-ID,
    `node_id` is 255, and it has no other service.
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
        self.storage = Storage(dictionary, store, lss)
        self._nmt, self.plan, self.time_of_day = nmt.NmtStates(), Plan(), broadcasts.Clock()
        self._now, self._silent_until = 0.0, -inf
        self._load(dict(self.storage.values))

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
        own = self._file.device.node_id_address
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
        self.pdo_service = PdoService(self.objects, self._catalogue, self._nmt, self.emergencies, self.plan)
        self.pdos = self.pdo_service.pdos
        self.error_control = ErrorControl(self.objects, self._nmt, self.emergencies, self.node_id)
        self._sync_and_time = SyncAndTime(self.objects, self._nmt, self.pdo_service, self.time_of_day)
        self.sdo_service = SdoService(self.objects, self._nmt, self.pdo_service.settle)
        self._connect(readers, writers)
        self._configure()

    def _connect(self, readers: dict[int, OnRead], writers: dict[int, OnWrite]) -> None:
        """Enter what reads and writes the objects that are more than a value."""
        bound = BoundObjects(self.objects, self._catalogue, self._application, self._command)
        stored = partial(self.storage.write, self.objects, self.emergencies, self.node_id)
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
        kept = standard.GUARD_TIME[0], standard.LIFE_TIME_FACTOR[0], standard.TIME[0]
        configuring: dict[int, OnWrite] = {
            standard.CONSUMED_HEARTBEATS: self.error_control.watch,
            **dict.fromkeys(kept, self.objects.put),
            **self.pdos.writers(),
        }
        writers |= {
            **bound.writers(),
            standard.ERROR_FIELD: self.emergencies.clear_field,
            **dict.fromkeys((standard.STORE, standard.RESTORE), stored),
            standard.HEARTBEAT_TIME[0]: lambda address, time: self.error_control.set_period(address, time, self._now),
            **{index: partial(self._reconfigure, write) for index, write in configuring.items()},
        }
        for index, _ in (standard.SYNC, standard.TIME, standard.EMCY):
            writers[index] = unrestricted(self.objects, writers.get(index, self.objects.put))

    def _reconfigure(self, write: OnWrite, address: Address, value: Value) -> None:
        """Write an object that says what the device listens to, and follow it."""
        write(address, value)
        self._configure()

    def _configure(self) -> None:
        """Listen to the services as they are configured now."""
        self.error_control.configure()
        self._periodic = self._sync_and_time.produced | {self.error_control.own}
        # Where a file gives two services the same identifier, the later one in this table gets it: NMT is never lost.
        ears: dict[int | None, Ear] = {
            **self._overhearing_ears(),
            **self.error_control.ears,
            **dict.fromkeys(self.pdos.received, self.pdo_service.receive),
            **self._sync_and_time.ears,
            **self.sdo_service.ears,
            NMT_COB_ID: self._receive_command,
        }
        self._ears = {cob_id: ear for cob_id, ear in ears.items() if cob_id is not None}
        self._remote_ears: dict[int, Ear] = {
            **dict.fromkeys(self.pdos.requestable, self.pdo_service.requested),
            **self.error_control.remote_ears,
        }
        if self.node_id == standard.UNCONFIGURED:
            self._ears, self._remote_ears = {}, {}
        if self._lss:
            self._ears[standard.REQUESTS] = self._receive_lss
        self.identifiers = sorted({*self._ears, *self._remote_ears})
        self.pdo_service.restart(self._now)
        self._sync_and_time.restart(self._now)

    def _overhearing_ears(self) -> dict[int | None, Ear]:
        """What it does with frames that others send under its own COB-IDs, if the application wants to hear of them."""
        overheard = self._application.overheard
        if overheard is None:
            return {}

        def overhear(frame: Frame, _: float) -> Reaction:
            overheard(frame)
            return Reaction([])

        return dict.fromkeys([*(each.cob_id for each in self.pdos.sent.values()), self.error_control.own], overhear)

    @property
    def service_identifiers(self) -> list[int]:
        """The present COB-IDs of all services of the device except its PDOs."""
        said = (self.objects.cob_id(standard.EMCY), self.pdos.sync_cob_id, self.objects.raw(standard.TIME))
        broadcast = [each & BASE_IDENTIFIER for each in said if each]
        return [NMT_COB_ID, self.sdo_service.requests, self.sdo_service.answers, self.error_control.own, *broadcast]

    @property
    def protocol(self) -> Protocol:
        """The messages of the PDOs that are valid now."""
        return self.pdos.protocol

    def stay(self, frame: Frame) -> Stay:
        """Return how long a frame of this device waits to be sent."""
        if frame.cob_id == self.sdo_service.answers:
            return Stay.TRANSFER
        if frame.cob_id in self.pdos.always_sent:
            return Stay.LASTING
        if frame.cob_id not in self._periodic:
            return Stay.SHORT
        # Without its boot-up message, which is sent only once, a master does not learn that the node is there, or has
        # forgotten everything.
        return Stay.LASTING if frame == nmt.error_control(self.node_id, NmtState.INITIALISING) else Stay.PERIODIC

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
        self.error_control.start(now)
        # By EMCY as well: when a device boots with defaults, nobody may be looking at a console.
        if self.storage.refused:
            self.emergencies.raised(ErrorCode.DATA_SET, Store)
        self._enter(nmt.boot_state(self.objects.value(standard.NMT_STARTUP)))
        return [nmt.error_control(self.node_id, NmtState.INITIALISING)]

    def _enter(self, state: NmtState) -> None:
        reported, self.state = self._nmt.reports, state
        self.pdo_service.enter(self._now)
        # SYNC and TIME run in PRE-OPERATIONAL and OPERATIONAL: a change between them must not shift their periods.
        if reported is not self._nmt.reports:
            self._sync_and_time.restart(self._now)
        if state is NmtState.STOPPED:  # no SDO there, not even an abort after a time-out
            self.sdo_service.forget()

    def restart(self, now: float) -> Reaction:
        """Do what an NMT command to reset the node does."""
        self._now = now
        return self._reset(NmtCommand.RESET_NODE)

    def _reset(self, command: NmtCommand) -> Reaction:
        """Restore what was stored, except for a new node-ID, which takes effect now (CiA 301, 7.3.2.2.3)."""
        if self._lss:
            (self._lss.power_on if command is NmtCommand.RESET_NODE else self._lss.activate)()
        self._load(self.storage.after(command, self.objects))
        return Reaction(self.start(self._now), reset=True)

    # Time

    @property
    def next_wakeup(self) -> float:
        """Time at which to call `tick`, infinite if nothing is planned."""
        if self._now < self._silent_until:
            return self._silent_until
        # Whatever the NMT state holds back must not wake anybody: `tick` would do nothing, and be called again at once.
        soonest = min(self.error_control.next, self.pdo_service.next, self.sdo_service.deadline)
        if self._nmt.reports:
            soonest = min(soonest, self._sync_and_time.next, self.emergencies.next)
        return soonest

    def tick(self, now: float) -> Reaction:
        """Do what is due: send heartbeat and TPDOs at their times, and notice nodes that have fallen silent."""
        self._now = now
        if now < self.next_wakeup:  # the application has set a timer: most ticks of a node that moves
            return Reaction([])
        self._nmt.listens = True  # again, if it has changed its bit rate
        frames = self.error_control.due(now)
        own = self._sync_and_time.due(now)
        frames += [*own.frames, *self.pdo_service.due(now)]
        frames += self.sdo_service.due(now)
        lost = self._lose(now)
        return Reaction(frames + self.emergency_frames(now), lost=lost, synchronous=own.synchronous)

    def _lose(self, now: float) -> tuple[int, ...]:
        """Notice nodes that have fallen silent, and a silent master that guards this one (CiA 301, 7.5.2.32)."""
        lost, unguarded = self.error_control.overdue(now)
        # 0x1029 counts only for a device at work: in other states there are no PDOs to be stopped.
        command = ON_COMMUNICATION_ERROR.get(self.objects.raw(standard.COMMUNICATION_ERROR))
        if (lost or unguarded) and command is not None and self.operational:
            self._enter(nmt.TARGET[command])
        return lost

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
