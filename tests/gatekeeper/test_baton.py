"""The baton: of a holder and whoever takes it out of a call, exactly one goes on, also with real threads."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from eurobot_od.gatekeeper.baton import Baton, Call

PATIENCE = 10.0
"""Seconds after which a test that hangs fails."""

CALLS = 5000
"""Calls in which a holder may lose its baton, or not."""

CALL: Call = ("listener", 1.0)


def held(call: Call | None = CALL) -> Baton:
    """Return a baton whose holder is in a call."""
    baton = Baton()
    baton.call = call
    return baton


def test_a_call_is_taken_once() -> None:
    baton = held()
    assert [baton.take(CALL), baton.take(CALL)] == [True, False]


def test_who_has_lost_the_baton_finds_it_claimed_and_gone() -> None:
    baton = held()
    baton.take(CALL)
    baton.call = None
    assert (baton.claimed, baton.lost()) == (True, True)


# What the holder is at, which is not the call that is to be taken.
OTHERS: dict[str, Call | None] = {
    "it has ended": None,
    "another call is under way": ("listener", 2.0),
    "another one that only looks the same": (*CALL,),
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_after_a_vain_attempt_the_holder_goes_on_and_can_lose_the_call_it_is_in(other: Call | None) -> None:
    baton = held(other)
    assert not baton.take(CALL)
    assert (baton.claimed, baton.lost()) == (False, False)
    baton.call = CALL
    assert baton.take(CALL)


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_what_is_lost_stays_lost(other: Call | None) -> None:
    baton = held()
    baton.take(CALL)
    baton.call = other
    assert not baton.take(CALL)
    assert (baton.claimed, baton.lost()) == (True, True)


class LookedAt(Baton):
    """A baton that calls `seen` whenever someone looks at its call."""

    def __init__(self, call: Call | None, seen: Callable[[Baton], object]) -> None:
        super().__init__()
        self.call, self.seen = call, seen

    def __getattribute__(self, name: str) -> Any:
        if name == "call":
            self.seen(self)
        return super().__getattribute__(name)


@pytest.mark.parametrize("other", [CALL, *OTHERS.values()], ids=["it is under way", *OTHERS])
def test_a_call_that_ends_behind_the_look_at_it_finds_the_baton_claimed(other: Call | None) -> None:
    claimed: list[bool] = []
    baton = LookedAt(other, lambda baton: claimed.append(baton.claimed))
    baton.take(CALL)
    assert claimed == [True]


@pytest.mark.parametrize("other", [CALL, *OTHERS.values()], ids=["it is under way", *OTHERS])
def test_a_holder_who_asks_in_the_midst_of_an_attempt_is_told_how_it_ends(other: Call | None) -> None:
    told: list[bool] = []
    holder = threading.Thread(target=lambda: told.append(baton.lost()))
    baton = LookedAt(other, lambda _: holder.start())
    taken = baton.take(CALL)
    holder.join(PATIENCE)
    assert told == [taken]


# Real threads


@pytest.fixture
def _restless() -> Iterator[None]:
    """Have threads take turns as often as Python lets them."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def listener(*_: object) -> None:
    """What is called, and returns."""


@pytest.mark.usefixtures("_restless")
@pytest.mark.parametrize("attempt", range(50))
def test_whoever_is_first_exactly_one_of_holder_and_taker_goes_on_behind_each_call(attempt: int) -> None:
    baton, taken, lost = Baton(), list[Call](), list[Call]()

    def hold() -> None:
        for number in range(CALLS):
            baton.call = call = ("listener", number)
            listener(*call)
            baton.call = None
            if baton.claimed and baton.lost():
                lost.append(call)
                return

    holder = threading.Thread(target=hold)
    holder.start()
    while holder.is_alive() and not taken:
        call = baton.call
        for _ in range(attempt * 100):
            listener()  # a little later each time
        if call is not None and baton.take(call):
            taken.append(call)
    holder.join(PATIENCE)
    assert lost == taken
