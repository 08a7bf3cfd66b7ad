"""The tool that measures how motions end leaves nothing behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"

LOADS = """
import time
from motion_ends import load
with load(2):
    print("loaded", flush=True)
    time.sleep(60)
"""


@pytest.mark.posix
def test_the_processes_that_load_the_cores_end_with_the_tool() -> None:
    with subprocess.Popen([sys.executable, "-c", LOADS], cwd=TOOLS, stdout=subprocess.PIPE) as tool:
        assert tool.stdout is not None
        assert tool.stdout.readline() == b"loaded\n"
        tool.kill()
        # The end of the output: whoever still had it would be alive.
        rest, _ = tool.communicate(timeout=60)
        assert rest == b""
