"""Names of steps: what is written is read again, also behind a group, and the numbers of CiA's tool one by one."""

from __future__ import annotations

import pytest

from eurobot_od.check.conformance.naming import StepName

NAMES = [
    "7.5.2.21 Identity: 0x1018:1 Vendor-ID [reading]",
    "7.2.4.3.17 Unknown sub-index: read 0x1000:1 [reading, CTT 2.5]",
    "7.5.2.37 TPDO transmission: TPDO 1 by event timer [reversible, CTT 3.4, 3.5]: none in STOPPED",
    "7.2.2.2 TPDO transmission: TPDO 1 by SYNC [reversible, CTT 3.6]: with each SYNC 1/2: it comes",
    "7.4.5 Writable: 0x2000:1 Speed: left [rpm] [reversible, CTT 2.2, 4.9]: put back",
]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_read_as_it_is_written(name: str) -> None:
    assert str(StepName.of(name)) == name


NUMBERS = [("", ()), ("2.5", ("2.5",)), ("7.1, 7.201 to 7.203", ("7.1", "7.201", "7.202", "7.203"))]


@pytest.mark.parametrize(("written", "numbers"), NUMBERS)
def test_numbers_one_by_one(written: str, numbers: tuple[str, ...]) -> None:
    assert StepName("7.4", "x", "y", "reading", written).numbers == numbers


def test_another_name_is_none() -> None:
    assert StepName.of("send Check Drive Request") is None
