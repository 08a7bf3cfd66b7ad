"""Suites as YAML: a line for each step, with numbers as CANopen people write them.

Rule of this file: what comes from a file, a ParameterName or a text, is always quoted and made printable.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from eurobot_od.check.conformance.step import Data

BARE = re.compile(r"0x[0-9A-F]+|[0-9]+ ?(?:ms|s)|(?!yes|no|on|off|true|false|null)[a-z]+(?:[- ][a-z]+)*")
"""Texts that need no quotes: hexadecimal numbers, durations, the words of the format."""

QUOTED = ("name", "skip", "data")
"""Keys whose values are texts, whatever they look like."""


def documents(suites: Iterable[Data]) -> str:
    """Write suites as documents of one file."""
    lines: list[str] = []
    for suite in suites:
        lines.append("---")
        for key, value in suite.items():
            if key in ("setup", "steps", "teardown"):
                lines.append(f"{key}:")
                lines += [line for step in value for line in _step_lines(step, "  ")]
            else:
                lines.append(f"{key}: {_inline(value, key)}")
    return "".join(f"{line}\n" for line in lines)


def _step_lines(step: Data, indent: str) -> Iterator[str]:
    """Write a step on one line, a group with a line for each of its steps."""
    if "steps" not in step:
        yield f"{indent}- {_inline(step)}"
        return
    yield f"{indent}- name: {_inline(step['name'], 'name')}"
    yield f"{indent}  steps:"
    for each in step["steps"]:
        yield from _step_lines(each, indent + "    ")


def _inline(value: Any, key: str = "") -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_inline(each, name)}" for name, each in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_inline(each, key) for each in value) + "]"
    text = str(value)
    bare = isinstance(value, int) or (key not in QUOTED and BARE.fullmatch(text))
    return text if bare else json.dumps(text, ensure_ascii=False)
