"""Runs coroutines of users to their end, whatever they do, and then the tasks that they leave behind."""

from __future__ import annotations

import asyncio
import selectors
import signal
import threading
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from types import FrameType
from typing import Any, TypeVar

from eurobot_od.bus.live.watchdog import Hang, Watchdog, give_up, raise_in
from eurobot_od.errors import ProgramFailed

# SIGTERM as an exception, so that a program that is terminated cleans up as usual


TERMINATED = 128 + signal.SIGTERM
"""Exit status of a program that SIGTERM has ended, as shells write it."""


class Terminated(SystemExit):
    """Raised when SIGTERM has come, by which it differs from a program that calls `sys.exit`."""


class EndedBySigterm:
    """A context manager: SIGTERM raises Terminated in the block, unless the program has a handler of its own.

    It does so once, and no longer after `hold`: what the program does at its end is not to be cut short. One that
    comes then raises it at the end of the block. Outside the main thread, where Python takes no signals, it does
    nothing.
    """

    def __init__(self) -> None:
        self._held = self._missed = self._installed = False

    def __enter__(self) -> EndedBySigterm:
        in_main_thread = threading.current_thread() is threading.main_thread()
        self._installed = in_main_thread and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
        if self._installed:
            signal.signal(signal.SIGTERM, self._on_sigterm)
        return self

    def hold(self) -> None:
        """Raise nothing before the end of the block."""
        self._held = True

    def _on_sigterm(self, _signal: int, _frame: FrameType | None) -> None:
        if self._held:
            self._missed = True
        else:
            self._held = True
            raise Terminated(TERMINATED)

    def __exit__(self, cause: object, *_: object) -> None:
        if self._installed:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if self._missed and cause is None:
            raise Terminated(TERMINATED)


Result = TypeVar("Result")

TIMES = 5
"""How often a task that is left over is cancelled before it is given up."""

LONGEST = 0.1
"""Longest single wait of a loop, s: what is raised in its thread from outside arrives only after a wait."""

GRACE = 0.2
"""Seconds that it has to end in, each time."""


def run(main: Coroutine[Any, Any, Result], tell: Callable[[str], object] = lambda _: None) -> Result:
    """Run a coroutine to its end in real time; raises ProgramFailed if it hangs or calls `sys.exit`.

    `tell` is that of the watchdog.
    """
    loop, watchdog = watched_loop(tell)
    with watchdog:
        result = run_in(loop, main)
    if watchdog.hang:  # in a task that nobody has awaited
        raise ProgramFailed(watchdog.hang)
    return result


def watched_loop(tell: Callable[[str], object]) -> tuple[asyncio.AbstractEventLoop, Watchdog]:
    """Return a loop in real time, and the watchdog of the thread that runs it.

    Unlike `asyncio.run` it leaves Ctrl-C to Python, which raises KeyboardInterrupt at once and wherever the program is.
    """
    waits = _Waits()
    return asyncio.SelectorEventLoop(waits), Watchdog(waits.has_moved, tell)


def apart(function: Callable[[], Result]) -> Result:
    """Call a function that runs an event loop: in a thread of its own where one is running already, as in a notebook.

    Whoever is interrupted while they wait, by Ctrl-C or the notebook's button, interrupts the function.
    """
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return function()
    called: Future[Result] = Future()

    def call() -> None:
        try:
            called.set_result(function())
        except BaseException as error:
            called.set_exception(error)

    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    try:
        return called.result()
    except KeyboardInterrupt:
        raise_in(thread, KeyboardInterrupt)
        thread.join()
        raise


def run_in(loop: asyncio.AbstractEventLoop, main: Coroutine[Any, Any, Result]) -> Result:
    """Run a coroutine to its end in a loop, which is closed then; raises ProgramFailed as `run` does."""
    try:
        return loop.run_until_complete(main)
    except Hang as hang:
        raise ProgramFailed(str(hang)) from None
    except Terminated:
        raise
    except SystemExit as end:
        raise ProgramFailed(exited(end)) from None
    finally:
        _wind_up(loop)


def exited(end: SystemExit) -> str:
    """Say what a program did that called `sys.exit`."""
    return f"sys.exit({'' if end.code is None else repr(end.code)}) ends the whole program: write `return`"


def _wind_up(loop: asyncio.AbstractEventLoop) -> None:
    """Have the tasks that are left clean up and end; one that does not is given up."""
    for _ in range(TIMES):
        tasks = asyncio.all_tasks(loop)
        if not tasks:
            break
        for task in tasks:
            task.cancel()
        done, _ = loop.run_until_complete(asyncio.wait(tasks, timeout=GRACE))
        for task in done:
            _ = task.cancelled() or task.exception()  # retrieved, as asyncio complains about an exception that never is
    loop.set_exception_handler(lambda *_: None)  # of tasks that are given up
    loop.run_until_complete(loop.shutdown_asyncgens())
    for task in asyncio.all_tasks(loop):
        give_up(task.get_coro())
    loop.close()


class _Waits(selectors.DefaultSelector):
    """Notices whether the loop waits for anything.

    While it does not, it is not asked for files either: Python would give the other threads their turn there and
    nowhere else, and the watchdog would never come upon the program.
    """

    def __init__(self) -> None:
        super().__init__()
        self._waiting = self._waited = self._spins = False

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        self._waiting = timeout is None or timeout > 0
        if self._spins and not self._waiting:
            return []
        try:
            return super().select(LONGEST if timeout is None else min(timeout, LONGEST))
        finally:
            self._waited, self._waiting = self._waited or self._waiting, False

    def has_moved(self) -> bool:
        """Tell whether it is waiting, or has waited since the last call."""
        waited, self._waited = self._waited or self._waiting, False
        self._spins = not waited
        return waited
