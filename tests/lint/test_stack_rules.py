"""What a stack asks of an object dictionary: each rule flags its own defect, and nothing in a device that has all."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.lint.rules import stack_findings
from eurobot_od.lint.stack_rules import RULES

SERVO = (Path(__file__).parents[2] / "docs" / "servo.eds").read_text("ascii")


OWN = """
[2F00]
ParameterName=Own
DataType=7
AccessType=rw
DefaultValue=$NODEID+1
"""


def found(text: str) -> set[tuple[str, str]]:
    return {(each.code, each.message) for each in stack_findings(text.encode(), "servo.eds", "canopennode")}


def without(*indices: str) -> str:
    sections = SERVO.split("\n[")
    return "\n[".join(each for each in sections if not each.upper().startswith(indices))


def test_a_complete_device_has_no_findings() -> None:
    assert found(SERVO) == {("I905", "CANopenLinux needs 0x1280, or to be compiled with -DCO_CONFIG_GTW=0")}


DEFECTS = [
    ("E901", without("1017]"), "CANopenNode needs 0x1017:0; add: Producer heartbeat time, UNSIGNED16, rw"),
    ("E901", without("1018SUB4]"), "CANopenNode needs 0x1018:4; add: Serial number, UNSIGNED32, ro"),
    ("I905", without("1010"), "CANopenLinux needs 0x1010, or to be compiled with -DCO_CONFIG_STORAGE=0"),
    ("E902", without("1A01"), "with 0x1801 CANopenNode needs 0x1A01, too"),
    ("E903", without("1801", "1A01"), "TPDO 4 is there and TPDO 2 (0x1801) is not; add it"),
    ("W904", SERVO + OWN,
     "CANopenNode does not add the node-ID to 0x2F00 sub 0: your program has to"),
]  # fmt: skip


@pytest.mark.parametrize(("code", "text", "message"), DEFECTS, ids=[each[2] for each in DEFECTS])
def test_a_defect_is_reported(code: str, text: str, message: str) -> None:
    assert (code, message) in found(text)


def test_each_rule_has_a_defect() -> None:
    assert {each.code for each in RULES} == {code for code, *_ in DEFECTS}
