"""Response times: the paper's example, small cases worked out by hand, every phasing of small sets, another program."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.traffic.load import HORIZON, INSTANCES, Analysis, ErrorRate, PeriodicMessage
from tests.traffic.sets import FAR, message, sets


def responses(analysis: Analysis) -> list[int | None]:
    return [each.response for each in analysis.bounds]


# Davis, Burns, Bril, Lukkien 2007: frames of 1 ms on a bus of 125 kbit/s, periods 2.5, 3.5 and 3.5 ms; here
# in hundredths of a millisecond.
PAPER = [message(1, 100, 250), message(2, 100, 350), message(3, 100, 350)]


def test_the_example_of_the_paper() -> None:
    analysis = Analysis(PAPER)
    assert responses(analysis) == [200, 300, 350]
    assert analysis.load == Fraction(34, 35)


def test_the_second_instance_is_the_later_one() -> None:
    """The test of 1994 looks at the first only, and says 300: its busy period is 700 long, and holds two."""
    assert [each.busy for each in Analysis(PAPER).bounds] == [200, 500, 700]


BY_HAND = [
    ("alone", [message(1, 100, 1000)], [100]),
    ("blocked by the longest", [message(1, 55, 1000), message(2, 65, 1000), message(3, 135, 1000)], [190, 255, 255]),
    ("late by its jitter", [message(1, 100, 1000, jitter=30)], [130]),
    # two of the first, 900 apart at least and 1000 - 950 at worst, before the second
    ("two at once", [message(1, 100, 1000, jitter=950), message(2, 100, 2000)], [1150, 300]),
    # at 150 the first comes again, within the first bit of the arbitration, and still takes part
    (
        "released with the arbitration",
        [message(1, 50, 150), message(2, 100, FAR), message(3, 50, FAR)],
        [150, 200, 250],
    ),
    (
        "equal identifiers wait for each other",
        [message(1, 100, 1000, node="a"), message(1, 60, 1000, node="b")],
        [160, 160],
    ),
]


@pytest.mark.parametrize(("found", "expected"), [row[1:] for row in BY_HAND], ids=[row[0] for row in BY_HAND])
def test_small_sets(found: list[PeriodicMessage], expected: list[int]) -> None:
    assert responses(Analysis(found)) == expected


def test_the_blocking_message_is_named() -> None:
    bounds = Analysis([message(1, 55, 1000), message(2, 65, 1000), message(3, 135, 1000)]).bounds
    assert [each.blocking for each in bounds] == [2, 2, None]


# Mailboxes: of node a, the three less urgent ones fill three mailboxes; node b is between them.
CROWDED = [
    message(1, 55, 10_000, node="a"),
    message(2, 100, 10_000, node="b"),
    *(message(rank, 135, 10_000, node="a") for rank in (3, 4, 5)),
]
INVERSIONS = [
    (4, None, 190),  # enough of them: only the frame on the bus is waited for
    (3, 2, 190 + 370),  # a frame on the bus, that of node b, and the first of the three, before there is a mailbox
    (2, 3, 190 + 370),  # the less urgent of two that can wait as long is named
    (1, 3, 190 + 370),
]


@pytest.mark.parametrize(("count", "inversion", "response"), INVERSIONS)
def test_full_mailboxes_keep_an_urgent_message_waiting(count: int, inversion: int | None, response: int) -> None:
    bound = Analysis(CROWDED, mailboxes={"a": count}).bounds[0]
    assert (bound.inversion, bound.response) == (inversion, response)


def test_the_wait_for_a_mailbox_is_jitter_for_others() -> None:
    """What waits for a mailbox can come just before its next instance, and so twice before a less urgent one."""
    quick = message(1, 55, 560, node="a")
    free, crowded = (Analysis([quick, *CROWDED[1:]], mailboxes=boxes).bounds[1] for boxes in ({}, {"a": 3}))
    assert (free.response, crowded.response) == (290, 345)


def test_an_answer_comes_after_what_it_answers() -> None:
    request = message(1, 55, 10_000)._replace(name="request")
    answer = message(2, 65, 10_000, jitter=500)._replace(answers="request")
    assert responses(Analysis([request, answer])) == [120, 120 + 500 + 55 + 65]


def test_an_error_costs_the_recovery_and_the_longest_frame_again() -> None:
    found = [message(1, 55, 10_000), message(2, 65, 10_000)]
    assert responses(Analysis(found, ErrorRate(1, 5000))) == [120 + 31 + 55, 120 + 31 + 65]
    assert responses(Analysis(found, ErrorRate(2, 5000))) == [120 + 2 * (31 + 55), 120 + 2 * (31 + 65)]


def test_errors_within_a_time() -> None:
    assert [ErrorRate(2, 100).within(time) for time in (0, 1, 100, 101, 200)] == [0, 2, 2, 4, 4]


# No bound

ENDLESS = [
    ("over the bus", [message(1, 100, 90)]),
    ("exactly the bus", [message(1, 100, 200), message(2, 100, 200)]),
    ("a jitter over the horizon", [message(1, 100, HORIZON, jitter=HORIZON + 1)]),
    ("more instances at once than are looked at", [message(1, 100, 1000, jitter=INSTANCES * 1000)]),
]


@pytest.mark.parametrize("found", [row[1] for row in ENDLESS], ids=[row[0] for row in ENDLESS])
def test_there_may_be_no_bound(found: list[PeriodicMessage]) -> None:
    assert responses(Analysis(found))[-1] is None


def test_errors_may_fill_the_bus() -> None:
    assert responses(Analysis([message(1, 55, 10_000)], ErrorRate(1, 50))) == [None]


def test_messages_more_urgent_than_an_overload_are_bounded() -> None:
    assert responses(Analysis([message(1, 55, 1000), message(2, 135, 130)])) == [190, None]


def test_an_answer_to_what_has_no_bound_has_none() -> None:
    found = [message(1, 55, 1000)._replace(answers="endless"), message(2, 135, 130)._replace(name="endless")]
    assert responses(Analysis(found)) == [None, None]


def test_near_the_full_bus_it_ends_as_well() -> None:
    found = [message(rank, 135, 135 * 20) for rank in range(19)] + [message(20, 135, 2701)]
    assert responses(Analysis(found))[-1] is not None


# Every phasing of small sets


def simulated(
    found: list[PeriodicMessage], phases: tuple[int, ...], just_after: tuple[bool, ...], span: int
) -> list[int]:
    """Return the longest response times on a bus that looks for the most urgent message in every bit time.

    What is released `just_after` the beginning of a bit time is too late for its arbitration, unless the bus is free.
    """
    waiting: list[list[int]] = [[] for _ in found]
    longest, free = [0] * len(found), 0
    for now in range(span):
        for late in (False, True):
            for n, each in enumerate(found):
                if just_after[n] is late and now >= phases[n] and (now - phases[n]) % each.period == 0:
                    waiting[n].append(now)
            if now >= free and any(waiting):
                n = next(n for n, dues in enumerate(waiting) if dues)
                free = now + found[n].bits
                longest[n] = max(longest[n], free - waiting[n].pop(0))
    return longest


SMALL = [
    [message(0, 2, 5), message(1, 2, 7), message(2, 2, 7)],  # the paper's example, 50 times as short
    [message(0, 1, 4), message(1, 3, 9), message(2, 2, 10)],
    [message(0, 3, 11), message(1, 1, 4), message(2, 2, 8)],  # not in the order of their periods
    [message(0, 4, 12), message(1, 2, 6), message(2, 1, 5)],
]


@pytest.mark.parametrize("found", SMALL)
def test_no_phasing_is_later_than_the_bound_and_one_is_as_late(found: list[PeriodicMessage]) -> None:
    seen = [0] * len(found)
    for phases in product(*(range(each.period) for each in found)):
        for just_after in product((False, True), repeat=len(found)):
            seen = [max(pair) for pair in zip(seen, simulated(found, phases, just_after, 80))]
    assert seen == responses(Analysis(found))


# Another program: response-time-analysis, of the verified PROSA school


def by_the_package(found: list[PeriodicMessage]) -> Iterator[int | None]:
    """Yield what the package says: the longest time from a release to the end, not from when a message falls due."""
    fp, model = (pytest.importorskip(f"response_time_analysis{name}") for name in (".analysis.fp", ".model"))
    tasks = [
        model.Task(
            model.PeriodicWithJitter(each.period, each.jitter) if each.jitter else model.Periodic(each.period),
            model.FullyNonPreemptive(model.WCET(each.bits)),
            model.Deadline(FAR),
            model.Priority(len(found) - rank),
        )
        for rank, each in enumerate(found)
    ]
    together = model.taskset(*tasks)
    for task in tasks:
        yield fp.rta(together, task, model.IdealProcessor(), horizon=HORIZON).response_time_bound


class BegunABitEarlier(Analysis):
    """Counts of a less urgent frame only what is left after its first bit."""

    @property
    def levels(self) -> tuple[object, ...]:  # type: ignore[override]  # computed once there
        return tuple(each._replace(blocked=max(each.blocked - 1, 0)) for each in super().levels)


def test_the_package_lets_a_less_urgent_frame_begin_one_unit_before_the_release() -> None:
    """So it says 199, 299, 350 where the paper has 200, 300, 350, and in hundredths of the unit 199.99.

    In the package's discrete time a frame blocks only if it began at least one unit before; in the paper's continuous
    time it may have begun just now. Both are right; what differs is how much of the first unit is counted. The least
    urgent message is never blocked, and has the same time in both.
    """
    assert list(by_the_package(PAPER)) == [199, 299, 350]
    finer = [message(n, 10_000, period) for n, period in enumerate((25_000, 35_000, 35_000))]
    assert list(by_the_package(finer)) == [19_999, 29_999, 35_000]


@given(sets)
def test_bounds_agree_with_another_package_to_one_bit(found: list[PeriodicMessage]) -> None:
    analysis = BegunABitEarlier(found)
    if analysis.load < Fraction(9, 10):  # nearer to a full bus the package takes its time
        assert [each.waiting for each in analysis.bounds] == list(by_the_package(found))


# Laws


def none_is_earlier(before: Analysis, after: Analysis) -> bool:
    pairs = zip(responses(before), responses(after))
    return all(late is None or (early is not None and early <= late) for early, late in pairs)


mailbox_counts = st.dictionaries(st.sampled_from(("a", "b")), st.integers(1, 3))
error_rates = st.builds(ErrorRate, st.integers(0, 2), st.integers(1000, 20_000))
CHANGES = {
    "bits": lambda each: each._replace(bits=each.bits + 10),
    "period": lambda each: each._replace(period=max(each.period * 9 // 10, 1)),
    "jitter": lambda each: each._replace(jitter=each.jitter + 50),
}


@given(found=sets, boxes=mailbox_counts, errors=error_rates, data=st.data())
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_more_traffic_makes_nothing_earlier(
    found: list[PeriodicMessage], boxes: dict[str, int], errors: ErrorRate, data: st.DataObject, change: object
) -> None:
    place = data.draw(st.integers(0, len(found) - 1))
    more = [change(each) if n == place else each for n, each in enumerate(found)]  # type: ignore[operator]
    assert none_is_earlier(Analysis(found, errors, boxes), Analysis(more, errors, boxes))


@given(sets, mailbox_counts, error_rates, st.integers(0, 7))
def test_a_further_message_makes_nothing_earlier(
    found: list[PeriodicMessage], boxes: dict[str, int], errors: ErrorRate, place: int
) -> None:
    """Wherever it stands: as a more urgent one it comes before, as a less urgent one it blocks and fills mailboxes."""
    ranks = [2 * n for n in range(len(found))]
    apart = [each._replace(identifier=rank) for each, rank in zip(found, ranks)]
    more = [*apart, message(2 * min(place, len(found)) - 1, 135, 4000, node="a")]
    assert none_is_earlier(Analysis(apart, errors, boxes), Analysis(more, errors, boxes))


@pytest.mark.long
@given(sets, error_rates)
def test_mailboxes_and_errors_make_nothing_earlier(found: list[PeriodicMessage], errors: ErrorRate) -> None:
    plain = Analysis(found)
    assert none_is_earlier(plain, Analysis(found, errors))
    assert none_is_earlier(Analysis(found, mailboxes={"a": 3}), Analysis(found, mailboxes={"a": 2}))
    assert none_is_earlier(plain, Analysis(found, mailboxes={"a": 3}))


@given(sets)
def test_a_bound_is_at_least_the_frame_and_its_jitter(found: list[PeriodicMessage]) -> None:
    for each, bound in zip(found, Analysis(found).bounds):
        assert bound.response is None or bound.response >= each.jitter + each.bits
