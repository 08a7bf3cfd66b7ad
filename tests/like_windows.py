"""Lets the package, and nothing else, see what Windows has: run as `python like_windows.py COMMAND...`.

The interpreter and other packages stay as they are. What a module of eurobot_od imports lacks the modules and names
that Windows lacks; `os.name` is "nt", a folder cannot be opened as a file, and an event loop takes no signals.
"""

from __future__ import annotations

import asyncio
import builtins
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGE = "eurobot_od"
MODULES = {"fcntl", "termios", "tty", "pty", "resource", "pwd", "grp", "syslog", "posix", "curses", "readline"}
NAMES = {
    "os": {
        *("fork", "forkpty", "getuid", "geteuid", "getgid", "getpgid", "setsid", "killpg", "mkfifo", "nice", "uname"),
        *("sched_getaffinity", "sched_setaffinity", "getloadavg", "statvfs", "fchown", "chown", "O_DIRECTORY", "sync"),
        *("O_NONBLOCK", "openpty", "ttyname", "wait", "pread", "pwrite", "sysconf", "posix_fadvise", "sendfile"),
    },
    "signal": {
        *("SIGHUP", "SIGURG", "SIGKILL", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGCHLD", "SIGWINCH", "SIGPIPE", "SIGQUIT"),
        *("pthread_kill", "pthread_sigmask", "setitimer", "alarm", "pause", "sigwait", "siginterrupt"),
    },
    "socket": {"AF_UNIX", "AF_CAN", "PF_CAN", "SOL_CAN_RAW", "SO_REUSEPORT", "socketpair_unix"},
    "time": {"tzset", "clock_gettime", "pthread_getcpuclockid", "CLOCK_MONOTONIC"},
}


class Lacking(ModuleType):
    """A module without some of its names, and with others in place of some."""

    def __init__(self, module: ModuleType, lacks: set[str], instead: Mapping[str, object]) -> None:
        super().__init__(module.__name__, module.__doc__)
        self._module, self._lacks, self._instead = module, lacks, instead

    def __getattr__(self, name: str) -> Any:
        if name in self._lacks:
            raise AttributeError(f"module {self._module.__name__!r} has no attribute {name!r} on Windows")
        return self._instead.get(name) or getattr(self._module, name)


def no_folder(path: Any, *flags: int) -> int:
    """Open a file as `os.open` does on Windows, where a folder is none."""
    if Path(path).is_dir():
        raise PermissionError(13, "Permission denied", str(path))
    return os.open(path, *flags)


def no_signals(*_: object) -> None:
    """Refuse a handler as the event loops of Windows do."""
    raise NotImplementedError


INSTEAD: dict[str, dict[str, object]] = {"os": {"name": "nt", "open": no_folder}}


def install() -> None:
    """From now on the package imports what Windows has."""
    usual = builtins.__import__
    lacking = {name: Lacking(usual(name), lacks, INSTEAD.get(name, {})) for name, lacks in NAMES.items()}

    def imported(
        name: str, globals: Any = None, locals: Any = None, fromlist: Sequence[str] | None = (), level: int = 0
    ) -> ModuleType:
        if not str((globals or {}).get("__name__", "")).startswith(PACKAGE):
            return usual(name, globals, locals, fromlist, level)
        if name.partition(".")[0] in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r} on Windows", name=name)
        return lacking.get(name) or usual(name, globals, locals, fromlist, level)

    builtins.__import__ = imported
    asyncio.AbstractEventLoop.add_signal_handler = no_signals  # type: ignore[assignment,method-assign]
    asyncio.SelectorEventLoop.add_signal_handler = no_signals  # type: ignore[assignment,method-assign]


if __name__ == "__main__":
    install()
    from eurobot_od.cli import main

    sys.exit(main(sys.argv[1:]))
