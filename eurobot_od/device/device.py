"""A CANopen device made from its EDS; it combines parts for the clauses of CiA 301.

| part | clauses |
|---|---|
| `nmt.NmtStates` | NMT states and their services: 7.3.2.2 |
| `nmt.ErrorControl` | heartbeats, node guarding: 7.2.8.2.2 |
| `pdo_service.PdoService` | PDOs: 7.2.2 |
| `pdo_service.SyncAndTime` | SYNC, TIME: 7.2.5, 7.2.6 |
| `broadcasts.Emergencies` | EMCY: 7.2.7 |
| `Storage` | stored values: 7.5.2.13, 7.5.2.14 |
| `SdoService` | SDO: 7.2.4 |
| `lss.LssSlave` | LSS: CiA 305 |

There is no clock and no bus in this module: input is frames and the time in s, output is frames and typed messages.
Wrong frames cause an EMCY, an SDO abort or a count, never an exception.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from eurobot_od.controller import Stay
from eurobot_od.device import broadcasts, nmt
from eurobot_od.device.bound import NO_APPLICATION, Application, BoundObjects
from eurobot_od.device.broadcasts import Emergencies
from eurobot_od.device.lss import Commissioning, LssSlave
from eurobot_od.device.nmt import ErrorControl, NmtCommand, NmtState, NmtStates
from eurobot_od.device.objects import (
    COMMUNICATION_PROFILE,
    Objects,
    OnRead,
    OnWrite,
    Store,
    predefined,
    refused,
    unrestricted,
)
from eurobot_od.device.pdo_service import PdoService, SyncAndTime
from eurobot_od.device.reaction import FrameHandler, Reaction
from eurobot_od.device.timers import Plan
from eurobot_od.errors import DamagedFile, DictionaryError
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import BASE_IDENTIFIER, NMT_COB_ID, Address, Value
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import NOTHING, Catalogue, Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import Abort, Reason


class Storage:
    """Values that a device keeps over power-off in its `store`; without one, until the program ends.

    `values` are the usable stored ones. `refused` has a sentence for each of the others, until the device stores again.
    """

    def __init__(self, dictionary: Dictionary, store: Store | None, lss: LssSlave | None) -> None:
        self._own = dictionary.device.node_id_address
        self._store = store
        self._lss = lss
        if lss:
            lss.store = self._store_commissioning
        self.refused: tuple[str, ...] = ()
        values: dict[Address, Value] = {}
        try:
            values |= store.load() if store else {}
        except DamagedFile as error:
            self.refused = (f"{error}; the defaults are taken",)
        # One by one, so that a narrower range in a newer file affects only one value.
        wrong = dict(refused(dictionary, values))
        self.refused += tuple(f"stored value refused: {what}" for what in wrong.values())
        self.values = {address: value for address, value in values.items() if address not in wrong}

    def after(self, command: NmtCommand, objects: Objects) -> dict[Address, Value]:
        """Return the values after a reset: the stored ones, with a new node-ID in effect (CiA 301, 7.3.2.2.3)."""
        values = dict(self.values)
        if command is NmtCommand.RESET_COMMUNICATION:
            # Only 0x1000 to 0x1FFF are restored; the application's parameters are kept.
            values = {a: value for a, value in values.items() if a[0] in COMMUNICATION_PROFILE}
            values |= {a: v for a, v in objects.values.items() if a[0] not in COMMUNICATION_PROFILE}
        if self._own:
            values[self._own] = objects.value(self._own)
        return values

    def write(
        self, objects: Objects, emergencies: Emergencies, node_id: int, address: Address, signature: Value
    ) -> None:
        """Write 0x1010 or 0x1011: store the present values, or restore the file's at the next reset."""
        # The signature prevents accidental writes.
        if signature != int.from_bytes(standard.SIGNATURES[address[0]], "little"):
            raise Abort(Reason.SIGNATURE)
        values = objects.configuration() if address[0] == standard.STORE else {}
        try:
            if self._store and self._lss:
                self._store.save(values, *self._lss.stored)
            elif self._store:
                self._store.save(values, objects.number(self._own) if self._own else node_id)
        except (OSError, DictionaryError) as error:
            raise Abort(Reason.NOT_STORED, str(error)) from error
        # The refused values were overwritten.
        self.values = values
        self.refused = ()
        emergencies.cleared(Store)
        if self._own and address[0] == standard.RESTORE:
            objects.values.pop(self._own, None)  # a reset keeps the present node-ID

    def _store_commissioning(self, commissioning: Commissioning) -> bool:
        """Store node-ID and bit rate with the stored values; return whether that succeeded."""
        try:
            if self._store:
                self._store.save(self.values, *commissioning)
        except (OSError, DictionaryError):
            return False
        return True


