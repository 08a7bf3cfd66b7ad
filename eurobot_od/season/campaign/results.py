"""The results of a campaign on the disk: a folder with a Parquet file for each block, written as blocks are done.

Rule of this file: a file is there whole or not at all; a folder holds the results of one campaign, with settings that
are written down in it, and of no other.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.errors import LocalError
from eurobot_od.season.campaign import records
from eurobot_od.support.files import write_whole

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
        self._schema = pa.schema([(ITEM, pa.string()), *records.schema(record)])
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
        rows = (row for file in sorted(self._folder.glob("*.parquet")) for row in pq.read_table(file).to_pylist())
        return {row[ITEM]: records.record_of(self._record, row) for row in rows if row[ITEM] in wanted}

    def write(self, items: Sequence[object], results: Sequence[ResultT]) -> None:
        """Add the results of a block of items."""
        rows = [{ITEM: str(item)} | records.row(result) for item, result in zip(items, results)]
        sink = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist(rows, self._schema), sink, compression="zstd")
        # Named after its items: a block done again because its worker was lost replaces its own file.
        name = hashlib.blake2b("\n".join(map(str, items)).encode(), digest_size=8).hexdigest()
        write_whole(self._folder / f"{name}.parquet", sink.getvalue().to_pybytes())
