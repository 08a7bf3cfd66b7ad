"""The results of a campaign on the disk: a folder with a Parquet file for each block, written as blocks are done.

Rule of this file: a file is written completely or not at all; a folder holds the results of one campaign, with the
settings that are written in it.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import types
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.errors import LocalError
from eurobot_od.support.files import write_whole
from eurobot_od.support.texts import encodable

# Results as rows of Parquet and back: named tuples and data classes, by the types of their fields. What comes back is
# equal to what was written. Numbers, texts, bytes, paths, enums, lists, tuples, mappings from texts, values that may be
# None, and records of all these are all that a record may have.


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
    if value is not None and hint in (str, Path):
        return encodable(str(value))
    if value is None or hint in SIMPLE:
        return value
    if get_origin(hint) in (list, tuple):
        return [_plain(each, get_args(hint)[0]) for each in value]
    if get_origin(hint) is dict:
        return [(key, _plain(each, get_args(hint)[1])) for key, each in value.items()]
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


def verified(file: Path, schema: pa.Schema) -> pa.Table | None:
    """Return a Parquet file's rows, the checksums of its pages verified; None for a damaged one, and for no file."""
    try:
        if not file.is_file():  # to open a pipe would wait for whoever writes into it
            return None
        table = pq.read_table(file, page_checksum_verification=True)
    except (OSError, ValueError, pa.ArrowException):
        return None
    return table if table.schema.equals(schema) else None


SETTINGS = "campaign.json"
ITEM = "item"
"""The column that says which item a row is the result of."""

ResultT = TypeVar("ResultT")


class Results(Generic[ResultT]):
    """The results in a folder, records of one type; `settings` are all that they depend on besides the item.

    Without `resume` the folder has to be new. Raises LocalError if it is not, or holds another campaign.
    """

    def __init__(self, folder: Path, record: type[ResultT], settings: Mapping[str, Any], resume: bool) -> None:
        self._folder, self._record = folder, record
        self._schema = pa.schema([(ITEM, pa.string()), *schema(record)])
        text = json.dumps(settings, indent=1, sort_keys=True) + "\n"
        said = folder / SETTINGS
        if not said.is_file():
            if folder.is_dir() and any(folder.iterdir()):
                raise LocalError(f"{folder} is not empty, and holds no campaign")
            folder.mkdir(parents=True, exist_ok=True)
            write_whole(said, text.encode())
        elif not resume:
            raise LocalError(f"{folder} holds a campaign already: --resume goes on with it")
        elif (before := said.read_text(encoding="utf-8")) != text:
            # The first difference is enough to see which campaign it is.
            was, is_ = json.loads(before), json.loads(text)
            name = next(key for key in sorted({*was, *is_}) if was.get(key) != is_.get(key))
            what = f"{name} was {was.get(name)!r}, and is {is_.get(name)!r}"
            raise LocalError(f"{folder} holds a campaign with other settings: {what}")

    def known(self, items: Iterable[object]) -> dict[str, ResultT]:
        """Return the results that are there of some items, by the items as text."""
        # The folder may hold items of an earlier, longer range of seeds; those are left alone.
        wanted = set(map(str, items))
        # A damaged file is left out: its block is done again, and takes its place.
        whole = (verified(file, self._schema) for file in sorted(self._folder.glob("*.parquet")))
        rows = (row for table in whole if table is not None for row in table.to_pylist())
        return {row[ITEM]: record_of(self._record, row) for row in rows if row[ITEM] in wanted}

    def write(self, items: Sequence[object], results: Sequence[ResultT]) -> None:
        """Add the results of a block of items."""
        rows = [{ITEM: str(item)} | row(result) for item, result in zip(items, results)]
        sink = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist(rows, self._schema), sink, compression="zstd", write_page_checksum=True)
        # Named after its items: a block done again because its worker was lost replaces its own file.
        name = hashlib.blake2b("\n".join(map(str, items)).encode(), digest_size=8).hexdigest()
        write_whole(self._folder / f"{name}.parquet", sink.getvalue().to_pybytes())
