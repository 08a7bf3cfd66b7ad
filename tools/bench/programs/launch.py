"""Runs a command; prints its wall and CPU time, peak memory and exit status as JSON.

`launch.py INPUT OUTPUT WORD...`: with `-` as OUTPUT the command is ended after its first line, at which its time is
taken.

Rule of this file: it uses little of the standard library, and nothing else. A process begins with its parent's peak
memory, so a large program cannot measure a small one.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from glob import glob

PAUSE = 0.02
"""Interval between two readings of the children, in s; the kernel keeps their peaks while they live."""

PEAK = "VmHWM:"


def peaks(process: int) -> dict[int, int]:
    """Return the peak memory in bytes of a process and its descendants so far, without those that have ended."""
    found = {}
    with suppress(OSError):
        with open(f"/proc/{process}/status") as status:  # noqa: PTH123  # pathlib would make this program greater
            found[process] = next((int(line.split()[1]) << 10 for line in status if line.startswith(PEAK)), 0)
        for file in glob(f"/proc/{process}/task/*/children"):  # noqa: PTH207
            with open(file) as children:  # noqa: PTH123
                for child in children.read().split():
                    found |= peaks(int(child))
    return found


def watch(process: int, seen: dict[int, int]) -> None:
    """Keep the peaks of a process and all its descendants up to date, for ever."""
    while True:
        seen |= peaks(process)
        time.sleep(PAUSE)


def first_line(file: int) -> bool:
    """Wait for a line; return whether there was one."""
    while said := os.read(file, 1):
        if said == b"\n":
            return True
    return False


def main() -> None:
    """Run the command."""
    source, target, *command = sys.argv[1:]
    seen: dict[int, int] = {}
    reading, writing = os.pipe()
    to_line = target == "-"
    to_file = (os.POSIX_SPAWN_OPEN, 1, target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    output = (os.POSIX_SPAWN_DUP2, writing, 1) if to_line else to_file
    files = [(os.POSIX_SPAWN_OPEN, 0, source, os.O_RDONLY, 0), output]
    begin = time.perf_counter()
    process = os.posix_spawn(command[0], command, os.environ, file_actions=files)
    threading.Thread(target=watch, args=(process, seen), daemon=True).start()
    os.close(writing)
    if is_ended := to_line and first_line(reading):
        seconds = time.perf_counter() - begin
        os.kill(process, signal.SIGTERM)
    _, status, usage = os.wait4(process, 0)
    if not is_ended:
        seconds = time.perf_counter() - begin
    memory = max(usage.ru_maxrss << 10, sum(seen.values()))
    cpu = usage.ru_utime + usage.ru_stime
    code = 0 if is_ended else os.waitstatus_to_exitcode(status) or int(to_line)  # one without a line has failed
    told = {"seconds": seconds, "cpu": cpu, "memory": memory, "status": code}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
