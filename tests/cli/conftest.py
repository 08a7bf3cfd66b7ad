"""The robot of these tests is the packaging line of the kit, as a user names one's own; `--robot` names another."""

from __future__ import annotations

import pytest

from eurobot_od.loading import ROBOTS
from tests.kit import plant


@pytest.fixture(autouse=True)
def _line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use the packaging line as the robot of the command line, in processes of their own too."""
    monkeypatch.setenv(ROBOTS.variable, str(plant.HERE))
