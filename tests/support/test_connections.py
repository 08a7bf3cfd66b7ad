"""Pauses that grow, and start from the shortest when all was well for a while."""

from __future__ import annotations

from eurobot_od.support.connections import FIRST_PAUSE, STEADY, Backoff


def test_pauses_are_doubled_up_to_the_longest_and_start_again_after_a_steady_time() -> None:
    backoff, now, pauses = Backoff(), 0.0, []
    for _ in range(8):
        pauses.append(backoff.pause(now))
        now += pauses[-1]
    assert pauses == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]  # as docs/safety.md says
    assert backoff.pause(now + STEADY) == FIRST_PAUSE
