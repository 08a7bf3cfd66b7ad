"""Faults that prove the suites made from a device's file: what the standard asks for, done differently.

A step is named by the beginning that it has in every such suite, whatever the file's objects are. Faults that are of
use to somebody who tests a master are in `eurobot_od.device.faults`.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from typing import TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import Caught, Fault, FrameChange, Mixin
from eurobot_od.device.nmt import NmtCommand, NmtState, error_control
from eurobot_od.device.node import Node
from eurobot_od.device.profiles import SimulatedModule
from eurobot_od.frame import Frame
from eurobot_od.od.objects import address_of, all_objects, at, data_type, in_limits, is_described
from eurobot_od.od.standard import (
    ALL_PARAMETERS,
    CONSUMED_HEARTBEATS,
    DEVICE_TYPE,
    ERROR_FIELD,
    ERROR_REGISTER,
    HEARTBEAT_TIME,
    RESTORE,
    SDO_REQUESTS,
    STORE,
    SYNC_COUNTER,
    SYNC_PERIOD,
    VERIFY_CONFIGURATION,
    ErrorCode,
)
from eurobot_od.od.values import (
    ALL_NODES,
    BASE_IDENTIFIER,
    COB_ID,
    COMMUNICATIONS,
    DUMMIES,
    ERROR_CONTROL_BASE,
    INHIBIT_TIME,
    MANUFACTURER,
    MAPPING_OFFSET,
    MAPPING_RECORDS,
    MAPPINGS,
    NMT_COB_ID,
    NOT_VALID,
    RESTRICTED,
    STRUCTURE,
    SYNC_START,
    TRANSMISSION_TYPE,
    Address,
    DataType,
    PdoDirection,
    Value,
    owner,
)
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import AbortCode, Block, ClientCommand, Initiate, ServerCommand

UNKNOWN = 7
"""A command specifier that no SDO request has."""

SECOND_WATCHED: Address = (CONSUMED_HEARTBEATS, 2)


# What is written is taken, whatever speaks against it

Taken: TypeAlias = "Callable[[Node, Address, bytes], bool]"
"""Whether a node takes a value that is to be written, although it should look at it first."""


def taking(taken: Taken, *, keeps: bool = True) -> Mixin:
    """Return a node that confirms what is written at once, and keeps it or not, without doing what it means."""

    class Taking(Node):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            content = _written(self, frame)
            address = Initiate.of(frame.data).address if content is not None else (0, 0)
            if content is None or not taken(self, address, content):
                return super().receive(frame, now)
            type_ = data_type(at(address, self.device.dictionary.objects))
            if keeps and type_.is_integer:
                # Cut or filled up to the type's size: the fault is to take a wrong length, not to break the object.
                value = type_.read(content[: type_.size].ljust(type_.size, b"\0"))
                self.device.objects.values[address] = value
            return [Frame(hooks.sdo_answer(self), wire.initiate(ServerCommand.DOWNLOAD << 5, address))]

    return Taking


def _written(node: Node, frame: Frame) -> bytes | None:
    """Return what an SDO request writes at once, None for any other frame, and in STOPPED."""
    # A fault is one thing: a node that answered SDO in STOPPED, too, would be found by another step (7.3.2.2.4).
    heard = node.device.state in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL)
    if not heard or frame.cob_id != hooks.sdo_request(node) or len(frame.data) != wire.LENGTH:
        return None
    request = Initiate.of(frame.data)
    if request.command >> 5 != ClientCommand.DOWNLOAD or not request.command & wire.EXPEDITED:
        return None
    return request.rest[: request.size]


def _to_object(wrong: Callable[[ODVariable, bytes], bool]) -> Taken:
    """Take what is written to an object of the file and is wrong in a way."""

    def taken(node: Node, address: Address, content: bytes) -> bool:
        variable = at(address, node.device.dictionary.objects)
        return is_described(variable) and wrong(variable, content)

    return taken


# A DOMAIN and a text have the size 0: they are never too long.
TOO_LONG = _to_object(lambda variable, content: variable.writable and 0 < data_type(variable).size < len(content))
TOO_SHORT = _to_object(lambda variable, content: variable.writable and len(content) < data_type(variable).size)

# A value of another length is refused for that, before its limits count.
OUTSIDE = _to_object(
    lambda variable, content: (
        len(content) == data_type(variable).size and not in_limits(variable, data_type(variable).read(content))
    )
)


def _fits(node: Node, address: Address, content: bytes) -> bool:
    return not any(odd(node, address, content) for odd in (TOO_LONG, TOO_SHORT))


def _is_valid(node: Node, communication: int) -> bool:
    return node.device.objects.cob_id((communication, COB_ID)) is not None


def _to_mapping(
    wrong: Callable[[int, int, bytes], bool], *, of: Container[int] = MAPPINGS, valid: bool = False
) -> Taken:
    """Take what is written to the mapping of a PDO, valid or not, if sub-index, sub-index 0 and content say so.

    CiA 301, 7.5.2.36: a mapping is changed while the PDO is not valid, its entries while sub-index 0 is 0.
    """
    return lambda node, address, content: (
        address[0] in of
        and wrong(address[1], node.device.objects.raw((address[0], 0)), content)
        and _is_valid(node, address[0] - MAPPING_OFFSET) is valid
    )


def _parameter(subindex: int, *, of_a_valid_one: bool = False) -> Taken:
    """Take what fits a communication parameter of any PDO, or of a valid one alone."""
    return lambda node, address, content: (
        address[0] in COMMUNICATIONS
        and address[1] == subindex
        and (_is_valid(node, address[0]) or not of_a_valid_one)
        and _fits(node, address, content)
    )


def _of(wanted: Address, *contents: bytes) -> Taken:
    """Take what is written to an object, or only some of it."""
    return lambda _node, address, content: address == wanted and (not contents or content in contents)


# What is answered


def _instead(*, of: AbortCode, by: AbortCode) -> Mixin:
    """Return a node that refuses with another code."""

    def changed(_: Node, frame: Frame) -> Iterable[Frame]:
        refused = frame.data[0] == wire.ABORT and Initiate.of(frame.data).number == of
        return [Frame(frame.cob_id, frame.data[:4] + by.to_bytes(4, "little"))] if refused else [frame]

    return hooks.leaving(hooks.sdo_answer, changed)


def _unknown_as_zero(_: Node, frame: Frame) -> Iterable[Frame]:
    answer = Initiate.of(frame.data)
    if answer.command != wire.ABORT or answer.number != AbortCode.NO_OBJECT:
        return [frame]
    return [Frame(frame.cob_id, wire.carrying(ServerCommand.UPLOAD, answer.address, bytes(4)))]


def _specifier(data: bytes) -> int | None:
    """Return the command specifier of an SDO frame, None for a frame that is not one."""
    return data[0] >> 5 if len(data) == wire.LENGTH else None


def _where(specifier: int, change: Callable[[bytes], bytes]) -> FrameChange:
    """Change frames whose command byte begins with a specifier."""
    return hooks.data(lambda data: change(data) if _specifier(data) == specifier else data)


def _no_error(data: bytes) -> bytes:
    """Return an answer in which 0x1001 has no error."""
    is_register = data[0] >> 5 == ServerCommand.UPLOAD and Initiate.of(data).address == ERROR_REGISTER
    return data[:4] + bytes(4) if is_register else data


class ToggleNotChecked(Node):
    """Goes on whatever the toggle bit of a segment is."""

    _toggle = 0

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id != hooks.sdo_request(self) or len(frame.data) != wire.LENGTH:
            return super().receive(frame, now)
        data = frame.data
        # The first segment has the toggle bit 0, then it alternates (CiA 301, 7.2.4.3.4). Our server checks it, so it
        # is handed the right one, whatever came.
        if data[0] >> 5 in (ClientCommand.DOWNLOAD, ClientCommand.UPLOAD):
            self._toggle = 0
        elif data[0] >> 5 in (ClientCommand.DOWNLOAD_SEGMENT, ClientCommand.UPLOAD_SEGMENT):
            data = bytes([data[0] & ~wire.TOGGLE | self._toggle]) + data[1:]
            self._toggle ^= wire.TOGGLE
        return super().receive(Frame(frame.cob_id, data), now)


class Blocked(Node):
    """Waits for the rest of a download by segments, for ever."""

    _waits = False

    def reset(self) -> None:
        super().reset()
        self._waits = False

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id != hooks.sdo_request(self) or len(frame.data) != wire.LENGTH:
            return super().receive(frame, now)
        command = frame.data[0]
        # Our server lets a new request end the old transfer; segments and aborts still reach it.
        if self._waits and command >> 5 in (ClientCommand.DOWNLOAD, ClientCommand.UPLOAD):
            return []
        answers = super().receive(frame, now)
        begun = all(each.data[0] != wire.ABORT for each in answers)
        self._waits = begun and command >> 5 == ClientCommand.DOWNLOAD and not command & wire.EXPEDITED
        return answers

    def tick(self, now: float) -> list[Frame]:
        # our server ends a transfer after its own timeout; its abort would give the fault away
        return [each for each in super().tick(now) if each.data[:1] != bytes([wire.ABORT])]


# NMT, values, PDOs


class SdoWhenStopped(Node):
    """Answers SDO requests in STOPPED."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if self.device.state is not NmtState.STOPPED or frame.cob_id != hooks.sdo_request(self):
            return super().receive(frame, now)
        self.device.state = NmtState.PRE_OPERATIONAL  # only for this request, so no heartbeat shows it
        answers = super().receive(frame, now)
        self.device.state = NmtState.STOPPED
        return answers


