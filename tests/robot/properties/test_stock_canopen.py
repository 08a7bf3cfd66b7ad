"""The PDOs of the robot's files are the same bits for stock canopen."""

from __future__ import annotations

from eurobot_od.robot import dialects
from tests.properties.test_stock_canopen import Case, agree_on, cases_in, frames, is_held, quiet
from tests.rows import rows

__all__ = ["quiet"]


@rows("case", (case for name in dialects.names() for case in cases_in(dialects.folder(name))))
def test_a_pdo_of_a_file_is_the_same_bits(case: Case) -> None:
    assert is_held(case.stock)
    agree_on(case, frames(case))
