"""The messages as a DBC file (Vector's CAN database): identifiers, bits, units, limits, value tables, nodes.

Rule of this file: everything comes from the loaded protocol and the kinds of its fields; a field that DBC cannot
express, because its bits are not in one piece in either byte order, is an error.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

from eurobot_od.errors import MappingError
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.layout import Layout, Run
from eurobot_od.pdo.protocol import Protocol

HEAD = """VERSION ""

NS_ :
\tCM_
\tBA_DEF_
\tBA_
\tVAL_
\tBA_DEF_DEF_
\tBO_TX_BU_

BS_:
"""

NOBODY = "Vector__XXX"
"""Stands for a node where DBC wants one and there is none."""

INTEL, MOTOROLA = 1, 0
"""DBC's numbers for the byte orders: least and most significant byte first."""

ATTRIBUTES = (
    'BA_DEF_ "BusType" STRING ;',
    'BA_DEF_ BO_ "Protocol" STRING ;',
    'BA_DEF_DEF_ "BusType" "CAN";',
    'BA_DEF_DEF_ "Protocol" "";',
)
"""Definitions of the attributes, then their defaults: DBC wants them in this order."""


def dbc_text(protocol: Protocol) -> str:
    """Return the DBC file of a protocol; raises MappingError for a field that DBC cannot express."""
    nodes = dict.fromkeys(node for each in protocol.bindings for node in (*each.senders, *each.receivers))
    parts = [
        [HEAD, f"BU_: {' '.join(nodes)}", ""],
        *([*_message(each), ""] for each in protocol.bindings),
        # A message with several senders names all of them once more.
        [f"BO_TX_BU_ {each.cob_id} : {','.join(each.senders)};" for each in protocol.bindings if len(each.senders) > 1],
        [""],
        [*_comments(protocol), ""],
        [*ATTRIBUTES, *(f'BA_ "Protocol" BO_ {each.cob_id} "{each.group}";' for each in protocol.bindings), ""],
        _value_tables(protocol),
    ]
    return "\n".join(line for part in parts for line in part) + "\n"


def identifier(name: str) -> str:
    """Return a name as DBC allows it: letters, digits and underscores."""
    return re.sub(r"\W", "_", name)


def _message(binding: Binding) -> Iterator[str]:
    sender = binding.senders[0] if binding.senders else NOBODY
    yield f"BO_ {binding.cob_id} {identifier(binding.name)}: {binding.layout.length} {sender}"
    for field in binding.layout.fields:
        yield _signal(binding, field)


def _signal(binding: Binding, field: str) -> str:
    layout, limits, unit = binding.layout, binding.limits[field], binding.kinds[field].unit
    runs = layout.runs[field]
    if len(runs) != 1:
        raise MappingError(binding.file, binding.pdo.mapping_index, f"{binding.name}: {field} is in {len(runs)} pieces")
    order, start = _place(layout, runs[0])
    receivers = ",".join(binding.receivers) or NOBODY
    return f' SG_ {field} : {start}|{runs[0].bits}@{order}+ (1,0) [{limits.low}|{limits.high}] "{unit}" {receivers}'


def _place(layout: Layout, run: Run) -> tuple[int, int]:
    """Return byte order and start bit: the lowest bit for Intel, the highest for Motorola, counted byte by byte."""
    if layout.byte_order == "little":
        return INTEL, run.offset
    highest = run.offset + run.bits - 1
    return MOTOROLA, 8 * (layout.length - 1 - highest // 8) + highest % 8


def _comments(protocol: Protocol) -> Iterator[str]:
    for each in protocol.bindings:
        text = " ".join((inspect.getdoc(each.type) or "").split())
        yield f'CM_ BO_ {each.cob_id} "{text}";'
        for field in each.layout.fields:
            yield f'CM_ SG_ {each.cob_id} {field} "{each.kinds[field].allowed(each.limits[field])}";'


def _value_tables(protocol: Protocol) -> Iterator[str]:
    for each in protocol.bindings:
        for field in each.layout.fields:
            if values := each.kinds[field].named_values():
                table = " ".join(f'{raw} "{name}"' for raw, name in sorted(values.items()))
                yield f"VAL_ {each.cob_id} {field} {table} ;"
