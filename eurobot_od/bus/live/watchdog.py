"""Ends a program that somebody else wrote when it hangs in an event loop.

Theory of operation. A coroutine that never gives way stops everything that runs in its thread, and nobody can cancel
it: to be cancelled it would have to await. So a thread of its own looks every `PERIOD` whether the loop has moved. In
simulated time that means that the clock went on, in real time that the loop has waited for something: a program that
gives way again and again without any time passing hangs as well. When nothing has moved for `PATIENCE`, the watchdog
raises `Hang` in the watched thread. It does so only while a function of the program is being called there, and not
asyncio or this package, so that what is ended is the program and nothing else; and again and again until the loop
moves, as a bare `except:` swallows it.

In the main thread of a POSIX system it raises from a signal's handler, which sees where the thread is right then, and
which wakes a thread that is blocked in a system call, as in `time.sleep`. Its signal is SIGURG, which nobody else uses
and which does nothing by default. In any other thread Python delivers the exception some instructions after the look,
perhaps in asyncio: that ends the loop, and the program with it. What cannot be ended: a function written in C that
neither returns nor looks for signals.
"""

from __future__ import annotations

import asyncio
import ctypes
import linecache
import os
import re
import signal
import sys
import sysconfig
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType

PERIOD = 0.05
"""Seconds between two checks whether the loop has moved."""

PATIENCE = 1.0
"""How long a program may keep the loop from moving, in seconds of real time."""

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
    # From asyncio's call of what is ready outwards there is no program any more.
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


class Watchdog:
    """Watches the thread that enters this context; `has_moved` says whether anything happened since the last call.

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
        still = 0
        while not self._ended.wait(PERIOD):
            still = 0 if self._has_moved() else still + 1
            if still * PERIOD >= PATIENCE:
                self._end_program()
            elif still > 1 and (frame := self._program()) is not None:
                where, line = place(frame)
                # Only what is known to block: any other line may just take its time.
                if hint(line) != IN_GENERAL and where not in self._warned:
                    self._warned.add(where)
                    self._report(f"{where}: `{line}` blocks: {hint(line)}")

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
