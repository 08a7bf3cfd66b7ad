"""The examples of docs/python.md pass `mypy --strict`, but for what canopen and IPython leave without types."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mypy import api

PAGE = Path(__file__).parents[1] / "docs" / "python.md"
OPTIONS = (
    "--strict",
    "--allow-untyped-calls",
    "--allow-redefinition",
    f"--config-file={PAGE.parents[1] / 'pyproject.toml'}",
)


@pytest.mark.long
def test_the_examples_are_typed(tmp_path: Path) -> None:
    file = tmp_path / "examples.py"
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    file.write_text("\n\n".join(each for each in blocks if "NodeClassError" not in each))  # which shows a mistake
    said, trouble, status = api.run([*OPTIONS, str(file)])
    assert (status, trouble) == (0, ""), said


@pytest.mark.long
def test_the_program_with_types_needs_neither_options_nor_casts(tmp_path: Path) -> None:
    program = re.findall(r"### With types\n.*?```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    file = tmp_path / "fastest.py"
    file.write_text(program)
    said, trouble, status = api.run(["--strict", f"--config-file={PAGE.parents[1] / 'pyproject.toml'}", str(file)])
    assert (status, trouble) == (0, ""), said
    assert not re.search("cast|Any|ignore", program)
    assert len(program.splitlines()) <= 40
