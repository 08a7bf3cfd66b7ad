"""docs/reliability.md: every promise names its tests, and they are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.rows import rows

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
PROMISES = [line for line in TEXT.split("## Promises")[1].split("\n## ")[0].splitlines() if line.startswith("| ")][1:]
NAMED = re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", TEXT)


@pytest.mark.parametrize("promise", PROMISES)
def test_every_promise_names_a_test(promise: str) -> None:
    assert re.search(r"`tests/[\w/]+\.py::test_\w+`", promise)


@rows("file, name", NAMED)
def test_every_test_named_is_there(file: str, name: str) -> None:
    assert f"\ndef {name}(" in (ROOT / file).read_text(encoding="utf-8")


@pytest.mark.parametrize("tool", sorted(set(re.findall(r"`python3 (tools/\w+\.py)", TEXT))))
def test_every_command_named_is_there(tool: str) -> None:
    assert (ROOT / tool).is_file()
