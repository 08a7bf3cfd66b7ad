"""Long jobs in blocks, on any `concurrent.futures.Executor`: this process, others on this machine, or dask's workers.

An item is what one call does, such as the match of a seed. Items go out in blocks, and results come back in the items'
order. They may be kept in Parquet files, one for each block, from which a campaign is resumed (end of this file).
There is no scheduler here.

Rule of this file: an item's result depends only on the item. So a block whose worker was lost is repeated, and the
results are the same on any executor. Nothing is done twice: results that are already there are read.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import signal
import threading
import types
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from enum import Enum
from functools import cache
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.errors import LocalError
from eurobot_od.season import MOST_JOBS
from eurobot_od.support.files import write_whole

DASK = "dask://"

RETRIES = 3
"""How often dask gives a block to another worker when one was lost."""

CONNECT_WAIT = "10s"

BLOCK = 100
"""Items of a block for workers elsewhere: losing one costs little, and handing it over next to nothing."""


class Workers(NamedTuple):
    """How many things are done at once, and by which executor; None: in this process, one after the other.

    `block` is how many items are handed over at once at most.
    """

    number: int = 1
    executor: Executor | None = None
    block: int = 1


HERE = Workers()


def cores() -> int:
    """Return how many cores this process may use, MOST_JOBS at most."""
    found = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(found, MOST_JOBS)


class Processes(ProcessPoolExecutor):
    """Processes of this machine; at the end of the `with` block they end at once, whatever they are doing.

    They are started anew, not forked: threads of other packages do not survive a fork. The standard library's wait for
    work for ever when their parent was killed, and finish started work even when it is no longer wanted. So each
    of ours has a thread that waits for either, and ends the process.
    """

    def __init__(self, number: int) -> None:
        context = get_context("spawn")
        self._end, self._end_here = context.Pipe(duplex=False)
        super().__init__(number, context, _begin, (self._end,))

    def __exit__(self, *_: object) -> bool | None:
        self._end_here.send_bytes(b"end")  # it stays in the pipe, so that all processes see it
        self.shutdown(wait=True, cancel_futures=True)
        self._end_here.close()
        self._end.close()
        return None


def _begin(end: Connection) -> None:
    """Set a new process up: Ctrl-C, which reaches all processes, is the parent's to act on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Its sentinel becomes readable however the parent dies; SIGKILL leaves it no time to write into the pipe.
    parent = parent_process()
    awaited: list[Any] = [end] if parent is None else [end, parent.sentinel]

    def end_process() -> None:
        wait(awaited)
        os._exit(0)  # without a clean-up of the interpreter, which would wait for work that is no longer wanted

    threading.Thread(target=end_process, daemon=True).start()


@contextmanager
def local(number: int) -> Iterator[Workers]:
    """Give a number of processes of this machine; one is this process itself. They end with the `with` block."""
    # A single process would do the work no sooner than this one, and cost its start.
    if number == 1:
        yield HERE
        return
    with Processes(number) as executor:
        yield Workers(number, executor)


@contextmanager
def dask(address: str) -> Iterator[Workers]:
    """Give the workers of a dask scheduler, `HOST:PORT`; work that is not done at the end is given up.

    Raises LocalError if nobody answers there, without a worker, and for a worker with several threads: they would share
    `sys.stdout`. Raises ModuleNotFoundError without dask.
    """
    from distributed import Client

    try:
        client = Client(  # type: ignore[no-untyped-call]
            f"tcp://{address}", timeout=CONNECT_WAIT, set_as_default=False
        )
    except (OSError, ValueError) as error:
        raise LocalError(f"{DASK}{address}: no dask scheduler answers: {str(error).splitlines()[0]}") from None
    with client:
        threads = client.nthreads()  # type: ignore[no-untyped-call]
        if not threads:
            raise LocalError(f"{DASK}{address}: no worker yet; start some: dask worker --nthreads 1 {address}")
        several = [worker for worker, number in threads.items() if number > 1]
        if several:
            what = f"{several[0]} has {threads[several[0]]} threads; start it with --nthreads 1"
            raise LocalError(f"{DASK}{address}: {what}")
        # Not pure: otherwise dask would answer equal calls with one result, and not run the second.
        executor = client.get_executor(pure=False, retries=RETRIES)  # type: ignore[no-untyped-call]
        try:
            yield Workers(len(threads), executor, BLOCK)
        finally:
            # Blocks that are still running are given up: nothing will take their results any more.
            executor.shutdown(wait=False)


