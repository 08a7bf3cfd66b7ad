"""Watches SDO: aborts, answers that are missing or too many, broken transfers, and what a master configures.

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
from eurobot_od.od.values import Address, label
from eurobot_od.sdo.wire import ABORT, AbortCode, Initiate, ServerCommand, code_and_reason, when_sent
from eurobot_od.support.texts import amount
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, Watcher
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Meaning, SdoTransfer
from eurobot_od.traffic.services import NMT, SDO, CanopenService, SdoEnd, object_words
from eurobot_od.traffic.transfers import ONE_WAY, SKIPPED, How

IMPATIENT = 0.01
"""Seconds that no client waits less for an answer: who asks again before that is another one."""

RESTLESS = 0.2
"""Time in which no client gives up a transfer that is going on, or asks for another object, in s."""

TWICE = 0.1
"""Longest time between two answers to one request, from two nodes, in s."""

SCAN = 5
"""So many nodes that do not answer the same question are looked for by a scan."""

IDENTIFIES: Mapping[Address, int] = {
    DEVICE_TYPE: 0xFFFF_FFFF,
    (IDENTITY, 1): 0xFFFF_FFFF,
    (IDENTITY, 2): 0xFFFF_FFFF,
    REVISION: 0xFFFF_0000,
    SERIAL: 0xFFFF_FFFF,
}
"""Objects by which a device is known, and the bits that count: minor revisions behave alike (CiA 301, 7.5.2.21)."""

MOST_QUESTIONS = 32
"""Most objects for which the nodes are kept that do not answer."""

NAMING = (ServerCommand.DOWNLOAD, ServerCommand.UPLOAD)
"""Answers that name their object."""

PATIENT = 0.5
"""Seconds after which a request that has no answer at the end of a log has none at all."""

SETTLED = 1.0
"""Seconds from the begin of a log on in which an answer may belong to a request before it."""

LISTED = 5
"""Objects that are named in a line."""


@dataclass
class SdoLine:
    """An SDO channel: the object of the last request, when that came, and where; None after its answer.

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
    """What only counts if the log has requests and answers: `rule`, `node` and `text` of the incident."""

    rule: BusRule
    node: ObservedNode
    text: str
    cause: str
    seen: Occurrences

    def report(self, bus: ObservedBus) -> None:
        """Report it on its bus."""
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

    def take(self, time: float, meaning: Meaning) -> None:
        if meaning.name == NMT:
            said = meaning.fields
            if said and said["command"] == COMMAND_NAMES[NmtCommand.START]:
                self._start(said["node"])
            return
        frame = meaning.raw
        end = meaning.service.end if isinstance(meaning.service, CanopenService) else None
        if end is None or not isinstance(frame, Frame):  # a segment of a block, or not a frame of SDO at all
            return
        self._heard(end.is_answer)
        line, node = self._lines.setdefault(end.channel, SdoLine()), self.bus.node(end.server)
        asked = line.seen if line.asked is not None else None
        if end.is_answer:
            node.heard = True
            self._answer(time, line, node, frame.data)
        else:
            self._request(time, line, node, end, frame.data)
        if frame.data[0] == ABORT and meaning.transfer is None:
            self._lone_abort(node, end, frame.data)
        if meaning.transfer:
            self._ended(meaning.transfer, node, is_refused=end.is_answer, asked=asked)
            if not end.is_answer and meaning.transfer.is_whole:
                line.asked = None  # the client's last word
        line.is_used, line.last, line.was_answer = True, time, end.is_answer

    def _heard(self, is_answer: bool) -> None:
        """Take in a direction; with both, what was held back counts."""
        if is_answer not in self._ways:
            self._ways.add(is_answer)
            for each in self._held.values() if len(self._ways) > 1 else ():
                each.report(self.bus)

    def _found(
        self, rule: BusRule, node: ObservedNode, text: str, cause: str = "", seen: Occurrences | None = None
    ) -> None:
        """Report what one direction alone does not tell, or hold it back until the other one is there."""
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
        line.asked, line.seen = time, Occurrences.once(self.bus.at())
        if address:
            line.object, line.address = words, address

    def _two_clients(self, node: ObservedNode, one: str, two: str, after: float, seen: Occurrences) -> None:
        text = f"two clients ask on one channel: {one}, and {duration(after, 6)} later {two}, before the answer"
        both = Occurrences(1, self.bus.at(), [*seen.places[:1], self.bus.at()])
        self._found(BusRule.TWO_CLIENTS, node, text, seen=both)

    def _is_own(self, node: ObservedNode, *addresses: Address | None) -> bool:
        """Return whether this program itself has asked a node for one of these objects."""
        return any((node.node_id, each) == self.bus.own_question for each in addresses)

    def _is_hasty(self, asked: float) -> bool:
        """Return whether no client would have given up waiting by now; a log without times does not tell."""
        return 0 < self.bus.now - asked < IMPATIENT

    def _answer(self, time: float, line: SdoLine, node: ObservedNode, data: bytes) -> None:
        needs_request = data[0] >> 5 < ServerCommand.ABORT  # unlike aborts, and the segments of a block
        address, named = Initiate.of(data).address, data[0] >> 5 in NAMING
        if line.asked is None and needs_request and (line.is_used or time - self.bus.began > SETTLED):
            self._unasked(time, line, node, address if named else None, data)
        if line.before and line.before[1] == address:  # the first question was not given up
            since, _, object_, seen = line.before
            line.is_shared = True
            self._two_clients(node, object_, line.object, (line.asked or time) - since, seen)
            line.before, line.owed = None, max(line.owed - 1, 0)
            return
        if line.asked is not None:
            line.asked, line.answered = None, (time, address, data)

    def _unasked(self, time: float, line: SdoLine, node: ObservedNode, address: Address | None, data: bytes) -> None:
        words = label(address) if address else "a segment"
        if line.owed:
            line.owed -= 1
            if line.is_shared and self.bus.own_question and self.bus.own_question[0] == node.node_id:
                return  # another client has begun before our question was answered
            text, cause = f"answers late: {words}", "the node answered after its client had given up"
            self._found(BusRule.SDO_UNASKED, node, text, cause)
        elif line.answered and self._is_second(line, line.answered, time, address, data):
            one, two = line.answered[2][4:].hex(" "), data[4:].hex(" ")
            text = f"node-ID {node.node_id} is used twice: two answers to one request for {label(address)}"
            self.bus.found(BusRule.TWO_NODES, node.name, f"{text}, {one} and {two}", "answers")
        else:
            self._found(BusRule.SDO_UNASKED, node, f"answers without a request: {words}")

    @staticmethod
    def _is_second(
        line: SdoLine, first: tuple[float, Address, bytes], time: float, address: Address | None, data: bytes
    ) -> bool:
        """Return whether an answer is another node's to the request that is answered; two clients explain it, too."""
        since, answered, before = first
        is_same = answered == address and before[0] >> 5 == data[0] >> 5
        return is_same and time - since < TWICE and not line.is_shared

    def _ended(self, ended: SdoTransfer, node: ObservedNode, is_refused: bool, asked: Occurrences | None) -> None:
        way = "read" if ended.is_upload else "write"
        if (ended.aborted is not None or not ended.is_whole) and self._is_own(node, ended.address):
            return  # what comes of it is said with the incident
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
        """Compare what a device says that it is with its file."""
        said, wanted, mask = int.from_bytes(content, "little"), file.number(address), IDENTIFIES[address]
        if address == SERIAL and not file.has_own_value(address):
            return  # an EDS is for all devices of a kind
        if wanted and (said ^ wanted) & mask:
            text = f"is another device than its file is for: {object_words(file, address)}"
            text = f"{text} is 0x{said:08X}, {file.file.name} has 0x{wanted:08X}"
            self.bus.found(BusRule.OTHER_DEVICE, node.name, text, address)

    def _identity(self, node: ObservedNode, address: Address, content: bytes) -> None:
        """Compare an answer about an identity with the one before, if the node has not started between."""
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
        """Take in a frame that shows that a transfer is not whole."""
        ended = meaning.transfer
        if ended and ended.is_whole and ended.address is None:
            return  # the log begins in the middle
        if ended and self._is_interrupted(meaning):
            return
        (text,) = (each.text for each in meaning.defects[:1])
        rule = BusRule.SDO_TOGGLE if text.endswith(SKIPPED) else BusRule.SDO_BROKEN
        self.bus.found(rule, meaning.nodes[0], text.partition(": ")[2])

    def _is_interrupted(self, meaning: Meaning) -> bool:
        """Return whether a second client has begun a transfer in the middle of one, and report it."""
        end = meaning.service.end if isinstance(meaning.service, CanopenService) else None
        if end is None or end.is_answer or not isinstance(meaning.raw, Frame) or meaning.transfer is None:
            return False
        line, command = self._lines.get(end.channel), end.command(meaning.raw.data)
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
        if wanted is None or content == wanted or pdo is not None:  # of a PDO the value counts that it has at the start
            return
        text = f"{object_words(node.dictionary, address)} is set to {content.hex(' ')}; its file has {wanted.hex(' ')}"
        self.bus.found(BusRule.CONFIGURED_OTHERWISE, node.name, text, address)

    def _start(self, node_id: int) -> None:
        """Compare what a master has written to the nodes that it starts with their files; 0 for all."""
        for node in list(self.bus.nodes.values()) if node_id == values.ALL_NODES else [self.bus.node(node_id)]:
            if not (node.booted and node.is_configured):
                continue
            own = self._own.get(node.node_id, {})
            left = [each for each, wanted in own.items() if node.shown.get(each) != wanted]
            if left:
                named = ", ".join(object_words(node.dictionary, each) for each in left[:LISTED])
                more = f" and {len(left) - LISTED} more" if len(left) > LISTED else ""
                text = f"is started without {amount(len(left), 'value')} of its file: {named}{more}"
                self.bus.found(BusRule.NOT_CONFIGURED, node.name, text)
            node.booted = False  # said once for each boot-up

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
        """Report that a log has only one direction, if it shows that; requests to nobody alone do not."""
        shows = [each for each in self._held.values() if each.rule is not BusRule.SDO_UNANSWERED]
        if len(self._ways) == 1 and shows:
            self.bus.found(BusRule.ONE_DIRECTION, "", ONE_WAY[True in self._ways], seen=shows[0].seen)
            return True
        return False

    def _questions(self, object_: str, nodes: Mapping[int, tuple[str, str, Occurrences]]) -> None:
        """Report who did not answer: a scan, or nodes one by one."""
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
    """Return the values that a DCF gives a device besides those that all of its kind have, as an SDO carries them."""
    found = {}
    for address in dictionary.addresses():
        variable = dictionary.variable(address)
        if variable is not None and variable.value not in (None, variable.default) and address in dictionary.parameters:
            content = objects.default_bytes(variable)
            if content is not None:
                found[address] = content
    return found


def _by_file(dictionary: Dictionary, address: Address, code: int) -> str:
    """Say what a device's file has for an object that it refuses."""
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
