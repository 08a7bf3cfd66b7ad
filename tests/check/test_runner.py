"""Steps turn green or red as the simulated lift deserves, and a red one says why."""

from __future__ import annotations

import pytest

from eurobot_od.check.on_bus import run_simulated
from eurobot_od.check.report import Status, StepReason, SuitePart
from eurobot_od.check.runner import RunOptions
from tests.check.suites import HEAD, document, results, run, suite, verdicts
from tests.kit import plant
from tests.rows import rows

START = """
- send: {Order Set: {colour: blue, boxes: 12, rows: 0}}
- expect: Order Confirm
"""
MOVE = "- send: {Move To: {x: 700, y: 1750, angle: 0, speed: 100}}\n"
PERIODIC = "- sdo: {write: Move State Response.Event timer, value: 50}\n- await: Move State Response\n"
ALL = HEAD.replace("node: lift\n", "node: [lift, scale]\n")

# Each row: steps, and how they end: + green, - red.
CASES = {
    # expect
    "an answer comes": ("- send: Check Lift Request\n- expect: Check Lift Response", "++"),
    "an answer counts once": (
        "- send: Check Lift Request\n- expect: Check Lift Response\n- expect: Check Lift Response",
        "++-",
    ),
    "no answer to another node's check": ("- send: Check Scale Request\n- expect: Check Scale Response", "+-"),
    "a question forgets what came before": (
        "- send: Check Lift Request\n- wait: 10 ms\n- send: Check Scale Request\n- expect: Check Lift Response",
        "+++-",
    ),
    "several sends are one question": (
        "- send: Check Lift Request\n- send: Place Request\n- expect: Check Lift Response\n- expect: Place Response",
        "++++",
    ),
    "in any order": (
        "- send: Check Lift Request\n- send: Place Request\n- expect: {all: [Check Lift Response, Place Response]}",
        "+++",
    ),
    "in this order": (
        "- send: Check Lift Request\n- send: Place Request\n- expect: [Place Response, Check Lift Response]",
        "++-",
    ),
    "one of them": (
        "- send: Check Lift Request\n- expect: {any: [Move Confirm, Check Lift Response]}",
        "++",
    ),
    "not all of them": (
        "- send: Check Lift Request\n- expect: {all: [Move Confirm, Check Lift Response]}",
        "+-",
    ),
    "fields as expected": (
        "- send: Place Request\n- expect: {Place Response: {x: unknown, source: encoder}}",
        "++",
    ),
    "a field is not": (
        "- send: Place Request\n- expect: {Place Response: {x: '> 0'}}",
        "+-",
    ),
    "raw frames": ("- send: {raw: '502#'}\n- expect: {raw: '482#'}", "++"),
    "raw data": ("- send: {raw: '402#'}\n- expect: {raw: '382#FF????????'}", "++"),
    "raw data differs": ("- send: {raw: '402#'}\n- expect: {raw: '382#FFFFFFFFFF'}", "+-"),
    # never
    "nothing came": ("- send: Check Scale Request\n- never: Check Lift Response\n  for: 50 ms", "++"),
    "something came": ("- send: Check Lift Request\n- never: Check Lift Response\n  for: 50 ms", "+-"),
    "never a second one": (
        "- send: Check Lift Request\n- expect: Check Lift Response\n- never: Check Lift Response\n  for: 50 ms",
        "+++",
    ),
    "never with other fields": (
        "- send: Place Request\n- never: {Place Response: {x: 5}}\n  for: 50 ms",
        "++",
    ),
    # await
    "what came before is not awaited": (
        "- send: Check Lift Request\n- wait: 10 ms\n- await: Check Lift Response",
        "++-",
    ),
    "awaited among others that come by themselves": (
        PERIODIC + START + MOVE + "- await: {Move State Response: {time: 0}}\n  within: 10 s",
        "++++++",
    ),
    "awaited in vain": (
        PERIODIC + START + MOVE + "- await: {Move State Response: {time: blocked}}\n  within: 1 s",
        "+++++-",
    ),
    # poll
    "polled until it is there": (
        START + MOVE + "- poll: {send: Move State Request, every: 100 ms}\n"
        "  until: {Move State Response: {time: 0}}\n  within: 10 s",
        "++++",
    ),
    "polled in vain": (
        START + MOVE + "- poll: {send: Move State Request, every: 100 ms}\n"
        "  until: {Move State Response: {time: 0}}\n  within: 300 ms",
        "+++-",
    ),
    # period
    "as often as it should": (
        "- period: {message: {heartbeat: operational}, every: 1 s, tolerance: 10 ms, count: 3}",
        "+",
    ),
    "too seldom": ("- period: {message: {heartbeat: operational}, every: 500 ms, tolerance: 10 ms, count: 3}", "-"),
    "too often": ("- period: {message: {heartbeat: operational}, every: 3 s, tolerance: 10 ms, count: 3}", "-"),
    "another state": ("- period: {message: {heartbeat: stopped}, every: 1 s, tolerance: 10 ms, count: 3}", "-"),
    # NMT, heartbeat, EMCY
    "states": (
        "- nmt: stop\n- heartbeat: stopped\n  within: 2 s\n- nmt: pre-operational\n- heartbeat: pre-operational\n"
        "  within: 2 s\n- nmt: start\n- heartbeat: operational\n  within: 2 s",
        "++++++",
    ),
    "a reset boots": ("- nmt: reset\n- heartbeat: boot-up", "++"),
    "another state than expected": ("- nmt: stop\n- heartbeat: operational\n  within: 2 s", "+-"),
    "an emergency": ("- send: {raw: '202#D274'}\n- emcy: 0x8210", "++"),
    "an emergency within a time": ("- send: {raw: '202#D274'}\n- emcy: 0x8210\n  within: 10 ms", "++"),
    "another emergency": ("- send: {raw: '202#D274'}\n- emcy: 0x8220", "+-"),
    "no emergency": ("- send: Halt Lift\n- never: {emcy: any}\n  for: 50 ms", "++"),
    # SDO
    "an object": ("- sdo: {read: 0x1017, expect: 1000}\n- sdo: {read: Producer heartbeat time, expect: '> 0'}", "++"),
    "another value": ("- sdo: {read: 0x1017, expect: 999}", "-"),
    "a text": ("- sdo: {read: Manufacturer device name, expect: Packaging line lift}", "+"),
    "written and read": ("- sdo: {write: 0x1017, value: 300}\n- sdo: {read: 0x1017, expect: 300}", "++"),
    "refused as it should": ("- sdo: {read: 0x5000, abort: 0x06020000}", "+"),
    "refused otherwise": ("- sdo: {read: 0x5000, abort: 0x06090011}", "-"),
    "refused without need": ("- sdo: {read: 0x5000}", "-"),
    "not refused": ("- sdo: {read: 0x1017, abort: 0x06020000}", "-"),
    # variables
    "saved and compared": (
        START + "- send: Place Request\n- expect: Place Response\n"
        "- save: {x: Place Response.x}\n- send: Place Request\n"
        "- expect: {Place Response: {x: '{x} +- 1'}}",
        "+++++++",
    ),
    "saved and sent": (
        START + "- send: Place Request\n- expect: Place Response\n"
        "- save: {x: Place Response.x}\n- send: {Move To: {x: '{x}', y: 1500, angle: 0, speed: 50}}\n"
        "- expect: Move Confirm",
        "+++++++",
    ),
    "saved by SDO": ("- sdo: {read: 0x1017, save: t}\n- sdo: {write: 0x1017, value: '{t}'}", "++"),
    "never saved": ("- save: {t: Move State Response.time}\n- expect: {Move State Response: {time: '{t}'}}", "--"),
    "saved as unknown and sent": (
        "- send: Place Request\n- expect: Place Response\n- save: {x: Place Response.x}\n"
        "- send: {Move To: {x: '{x}', y: 1500, angle: 0, speed: 50}}",
        "+++-",
    ),
    # repetition
    "repeated": ("- {send: Check Lift Request, repeat: 3}\n- expect: Check Lift Response\n  repeat: 3", "++"),
    "repeated too often": (
        "- {send: Check Lift Request, repeat: 3}\n- {expect: Check Lift Response, repeat: 4}",
        "+-",
    ),
    "a group, repeated": (
        "- repeat: 2\n  steps:\n    - send: Check Lift Request\n    - expect: Check Lift Response",
        "++++",
    ),
}


