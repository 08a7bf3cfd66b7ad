"""The bench's trace: a frame has the time at which it came, and none is said not to have come before all are read."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import pytest

from eurobot_od.check.actions.frames import Period
from eurobot_od.check.bench import BEHIND, SeenFrame, Trace
from eurobot_od.check.on_bus import Arrivals
from eurobot_od.check.suite import FramePattern
from eurobot_od.check.tester import BenchTester, Failed
from eurobot_od.frame import Frame
from tests.kit.devices import MODULE, suites

HEARTBEAT = Frame(0x705, b"\x05")

STAMPED = {
    # the driver's stamps, when the frames were read, and when they came: in s
    "read at once": ([100.0, 100.1, 100.2], [7.0, 7.1, 7.2], [7.0, 7.1, 7.2]),
    "the second and third read late": ([100.0, 100.1, 100.2], [7.0, 7.25, 7.25], [7.0, 7.1, 7.2]),
    "the first read late": ([100.0, 100.1, 100.2], [7.05, 7.1, 7.2], [7.05, 7.1, 7.2]),
    "no stamps": ([0.0, 0.0], [7.0, 7.2], [7.0, 7.2]),
    "the driver's clock set back": ([100.0, 40.0, 40.1], [7.0, 7.1, 7.3], [7.0, 7.1, 7.2]),
    "the driver's clock set forward": ([100.0, 200.0, 200.1], [7.0, 7.1, 7.3], [7.0, 7.1, 7.2]),
}


@pytest.mark.parametrize("case", STAMPED)
def test_a_frame_has_the_time_of_its_arrival_however_late_it_is_read(case: str) -> None:
    stamps, read, came = STAMPED[case]
    arrivals = Arrivals()
    assert [arrivals.time(*each) for each in zip(stamps, read, strict=True)] == pytest.approx(came, abs=1e-3)


def first(act: Callable[[Trace, float], object]) -> int | None:
    """Return the frame that is found by a time that is over, where something happens a moment later."""

    async def main() -> int | None:
        trace = Trace()
        now = trace.now
        trace.read_to = now - 1
        asyncio.get_running_loop().call_soon(act, trace, now)
        return await trace.first(frozenset({0x705}), 0, now)

    return asyncio.run(main())


def test_a_frame_that_came_in_time_is_found_though_it_is_read_afterwards() -> None:
    assert first(lambda trace, now: trace.add(SeenFrame(now - 0.001, HEARTBEAT))) == 0


def test_a_missing_frame_is_reported_after_all_frames_up_to_then_are_read() -> None:
    assert first(lambda trace, now: trace.caught_up(now + 0.001)) is None
    assert first(lambda trace, now: trace.add(SeenFrame(now + 0.001, HEARTBEAT))) is None


# Periods


class Recorded:
    """A bench on which heartbeats have come at some times, with a tester that was late itself."""

    def __init__(self, times: Sequence[float], late: float) -> None:
        class LateTrace(Trace):
            @contextmanager
            def lateness(self) -> Iterator[Callable[[], float]]:
                yield lambda: late

        self.trace: Trace = LateTrace()
        for each in times:
            self.trace.add(SeenFrame(each, HEARTBEAT))

    async def begin(self) -> None:
        pass

    async def send(self, frame: Frame) -> float:
        raise NotImplementedError(frame)

    async def recover(self) -> bool:
        return False


def measured(distances: Sequence[float], late: float, worst: float | None = None) -> str:
    """Return what is said of heartbeats that are to come each 0.1 s, give or take 0.02 s."""
    times = [sum(distances[:number]) for number in range(len(distances) + 1)]

    async def main() -> str:
        bench = Recorded(times, late)
        tester = BenchTester(BEHIND, suites(MODULE)[0].decoder, bench, set())
        tester.edge = 0
        period = Period(FramePattern(0x705, "??"), 0.1, 0.02, len(distances), worst)
        try:
            await period.run(tester)
        except Failed as failed:
            return ", ".join(each.what for each in failed.reason.mismatches) or failed.reason.what
        return tester.remark

    return asyncio.run(main())


LATE = "705#?? every 100 ms +- 20 ms: at the worst 135 ms (the tester itself was late by up to 30 ms)"
HEARTBEATS = {
    # distances between heartbeats, how late the tester was, and what is said
    "in time": ([0.1, 0.11, 0.09, 0.1, 0.115], 0.0, ""),
    "one late": ([0.1, 0.135, 0.1, 0.1, 0.1], 0.0, "period 2"),
    "one late by a tester that was late": ([0.1, 0.135, 0.1, 0.1, 0.1], 0.03, LATE),
    "all late": ([0.125] * 5, 0.0, "median, period 1"),
    "all late though the tester was": ([0.125] * 5, 0.03, "median"),
    "every other left out": ([0.21, 0.2, 0.2, 0.2, 0.2], 0.03, "median, period 1"),
    "one left out": ([0.1, 0.1, 0.3], 0.1, "no 705#?? within 220 ms, after 3 of them"),
}


@pytest.mark.parametrize("case", HEARTBEATS)
def test_a_period_is_judged_by_its_median_and_its_worst_and_the_testers_own_lateness(case: str) -> None:
    distances, late, said = HEARTBEATS[case]
    assert measured(distances, late) == said


SHOWN = "705#?? every 100 ms +- 20 ms: at the worst {}"


@pytest.mark.parametrize(("late", "said"), [(0.19, SHOWN.format("190 ms")), (0.21, "period 2")])
def test_one_distance_may_be_off_by_more_where_the_suite_says_so(late: float, said: str) -> None:
    assert measured([0.1, late, 0.1, 0.1, 0.1], 0.0, worst=0.1) == said
