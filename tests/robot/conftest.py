"""EDS files of the robot, copied and spoilt in one place."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.eds_text import with_entry

EDS = Path(__file__).parents[2] / "eds"


@pytest.fixture
def spoil_eds(tmp_path: Path) -> Callable[..., Path]:
    """Copies the EDS files of `dialect` and changes entries (node, section, key, value); gives their new folder."""

    def spoil(*changes: tuple[str, str, str, str | None], dialect: str = "canopen") -> Path:
        folder = Path(mkdtemp(dir=tmp_path), "eds")
        shutil.copytree(EDS / dialect, folder)
        for node, section, key, value in changes:
            file = folder / f"{node}.eds"
            file.write_text(with_entry(file.read_text(), section, key, value))
        return folder

    return spoil