class ValuesKept(Node):
    """Keeps its values over a reset."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        before = dict(self.device.objects.values)
        frames = super().receive(frame, now)
        if frame.cob_id == NMT_COB_ID:  # no other command than a reset changes values
            self.device.objects.values.update(before)
        return frames


class NoBootUpOfCommunication(Node):
    """Sends no boot-up message after a reset of the communication."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        frames = super().receive(frame, now)
        reset = frame.cob_id == NMT_COB_ID and frame.data[:1] == bytes([NmtCommand.RESET_COMMUNICATION])
        return [each for each in frames if each.cob_id != hooks.heartbeat(self)] if reset else frames


class HistoryKept(Node):
    """Confirms that the error history is cleared, and keeps it."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        # Put back after our server has confirmed: the write is answered as it should be, which is what makes the fault
        # hard to see.
        emergencies = self.device.emergencies
        before = list(emergencies.history)
        frames = super().receive(frame, now)
        if before and not emergencies.history and frame.cob_id == hooks.sdo_request(self):
            emergencies.history.extend(before)
        return frames


def _a_setting(node: Node) -> Address | None:
    """Return the first whole number of the manufacturer that a PDO cannot carry."""
    own = (each for each in all_objects(node.device.dictionary.objects) if each.index >= MANUFACTURER[0])
    numbers = (each for each in own if each.access_type == "rw" and data_type(each).is_integer)
    # Sub-index 0xFF is the description of a structure; an object that gives the node-ID would move all its COB-IDs.
    addresses = (address_of(each) for each in numbers if each.subindex != STRUCTURE)
    return next((each for each in addresses if each != node.device.dictionary.device.node_id_address), None)


# Remote frames, error control, SYNC


def _in_any_state(node: Node, cob_id: int, now: float) -> list[Frame] | None:
    if cob_id == hooks.heartbeat(node) or node.device.state is NmtState.OPERATIONAL:
        return None
    binding = node.device.protocol.binding_of(cob_id)
    return [Frame(cob_id, bytes(binding.layout.length))] if now else None


def _with_a_heartbeat(node: Node, cob_id: int, _: float) -> list[Frame] | None:
    beats = node.device.objects.raw(HEARTBEAT_TIME)
    return (
        [error_control(node.device.node_id, node.device.state)] if beats and cob_id == hooks.heartbeat(node) else None
    )


class HeartbeatsUnheard(Node):
    """Hears no heartbeat of another node."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        other = frame.cob_id in range(ERROR_CONTROL_BASE + 1, ERROR_CONTROL_BASE + 0x80)
        # The whole range of error control, its own node-ID too: nobody else sends under that.
        return [] if other else super().receive(frame, now)


