"""Runs `eurobot-od` with the arguments given, in an environment that it sets up itself: `python3 tools/run.py match`.

Rule of this file: standard library only, and nothing but the call. `bench` is no command of `eurobot-od`, but the
repository's own: `tools/bench`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from environment import ROOT, call, prepare


def command(words: list[str]) -> tuple[str | Path, ...]:
    """Return what is to be called for the arguments given."""
    if words[:1] == ["bench"]:
        return prepare("bench"), ROOT / "tools" / "bench", *words[1:]
    return prepare(), "-m", "eurobot_od", *words


if __name__ == "__main__":
    sys.exit(call(*command(sys.argv[1:])))
