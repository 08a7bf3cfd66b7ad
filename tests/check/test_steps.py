"""Steps on a bench whose device answers at once, or late: what came is looked at in its order, and once."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from eurobot_od.check.bench import SeenFrame, Trace
from eurobot_od.check.report import Status, SuiteResult
from eurobot_od.check.runner import Runner, RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from tests.kit.devices import MODULE, NODE_ID, read

HEAD = "spec: 1\nname: a suite\nnode: clean\nsteps:\n"


class AtOnce:
    """A bench whose device has answered, with all its frames in one turn, before `send` returns.

    `late` gives the seconds after which the answers to a request come instead.
    """

    def __init__(self, device: SimulatedDevice, late: Callable[[Frame], float] = lambda _: 0.0) -> None:
        self.trace = Trace()
        self._device = device
        self._late = late
        self._loop = asyncio.get_running_loop()

    async def begin(self) -> None:
        self._heard(self._device.start(self.trace.now))

    async def send(self, frame: Frame) -> float:
        answers = self._device.receive(frame, self.trace.now)
        while self._device.next_wakeup <= self.trace.now:
            answers += self._device.tick(self.trace.now)
        self._loop.call_later(late, self._heard, answers) if (late := self._late(frame)) else self._heard(answers)
        return self.trace.now

    def _heard(self, frames: list[Frame]) -> None:
        for each in frames:
            self.trace.add(SeenFrame(self.trace.now, each))

    async def recover(self) -> bool:
        return False


def run(steps: str, late: Callable[[Frame], float] = lambda _: 0.0) -> list[Status]:
    return [each.status for each in done(steps, late).steps]


def done(steps: str, late: Callable[[Frame], float] = lambda _: 0.0) -> SuiteResult:
    dictionary = Dictionary.load(MODULE, NODE_ID)
    (suite,) = read(dictionary, HEAD + "".join(f"  - {each}\n" for each in steps.split("\n")))

    async def main(suite: Suite) -> SuiteResult:
        return await Runner(suite, AtOnce(SimulatedDevice(dictionary), late), RunOptions(keep_going=True)).run(
            "at once"
        )

    return asyncio.run(main(suite))


def test_a_block_whose_segments_come_at_once_is_taken() -> None:
    result = done("sdo: {read: 0x1008, transfer: block}\nsdo: {read: 0x1017, expect: 500}")
    assert result.count(Status.PASSED) == 2
    assert result.seconds < 0.5  # with a segment overlooked it waits a second, and has it sent again


def test_a_late_answer_is_not_taken_for_one_to_the_next_question() -> None:
    late = {b"\x40\x08\x10": 0.15}
    steps = (
        "{sdo: {read: 0x1008}, within: 100 ms}\n"
        '{steps: [{send: {raw: "605#4017100000000000"}}, {expect: {raw: "585#4B171000F4010000"}}]}'
    )
    found = run(steps, lambda frame: late.get(frame.data[:3], 0.0))
    assert found == [Status.FAILED, Status.PASSED, Status.PASSED]


RESTORED = {
    # steps, and how they end: + green, - red, . skipped
    "as it is": ("sdo: {read: 0x1017, save: t}\nsdo: {restore: 0x1017, saved: t}", "++"),
    "changed": (
        "sdo: {read: 0x1017, save: t}\nsdo: {write: 0x1017, value: 300}\n{sdo: {restore: 0x1017, saved: t}}\n"
        "sdo: {read: 0x1017, expect: 500}",
        "++++",
    ),
    "another object's": ("sdo: {read: 0x1017, save: t}\nsdo: {restore: 0x1016:1, saved: t}", "+."),
    "bits set": ('sdo: {read: 0x1800:1, save: t}\nsdo: {write: 0x1800:1, value: "{t|0x80000000}"}', "++"),
    "unheard": ("unheard: 0x000", "+"),
    "heard": ("unheard: 0x705", "-"),
    "a boot-up": ("nmt: reset\nboot-up: awaited", "++"),
    "what a red step leaves undone": (
        "{steps: [{sdo: {read: 0x1017, save: t}}, {sdo: {write: 0x1017, value: 300}}, "
        '{expect: {raw: "123#"}, within: 1 ms}, '
        "{wait: 1 ms}, {sdo: {restore: 0x1017, saved: t}, undo: yes}]}\nsdo: {read: 0x1017, expect: 500}",
        "++-.++",
    ),
}
SIGNS = {Status.PASSED: "+", Status.FAILED: "-", Status.SKIPPED: "."}


@pytest.mark.parametrize(("steps", "ends"), RESTORED.values())
def test_a_kept_value_is_restored(steps: str, ends: str) -> None:
    assert "".join(SIGNS[each] for each in run(steps)) == ends
