"""A row of the interop matrix: a tool, the question to it, and the judgement of its answer.

A question returns an Answer or raises Differs; any other error is its own fault.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from interop_rows.tools import Tool


class Judgement(Enum):
    """The judgement of an answer: whether the tool agrees with us."""

    AGREES = "agrees"
    LIMIT = "agrees with a limit"
    DIFFERS = "differs"
    ABSENT = "not asked: absent"


class Answer(NamedTuple):
    """A tool's answer; `limit`: what it cannot do or does wrong, by which clause, and how to avoid it (Markdown)."""

    said: str
    limit: str = ""

    @property
    def judgement(self) -> Judgement:
        """LIMIT if there is one, else AGREES."""
        return Judgement.LIMIT if self.limit else Judgement.AGREES


class Differs(Exception):
    """A tool's answer differs from ours."""


class Row(NamedTuple):
    """One question to one tool; `ask` gets an empty folder to work in."""

    tool: Tool
    asked: str
    ask: Callable[[Path], Answer]


class Verdict(NamedTuple):
    """A row, and the judgement and text of its answer."""

    row: Row
    judgement: Judgement
    said: str


def agree(what: str, theirs: object, ours: object) -> None:
    """Check that the tool's value of `what` is ours; raises Differs."""
    if theirs != ours:
        raise Differs(f"{what}: the tool has {theirs!r}, we have {ours!r}")


def judge(row: Row, folder: Path) -> Verdict:
    """Ask a row's question if its tool is there; any error counts as a difference."""
    if not row.tool.present():
        return Verdict(row, Judgement.ABSENT, f"{row.tool.name} is not here: {row.tool.remedy}")
    try:
        answer = row.ask(folder)
    except Exception as error:  # whatever breaks between the tool and us is what the matrix is for
        return Verdict(row, Judgement.DIFFERS, f"{type(error).__name__}: {' '.join(str(error).split())}")
    return Verdict(row, answer.judgement, f"{answer.said}. Limit: {answer.limit}" if answer.limit else answer.said)
