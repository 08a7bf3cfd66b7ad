"""An edit as words say it: what it makes of a file, and what lint finds there that was not there before."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.lint.edits import VERBS, difference, make_edit

MOTOR = (Path(__file__).parents[2] / "docs" / "motor.eds").read_bytes()


def test_a_finding_that_only_moves_to_another_line_is_not_new() -> None:
    made = make_edit(MOTOR, "motor.eds", VERBS["add"].changes(["0x1005", "COB-ID SYNC", "default=0x80"]))
    assert [each.code for each in made.findings] == ["W442"]
    assert (made.new, made.errors, made.warnings) == ([], [], [])


def test_new_errors_and_new_warnings_are_separate() -> None:
    made = make_edit(MOTOR, "motor.eds", VERBS["map"].changes(["TPDO1", "2100"]))
    assert ([each.code for each in made.errors], made.warnings) == (["E637"], [])
    made = make_edit(MOTOR, "motor.eds", VERBS["set"].changes(["2100", "high=100"]))
    assert (made.errors, [each.code for each in made.warnings]) == ([], ["W442"])


def test_too_few_words_are_refused_with_the_syntax() -> None:
    with pytest.raises(LocalError, match="write set OBJECT KEY=VALUE"):
        VERBS["set"].changes(["2100"])


def test_unprintable_characters_are_escaped_in_a_difference() -> None:
    assert difference(b"a\n", b"\x1b[31m\n", "x.eds")[2:] == ["@@ -1 +1 @@", "-a", "+\\x1b[31m"]
