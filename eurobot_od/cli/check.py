"""Check nodes with suites of steps: against real nodes on a CAN bus, or simulated ones."""

from __future__ import annotations

import datetime
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from eurobot_od.check import report
from eurobot_od.check.results import CheckedSeed, SuiteResult
from eurobot_od.check.runner import Interrupt
from eurobot_od.cli import ExitStatus, version
from eurobot_od.cli.campaign import Campaign
from eurobot_od.cli.checking import Checks, Printer, listed, many_results, results_of
from eurobot_od.cli.devices import left_out
from eurobot_od.cli.options import Json, Output, whole, write
from eurobot_od.cli.signature import HelpGroup, Option
from eurobot_od.errors import LocalError
from eurobot_od.support.files import check_writable

AT_ONCE = "--simulate --repeat"
"""The options with which many things are done at once."""


@dataclass(frozen=True, kw_only=True)
class CheckReport:
    """What is said of a check: on standard output in one form, and in files.

    page: conformance: write a page for the maker, as .html, .md or .json
    junit: write a JUnit XML report
    ctt: conformance: print by the numbers of CiA's test tool
    format: also print annotations for GitHub Actions
    verbose: print every step, green and skipped ones too
    quiet: print only the red steps and the last line
    """

    page: Annotated[Path | None, Option("--report", metavar="FILE")] = None
    junit: Annotated[Path | None, Option(metavar="FILE")] = None
    as_json: Annotated[Json, Option(either="form")] = False
    ctt: Annotated[bool, Option(either="form")] = False
    format: Annotated[Literal["github"] | None, Option(either="form")] = None
    verbose: Annotated[bool, Option("-v", either="form")] = False
    quiet: Annotated[bool, Option("-q", either="form")] = False

    def check_files(self) -> None:
        """Raise LocalError, OSError for a file that could not be written: before the check, not after it."""
        if self.page is not None:
            from eurobot_od.check.conformance.page import check_form

            check_form(self.page)
        for file in (self.junit, self.page):
            if file is not None:
                check_writable(file)

    @property
    def printer(self) -> Printer:
        """What prints the suites as they run."""
        return Printer(silent=self.as_json or self.ctt or self.quiet, verbose=self.verbose)

    def give(self, checks: Checks, results: Sequence[SuiteResult]) -> None:
        """Print the failures again and the summary, or the whole report in another form; write the files."""
        if self.as_json:
            print(json.dumps(report.as_data(results), indent=2))
        elif self.ctt:
            from eurobot_od.check.conformance.ctt import lines

            for each in checks.made.device_runs(checks.devices.load(), results, ""):
                print(each.dictionary.name, *lines(each.tests), sep="\n")
        else:
            sys.stdout.writelines(f"{line}\n" for line in report.failures(results))
            print(report.summary(results))
            sys.stdout.writelines(f"{line}\n" for line in report.github(results) if self.format)
        if self.junit is not None:
            write(self.junit, report.junit(results))
        if self.page is not None:
            from eurobot_od.check.conformance.page import text

            made = f"{version()}, {datetime.date.today()}"
            write(self.page, text(self.page, checks.made.device_runs(checks.devices.load(), results, made)))


def check(
    checks: Checks,
    *,
    list: bool = False,
    schema: bool = False,
    output: Output = None,
    repeat: Annotated[int, Option(metavar="N", read=whole(1, what="a number of times"))] = 1,
    seed: int = 1,
    report: CheckReport,
    campaign: Annotated[Campaign, HelpGroup(f"many at once, with {AT_ONCE}")],
) -> ExitStatus:
    """Check nodes with suites of steps: against real nodes on a CAN bus, or simulated ones.

    list: list the robot's suites, or the given ones, and exit
    schema: print the JSON Schema of suites, for editors, and exit
    output: conformance, profile: write the suites, and exit
    repeat: run everything N times, seed by seed
    seed: seed of everything random in the simulation (default: 1)
    """
    _refuse_what_does_not_go_together(checks, {"output": output, "report": report.page, "ctt": report.ctt})
    if not checks.simulate:
        campaign.refuse(AT_ONCE)
    report.check_files()
    for name in checks.fault:
        checks.devices.robot.find_fault(name)  # complains of a name before the first suite, not in it
    with left_out() as refused:
        reader = checks.reader(refused)
        if schema:
            print(json.dumps(reader.schema(), indent=1))
            return ExitStatus.FINE
        if output is not None:
            write(output, "".join(checks.made.texts(checks.devices.load()).values()))
            return ExitStatus.FINE
        suites = checks.suites(reader)
    if list:
        print(*listed(suites), sep="\n")
        return ExitStatus.FINE
    interrupt, seeds = Interrupt(), range(seed, seed + repeat)
    with interrupt.by_ctrl_c():
        if campaign.given:
            kept = campaign.kept(CheckedSeed, lambda: checks.settings(suites))
            with campaign.workers(len(seeds)) as workers:
                results = [*many_results(checks, suites, seeds, interrupt, report.printer, workers, kept)]
        else:
            results = [*results_of(checks, suites, seeds, interrupt, report.printer)]
    report.give(checks, results)
    if interrupt.requested:
        return ExitStatus.INTERRUPTED
    if any(result.error for result in results):
        return ExitStatus.TROUBLE
    return ExitStatus.FOUND if any(result.failed for result in results) else ExitStatus.FINE


def _refuse_what_does_not_go_together(checks: Checks, of_made: Mapping[str, object]) -> None:
    """Raise LocalError; `of_made` are options that say something of suites that are made."""
    made = checks.made
    if checks.fault and not checks.simulate:
        raise LocalError("--fault needs --simulate: it is a fault of a simulated node")
    if made.conformance and checks.files:
        raise LocalError(f"--conformance makes its suites from the EDS files: leave out {checks.files[0]}")
    if made.profile and (made.conformance or checks.files):
        raise LocalError("--profile makes its suites from the EDS files: leave out --conformance, and files")
    made.check()
    for option, value in of_made.items():
        if value and not (made.conformance or (made.profile and option == "output")):
            raise LocalError(f"--{option} needs --conformance")
