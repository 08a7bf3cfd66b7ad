"""Writes suites for tests, reads them, and runs them against simulated nodes."""

from __future__ import annotations

import textwrap
from functools import cache
from pathlib import Path

from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import run_simulated
from eurobot_od.check.report import StepResult, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.support.yaml_places import Problems
from tests.kit import plant

HEAD = "spec: 1\nname: a suite\nnode: lift\n"
FILE = Path("suite.yaml")


def document(steps: str, head: str = HEAD) -> str:
    """Return a suite's text with some steps."""
    return f"{head}steps:\n{textwrap.indent(textwrap.dedent(steps).strip(), '  ')}\n"


@cache
def reader(dialect: str | None) -> SuiteReader:
    """Return the reader of a dialect, which loads its EDS files once."""
    return SuiteReader(plant.PLUGINS.networks(), dialect)


def read(text: str, dialect: str | None = None) -> tuple[list[Suite], list[str]]:
    """Read a text and return its suites, and its problems, each once, as `line:column: what`."""
    problems: Problems = []
    suites = reader(dialect).read(FILE, text, problems)
    return suites, [f"{line}:{column}: {what}" for (line, column), what in sorted(set(problems))]


def suite(text: str) -> Suite:
    """Read a text without problems and return its one suite."""
    suites, problems = read(text)
    assert problems == []
    return suites[0]


def results(text: str, *, keep_going: bool = True, seed: int = 1) -> SuiteResult:
    """Run a suite against simulated nodes."""
    return run_simulated(suite(text), RunOptions(keep_going), plant.PLUGINS.under_test, seed)


def run(steps: str, head: str = HEAD) -> tuple[StepResult, ...]:
    """Run some steps against the simulated lift and return their results."""
    return results(document(steps, head)).steps


def verdicts(steps: str, head: str = HEAD) -> str:
    """Run some steps and return how they ended: `+` green, `-` red."""
    return "".join("+" if step.status.value == "ok" else "-" for step in run(steps, head))
