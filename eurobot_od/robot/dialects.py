"""The dialects of the robot of 2014: the folders of `eds/`.

No other module names a dialect or a folder.
"""

from __future__ import annotations

from pathlib import Path

from eurobot_od.od import Dialects


def eds_folder() -> Path:
    """Return the folder of the dialects: in an installed package, or next to the package in a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "eds"
    return inside if inside.is_dir() else package.parent / "eds"


DEFAULT = "canopen"
"""Bits in CiA 301 order."""

DIALECTS = Dialects(eds_folder(), DEFAULT)

names = DIALECTS.names
folder = DIALECTS.folder
load = DIALECTS.load
load_all = DIALECTS.load_all
