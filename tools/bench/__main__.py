"""Compares the speed of this package with that of other programs.

`python3 tools/bench`, or `python3 tools/run.py bench`: it sets up the environment and starts the command.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])  # `bench` is a package among the tools

from environment import ensure  # noqa: E402  # found from here on

for needed in ("eurobot_od", "cantools", "dcf", "rich"):
    ensure(needed, "bench")

from bench.command import main  # noqa: E402  # after the environment is there

if __name__ == "__main__":
    sys.exit(main())
