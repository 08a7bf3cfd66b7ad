"""What `check` runs and prints: suites on simulated nodes or on a bus, in this process or in others."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.check import report
from eurobot_od.check.reader import SuiteReader
from eurobot_od.check.results import CheckedSeed, StepResult, SuiteResult
from eurobot_od.check.runner import Interrupt, RunOptions
from eurobot_od.cli import campaign
from eurobot_od.cli.options import Devices, complain_of_repairs
from eurobot_od.errors import LocalError
from eurobot_od.od import network
from eurobot_od.support.terminal import in_colour
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    from eurobot_od.bus.live.connection import Opener
    from eurobot_od.check.conformance.drive import MotionBounds
    from eurobot_od.check.conformance.page import DeviceRun
    from eurobot_od.check.conformance.subject import Tier
    from eurobot_od.check.suite import Suite
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.pdos import OnRefused
    from eurobot_od.season.campaign import Workers
    from eurobot_od.season.results import Results


class Checks(NamedTuple):
    """Which suites are run, and how, called as the options are; it can be sent to other processes."""

    devices: Devices
    open_bus: Opener
    files: Sequence[str]
    tag: Sequence[str]
    step: Sequence[str]
    fault: Sequence[str]
    simulate: bool
    shared_world: bool
    conformance: bool
    reversible: bool
    destructive: bool
    restore: Sequence[int]
    keep_going: bool
    profile: int | None = None
    motion: MotionBounds | None = None
    outputs: bool = False

    def reader(self, refused: OnRefused = lambda _: None) -> SuiteReader:
        """Return the reader of suites for the devices; `refused` gets each PDO that is left out."""
        known = self.devices.robot.networks()._replace(refused=refused)
        files = self.devices.files()
        if not files:
            return SuiteReader(known, self.devices.dialect)
        # Suites that name a dialect are for that; all others are for the devices of the command line.
        named = Path(self.devices.network or files[0].file)

        def load(path: Path) -> tuple[Dictionary, ...]:
            if path != named:
                return known.load(path)
            loaded = network.load(files)
            complain_of_repairs(loaded)
            return loaded

        networks = known._replace(find=lambda dialect: known.find(dialect) if dialect else named, load=load)
        return SuiteReader(networks, self.devices.dialect)

    @property
    def tier(self) -> Tier:
        """How far conformance suites may go."""
        from eurobot_od.check.conformance.subject import Tier

        return Tier.DESTRUCTIVE if self.destructive else Tier.REVERSIBLE if self.reversible else Tier.READING

    def conformance_texts(self) -> dict[Path, str]:
        """Make the conformance suites of each device, by what reports call their file."""
        from eurobot_od.check.conformance import suite

        return {_file_of(each): suite.text(each, self.tier, self.restore) for each in self.devices.load()}

    def profile_texts(self) -> dict[Path, str]:
        """Make the suites of each device by its profile, by what reports call their file."""
        from eurobot_od.check.conformance import drive, module

        makers = {
            401: partial(module.text, outputs=self.outputs),
            402: partial(drive.text, motion=self.motion),
        }
        make = makers[self.profile or 402]
        return {_file_of(each): make(each, self.reversible) for each in self.devices.load()}

    @property
    def is_generated(self) -> bool:
        """Whether the suites are made from the EDS files."""
        return self.conformance or self.profile is not None

    def conformance_reports(self, results: Sequence[SuiteResult], made: str) -> list[DeviceRun]:
        """Return what there is to say about each device; `made` says by what and when."""
        from eurobot_od.check.conformance.page import DeviceRun

        of_device = {
            each: [result for result in results if result.file == _file_of(each)] for each in self.devices.load()
        }
        return [DeviceRun(each, self.tier, own, made) for each, own in of_device.items()]

    def suites(self, reader: SuiteReader) -> list[Suite]:
        """Read the suites that are asked for; raises YamlError, LocalError."""
        if self.conformance:
            read = reader.read_texts(self.conformance_texts())
        elif self.profile is not None:
            read = reader.read_texts(self.profile_texts())
        else:
            robot = self.devices.robot
            files = [robot.suite(name) for name in self.files] or [*robot.shipped_suites().values()]
            if not files:
                raise LocalError("which suites? Name their files, or make them from the device's: --conformance")
            read = reader.read_files(files)
        return chosen(read, self.tag, self.step)

    def how(self, seed: int) -> str:
        """Say how suites are run, for reports."""
        return f"simulated, seed {seed}" if self.simulate else "on the bus"

    def skips(self, suite: Suite) -> str:
        """Say why a suite is skipped, `` if it is not."""
        if suite.world and not self.simulate and not self.shared_world:
            return "skipped: its nodes have to share a world (--shared-world: they do)"
        folder = self.devices.robot.dialects.folder
        # By folder: a dialect may be given by its name or by its path.
        fits = None in (suite.dialect, self.devices.dialect) or folder(suite.dialect) == folder(self.devices.dialect)
        return "" if fits else f"skipped: it is for the dialect {suite.dialect}"

    def run(
        self, suite: Suite, seed: int, interrupt: Interrupt, show: Callable[[StepResult], None] = lambda _: None
    ) -> SuiteResult:
        """Run a suite, unless it is skipped; `show` gets each step's result as it comes."""
        if skipped := self.skips(suite):
            return SuiteResult(suite.file, suite.name, self.how(seed), skipped=skipped)
        # A conformance suite is to find all that is wrong with a device; its steps do not build on each other.
        keeps_going, is_chosen_here = self.keep_going or self.is_generated, partial(is_chosen, self.step)
        options = RunOptions(keeps_going, is_chosen_here, self.is_generated, interrupt, show)
        if self.simulate:
            return self.devices.robot.simulate(suite, options, self.fault, seed, self.profile or 0)
        from eurobot_od.check.live import run_live

        return run_live(suite, options, self.open_bus)

    def run_seed(self, seed: int) -> CheckedSeed:
        """Run all suites for one seed, in any process."""
        # Read anew in each process: suites hold functions, which cannot be sent to another one.
        # PDOs that are left out were reported when the suites were first read, before there were processes.
        suites = self.suites(self.reader())
        return CheckedSeed(seed, tuple(self.run(suite, seed, Interrupt()) for suite in suites))

    def settings(self, suites: Sequence[Suite]) -> dict[str, str]:
        """Return all that the results of a seed depend on: the options, and the content of the files."""
        from eurobot_od.support.files import digest_of

        devices, dialect = self.devices, self.devices.dialect
        named = [Path(file) for each in devices.files() for file in (each.file, *each.patch)]
        dialects = devices.robot.dialects
        folders = {dialects.folder(each.dialect or dialect) for each in suites if each.dialect or not named}
        found = [file for folder in sorted(folders) for file in sorted(folder.glob("*.eds"))]
        options = {"robot": devices.robot_name, "dialect": dialect, "eds": devices.eds, "network": devices.network}
        options |= {"module": devices.modules, "patch": devices.patches}
        tiers = ("conformance", "reversible", "destructive", "restore", "profile", "motion", "outputs")
        own = ("fault", "tag", "step", *tiers, "keep_going")
        # Beside the options the files' content: an edited suite must not be continued with results of the old one.
        given = {name: str(value) for name, value in (options | {each: getattr(self, each) for each in own}).items()}
        return {"campaign": "checks", **given, "files": digest_of([*(each.file for each in suites), *named, *found])}


