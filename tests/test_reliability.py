"""docs/reliability.md: tests/reliability.yaml names the tests of every promise, and they are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from tests.rows import rows

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
PROMISES = re.findall(r"^- (.+)$", TEXT.split("## Promises")[1].split("\n## ")[0], re.MULTILINE)
HELD = {
    each["promise"]: each["tests"] for each in yaml.safe_load((ROOT / "tests" / "reliability.yaml").read_text("utf-8"))
}
NAMED = [each.split("::") for tests in HELD.values() for each in tests]


def test_every_promise_has_tests() -> None:
    assert [*HELD] == PROMISES
    assert all(HELD.values())


@rows("file, name", NAMED)
def test_every_test_named_is_there(file: str, name: str) -> None:
    assert f"\ndef {name}(" in (ROOT / file).read_text(encoding="utf-8")


@pytest.mark.parametrize("tool", sorted(set(re.findall(r"`python3 (tools/\w+\.py)", TEXT))))
def test_every_command_named_is_there(tool: str) -> None:
    assert (ROOT / tool).is_file()