@rows("steps, verdict", CASES.values())
def test_steps_end_by_what_the_node_sends(steps: str, verdict: str) -> None:
    assert verdicts(steps) == verdict


def test_one_frame_may_be_expected_of_two_nodes() -> None:
    assert verdicts(START + "- nmt: reset\n- heartbeat: {state: boot-up, node: scale}", ALL) == "++++"


def reason(steps: str) -> StepReason:
    """Return why the last step is red."""
    step = run(steps)[-1]
    assert step.status is Status.FAILED
    assert step.reason is not None
    return step.reason


def test_each_different_field_is_reported_with_both_values() -> None:
    found = reason(
        START
        + "- send: Place Request\n"
        + "- expect: {Place Response: {x: 10 +- 5, y: any, angle: 90..100, source: laser}}"
    )
    assert found.what == "Place Response is not as expected"
    assert found.expected == ("Place Response: x 10 mm +- 5 mm, y anything, angle 90 deg .. 100 deg, source laser")
    assert [(each.what, each.expected) for each in found.mismatches] == [
        ("x", "10 mm +- 5 mm"),
        ("angle", "90 deg .. 100 deg"),
        ("source", "laser"),
    ]


@pytest.mark.parametrize(
    ("steps", "what", "came"),
    [
        ("- expect: Move Confirm", "no Move Confirm within 1 s", "nothing"),
        ("- expect: Move Confirm\n  within: 50 ms", "no Move Confirm within 50 ms", "nothing"),
        (
            "- nmt: stop\n- heartbeat: operational\n  within: 2 s",
            "no heartbeat of lift within 2 s",
            "Heartbeat  lift, stopped",
        ),
        (
            "- send: Check Lift Request\n- never: Check Lift Response\n  for: 50 ms",
            "Check Lift Response came, though it should not",
            "Check Lift Response",
        ),
        (
            "- poll: {send: Move State Request, every: 100 ms}\n  until: {Move State Response: {time: 0}}",
            "Move State Response not as wanted after 10 x Move State Request",
            "Move State Response  time=unknown",
        ),
        (
            "- sdo: {read: 0x5000}",
            "SDO read 0x5000:0: the node aborts: Object does not exist (0x06020000)",
            "abort 0x06020000 Object does not exist",
        ),
    ],
)
def test_the_frame_that_came_instead_is_reported(steps: str, what: str, came: str) -> None:
    found = reason(steps)
    assert (found.what, found.came) == (what, came)


