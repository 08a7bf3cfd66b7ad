"""Requests of layouts: what a page shows, kept by name in the folder of the page."""

from __future__ import annotations

import json
from typing import Any

from eurobot_od.errors import FileError, LocalError
from eurobot_od.support.files import read_whole, write_whole
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of
from eurobot_od.web.desk import Desk

FILE = "layouts.json"

MOST, LONGEST_NAME = 50, 60


def layouts(desk: Desk, _: Arguments) -> dict[str, Any]:
    """Return the layouts by name; raises FileError for a damaged file."""
    file = desk.folder / FILE
    if not file.exists():
        return {}
    try:
        found = json.loads(read_whole(file))
    except ValueError as error:
        raise FileError(file, f"not JSON: {error}") from None
    if not isinstance(found, dict):
        raise FileError(file, "not layouts by name")
    return found


def keep(desk: Desk, said: Arguments) -> None:
    """Keep a layout under a name; an existing one is replaced."""
    name = text_of(said, "name")
    layout = said.get("layout")
    known = layouts(desk, said)
    if not name or len(name) > LONGEST_NAME or not name.isprintable():
        raise LocalError(f"a layout has a name of 1 to {LONGEST_NAME} characters")
    if not isinstance(layout, dict):
        raise LocalError("layout is missing")
    if name not in known and len(known) >= MOST:
        raise LocalError(f"{MOST} layouts are kept already: remove another one first")
    _write(desk, {**known, name: layout})


def remove(desk: Desk, said: Arguments) -> None:
    """Remove a layout, if there is one with the name."""
    _write(desk, {name: each for name, each in layouts(desk, said).items() if name != text_of(said, "name")})


def _write(desk: Desk, known: dict[str, Any]) -> None:
    write_whole(desk.folder / FILE, f"{json.dumps(known, indent=1, ensure_ascii=False)}\n".encode())


REQUESTS = {
    "layouts": PageRequest(layouts, Way.AT_ONCE),
    "keep layout": PageRequest(keep, Way.AT_ONCE, acts=True),
    "remove layout": PageRequest(remove, Way.AT_ONCE, acts=True),
}
