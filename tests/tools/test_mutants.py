"""Which tests are to notice small changes to a module."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("cosmic_ray", reason="the extra `mutants` is not installed")

import mutants

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("module", "tests"),
    [
        ("eurobot_od/frame.py", "tests/test_frame.py"),
        ("eurobot_od/sdo/wire.py", "tests/sdo/test_wire.py"),
        ("eurobot_od/sdo/__init__.py", "tests/sdo"),  # has no tests of its own
        ("eurobot_od/lint/network.py", "tests/lint"),
    ],
)
def test_the_tests_of_a_module_mirror_it(module: str, tests: str) -> None:
    assert mutants.tests_of(module) == tests
    assert (ROOT / tests).exists()
