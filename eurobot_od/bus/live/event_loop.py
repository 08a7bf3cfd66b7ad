"""Runs users' coroutines and their remaining tasks to the end; a watchdog detects code that blocks, and ends it."""

from __future__ import annotations

import asyncio
import ctypes
import linecache
import os
import re
import selectors
import signal
import sys
import sysconfig
import threading
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

from eurobot_od.errors import ProgramFailed

# SIGTERM as an exception, so that a terminated program cleans up


TERMINATED = 128 + signal.SIGTERM
"""Exit status of a program ended by SIGTERM, as in shells."""


class Terminated(SystemExit):
    """Raised by SIGTERM, to distinguish it from `sys.exit`."""


class EndedBySigterm:
    """A context manager: SIGTERM raises Terminated in the block, unless the program has its own handler.

    It raises once, and after `hold` only at the end of the block, so that the program's clean-up is not interrupted.
    Outside the main thread, which alone gets signals, it does nothing.
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
        """Defer Terminated to the end of the block."""
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
"""Number of times that a remaining task is cancelled before it is given up."""

LONGEST = 0.1
"""Longest single wait of a loop, in s; exceptions raised in its thread from outside arrive after a wait."""

GRACE = 0.2
"""Time for a cancelled task to end, in s."""


def run(main: Coroutine[Any, Any, Result], tell: Callable[[str], object] = lambda _: None) -> Result:
    """Run a coroutine to its end in real time; raises ProgramFailed if it hangs or calls `sys.exit`.

    `tell` is called with the watchdog's lines.
    """
    loop, watchdog = watched_loop(tell)
    with watchdog:
        result = run_in(loop, main)
    if watchdog.hang:  # in a task that was not awaited
        raise ProgramFailed(watchdog.hang)
    return result


def watched_loop(tell: Callable[[str], object]) -> tuple[asyncio.AbstractEventLoop, Watchdog]:
    """Return a loop in real time, and the watchdog of its thread.

    Unlike in `asyncio.run`, Ctrl-C raises KeyboardInterrupt at once, wherever the program is.
    """
    waits = _Waits()
    return asyncio.SelectorEventLoop(waits), Watchdog(waits.has_moved, tell)


def apart(function: Callable[[], Result]) -> Result:
    """Call a function that runs an event loop; in another thread if one is running already, as in a notebook.

    An interrupt of the caller, by Ctrl-C or the notebook's button, also interrupts the function.
    """
    try:
        asyncio.get_running_loop()
        is_running = True
    except RuntimeError:
        is_running = False
    if not is_running:  # not in the handler above, whose error would be the context of the function's
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
    """Run a coroutine to its end in a loop, and close the loop; raises ProgramFailed as `run` does."""
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
    """Return the error about a program that called `sys.exit`."""
    return f"sys.exit({'' if end.code is None else repr(end.code)}) ends the whole program: write `return`"


def _wind_up(loop: asyncio.AbstractEventLoop) -> None:
    """Cancel the remaining tasks, wait for their end, and give up those that do not end."""
    for _ in range(TIMES):
        tasks = asyncio.all_tasks(loop)
        if not tasks:
            break
        for task in tasks:
            task.cancel()
        done, _ = loop.run_until_complete(asyncio.wait(tasks, timeout=GRACE))
        for task in done:
            _ = task.cancelled() or task.exception()  # otherwise asyncio logs an unretrieved exception
    loop.set_exception_handler(lambda *_: None)  # for tasks that are given up
    loop.run_until_complete(loop.shutdown_asyncgens())
    for task in asyncio.all_tasks(loop):
        give_up(task.get_coro())
    loop.close()


class _Waits(selectors.DefaultSelector):
    """Notes whether the loop waits for anything.

    While it does not wait, files are not polled either: Python would switch threads only there, and the watchdog would
    never see the program's own code.
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
            self._waited = self._waited or self._waiting
            self._waiting = False

    def has_moved(self) -> bool:
        """Return whether it is waiting, or has waited since the last call."""
        waited = self._waited or self._waiting
        self._waited = False
        self._spins = not waited
        return waited


