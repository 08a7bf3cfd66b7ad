"""Runs `eurobot-od` with the arguments given, in an environment that it sets up itself: `python3 tools/run.py match`.

`python3 tools/run.py canopen-workbench decode ...` runs the program of that name. It runs before anything is installed,
so it uses the standard library only. `bench` is not a command of the program but the repository's own, `tools/bench`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from environment import ROOT, call, prepare

PROGRAMS = ("eurobot-od", "canopen-workbench")


def command(words: list[str]) -> tuple[str | Path, ...]:
    """Return the command for the arguments."""
    if words[:1] == ["bench"]:
        return prepare("bench"), ROOT / "tools" / "bench", *words[1:]
    program, *words = words if words[:1] and words[0] in PROGRAMS else [PROGRAMS[0], *words]
    # Not `python -m`, which imports from the folder that it is started in: there may be somebody's logs.
    return prepare().with_name(program), *words


if __name__ == "__main__":
    sys.exit(call(*command(sys.argv[1:])))