def test_the_last_frames_are_reported_with_their_meaning() -> None:
    found = reason("- send: Check Lift Request\n- expect: Move Confirm\n  within: 10 ms")
    assert [(str(line.frame), line.own, line.meaning) for line in found.frames[-2:]] == [
        ("502#", True, "Check Lift Request"),
        ("482#", False, "Check Lift Response"),
    ]


def test_the_last_frames_are_decoded_with_the_frames_before_them() -> None:
    """The first byte of a segment is that of an abort; only the frames before tell them apart."""
    found = reason(
        "- send: {raw: 602#C617100002000000}\n- wait: 10 ms\n- send: {raw: 602#8102000000000000}\n"
        "- expect: Move Confirm\n  within: 10 ms"
    )
    assert "SDO  lift, block segment 1, the last" in [line.meaning for line in found.frames]


SECTIONS = """\
spec: 1
name: sections
node: lift
setup:
  - {name: prepared, send: Check Lift Request}
steps:
  - {name: red, expect: Move Confirm, within: 10 ms}
  - {name: green, send: Check Lift Request}
teardown:
  - {name: red too, expect: Move Confirm, within: 10 ms}
  - {name: tidy, send: Halt Lift}
"""


def outcome(text: str, *, keep_going: bool) -> list[tuple[str, Status]]:
    return [(step.name, step.status) for step in results(text, keep_going=keep_going).steps]


def test_a_red_step_skips_the_rest_but_not_the_teardown() -> None:
    assert outcome(SECTIONS, keep_going=False) == [
        ("prepared", Status.PASSED),
        ("red", Status.FAILED),
        ("green", Status.SKIPPED),
        ("red too", Status.FAILED),
        ("tidy", Status.PASSED),
    ]


