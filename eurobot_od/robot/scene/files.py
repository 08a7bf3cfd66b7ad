"""A match as a file to look at: SVG or PNG, the picture; HTML, the page that plays it; by the file's suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from eurobot_od.errors import UnknownName
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.scene.recording import NOTHING, Recording, Truth, record
from eurobot_od.robot.scene.sheet import PAGE, sheet
from eurobot_od.support import extras
from eurobot_od.support.files import write_whole
from eurobot_od.traffic.meaning import Decoder, Meaning


class SeenMatch(NamedTuple):
    """What was on the bus, with times in s, what its frames mean by `decoder`, the facts, and what else is known."""

    frames: Sequence[tuple[float, Meaning]]
    decoder: Decoder
    facts: Facts
    truth: Truth = NOTHING

    @property
    def recording(self) -> Recording:
        """What the messages tell."""
        messages = ((time, each.message) for time, each in self.frames if each.message is not None)
        return record(messages, self.truth)


def _renderer() -> ModuleType:
    """Return what makes pixels of SVG; raises LocalError without the extra that brings it."""
    with extras.needed("png"):
        import resvg_py
    return resvg_py


def _html(match: SeenMatch, title: str) -> bytes:
    from eurobot_od.bus.live import BITRATE
    from eurobot_od.robot.scene.panel import field_panel, true_path, truth_events
    from eurobot_od.web.page import Columns, page

    panels = [field_panel(match.facts)]
    columns = Columns(title, match.decoder, BITRATE, panels)
    for time, meaning in match.frames:
        columns.take(time, meaning)
    truth = match.truth.later(-(columns.start or 0.0))
    columns.add(truth_events(truth, match.facts))
    return page(title, [columns.data(true_path(truth))], panels).encode()


PNG = ".png"
"""The suffix of the one format that needs an extra."""

PICTURE_FORMATS: Mapping[str, Callable[[SeenMatch, str], bytes]] = {
    ".svg": lambda match, title: sheet(match.recording, match.facts, title).encode(),
    ".html": _html,
    # One pixel for each unit of the drawing: on an A4 page that is 360 to the inch.
    PNG: lambda match, title: bytes(
        _renderer().svg_to_bytes(svg_string=sheet(match.recording, match.facts, title), width=PAGE[0])
    ),
}


def form(file: Path) -> Callable[[SeenMatch, str], bytes]:
    """Return what makes the file of a match for its suffix.

    Raises UnknownName for a suffix of no format, LocalError for a PNG without the extra.
    """
    suffix = file.suffix.lower()
    if suffix not in PICTURE_FORMATS:
        raise UnknownName("picture format", file.suffix or file.name, PICTURE_FORMATS)
    if suffix == PNG:
        _renderer()  # complains before a match is played, not after it
    return PICTURE_FORMATS[suffix]


def save(match: SeenMatch, file: Path, title: str) -> None:
    """Draw a match into a file; raises UnknownName for its suffix, LocalError for a PNG without the extra."""
    write_whole(file, form(file)(match, title))
