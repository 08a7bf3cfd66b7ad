"""The suites by device profiles: which steps may be done."""

from __future__ import annotations

import pytest

from eurobot_od.check.conformance.profile import Needs, allowed_steps


@pytest.mark.parametrize(
    ("reversible", "acting", "allowed"),
    [
        (False, None, {Needs.READING}),
        (True, None, {Needs.READING, Needs.REVERSIBLE}),
        (False, Needs.MOTION, {Needs.READING, Needs.REVERSIBLE, Needs.MOTION}),  # who may move it may write as well
        (True, Needs.OUTPUTS, {Needs.READING, Needs.REVERSIBLE, Needs.OUTPUTS}),
    ],
)
def test_what_may_be_done(reversible: bool, acting: Needs | None, allowed: set[Needs]) -> None:
    assert allowed_steps(reversible, acting) == allowed
