"""Long jobs in blocks, on any `concurrent.futures.Executor`: this process, others on this machine, or dask's workers.

An item is the argument of one call, such as the seed of a match. Items are sent in blocks, and results come back in the
order of the items. They may be kept in Parquet files, one per block, from which a campaign is resumed (`results`).
There is no scheduler here.

The result of an item depends only on the item. So the block of a lost worker is repeated, and the results are the same
on any executor. Existing results are read, not computed again.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from eurobot_od.errors import LocalError
from eurobot_od.season import MOST_JOBS

if TYPE_CHECKING:
    from eurobot_od.season.results import Results

DASK = "dask://"

RETRIES = 3
"""How often dask sends a block to another worker after one was lost."""

CONNECT_WAIT = "10s"

BLOCK = 100
"""Number of items of a block for remote workers: losing one costs little, and sending it next to nothing."""


class Workers(NamedTuple):
    """Number of parallel calls, and their executor; None: in this process, one after the other.

    `block` is the maximum number of items that are sent together.
    """

    number: int = 1
    executor: Executor | None = None
    block: int = 1


HERE = Workers()


def cores() -> int:
    """Return the number of cores that this process may use, at most MOST_JOBS."""
    found = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(found, MOST_JOBS)


class Processes(ProcessPoolExecutor):
    """Processes of this machine; the end of the `with` block kills them, whatever they are doing.

    They are spawned, not forked, as threads of other packages do not survive a fork. Standard-library workers wait
    forever if their parent is killed, and finish work that was cancelled. So each of ours has a thread that waits for
    either, and ends the process.
    """

    def __init__(self, number: int) -> None:
        context = get_context("spawn")
        self._end, self._end_here = context.Pipe(duplex=False)
        super().__init__(number, context, _begin, (self._end,))

    def __exit__(self, *_: object) -> bool | None:
        self._end_here.send_bytes(b"end")  # it stays in the pipe, so that all processes read it
        self.shutdown(wait=True, cancel_futures=True)
        self._end_here.close()
        self._end.close()
        return None


def _begin(end: Connection) -> None:
    """Set up a new process: it ignores Ctrl-C, which the parent handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The sentinel becomes readable however the parent dies; after SIGKILL it cannot write into the pipe.
    parent = parent_process()
    awaited: list[Any] = [end] if parent is None else [end, parent.sentinel]
    # `_exit` does not wait for cancelled work. It is looked up now, as a match replaces it so that a strategy cannot
    # end the process.
    exit_now = os._exit

    def end_process() -> None:
        wait(awaited)
        exit_now(0)

    threading.Thread(target=end_process, daemon=True).start()


@contextmanager
def local(number: int) -> Iterator[Workers]:
    """Yield a number of processes of this machine, which end with the `with` block; one is this process itself."""
    # A single process would be no faster than this one.
    if number == 1:
        yield HERE
        return
    with Processes(number) as executor:
        yield Workers(number, executor)


@contextmanager
def dask(address: str) -> Iterator[Workers]:
    """Yield the workers of a dask scheduler, `HOST:PORT`; unfinished work is cancelled at the end.

    Raises LocalError if no scheduler answers, if it has no worker, or one with several threads, which would share
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
        # Not pure: otherwise dask would run equal calls once only.
        executor = client.get_executor(pure=False, retries=RETRIES)  # type: ignore[no-untyped-call]
        try:
            yield Workers(len(threads), executor, BLOCK)
        finally:
            # Running blocks are cancelled.
            executor.shutdown(wait=False)


def workers(text: str | None, jobs: int | None, most: int) -> AbstractContextManager[Workers]:
    """Return the workers: those of `dask://HOST:PORT`, otherwise `jobs` processes, at most `most`.

    The default is one process per core.
    """
    if text is None:
        return local(min(jobs or cores(), most))
    if not text.startswith(DASK):
        raise LocalError(f"{text!r} is not an executor: {DASK}HOST:PORT, or --jobs for processes of this machine")
    return dask(text.removeprefix(DASK))


# Items are sent in blocks; results that come early are kept until it is their turn


ROUNDS = 8
"""Number of blocks per worker, if there are enough items, so that the wait for the last block is short."""

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def run(
    do: Callable[[ItemT], ResultT], items: Sequence[ItemT], workers: Workers, results: Results[ResultT] | None = None
) -> Generator[ResultT, None, None]:
    """Yield the result of `do` for each item, in order; `do` and everything it needs is sent to the workers.

    An item's text is its name. Raises ValueError for two items of one name before the first is done, ChildProcessError
    if a process of this machine dies, and everything that `do` raises.
    """
    named = Counter(map(str, items))
    if doubled := [name for name, number in named.items() if number > 1]:
        raise ValueError(f"{named[doubled[0]]} items are called {doubled[0]!r}")
    done = {} if results is None else results.known(items)
    left = [item for item in items if str(item) not in done]
    # From the items that are left, so that a campaign resumed near its end keeps all workers busy.
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
    """Return the number of items per block; with kept results it is larger, as each block is a file."""
    return max(1, min(BLOCK if kept else workers.block, items // (workers.number * ROUNDS)))


def _done(
    do: Callable[[ItemT], ResultT], blocks: Sequence[Sequence[ItemT]], workers: Workers
) -> Generator[tuple[Sequence[ItemT], list[ResultT]], None, None]:
    """Yield each block with its results when it is done."""
    if workers.executor is None:
        yield from ((block, _do_block(do, block)) for block in blocks)
        return
    # All at once, so that every worker stays busy; blocks are written in the order in which they are done.
    futures = {workers.executor.submit(_do_block, do, block): block for block in blocks}
    try:
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    except BrokenExecutor:
        raise ChildProcessError("a process that did a part of the work has died") from None


def _do_block(do: Callable[[ItemT], ResultT], block: Sequence[ItemT]) -> list[ResultT]:
    return list(map(do, block))  # a module-level function, as it is pickled for other processes
