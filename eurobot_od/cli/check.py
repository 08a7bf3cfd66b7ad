"""Check nodes with suites of steps: against real nodes on a CAN bus, or simulated ones."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, campaign, output
from eurobot_od.cli import options as shared
from eurobot_od.cli.terminal import in_colour
from eurobot_od.errors import LocalError
from eurobot_od.support.escaping import one_line
from eurobot_od.support.files import check_writable

if TYPE_CHECKING:
    from eurobot_od.check.reader import SuiteReader
    from eurobot_od.check.results import CheckedSeed, StepResult, SuiteResult
    from eurobot_od.check.runner import Interrupt
    from eurobot_od.check.suite import Suite
    from eurobot_od.check.vocabulary import Networks
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.pdos import OnRefused


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("files", nargs="*", metavar="FILE", help="suite files, or names of the robot's suites (--list)")
    parser.add_argument("--list", action="store_true", help="list the robot's suites, or the given ones, and end")
    parser.add_argument("--schema", action="store_true", help="print the JSON Schema of suites, for editors, and end")
    parser.add_argument("--simulate", action="store_true", help="check simulated nodes, in simulated time")
    parser.add_argument("--fault", action="append", default=[], metavar="NAME", help="give simulated nodes a fault")
    parser.add_argument(
        "--shared-world", action="store_true", help="the nodes on the bus share the world that a suite needs"
    )
    parser.add_argument("--tag", action="append", default=[], metavar="TAG", help="run the suites with this tag")
    parser.add_argument(
        "--step", action="append", default=[], metavar="TEXT", help="do the steps named like this, and those before"
    )
    parser.add_argument("--conformance", action="store_true", help="make the suites from the EDS files: CiA 301")
    tier = parser.add_mutually_exclusive_group()
    tier.add_argument("--reversible", action="store_true", help="conformance: also reset, write PDOs and own values")
    tier.add_argument("--destructive", action="store_true", help="conformance: also write other values, and store")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="conformance: write the suites, and end")
    parser.add_argument("--keep-going", action="store_true", help="go on with the next step after a failed one")
    parser.add_argument("--repeat", type=_count, default=1, metavar="N", help="run everything N times, seed by seed")
    parser.add_argument("--seed", type=int, default=1, help="seed of all chance in the simulation (default: 1)")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write a JUnit XML report")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--tap", action="store_true", help="print as TAP")
    form.add_argument("--json", action="store_true", help="print as JSON")
    form.add_argument("--format", choices=("github",), help="also print annotations for GitHub Actions")
    form.add_argument("-v", "--verbose", action="store_true", help="print every step, also green and skipped ones")
    form.add_argument("-q", "--quiet", action="store_true", help="print what is red, and the last line")
    campaign.add_campaign(parser, "--simulate --repeat")
    shared.add_network(parser)
    shared.add_bus(parser)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number of times")
    return int(text)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Read the suites, run them, and report."""
    from eurobot_od.check.reader import SuiteError, SuiteReader

    _refuse_what_does_not_go_together(arguments)
    if arguments.junit is not None:
        check_writable(arguments.junit)
    with shared.left_out() as refused:
        reader = SuiteReader(_networks(arguments, refused), arguments.dialect)
        if arguments.schema:
            print(json.dumps(reader.schema(), indent=1))
            return ExitStatus.FINE
        if arguments.output is not None:
            output.write(arguments.output, "".join(_conformance(arguments).values()))
            return ExitStatus.FINE
        try:
            suites = _suites(arguments, reader)
        except SuiteError as error:
            print(error, file=sys.stderr)
            return ExitStatus.WRONG_INPUT
    if arguments.list:
        for suite in suites:
            where = f"{', '.join(suite.nodes)}; {suite.dialect or 'any dialect'}"
            tags = f"  [{', '.join(suite.tags)}]" if suite.tags else ""
            print(one_line(f"{suite.file.stem:<24} {len(suite.steps):>4} steps  {suite.name} ({where}){tags}"))
        return ExitStatus.FINE
    return _check(arguments, suites)


def _suites(arguments: argparse.Namespace, reader: SuiteReader) -> list[Suite]:
    """Read the suites that are asked for; raises SuiteError, LocalError."""
    robot = shared.robot(arguments)
    if arguments.conformance:
        read = reader.read_texts(_conformance(arguments))
    else:
        files = [robot.suite(name) for name in arguments.files] or list(robot.shipped_suites().values())
        read = reader.read_files(files)
    return _chosen(read, arguments.tag, arguments.step)


