"""Benches for the robot's nodes; see also `harness` and `driving`."""

from __future__ import annotations

import pytest

from tests.robot.nodes.driving import ready
from tests.robot.nodes.harness import Bench


@pytest.fixture
def bench() -> Bench:
    """All three nodes, configured."""
    return ready()


@pytest.fixture
def half() -> Bench:
    """The core, and stand-ins for the others, configured."""
    return ready("drive", "navigation")


@pytest.fixture
def alone() -> Bench:
    """The core, and stand-ins for the others, not configured."""
    return Bench("drive", "navigation")