class SdoService(SdoServer):
    """The SDO server of a device from one reset to the next; all times are in s.

    `requests` and `answers` are its COB-IDs, which a master cannot change (CiA 301, 7.5.2.33: ro). `settle` stores the
    values of received PDOs in the objects.
    """

    def __init__(self, objects: Objects, nmt: NmtStates, settle: Callable[[], None]) -> None:
        super().__init__(objects)
        self._objects, self._nmt, self._settle = objects, nmt, settle
        self.requests, self.answers = SdoChannel.of(objects.dictionary)

    @property
    def handlers(self) -> dict[int | None, FrameHandler]:
        """Handlers by COB-ID: of requests, and of other servers' answers to this device."""
        # Sub-index 2 of 0x1280 and following is the COB-ID of a server's answers (7.5.2.34).
        clients = [index for index in standard.SDO_CLIENTS if index in self._objects.dictionary.members]
        answered: dict[int | None, FrameHandler] = {
            self._objects.cob_id((index, 2)): _receive_answer for index in clients
        }
        return {**answered, self.requests: self._receive_request}

    def due(self, now: float) -> list[Frame]:
        """Return the abort of a transfer after the client's time-out."""
        return [Frame(self.answers, data) for data in self.tick(now)]

    def _receive_request(self, frame: Frame, now: float) -> Reaction:
        if not self._nmt.serves:
            return Reaction([])
        self._settle()  # first, so that a read returns the values of the last PDO
        return Reaction([Frame(self.answers, data) for data in self.receive(frame.data, now)])


def _receive_answer(frame: Frame, _: float) -> Reaction:
    return Reaction([], answer=frame)


ON_COMMUNICATION_ERROR: Mapping[int, NmtCommand | None] = {
    0: NmtCommand.ENTER_PRE_OPERATIONAL,
    1: None,
    2: NmtCommand.STOP,
}
"""Reaction of an operational device to a lost heartbeat, by its error behaviour 0x1029:1 (CiA 301, 7.5.2.32)."""