def _refuse_what_does_not_go_together(arguments: argparse.Namespace) -> None:
    if arguments.fault and not arguments.simulate:
        raise LocalError("--fault needs --simulate: it is a fault of a simulated node")
    for name in arguments.fault:
        shared.robot(arguments).find_fault(name)  # complains of a name before the first suite, not in it
    if arguments.conformance and arguments.files:
        raise LocalError(f"--conformance makes its suites from the EDS files: leave out {arguments.files[0]}")
    if not arguments.simulate:
        campaign.refuse(arguments, "--simulate --repeat")
    for option in ("reversible", "destructive", "output"):
        if getattr(arguments, option) and not arguments.conformance:
            raise LocalError(f"--{option} needs --conformance")


def _conformance(arguments: argparse.Namespace) -> dict[Path, str]:
    """Make the suites of each device, by what reports call their file."""
    from eurobot_od.check.conformance import suite
    from eurobot_od.check.conformance.subject import Tier

    tier = next((each for each in Tier if each and getattr(arguments, each.word)), Tier.READING)
    return {Path(f"{each.name}.yaml"): suite.text(each, tier) for each in shared.devices(arguments)}


def _networks(arguments: argparse.Namespace, refused: OnRefused) -> Networks:
    """Return the dialects, and the devices that the command line names for suites that name no dialect."""
    from eurobot_od.od import network

    known = shared.robot(arguments).networks()._replace(refused=refused)
    files = shared.named_files(arguments)
    if not files:
        return known
    named = Path(arguments.network or files[0].file)

    def load(path: Path) -> tuple[Dictionary, ...]:
        if path != named:
            return known.load(path)
        loaded = network.load(files)
        shared.tell_repairs(loaded)
        return loaded

    return known._replace(find=lambda dialect: known.find(dialect) if dialect else named, load=load)


def _chosen(suites: Sequence[Suite], tags: Sequence[str], steps: Sequence[str]) -> list[Suite]:
    """Return the suites with one of the tags and with one of the steps; all if nothing is asked for.

    Raises LocalError if that leaves nothing.
    """
    tagged = [suite for suite in suites if not tags or set(tags) & set(suite.tags)]
    if not tagged:
        known = sorted({tag for suite in suites for tag in suite.tags})
        raise LocalError(f"no suite is tagged {' or '.join(tags)}; tags: {', '.join(known) or 'none'}")
    chosen = [suite for suite in tagged if not steps or any(_is_chosen(steps, step.name) for step in suite.steps)]
    if not chosen:
        raise LocalError(f"no step is named like {' or '.join(steps)}")
    return chosen


def _check(arguments: argparse.Namespace, suites: Sequence[Suite]) -> ExitStatus:
    from eurobot_od.check.runner import Interrupt

    interrupt = Interrupt()
    many = any(getattr(arguments, option) for option in campaign.OPTIONS)
    with interrupt.by_ctrl_c():
        results = list((_many_results if many else _results)(arguments, suites, interrupt))
    _report(arguments, results)
    if interrupt.requested:
        return ExitStatus.INTERRUPTED
    if any(result.error for result in results):
        return ExitStatus.TROUBLE
    return ExitStatus.FOUND if any(result.failed for result in results) else ExitStatus.FINE


def _results(arguments: argparse.Namespace, suites: Sequence[Suite], interrupt: Interrupt) -> Iterator[SuiteResult]:
    """Run the suites, as often as asked for, until an interrupt or until the bus fails."""
    gone: set[tuple[str, ...]] = (
        set()
    )  # a device that does not come back from a reset is told once, not in each chapter
    for seed in range(arguments.seed, arguments.seed + arguments.repeat):
        for suite in suites:
            if interrupt.requested:
                return
            if suite.nodes in gone:
                continue
            result = _run_one(arguments, suite, seed, interrupt)
            _show_end(arguments, result)
            yield result
            if result.error:
                return
            if arguments.conformance and result.ended:
                gone.add(suite.nodes)


# Seeds at once


def _many_results(
    arguments: argparse.Namespace, suites: Sequence[Suite], interrupt: Interrupt
) -> Iterator[SuiteResult]:
    """Run the suites for all seeds by several workers, and show what `_results` shows, seed by seed."""
    from eurobot_od.campaign import blocks
    from eurobot_od.check.results import CheckedSeed

    seeds = range(arguments.seed, arguments.seed + arguments.repeat)
    silent = argparse.Namespace(**{**vars(arguments), "json": True})
    kept = campaign.results(arguments, CheckedSeed, lambda: _settings(arguments, suites))
    with campaign.workers(arguments, len(seeds)) as workers:
        done = blocks.run(partial(_check_seed, silent), seeds, workers, kept)
        for seed, results in campaign.counted(done, len(seeds), "seeds", workers, hidden=not _silent(arguments)):
            for suite, result in zip(suites, results):
                _show_result(arguments, suite, seed, result)
                yield result
            if interrupt.requested:
                return


DEPENDED_ON = (
    *("robot", "dialect", "eds", "network", "fault", "tag", "step"),
    *("conformance", "reversible", "destructive", "keep_going"),
)
"""Options that the results of a seed depend on."""


