"""Runs coroutines of users to their end, whatever they do, and then the tasks that they leave behind.

A watchdog sees whether the code of a coroutine hangs, says where, and ends it.
"""

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
        """Return whether it is waiting, or has waited since the last call."""
        waited, self._waited = self._waited or self._waiting, False
        self._spins = not waited
        return waited


PERIOD = 0.05
"""Seconds between two checks whether the loop has moved."""

PATIENCE = 1.0
"""How long a program may keep the loop from moving: s that it computes, or waits at a line that is known to block."""

STALLED = 30.0
"""How long it may do so at any other line without computing, s: the disk may stall, the machine be loaded."""

AGAIN = 0.002
"""Seconds from one try to end a program to the next."""

ARRIVAL = 100
"""Turns of a loop, at each of which Python looks whether another thread has raised something."""

SLOWEST = 0.1
"""A simulated clock that goes on by less in the seconds of `PATIENCE` stands still, s."""

PACKAGE = str(Path(__file__).resolve().parents[2]) + os.sep
OWN_CODE = (PACKAGE, sysconfig.get_path("stdlib") + os.sep, "<frozen ", "<generated ", "<string>")
"""Prefixes of file names whose code is not the watched program; named tuples and dataclasses are made in `<string>`."""

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
"""What to write instead of a line that blocks."""

IN_GENERAL = "nothing else can go on, await something that takes time, such as `await asyncio.sleep(0.05)`"


class Hang(BaseException):
    """Raised in a program that hangs; it is not an Exception, which a program in a loop may well catch.

    Python makes it from its class alone, so each has a class of its own, with the `text` that says where.
    """

    text = ""

    def __str__(self) -> str:
        return self.text


def hint(line: str) -> str:
    """Say what to write instead of a source line that hangs."""
    for pattern, text in HINTS:
        if found := pattern.search(line):
            return text.format_map(found.groupdict())
    return IN_GENERAL


def place(frame: FrameType) -> tuple[str, str]:
    """Return the file with the line that a program is in, and what stands there."""
    file, number = frame.f_code.co_filename, frame.f_lineno
    return f"{file}:{number}", linecache.getline(file, number).strip()


def innermost(frame: FrameType | None) -> FrameType | None:
    """Return the innermost call of the program at this place, None if it is not there, or in a debugger."""
    found = None
    # Frames outside asyncio's call of what is ready are not the program's.
    while frame is not None and frame.f_code is not asyncio.Handle._run.__code__:
        if frame.f_globals.get("__name__") in DEBUGGERS:
            return None
        found = found or (None if frame.f_code.co_filename.startswith(OWN_CODE) else frame)
        frame = frame.f_back
    return None if frame is None else found


def caller() -> str:
    """Return the file with the line in which a program calls this package; raises nothing."""
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(OWN_CODE):
        frame = frame.f_back
    return place(frame)[0]


def raise_in(thread: threading.Thread, kind: type[BaseException]) -> None:
    """Raise an exception in another thread, as soon as it runs Python again.

    It cannot be taken back: Python would look for it at each instruction from then on, and never trace a line again.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(kind))


def cpu_time_of(thread: threading.Thread) -> Callable[[], float]:
    """Return a clock of the CPU time of a running thread, in s; of real time, where the system does not count it."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return time.monotonic
    clock = time.pthread_getcpuclockid(thread.ident or 0)
    return lambda: time.clock_gettime(clock)


class Watchdog:
    """Watches the thread that enters this context; `has_moved` says whether anything happened since the last call.

    A program hangs if it computes, or waits at a line that is known to block, for `PATIENCE`. While it does neither,
    the machine lets it wait, for `STALLED` at most.

    `hang` is the line at which the program was ended, and what to write instead; empty if it did not hang. `warn` gets
    a line about each place that blocks for a shorter time.
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
        """End the watching thread; False if what it has raised last arrived only now."""
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
        still, moved_at = 0, cpu_time()
        while not self._ended.wait(PERIOD):
            if self._has_moved():
                still, moved_at = 0, cpu_time()
                continue
            still += 1
            # Before the loop is called still, a line may just take its time.
            blocks = still > 1 and self._blocks()
            waited = still * PERIOD  # not by a clock: a machine that is suspended lets nobody wait
            if cpu_time() - moved_at >= PATIENCE or waited >= (PATIENCE if blocks else STALLED):
                self._end_program()
                still, moved_at = 0, cpu_time()

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
            self._hang = None  # a program that has gone on by itself may hang elsewhere now
        while not (self._ended.wait(AGAIN) or self._has_moved()):
            if self._hang is None:
                self._look()
            elif self._signalled:
                signal.pthread_kill(self._watched.ident or 0, signal.SIGURG)
            elif self._program() is not None:
                self.hang = self._hang.text
                raise_in(self._watched, self._hang)

    def _look(self) -> None:
        """Note at which line the program hangs, if it is there."""
        frame = self._program()
        if frame is not None:
            where, line = place(frame)
            text = f"{where}: `{line}` does not give way: {hint(line)}"
            self._hang = type(Hang.__name__, (Hang,), {"text": text})

    def _end(self, frame: FrameType | None) -> None:
        """End the program, if it is there now; called by the signal in the watched thread."""
        if self._hang is not None and innermost(frame) is not None:
            self.hang = self._hang.text
            raise self._hang

    def _program(self) -> FrameType | None:
        """Return where the program is in the watched thread, as `innermost` does."""
        return innermost(sys._current_frames().get(self._watched.ident or 0))


def give_up(program: object) -> None:
    """Keep a coroutine that swallows its cancellation for as long as the process lasts.

    Python would close it when it collects it, in the middle of anything, and it would swallow that as well: for ever.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(program))


# What moves


def passing(clock: Callable[[], float]) -> Callable[[], bool]:
    """Return a function that says whether a simulated clock has advanced."""
    seen = clock()

    def has_moved() -> bool:
        nonlocal seen
        now = clock()
        if now - seen < SLOWEST:
            return False
        seen = now
        return True

    return has_moved