PERIOD = 0.05
"""Time between two checks of the loop, in s."""

PATIENCE = 1.0
"""Longest time that a program may compute, or wait at a line that is known to block, in s."""

STALLED = 30.0
"""Longest time that a program may wait at any other line, in s; disk or machine may be slow."""

AGAIN = 0.002
"""Time between two tries to end a program, in s."""

ARRIVAL = 100
"""Loop iterations that give Python time to deliver an exception from another thread."""

SLOWEST = 0.1
"""Least advance of a simulated clock that counts as movement, in s."""

PACKAGE = str(Path(__file__).resolve().parents[2]) + os.sep
OWN_CODE = (PACKAGE, sysconfig.get_path("stdlib") + os.sep, "<frozen ", "<generated ", "<string>")
"""Prefixes of files that are not the watched program; named tuples and dataclasses are made in `<string>`."""

DEBUGGERS = {"bdb", "pdb"}

HINTS = (
    (
        re.compile(r"(?<!asyncio\.)\bsleep\((?P<what>[^()]*)\)"),
        "time.sleep stops everything, write `await asyncio.sleep({what})`",
    ),
    (re.compile(r"\.result\("), "nothing goes on while it waits for `.result()`, write `await` before the call"),
    (re.compile(r"\binput\("), "nobody can answer `input()` in a match"),
    (
        re.compile(r"^(?!.*\bawait\b).*(\.(wait|acquire)\(|\.join\(\)|\bsubprocess\.)"),
        "nothing goes on while it waits for a thread or a program, await it in `asyncio.to_thread(...)`",
    ),
)
"""Patterns of blocking lines, and what to write instead."""

IN_GENERAL = "nothing else can go on, await something that takes time, such as `await asyncio.sleep(0.05)`"


class Hang(BaseException):
    """Raised in a program that hangs; not an Exception, which the program may catch.

    Python creates it from its class alone, so each hang has its own class with the `text`.
    """

    text = ""

    def __str__(self) -> str:
        return self.text


def hint(line: str) -> str:
    """Return what to write instead of a source line that hangs."""
    for pattern, text in HINTS:
        if found := pattern.search(line):
            return text.format_map(found.groupdict())
    return IN_GENERAL


def place(frame: FrameType) -> tuple[str, str]:
    """Return file and line number of a frame, and the line's text."""
    file = frame.f_code.co_filename
    number = frame.f_lineno
    return f"{file}:{number}", linecache.getline(file, number).strip()


def innermost(frame: FrameType | None) -> FrameType | None:
    """Return the innermost frame of the program, None if there is none, or a debugger is active."""
    found = None
    # Frames outside asyncio's call of a handle are not the program's.
    while frame is not None and frame.f_code is not asyncio.Handle._run.__code__:
        if frame.f_globals.get("__name__") in DEBUGGERS:
            return None
        found = found or (None if frame.f_code.co_filename.startswith(OWN_CODE) else frame)
        frame = frame.f_back
    return None if frame is None else found


def caller() -> str:
    """Return file and line number of a program's call of this package; raises nothing."""
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(OWN_CODE):
        frame = frame.f_back
    return place(frame)[0]


def raise_in(thread: threading.Thread, kind: type[BaseException]) -> None:
    """Make another thread raise an exception as soon as it runs Python code.

    It is never revoked: Python would then check for it at each instruction, and never trace a line again.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(kind))


def cpu_time_of(thread: threading.Thread) -> Callable[[], float]:
    """Return a clock of a thread's CPU time in s; of real time if the system does not measure it."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return time.monotonic
    clock = time.pthread_getcpuclockid(thread.ident or 0)
    return lambda: time.clock_gettime(clock)


