"""Runs `eurobot-od` with the arguments given, in an environment that it sets up itself: `python3 tools/run.py match`.

It runs before anything is installed, so it uses the standard library only. `bench` is not a command of `eurobot-od`
but the repository's own, `tools/bench`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from environment import ROOT, call, prepare


def command(words: list[str]) -> tuple[str | Path, ...]:
    """Return the command that the arguments stand for."""
    if words[:1] == ["bench"]:
        return prepare("bench"), ROOT / "tools" / "bench", *words[1:]
    return prepare(), "-m", "eurobot_od", *words


if __name__ == "__main__":
    sys.exit(call(*command(sys.argv[1:])))
