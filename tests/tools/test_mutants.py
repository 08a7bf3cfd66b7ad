"""Which tests are to notice small changes to a module."""

from __future__ import annotations

from pathlib import Path
from uuid import uuid4

import pytest

pytest.importorskip("cosmic_ray", reason="the extra `mutants` is not installed")

import mutants
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, WorkItem

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


def test_a_seed_chooses_the_same_changes_in_each_session(tmp_path: Path) -> None:
    def chosen(session: Path, seed: int) -> set[int]:
        specs = [MutationSpec("m.py", "core/AddNot", number, (1, 0), (1, 1)) for number in range(50)]
        items = [WorkItem.single(uuid4().hex, each) for each in specs]
        with use_db(session, WorkDB.Mode.create) as database:
            database.add_work_items(items)
        mutants.choose(session, 5, seed)
        with use_db(session, WorkDB.Mode.open) as database:
            return {each.occurrence for item in database.pending_work_items for each in item.mutations}

    first, again, other = (chosen(tmp_path / f"{name}.sqlite", seed) for name, seed in (("a", 1), ("b", 1), ("c", 2)))
    assert first == again != other
    assert len(first) == len(other) == 5