def test_with_keep_going_steps_after_a_red_one_are_done() -> None:
    assert dict(outcome(SECTIONS, keep_going=True))["green"] is Status.PASSED


def test_a_red_setup_skips_all_steps() -> None:
    text = SECTIONS.replace("send: Check Lift Request}\nsteps", "expect: Move Confirm}\nsteps")
    assert dict(outcome(text, keep_going=True)) == {
        "prepared": Status.FAILED,
        "red": Status.SKIPPED,
        "green": Status.SKIPPED,
        "red too": Status.FAILED,
        "tidy": Status.PASSED,
    }


def test_results_have_parts_and_times() -> None:
    steps = results(SECTIONS).steps
    assert [step.section for step in steps] == [SuitePart.SETUP] + 2 * [SuitePart.STEPS] + 2 * [SuitePart.TEARDOWN]
    assert steps[1].seconds == pytest.approx(0.010)
    assert steps[2].started == pytest.approx(steps[1].started + steps[1].seconds)


def test_the_same_seed_gives_the_same_times() -> None:
    text = document(START + MOVE + "- poll: {send: Move State Request, every: 100 ms}\n"
                    "  until: {Move State Response: {time: 0}}\n  within: 10 s")  # fmt: skip
    assert results(text, seed=5) == results(text, seed=5)


def test_steps_of_a_group_have_its_name() -> None:
    groups = "- name: {}\n  repeat: {}\n  steps: [send: Check Lift Request]\n"
    steps = run(groups.format("twice", 2) + groups.format("once", 1) + "- wait: 1 ms")
    assert [step.name for step in steps] == [
        "twice 1/2: send Check Lift Request",
        "twice 2/2: send Check Lift Request",
        "once: send Check Lift Request",
        "wait 1 ms",
    ]


@pytest.mark.parametrize(("names", "done"), [("b", ["a", "b"]), ("ac", ["a", "b", "c"]), ("", [])])
def test_chosen_steps_are_done_with_those_before_them_only(names: str, done: list[str]) -> None:
    steps = "\n".join(f"- {{name: {name}, wait: 1 ms}}" for name in "abc")
    options = RunOptions(chosen=lambda name: name in names)
    result = run_simulated(suite(document(steps)), options, plant.PLUGINS.under_test)
    assert [step.name for step in result.steps] == done


# Errors that the node itself reports


def test_errors_none_is_green_for_a_node_without_errors() -> None:
    assert verdicts("- errors: none") == "+"


TOO_SHORT = "- send: {raw: 202#D274}\n- emcy: 0x8210\n"


def test_errors_none_is_red_with_the_errors_of_the_node() -> None:
    reason = run(f"{TOO_SHORT}- errors: none")[-1].reason
    assert reason is not None
    assert reason.what == "lift reports an error itself"
    assert reason.came == "generic error; communication; 0x8210 pdo too short"


def test_a_red_step_has_the_last_emcy_of_the_node() -> None:
    reason = run(f"{TOO_SHORT}- expect: Move Confirm")[-1].reason
    assert reason is not None
    assert reason.cause.startswith("EMCY  lift, 0x8210 pdo too short")


@pytest.mark.parametrize("before", ["", f"{TOO_SHORT}- nmt: reset\n- heartbeat: boot-up\n"])
def test_an_emcy_before_a_reset_is_not_reported(before: str) -> None:
    reason = run(f"{before}- expect: Move Confirm")[-1].reason
    assert reason is not None
    assert reason.cause == ""


@pytest.mark.parametrize(
    ("steps", "remarks"),
    [
        (TOO_SHORT, ["all is green, and yet the last error is not reset: EMCY  lift, 0x8210 pdo too short"]),
        ("- errors: none\n", []),
        (f"{TOO_SHORT}- nmt: reset\n- heartbeat: boot-up\n", []),
        (f"{TOO_SHORT}- expect: Move Confirm\n", []),  # red: its step has it
    ],
)
def test_a_green_suite_says_which_error_the_node_has_reported_at_the_end(steps: str, remarks: list[str]) -> None:
    result = run_simulated(suite(document(steps)), RunOptions(), plant.PLUGINS.under_test)
    assert [each.partition(", register")[0] for each in result.remarks] == remarks
