"""Filters of log entries by message, group, node, field value and time.

Rule of this file: names and values are checked when a filter is made; a filter itself never raises.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import FieldError, LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import EMCY, SDO_ANSWERS
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message, plain_name
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.traffic.meaning import CANOPEN, DBC, Decoder, Meaning

Wanted: TypeAlias = Callable[[Meaning], bool]
"""Returns whether a frame with this meaning is wanted."""

OPERATORS: Mapping[str, Callable[[Any, Any], bool]] = {
    "=": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
CONDITION = re.compile(
    r"\s*(?:(?P<message>[^<>=!]+)\.)?(?P<field>\w+)\s*(?P<operator>[<>!]?=|[<>])\s*(?P<value>.+?)\s*"
)


def by_name(names: Iterable[str], decoder: Decoder) -> Wanted:
    """Return a filter for messages and services by name, or by group: of the catalogue, CANopen, or DBC.

    Raises UnknownName.
    """
    from eurobot_od.traffic import services  # here: few filters are by name

    protocol = decoder.protocol
    others = [each.name for each in decoder.others.values()]
    named = *(others and [*others, DBC]), *services.NAMES, *protocol.names(), *protocol.catalogue.groups, CANOPEN
    known = {plain_name(name): name for name in named}
    wanted = {known_name(name, known, "message") for name in names}
    return lambda meaning: meaning.name in wanted or meaning.group in wanted


def by_node(nodes: Iterable[str], known: Iterable[str]) -> Wanted:
    """Return a filter for the frames of nodes, sent or received; raises UnknownName."""
    names = {plain_name(name): name for name in known}
    if not names:
        raise LocalError(f"node {', '.join(nodes)}: without files no node has a name; name them by --eds or --network")
    wanted = {known_name(node, names, "node") for node in nodes}
    return lambda meaning: not wanted.isdisjoint(meaning.nodes)


def known_name(name: str, known: Mapping[str, str], kind: str) -> str:
    """Return the known name that equals `name` in its plain form; raises UnknownName."""
    try:
        return known[plain_name(name)]
    except KeyError:
        raise UnknownName(kind, name, known.values()) from None


class Condition(NamedTuple):
    """A comparison of a field of a message type with a value."""

    field: str
    compare: Callable[[Any, Any], bool]
    value: Any

    def holds(self, message: Message) -> bool:
        """Return whether the condition holds; unknown values and codes are neither less nor greater."""
        found = getattr(message, self.field)
        # An ordered comparison with None (unknown) would raise.
        is_ordered = self.compare not in (operator.eq, operator.ne)
        is_code = isinstance(found, IntEnum) is not isinstance(self.value, IntEnum)
        return not (is_ordered and (is_code or None in (found, self.value))) and self.compare(found, self.value)


def by_value(text: str, protocol: Protocol) -> Wanted:
    """Return a filter for messages with a field that satisfies `text`: `x>1000`, `Goto XY.speed<=20`.

    Raises LocalError for a text that is not a comparison, UnknownName for a message or field, FieldError for a value.
    """
    match = CONDITION.fullmatch(text)
    if match and match["value"][0] in "<>=!":
        raise LocalError(f"{text!r}: {match['operator'] + match['value'][0]} is none of {', '.join(OPERATORS)}")
    if match and re.search(r"\s(?:and|or|&&|\|\|)\s", match["value"]):
        raise LocalError(f"{text!r}: a filter is one comparison; give several, and an entry has to fit them all")
    if match is None:
        quoted = "" if OPERATORS.keys() & {*text} else "; write it in quotes, as a shell takes > and < for itself"
        raise LocalError(f"{text!r} is not a comparison such as `x>1000` or `MESSAGE.x>1000`{quoted}")
    bindings = [protocol.binding(match["message"].strip())] if match["message"] else protocol.bindings
    having = [each for each in bindings if match["field"] in each.kinds]
    if not having:
        raise UnknownName("field", match["field"], dict.fromkeys(field for each in bindings for field in each.kinds))
    conditions = dict(_conditions(having, match))

    def wanted(meaning: Meaning) -> bool:
        condition = conditions.get(type(meaning.message)) if meaning.message is not None else None
        return condition is not None and meaning.message is not None and condition.holds(meaning.message)

    return wanted


def _conditions(bindings: Iterable[Binding], match: re.Match[str]) -> Iterator[tuple[type[Message], Condition]]:
    """Yield the condition for each message whose field can have the value; raises FieldError if none can."""
    field = match["field"]
    refused = None
    found = False
    for each in bindings:
        kind = each.kinds[field]
        try:
            value = kind.parse(match["value"])
        except (ValueError, LookupError, UnknownName):
            # An error only if no other message accepts it, as fields of one name may differ in kind.
            allowed = kind.allowed(each.limits[field]) if field in each.limits else "the field is not mapped"
            refused = FieldError(each.name, field, match["value"], allowed)
        else:
            found = True
            yield each.type, Condition(field, OPERATORS[match["operator"]], value)
    if refused and not found:
        raise refused


# Time


class Window(NamedTuple):
    """A time window in s; `relative` counts from the first entry of the log."""

    since: float = 0.0
    until: float = float("inf")
    relative: bool = False

    def clock(self) -> Callable[[float], float | None]:
        """Return the function that maps an entry's time to the displayed time, None outside the window."""
        if self == Window():
            return float  # returns the time unchanged, without a call of Python code
        start: list[float] = [] if self.relative else [0.0]

        def shown(time: float) -> float | None:
            if not start:
                start.append(time)
            elapsed = time - start[0]
            return elapsed if self.since <= elapsed <= self.until else None

        return shown


# Senders of identifiers, from the files of the devices; NMT commands and SDO requests have none


OWN_SERVICES = ((EMCY, values.EMCY_BASE), (SDO_ANSWERS, values.SDO_RESPONSE_BASE), (None, values.ERROR_CONTROL_BASE))
"""Services that a device sends: the object with their COB-ID, and the predefined base."""


def senders(dictionaries: Iterable[Dictionary], protocol: Protocol) -> dict[int, frozenset[str]]:
    """Return the names of the devices that send each identifier, without unknown senders."""
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
    """Return a filter for frames by sender: `only` these devices, or all but those `without`.

    Raises UnknownName. A frame without a known sender is wanted unless `only` is given.
    """
    known = {plain_name(each.name): each.name for each in dictionaries}
    wanted, unwanted = ({known_name(name, known, "node") for name in names} for names in (only, without))
    sent_by = senders(dictionaries, protocol)
    nobody = frozenset[str]()

    def wants(frame: Frame) -> bool:
        names = sent_by.get(frame.cob_id, nobody)
        return not wanted.isdisjoint(names) if wanted else not names or not names <= unwanted

    return wants
