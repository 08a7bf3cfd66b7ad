"""The picture of a match as a file: SVG, HTML or PNG by its suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.files import write_whole
from eurobot_od.robot.picture.page import page
from eurobot_od.robot.picture.picture import PAGE, picture
from eurobot_od.robot.picture.recording import Recording


def _png(recording: Recording, title: str) -> bytes:
    try:
        import resvg_py
    except ImportError:
        raise LocalError("a PNG needs the extra `png`: pip install 'eurobot-od[png]'") from None
    # One pixel for each unit of the drawing: on an A4 page that is 360 to the inch.
    return bytes(resvg_py.svg_to_bytes(svg_string=picture(recording, title), width=PAGE[0]))


PICTURE_FORMATS: Mapping[str, Callable[[Recording, str], bytes]] = {
    ".svg": lambda recording, title: picture(recording, title).encode(),
    ".html": lambda recording, title: page(recording, title).encode(),
    ".png": _png,
}


def form(file: Path) -> Callable[[Recording, str], bytes]:
    """Return what makes the picture for a file's suffix; raises UnknownName for a suffix of no format."""
    try:
        return PICTURE_FORMATS[file.suffix.lower()]
    except KeyError:
        raise UnknownName("picture format", file.suffix or file.name, PICTURE_FORMATS) from None


def save(recording: Recording, file: Path, title: str) -> None:
    """Draw a match into a file; raises UnknownName for its suffix, LocalError for a PNG without the extra."""
    write_whole(file, form(file)(recording, title))
