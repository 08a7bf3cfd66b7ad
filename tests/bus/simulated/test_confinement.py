"""Error counters and states, rule by rule (ISO 11898-1, fault confinement)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus.simulated.confinement import FRESH, RECEIVE_LIMIT, STEPS, Counters, CountingRule, ErrorState

RULES = [
    # What happens; the counters before and after it; why
    (CountingRule.RECEIVER_ERROR, (0, 0), (0, 1), "a receiver is not the likely culprit"),
    (CountingRule.RECEIVER_ERROR, (5, 127), (5, 128), "the transmit counter is a transmitter's"),
    (
        CountingRule.RECEIVER_DOMINANT_AFTER_FLAG,
        (0, 1),
        (0, 9),
        "the others flagged later: it saw the error first",
    ),
    (CountingRule.TRANSMITTER_ERROR, (0, 0), (8, 0), "a transmitter is the likely culprit"),
    (CountingRule.TRANSMITTER_ERROR, (120, 3), (128, 3), "the receive counter is a receiver's"),
    (CountingRule.TRANSMITTER_FLAG_ERROR, (8, 0), (16, 0), "its dominant bits do not get through"),
    (CountingRule.RECEIVER_FLAG_ERROR, (0, 1), (0, 9), "its dominant bits do not get through"),
    (CountingRule.TRANSMITTER_STUCK, (16, 0), (24, 0), "the bus is stuck dominant"),
    (CountingRule.RECEIVER_STUCK, (0, 9), (0, 17), "the bus is stuck dominant"),
    (CountingRule.TRANSMITTED, (8, 4), (7, 4), "one frame makes up for an eighth of an error"),
    (CountingRule.TRANSMITTED, (0, 0), (0, 0), "no counter is below zero"),
    (CountingRule.RECEIVED, (3, 5), (3, 4), "one frame makes up for one error"),
    (CountingRule.RECEIVED, (0, 0), (0, 0), "no counter is below zero"),
    (CountingRule.RECEIVED, (0, 127), (0, 126), "error active: one less"),
    (CountingRule.RECEIVED, (0, 128), (0, 127), "error passive: to between 119 and 127"),
    (CountingRule.RECEIVED, (0, 200), (0, 127), "error passive: to between 119 and 127, from wherever it was"),
    (CountingRule.RECEIVER_STUCK, (0, 250), (0, 255), "eight bits hold no more"),
]


@pytest.mark.parametrize(("rule", "before", "after", "_why"), RULES)
def test_what_a_rule_counts(rule: CountingRule, before: tuple[int, int], after: tuple[int, int], _why: str) -> None:
    assert Counters(*before).after(rule) == Counters(*after)


def test_every_rule_has_a_case() -> None:
    assert {rule for rule, *_ in RULES} == set(CountingRule) == set(STEPS)


STATES = [
    ((0, 0), ErrorState.ACTIVE),
    ((127, 127), ErrorState.ACTIVE),
    ((128, 0), ErrorState.PASSIVE),
    ((0, 128), ErrorState.PASSIVE),
    ((255, 0), ErrorState.PASSIVE),
    ((0, 255), ErrorState.PASSIVE),  # who only listens never goes off
    ((256, 0), ErrorState.OFF),
]


@pytest.mark.parametrize(("counters", "state"), STATES)
def test_what_state_counters_mean(counters: tuple[int, int], state: ErrorState) -> None:
    assert Counters(*counters).state is state


@given(st.lists(st.sampled_from(CountingRule), max_size=100))
def test_counters_never_go_below_zero(rules: list[CountingRule]) -> None:
    counters = FRESH
    for rule in rules:
        counters = counters.after(rule)
        assert min(counters) >= 0


@given(st.lists(st.sampled_from([rule for rule, step in STEPS.items() if step.receive]), max_size=100))
def test_who_only_receives_never_goes_bus_off(rules: list[CountingRule]) -> None:
    counters = FRESH
    for rule in rules:
        counters = counters.after(rule)
    assert counters.state is not ErrorState.OFF
    assert counters.receive <= RECEIVE_LIMIT
