"""Watches SDO: aborts, missing and extra answers, broken transfers, and configuration by a master.

CiA 301, 7.2.4; the values of a device's DCF by CiA 302-2 and 306.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from eurobot_od.device.nmt import COMMAND_NAMES, SERVICES, STATE_NAMES, NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od import objects, values
from eurobot_od.od.cia402 import MODE, on_first_axis
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import DEVICE_TYPE, IDENTITY, REVISION, SERIAL
from eurobot_od.od.values import COMMUNICATION_RECORDS, Address, PdoDirection, label
from eurobot_od.sdo.wire import ABORT, AbortCode, Initiate, ServerCommand, code_and_reason, when_sent
from eurobot_od.support.texts import amount
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, Watcher
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Meaning, SdoTransfer
from eurobot_od.traffic.services import NMT, SDO, CanopenService, SdoEnd, object_words
from eurobot_od.traffic.transfers import ONE_WAY, SKIPPED, How

IMPATIENT = 0.01
"""Minimum time a client waits for an answer, in s; an earlier repeat comes from a second client."""

RESTLESS = 0.2
"""Minimum time before a client abandons a running transfer or asks for another object, in s."""

TWICE = 0.1
"""Maximum time between answers of two nodes to one request, in s."""

SCAN = 5
"""Number of nodes not answering the same question from which it counts as a scan."""

IDENTIFIES: Mapping[Address, int] = {
    DEVICE_TYPE: 0xFFFF_FFFF,
    (IDENTITY, 1): 0xFFFF_FFFF,
    (IDENTITY, 2): 0xFFFF_FFFF,
    REVISION: 0xFFFF_0000,
    SERIAL: 0xFFFF_FFFF,
}
"""Objects that identify a device, and their significant bits; minor revisions behave alike (CiA 301, 7.5.2.21)."""

MOST_QUESTIONS = 32
"""Maximum number of objects for which silent nodes are recorded."""

NAMING = (ServerCommand.DOWNLOAD, ServerCommand.UPLOAD)
"""Commands of answers that name their object."""

PATIENT = 0.5
"""Minimum age of an open request at the end of a log to count as unanswered, in s."""

SETTLED = 1.0
"""For this long after a log starts, in s, an answer may belong to a request made before recording."""

LISTED = 5
"""Maximum number of objects named in a line."""


@dataclass
class SdoLine:
    """An SDO channel: the object, time and place of the open request; None after its answer.

    `before` is the question that another one has followed before its answer, with its time in s. `owed` counts the
    requests whose answers may come late; it `is_shared` by two clients. `answered` is the last object answered,
    when, and what came; `last` is when the last frame came.
    """

    asked: float | None = None
    object: str = ""
    address: Address | None = None
    seen: Occurrences | None = None
    is_used: bool = False
    is_shared: bool = False
    before: tuple[float, Address, str, Occurrences] | None = None
    owed: int = 0
    answered: tuple[float, Address, bytes] | None = None
    last: float = 0.0
    was_answer: bool = False


class HeldFinding(NamedTuple):
    """An incident that counts only if the log has both requests and answers."""

    rule: BusRule
    node: ObservedNode
    text: str
    cause: str
    seen: Occurrences

    def report(self, bus: ObservedBus) -> None:
        """Report the incident on its bus."""
        bus.found(self.rule, self.node.name, self.text, cause=self.cause, seen=self.seen)


class SdoWatcher(Watcher):
    """Watches the SDO channels of a bus."""

    SERVICES = NMT, SDO

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._lines: dict[int, SdoLine] = {}
        self._ways = set[bool]()
        self._held: dict[tuple[BusRule, int], HeldFinding] = {}
        self._silent: dict[str, dict[int, tuple[str, str, Occurrences]]] = {}
        self._identities: dict[tuple[int, Address], tuple[int, bytes]] = {}
        self._own = {n: _own_values(node.dictionary) for n, node in bus.nodes.items() if node.dictionary}

    @property
    def is_setting_pdo(self) -> bool:
        """Whether a request about a TPDO's communication is not answered yet."""
        asked = (each.address for each in self._lines.values() if each.asked is not None and each.address)
        return any(index in COMMUNICATION_RECORDS[PdoDirection.TPDO] for index, _ in asked)

    def take(self, time: float, meaning: Meaning) -> None:
        if meaning.name == NMT:
            said = meaning.fields
            if said and said["command"] == COMMAND_NAMES[NmtCommand.START]:
                self._start(said["node"])
            return
        frame = meaning.raw
        end = meaning.service.end if isinstance(meaning.service, CanopenService) else None
        if end is None or not isinstance(frame, Frame):  # a block segment, or no SDO frame
            return
        self._heard(end.is_answer)
        line = self._lines.setdefault(end.channel, SdoLine())
        node = self.bus.node(end.server)
        asked = line.seen if line.asked is not None else None
        if end.is_answer:
            node.heard = node.is_device = True
            self._answer(time, line, node, frame.data)
        else:
            self._request(time, line, node, end, frame.data)
        if frame.data[0] == ABORT and meaning.transfer is None:
            self._lone_abort(node, end, frame.data)
        if meaning.transfer:
            self._ended(meaning.transfer, node, is_refused=end.is_answer, asked=asked)
            if not end.is_answer and meaning.transfer.is_whole:
                line.asked = None  # the client's last word
        line.is_used = True
        line.last = time
        line.was_answer = end.is_answer

    def _heard(self, is_answer: bool) -> None:
        """Record a direction; once there are both, report the findings held back."""
        if is_answer not in self._ways:
            self._ways.add(is_answer)
            if len(self._ways) > 1:
                for each in self._held.values():
                    each.report(self.bus)

    def _found(
        self, rule: BusRule, node: ObservedNode, text: str, cause: str = "", seen: Occurrences | None = None
    ) -> None:
        """Report a finding that needs both directions, or hold it back until both were seen."""
        finding = HeldFinding(rule, node, text, cause, seen or Occurrences.once(self.bus.at()))
        if len(self._ways) > 1:
            finding.report(self.bus)
        elif first := self._held.get((rule, node.node_id)):
            first.seen.join(finding.seen)
        else:
            self._held[rule, node.node_id] = finding

    def _request(self, time: float, line: SdoLine, node: ObservedNode, end: SdoEnd, data: bytes) -> None:
        command = end.command(data)
        named = command is not None and command.names_object
        if data[0] == ABORT:
            line.asked = line.before = None
            return
        address = Initiate.of(data).address if named else None
        words = object_words(end.dictionary, address) if address else line.object
        line.before = None
        if address and line.asked is not None and line.seen:
            if self._is_own(node, line.address, address):
                line.is_shared = True
            elif self._is_hasty(line.asked):
                line.is_shared = True
                self._two_clients(node, line.object, words, time - line.asked, line.seen)
            elif line.address and line.address != address and time - line.asked < RESTLESS:
                line.before = line.asked, line.address, line.object, line.seen
            line.owed += 1
        line.asked = time
        line.seen = Occurrences.once(self.bus.at())
        if address:
            line.object, line.address = words, address

    def _two_clients(self, node: ObservedNode, one: str, two: str, after: float, seen: Occurrences) -> None:
        text = f"two clients ask on one channel: {one}, and {duration(after, 6)} later {two}, before the answer"
        both = Occurrences(1, self.bus.at(), [*seen.places[:1], self.bus.at()])
        self._found(BusRule.TWO_CLIENTS, node, text, seen=both)

    def _is_own(self, node: ObservedNode, *addresses: Address | None) -> bool:
        """Return whether this program itself asked a node for one of these objects."""
        return any((node.node_id, each) == self.bus.own_question for each in addresses)

    def _is_hasty(self, asked: float) -> bool:
        """Return whether a client cannot have timed out yet; False in a log without times."""
        return 0 < self.bus.now - asked < IMPATIENT

    def _answer(self, time: float, line: SdoLine, node: ObservedNode, data: bytes) -> None:
        needs_request = data[0] >> 5 < ServerCommand.ABORT  # aborts and block segments do not
        address = Initiate.of(data).address
        named = data[0] >> 5 in NAMING
        if line.asked is None and needs_request and (line.is_used or time - self.bus.began > SETTLED):
            self._unasked(time, line, node, address if named else None, data)
        if line.before and line.before[1] == address:  # the first request was not abandoned
            since, _, object_, seen = line.before
            line.is_shared = True
            self._two_clients(node, object_, line.object, (line.asked or time) - since, seen)
            line.before = None
            line.owed = max(line.owed - 1, 0)
            return
        if line.asked is not None:
            line.asked = None
            line.answered = (time, address, data)

    def _unasked(self, time: float, line: SdoLine, node: ObservedNode, address: Address | None, data: bytes) -> None:
        words = label(address) if address else "a segment"
        if line.owed:
            line.owed -= 1
            if line.is_shared and self.bus.own_question and self.bus.own_question[0] == node.node_id:
                return  # another client started before our request was answered
            text = f"answers late: {words}"
            cause = "the node answered after its client had given up"
            self._found(BusRule.SDO_UNASKED, node, text, cause)
        elif line.answered and self._is_second(line, line.answered, time, address, data):
            one = line.answered[2][4:].hex(" ")
            two = data[4:].hex(" ")
            text = f"node-ID {node.node_id} is used twice: two answers to one request for {label(address)}"
            self.bus.found(BusRule.TWO_NODES, node.name, f"{text}, {one} and {two}", "answers")
        else:
            self._found(BusRule.SDO_UNASKED, node, f"answers without a request: {words}")

    @staticmethod
    def _is_second(
        line: SdoLine, first: tuple[float, Address, bytes], time: float, address: Address | None, data: bytes
    ) -> bool:
        """Return whether an answer is a second node's to one request; two clients would also explain it."""
        since, answered, before = first
        is_same = answered == address and before[0] >> 5 == data[0] >> 5
        return is_same and time - since < TWICE and not line.is_shared

    def _ended(self, ended: SdoTransfer, node: ObservedNode, is_refused: bool, asked: Occurrences | None) -> None:
        way = "read" if ended.is_upload else "write"
        if (ended.aborted is not None or not ended.is_whole) and self._is_own(node, ended.address):
            return  # reported with the incident
        if ended.aborted is not None:
            if ended.aborted == AbortCode.TIMEOUT and not is_refused and asked:
                self._unanswered(node, f"the {way} of {ended.object}", asked)
                return
            self._aborted(ended, node, f"{way} of {ended.object}", is_refused)
        elif not ended.is_whole:
            if ended.how == How.EXPEDITED.value and asked and not self._is_hasty(asked.places[0].time):
                self._unanswered(node, f"the {way} of {ended.object}", asked)
        elif ended.address is not None and ended.content is not None:
            if ended.address in IDENTIFIES and ended.is_upload and node.dictionary:
                self._differs(node, node.dictionary, ended.address, ended.content)
            if ended.address[0] == IDENTITY and ended.address[1] and ended.is_upload:
                self._identity(node, ended.address, ended.content)
            if ended.address in self._own.get(node.node_id, ()):
                node.shown[ended.address] = ended.content
            if not ended.is_upload:
                self._written(node, ended.address, ended.content)

    def _differs(self, node: ObservedNode, file: Dictionary, address: Address, content: bytes) -> None:
        """Compare the reported identity of a device with its file."""
        said = int.from_bytes(content, "little")
        wanted = file.number(address)
        mask = IDENTIFIES[address]
        if address == SERIAL and not file.has_own_value(address):
            return  # an EDS is for all devices of a kind
        if wanted and (said ^ wanted) & mask:
            text = f"is another device than its file is for: {object_words(file, address)}"
            text = f"{text} is 0x{said:08X}, {file.file.name} has 0x{wanted:08X}"
            self.bus.found(BusRule.OTHER_DEVICE, node.name, text, address)

    def _identity(self, node: ObservedNode, address: Address, content: bytes) -> None:
        """Compare an identity with the previous answer, unless the node booted in between."""
        boots, before = self._identities.get((node.node_id, address), (node.boots, content))
        if boots == node.boots and before != content:
            texts = (f"0x{int.from_bytes(each, 'little'):08X}" for each in (before, content))
            text = f"node-ID {node.node_id} is used twice: {label(address)} is {' and '.join(texts)} by turns"
            self.bus.found(BusRule.TWO_NODES, node.name, text, "identity")
        self._identities[node.node_id, address] = node.boots, content

    def _lone_abort(self, node: ObservedNode, end: SdoEnd, data: bytes) -> None:
        """Report an abort whose transfer is not in the log."""
        initiate = Initiate.of(data)
        words = object_words(end.dictionary, initiate.address)
        by = "aborts" if end.is_answer else "has its client abort"
        text = f"{by} a transfer of {words} that is not in the log: {code_and_reason(initiate.number)}"
        is_probe = initiate.number in (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX)
        rule = BusRule.SDO_PROBED if is_probe else BusRule.SDO_ABORT
        cause = when_sent(initiate.number, initiate.address[0])
        self.bus.found(rule, node.name, text, (words, initiate.number), cause=cause)

    def _unanswered(self, node: ObservedNode, what: str, seen: Occurrences | None = None) -> None:
        cause = self._why_silent(node)
        object_ = what.partition(" of ")[2] or what.partition(" for ")[2]
        if node.heard or len(self._silent.setdefault(object_, {})) > 127 or len(self._silent) > MOST_QUESTIONS:
            self._found(BusRule.SDO_UNANSWERED, node, f"does not answer {what}", cause, seen)
            return
        here = self._silent[object_].setdefault(node.node_id, (f"does not answer {what}", cause, Occurrences()))
        here[2].join(seen or Occurrences.once(self.bus.at()))

    @staticmethod
    def _why_silent(node: ObservedNode) -> str:
        if node.state is not None and not SERVICES[node.state].sdo:
            return f"the node is {STATE_NAMES[node.state]}, where it has no SDO (CiA 301, 7.3.2.2.4)"
        if node.heard:
            return "the node is there, but its SDO server hangs, refuses without a word, or is elsewhere (0x1200)"
        return "the node was not heard by then: it boots later, has no power, another bit rate or node-ID"

    def _aborted(self, ended: SdoTransfer, node: ObservedNode, what: str, is_refused: bool) -> None:
        assert ended.aborted is not None
        index = ended.address[0] if ended.address else 0
        is_probe = ended.is_upload and ended.aborted in (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX)
        rule = BusRule.SDO_PROBED if is_probe else BusRule.SDO_ABORT
        if ended.aborted == AbortCode.TOGGLE_BIT:
            rule = BusRule.SDO_TOGGLE
        cause = when_sent(ended.aborted, index)
        if ended.address and node.dictionary:
            cause = "; ".join(filter(None, (cause, _by_file(node.dictionary, ended.address, ended.aborted))))
        if on_first_axis(index) == MODE and ended.aborted == AbortCode.VALUE:
            cause = "the drive does not have this mode of operation: compare 0x6502"
        by = "aborts" if is_refused else "has its client abort"
        text = f"{by} the {what}: {code_and_reason(ended.aborted)}"
        self.bus.found(rule, node.name, text, (ended.object, ended.is_upload, ended.aborted), cause=cause)

    def damaged(self, meaning: Meaning) -> None:
        """Process a frame that shows an incomplete transfer."""
        ended = meaning.transfer
        if ended and ended.is_whole and ended.address is None:
            return  # the log begins in the middle
        if ended and self._is_interrupted(meaning):
            return
        (text,) = (each.text for each in meaning.defects[:1])
        rule = BusRule.SDO_TOGGLE if text.endswith(SKIPPED) else BusRule.SDO_BROKEN
        self.bus.found(rule, meaning.nodes[0], text.partition(": ")[2])

    def _is_interrupted(self, meaning: Meaning) -> bool:
        """Return whether a second client started a transfer amid another one, and report it."""
        end = meaning.service.end if isinstance(meaning.service, CanopenService) else None
        if end is None or end.is_answer or not isinstance(meaning.raw, Frame) or meaning.transfer is None:
            return False
        line = self._lines.get(end.channel)
        command = end.command(meaning.raw.data)
        is_new = command is not None and command.names_object and line is not None
        if (
            not is_new
            or line is None
            or not 0 < self.bus.now - line.last < (RESTLESS if line.was_answer else IMPATIENT)
        ):
            return False
        words = object_words(end.dictionary, Initiate.of(meaning.raw.data).address)
        line.is_shared = True
        one = f"the {'read' if meaning.transfer.is_upload else 'write'} of {meaning.transfer.object}"
        text = f"two clients use one channel: {one} goes on, and another one begins with {words}"
        self.bus.found(BusRule.TWO_CLIENTS, self.bus.node(end.server).name, text)
        return True

    # Configuration

    def _written(self, node: ObservedNode, address: Address, content: bytes) -> None:
        node.is_configured = True
        wanted = self._own.get(node.node_id, {}).get(address)
        pdo = values.pdo_of(address[0])
        if wanted is None or content == wanted or pdo is not None:  # for a PDO, only the value at the start counts
            return
        text = f"{object_words(node.dictionary, address)} is set to {content.hex(' ')}; its file has {wanted.hex(' ')}"
        self.bus.found(BusRule.CONFIGURED_OTHERWISE, node.name, text, address)

    def _start(self, node_id: int) -> None:
        """Compare the values written to the started nodes with their files; node-ID 0 means all."""
        nodes = list(self.bus.nodes.values()) if node_id == values.ALL_NODES else [self.bus.node(node_id)]
        for node in nodes:
            if not (node.booted and node.is_configured):
                continue
            own = self._own.get(node.node_id, {})
            left = [each for each, wanted in own.items() if node.shown.get(each) != wanted]
            if left:
                named = ", ".join(object_words(node.dictionary, each) for each in left[:LISTED])
                more = f" and {len(left) - LISTED} more" if len(left) > LISTED else ""
                text = f"is started without {amount(len(left), 'value')} of its file: {named}{more}"
                self.bus.found(BusRule.NOT_CONFIGURED, node.name, text)
            node.booted = False  # reported once per boot-up

    def end(self, time: float) -> None:
        if self._is_one_way():
            return
        held = () if len(self._ways) > 1 else self._held.values()
        for each in held:
            each.report(self.bus)
        silent = {object_: dict(nodes) for object_, nodes in self._silent.items()}
        for channel, line in self._lines.items():
            service = self.bus.decoder.services.get(channel)
            if line.asked is None or time - line.asked <= PATIENT or not (service and service.end):
                continue
            node = self.bus.node(service.end.server)
            if self._is_own(node, line.address):
                continue
            said = f"does not answer the request for {line.object}", self._why_silent(node)
            if node.heard:
                self.bus.found(BusRule.SDO_UNANSWERED, node.name, said[0], cause=said[1], seen=line.seen)
            else:
                silent.setdefault(line.object, {}).setdefault(node.node_id, (*said, line.seen or Occurrences()))
        for object_, nodes in silent.items():
            self._questions(object_, nodes)

    def _is_one_way(self) -> bool:
        """Return whether a log has only one direction, and report it; unanswered requests alone do not count."""
        shows = [each for each in self._held.values() if each.rule is not BusRule.SDO_UNANSWERED]
        if len(self._ways) == 1 and shows:
            self.bus.found(BusRule.ONE_DIRECTION, "", ONE_WAY[True in self._ways], seen=shows[0].seen)
            return True
        return False

    def _questions(self, object_: str, nodes: Mapping[int, tuple[str, str, Occurrences]]) -> None:
        """Report nodes that did not answer: as a scan, or one by one."""
        if len(nodes) < SCAN:
            for node_id, (text, cause, seen) in nodes.items():
                self.bus.found(BusRule.SDO_UNANSWERED, self.bus.node(node_id).name, text, cause=cause, seen=seen)
            return
        whole = Occurrences()
        for _, _, seen in nodes.values():
            whole.join(seen)
        text = f"a scan: {amount(len(nodes), 'node-ID')} without a node are asked for {object_}"
        self.bus.found(BusRule.SDO_SCAN, "", text, object_, seen=whole)


def _own_values(dictionary: Dictionary) -> dict[Address, bytes]:
    """Return the values of a DCF that differ from the defaults, as an SDO carries them."""
    found = {}
    for address in dictionary.addresses():
        variable = dictionary.variable(address)
        if variable is not None and variable.value not in (None, variable.default) and address in dictionary.parameters:
            content = objects.default_bytes(variable)
            if content is not None:
                found[address] = content
    return found


def _by_file(dictionary: Dictionary, address: Address, code: int) -> str:
    """Return the entry of a refused object in the device's file, as text."""
    variable = dictionary.variable(address)
    if code in (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX):
        return f"{dictionary.file.name} {'does not have it either' if variable is None else 'has it: another version?'}"
    if variable is None:
        return f"{dictionary.file.name} does not have it"
    range_ = objects.limits(variable)
    limits = f", {range_.low}..{range_.high}" if range_ and code in OF_VALUES else ""
    return f"{dictionary.file.name} says {objects.data_type(variable).name}, {variable.access_type}{limits}"


OF_VALUES = (AbortCode.VALUE, AbortCode.TOO_HIGH, AbortCode.TOO_LOW)
"""Abort codes about a value."""
