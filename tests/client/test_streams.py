"""What comes again and again: an iterator that is behind keeps the newest, and counts what it has dropped."""

from __future__ import annotations

import pytest

from eurobot_od.client import streams
from eurobot_od.client.streams import BlockingStream
from tests.client.wired import wired


def test_an_iterator_that_is_behind_has_the_newest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "BACKLOG", 2)
    with wired() as master:
        stream = BlockingStream[int](master, "TPDO1", 5)
        reader = iter(stream)
        for number in range(4):
            stream.push(number)
        assert (next(reader), next(reader), reader.lost) == (2, 3, 2)