class Watchdog:
    """Watches the thread that enters this context; `has_moved` returns whether the loop has moved since its last call.

    A program hangs if it computes, or waits at a line that is known to block, for `PATIENCE`, or waits elsewhere for
    `STALLED`.

    `hang` is the line where the program was ended, and what to write instead; empty if it did not hang. `warn` is
    called with a line about each place that blocks for a shorter time.
    """

    def __init__(self, has_moved: Callable[[], bool], warn: Callable[[str], object] = lambda _: None) -> None:
        self.hang = ""
        self._has_moved, self._report = has_moved, warn
        self._hang: type[Hang] | None = None
        self._warned: set[str] = set()
        self._ended = threading.Event()

    def __enter__(self) -> Watchdog:
        self._watched = threading.current_thread()
        self._signalled = self._watched is threading.main_thread() and hasattr(signal, "SIGURG")
        if self._signalled:
            self._before = signal.signal(signal.SIGURG, lambda _signal, frame: self._end(frame))
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        while not self._is_over():
            pass
        if self._signalled:
            signal.signal(signal.SIGURG, self._before)

    def _is_over(self) -> bool:
        """End the watching thread; return False if its exception arrived only now."""
        try:
            self._ended.set()
            self._thread.join()
            for _ in range(ARRIVAL):
                pass
        except Hang:
            return False
        return True

    def _watch(self) -> None:
        cpu_time = cpu_time_of(self._watched)
        still = 0
        moved_at = cpu_time()
        while not self._ended.wait(PERIOD):
            if self._has_moved():
                still = 0
                moved_at = cpu_time()
                continue
            still += 1
            # The first time, the line may just be slow.
            blocks = still > 1 and self._blocks()
            waited = still * PERIOD  # not from a clock, because the machine may have been suspended
            if cpu_time() - moved_at >= PATIENCE or waited >= (PATIENCE if blocks else STALLED):
                self._end_program()
                still = 0
                moved_at = cpu_time()

    def _blocks(self) -> bool:
        """Return whether the program is at a line that is known to block, and warn of it once."""
        frame = self._program()
        where, line = place(frame) if frame else ("", "")
        if hint(line) == IN_GENERAL:
            return False
        if where not in self._warned:
            self._warned.add(where)
            self._report(f"{where}: `{line}` blocks: {hint(line)}")
        return True

    def _end_program(self) -> None:
        if not self.hang:
            self._hang = None  # the program may now hang elsewhere
        while not (self._ended.wait(AGAIN) or self._has_moved()):
            if self._hang is None:
                self._look()
            elif self._signalled:
                signal.pthread_kill(self._watched.ident or 0, signal.SIGURG)
            elif self._program() is not None:
                self.hang = self._hang.text
                raise_in(self._watched, self._hang)

    def _look(self) -> None:
        """Note the line at which the program hangs."""
        frame = self._program()
        if frame is not None:
            where, line = place(frame)
            text = f"{where}: `{line}` does not give way: {hint(line)}"
            self._hang = type(Hang.__name__, (Hang,), {"text": text})

    def _end(self, frame: FrameType | None) -> None:
        """End the program if it is still there; called by the signal in the watched thread."""
        if self._hang is not None and innermost(frame) is not None:
            self.hang = self._hang.text
            raise self._hang

    def _program(self) -> FrameType | None:
        """Return the innermost frame of the program in the watched thread."""
        return innermost(sys._current_frames().get(self._watched.ident or 0))


def give_up(program: object) -> None:
    """Keep a coroutine that ignores its cancellation alive until the process ends.

    Otherwise garbage collection would close it, which it would ignore as well, without end.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(program))


# Simulated clocks


def passing(clock: Callable[[], float]) -> Callable[[], bool]:
    """Return a function that returns whether a simulated clock has advanced since its last call."""
    seen = clock()

    def has_moved() -> bool:
        nonlocal seen
        now = clock()
        if now - seen < SLOWEST:
            return False
        seen = now
        return True

    return has_moved