def _settings(arguments: argparse.Namespace, suites: Sequence[Suite]) -> dict[str, str]:
    """Return all that the results of any seeds depend on: the options, and what the files have in them."""
    from eurobot_od.campaign.files import digest_of

    named = [Path(each.file) for each in shared.named_files(arguments)]
    dialects = shared.robot(arguments).dialects
    folders = {dialects.folder(each.dialect or arguments.dialect) for each in suites if each.dialect or not named}
    eds = [file for folder in sorted(folders) for file in sorted(folder.glob("*.eds"))]
    given = {name: str(getattr(arguments, name)) for name in DEPENDED_ON}
    return {"campaign": "checks", **given, "files": digest_of([*(suite.file for suite in suites), *named, *eds])}


def _check_seed(arguments: argparse.Namespace, seed: int) -> CheckedSeed:
    """Run all suites for one seed, in any process."""
    from eurobot_od.check.reader import SuiteReader
    from eurobot_od.check.results import CheckedSeed
    from eurobot_od.check.runner import Interrupt

    suites = _suites(arguments, SuiteReader(_networks(arguments, lambda _: None), arguments.dialect))
    return CheckedSeed(seed, tuple(_run_one(arguments, suite, seed, Interrupt()) for suite in suites))


def _show_result(arguments: argparse.Namespace, suite: Suite, seed: int, result: SuiteResult) -> None:
    from eurobot_od.check import report

    if not _silent(arguments):
        print(report.heading(suite, result.skipped or _how(arguments, seed)), flush=True)
    for step in result.steps:
        _show(arguments, step)
    _show_end(arguments, result)


def _run_one(arguments: argparse.Namespace, suite: Suite, seed: int, interrupt: Interrupt) -> SuiteResult:
    from eurobot_od.check import report
    from eurobot_od.check.results import SuiteResult
    from eurobot_od.check.runner import RunOptions

    how = _how(arguments, seed)
    robot = shared.robot(arguments)
    dialects = robot.dialects
    fits = None in (suite.dialect, arguments.dialect) or (
        dialects.folder(suite.dialect) == dialects.folder(arguments.dialect)
    )
    apart = suite.world and not arguments.simulate and not arguments.shared_world
    reason = "" if fits else f"skipped: it is for the dialect {suite.dialect}"
    reason = "skipped: its nodes have to share a world (--shared-world: they do)" if apart else reason
    if not _silent(arguments):
        print(report.heading(suite, reason or how), flush=True)
    if reason:
        return SuiteResult(suite.file, suite.name, how, skipped=reason)
    chosen, show = partial(_is_chosen, arguments.step), partial(_show, arguments)
    # A conformance suite is to find all that is wrong with a device; its steps do not build on each other.
    conformance = arguments.conformance
    options = RunOptions(arguments.keep_going or conformance, chosen, conformance, interrupt, show)
    if arguments.simulate:
        return robot.simulate(suite, options, arguments.fault, seed)
    from eurobot_od.check.live import run_live

    return run_live(suite, options, partial(shared.open_bus, arguments))


def _how(arguments: argparse.Namespace, seed: int) -> str:
    return f"simulated, seed {seed}" if arguments.simulate else "on the bus"


def _is_chosen(texts: Sequence[str], name: str) -> bool:
    return not texts or any(text.lower() in name.lower() for text in texts)


# Reports


def _report(arguments: argparse.Namespace, results: Sequence[SuiteResult]) -> None:
    """Print what is left to be said, and write the JUnit report."""
    from eurobot_od.check import report

    if arguments.tap:
        print("\n".join(report.tap(results)))
    elif arguments.json:
        print(json.dumps(report.as_data(results), indent=2))
    else:
        sys.stdout.writelines(f"{line}\n" for line in report.failures(results))
        print(report.summary(results))
        for line in report.github(results) if arguments.format else ():
            print(line)
    if arguments.junit is not None:
        output.write(arguments.junit, report.junit(results))


def _silent(arguments: argparse.Namespace) -> bool:
    """Whether nothing is printed while the suites run: standard output is one document."""
    return bool(arguments.tap or arguments.json or arguments.quiet)


def _show(arguments: argparse.Namespace, step: StepResult) -> None:
    """Print a step's line as it ends, unless it is only counted; with -v also why."""
    from eurobot_od.check import report

    if _silent(arguments) or (step.status in report.UNEVENTFUL and not arguments.verbose):
        return
    print(report.step_line(step, in_colour(sys.stdout)))
    if step.reason is not None and arguments.verbose:
        print("\n".join(report.reason_lines(step.reason)))
    sys.stdout.flush()


def _show_end(arguments: argparse.Namespace, result: SuiteResult) -> None:
    """Print how many of a suite's steps have not been shown."""
    from eurobot_od.check import report

    counted = report.folded(result)
    if counted and not (_silent(arguments) or arguments.verbose):
        print(f"  {counted}", flush=True)
