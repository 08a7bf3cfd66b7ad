"""Changes that were judged equivalent: nobody can notice them, or nobody was promised what they change."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import yaml

from mutation.changes import Change


class Judged(NamedTuple):
    """A change that needs no test, by what stands for it in the text, and why."""

    module: str
    line: str
    change: str
    reason: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What stands for the change."""
        return self.module, self.line, self.change


def read(file: Path) -> list[Judged]:
    """Read the file of judged changes: for each module a list of line, change and reason."""
    modules = yaml.safe_load(file.read_text("utf-8")) or {}
    return [Judged(module, **each) for module, entries in modules.items() for each in entries]


def key(change: Change) -> tuple[str, str, str]:
    """Return what stands for a change in the file."""
    return change.module, change.statement, change.what
