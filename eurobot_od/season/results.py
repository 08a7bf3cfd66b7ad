"""The results of a campaign on disk: a folder with one Parquet file per block.

A file is written completely or not at all. A folder holds the results of one campaign, with its settings.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from enum import Enum
from functools import cache, partial
from operator import attrgetter
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.errors import LocalError
from eurobot_od.season import pages
from eurobot_od.support.files import UNREADABLE, write_whole
from eurobot_od.support.texts import encodable

# Records to rows of Parquet and back: named tuples and data classes, by the types of their fields, without loss. A
# field may be a number, text, bytes, path, enum, list, tuple, mapping from texts, optional value, or record of these.


class Form(NamedTuple):
    """How values of a type are stored: the column's type, and the conversions to and from it."""

    column: pa.DataType
    plain: Callable[[Any], Any] = lambda value: value
    made: Callable[[Any], Any] = lambda value: value


SIMPLE: Mapping[object, Form] = {
    int: Form(pa.int64()),
    float: Form(pa.float64()),
    str: Form(pa.string(), encodable),
    bool: Form(pa.bool_()),
    bytes: Form(pa.binary()),
    Path: Form(pa.string(), lambda value: encodable(str(value)), Path),
}


@cache
def form_of(hint: Any) -> Form:
    """Return the form of a type; for an optional type, that of the type with None."""
    origin = get_origin(hint)
    arguments = get_args(hint)
    if origin in (Union, types.UnionType):
        (hint,) = (each for each in arguments if each is not type(None))
        form = form_of(hint)
        return form._replace(plain=_unless_none(form.plain), made=_unless_none(form.made))
    if hint in SIMPLE:
        return SIMPLE[hint]
    if origin in (list, tuple):
        item = form_of(arguments[0])
        return Form(
            pa.list_(item.column),
            lambda value: list(map(item.plain, value)),
            lambda value: origin(map(item.made, value)),
        )
    if origin is dict:
        item = form_of(arguments[1])
        return Form(
            pa.map_(pa.string(), item.column),
            lambda value: [(key, item.plain(each)) for key, each in value.items()],
            lambda value: {key: item.made(each) for key, each in value},
        )
    if issubclass(hint, Enum):
        return Form(pa.string(), attrgetter("name"), hint.__getitem__)
    return Form(pa.struct(list(schema(hint))), row, partial(record_of, hint))


def _unless_none(convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: None if value is None else convert(value)


@cache
def fields(record: Any) -> dict[str, Form]:
    """Return the forms of a record's fields, by name."""
    hints = get_type_hints(record)
    names = [each.name for each in dataclasses.fields(record)] if dataclasses.is_dataclass(record) else record._fields
    return {name: form_of(hints[name]) for name in names}


def schema(record: type) -> pa.Schema:
    """Return the columns of a record."""
    return pa.schema([(name, form.column) for name, form in fields(record).items()])


def row(record: Any) -> dict[str, Any]:
    """Return a record as a row."""
    return {name: form.plain(getattr(record, name)) for name, form in fields(type(record)).items()}  # type: ignore[arg-type]


def record_of(record: type, row: Mapping[str, Any]) -> Any:
    """Return the record of a row."""
    return record(**{name: form.made(row[name]) for name, form in fields(record).items()})


MOST_ROWS, MOST_BYTES, AT_ONCE = 1_000_000, 32 << 20, 4 << 20
"""Maximum rows of a file, bytes of all its rows, and bytes of a batch; a small file can hold billions of equal rows."""


def verified(file: Path, schema: pa.Schema | None = None) -> pa.Table | None:
    """Return a Parquet file's rows, with the checksums of its pages verified; None if it is damaged or missing.

    Also None for a file with another `schema`, and for one that is too large.
    """
    try:
        if not file.is_file():  # opening a pipe would wait for its writer
            return None
        # Not `read_table`, whose imports take longer than reading a file.
        with pq.ParquetFile(file, page_checksum_verification=True) as opened:
            table = _read(file, opened)
    except (OSError, *UNREADABLE, pa.ArrowException):
        return None
    return table if table is None or schema is None or table.schema.equals(schema) else None


def _read(file: Path, opened: pq.ParquetFile) -> pa.Table | None:
    """Return the rows of a file; None if they are too many or too large."""
    footer = opened.metadata
    if footer.num_rows > MOST_ROWS:
        return None
    sizes = pages.unpacked(file, footer)
    if sum(sizes) > MOST_BYTES:
        return None
    batches = list[pa.RecordBatch]()
    size = 0
    for batch in opened.iter_batches(min(max(AT_ONCE // max([1, *sizes]), 1), MOST_ROWS)):
        size += batch.nbytes
        if size > MOST_BYTES:
            return None
        batches.append(batch)
    return pa.Table.from_batches(batches, opened.schema_arrow)


def _settings(file: Path, text: str) -> dict[str, Any]:
    """Return the settings of a campaign; raises LocalError if the file has none."""
    with suppress(*UNREADABLE):
        found = json.loads(text)
        if isinstance(found, dict):
            return found
    raise LocalError(f"{file}: these are not the settings of a campaign")


SETTINGS = "campaign.json"
ITEM = "item"
"""Name of the column of items."""

ResultT = TypeVar("ResultT")


class Results(Generic[ResultT]):
    """The results in a folder, records of one type; `settings` are everything they depend on besides the item.

    Raises LocalError if the folder holds another campaign, or is not new without `resume`.
    """

    def __init__(self, folder: Path, record: type[ResultT], settings: Mapping[str, Any], resume: bool) -> None:
        self._folder = folder
        self._record = record
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
            # The error names the first difference.
            was = _settings(said, before)
            is_ = json.loads(text)
            name = next(key for key in sorted({*was, *is_}) if was.get(key) != is_.get(key))
            what = f"{name} was {was.get(name)!r}, and is {is_.get(name)!r}"
            raise LocalError(f"{folder} holds a campaign with other settings: {what}")

    def known(self, items: Iterable[object]) -> dict[str, ResultT]:
        """Return the results of these items that exist, by the items as text."""
        # The folder may hold items of an earlier, longer range of seeds.
        wanted = set(map(str, items))
        # Damaged files are ignored: their blocks are done again, and replace them.
        whole = (verified(file, self._schema) for file in sorted(self._folder.glob("*.parquet")))
        rows = (row for table in whole if table is not None for row in table.to_pylist())
        return {row[ITEM]: record_of(self._record, row) for row in rows if row[ITEM] in wanted}

    def write(self, items: Sequence[object], results: Sequence[ResultT]) -> None:
        """Add the results of a block of items."""
        rows = [{ITEM: str(item)} | row(result) for item, result in zip(items, results)]
        sink = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist(rows, self._schema), sink, compression="zstd", write_page_checksum=True)
        # The name is a hash of the items, so a repeated block replaces its file.
        name = hashlib.blake2b("\n".join(map(str, items)).encode(), digest_size=8).hexdigest()
        write_whole(self._folder / f"{name}.parquet", sink.getvalue().to_pybytes())