class Device:
    """The CANopen side of a node.

    `objects` has the values, `pdos` the PDOs and `protocol` their messages as presently mapped, `identifiers` the
    COB-IDs of all received frames, including remote frames; both are replaced as a whole when a master changes them.
    `time_of_day` is its clock, which no reset changes. `plan` has the times planned by frames, `next_wakeup` is the
    next time of all. A stored value that cannot be used is in `storage.refused`: the default is used, and an EMCY is
    sent at each start until the device stores again. Without a node-ID, `node_id` is 255, and the device has only LSS.

    Args:
        dictionary: the device's dictionary
        store: keeps the values stored by 0x1010 over power-off
        catalogue: message types
        application: bindings of the objects
        lss: LSS slave, which can set the node-ID
    """

    def __init__(
        self,
        dictionary: Dictionary,
        store: Store | None = None,
        catalogue: Catalogue = NOTHING,
        application: Application = NO_APPLICATION,
        lss: LssSlave | None = None,
    ) -> None:
        self._file = dictionary
        self._catalogue = catalogue
        self._application = application
        self._lss = lss
        self.storage = Storage(dictionary, store, lss)
        self._nmt = nmt.NmtStates()
        self.plan = Plan()
        self.time_of_day = broadcasts.Clock()
        self._now = 0.0
        self._silent_until = -inf
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
        """Create all parts from these values, as after power-on or a reset."""
        own = self._file.device.node_id_address
        if own and self._lss:
            values[own] = self._lss.active.node_id
        number = values.setdefault(own, self._file.node_id) if own else self._file.node_id
        self.node_id = number if isinstance(number, int) else self._file.node_id
        if self._lss:
            self.node_id = self._lss.active.node_id
        if self.node_id == standard.UNCONFIGURED:  # it has only LSS
            self.state = NmtState.INITIALISING
        # Values with $NODEID follow a new node-ID (CiA 306-1).
        is_of_file = self.node_id in (self._file.node_id, standard.UNCONFIGURED)
        self.dictionary = self._file if is_of_file else self._file.renumbered(self.node_id)
        # Functions, because a master may change 0x1014 and 0x1015; the inhibit time is in 100 us.
        self.emergencies = broadcasts.Emergencies(
            lambda: self.objects.cob_id(standard.EMCY), lambda: self.objects.raw(standard.EMCY_INHIBIT_TIME) / 10_000
        )
        readers: dict[int, OnRead] = {}  # filled by _connect, which needs the objects
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
        """Set the functions that read and write objects with special behaviour."""
        bound = BoundObjects(self.objects, self._catalogue, self._application, self._command)
        stored = partial(self.storage.write, self.objects, self.emergencies, self.node_id)
        eds = self.dictionary.variable(standard.STORED_EDS)
        # In some files 0x1021 is a number, which cannot hold an EDS.
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
        """Write an object that affects the received identifiers, and update them."""
        write(address, value)
        self._configure()

    def _configure(self) -> None:
        """Update all services from the present objects."""
        self.error_control.configure()
        self._periodic = self._sync_and_time.produced | {self.error_control.own}
        # If two services have the same identifier, the later one in this table gets it; NMT is last.
        handlers: dict[int | None, FrameHandler] = {
            **self._overhearing_handlers(),
            **self.error_control.handlers,
            **dict.fromkeys(self.pdos.received, self.pdo_service.receive),
            **self._sync_and_time.handlers,
            **self.sdo_service.handlers,
            NMT_COB_ID: self._receive_command,
        }
        self._handlers = {cob_id: handler for cob_id, handler in handlers.items() if cob_id is not None}
        self._remote_handlers: dict[int, FrameHandler] = {
            **dict.fromkeys(self.pdos.requestable, self.pdo_service.requested),
            **self.error_control.remote_handlers,
        }
        if self.node_id == standard.UNCONFIGURED:
            self._handlers, self._remote_handlers = {}, {}
        if self._lss:
            self._handlers[standard.REQUESTS] = self._receive_lss
        self.identifiers = sorted({*self._handlers, *self._remote_handlers})
        self.pdo_service.restart(self._now)
        self._sync_and_time.restart(self._now)

    def _overhearing_handlers(self) -> dict[int | None, FrameHandler]:
        """Handlers of frames that others send with this device's COB-IDs, if the application wants them."""
        overheard = self._application.overheard
        if overheard is None:
            return {}

        def overhear(frame: Frame, _: float) -> Reaction:
            overheard(frame)
            return Reaction([])

        return dict.fromkeys([*(each.cob_id for each in self.pdos.sent.values()), self.error_control.own], overhear)

    @property
    def service_identifiers(self) -> list[int]:
        """Present COB-IDs of all services except PDOs."""
        said = (self.objects.cob_id(standard.EMCY), self.pdos.sync_cob_id, self.objects.raw(standard.TIME))
        broadcast = [each & BASE_IDENTIFIER for each in said if each]
        return [NMT_COB_ID, self.sdo_service.requests, self.sdo_service.answers, self.error_control.own, *broadcast]

    @property
    def protocol(self) -> Protocol:
        """Messages of the valid PDOs."""
        return self.pdos.protocol

    def stay(self, frame: Frame) -> Stay:
        """Return how long a frame of this device may wait in the queue."""
        if frame.cob_id == self.sdo_service.answers:
            return Stay.TRANSFER
        if frame.cob_id in self.pdos.always_sent:
            return Stay.LASTING
        if frame.cob_id not in self._periodic:
            return Stay.SHORT
        # The boot-up message is sent only once, and a master needs it.
        return Stay.LASTING if frame == nmt.error_control(self.node_id, NmtState.INITIALISING) else Stay.PERIODIC

    def _command(self, binding: Binding, message: Message) -> None:
        """Pass a message that was written by SDO to the application; raises Abort or Refused."""
        if not self.operational and not binding.always:
            raise Abort(Reason.WRONG_STATE, f"{self.dictionary.name} is {self.state.name}")
        self._application.act(message)

    # NMT

    def start(self, now: float) -> list[Frame]:
        """Boot: send the boot-up message and enter the state given by NMT startup 0x1F80 (CiA 301, 7.3.2.2)."""
        self._now = now
        if self.node_id == standard.UNCONFIGURED:
            self._nmt.listens = True  # to LSS only
            return []
        self.error_control.start(now)
        # By EMCY, too, because nobody may read a console.
        if self.storage.refused:
            self.emergencies.raised(ErrorCode.DATA_SET, Store)
        self._enter(nmt.boot_state(self.objects.value(standard.NMT_STARTUP)))
        return [nmt.error_control(self.node_id, NmtState.INITIALISING)]

    def _enter(self, state: NmtState) -> None:
        reported = self._nmt.reports
        self.state = state
        self.pdo_service.enter(self._now)
        # Changes between PRE-OPERATIONAL and OPERATIONAL do not shift the periods of SYNC and TIME.
        if reported is not self._nmt.reports:
            self._sync_and_time.restart(self._now)
        if state is NmtState.STOPPED:  # no SDO, not even an abort after a time-out
            self.sdo_service.forget()

    def restart(self, now: float) -> Reaction:
        """Reset the node, as by an NMT command."""
        self._now = now
        return self._reset(NmtCommand.RESET_NODE)

    def _reset(self, command: NmtCommand) -> Reaction:
        """Restore the stored values, except for a new node-ID, which takes effect now (CiA 301, 7.3.2.2.3)."""
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
        # Without services that the NMT state disables, for which `tick` would do nothing.
        soonest = min(self.error_control.next, self.pdo_service.next, self.sdo_service.deadline)
        if self._nmt.reports:
            soonest = min(soonest, self._sync_and_time.next, self.emergencies.next)
        return soonest

    def tick(self, now: float) -> Reaction:
        """Do all due actions: send heartbeat and TPDOs, and detect lost nodes."""
        self._now = now
        if now < self.next_wakeup:  # the tick is for a timer of the application
            return Reaction([])
        self._nmt.listens = True  # after a change of the bit rate
        frames = self.error_control.due(now)
        own = self._sync_and_time.due(now)
        frames += [*own.frames, *self.pdo_service.due(now)]
        frames += self.sdo_service.due(now)
        lost = self._lose(now)
        return Reaction(frames + self.emergency_frames(now), lost=lost, synchronous=own.synchronous)

    def _lose(self, now: float) -> tuple[int, ...]:
        """Detect lost nodes, and a lost guarding master (CiA 301, 7.5.2.32)."""
        lost, unguarded = self.error_control.overdue(now)
        # 0x1029 applies only to an operational device.
        command = ON_COMMUNICATION_ERROR.get(self.objects.raw(standard.COMMUNICATION_ERROR))
        if (lost or unguarded) and command is not None and self.operational:
            self._enter(nmt.TARGET[command])
        return lost

    def emergency_frames(self, now: float) -> list[Frame]:
        """Return the EMCY frames that may be sent now; in STOPPED they wait (CiA 301, 7.3.2.2.4)."""
        if not self._nmt.reports:
            return []
        frames = self.emergencies.due(now)
        self.plan.at(self.emergencies.next)
        return frames

    # Frames

    def receive(self, frame: Frame, now: float) -> Reaction:
        """Handle a frame from the bus; before `start` all frames are ignored."""
        return self._hear(self._handlers.get(frame.cob_id), frame, now)

    def requested(self, cob_id: int, now: float) -> Reaction:
        """Handle a remote frame, which requests a TPDO or is node guarding."""
        return self._hear(self._remote_handlers.get(cob_id), Frame(cob_id), now)

    def _hear(self, handler: FrameHandler | None, frame: Frame, now: float) -> Reaction:
        if handler is None or not self._nmt.listens:
            return Reaction([])
        self._now = now
        reaction = handler(frame, now)
        # A flag is cheaper than a call for every frame.
        if not self.emergencies.quiet:
            reaction.frames.extend(self.emergency_frames(now))
        if reaction.message is None:  # messages for the application do not change the device's plan
            self.plan.at(self.next_wakeup)
        return reaction

    def _receive_command(self, frame: Frame, _: float) -> Reaction:
        command = nmt.command_in(frame, self.node_id)
        if command in nmt.TARGET:
            self._enter(nmt.TARGET[command])
        return Reaction([]) if command is None or command in nmt.TARGET else self._reset(command)

    def _receive_lss(self, frame: Frame, now: float) -> Reaction:
        """Answer a request of LSS, except in OPERATIONAL; boot once a node-ID was set."""
        if self._lss is None or self.operational:
            return Reaction([])
        answer = self._lss.receive(frame.data, now)
        if self._lss.needs_boot:
            return self._reset(NmtCommand.RESET_COMMUNICATION)
        if self._lss.silent_until > now:
            self._silent_until = self._lss.silent_until
            self._nmt.listens = False
        return Reaction([] if answer is None else [Frame(standard.ANSWERS, answer)])