class CounterForgotten(Node):
    """Stores no SYNC counter."""

    def reset(self) -> None:
        super().reset()
        self.device.objects.values.pop(SYNC_COUNTER, None)


class VerifiedForGood(Node):
    """Keeps date and time of its configuration, whatever is changed."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        values = self.device.objects.values
        # 0x1020 goes to 0 by itself when the configuration changes (CiA 301, 7.5.2.23): here it is put back at once.
        before = {mark: values[mark] for mark in VERIFY_CONFIGURATION if values.get(mark)}
        frames = super().receive(frame, now)
        if frame.cob_id == hooks.sdo_request(self):
            self.device.objects.values |= before
        return frames


def refusing(refused: Taken, code: AbortCode) -> Mixin:
    """Return a node that refuses what it should take."""

    class Refusing(Node):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            content = _written(self, frame)
            address = Initiate.of(frame.data).address if content is not None else (0, 0)
            if content is None or not refused(self, address, content):
                return super().receive(frame, now)
            return [Frame(hooks.sdo_answer(self), wire.aborted(address, code))]

    return Refusing


def _restricted(node: Node, address: Address, content: bytes) -> bool:
    identifier = int.from_bytes(content, "little")
    parameter = address[0] in COMMUNICATIONS and address[1] == COB_ID and _fits(node, address, content)
    return parameter and not identifier & NOT_VALID and owner(identifier & BASE_IDENTIFIER, RESTRICTED) is not None


def _as_event(data: bytes) -> bytes:
    """Make transmission type 0 one that is event-driven."""
    written = len(data) == wire.LENGTH and data[0] >> 5 == ClientCommand.DOWNLOAD
    index, sub = Initiate.of(data).address if written else (0, 0)
    return (
        data[:4] + b"\xfe" + data[5:] if index in COMMUNICATIONS and sub == TRANSMISSION_TYPE and not data[4] else data
    )


def _at_most(place: int) -> FrameChange:
    """Take 1 for a number of segments that is too high, at a place of a request of a block upload."""

    def change(data: bytes) -> bytes:
        return data[:place] + b"\1" + data[place + 1 :] if data[place] > wire.BLOCK_SEGMENTS else data

    kind = Block.INITIATE if place > 1 else Block.ACKNOWLEDGE
    return _where(ClientCommand.BLOCK_UPLOAD, lambda data: change(data) if data[0] & 3 == kind else data)


class StructureWrong(Node):
    """Says of 0x1000 in sub-index 255 that it has no type."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        # Only this one sub-index: every other upload goes its usual way, so that no other step finds the fault.
        address = DEVICE_TYPE[0], STRUCTURE
        if frame.cob_id == hooks.sdo_request(self) and frame.data == wire.initiate(ClientCommand.UPLOAD << 5, address):
            return [Frame(hooks.sdo_answer(self), wire.carrying(ServerCommand.UPLOAD, address, bytes(4)))]
        return super().receive(frame, now)


