"""Check nodes with suites of steps: against real nodes on a CAN bus, or simulated ones."""

from __future__ import annotations

import argparse
import datetime
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, campaign, output, version
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError
from eurobot_od.od.values import MOST_SUBS
from eurobot_od.support.files import check_writable

if TYPE_CHECKING:
    from eurobot_od.check.conformance.drive import MotionBounds
    from eurobot_od.check.results import SuiteResult
    from eurobot_od.check.suite import Suite
    from eurobot_od.cli.checking import Checks


FIRST_OWN = 4
"""The first sub-index of 0x1011 that is the maker's (CiA 301, 7.5.2.14)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("files", nargs="*", metavar="FILE", help="suite files, or names of the robot's suites (--list)")
    parser.add_argument("--list", action="store_true", help="list the robot's suites, or the given ones, and exit")
    parser.add_argument("--schema", action="store_true", help="print the JSON Schema of suites, for editors, and exit")
    parser.add_argument("--simulate", action="store_true", help="check simulated nodes, in simulated time")
    parser.add_argument("--fault", action="append", default=[], metavar="NAME", help="give simulated nodes a fault")
    parser.add_argument(
        "--shared-world", action="store_true", help="the nodes on the bus share the world that a suite needs"
    )
    parser.add_argument("--tag", action="append", default=[], metavar="TAG", help="run the suites with this tag")
    parser.add_argument(
        "--step",
        action="append",
        default=[],
        metavar="TEXT",
        help="run the steps whose names contain this, and those before them",
    )
    _add_generated(parser)
    parser.add_argument("--keep-going", action="store_true", help="go on with the next step after a failed one")
    parser.add_argument(
        "--repeat",
        type=shared.whole(1, what="a number of times"),
        default=1,
        metavar="N",
        help="run everything N times, seed by seed",
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of everything random in the simulation (default: 1)")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write a JUnit XML report")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print as JSON")
    form.add_argument("--ctt", action="store_true", help="conformance: print by the numbers of CiA's test tool")
    form.add_argument("--format", choices=("github",), help="also print annotations for GitHub Actions")
    form.add_argument("-v", "--verbose", action="store_true", help="print every step, green and skipped ones too")
    form.add_argument("-q", "--quiet", action="store_true", help="print only the red steps and the last line")
    campaign.add_campaign(parser, "--simulate --repeat")
    shared.add_network(parser)
    shared.add_bus(parser)


def _add_generated(parser: argparse.ArgumentParser) -> None:
    """Describe the options of suites that are made from the EDS files."""
    parser.add_argument("--conformance", action="store_true", help="make the suites from the EDS files, by CiA 301")
    parser.add_argument(
        "--profile", type=int, choices=(401, 402), help="make the suites from the EDS files, by a device profile"
    )
    parser.add_argument(
        "--motion",
        type=_motion,
        metavar="DISTANCE@VELOCITY",
        help="profile 402: also move the motor, at most this far and this fast, in the drive's units",
    )
    parser.add_argument("--outputs", action="store_true", help="profile 401: also switch the outputs")
    tier = parser.add_mutually_exclusive_group()
    tier.add_argument(
        "--reversible",
        action="store_true",
        help="conformance: also reset, write PDOs and own values; profile: also the state machine, settings",
    )
    tier.add_argument("--destructive", action="store_true", help="conformance: also write other values, and store")
    parser.add_argument(
        "--restore",
        action="append",
        type=shared.whole(FIRST_OWN, MOST_SUBS, what="a sub-index of the maker's"),
        default=[],
        metavar="SUB",
        help="conformance, destructive: also restore what the maker has behind this sub-index of 0x1011",
    )
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="conformance: write a page for the maker, as .html, .md or .json"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="conformance, profile: write the suites, and exit"
    )


def _motion(text: str) -> MotionBounds:
    """Read how far and how fast a motor may be moved; raises ArgumentTypeError."""
    from eurobot_od.check.conformance.drive import MotionBounds

    distance, _, velocity = text.partition("@")
    limits = MotionBounds(*(int(each) if each.isdecimal() and len(each) < 10 else 0 for each in (distance, velocity)))
    if not all(limits):
        raise argparse.ArgumentTypeError(f"{text!r}: a distance and a velocity above 0, such as 2000@100")
    return limits


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Read the suites, run them, and report."""
    from eurobot_od.cli.checking import Checks, listed

    _refuse_what_does_not_go_together(arguments)
    for file in (arguments.junit, arguments.report):
        if file is not None:
            check_writable(file)
    own = {name: getattr(arguments, name) for name in Checks._fields if name not in ("devices", "open_bus")}
    checks = Checks(shared.Devices.of(arguments), shared.opener(arguments), **own)
    for name in checks.fault:
        checks.devices.robot.find_fault(name)  # complains of a name before the first suite, not in it
    with shared.left_out() as refused:
        reader = checks.reader(refused)
        if arguments.schema:
            print(json.dumps(reader.schema(), indent=1))
            return ExitStatus.FINE
        if arguments.output is not None:
            texts = checks.conformance_texts() if checks.conformance else checks.profile_texts()
            output.write(arguments.output, "".join(texts.values()))
            return ExitStatus.FINE
        suites = checks.suites(reader)
    if arguments.list:
        print(*listed(suites), sep="\n")
        return ExitStatus.FINE
    return _run(arguments, checks, suites)


