"""What the keys of the monitor do; no terminal is needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from eurobot_od.traffic.monitor.traffic import SORTS

ENTER, ESCAPE, BACKSPACES = "\r\n", "\x1b", "\x08\x7f"  # a terminal sends one or the other
HELP = "q quit  p pause  s sort  / filter  j k scroll  c clear counts"


@dataclass
class Controls:
    """Settings of the table: `part` is what names must contain, `typing` whether it is being typed.

    `top` is how many rows are scrolled away.
    """

    sort: str = "identifier"
    part: str = ""
    typing: bool = False
    paused: bool = False
    clear: bool = False
    running: bool = True
    top: int = 0

    def within(self, most: int) -> int:
        """Return how many rows are scrolled away, `most` at most: what is shown ends with the last row."""
        # Kept, or each press of `j` beyond the end would have to be taken back by one of `k`.
        self.top = min(self.top, max(most, 0))
        return self.top

    def key(self, key: str) -> None:
        """Take in a key; unknown keys do nothing."""
        if not self.typing:
            for name, value in (KEYS[key](self) if key in KEYS else {}).items():
                setattr(self, name, value)
        elif key in ENTER:
            self.typing = False
        elif key == ESCAPE:
            self.typing, self.part = False, ""
        elif key in BACKSPACES:
            self.part = self.part[:-1]
        elif key.isprintable():
            self.part += key


ORDERS = list(SORTS)

KEYS: Mapping[str, Callable[[Controls], Mapping[str, object]]] = {
    **dict.fromkeys("p ", lambda controls: {"paused": not controls.paused}),
    "s": lambda controls: {"sort": ORDERS[(ORDERS.index(controls.sort) + 1) % len(ORDERS)]},
    "/": lambda _: {"typing": True, "part": ""},
    **dict.fromkeys("j\x0e", lambda controls: {"top": controls.top + 1}),
    **dict.fromkeys("k\x10", lambda controls: {"top": max(controls.top - 1, 0)}),
    "c": lambda _: {"clear": True},
    "q": lambda _: {"running": False},
}
"""What the keys change while no filter is being typed."""