def _fault(step: str, text: str, mixin: Mixin) -> Fault:
    return Caught(hooks.MADE, step).fault(text, mixin)


FAULTS: Mapping[str, Fault] = {
    # NMT
    "boot-up-missing-after-communication": _fault(
        "7.2.8.3.3 Boot-up: boot-up after reset communication",
        "sends no boot-up message after a reset of the communication",
        NoBootUpOfCommunication,
    ),
    "nmt-to-all-ignored": _fault(
        "7.2.8.2.1 NMT commands: a command to all nodes",
        "hears no NMT command that is for all nodes",
        hooks.arriving(hooks.nmt, hooks.only(lambda data: data[1:] != bytes([ALL_NODES]))),
    ),
    "nmt-half-heeded": _fault(
        "7.2.8.2.1 NMT commands: half a command does not matter",
        "carries out NMT commands of one byte",
        # a missing node-ID read as 0 makes a command for all nodes
        hooks.arriving(hooks.nmt, hooks.data(lambda data: data.ljust(2, b"\0"))),
    ),
    "sdo-when-stopped": _fault("7.3.2.2.4 NMT state: no SDO in STOPPED", "answers SDO in STOPPED", SdoWhenStopped),
    "heartbeat-change-late": _fault(
        "7.5.2.20 Heartbeat time: a change counts at once",
        "takes a new heartbeat time over when the old one is over",
        taking(_of(HEARTBEAT_TIME)),  # stored without a word to the timer, which runs as it was set
    ),
    "heartbeat-never-ends": _fault(
        "7.5.2.20 Heartbeat time: 0 ends it",
        "goes on with its heartbeat when the time is set to 0",
        taking(_of(HEARTBEAT_TIME, bytes(2))),  # only the value 0: all others count at once, as they should
    ),
    # Objects
    "default-wrong": _fault(
        "7.3.2.2.3 Default after a reset", "has another default than its file", hooks.other_value(_a_setting)
    ),
    "values-kept-over-reset": _fault(
        "7.3.2.2.3 Values", "keeps its values over a reset, without having stored them", ValuesKept
    ),
    "read-only-written": _fault(
        "7.4.5 Read-only",
        "lets read-only objects be written",
        taking(_to_object(lambda variable, _: not variable.writable)),
    ),
    "read-only-code-wrong": _fault(
        "7.4.5 Read-only",
        "refuses to write a read-only object as one that cannot be read",
        _instead(of=AbortCode.READ_ONLY, by=AbortCode.WRITE_ONLY),
    ),
    "unknown-object-as-zero": _fault(
        "7.2.4.3.17 Unknown object",
        "gives 0 for an object that is not there",
        hooks.leaving(hooks.sdo_answer, _unknown_as_zero),
    ),
    "unknown-object-code-wrong": _fault(
        "7.2.4.3.17 Unknown object",
        "says of an object that is not there that its sub-index is not",
        _instead(of=AbortCode.NO_OBJECT, by=AbortCode.NO_SUBINDEX),
    ),
    "unknown-subindex-code-wrong": _fault(
        "7.2.4.3.17 Unknown sub-index",
        "says of a sub-index that is not there that the object is not",
        _instead(of=AbortCode.NO_SUBINDEX, by=AbortCode.NO_OBJECT),
    ),
    "too-long-taken": _fault("7.2.4.3.17 Wrong length", "takes more bytes than an object has", taking(TOO_LONG)),
    "too-short-taken": _fault("7.2.4.3.17 Wrong length", "takes fewer bytes than an object has", taking(TOO_SHORT)),
    "length-code-wrong": _fault(
        "7.2.4.3.17 Wrong length",
        "refuses too many bytes as a value that is too high",
        _instead(of=AbortCode.TOO_LONG, by=AbortCode.TOO_HIGH),
    ),
    "limits-not-checked": _fault("7.2.4.3.17 Limits", "takes values outside the limits", taking(OUTSIDE)),
    "limits-code-wrong": _fault(
        "7.2.4.3.17 Limits",
        "refuses a value that is too high as too low",
        _instead(of=AbortCode.TOO_HIGH, by=AbortCode.TOO_LOW),
    ),
    # SDO
    "toggle-not-checked": _fault(
        "7.2.4.3.7 SDO upload: a wrong toggle bit is refused", "does not look at toggle bits", ToggleNotChecked
    ),
    "toggle-code-wrong": _fault(
        "7.2.4.3.7 SDO upload: a wrong toggle bit is refused",
        "refuses a wrong toggle bit as an unknown command",
        _instead(of=AbortCode.TOGGLE_BIT, by=AbortCode.UNKNOWN_COMMAND),
    ),
    "last-byte-lost": _fault(
        "7.4.4 Length of the type",
        "has a 0 as the seventh byte of each segment",
        hooks.leaving(hooks.sdo_answer, _where(ServerCommand.UPLOAD_SEGMENT, lambda data: data[:7] + b"\0")),
    ),
    "segments-forgotten": _fault(
        "7.2.4.3.4 SDO download",
        "takes 0 for what comes in segments",
        hooks.arriving(hooks.sdo_request, _where(ClientCommand.DOWNLOAD_SEGMENT, lambda data: data[:1] + bytes(7))),
    ),
    "unknown-command-ignored": _fault(
        "7.2.4.3.17 SDO abort: an unknown command is refused",
        "does not answer an SDO command that it does not know",
        hooks.arriving(hooks.sdo_request, hooks.only(lambda data: _specifier(data) != UNKNOWN)),
    ),
    "abort-answered": _fault(
        "7.2.4.3.17 SDO abort: a client's abort is not answered",
        "answers a client's abort",
        hooks.arriving(
            hooks.sdo_request,
            # specifier 7, which no request has: the server refuses it, and that is the answer
            hooks.data(lambda data: b"\xe0" + data[1:] if data[:1] == bytes([wire.ABORT]) else data),
        ),
    ),
    "blocked-by-a-transfer": _fault(
        "7.2.4.3.17 SDO abort: a transfer that is left alone",
        "waits for ever for the rest of a transfer",
        Blocked,
    ),
    # PDOs
    "identifier-changed-while-valid": _fault(
        "7.5.2.35 RPDO communication",
        "lets the identifier of a valid PDO be changed",
        taking(_parameter(COB_ID, of_a_valid_one=True)),
    ),
    "inhibit-time-changed-while-valid": _fault(
        "7.5.2.37 TPDO communication",
        "lets the inhibit time of a valid TPDO be changed",
        taking(_parameter(INHIBIT_TIME, of_a_valid_one=True)),
    ),
    "mapping-changed-while-valid": _fault(
        "7.5.2.36 RPDO mapping",
        "lets the mapping of a valid PDO be changed",
        taking(_to_mapping(lambda *_: True, valid=True)),
    ),
    "mapping-changed-in-use": _fault(
        "7.5.2.36 RPDO mapping",
        "lets entries be changed while sub-index 0 is not 0",
        taking(_to_mapping(lambda subindex, count, _: subindex > 0 and count > 0)),
    ),
    "anything-mapped": _fault(
        "7.5.2.36 RPDO mapping",
        "maps what cannot be mapped",
        taking(_to_mapping(lambda subindex, count, _: subindex > 0 and count == 0)),
    ),
    "mapping-too-long-taken": _fault(
        "7.5.2.38 TPDO mapping",
        "maps more than 64 bits",
        # the bits are added up when sub-index 0 is written; 0 itself ends the mapping and is always right
        taking(
            _to_mapping(
                lambda subindex, _, content: subindex == 0 and content != b"\0", of=MAPPING_RECORDS[PdoDirection.TPDO]
            )
        ),
    ),
    "not-mappable-code-wrong": _fault(
        "7.5.2.36 RPDO mapping",
        "refuses what cannot be mapped as read-only",
        _instead(of=AbortCode.NOT_MAPPABLE, by=AbortCode.READ_ONLY),
    ),
    # Emergencies
    "history-not-cleared": _fault(
        "7.2.7 EMCY: RPDO", "confirms that the error history is cleared, and keeps it", HistoryKept
    ),
    "history-cleared-by-anything": _fault(
        "7.5.2.4 Error history: only 0 may be written",
        "takes any value for the number of errors",
        taking(_of((ERROR_FIELD, 0)), keeps=False),
    ),
    "error-register-empty": _fault(
        "7.2.7 EMCY: RPDO",
        "says in 0x1001 that there is no error when there is one",
        hooks.leaving(hooks.sdo_answer, hooks.data(_no_error)),
    ),
    # Remote frames
    "remote-frames-ignored": _fault(
        "7.2.2.5.2 TPDO by remote frame",
        "sends no TPDO that a remote frame asks for",
        hooks.asked(lambda node, cob_id, _: None if cob_id == hooks.heartbeat(node) else []),
    ),
    "remote-frames-answered-when-stopped": _fault(
        "7.2.2.5.2 TPDO by remote frame",
        "sends TPDOs that remote frames ask for in any state",
        hooks.asked(_in_any_state),
    ),
    "guarded-with-a-heartbeat": _fault(
        "7.2.8.2.2 Heartbeat or guarding",
        "answers node guarding though it sends heartbeats",
        hooks.asked(_with_a_heartbeat),
    ),
    "loss-not-told": _fault(
        "7.5.2.12 Life guarding: the master is missed",
        "tells nobody that a heartbeat, or the master that guards it, is missed",
        hooks.leaving(hooks.emcy, hooks.only(lambda data: data[:2] != ErrorCode.HEARTBEAT_LOST.to_bytes(2, "little"))),
    ),
    "watched-twice": _fault(
        "7.5.2.19 Consumer heartbeat time: a node is watched once",
        "lets one node be watched twice",
        taking(lambda node, address, content: address == SECOND_WATCHED and _fits(node, address, content)),
    ),
    "heartbeats-unheard": _fault(
        "7.5.2.19 Consumer heartbeat time: heartbeats too late", "hears no heartbeats", HeartbeatsUnheard
    ),
    # SYNC
    "acyclic-as-event": _fault(
        "7.2.2.2 TPDO transmission: TPDO 1 by SYNC after an event",
        "sends a TPDO of type 0 without waiting for SYNC",
        hooks.arriving(hooks.sdo_request, hooks.data(_as_event)),
    ),
    "start-value-ignored": _fault(
        "7.5.2.37 SYNC start value",
        "takes SYNC start values, and forgets them",
        taking(_parameter(SYNC_START), keeps=False),
    ),
    "sync-missing": _fault("7.5.2.6 SYNC producer", "never sends SYNC", hooks.leaving(hooks.sync, hooks.lost)),
    "sync-counter-stuck": _fault(
        "7.5.2.22 SYNC counter: a counter up to",
        "counts each SYNC as the first",
        hooks.leaving(hooks.sync, hooks.data(lambda data: b"\1" if data else data)),
    ),
    "sync-counter-unlimited": _fault(
        "7.5.2.22 SYNC counter: only 0 and 2 to 240",
        "takes any number for the SYNC counter",
        taking(_of(SYNC_COUNTER, b"\1", b"\xf1")),
    ),
    "sync-counter-changed-in-use": _fault(
        "7.5.2.22 SYNC counter: not while SYNC has a period",
        "lets the SYNC counter be changed while SYNC has a period",
        taking(lambda node, address, _: address == SYNC_COUNTER and bool(node.device.objects.raw(SYNC_PERIOD))),
    ),
    "sync-counter-not-stored": _fault(
        "7.5.2.13 SYNC: the counter is stored", "does not store the SYNC counter", CounterForgotten
    ),
    # Further
    "dummy-refused": _fault(
        "7.5.2.36 RPDO mapping",
        "maps no dummies",
        refusing(
            lambda _, address, content: (
                address[0] in MAPPINGS and address[1] > 0 and int.from_bytes(content, "little") >> 16 in DUMMIES
            ),
            AbortCode.NOT_MAPPABLE,
        ),
    ),
    "restricted-identifier-taken": _fault(
        "7.3.5 RPDO identifier", "lets a PDO have an identifier that CANopen itself uses", taking(_restricted)
    ),
    "block-size-not-checked": _fault(
        "7.2.4.3.12 SDO block upload: a block of 128 segments is refused",
        "takes any number of segments for a block",
        hooks.arriving(hooks.sdo_request, _at_most(4)),
    ),
    "acknowledgement-not-checked": _fault(
        "7.2.4.3.13 SDO block upload",
        "takes any number of acknowledged segments",
        hooks.arriving(hooks.sdo_request, _at_most(1)),
    ),
    "structure-wrong": _fault("7.4.9 Structure", "has a wrong structure in sub-index 255", StructureWrong),
    "sdo-server-elsewhere": _fault(
        "7.5.2.33 SDO server", "says another identifier of its SDO server", hooks.other_value(lambda _: SDO_REQUESTS)
    ),
    "verified-for-good": _fault(
        "7.5.2.23 Verify configuration",
        "has its configuration verified still after a change of it",
        VerifiedForGood,
    ),
    # Store and restore
    "stores-without-signature": _fault(
        "7.5.2.13 Store", "stores without the signature", taking(_of((STORE, ALL_PARAMETERS)), keeps=False)
    ),
    "restores-without-signature": _fault(
        "7.5.2.14 Restore",
        "restores the defaults without the signature",
        taking(_of((RESTORE, ALL_PARAMETERS)), keeps=False),
    ),
}

