"""Runs `eurobot-od` with the arguments given, in an environment that it sets up itself: `python3 tools/run.py match`.

`python3 tools/run.py canopen-workbench decode ...` runs the program of that name. It runs before anything is installed,
so it uses the standard library only. `bench` is not a command of the program but the repository's own, `tools/bench`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from environment import ROOT, call, has, prepare

PROGRAMS = ("eurobot-od", "canopen-workbench")

NEEDED = {"serve": ("web", "aiohttp"), "remote": ("remote", "can_remote"), "--share": ("remote", "can_remote")}
"""Words of a command that need an extra, and the module by which an environment has it."""


def command(words: list[str]) -> tuple[str | Path, ...]:
    """Return the command for the arguments."""
    if words[:1] == ["bench"]:
        return prepare("bench"), ROOT / "tools" / "bench", *words[1:]
    program, *words = words if words[:1] and words[0] in PROGRAMS else [PROGRAMS[0], *words]
    # Not `python -m`, which imports from the folder that it is started in: there may be somebody's logs.
    extras = {extra for word, (extra, module) in NEEDED.items() if word in words and not has(module)}
    return prepare(",".join(sorted(extras))).with_name(program), *words


if __name__ == "__main__":
    sys.exit(call(*command(sys.argv[1:])))
