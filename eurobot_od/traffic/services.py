"""The CANopen services besides the messages, by identifier (CiA 301, 7.3.3; CiA 302-2, 304, 305).

What a single frame says is in `words`, what several say together in `transfers`.

What a frame means is said without the frames before it, so that a log may start anywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple

from eurobot_od.device.broadcasts import ErrorWords
from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary, sdo_channels
from eurobot_od.od.standard import (
    EMCY,
    SRDO_DATA,
    SRDO_DIRECTION,
    SRDO_INVERTED,
    SRDOS,
    SYNC,
    SYNC_PRODUCER,
    TIME,
)
from eurobot_od.traffic import words as words
from eurobot_od.traffic.entries import MASTER
from eurobot_od.traffic.words import ANSWERS, REQUESTS, frame_words

NMT, GFC, FLYING_MASTER, SYNC_NAME, TIME_NAME = "NMT", "GFC", "Flying master", "SYNC", "TIME"
EMCY_NAME, SRDO, SDO, HEARTBEAT, GUARDING, LSS = "EMCY", "SRDO", "SDO", "Heartbeat", "Node guarding", "LSS"

NAMES = (NMT, GFC, FLYING_MASTER, SYNC_NAME, TIME_NAME, EMCY_NAME, SRDO, SDO, HEARTBEAT, GUARDING, LSS)
"""The names of all services."""

NO_WORDS = ErrorWords({}, {}, {})
"""No words but those of CiA 301."""

ANY_LENGTH: tuple[int, ...] = ()

SENT = 1
"""The direction of an SRDO that its device sends (CiA 304); 2: it receives it."""


class SdoEnd(NamedTuple):
    """Which end of an SDO channel sends under an identifier; the `channel` is called by that of its requests.

    `server` is the node-ID of the one with the objects.
    """

    channel: int
    is_answer: bool
    dictionary: Dictionary | None
    server: int


class CanopenService(NamedTuple):
    """What an identifier is for: the service's name, its node, the frame's `lengths` (none: any), and its words.

    `sender` is who sends it; empty if that cannot be known.
    """

    name: str
    node: str
    lengths: tuple[int, ...]
    text: Callable[[bytes], str]
    sender: str = ""
    end: SdoEnd | None = None

    @property
    def expected(self) -> str:
        """The lengths in words."""
        return " or ".join(map(str, self.lengths))


class KnownNode(NamedTuple):
    """What is known of the node that a frame is from or for: its name, and its dictionary if there is one."""

    node_id: int
    name: str
    dictionary: Dictionary | None = None

    @classmethod
    def unnamed(cls, node_id: int) -> KnownNode:
        """Return a node of which only the node-ID is known."""
        return cls(node_id, f"node {node_id}")


Services = dict[int, CanopenService]


def services(dictionaries: Iterable[Dictionary], errors: ErrorWords = NO_WORDS, master: str = MASTER) -> Services:
    """Return the services by identifier: the predefined ones of all node-IDs, then what the EDS files say.

    `errors` are the words for the devices' emergency error codes, `master` is the name of who leads the network.
    """
    known = {each.node_id: KnownNode(each.node_id, each.name, each) for each in dictionaries}
    found = _broadcast({node_id: node.name for node_id, node in known.items()}, master)
    emcy = {}
    for node_id in values.NODE_IDS:
        node = known.get(node_id, KnownNode.unnamed(node_id))
        emcy[node_id] = CanopenService(EMCY_NAME, node.name, (8,), partial(words.emcy, errors.of(node_id)), node.name)
        found[values.EMCY_BASE + node_id] = emcy[node_id]
        found |= _sdo(node, values.SDO_REQUEST_BASE + node_id, values.SDO_RESPONSE_BASE + node_id, master)
        found[values.ERROR_CONTROL_BASE + node_id] = CanopenService(
            HEARTBEAT, node.name, (1,), words.heartbeat, node.name
        )
    devices = [each.dictionary for each in known.values() if each.dictionary]
    for device in devices:  # after the predefined ones: what a node's file says is what it does
        found |= _moved(device, found, emcy[device.node_id]) | _safety(device)
    for device in devices:  # after all have said where SYNC and TIME are: a producer names itself
        found |= _produced(device, found)
        for server, client, request, answer in sdo_channels(device):
            asks = known.get(client, KnownNode.unnamed(client)).name if client else master
            found |= _sdo(known.get(server, KnownNode.unnamed(server)), request, answer, asks)
    return found


def _broadcast(names: Mapping[int, str], master: str) -> Services:
    """Return the services that belong to no node."""
    plainly = {
        0x072: "negotiation of a new master",
        0x073: "who is the active master?",
        0x074: "a device that can be master is there",
        0x075: "who can be master?",
        0x076: "negotiation of a new master is forced",
    }
    return {
        values.NMT_COB_ID: CanopenService(NMT, "", (2,), partial(words.nmt, names), master),
        0x001: CanopenService(GFC, "", (0,), words.said_plainly("all devices into their safe state")),
        0x071: CanopenService(FLYING_MASTER, "", (2,), partial(words.active_master, names), master),
        **{
            cob_id: CanopenService(FLYING_MASTER, "", ANY_LENGTH, words.said_plainly(what))
            for cob_id, what in plainly.items()
        },
        values.SYNC_COB_ID: CanopenService(SYNC_NAME, "", (0, 1), words.sync, master),
        values.TIME_COB_ID: CanopenService(TIME_NAME, "", (6,), words.time, master),
        standard.REQUESTS: CanopenService(LSS, "", (standard.LENGTH,), words.lss_request, master),
        standard.ANSWERS: CanopenService(LSS, "", (standard.LENGTH,), words.lss_answer),
    }


def _sdo(node: KnownNode, request: int, answer: int, client: str) -> Services:
    return {
        cob_id: CanopenService(
            SDO,
            node.name,
            (8,),
            partial(frame_words, commands, node.dictionary),
            sender,
            SdoEnd(request, commands is ANSWERS, node.dictionary, node.node_id),
        )
        for cob_id, commands, sender in ((request, REQUESTS, client), (answer, ANSWERS, node.name))
    }


def _moved(dictionary: Dictionary, predefined: Services, emcy: CanopenService) -> Services:
    """Return what a file says is under another identifier than the predefined one."""
    entries = {
        SYNC: predefined[values.SYNC_COB_ID],
        TIME: predefined[values.TIME_COB_ID],
        EMCY: emcy,
    }
    found = {address: dictionary.number(address) for address in entries}
    # The highest bit says "not valid" of EMCY only: of TIME it is "consumed", and of SYNC it means nothing.
    return {
        values.identifier(entry): entries[address]
        for address, entry in found.items()
        if entry is not None and not (address == EMCY and entry & values.NOT_VALID)
    }


def _produced(dictionary: Dictionary, known: Services) -> Services:
    """Return what a device sends itself, and not the master: SYNC and TIME, if its file says that it produces them."""
    entries = (dictionary.number(each) or 0 for each in (SYNC, TIME))
    produced = [values.identifier(entry) for entry in entries if entry & SYNC_PRODUCER]  # of TIME the same bit
    return {cob_id: known[cob_id]._replace(sender=dictionary.name) for cob_id in produced}


def _safety(dictionary: Dictionary) -> Services:
    """Return the safety-relevant data objects of a device: its data, and the same with all bits inverted (CiA 304)."""
    found = {}
    for index in (each for each in SRDOS if each in dictionary.members):
        if direction := dictionary.number((index, SRDO_DIRECTION)):  # 0: it is not valid
            for sub, text in ((SRDO_DATA, words.plain), (SRDO_INVERTED, words.inverted)):
                if entry := dictionary.number((index, sub)):
                    found[values.identifier(entry)] = CanopenService(
                        SRDO, dictionary.name, ANY_LENGTH, text, dictionary.name if direction == SENT else ""
                    )
    return found
