"""Runs the command line inside the test and returns what it said."""

from __future__ import annotations

import io
from typing import NamedTuple

import pytest

from eurobot_od import cli


class Said(NamedTuple):
    """Exit status, standard output and standard error of a command."""

    status: int
    out: str
    err: str

    @property
    def complaint(self) -> str:
        """The last line on standard error; argparse puts its usage before."""
        return self.err.splitlines()[-1] if self.err else ""


def run(capsys: pytest.CaptureFixture[str], *words: str) -> Said:
    """Run one command line."""
    capsys.readouterr()
    try:
        status = cli.main(words)
    except SystemExit as end:
        status = int(end.code or 0)
    return Said(status, *capsys.readouterr())


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True