def _file_of(device: Dictionary) -> Path:
    """Return what the file of a device's conformance suites is called."""
    return Path(f"{device.name}.yaml")


def is_chosen(texts: Sequence[str], name: str) -> bool:
    """Tell whether a step's name contains one of some texts; without texts all are chosen."""
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


class Printer(NamedTuple):
    """Prints suites as they run; `silent` if standard output is one document, `verbose` for every step and reason."""

    silent: bool
    verbose: bool

    def heading(self, suite: Suite, how: str) -> None:
        """Print the line above a suite."""
        if not self.silent:
            print(report.heading(suite, how), flush=True)

    def step(self, step: StepResult) -> None:
        """Print a step's line, unless it is only counted; if `verbose` also why it failed or was skipped."""
        if self.silent or (step.status in report.UNEVENTFUL and not self.verbose):
            return
        # Flushed below: the next step may take minutes, and a pipe would keep this line back until then.
        print(report.step_line(step, in_colour(sys.stdout)))
        if step.reason is not None and self.verbose:
            print("\n".join(report.reason_lines(step.reason)))
        sys.stdout.flush()

    def end(self, result: SuiteResult) -> None:
        """Print how many of a suite's steps have not been shown."""
        counted = report.folded(result)
        if counted and not (self.silent or self.verbose):
            print(f"  {counted}", flush=True)


def listed(suites: Iterable[Suite]) -> Iterator[str]:
    """Yield a line for each suite."""
    for suite in suites:
        where = f"{', '.join(suite.nodes)}; {suite.dialect or 'any dialect'}"
        tags = f"  [{', '.join(suite.tags)}]" if suite.tags else ""
        yield one_line(f"{suite.file.stem:<24} {len(suite.steps):>4} steps  {suite.name} ({where}){tags}")


def results_of(
    checks: Checks, suites: Sequence[Suite], seeds: Iterable[int], interrupt: Interrupt, printer: Printer
) -> Iterator[SuiteResult]:
    """Run the suites for all seeds, until an interrupt or until the bus fails."""
    gone: set[tuple[str, ...]] = set()  # a device that does not come back from a reset is reported once
    for seed in seeds:
        for suite in suites:
            if interrupt.requested:
                return
            if suite.nodes in gone:
                continue
            printer.heading(suite, checks.skips(suite) or checks.how(seed))
            result = checks.run(suite, seed, interrupt, printer.step)
            printer.end(result)
            yield result
            if result.error:  # the bus is gone, for all suites that follow
                return
            if checks.is_generated and result.ended:
                gone.add(suite.nodes)


def many_results(
    checks: Checks,
    suites: Sequence[Suite],
    seeds: Sequence[int],
    interrupt: Interrupt,
    printer: Printer,
    workers: Workers,
    kept: Results[CheckedSeed] | None,
) -> Iterator[SuiteResult]:
    """Run the suites for all seeds by several workers, and print what `results_of` prints, seed by seed."""
    from eurobot_od.season.campaign import run as in_blocks

    done = in_blocks(checks.run_seed, seeds, workers, kept)
    for seed, results in campaign.counted(done, len(seeds), "seeds", workers, hidden=not printer.silent):
        for suite, result in zip(suites, results):
            printer.heading(suite, result.skipped or checks.how(seed))
            for step in result.steps:
                printer.step(step)
            printer.end(result)
            yield result
        if interrupt.requested:
            return
