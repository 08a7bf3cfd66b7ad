"""SDO steps against a lift whose answers are damaged on their way: each is reported as what it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import count

import pytest

from eurobot_od.check.on_bus import run_simulated
from eurobot_od.check.report import Status, StepReason
from eurobot_od.check.runner import RunOptions
from eurobot_od.device.faults import leaving, sdo_answer
from eurobot_od.frame import Frame
from eurobot_od.plugin import Plugins
from tests.check.suites import document, results, run, suite
from tests.kit import plant


def reason(step: str, change: Callable[[bytes], bytes | None]) -> tuple[StepReason, list[str]]:
    """Return why a step is red when the lift's answers are changed or lost, and what the tester sent."""

    def changed(_: object, frame: Frame) -> Iterable[Frame]:
        data = change(frame.data)
        return [] if data is None else [Frame(frame.cob_id, data)]

    broken = type("Broken", (leaving(sdo_answer, changed), plant.NODES["lift"]), {})
    robot = plant.PLANT._replace(nodes={**plant.PLANT.nodes, "lift": lambda: broken})
    (result,) = run_simulated(suite(document(step)), RunOptions(), Plugins(robot).under_test).steps
    assert result.reason is not None
    return result.reason, [str(line.frame) for line in result.reason.frames if line.own]


def test_a_step_with_a_time_of_its_own_is_asked_once() -> None:
    verdicts = []
    for step in ("- sdo: {read: 0x1017}", "- {sdo: {read: 0x1017}, within: 100 ms}"):
        answers = count()

        def first_is_lost(_: object, frame: Frame, answers: Iterator[int] = answers) -> Iterable[Frame]:
            return [frame] if next(answers) else []

        broken = type("Broken", (leaving(sdo_answer, first_is_lost), plant.NODES["lift"]), {})
        robot = plant.PLANT._replace(nodes={**plant.PLANT.nodes, "lift": partial(type, "Broken", (broken,), {})})
        result = run_simulated(suite(document(step)), RunOptions(), Plugins(robot).under_test)
        verdicts.append((result.steps[0].status, result.asked_again))
    assert verdicts == [(Status.PASSED, 1), (Status.FAILED, 0)]


FORMS = {
    # bytes, of any type, as they are and from a variable
    "bytes": ('- sdo: {read: 0x1017, data: "E8 03"}', "+"),
    "other bytes": ('- sdo: {read: 0x1017, data: "E8 04"}', "-"),
    "bytes from a text's variable": ('- sdo: {read: 0x1008, save: t}\n- sdo: {read: 0x1008, data: "{t}"}', "+-"),
    "no object, bytes again": (
        '- sdo: {read: 0x1021, save: t}\n- sdo: {read: 0x1021, data: "{t}", transfer: block}',
        "++",
    ),
    # refused with one of several codes, with any
    "one of two": ("- sdo: {read: 0x5000, abort: [0x06020000, 0x06090011]}", "+"),
    "none of two": ("- sdo: {read: 0x5000, abort: [0x06010000, 0x06090011]}", "-"),
    "any": ("- sdo: {write: 0x1000, value: 0, abort: any}", "+"),
    "not refused": ("- sdo: {read: 0x1000, abort: any}", "-"),
    # what was not refused is red once
    "taken twice, and kept": (
        "- sdo: {write: 0x1017, value: 100, abort: any}\n- sdo: {write: 0x1017, value: 200, abort: any}\n"
        "- sdo: {read: 0x1017, expect: 1000}",
        "-ss",
    ),
    "written since": (
        "- sdo: {write: 0x1017, value: 100, abort: any}\n- sdo: {write: 0x1017, value: 200}\n"
        "- sdo: {read: 0x1017, expect: 1000}",
        "-+-",
    ),
    # what a node need not have
    "optional and there": ("- sdo: {read: 0x1008, transfer: block, optional: 0x05040001}", "+"),
    "optional and not there": ("- sdo: {read: 0x5000, optional: [0x06020000]}", "s"),
    "refused otherwise": ("- sdo: {read: 0x5000, optional: 0x06010000}", "-"),
    "left out": ("- skip: nothing to see here", "s"),
    "skipped with its group": (
        "- steps:\n  - sdo: {read: 0x5000, optional: any}\n  - sdo: {read: 0x1000, abort: any}\n- sdo: {read: 0x1000}",
        "ss+",
    ),
}


@pytest.mark.parametrize(("steps", "verdicts"), FORMS.values())
def test_an_sdo_step_ends_by_the_answer(steps: str, verdicts: str) -> None:
    signs = {Status.PASSED: "+", Status.SKIPPED: "s"}
    assert "".join(signs.get(step.status, "-") for step in run(steps)) == verdicts


def test_a_skipped_step_says_why_and_does_not_end_the_suite() -> None:
    reasons = [
        step.reason.what if step.reason else ""
        for step in results(document(FORMS["skipped with its group"][0]), keep_going=False).steps
    ]
    assert reasons == [
        "SDO read 0x5000:0: the node does not do this (abort 0x06020000 Object does not exist)",
        "it belongs to a step that is skipped",
        "",
    ]


NAME, PERIOD = "- sdo: {read: 0x1008}", "- sdo: {read: 0x1017}"


@pytest.mark.parametrize(
    ("step", "change", "what", "sent"),
    [
        (PERIOD, lambda data: data[:5], "the answer 4B171000E8 is not of 8 bytes", "602#4017100000000000"),
        (
            PERIOD,
            lambda data: data[:1] + b"\x18" + data[2:],
            "no answer from lift (but 4B 18 10 00 E8 03 00 00, which is none) within 1000 ms after SDO request",
            "602#8017100000000405",
        ),
        (
            NAME,
            lambda data: bytes([data[0] ^ 0x10]) + data[1:] if data[0] < 0x20 else data,
            "the answer 105061636B616769 is not with the toggle bit of the request",
            "602#8008100000000305",
        ),
        (
            PERIOD,
            lambda _: None,
            "no answer from lift within 1000 ms after SDO request",
            "602#8017100000000405",  # the tester gives up, and says so
        ),
    ],
)
def test_an_unexpected_answer_is_reported(
    step: str, change: Callable[[bytes], bytes | None], what: str, sent: str
) -> None:
    found, frames = reason(step, change)
    assert found.what.endswith(what)
    assert frames[-1] == sent
