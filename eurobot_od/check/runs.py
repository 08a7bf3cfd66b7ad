"""Runs several suites, on a bus or simulated, and compares two runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from eurobot_od.check.report import CheckedDevice, StepResult, SuiteResult
from eurobot_od.check.suite import Group, Report, Step, Suite
from eurobot_od.errors import MOST_SHOWN, LocalError, RemoteError, meant
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import stranger
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    import can

    from eurobot_od.check.runner import Interrupt, RunOptions
    from eurobot_od.client.master import Master

Show = Callable[[StepResult], None]
"""Called with each step's result, as soon as it is known."""


class RunListener(Protocol):
    """Is called while suites run, for output."""

    def heading(self, suite: Suite, how: str) -> None:
        """Called before a suite; `how` says how it is run, or why it is not."""

    def step(self, step: StepResult) -> None:
        """Called with each step's result."""

    def end(self, result: SuiteResult) -> None:
        """Called with a suite's result."""


class SuiteRunner(Protocol):
    """Runs suites, on a bus or simulated."""

    @property
    def is_made(self) -> bool:
        """Whether the suites are made from a device's file; then they go on after a red step."""

    def how(self, seed: int) -> str:
        """Return for reports how suites are run."""

    def skips(self, suite: Suite) -> str:
        """Return why a suite is skipped; empty if it is run."""

    def run(self, suite: Suite, seed: int, interrupt: Interrupt, reported: set[Report], show: Show) -> SuiteResult:
        """Run a suite; `reported` holds the findings that are reported once per node, of all suites so far."""


def run_options(
    *,
    keep_going: bool,
    is_made: bool,
    steps: Sequence[str],
    interrupt: Interrupt,
    reported: set[Report],
    show: Show,
    level: str = "",
) -> RunOptions:
    """Return the options of a run."""
    from eurobot_od.check.runner import RunOptions  # here, as listing suites does not need it

    return RunOptions(keep_going or is_made, partial(is_chosen, steps), is_made, interrupt, show, reported, level)


@dataclass(frozen=True)
class OnBus:
    """Runs suites on the bus that `open_bus` opens, `bus` in words; of `is_made` see SuiteRunner.

    Of each suite only the steps are run that have one of the texts of `steps` in their name; empty: all.
    """

    open_bus: Callable[[], can.BusABC]
    is_made: bool = False
    steps: Sequence[str] = ()
    bus: str = ""

    def how(self, _: int) -> str:
        """Return for reports how suites are run."""
        return f"on the bus {self.bus}".strip()

    def skips(self, _: Suite) -> str:
        """Return an empty text: on a bus no suite is skipped."""
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


def above(suites: Iterable[Suite], level: str) -> list[str]:
    """Return the names of the steps above a level; raises LocalError if there are none."""
    steps = [step for suite in suites for step in suite.steps if step.above]
    levels = sorted({step.above for step in steps})
    if level not in levels:
        raise LocalError(f"no step is above a level {level}; levels: {', '.join(levels) or 'none'}")
    return [step.name for step in steps if step.above == level]


def chosen(suites: Sequence[Suite], tags: Sequence[str], steps: Sequence[str]) -> list[Suite]:
    """Return the suites with one of the tags and one of the steps; empty: all. Raises LocalError if none is left."""
    tagged = [suite for suite in suites if not tags or set(tags) & set(suite.tags)]
    if not tagged:
        known = sorted({tag for suite in suites for tag in suite.tags})
        raise LocalError(f"no suite is tagged {' or '.join(tags)}; tags: {', '.join(known) or 'none'}")
    found = [suite for suite in tagged if any(is_chosen(steps, step.name) for step in suite.steps)]
    if steps and not found:
        names = [*dict.fromkeys(step.name for suite in tagged for step in suite.steps)]
        hint = meant(steps[0], names) or f"; steps: {'; '.join(names)}"
        if len(hint) > MOST_SHOWN:
            hint = f"; there are {len(names)}, and -v prints them"
        raise LocalError(f"no step is named like {' or '.join(steps)}{hint}")
    return found if steps else tagged


def number_of_steps(suite: Suite) -> int:
    """Return how many steps a run of a suite reports if none is red, groups counted by what is in them."""
    return sum(map(_single_steps, (*suite.setup, *suite.steps, *suite.teardown)))


def _single_steps(step: Step) -> int:
    if not isinstance(step.action, Group):
        return 1
    return step.repeat * sum(map(_single_steps, step.action.steps))


def listed(suites: Iterable[Suite]) -> Iterator[str]:
    """Yield one line per suite."""
    for suite in suites:
        where = f"{', '.join(suite.nodes)}; {suite.dialect or 'any dialect'}"
        tags = f"  [{', '.join(suite.tags)}]" if suite.tags else ""
        yield one_line(f"{suite.file.stem:<24} {number_of_steps(suite):>4} steps  {suite.name} ({where}){tags}")


def results_of(
    runner: SuiteRunner, suites: Sequence[Suite], seeds: Iterable[int], interrupt: Interrupt, listener: RunListener
) -> Iterator[SuiteResult]:
    """Run the suites for all seeds and yield their results, until an interrupt or until the bus fails.

    For generated suites (`is_made`), those that cannot be run any more have a result with the reason.
    """
    from eurobot_od.check.runner import not_run

    gone: dict[tuple[str, ...], str] = {}  # why the other suites of a lost device are not run
    ended = ""
    for seed in seeds:
        if ended:
            return
        reported = set[Report]()
        for suite in suites:
            if interrupt.requested and not ended:
                ended = "interrupted"
            if ended and not runner.is_made:
                return
            if why := ended or gone.get(suite.nodes, ""):
                listener.heading(suite, f"not run: {why}")
                yield not_run(suite, runner.how(seed), why)
                continue
            listener.heading(suite, runner.skips(suite) or runner.how(seed))
            result = runner.run(suite, seed, interrupt, reported, listener.step)
            listener.end(result)
            yield result
            if result.error:
                ended = f"the bus failed: {result.error}"
            if runner.is_made and result.ended:
                gone[suite.nodes] = f"'{result.ended}' is red in '{result.name}', and nothing else can be asked"


def identified(master: Master, dictionaries: Iterable[Dictionary]) -> list[CheckedDevice]:
    """Return devices with the identity that each shows, and why it may not be the one of its file; raises BusError."""
    from eurobot_od.client.description import read_numbers
    from eurobot_od.library.library import identity_of

    found = []
    for each in dictionaries:
        master.follow(each)
        try:
            numbers = read_numbers(master.node(each.node_id))
        except RemoteError as error:
            found.append(CheckedDevice(each, None, f"node {each.node_id} has not shown its identity: {error}"))
        else:
            identity = identity_of(numbers)
            doubt = stranger(each, each.node_id, identity, numbers.get(DEVICE_TYPE))
            found.append(CheckedDevice(each, identity, doubt))
    return found


# Two runs


def compared(before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Return the steps that ended differently in two runs, each given as `report.as_data` returns it.

    A step that only one run has is "-" in the other.
    """
    old, new = _statuses(before), _statuses(after)
    return [
        {
            "suite": suite,
            "step": name,
            "before": old.get((suite, name), "-"),
            "after": new.get((suite, name), "-"),
        }
        for suite, name in dict.fromkeys([*new, *old])
        if old.get((suite, name)) != new.get((suite, name))
    ]


def _statuses(results: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    return {(str(each["name"]), str(step["name"])): str(step["status"]) for each in results for step in each["steps"]}
