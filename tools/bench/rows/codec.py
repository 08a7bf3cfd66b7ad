"""One message decoded and encoded: `protocol.decode` and `protocol.encode` beside cantools, canopen and bitstruct.

Only public functions are measured, with the same message for all. A contender is measured only after its result was
right.
"""

from __future__ import annotations

import timeit
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, partial
from typing import Any, NamedTuple

import canopen
import cantools
from bitstruct import c as bitstruct  # type: ignore[import-untyped]  # it carries no types

from bench.measure import Claim, Contender, Figures, Quantity, Scale, Series, Way, Wrong
from bench.shared import protocol
from eurobot_od.export.dbc import dbc_text
from eurobot_od.od.pdos import RESERVED
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import GotoXY, NaviPositionResponse, StartConfigurationSet
from eurobot_od.robot.model.values import Barriers, Source, TeamColour
from eurobot_od.robot.protocol import EurobotProtocol

GOTO = GotoXY(1234, 567, 89, 75, Barriers(0xA5C3))
POSITION = NaviPositionResponse(1234, 567, 89, Source.INTERNAL)
START = StartConfigurationSet(TeamColour.RED, 2, 1, 45, 33)


class Statement(NamedTuple):
    """An expression as a user would write it, and the values of its names."""

    text: str
    names: Mapping[str, object]

    def result(self) -> object:
        """Return its value."""
        return eval(self.text, {**self.names})

    def timed(self, calls: int) -> Figures:
        """Measure it among many calls, and return the time of one."""
        return {Quantity.TIME: timeit.timeit(self.text, globals={**self.names}, number=calls) / calls}


Statements = Mapping[str, Statement]


@cache
def database() -> Any:
    """Return cantools' database of the same messages."""
    return cantools.database.load_string(dbc_text(protocol()), "dbc")


def raw_values(message: Message) -> dict[str, int]:
    """Return a message's raw values, by field in wire order."""
    return protocol().unpack(*protocol().encode(message))[1]


def checked(texts: Mapping[str, str], names: Mapping[str, object], right: Mapping[str, object]) -> Statements:
    """Return the statements after each that has a known result was run once; raises Wrong if one differs."""
    statements = {name: Statement(text, names) for name, text in texts.items()}
    for name, statement in statements.items():
        result = statement.result()
        if name in right and result != right[name]:
            raise Wrong(f"{name} gives {result!r} instead of {right[name]!r}")
    return statements


# The peers


def variables(message: Message) -> Any:
    """Return canopen's PDO with the mapping of the sender's EDS."""
    binding = protocol().binding(type(message))
    node: Any = canopen.Network().create_node(1, str(dialects.folder() / f"{binding.senders[0]}.eds"))
    node.tpdo.read(from_od=True)
    return next(pdo for pdo in node.tpdo.values() if pdo.cob_id == binding.cob_id)


def bit_format(binding: Binding) -> Any:
    """Return bitstruct's compiled format for a message's bytes in reverse order: its last field comes first."""
    unused = 8 * binding.layout.length - binding.layout.bits
    runs = [("p", unused)] * bool(unused)
    runs += [("u" if slot.field else "p", slot.bits) for slot in reversed(binding.layout.slots)]
    return bitstruct.compile("".join(f"{kind}{bits}" for kind, bits in runs), [*reversed(binding.layout.fields)])


# What is measured


DECODERS = {
    "ours": "protocol.decode(cob_id, data)",
    "decode_message": "database.decode_message(cob_id, data)",
    "decode_simple": "peer.decode_simple(data)",
    "variables": "read(pdo, fields, data)",
    "bitstruct": "bits.unpack(data[::-1])",
}
ENCODERS = {
    "ours": "protocol.encode(message)",
    "encode_message": "database.encode_message(name, values)",
    "strict=False": "database.encode_message(name, values, strict=False)",
    "cheapest": "peer.encode(values, scaling=False, strict=False)",
    "variables": "write(pdo, fields, values)",
    "bitstruct": "bits.pack(values)[::-1]",
}
TASKS = {
    "decode": "protocol.decode(cob_id, data)",
    "encode": "protocol.encode(message)",
    "unpack": "protocol.unpack(cob_id, data)",
    "pack": "protocol.pack(name, **values)",
}


def carrying(pdo: Any) -> list[Any]:
    """Return the variables of canopen's PDO without the reserved bits."""
    return [variable for variable in pdo if not variable.name.endswith(RESERVED)]


def read(pdo: Any, fields: Sequence[Any], data: bytes) -> list[int]:
    """Read the variables of canopen's PDO."""
    pdo.data = bytearray(data)
    return [variable.raw for variable in fields]