ALSO_FOUND: Mapping[str, str] = {
    "boot-up-missing": "7.2.8.3.3 Boot-up: boot-up after reset",
    "reset-ignored": "7.2.8.3.3 Boot-up: boot-up after reset",
    "heartbeat-missing": "7.5.2.20 Heartbeat time: a change counts at once",
    "heartbeat-stops": "7.5.2.20 Heartbeat time: heartbeats come at their time",
    "heartbeat-every-other": "7.5.2.20 Heartbeat time: heartbeats come at their time",
    "heartbeat-of-another-node": "7.2.8.3.3 Boot-up: boot-up after reset",
    "heartbeat-always-operational": "7.3.2.2 NMT state: after a reset",
    "nmt-ignored": "7.2.8.3.3 Boot-up: boot-up after reset",
    "nmt-stop-ignored": "7.2.8.2.1 NMT commands: stop in OPERATIONAL",
    "nmt-of-others-heeded": "7.2.8.2.1 NMT commands: another node's command does not matter",
    "works-when-stopped": "7.3.2.2.4 NMT state: no SDO in STOPPED",
    "emcy-missing": "7.2.7 EMCY: RPDO",
    "emcy-twice": "7.2.7 EMCY: RPDO",
    "emcy-code-wrong": "7.2.7 EMCY: RPDO",
    "sdo-not-answered": "7.2.4.3.5 SDO: the device answers",
    "sdo-value-reversed": "7.2.4.3.17 Unknown object",
    "sdo-write-forgotten": "7.5.2.20 Heartbeat time: a change counts at once",
    "sdo-abort-general": "7.2.4.3.7 SDO upload: a wrong toggle bit",
    "sdo-abort-silent": "7.2.4.3.17 Unknown object",
    "babbling": "7.2.7 EMCY: none without an error",
}
"""Steps of the conformance suites that find faults which a suite of the robot finds, too."""

CONFORMANCE: Mapping[str, Fault] = {
    **FAULTS,
    **{name: fault for name, fault in hooks.FAULTS.items() if fault.caught_by.suite == hooks.MADE},
    **{name: hooks.FAULTS[name]._replace(caught_by=Caught(hooks.MADE, step)) for name, step in ALSO_FOUND.items()},
}
"""All that the conformance suites find, with the step that finds it."""


# CiA 401


class PolarityIgnored(SimulatedModule):
    """Does not heed the polarity of its inputs."""

    def _input(self, address: Address, type_: DataType, read: Callable[[], Value]) -> Value:
        return read()
