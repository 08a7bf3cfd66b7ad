"""Long jobs in blocks, on any `concurrent.futures.Executor`: this process, others on this machine, or dask's workers.

An item is what one call does, such as the match of a seed. Items go out in blocks, and results come back in the items'
order. They may be kept in Parquet files, one for each block, from which a campaign is resumed (end of this file).
There is no scheduler here.

Rule of this file: an item's result depends only on the item. So a block whose worker was lost is repeated, and the
results are the same on any executor. Nothing is done twice: results that are already there are read.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
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
    # Without a clean-up of the interpreter, which would wait for work that is no longer wanted. Looked up now: a match
    # that is being played replaces it, so that its strategy cannot end the process.
    exit_now = os._exit

    def end_process() -> None:
        wait(awaited)
        exit_now(0)

    threading.Thread(target=end_process, daemon=True).start()


@contextmanager
def local(number: int) -> Iterator[Workers]:
    """Yield a number of processes of this machine; one is this process itself. They end with the `with` block."""
    # A single process would do the work no sooner than this one, and cost its start.
    if number == 1:
        yield HERE
        return
    with Processes(number) as executor:
        yield Workers(number, executor)


@contextmanager
def dask(address: str) -> Iterator[Workers]:
    """Yield the workers of a dask scheduler, `HOST:PORT`; work that is not done at the end is given up.

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
    do: Callable[[ItemT], ResultT], items: Sequence[ItemT], workers: Workers, results: Results[ResultT] | None = None
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
