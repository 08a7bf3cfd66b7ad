"""Who does the work of a campaign: this process, others on this machine, or dask's workers on any.

Rule of this file: an executor of `concurrent.futures` is all that a campaign sees of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from typing import NamedTuple

from eurobot_od.errors import LocalError

DASK = "dask://"

RETRIES = 3
"""How often dask gives a block to another worker when one was lost."""

CONNECT_WAIT = "10s"


BLOCK = 100
"""Items of a block for workers elsewhere: a lost one does not matter much, and handing it over not at all."""


class Workers(NamedTuple):
    """How many things are done at once, and by which executor; None: in this process, one after the other.

    `block` is how many items are handed over at once at most.
    """

    number: int = 1
    executor: Executor | None = None
    block: int = 1


HERE = Workers()


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def local(number: int) -> Iterator[Workers]:
    """Give so many processes of this machine; one is this process itself. They end with the `with` block."""
    if number == 1:
        yield HERE
        return
    from eurobot_od.campaign.processes import Processes

    with Processes(number) as executor:
        yield Workers(number, executor)


@contextmanager
def dask(address: str) -> Iterator[Workers]:
    """Give the workers of a dask scheduler, `HOST:PORT`; what is still to be done is given up at the end.

    Raises LocalError if nobody answers there, without a worker, and for one that does several things at once in one
    process: `sys.stdout` would be anybody's. Raises ModuleNotFoundError without dask.
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
        executor = client.get_executor(pure=False, retries=RETRIES)  # type: ignore[no-untyped-call]
        try:
            yield Workers(len(threads), executor, BLOCK)
        finally:
            executor.shutdown(wait=False)


def workers(text: str | None, jobs: int | None, most: int) -> AbstractContextManager[Workers]:
    """Give what `dask://HOST:PORT` names, or else `jobs` processes, one a core, but not more than there is to do."""
    if text is None:
        return local(min(jobs or cores(), most))
    if not text.startswith(DASK):
        raise LocalError(f"{text!r} is no executor: {DASK}HOST:PORT, or --jobs for processes of this machine")
    return dask(text.removeprefix(DASK))
