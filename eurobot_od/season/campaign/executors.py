"""Who does the work of a campaign: this process, others on this machine, or dask's workers on any machine.

A campaign sees nothing of them but an executor of `concurrent.futures`.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from eurobot_od.errors import LocalError
from eurobot_od.season.campaign import MOST_JOBS

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
            # Blocks that are still running are given up: nobody is left to take their results.
            executor.shutdown(wait=False)


def workers(text: str | None, jobs: int | None, most: int) -> AbstractContextManager[Workers]:
    """Give what `dask://HOST:PORT` names, or else `jobs` processes, one a core, but not more than there is to do."""
    if text is None:
        return local(min(jobs or cores(), most))
    if not text.startswith(DASK):
        raise LocalError(f"{text!r} is no executor: {DASK}HOST:PORT, or --jobs for processes of this machine")
    return dask(text.removeprefix(DASK))
