"""The tools around the EDS checker: no input makes it fail."""

from __future__ import annotations

import lint_fuzz
import pytest
from bench.eds import make_eds

from eurobot_od.lint.model import load
from eurobot_od.lint.rules import lint

INPUTS = range(1200)


@pytest.mark.long
@pytest.mark.parametrize("part", range(4), ids=[each.__name__ for each in lint_fuzz.MAKERS])
def test_no_input_makes_the_checker_fail(part: int) -> None:
    for number in INPUTS[part::4]:
        lint_fuzz.check(lint_fuzz.make_input(number))


def test_an_input_follows_from_its_number() -> None:
    assert [lint_fuzz.make_input(number) for number in INPUTS[:40]] == [
        lint_fuzz.make_input(number) for number in INPUTS[:40]
    ]


@pytest.mark.parametrize(("objects", "pdos"), [(200, 16), (4, 0)])
def test_the_bench_s_device_has_no_findings(objects: int, pdos: int) -> None:
    data = make_eds(objects, pdos).encode()
    assert len(load(data, "bench.eds").objects) == objects
    assert lint(data, "bench.eds") == []


def test_ten_thousand_objects_are_checked() -> None:
    data = make_eds(10_000).encode()
    assert len(load(data, "bench.eds").objects) == 10_000


def test_deep_nests_and_long_lines_are_only_long() -> None:
    for data in (b"[" * 100_000, b"=" * 100_000, b"[2000]\nDefaultValue=" + b"9" * 100_000, b"\r" * 100_000):
        lint(data, "long.eds")
