"""What tests of seasons share: archived logs, and what a row has to be by `Protocol`."""

from __future__ import annotations

import random
from collections.abc import Iterable
from enum import IntEnum
from pathlib import Path
from typing import Any

import polars as pl

from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import ColumnForm, Kind, OutOfRange, words_of
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.season import season as tables
from eurobot_od.season.archive import Archiver, DecodedNetwork

Timed = tuple[float, Frame]


def write_log(file: Path, frames: Iterable[Timed]) -> Path:
    """Write a candump log."""
    with file.open("w") as log:
        log.writelines(f"({time:.6f}) can0 {frame}\n" for time, frame in frames)
    return file


def archived(log: Path, network: DecodedNetwork) -> Path:
    """Archive a log into a season beside it."""
    season = log.with_suffix(".season")
    Archiver(season, network)(log)
    return season


def table(season: Path, name: str) -> pl.DataFrame:
    """Read a table whole, in the order of the lines; empty if it has no file."""
    files = sorted((season / name).glob("*.parquet"))
    return pl.read_parquet(files).sort("run", "line") if files else pl.DataFrame()


def protocol_of(network: DecodedNetwork) -> Protocol:
    """Return the messages of a network, without PDOs that do not hold."""
    return Protocol.of_devices(network.dictionaries, network.catalogue, lambda _: None)


def assert_equal_to_protocol(season: Path, frames: Iterable[Timed], network: DecodedNetwork) -> None:
    """Compare all message tables with what `Protocol` decodes, row by row and field by field."""
    protocol = protocol_of(network)
    expected: dict[str, list[dict[str, Any]]] = {name: [] for name in protocol.names()}
    for number, (time, frame) in enumerate(frames, 1):
        try:
            message = protocol.decode(*frame)
        except EurobotError:
            continue
        binding = protocol.binding(type(message))
        if len(frame.data) > binding.layout.length and not binding.reads_longer:
            continue
        row = {"line": number, "t": time}
        for field in binding.limits:
            row |= cells(binding, field, getattr(message, field))
        expected[binding.name].append(row)
    for name, file in tables.table_names(protocol.names()).items():
        found = table(season, file)
        wanted = expected[name]
        assert len(found) == len(wanted), name
        if not wanted:
            continue
        for column in wanted[0]:
            values = [row[column] for row in wanted]
            assert (found[column].to_list() if column in found.columns else [None] * len(found)) == values, name


def cells(binding: Binding, field: str, value: Any) -> dict[str, Any]:
    """Return what the columns of a field have to hold for a value that `Protocol` decoded."""
    kind: Kind = binding.kinds[field]
    if isinstance(value, OutOfRange):
        return {field: None, f"{field}_flag": f"out of range: {int(value)}"}
    if value is None:
        return {field: None, f"{field}_flag": "unknown"}
    if isinstance(value, IntEnum) and kind.column_form is not ColumnForm.WORD:  # a code in a field of numbers
        return {field: None, f"{field}_flag": words_of(value)}
    return {field: words_of(value) if isinstance(value, IntEnum) else value, f"{field}_flag": None}


def random_frames(count: int, protocol: Protocol, seed: int = 1) -> list[Timed]:
    """Yield frames with random data, mostly of fitting lengths, for all messages and for unknown identifiers."""
    chance = random.Random(seed)
    bindings = protocol.bindings
    found: list[Timed] = []
    for number in range(count):
        binding = bindings[chance.randrange(len(bindings))]
        length = chance.choice([*binding.lengths] * 6 + [chance.randrange(9)])
        cob_id = binding.cob_id if chance.random() < 0.95 else chance.randrange(0x800)
        data = chance.choice((chance.randbytes(length), _mostly_codes(binding, chance, length)))
        found.append((round(number * 0.000217, 6), Frame(cob_id, data)))
    return found


def _mostly_codes(binding: Binding, chance: random.Random, length: int) -> bytes:
    """Return data whose fields are often at the edges of their ranges, or codes."""
    word = 0
    for field, limits in binding.limits.items():
        kind = binding.kinds[field]
        raws = binding.layout.raws[field]
        codes = [*kind.named_values(), kind.unknown_as_a_whole, limits.low, limits.high, limits.high + 1, raws[-1]]
        word |= binding.layout.place(field, chance.choice([raw for raw in codes if raw is not None]))
    full = word.to_bytes(binding.layout.length, binding.layout.byte_order)
    return full[:length] + bytes(max(length - len(full), 0))
