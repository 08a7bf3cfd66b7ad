"""A team's strategy from its file: Python with a coroutine function `play(core)`.

Whatever is wrong with a strategy before a match begins is one line with the place in its file.
"""

from __future__ import annotations

from inspect import iscoroutinefunction, signature
from pathlib import Path
from typing import NamedTuple, cast

from eurobot_od.errors import LocalError
from eurobot_od.robot.match import strategy as shipped
from eurobot_od.robot.match.referee import Strategy
from eurobot_od.support import python_file


class Players(NamedTuple):
    """Who plays: our strategy, and that of the second robot, None if there is none."""

    ours: Strategy = shipped.play
    against: Strategy | None = None


class StrategyFiles(NamedTuple):
    """The files of strategies: ours, None for the shipped one; the second robot's, None if there is no such robot."""

    ours: Path | None = None
    against: Path | None = None

    def load(self) -> Players:
        """Load them; raises LocalError."""
        return Players(load(self.ours) if self.ours else shipped.play, load(self.against) if self.against else None)


def load(file: Path) -> Strategy:
    """Return the `play` of a Python file, which may import modules beside it.

    What the file prints while it is loaded goes to standard error. Raises LocalError with the line of the file if it
    cannot be read, is not Python, raises, or has no coroutine function `play` that takes the core.
    """
    play = getattr(python_file.load(file), "play", None)
    if play is None:
        raise LocalError(f"{file}: no `play` in it; write `async def play(core)`")
    code = getattr(play, "__code__", None)
    where = f"{code.co_filename}:{code.co_firstlineno}" if code else str(file)
    if not iscoroutinefunction(play):
        raise LocalError(f"{where}: `play` is not a coroutine function; write `async def play(core)`")
    try:
        # Tried here: in the match, the TypeError would name a line of ours.
        signature(play).bind(None)
    except TypeError as error:
        raise LocalError(f"{where}: `play` is called with the core and nothing else: {error}") from None
    return cast(Strategy, play)
