"""Runs all shipped check suites against all faults and prints which suite finds which fault.

Each fault has to make the step fail that its table names, and without a fault no suite may fail, for any seed.
tests/check/conformance/test_faults.py does the same for the conformance suites. The exit status is 0 if all this holds,
else 1.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, partial
from importlib import import_module
from typing import Annotated, NamedTuple

from environment import ROOT

if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))  # the kit is the tests'

from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import run_simulated
from eurobot_od.check.report import Status
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.cli.options import Campaign, counted
from eurobot_od.cli.signature import HelpGroup, Option, Parser, describe, summary
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import ROLES
from eurobot_od.season.campaign import Workers
from eurobot_od.season.campaign import run as in_blocks
from eurobot_od.season.results import Results
from tests.robot.faults import PLUGINS

FINE, NOT_FOUND = 0, 1

UNTOUCHED, GREEN, RED, NAMED = " ", ".", "r", "X"
"""Cells of the matrix: the fault fits none of the suite's nodes; not found; found; found by the step it names."""


class Run(NamedTuple):
    """One run of a suite in a dialect, with a fault (None: without) and a seed."""

    dialect: str
    suite: str
    fault: str | None = None
    seed: int = 1


class Outcome(NamedTuple):
    """A run and the names of its failed steps."""

    run: Run
    red: tuple[str, ...]


@cache
def shipped(dialect: str) -> dict[str, Suite]:
    """Return the shipped suites that are for a dialect, by the names of their files."""
    suites = SuiteReader(PLUGINS.networks(), dialect).read_files(PLUGINS.shipped_suites().values())
    return {suite.file.stem: suite for suite in suites if suite.dialect in (None, dialect)}


def do(run: Run) -> Outcome:
    """Run a suite."""
    suite = shipped(run.dialect)[run.suite]
    make_nodes = partial(PLUGINS.under_test, faults=[run.fault] if run.fault else [])
    options = RunOptions(keep_going=True)
    result = run_simulated(suite, options, make_nodes, run.seed)
    return Outcome(run, tuple(step.name for step in result.steps if step.status is not Status.PASSED))


def fits(fault: str, node: str) -> bool:
    """Return whether a node can have a fault."""
    return issubclass(ROLES[node], PLUGINS.find_fault(fault)[0])


def named_red(fault: str, outcome: Outcome) -> bool:
    """Return whether the first failed step is the one that the fault's table names; a group's steps carry its name."""
    suite, step = PLUGINS.find_fault(fault)[1].caught_by
    return (
        outcome.run.suite == suite
        and outcome.red[:1] != ()
        and f"{outcome.red[0]}:".startswith((f"{step}:", f"{step} "))
    )


# Runs


def robot_faults() -> list[str]:
    """Return the faults that a shipped suite finds."""
    return [
        name
        for name in PLUGINS.fault_names()
        if PLUGINS.find_fault(name)[1].caught_by.suite in PLUGINS.shipped_suites()
    ]


def fault_runs(dialect: str, names: Iterable[str]) -> list[Run]:
    """Return the runs of each fault with each suite that has a node for it."""
    return [
        Run(dialect, name, fault)
        for fault in names
        for name, suite in shipped(dialect).items()
        if any(fits(fault, node) for node in suite.nodes)
    ]


def healthy_runs(dialect: str, seeds: int) -> list[Run]:
    """Return the runs of all suites without a fault."""
    return [Run(dialect, suite, None, seed) for seed in range(1, seeds + 1) for suite in shipped(dialect)]


# Reports


def matrix(outcomes: Sequence[Outcome], suites: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the matrix, one for each fault."""
    cells = {(each.run.fault, each.run.suite): cell(each) for each in outcomes}
    names = list(dict.fromkeys(each.run.fault or "" for each in outcomes))
    width = max(map(len, names), default=0)
    for row in range(max(map(len, suites))):
        yield " " * width + "  " + " ".join(suite.rjust(max(map(len, suites)))[row] for suite in suites)
    for name in names:
        yield f"{name:{width}}  " + " ".join(cells.get((name, suite), UNTOUCHED) for suite in suites)


def cell(outcome: Outcome) -> str:
    """Return the sign for a run with a fault."""
    if not outcome.red:
        return GREEN
    return NAMED if outcome.run.fault and named_red(outcome.run.fault, outcome) else RED


def missed(outcomes: Iterable[Outcome]) -> Iterator[str]:
    """Yield a line for each fault that no suite finds by the named step, with the step that fails instead."""
    by_fault: dict[str, list[Outcome]] = {}
    for each in outcomes:
        by_fault.setdefault(each.run.fault or "", []).append(each)
    for fault, runs in by_fault.items():
        if not any(named_red(fault, each) for each in runs):
            suite, step = PLUGINS.find_fault(fault)[1].caught_by
            red = "; ".join(f"{each.run.suite}: {each.red[0]}" for each in runs if each.red) or "nothing"
            yield f"{fault}: expected red is {suite}: {step!r}; red is {red}"


def wrongly_red(outcomes: Iterable[Outcome]) -> Iterator[str]:
    """Yield a line for each suite that fails without a fault."""
    for each in outcomes:
        if each.red:
            yield f"{each.run.suite} ({each.run.dialect}, seed {each.run.seed}): {each.red[0]!r} is red without a fault"


# Command line


def _done(runs: Sequence[Run], workers: Workers, kept: Results[Outcome] | None) -> list[Outcome]:
    return list(counted(in_blocks(do, runs, workers, kept), len(runs), "runs", workers))


def run_all(
    *,
    dialect: Annotated[Sequence[str], "EDS files (default: all dialects)"] = (),
    fault: Annotated[Sequence[str], Option(metavar="NAME"), "only this fault, may be given several times"] = (),
    seeds: Annotated[int, Option(metavar="N"), "seeds for the runs without a fault"] = 1,
    campaign: Annotated[Campaign, HelpGroup("many at once, with all of it")],
) -> int:
    """Run all shipped suites against all faults; print the matrix of each dialect and what is wrong."""
    for name in fault:
        PLUGINS.find_fault(name)  # complains of a name before the first run
    names = [name for name in robot_faults() if name in fault or not fault]
    wrong = list[str]()
    chosen = {each: (fault_runs(each, names), healthy_runs(each, seeds)) for each in dialect or dialects.names()}
    number = sum(len(runs) for both in chosen.values() for runs in both)
    kept = campaign.kept(Outcome, lambda: {"campaign": "faults"})
    with campaign.workers(number) as workers:
        for dialect, both in chosen.items():
            found, healthy = (_done(runs, workers, kept) for runs in both)
            print(f"{dialect}: {UNTOUCHED!r} no such node, {GREEN} green, {RED} red, {NAMED} red as named\n")
            print(*matrix(found, list(shipped(dialect))), sep="\n")
            wrong += [f"{dialect}: {line}" for line in missed(found)] + list(wrongly_red(healthy))
            print(f"\n{len(found)} runs with a fault, {len(healthy)} without\n")
    print(*wrong, sep="\n")
    print(
        f"{len(wrong)} findings" if wrong else "every fault is found by the step that it names, and nothing else is red"
    )
    return NOT_FOUND if wrong else FINE


def main(words: Sequence[str] | None = None) -> int:
    """Run the tool with the words of a command line, by default those of this process."""
    parser = Parser("fault_matrix", description=summary(run_all))
    status: int = describe(parser, run_all)(parser.parse_args(words))
    return status


if __name__ == "__main__":
    sys.exit(import_module("fault_matrix").main())  # other processes find it by this name
