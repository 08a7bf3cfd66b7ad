"""Items out in blocks, results back in the items' order.

Rule of this file: nothing is done twice. What is among the results already is read; a block is written as soon as it is
done, in whatever order; only what is done before its turn is held back.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from typing import TYPE_CHECKING, TypeVar

from eurobot_od.campaign.executors import BLOCK, Workers

if TYPE_CHECKING:
    from eurobot_od.campaign.results import Results

ROUNDS = 8
"""At least so many blocks for each worker, where there are enough items: nobody waits long for the last one."""

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def run(
    do: Callable[[ItemT], ResultT],
    items: Sequence[ItemT],
    workers: Workers,
    results: Results[ResultT] | None = None,
) -> Generator[ResultT, None, None]:
    """Yield what `do` makes of each item, in their order; `do` and all it needs is sent to the workers.

    Raises ChildProcessError if a process of this machine dies, and whatever `do` raises.
    """
    done = {} if results is None else results.known(items)
    left = [item for item in items if str(item) not in done]
    blocks = _sliced(left, block_size(len(left), workers, results is not None))
    made = _done_here(do, blocks) if workers.executor is None else _done_elsewhere(do, blocks, workers)
    turns = iter(items)
    turn = next(turns, None)
    for block, found in _written(made, results):
        done.update(zip(map(str, block), found))
        while turn is not None and str(turn) in done:
            yield done.pop(str(turn))
            turn = next(turns, None)
    while turn is not None:
        yield done.pop(str(turn))
        turn = next(turns, None)


def block_size(items: int, workers: Workers, kept: bool) -> int:
    """Return how many items a block has; what is kept comes in larger ones, as each is a file."""
    return max(1, min(BLOCK if kept else workers.block, items // (workers.number * ROUNDS)))


def _sliced(items: Sequence[ItemT], size: int) -> list[Sequence[ItemT]]:
    return [items[begin : begin + size] for begin in range(0, len(items), size)]


Done = tuple[Sequence[ItemT], list[ResultT]]
"""A block and its results."""


def _written(made: Iterable[Done[ItemT, ResultT]], results: Results[ResultT] | None) -> Iterator[Done[ItemT, ResultT]]:
    for block, found in made:
        if results is not None:
            results.write(block, found)
        yield block, found


def _done_here(do: Callable[[ItemT], ResultT], blocks: Iterable[Sequence[ItemT]]) -> Iterator[Done[ItemT, ResultT]]:
    return ((block, _do_block(do, block)) for block in blocks)


def _done_elsewhere(
    do: Callable[[ItemT], ResultT], blocks: Iterable[Sequence[ItemT]], workers: Workers
) -> Iterator[Done[ItemT, ResultT]]:
    assert workers.executor is not None
    futures: dict[Future[list[ResultT]], Sequence[ItemT]] = {
        workers.executor.submit(_do_block, do, block): block for block in blocks
    }
    try:
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    except BrokenExecutor:
        raise ChildProcessError("a process that did a part of the work has died") from None


def _do_block(do: Callable[[ItemT], ResultT], block: Sequence[ItemT]) -> list[ResultT]:
    return [do(item) for item in block]
