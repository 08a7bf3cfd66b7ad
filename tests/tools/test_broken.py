"""The table of what breaks each promise: it fits the code, and names tests that are there."""

from __future__ import annotations

import re
from pathlib import Path

import broken
import pytest

from tests.rows import rows

ROOT = Path(__file__).parents[2]
CHANGES = broken.read()


@rows("change", CHANGES)
def test_a_change_fits_the_code_and_names_a_test(change: broken.Change) -> None:
    assert change.fits
    assert change.new != change.old
    file, _, name = change.test.partition("::")
    assert f"\ndef {name}(" in (ROOT / file).read_text(encoding="utf-8")


def test_every_decision_is_broken_once() -> None:
    numbers = {int(found[1]) for each in CHANGES if (found := re.match(r"Decision (\d+)", each.promise))}
    assert numbers == set(range(1, 25))


@pytest.mark.long
@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("tests/test_frame.py", broken.Verdict.UNNOTICED),
        ("tests/tools/test_broken.py::test_that_is_not_there", broken.Verdict.NOT_RUN),
    ],
)
def test_an_unnoticed_change_is_reported(tmp_path: Path, test: str, verdict: broken.Verdict) -> None:
    copy = broken.copy(tmp_path / "copy")
    before = (copy / "eurobot_od" / "errors.py").read_text(encoding="utf-8")
    change = broken.Change("a word", "eurobot_od/errors.py", "from __future__", "# changed\nfrom __future__", test)
    assert broken.judge(change, copy, 1_000_000_000) is verdict
    assert (copy / "eurobot_od" / "errors.py").read_text(encoding="utf-8") == before
