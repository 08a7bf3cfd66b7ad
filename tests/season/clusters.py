"""What tests share that need several dask workers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest


class Cluster(NamedTuple):
    """Where the scheduler listens, and all processes, the scheduler the first."""

    address: str
    started: list[subprocess.Popen[str]]


DASK_SCHEDULER = (sys.executable, "-m", "distributed.cli.dask_scheduler")
DASK_WORKER = (sys.executable, "-m", "distributed.cli.dask_worker")


@contextmanager
def two_workers(folder: Path) -> Iterator[Cluster]:
    """Yield a scheduler and two workers on 127.0.0.1, each a process of its own without a nurse; skip without dask."""
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    file = folder / "scheduler.json"
    quiet = {"text": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    here = ("--host", "127.0.0.1")
    start = partial(subprocess.Popen, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, **quiet)
    started = [start([*DASK_SCHEDULER, *here, "--port", "0", "--no-dashboard", "--scheduler-file", str(file)])]
    try:
        while not file.is_file():
            assert started[0].poll() is None
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"].removeprefix("tcp://")
        alone = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
        started += [start([*DASK_WORKER, address, *here, *alone]) for _ in range(2)]
        _wait_for_workers(address, 2)
        yield Cluster(address, started)
    finally:
        for process in started:
            process.kill()
        for process in started:
            process.wait()


def _wait_for_workers(address: str, number: int) -> None:
    from distributed import Client

    with Client(f"tcp://{address}", set_as_default=False) as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(number, timeout=60)
