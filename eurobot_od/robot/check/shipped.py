"""The suites that come with the package, by the names of their files, and the networks that suites may be for."""

from __future__ import annotations

from pathlib import Path

from eurobot_od.check.vocabulary import Networks
from eurobot_od.errors import UnknownName
from eurobot_od.robot import dialects
from eurobot_od.robot.messages import CATALOGUE

NETWORKS = Networks(dialects.folder, CATALOGUE)
"""The dialects, and any folder of EDS files."""

FOLDER = Path(__file__).parent / "suites"


def shipped_suites() -> dict[str, Path]:
    """Return the files of the shipped suites by name."""
    return {file.stem: file for file in sorted(FOLDER.glob("*.yaml"))}


def find(text: str) -> Path:
    """Return the file that is meant by a path or by a shipped suite's name; raises UnknownName for neither."""
    shipped = shipped_suites()
    if text in shipped and not Path(text).is_file():
        return shipped[text]
    if not Path(text).is_file() and Path(text).suffix not in (".yaml", ".yml"):
        raise UnknownName("suite", text, shipped)
    return Path(text)
