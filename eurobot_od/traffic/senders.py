"""The sender of a frame, as far as the devices' files name it: for filters by sender.

Only identifiers count. NMT commands and SDO requests come from a master, which has no name here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from eurobot_od.frame import Frame
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import EMCY, SDO_ANSWERS
from eurobot_od.pdo.catalogue import plain_name
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.traffic.filters import known_name

OWN_SERVICES = (
    (EMCY, values.EMCY_BASE),
    (SDO_ANSWERS, values.SDO_RESPONSE_BASE),
    (None, values.ERROR_CONTROL_BASE),
)
"""What a device sends besides messages: the object with its identifier, and the predefined identifier."""


def senders(dictionaries: Iterable[Dictionary], protocol: Protocol) -> dict[int, frozenset[str]]:
    """Return the names of the devices that send each identifier; an identifier without a known sender is left out."""
    found: dict[int, set[str]] = {}
    for dictionary in dictionaries:
        for address, base in OWN_SERVICES:
            cob_id = dictionary.cob_id(address, base) if address else base + dictionary.node_id
            found.setdefault(cob_id, set()).add(dictionary.name)
    messages = {each.cob_id: frozenset(each.senders) for each in protocol.bindings if each.senders}
    return {cob_id: frozenset(names) for cob_id, names in found.items()} | messages


def by_sender(
    dictionaries: Collection[Dictionary], protocol: Protocol, only: Iterable[str], without: Iterable[str]
) -> Callable[[Frame], bool]:
    """Want what devices send: `only` these, or everything but frames that come from those `without` alone.

    Raises UnknownName. A frame without a known sender is wanted unless `only` is given.
    """
    known = {plain_name(each.name): each.name for each in dictionaries}
    wanted, unwanted = ({known_name(name, known, "node") for name in names} for names in (only, without))
    sent_by, nobody = senders(dictionaries, protocol), frozenset[str]()

    def wants(frame: Frame) -> bool:
        names = sent_by.get(frame.cob_id, nobody)
        return not wanted.isdisjoint(names) if wanted else not names or not names <= unwanted

    return wants
