"""Items out in blocks, results back in the items' order.

Rule of this file: nothing is done twice. Results that are already there are read; a block is written as soon as it is
done, in whatever order, and only results that come before their turn are held back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from typing import TYPE_CHECKING, TypeVar

from eurobot_od.season.campaign.executors import BLOCK, Workers

if TYPE_CHECKING:
    from eurobot_od.season.campaign.results import Results

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
