"""Runs suites one after the other, on a bus or simulated, and compares a run with the one before it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from eurobot_od.check.report import StepResult, SuiteResult
from eurobot_od.check.suite import Report, Suite
from eurobot_od.errors import LocalError
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    import can

    from eurobot_od.check.runner import Interrupt, RunOptions

Show = Callable[[StepResult], None]
"""Called with each step's result as it comes."""


class Told(Protocol):
    """What hears of a run as it goes on."""

    def heading(self, suite: Suite, how: str) -> None:
        """Take in that a suite begins, and how it is run, or why it is not."""

    def step(self, step: StepResult) -> None:
        """Take in a step's result."""

    def end(self, result: SuiteResult) -> None:
        """Take in the result of a suite."""


class HowToRun(Protocol):
    """How suites are run; `is_made` tells that they are made from a device's file, and find all that is wrong."""

    @property
    def is_made(self) -> bool:
        """Whether each step stands alone, so that a red one does not end the run."""

    def how(self, seed: int) -> str:
        """Return how suites are run, in words for reports."""

    def skips(self, suite: Suite) -> str:
        """Return why a suite is skipped; empty if it is run."""

    def run(self, suite: Suite, seed: int, interrupt: Interrupt, reported: set[Report], show: Show) -> SuiteResult:
        """Run a suite; `reported` has what suites before it have found in a node."""


def run_options(
    *, keep_going: bool, is_made: bool, steps: Sequence[str], interrupt: Interrupt, reported: set[Report], show: Show
) -> RunOptions:
    """Return the options of a run."""
    from eurobot_od.check.runner import RunOptions  # suites are listed without

    return RunOptions(keep_going or is_made, partial(is_chosen, steps), is_made, interrupt, show, reported)


@dataclass(frozen=True)
class OnBus:
    """How suites are run on a bus that `open_bus` opens; only the `steps` with one of these texts in their name."""

    open_bus: Callable[[], can.BusABC]
    is_made: bool = False
    steps: Sequence[str] = ()

    def how(self, _: int) -> str:
        """Return how suites are run, in words for reports."""
        return "on the bus"

    def skips(self, _: Suite) -> str:
        """Skip none."""
        return ""

    def run(self, suite: Suite, _: int, interrupt: Interrupt, reported: set[Report], show: Show) -> SuiteResult:
        """Run a suite; raises BusError."""
        from eurobot_od.check.on_bus import run_live

        options = run_options(
            keep_going=False,
            is_made=self.is_made,
            steps=self.steps,
            interrupt=interrupt,
            reported=reported,
            show=show,
        )
        return run_live(suite, options, self.open_bus)


def is_chosen(texts: Sequence[str], name: str) -> bool:
    """Return whether a step's name contains one of some texts; without texts all are chosen."""
    return not texts or any(text.lower() in name.lower() for text in texts)


def chosen(suites: Sequence[Suite], tags: Sequence[str], steps: Sequence[str]) -> list[Suite]:
    """Return the suites with one of the tags and with one of the steps, all if there are none; raises LocalError."""
    tagged = [suite for suite in suites if not tags or set(tags) & set(suite.tags)]
    if not tagged:
        known = sorted({tag for suite in suites for tag in suite.tags})
        raise LocalError(f"no suite is tagged {' or '.join(tags)}; tags: {', '.join(known) or 'none'}")
    found = [suite for suite in tagged if any(is_chosen(steps, step.name) for step in suite.steps)]
    if steps and not found:
        raise LocalError(f"no step is named like {' or '.join(steps)}")
    return found if steps else tagged


def listed(suites: Iterable[Suite]) -> Iterator[str]:
    """Yield a line for each suite."""
    for suite in suites:
        where = f"{', '.join(suite.nodes)}; {suite.dialect or 'any dialect'}"
        tags = f"  [{', '.join(suite.tags)}]" if suite.tags else ""
        yield one_line(f"{suite.file.stem:<24} {len(suite.steps):>4} steps  {suite.name} ({where}){tags}")


def results_of(
    checks: HowToRun, suites: Sequence[Suite], seeds: Iterable[int], interrupt: Interrupt, told: Told
) -> Iterator[SuiteResult]:
    """Run the suites for all seeds, until an interrupt or until the bus fails.

    Those that cannot be run any more have a result that says why.
    """
    from eurobot_od.check.runner import not_run

    gone: dict[tuple[str, ...], str] = {}  # a device that does not come back from a reset is reported once
    everything = ""
    for seed in seeds:
        if everything:
            return
        reported = set[Report]()
        for suite in suites:
            everything = everything or ("interrupted" if interrupt.requested else "")
            if everything and not checks.is_made:
                return
            if why := everything or gone.get(suite.nodes, ""):
                told.heading(suite, f"not run: {why}")
                yield not_run(suite, checks.how(seed), why)
                continue
            told.heading(suite, checks.skips(suite) or checks.how(seed))
            result = checks.run(suite, seed, interrupt, reported, told.step)
            told.end(result)
            yield result
            if result.error:  # the bus is gone, for all suites that follow
                everything = f"the bus failed: {result.error}"
            if checks.is_made and result.ended:
                gone[suite.nodes] = f"'{result.ended}' is red in '{result.name}', and nothing else can be asked"


# Two runs


def compared(before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Return the steps that have not ended as in the run before, both as `report.as_data` gives them.

    A step that only one of the runs has ended as `-` in the other.
    """
    former, present = _statuses(before), _statuses(after)
    return [
        {
            "suite": suite,
            "step": name,
            "before": former.get((suite, name), "-"),
            "after": present.get((suite, name), "-"),
        }
        for suite, name in dict.fromkeys([*present, *former])
        if former.get((suite, name)) != present.get((suite, name))
    ]


def _statuses(results: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    return {(str(each["name"]), str(step["name"])): str(step["status"]) for each in results for step in each["steps"]}
