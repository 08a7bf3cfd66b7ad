"""Results as rows of Parquet and back: named tuples and data classes, by the types of their fields.

Rule of this file: what comes back is equal to what was written. Numbers, texts, bytes, paths, enums, lists, tuples,
mappings from texts, values that may be None, and records of all these are all that a record may have.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Iterable, Mapping
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import pyarrow as pa

SIMPLE: Mapping[object, pa.DataType] = {
    int: pa.int64(),
    float: pa.float64(),
    str: pa.string(),
    bool: pa.bool_(),
    bytes: pa.binary(),
    Path: pa.string(),
}


@cache
def fields(record: Any) -> dict[str, Any]:
    """Return the types of a record's fields by name."""
    hints = get_type_hints(record)
    if dataclasses.is_dataclass(record):
        return {each.name: hints[each.name] for each in dataclasses.fields(record)}
    names: Iterable[str] = record._fields  # a named tuple's
    return {name: hints[name] for name in names}


def schema(record: type) -> pa.Schema:
    """Return the columns of a record."""
    return pa.schema([(name, _column(hint)) for name, hint in fields(record).items()])


def row(record: Any) -> dict[str, Any]:
    """Return a record as a row."""
    return {name: _plain(getattr(record, name), hint) for name, hint in fields(type(record)).items()}  # type: ignore[arg-type]


def record_of(record: type, row: Mapping[str, Any]) -> Any:
    """Return the record that a row was made of."""
    return record(**{name: _made(row[name], hint) for name, hint in fields(record).items()})


def _optional(hint: Any) -> Any:
    """Return the type of what may be None, or the type itself."""
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (each for each in get_args(hint) if each is not type(None))
    return hint


def _column(hint: Any) -> pa.DataType:
    hint = _optional(hint)
    if hint in SIMPLE:
        return SIMPLE[hint]
    if get_origin(hint) in (list, tuple):
        return pa.list_(_column(get_args(hint)[0]))
    if get_origin(hint) is dict:
        return pa.map_(pa.string(), _column(get_args(hint)[1]))
    if issubclass(hint, Enum):
        return pa.string()
    return pa.struct([(name, _column(each)) for name, each in fields(hint).items()])


def _plain(value: Any, hint: Any) -> Any:
    hint = _optional(hint)
    if value is None or (hint in SIMPLE and hint is not Path):
        return value
    if get_origin(hint) in (list, tuple):
        return [_plain(each, get_args(hint)[0]) for each in value]
    if get_origin(hint) is dict:
        return [(key, _plain(each, get_args(hint)[1])) for key, each in value.items()]
    if hint is Path:
        return str(value)
    return value.name if issubclass(hint, Enum) else row(value)


def _made(value: Any, hint: Any) -> Any:
    hint = _optional(hint)
    if value is None or (hint in SIMPLE and hint is not Path):
        return value
    origin = get_origin(hint)
    if origin in (list, tuple):
        return origin(_made(each, get_args(hint)[0]) for each in value)
    if origin is dict:
        return {key: _made(each, get_args(hint)[1]) for key, each in value}
    if hint is Path:
        return Path(value)
    return hint[value] if issubclass(hint, Enum) else record_of(hint, value)