def workers(text: str | None, jobs: int | None, most: int) -> AbstractContextManager[Workers]:
    """Give what `dask://HOST:PORT` names, or else `jobs` processes, one a core, but not more than there is to do."""
    if text is None:
        return local(min(jobs or cores(), most))
    if not text.startswith(DASK):
        raise LocalError(f"{text!r} is not an executor: {DASK}HOST:PORT, or --jobs for processes of this machine")
    return dask(text.removeprefix(DASK))


# Items out in blocks, results back in their order: only those that come before their turn are held back


ROUNDS = 8
"""Blocks for each worker, if there are enough items: so the wait for the last block is short."""

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def run(
    do: Callable[[ItemT], ResultT],
    items: Sequence[ItemT],
    workers: Workers,
    results: Results[ResultT] | None = None,
) -> Generator[ResultT, None, None]:
    """Yield what `do` makes of each item, in their order; `do` and everything it needs is sent to the workers.

    Raises ChildProcessError if a process of this machine dies, and whatever `do` raises.
    """
    done = {} if results is None else results.known(items)
    left = [item for item in items if str(item) not in done]
    # By what is left, not by all items: a campaign resumed near its end still keeps all workers busy.
    size = block_size(len(left), workers, results is not None)
    blocks = [left[begin : begin + size] for begin in range(0, len(left), size)]
    turns = deque(map(str, items))
    for block, found in _done(do, blocks, workers):
        if results is not None:
            results.write(block, found)
        done.update(zip(map(str, block), found))
        while turns and turns[0] in done:
            yield done.pop(turns.popleft())
    yield from map(done.pop, turns)


def block_size(items: int, workers: Workers, kept: bool) -> int:
    """Return how many items a block has; results that are kept come in larger blocks, as each block is a file."""
    return max(1, min(BLOCK if kept else workers.block, items // (workers.number * ROUNDS)))


def _done(
    do: Callable[[ItemT], ResultT], blocks: Sequence[Sequence[ItemT]], workers: Workers
) -> Generator[tuple[Sequence[ItemT], list[ResultT]], None, None]:
    """Yield each block with its results as it is done."""
    if workers.executor is None:
        yield from ((block, _do_block(do, block)) for block in blocks)
        return
    # All at once: the executor keeps every worker busy, and blocks are written in whatever order they are done.
    futures = {workers.executor.submit(_do_block, do, block): block for block in blocks}
    try:
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    except BrokenExecutor:
        raise ChildProcessError("a process that did a part of the work has died") from None


def _do_block(do: Callable[[ItemT], ResultT], block: Sequence[ItemT]) -> list[ResultT]:
    return list(map(do, block))  # a function of the module, as it is sent to other processes


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


SETTINGS = "campaign.json"
ITEM = "item"
"""The column that says which item a row is the result of."""


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
        rows = (row for file in sorted(self._folder.glob("*.parquet")) for row in pq.read_table(file).to_pylist())
        return {row[ITEM]: record_of(self._record, row) for row in rows if row[ITEM] in wanted}

    def write(self, items: Sequence[object], results: Sequence[ResultT]) -> None:
        """Add the results of a block of items."""
        rows = [{ITEM: str(item)} | row(result) for item, result in zip(items, results)]
        sink = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist(rows, self._schema), sink, compression="zstd")
        # Named after its items: a block done again because its worker was lost replaces its own file.
        name = hashlib.blake2b("\n".join(map(str, items)).encode(), digest_size=8).hexdigest()
        write_whole(self._folder / f"{name}.parquet", sink.getvalue().to_pybytes())
