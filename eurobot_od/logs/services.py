"""The CANopen services besides the messages, by identifier (CiA 301, 7.3.3; CiA 302-2, 304, 305).

What they say is in `network_words` and `sdo_words`, what their frames say together in `transfers`.

Rule of this file: one frame at a time. What a frame means is said without the frames before it, so that a log may
start anywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple

from eurobot_od.device.emergency import ErrorWords
from eurobot_od.logs import network_words as words
from eurobot_od.logs.sdo_words import ANSWERS, REQUESTS, frame_words
from eurobot_od.od import lss, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.sdo_channel import sdo_channels
from eurobot_od.od.standard import (
    EMCY,
    SRDO_DATA,
    SRDO_DIRECTION,
    SRDO_INVERTED,
    SRDOS,
    SYNC,
    TIME,
)

NMT, GFC, FLYING_MASTER, SYNC_NAME, TIME_NAME = "NMT", "GFC", "Flying master", "SYNC", "TIME"
EMCY_NAME, SRDO, SDO, HEARTBEAT, GUARDING, LSS = "EMCY", "SRDO", "SDO", "Heartbeat", "Node guarding", "LSS"

NAMES = (NMT, GFC, FLYING_MASTER, SYNC_NAME, TIME_NAME, EMCY_NAME, SRDO, SDO, HEARTBEAT, GUARDING, LSS)
"""The names of all services."""

NO_WORDS = ErrorWords({}, {}, {})
"""No words but those of CiA 301."""

ANY_LENGTH: tuple[int, ...] = ()


class SdoEnd(NamedTuple):
    """Which end of an SDO channel sends under an identifier; the `channel` is called by that of its requests."""

    channel: int
    is_answer: bool
    dictionary: Dictionary | None


class CanopenService(NamedTuple):
    """What an identifier is for: the service's name, its node, the frame's `lengths` (none: any), and its words."""

    name: str
    node: str
    lengths: tuple[int, ...]
    text: Callable[[bytes], str]
    end: SdoEnd | None = None

    @property
    def expected(self) -> str:
        """The lengths in words."""
        return " or ".join(map(str, self.lengths))


class KnownNode(NamedTuple):
    """What is known of the node that a frame is from or for: its name, and its dictionary if there is one."""

    name: str
    dictionary: Dictionary | None = None


Services = dict[int, CanopenService]


def services(dictionaries: Iterable[Dictionary], errors: ErrorWords = NO_WORDS) -> Services:
    """Return the services by identifier: the predefined ones of all node-IDs, then what the EDS files say.

    `errors` are the words for the devices' emergency error codes.
    """
    known = {each.node_id: KnownNode(each.name, each) for each in dictionaries}
    found = _broadcast({node_id: node.name for node_id, node in known.items()})
    emcy = {}
    for node_id in values.NODE_IDS:
        node = known.get(node_id, KnownNode(f"node {node_id}"))
        emcy[node_id] = CanopenService(EMCY_NAME, node.name, (8,), partial(words.emcy, errors.of(node_id)))
        found[values.EMCY_BASE + node_id] = emcy[node_id]
        found |= _sdo(node, values.SDO_REQUEST_BASE + node_id, values.SDO_RESPONSE_BASE + node_id)
        found[values.ERROR_CONTROL_BASE + node_id] = CanopenService(HEARTBEAT, node.name, (1,), words.heartbeat)
    for node_id, node in known.items():  # after the predefined ones: what a node's file says is what it does
        assert node.dictionary is not None
        found |= _moved(node.dictionary, found, emcy[node_id]) | _safety(node.dictionary)
    for dictionary in (each.dictionary for each in known.values()):
        for server, request, answer in sdo_channels(dictionary) if dictionary else ():
            found |= _sdo(known.get(server, KnownNode(f"node {server}")), request, answer)
    return found


def _broadcast(names: Mapping[int, str]) -> Services:
    """Return the services that belong to no node."""
    plainly = {
        0x072: "negotiation of a new master",
        0x073: "who is the active master?",
        0x074: "a device that can be master is there",
        0x075: "who can be master?",
        0x076: "negotiation of a new master is forced",
    }
    return {
        values.NMT_COB_ID: CanopenService(NMT, "", (2,), partial(words.nmt, names)),
        0x001: CanopenService(GFC, "", (0,), words.said_plainly("all devices into their safe state")),
        0x071: CanopenService(FLYING_MASTER, "", (2,), partial(words.active_master, names)),
        **{
            cob_id: CanopenService(FLYING_MASTER, "", ANY_LENGTH, words.said_plainly(what))
            for cob_id, what in plainly.items()
        },
        values.SYNC_COB_ID: CanopenService(SYNC_NAME, "", (0, 1), words.sync),
        values.TIME_COB_ID: CanopenService(TIME_NAME, "", (6,), words.time),
        lss.REQUESTS: CanopenService(LSS, "", (lss.LENGTH,), words.lss_request),
        lss.ANSWERS: CanopenService(LSS, "", (lss.LENGTH,), words.lss_answer),
    }


def _sdo(node: KnownNode, request: int, answer: int) -> Services:
    return {
        cob_id: CanopenService(
            SDO,
            node.name,
            (8,),
            partial(frame_words, commands, node.dictionary),
            SdoEnd(request, commands is ANSWERS, node.dictionary),
        )
        for cob_id, commands in ((request, REQUESTS), (answer, ANSWERS))
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


def _safety(dictionary: Dictionary) -> Services:
    """Return the safety-relevant data objects of a device: its data, and the same with all bits inverted (CiA 304)."""
    found = {}
    for index in (each for each in SRDOS if each in dictionary.members):
        if dictionary.number((index, SRDO_DIRECTION)):  # 0: it is not valid
            for sub, text in ((SRDO_DATA, words.plain), (SRDO_INVERTED, words.inverted)):
                if entry := dictionary.number((index, sub)):
                    found[values.identifier(entry)] = CanopenService(SRDO, dictionary.name, ANY_LENGTH, text)
    return found