def write(pdo: Any, fields: Sequence[Any], values: Mapping[str, int]) -> bytes:
    """Write the variables of canopen's PDO."""
    for variable, value in zip(fields, values.values()):
        variable.raw = value
    return bytes(pdo.data)


def decoders(message: Message) -> Statements:
    """Return the statements that decode a message's frame."""
    (cob_id, data) = protocol().encode(message)
    raw = raw_values(message)
    peer = database().get_message_by_frame_id(cob_id)
    pdo = variables(message)
    names = {
        "protocol": protocol(),
        "cob_id": cob_id,
        "data": data,
        "database": database(),
        "peer": peer,
        "read": read,
        "pdo": pdo,
        "fields": carrying(pdo),
        "bits": bit_format(protocol().binding_of(cob_id)),
    }
    named = {signal.name: (signal.choices or {}).get(raw[signal.name], raw[signal.name]) for signal in peer.signals}
    right = {
        "ours": message,
        "decode_message": named,
        "decode_simple": named,
        "variables": [*raw.values()],
        "bitstruct": raw,
    }
    return checked(DECODERS, names, right)


def encoders(message: Message) -> Statements:
    """Return the statements that encode a message; all but ours start from its raw values."""
    frame = protocol().encode(message)
    pdo = variables(message)
    peer = database().get_message_by_frame_id(frame.cob_id)
    names = {
        "protocol": protocol(),
        "message": message,
        "database": database(),
        "name": peer.name,
        "values": raw_values(message),
        "peer": peer,
        "write": write,
        "pdo": pdo,
        "fields": carrying(pdo),
        "bits": bit_format(protocol().binding_of(frame.cob_id)),
    }
    pdo.data = bytearray(len(frame.data))
    right = dict.fromkeys(ENCODERS, frame.data) | {"ours": frame}
    return checked(ENCODERS, names, right)


def slices(task: str, message: Message) -> Statements:
    """Return a task in each dialect: one dialect has each field in one piece, another splits it into slices."""
    return {name: task_of(EurobotProtocol.load(name), task, message) for name in dialects.names()}


def task_of(protocol: Protocol, task: str, message: Message) -> Statement:
    """Return the statement of a task on a message."""
    cob_id, data = protocol.encode(message)
    name, values = protocol.unpack(cob_id, data)
    names = {"protocol": protocol, "message": message, "cob_id": cob_id, "data": data, "name": name, "values": values}
    return Statement(TASKS[task], names)


# Rows


def opened(make: Callable[[], Statements], scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield the statements as contenders."""
    calls = scale.of(10_000, 10)
    yield {name: partial(statement.timed, calls) for name, statement in make().items()}


def _series(name: str, make: Callable[[], Statements], *claims: Claim, often: float = 3) -> Series:
    return Series("codec", name, contextmanager(partial(opened, make)), claims, often)


def _claim(task: str, peer: str, label: str, wanted: float | None = None) -> Claim:
    return Claim(f"{task}: {label}", "ours", peer, Way.TIMES_AS_FAST, wanted)


def _decode(name: str, message: Message) -> Series:
    task = f"decode {name}"
    return _series(
        task,
        partial(decoders, message),
        _claim(task, "decode_message", "cantools decode_message", 2.8),
        _claim(task, "decode_simple", "cantools decode_simple"),
        _claim(task, "variables", "canopen's PDO variables"),
        _claim(task, "bitstruct", "bitstruct, a dict of integers"),
    )


def _encode(name: str, message: Message) -> Series:
    task = f"encode {name}"
    return _series(
        task,
        partial(encoders, message),
        _claim(task, "encode_message", "cantools encode_message", 9.5),
        _claim(task, "strict=False", "cantools, strict=False"),
        _claim(task, "cheapest", "cantools' cheapest, no scaling either"),
        _claim(task, "variables", "canopen's PDO variables"),
        _claim(task, "bitstruct", "bitstruct, of a dict of integers"),
    )


def _slices(task: str, message: Message) -> Series:
    first, *others = dialects.names()
    name = f"{task} {type(message).__name__}"
    claims = (Claim(f"{name}: {other} against {first}", other, first, Way.RATIO) for other in others)
    return _series(f"{name} in slices", partial(slices, task, message), *claims, often=1)


SERIES = (
    *(make(name, each) for name, each in (("Goto XY", GOTO), ("Position", POSITION)) for make in (_decode, _encode)),
    *(_slices(task, each) for each in (GOTO, START) for task in ("decode", "encode", "unpack", "pack")),
)
