"""What the keys of the monitor do.

Rule of this file: one key in, the settings changed; no terminal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from eurobot_od.monitor.traffic import SORTS

ENTER, ESCAPE, BACKSPACES = "\r\n", "\x1b", "\x08\x7f"
HELP = "p pause  s sort  / filter  c clear counts  q quit"


@dataclass
class Controls:
    """Settings of the table: `part` is what names must contain, `typing` whether it is being typed."""

    sort: str = "identifier"
    part: str = ""
    typing: bool = False
    paused: bool = False
    clear: bool = False
    running: bool = True

    def key(self, key: str) -> None:
        """Take in a key; one that means nothing does nothing."""
        if self.typing:
            self._type(key)
        elif key in KEYS:
            KEYS[key](self)

    def _type(self, key: str) -> None:
        if key in ENTER:
            self.typing = False
        elif key == ESCAPE:
            self.typing, self.part = False, ""
        elif key in BACKSPACES:
            self.part = self.part[:-1]
        elif key.isprintable():
            self.part += key

    def _pause(self) -> None:
        self.paused = not self.paused

    def _next_sort(self) -> None:
        names = list(SORTS)
        self.sort = names[(names.index(self.sort) + 1) % len(names)]

    def _begin_filter(self) -> None:
        self.typing, self.part = True, ""

    def _clear(self) -> None:
        self.clear = True

    def _quit(self) -> None:
        self.running = False


KEYS: Mapping[str, Callable[[Controls], None]] = {
    "p": Controls._pause,
    " ": Controls._pause,
    "s": Controls._next_sort,
    "/": Controls._begin_filter,
    "c": Controls._clear,
    "q": Controls._quit,
}
"""The keys while no filter is being typed."""