def _run(arguments: argparse.Namespace, checks: Checks, suites: Sequence[Suite]) -> ExitStatus:
    """Run the suites with each seed, in this process or in workers, and report."""
    from eurobot_od.check.results import CheckedSeed
    from eurobot_od.check.runner import Interrupt
    from eurobot_od.cli.checking import Printer, many_results, results_of

    interrupt, seeds = Interrupt(), range(arguments.seed, arguments.seed + arguments.repeat)
    silent = arguments.json or arguments.quiet or arguments.ctt
    printer = Printer(bool(silent), arguments.verbose)
    with interrupt.by_ctrl_c():
        if any(getattr(arguments, option) for option in campaign.OPTIONS):
            kept = campaign.results(arguments, CheckedSeed, lambda: checks.settings(suites))
            with campaign.workers(arguments, len(seeds)) as workers:
                results = list(many_results(checks, suites, seeds, interrupt, printer, workers, kept))
        else:
            results = list(results_of(checks, suites, seeds, interrupt, printer))
    _report(arguments, checks, results)
    if interrupt.requested:
        return ExitStatus.INTERRUPTED
    if any(result.error for result in results):
        return ExitStatus.TROUBLE
    return ExitStatus.FOUND if any(result.failed for result in results) else ExitStatus.FINE


def _refuse_what_does_not_go_together(arguments: argparse.Namespace) -> None:
    if arguments.fault and not arguments.simulate:
        raise LocalError("--fault needs --simulate: it is a fault of a simulated node")
    if arguments.conformance and arguments.files:
        raise LocalError(f"--conformance makes its suites from the EDS files: leave out {arguments.files[0]}")
    if not arguments.simulate:
        campaign.refuse(arguments, "--simulate --repeat")
    if arguments.profile and (arguments.conformance or arguments.files):
        raise LocalError("--profile makes its suites from the EDS files: leave out --conformance, and files")
    for option, profile in (("motion", 402), ("outputs", 401)):
        if getattr(arguments, option) and arguments.profile != profile:
            raise LocalError(f"--{option} needs --profile {profile}")
    if arguments.restore and not arguments.destructive:
        raise LocalError("--restore needs --destructive")
    if arguments.report is not None:
        from eurobot_od.check.conformance.page import check_form

        check_form(arguments.report)
    for option in ("reversible", "destructive", "output", "report", "ctt"):
        profiled = arguments.profile and option in ("reversible", "output")
        if getattr(arguments, option) and not (arguments.conformance or profiled):
            raise LocalError(f"--{option} needs --conformance")


def _report(arguments: argparse.Namespace, checks: Checks, results: Sequence[SuiteResult]) -> None:
    """Print the failures again and the summary, or the whole report in another form; write the files."""
    from eurobot_od.check import report
    from eurobot_od.check.conformance import ctt, page

    if arguments.json:
        print(json.dumps(report.as_data(results), indent=2))
    elif arguments.ctt:
        for each in checks.conformance_reports(results, ""):
            print(each.dictionary.name, *ctt.lines(each.tests), sep="\n")
    else:
        sys.stdout.writelines(f"{line}\n" for line in report.failures(results))
        print(report.summary(results))
        for line in report.github(results) if arguments.format else ():
            print(line)
    if arguments.junit is not None:
        output.write(arguments.junit, report.junit(results))
    if arguments.report is not None:
        made = f"{version()}, {datetime.date.today()}"
        output.write(arguments.report, page.text(arguments.report, checks.conformance_reports(results, made)))
