"""The watchdog leaves the program as it found it; what it ends is tested with strategies that hang."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from types import FrameType

import pytest

from eurobot_od.live.watchdog import Watchdog

if not hasattr(signal, "SIGURG"):
    pytest.skip("no SIGURG here", allow_module_level=True)


def own(_signal: int, _frame: FrameType | None) -> None:
    """A program's own handler."""


@pytest.fixture
def _own_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGURG, own)
    yield
    signal.signal(signal.SIGURG, before)


@pytest.mark.usefixtures("_own_handler")
def test_a_programs_own_handler_is_back_at_the_end() -> None:
    with Watchdog(lambda: True):
        assert signal.getsignal(signal.SIGURG) is not own
    assert signal.getsignal(signal.SIGURG) is own
