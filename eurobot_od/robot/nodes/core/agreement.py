"""Checks by SDO, at each node check and after each loss, that another node reads frames as the core does.

Both have the fingerprints of all messages (see `od.fingerprints`): one number is read, and only if it differs the
others, to name the messages that differ. A node with other numbers, or none, is not driven. One that answers no SDO
cannot be asked: the nodes of 2014 have none, and their dialect states that in the setting `Nodes without SDO`; in any
other dialect such a node is not driven either.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from eurobot_od.device.device import Device
from eurobot_od.device.timers import Ask, Script
from eurobot_od.errors import DictionaryError, NoAnswer, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od import fingerprints
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.fingerprints import FINGERPRINTS, FIRST, OF_ALL, MessageDifference
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import COB_ID, MAPPING_OFFSET, Address, MappingEntry, PdoDirection, identifier
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.sdo.client import TransferError, download, upload

CHANNEL_NAME = "SDO client parameter {}"
"""ParameterName of the record with the identifiers for a node's SDO server."""

QUESTIONS = 3
"""How often a node is asked before it counts as one without SDO: a single answer may be lost."""

NAMED = 3
"""Most messages that are named one by one."""


class SdoClientParameter(NamedTuple):
    """The identifiers by which a device reaches another one by SDO (CiA 301, 7.5.2.34)."""

    request: int
    answer: int
    node_id: int

    @classmethod
    def to(cls, node: str, device: Device) -> SdoClientParameter | None:
        """Return the parameter for a node, None if the device's EDS has none."""
        try:
            index, _ = device.dictionary.address(CHANNEL_NAME.format(node))
        except DictionaryError:
            return None
        return cls(*(device.objects.number((index, subindex)) for subindex in (1, 2, 3)))

    def ask(self, address: Address) -> Frame:
        """Return the request for an object's value."""
        (request,) = upload(address, inf).start(0.0)
        return Frame(self.request, request)

    def order(self, dictionary: Dictionary, name: str, value: int) -> Frame:
        """Return the request that writes a number of up to 4 bytes to an object; raises DictionaryError."""
        address = dictionary.address(name)
        variable = dictionary.variable(address)
        assert variable is not None  # it has an address
        # Least significant byte first, as CiA 301 transfers numbers; up to four bytes fit an expedited transfer.
        content = value.to_bytes((len(variable) + 7) // 8, "little")
        (request,) = download(address, content, inf).start(0.0)
        return Frame(self.request, request)


def number_in(answer: Frame, address: Address) -> int | None:
    """Return the number in the answer to a request for an object, None if the answer has none."""
    # Only one request is sent and one answer awaited, so the transfer needs no time and ends here: a node that would
    # send its number in segments, or sends a wrong answer, gives none.
    question = upload(address, inf)
    question.start(0.0)
    question.receive(answer.data, 0.0)
    try:
        return int.from_bytes(question.result(), "little") if question.done else None
    except TransferError:
        return None


class NodeMismatch(RemoteError):
    """A node does not read frames as the core does, or cannot answer whether it does; nothing is driven.

    `what` is the reason. If the node has a number for all messages, its dialect is named only where the error is turned
    into text, not where it is raised: finding it reads EDS files, and the core runs on the thread that receives frames.
    """

    def __init__(self, node: str, node_id: int, what: str, of_all: int | None = None) -> None:
        super().__init__(node, node_id, what, of_all)
        self.node = node
        self.node_id = node_id
        self.what = what
        self.of_all = of_all

    def __str__(self) -> str:
        return f"{self.node} (node {self.node_id}) {self.what}{_dialect(self.of_all)}; nothing is driven"


def _dialect(of_all: int | None) -> str:
    """Return the name of the dialect with a fingerprint of all messages, as a part of a sentence.

    It is empty if there is none.
    """
    loaded = ((name, next(iter(dialects.load_all(name)))) for name in dialects.names() if of_all is not None)
    known = [name for name, dictionary in loaded if dictionary.default((FINGERPRINTS, OF_ALL)) == of_all]
    return f" (its EDS is that of the dialect {known[0]})" if known else ""


def compare(core: CoreSettings, node: str) -> Script[None]:
    """Check that a node reads frames as we do; raises NodeMismatch. A node that `asks` does not name is trusted."""
    channel = SdoClientParameter.to(node, core.device)
    if channel is None:
        return
    try:
        theirs = yield from _number(core, channel, (FINGERPRINTS, OF_ALL))
    except NoAnswer:
        if core.trusts_without_sdo:
            return
        what = "answers no SDO, so nobody knows how it maps; is it one of 2014, which has a dialect of its own?"
        raise NodeMismatch(node, channel.node_id, what) from None
    if theirs is None:
        raise NodeMismatch(
            node, channel.node_id, f"has no message fingerprints (0x{FINGERPRINTS:04X}): make its EDS anew"
        )
    if theirs != core.device.objects.number((FINGERPRINTS, OF_ALL)):
        what = yield from _what_differs(core, channel)
        if what:
            raise NodeMismatch(node, channel.node_id, f"maps messages differently: {what}", theirs)


def _number(core: CoreSettings, channel: SdoClientParameter, address: Address) -> Script[int | None]:
    """Ask for a number; None if the node has another answer. Raises NoAnswer."""
    # A node that may have no SDO is asked only once: the document limits the time of the startup.
    attempts = 1 if core.trusts_without_sdo else QUESTIONS
    answer = yield Ask(channel.ask(address), channel.answer, core.identity_wait, attempts)
    return number_in(answer, address)


def _what_differs(core: CoreSettings, channel: SdoClientParameter) -> Script[str]:
    """Return the names of the messages that differ, as far as the node answers; empty if it maps its own as we do."""
    try:
        return (yield from _messages_that_differ(core, channel))
    except NoAnswer:
        return "nobody knows which, as it answers no SDO any more"


def _messages_that_differ(core: CoreSettings, channel: SdoClientParameter) -> Script[str]:
    device = core.device
    theirs = yield from _numbers(core, channel, lambda n: (FINGERPRINTS, FIRST + n))
    found = fingerprints.differences(fingerprints.in_force(device.dictionary, device.objects.value), theirs)
    texts = []
    for each in found[:NAMED]:
        texts.append((yield from _difference(core, channel, each)))
    more = len(found) - NAMED
    return "; ".join(texts + ([f"and {more} more"] if more > 0 else []))


def _numbers(core: CoreSettings, channel: SdoClientParameter, address: Callable[[int], Address]) -> Script[list[int]]:
    """Return the numbers at the addresses for 0, 1, 2, ... up to the first that is not there."""
    found: list[int] = []
    while (number := (yield from _number(core, channel, address(len(found))))) is not None:
        found.append(number)
    return found


def _difference(core: CoreSettings, channel: SdoClientParameter, each: MessageDifference) -> Script[str]:
    if not each.name:
        return f"0x{each.identifier:03X} is a message that the core does not know"
    if each.identifier is None:
        return f"it does not know {each.name}"
    if not each.bits:
        return f"{each.name} has the identifier 0x{each.identifier:03X} there"
    device = core.device
    pdo = next(p for p in device.dictionary.read_pdos(device.objects.value, lambda _: None) if p.name == each.name)
    return f"{each.name} (0x{each.identifier:03X}): {(yield from _bits(core, channel, pdo))}"


OTHER_END = {PdoDirection.RPDO: PdoDirection.TPDO, PdoDirection.TPDO: PdoDirection.RPDO}


def _bits(core: CoreSettings, channel: SdoClientParameter, ours: Pdo) -> Script[str]:
    """Return which bits of a message differ, by the mapping that the node has now."""
    first = OTHER_END[ours.direction].value
    cob_ids = yield from _numbers(core, channel, lambda n: (first + n, COB_ID))
    index = next((first + n for n, each in enumerate(cob_ids) if identifier(each) == ours.cob_id), None)
    if index is None:
        return "its bits or codes"
    count = (yield from _number(core, channel, (index + MAPPING_OFFSET, 0))) or 0
    entries = yield from _numbers(core, channel, lambda n: (index + MAPPING_OFFSET, 1 + n))
    theirs = [MappingEntry.of(each) for each in entries[:count]]
    here = [MappingEntry(*each.address, each.bits) for each in ours.mapping]
    if theirs == here:
        return "its codes, units or name"
    bits = {each.address: each.bits for each in theirs}
    odd = [
        f"{mapped.name} has {bits.get(mapped.address, 0)} bits there, {mapped.bits} here"
        for mapped in ours.mapping
        if bits.get(mapped.address) != mapped.bits
    ]
    return ", ".join(odd) or "more bits there, or in another order"
