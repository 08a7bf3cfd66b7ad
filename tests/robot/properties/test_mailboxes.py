"""Laws of the mailboxes: what leaves is in order, whatever is submitted, and nothing is lost without a word."""

from __future__ import annotations

from math import inf

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.controller import Report
from eurobot_od.frame import Frame
from eurobot_od.robot.gatekeeper import Mailboxes

WAIT = 5.0

# One after the other: a frame of a COB-ID is submitted, seconds pass, mailboxes are loaded, a mailbox is done.
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("submit"), st.integers(0, 4)),
        st.tuples(st.just("pass"), st.integers(0, 3)),
        st.tuples(st.just("load"), st.just(0)),
        st.tuples(st.just("complete"), st.integers(0, 31)),
    ),
    max_size=60,
)


class Bench:
    """Mailboxes under test beside a plain record of what must be in them; frames are numbered in their data."""

    def __init__(self, count: int) -> None:
        self.reports: list[Report] = []
        self.boxes = Mailboxes(self.reports.append, count, WAIT)
        self.count = count
        self.now = 0.0
        self.submitted: list[Frame] = []
        self.waiting: dict[Frame, float] = {}
        """Until when each frame may wait: without end if a mailbox was free for it."""
        self.loaded: list[Frame] = []
        self.done: list[Frame] = []
        self.dropped = 0

    def submit(self, cob_id: int) -> None:
        frame = Frame(cob_id, len(self.submitted).to_bytes(2, "big"))
        self.boxes.submit(frame, self.now)
        full = len(self.loaded) + len(self.waiting) >= self.count
        self.submitted.append(frame)
        self.waiting[frame] = self.now + WAIT if full else inf

    def pass_(self, seconds: int) -> None:
        self.now += seconds

    def load(self, _: int) -> None:
        loaded = self.boxes.load(self.now)
        in_time = sorted(frame for frame, until in self.waiting.items() if self.now < until)
        self.dropped += len(self.waiting) - len(in_time)
        free = self.count - len(self.loaded)
        assert loaded == in_time[:free]  # a frame sorts by COB-ID, then by its number
        self.waiting = {frame: min(self.waiting[frame], self.now + WAIT) for frame in in_time[free:]}
        self.loaded += loaded

    def complete(self, place: int) -> None:
        if place < len(self.loaded):
            self.done.append(self.loaded.pop(place))
            assert self.boxes.complete(self.done[-1])

    def check(self) -> None:
        counts = self.boxes.statistics()
        assert counts.submitted == counts.completed + counts.dropped + counts.waiting + counts.loaded
        assert (counts.completed, counts.dropped, counts.loaded) == (len(self.done), self.dropped, len(self.loaded))
        assert len(self.reports) == self.dropped
        assert self.boxes.urgent() == min(self.loaded, default=None)
        assert self.boxes.next_expiry == min(self.waiting.values(), default=inf)


def run(bench: Bench, steps: list[tuple[str, int]]) -> None:
    actions = {"submit": bench.submit, "pass": bench.pass_, "load": bench.load, "complete": bench.complete}
    for action, argument in steps:
        actions[action](argument)
        bench.check()


@given(st.integers(1, 4), STEPS)
def test_mailboxes_hold_the_most_urgent_frames_and_counts_add_up(count: int, steps: list[tuple[str, int]]) -> None:
    run(Bench(count), steps)


@given(st.integers(1, 4), STEPS)
def test_everything_leaves_but_the_expired(count: int, steps: list[tuple[str, int]]) -> None:
    bench = Bench(count)
    run(bench, steps)
    bench.load(0)
    while bench.loaded:
        bench.complete(0)
        bench.load(0)
    bench.check()
    assert len(bench.done) + bench.dropped == len(bench.submitted)
    assert len(set(bench.done)) == len(bench.done)


@given(st.integers(1, 4), st.lists(st.integers(0, 4), max_size=40))
def test_the_controller_sends_equal_identifiers_in_the_order_submitted(count: int, cob_ids: list[int]) -> None:
    bench = Bench(count)
    for cob_id in cob_ids:
        bench.submit(cob_id)
    bench.load(0)
    order: list[Frame] = []
    while (frame := bench.boxes.urgent()) is not None:
        order.append(frame)
        bench.complete(bench.loaded.index(frame))
        bench.load(0)
    assert order == sorted(bench.submitted)
