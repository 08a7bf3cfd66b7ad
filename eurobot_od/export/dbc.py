"""The messages as a DBC file (Vector's CAN database): identifiers, bits, units, limits, value tables, nodes.

No multiplexing is invented: a field whose bits are not contiguous in either byte order is an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from eurobot_od.errors import MappingError
from eurobot_od.export.description import DescribedField, DescribedMessage, Identifiers, Numeral, described, printable
from eurobot_od.od.units import digits
from eurobot_od.pdo.protocol import Protocol

HEAD = """VERSION ""

NS_ :
\tCM_
\tBA_DEF_
\tBA_
\tVAL_
\tBA_DEF_DEF_
\tBO_TX_BU_
\tSIG_VALTYPE_

BS_:
"""

NOBODY = "Vector__XXX"
"""DBC's node for none."""

INTEL, MOTOROLA = 1, 0
"""DBC's numbers for the byte orders: least and most significant byte first."""

VALUE_TYPES = {32: 1, 64: 2}
"""DBC's numbers for REALs, by their bits."""

SIGNS = {Numeral.UNSIGNED: "+", Numeral.SIGNED: "-", Numeral.REAL: "-"}

RESERVED = """version ns_ bs_ bu_ bo_ sg_ ev_ cm_ val_ val_table_ ba_ ba_def_ ba_def_def_ ba_def_rel_ ba_rel_ bo_tx_bu_
 sig_valtype_ sgtype_ sig_group_ envvar_data_ cat_def_ cat_ filter int hex float string enum vector__xxx"""
"""The keywords of the format."""

ATTRIBUTES = ('BA_DEF_ "BusType" STRING ;', 'BA_DEF_DEF_ "BusType" "CAN";')
"""Definition of the attribute, then its default, in DBC's order."""


class DbcMessage(NamedTuple):
    """A message with the identifiers of message, nodes and fields; `signals` are the fields by identifier."""

    name: str
    message: DescribedMessage
    senders: Sequence[str]
    receivers: Sequence[str]
    signals: Mapping[str, DescribedField]

    def lines(self) -> Iterator[str]:
        """Yield the message and its signals."""
        # DBC sets bit 31 only for 29-bit identifiers.
        yield f"BO_ {self.message.cob_id} {self.name}: {self.message.length} {next(iter(self.senders), NOBODY)}"
        receivers = ",".join(self.receivers) or NOBODY
        for name, field in self.signals.items():
            order, start = _place(self.message, field)
            scale = field.scale
            ends = (0, 0) if field.numeral is Numeral.REAL else map(scale.physical, field.limits)
            low, high = map(digits, sorted(ends))  # equal ends mean no limits
            bits = f"{start}|{field.width}@{order}{SIGNS[field.numeral]}"
            factor = f"({digits(scale.factor)},{digits(scale.offset)})"
            yield f" SG_ {name} : {bits} {factor} [{low}|{high}] {_quoted(scale.unit)} {receivers}"


def dbc_text(protocol: Protocol) -> str:
    """Return the DBC file of a protocol; raises MappingError for a field that DBC cannot express, LocalError."""
    return text_of(described(protocol))


def text_of(messages: Iterable[DescribedMessage]) -> str:
    """Return the DBC file of messages; raises MappingError."""
    nodes: dict[str, str] = {}
    entries = list(_named(messages, nodes))
    signals = [(each.message.cob_id, name, field) for each in entries for name, field in each.signals.items()]
    parts = [  # in the order of DBC's grammar
        [HEAD, f"BU_: {' '.join(nodes.values())}", ""],
        *([*each.lines(), ""] for each in entries),
        # All senders of a message with several.
        [f"BO_TX_BU_ {each.message.cob_id} : {','.join(each.senders)};" for each in entries if len(each.senders) > 1],
        [""],
        [*_comments(entries), ""],
        [*ATTRIBUTES, ""],
        [
            f"VAL_ {id_} {name} {' '.join(f'{raw} {_quoted(text)}' for raw, text in field.named.items())} ;"
            for id_, name, field in signals
            if field.named
        ],
        # Otherwise the bits of a REAL are read as an integer.
        [
            f"SIG_VALTYPE_ {id_} {name} : {VALUE_TYPES[field.width]};"
            for id_, name, field in signals
            if field.numeral is Numeral.REAL
        ],
    ]
    return "\n".join(line for part in parts for line in part) + "\n"


def _named(messages: Iterable[DescribedMessage], nodes: dict[str, str]) -> Iterator[DbcMessage]:
    """Yield the messages with their identifiers; `nodes` is filled with those of the nodes, by name."""
    of_nodes, of_messages = Identifiers(RESERVED), Identifiers(RESERVED)
    for each in messages:
        for node in (*each.senders, *each.receivers):
            if node not in nodes:
                nodes[node] = of_nodes.new(node)
        of_signals = Identifiers(RESERVED)
        yield DbcMessage(
            of_messages.new(each.name),
            each,
            [nodes[node] for node in each.senders],
            [nodes[node] for node in each.receivers],
            {of_signals.new(field.name): field for field in each.fields},
        )


def _comments(entries: Iterable[DbcMessage]) -> Iterator[str]:
    """Yield comments with the real names of messages and objects, and the allowed values."""
    for each in entries:
        id_ = each.message.cob_id
        said = {f"BO_ {id_}": ": ".join(filter(None, (each.message.name, each.message.text)))}
        for name, field in each.signals.items():
            said[f"SG_ {id_} {name}"] = "; ".join(filter(None, (", ".join(field.objects), field.allowed)))
        yield from (f"CM_ {of} {_quoted(text)};" for of, text in said.items() if text)


def _quoted(text: str) -> str:
    """Return a quoted text; double quotes become single ones, because not every reader knows backslashes."""
    return '"' + printable(text).replace("\\", "/").replace('"', "'") + '"'


def _place(message: DescribedMessage, field: DescribedField) -> tuple[int, int]:
    """Return byte order and start bit: the lowest bit for Intel, the highest for Motorola."""
    places = list(field.places)
    if places == list(range(places[0], places[0] + field.width)):
        return INTEL, places[0]
    # With bytes in reverse order, the bits of a big-endian value are consecutive.
    turned = [place % 8 - place // 8 * 8 for place in places]
    if turned == list(range(turned[0], turned[0] + field.width)):
        return MOTOROLA, places[-1]
    what = f"{message.name}: {field.name} is not contiguous, which DBC cannot express"
    raise MappingError(message.file, message.mapping_index, what)
