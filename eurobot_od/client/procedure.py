"""Procedures: what a master does with a node, written once for programs that block and for event loops.

Theory of operation. A procedure is a coroutine that awaits only other procedures, down to `Master.pump`, where
frames are awaited. The pump of a blocking master waits inside itself: a procedure on it runs from beginning to end in
one step, which is what calling it does. The pump of an event loop's master suspends, and its procedures are awaited:

    configure(node, description, now)               # on a blocking master
    await configure.steps(node, description, now)   # in an event loop, and in other procedures

So each procedure is written only once, and there is no thread or loop that nobody has asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import partial, update_wrapper
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

from eurobot_od.errors import StateError

P = ParamSpec("P")
Result = TypeVar("Result")
Owner = TypeVar("Owner")
Rest = ParamSpec("Rest")


class Procedure(Generic[P, Result]):
    """A coroutine function: calling it carries all of it out at once, its `steps` have to be awaited.

    It is a decorator for functions and methods. Called for the master of an event loop, it raises StateError.
    """

    def __init__(self, function: Callable[P, Coroutine[Any, Any, Result]]) -> None:
        self.steps = function
        if not isinstance(function, partial):
            update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Result:
        """Carry it out, and return when it is done."""
        return finished(self.steps(*args, **kwargs))

    def __get__(
        self: Procedure[Concatenate[Owner, Rest], Result], instance: Owner, owner: type[Owner]
    ) -> Procedure[Rest, Result]:
        """Return the procedure bound to an object, like a method."""
        return Procedure(partial(self.steps, instance))


def finished(steps: Coroutine[Any, Any, Result]) -> Result:
    """Return the result of a coroutine that must not suspend; raises StateError if it does."""
    try:
        steps.send(None)
    except StopIteration as end:
        result: Result = end.value
        return result
    steps.close()
    raise StateError("this network belongs to an event loop: await its calls")
