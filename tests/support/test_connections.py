"""Pauses that grow, and start from the shortest when all was well for a while."""

from __future__ import annotations

from eurobot_od.support.connections import FIRST_PAUSE, LONGEST_PAUSE, STEADY, Backoff


def test_pauses_are_doubled_up_to_the_longest_and_start_again_after_a_steady_time() -> None:
    backoff, now, pauses = Backoff(), 0.0, []
    for _ in range(8):
        pauses.append(backoff.pause(now))
        now += pauses[-1]
    assert pauses == [min(FIRST_PAUSE * 2**doublings, LONGEST_PAUSE) for doublings in range(8)]
    assert backoff.pause(now + STEADY) == FIRST_PAUSE
