"""Check nodes with suites of steps: against real nodes on a CAN bus, or simulated ones."""

from __future__ import annotations

import datetime
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from eurobot_od.check import report
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.report import CheckedDevice, RunFacts, StepResult, SuiteResult, checked_nothing
from eurobot_od.check.runs import above, chosen, listed, results_of, run_options
from eurobot_od.check.suite import Report, Suite
from eurobot_od.cli import ExitStatus, complain, is_closed_pipe, version
from eurobot_od.cli.devices import Devices, complain_of_repairs, left_out
from eurobot_od.cli.options import BusOptions, Faults, FrameNames, Json, Output, whole, write
from eurobot_od.cli.signature import Option
from eurobot_od.errors import EurobotError, LocalError, RemoteError
from eurobot_od.loading import ROBOTS
from eurobot_od.od import network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.formats import SUFFIXES
from eurobot_od.od.identity import Identity, absence
from eurobot_od.od.pdos import OnRefused
from eurobot_od.plugin import Plugins
from eurobot_od.support.files import check_writable
from eurobot_od.support.progress import in_colour
from eurobot_od.support.texts import amount

if TYPE_CHECKING:
    from eurobot_od.check.conformance.suite import MadeSuites
    from eurobot_od.check.runner import Interrupt


NO_RESULTS = "it has begun, and has no results: its output says why"
"""What reports say until a run has ended."""


@dataclass(frozen=True, kw_only=True)
class CheckReport:
    """The output of a check: one form on standard output, and files.

    page: write a page for somebody else, as .html or .md
    junit: write a JUnit XML report
    ctt: conformance: print by the numbers of CiA's test tool
    verbose: print every step, green and skipped ones too
    quiet: print only the red steps and the last line
    """

    page: Annotated[Path | None, Option("--report", metavar="FILE", is_output=True)] = None
    junit: Annotated[Path | None, Option(metavar="FILE", is_output=True)] = None
    as_json: Annotated[Json, Option(either="form")] = False
    ctt: Annotated[bool, Option(either="form")] = False
    verbose: Annotated[bool, Option("-v", either="form")] = False
    quiet: Annotated[bool, Option("-q", either="form")] = False

    @property
    def files(self) -> list[Path]:
        """The files to write."""
        return [each for each in (self.junit, self.page) if each is not None]

    def begin(self, facts: RunFacts) -> None:
        """Check that the files can be written, and replace those of an earlier run; raises LocalError, OSError.

        Until the run has results, they say that it has none: an earlier report would be taken for that of this run.
        """
        if self.page is not None:
            from eurobot_od.export.forms import form_of

            form_of(self.page)
        for file in self.files:
            check_writable(file)
        if any(each.is_file() for each in self.files):
            self._write_error(NO_RESULTS, facts)

    @contextmanager
    def explained(self, facts: RunFacts) -> Iterator[None]:
        """Write into the files why a run ends without results; raises what it does."""
        try:
            yield
        except (EurobotError, OSError) as error:
            if not is_closed_pipe(error):
                with suppress(OSError):
                    self._write_error(str(error), facts)
            raise

    def _write_error(self, error: str, facts: RunFacts) -> None:
        self._write([SuiteResult(Path("check"), "the run", facts.bus, error=error)], facts, None)

    @property
    def silent(self) -> bool:
        """Whether nothing is printed before the end, as standard output is one document."""
        return self.as_json or self.ctt or self.quiet

    def heading(self, suite: Suite, how: str) -> None:
        """Print the line above a suite."""
        if not self.silent:
            print(report.heading(suite, how), flush=True)

    def step(self, step: StepResult) -> None:
        """Print a step's line, unless it is only counted; if `verbose`, also why it failed or was skipped."""
        if self.silent or (step.status in report.GOES_ON and not self.verbose):
            return
        # Flushed, as the next step may take minutes.
        print(report.step_line(step, in_colour(sys.stdout)))
        if step.reason is not None and self.verbose:
            print("\n".join(report.reason_lines(step.reason)))
        sys.stdout.flush()

    def end(self, result: SuiteResult) -> None:
        """Print how many of a suite's steps have not been shown."""
        unseen = report.folded(result)
        if unseen and not (self.silent or self.verbose):
            print(f"  {unseen}", flush=True)

    def give(self, made: Made, results: Sequence[SuiteResult], facts: RunFacts) -> None:
        """Print the failures again and the summary, or the whole report in another form; write the files."""
        if self.as_json:
            print(json.dumps(report.as_data(results, facts), indent=2))
        elif self.ctt:
            from eurobot_od.check.conformance.page import lines

            for each in made.suites().device_runs(results, facts):
                print(each.device.dictionary.name, *lines(each.tests), *report.not_run(each.results), sep="\n")
        else:
            lines_of: list[Callable[[Sequence[SuiteResult]], Iterable[str]]] = [
                report.changed,
                report.remarks,
                report.failures,
            ]
            if made.is_wanted:
                lines_of[2:] = [report.slowest, report.not_run, report.failures, report.places, report.further]
            sys.stdout.writelines(f"{line}\n" for each in lines_of for line in each(results))
            print(report.summary(results, facts))
        self._write(results, facts, made)

    def _write(self, results: Sequence[SuiteResult], facts: RunFacts, made: Made | None) -> None:
        """Write the files; raises OSError."""
        if self.junit is not None:
            write(self.junit, report.junit(results, facts))
        if self.page is not None:
            from eurobot_od.check.page import blocks
            from eurobot_od.export.forms import FORMS, form_of

            of_run = made.suites().blocks(results, facts) if made and made.conformance else blocks(results, facts)
            write(self.page, FORMS[form_of(self.page)](list(of_run)))


def check(
    checks: Checks,
    *,
    list: bool = False,
    output: Output = None,
    repeat: Annotated[int, Option(metavar="N", read=whole(1, what="a number of times"))] = 1,
    seed: int = 1,
    report: CheckReport,
) -> ExitStatus:
    """Check nodes with suites of steps: against real nodes on a CAN bus, or simulated ones.

    list: list the robot's suites, or the given ones, and exit
    output: conformance, profile: write the suites, and exit
    repeat: run everything N times, seed by seed
    seed: seed of everything random in the simulation (default: 1)

    $ check --conformance --eds 5=motor.eds --simulate --tag nmt
    $ check --conformance --eds 5=motor.eds --tag emcy --report report.html -i socketcan -c can0
    """
    of_made = {"output": output, "ctt": report.ctt}
    _check_options(checks, {name: given for name, given in of_made.items() if given})
    began = datetime.datetime.now(datetime.UTC).astimezone().isoformat("T", "seconds")
    facts = RunFacts(version(), began, "simulated" if checks.simulate else checks.bus.words)
    if output is not None:
        write(output, "".join(checks.made_texts().values()))
        return ExitStatus.FINE
    if list:
        print(*listed(checks.read()), sep="\n")
        return ExitStatus.FINE
    report.begin(facts)
    from eurobot_od.check.runner import Interrupt  # here, as listing suites does not need it

    interrupt = Interrupt()
    with report.explained(facts):
        if checks.made.is_wanted and not checks.simulate:
            checks = replace(checks, devices=checks.devices.found_on(checks.bus))
        suites = checks.read()
        checks.check_faults(suites)
        beyond = above(suites, checks.level) if checks.level else []
        if not checks.simulate:
            checks.bus.check_named("; --simulate needs none")
            checks = checks.as_spoken(suites, report)
        facts = facts._replace(devices=checks.identified(suites, report))
        with interrupt.by_ctrl_c():
            results = [*results_of(checks, suites, range(seed, seed + repeat), interrupt, report)]
    report.give(checks.made, results, facts)
    if beyond and not report.as_json:
        print(f"at level {checks.level}, {amount(len(beyond), 'step')} not asked: {'; '.join(beyond)}")
    return _status(results, facts, is_interrupted=interrupt.requested)


def _status(results: Sequence[SuiteResult], facts: RunFacts, *, is_interrupted: bool) -> ExitStatus:
    if is_interrupted:
        return ExitStatus.INTERRUPTED
    if any(result.error for result in results):
        return ExitStatus.TROUBLE
    is_red = any(result.failed for result in results) or checked_nothing(results)
    return ExitStatus.FOUND if is_red or facts.left_out else ExitStatus.FINE


def _check_options(checks: Checks, of_made: Mapping[str, object]) -> None:
    """Check that the options go together; `of_made` are those about generated suites. Raises LocalError."""
    made = checks.made
    for each in checks.devices.eds:
        network.node_file(each)  # first, as `--eds 5 motor.eds` makes the file a suite
    from_files = "makes its suites from the EDS files: leave out"
    about = ["output"] if made.profile else []
    if made.conformance:
        about = [*of_made]
    refused = (
        (checks.fault and not checks.simulate, "--fault needs --simulate: it is a fault of a simulated node"),
        (checks.simulate and checks.bus.is_given, "--simulate is without a bus: leave it out, or -i and -c"),
        (made.conformance and checks.files, f"--conformance {from_files} {''.join(checks.files[:1])}"),
        (made.profile and (made.conformance or checks.files), f"--profile {from_files} --conformance, and files"),
        (made.motion and made.profile != 402, "--motion needs --profile 402"),
        (made.outputs and made.profile != 401, "--outputs needs --profile 401"),
        (made.reversible and not made.is_wanted, "--reversible needs --conformance"),
        (made.destructive and not made.conformance, "--destructive needs --conformance"),
        *((option not in about, f"--{option} needs --conformance") for option in of_made),
    )
    for is_wrong, why in refused:
        if is_wrong:
            raise LocalError(why)


def _motion(text: str) -> tuple[int, int]:
    from eurobot_od.check.conformance.suite import parse_motion  # with the suites: most commands do without

    return parse_motion(text)


@dataclass(frozen=True, kw_only=True)
class Made:
    """The suites that are generated from the EDS files, and their tiers.

    conformance: make the suites from the EDS files, by CiA 301
    profile: make the suites from the EDS files, by a device profile
    motion: profile 402: also move the motor, at most this far and this fast, in the drive's units
    outputs: profile 401: also switch the outputs
    reversible: conformance: also reset, write PDOs and own values; profile: also the state machine, settings
    destructive: conformance: also write other values, and store
    """

    conformance: bool = False
    profile: Literal[401, 402] | None = None
    motion: Annotated[tuple[int, int] | None, Option(metavar="DISTANCE@VELOCITY", read=_motion)] = None
    outputs: bool = False
    reversible: Annotated[bool, Option(either="tier")] = False
    destructive: Annotated[bool, Option(either="tier")] = False

    @property
    def is_wanted(self) -> bool:
        """Whether suites are generated."""
        return self.conformance or self.profile is not None

    def suites(self) -> MadeSuites:
        """Return the generated suites."""
        from eurobot_od.check.conformance.clauses import Tier
        from eurobot_od.check.conformance.suite import MadeSuites

        tier = Tier.REVERSIBLE if self.reversible else Tier.READING
        if self.destructive:
            tier = Tier.DESTRUCTIVE
        return MadeSuites(None if self.conformance else self.profile, tier, self.motion, self.outputs)


def _suite_file(plugins: Plugins, name: str) -> Path:
    """Return the file of a suite; raises LocalError, for one of a robot that is not used with its name."""
    try:
        return plugins.suite(name)
    except LocalError:
        others = (each for each in ROBOTS.installed() if ROBOTS.load(each) is not plugins.robot)
        robot = next((each for each in others if name in Plugins(ROBOTS.load(each)).shipped_suites()), None)
        if robot is None:
            raise
        raise LocalError(
            f"{name} is a suite of {robot}, for its own nodes: --robot {robot} without --eds and --network; "
            "for other devices: a suite of your own, --conformance, --profile"
        ) from None


@dataclass(frozen=True)
class Checks:
    """The suites to run, and how to run them.

    files: suite files, or names of the robot's suites (--list)
    simulate: check simulated nodes, in simulated time
    fault: give simulated nodes a fault
    shared_world: the nodes on the bus share the world that a suite needs
    tag: run the suites with this tag
    step: run the steps whose names contain this, and those before them
    keep_going: go on with the next step after a failed one, and check a device that is not the file's
    level: leave out the steps that ask for more than this, such as 2014 for what the robot of that year had
    """

    files: Annotated[Sequence[str], Option(metavar="FILE", is_file=True)] = ()
    _: KW_ONLY
    simulate: bool = False
    fault: Faults = ()
    shared_world: bool = False
    tag: Annotated[Sequence[str], Option(metavar="TAG")] = ()
    step: Annotated[Sequence[str], Option(metavar="TEXT")] = ()
    made: Made
    keep_going: bool = False
    level: str = ""
    names: FrameNames
    devices: Devices
    bus: BusOptions

    def reader(self, refused: OnRefused) -> SuiteReader:
        """Return the reader of suites for the devices; `refused` is called with each PDO that is left out."""
        known = self.devices.plugins.networks()
        known = known._replace(refused=refused, decoder=self.devices.decoder_with(self.names))
        files = self.devices.files()
        if not files:
            return SuiteReader(known, self.devices.dialect)
        # Suites without a dialect are for the devices of the command line.
        named = Path(self.devices.network or files[0].file)

        def load(path: Path) -> tuple[Dictionary, ...]:
            if path != named:
                return known.load(path)
            loaded = self.devices.with_words(network.load(files))
            complain_of_repairs(loaded)
            return loaded

        networks = known._replace(find=lambda dialect: known.find(dialect) if dialect else named, load=load)
        return SuiteReader(networks, self.devices.dialect)

    def made_texts(self) -> Mapping[Path, str]:
        """Return the generated suites, and report the devices that they are not for; raises LocalError, FileError."""
        made, devices = self.made.suites(), self.devices.load()
        texts = made.texts(devices)
        for each in made.others(devices).values():
            complain(f"not checked: {each}")
        return texts

    def read(self) -> list[Suite]:
        """Read the chosen suites, and report PDOs that are left out; raises YamlError, LocalError."""
        with left_out() as refused:
            return self._suites(self.reader(refused))

    def _suites(self, reader: SuiteReader) -> list[Suite]:
        if self.made.is_wanted:
            read = reader.read_texts(self.made_texts())
        else:
            plugins = self.devices.plugins
            files = [_suite_file(plugins, name) for name in self.files] or [*plugins.shipped_suites().values()]
            if not files:
                raise LocalError("which suites? Name their files, or make them from the device's: --conformance")
            if device := next((each for each in self.files if Path(each).suffix.lower() in SUFFIXES), None):
                raise LocalError(f"{device} is a device's file, not a suite; write --conformance --eds 5={device}")
            if program := next((each for each in self.files if each.endswith(".py")), None):
                raise LocalError(f"{program} is a Python program, not a suite: a suite is YAML")
            read = reader.read_files(files)
        return chosen(read, self.tag, self.step)

    @property
    def is_made(self) -> bool:
        """Whether the suites are generated from the devices' files."""
        return self.made.is_wanted

    def how(self, seed: int) -> str:
        """Return for reports how suites are run."""
        return f"simulated, seed {seed}" if self.simulate else "on the bus"

    def as_spoken(self, suites: Sequence[Suite], report: CheckReport) -> Checks:
        """Return the checks with the robot's dialect that the nodes on the bus speak, if suites are for several.

        It is that whose files have the identity (0x1018) of a node, or else the default one. Raises BusError.
        """
        named = {suite.dialect for suite in suites if suite.dialect}
        if len(named) < 2 or self.devices.dialect or self.devices.files():
            return self
        dialects = self.devices.robot.dialects
        identities = {name: [Identity.of(each)[:3] for each in dialects.load_all(name)] for name in sorted(named)}
        found = self._identity({each for suite in suites for each in suite.dictionaries.values()})
        spoken = next((name for name, known in identities.items() if found and found[:3] in known), "")
        dialect = spoken or dialects.folder().name
        if not report.silent:
            how = "as 0x1018 says" if spoken else "as no node says another one in 0x1018"
            print(f"dialect {dialect}, {how}; --dialect names another one", flush=True)
        return replace(self, devices=replace(self.devices, dialect=dialect))

    def identified(self, suites: Sequence[Suite], report: CheckReport) -> list[CheckedDevice]:
        """Return the devices under test; on a bus, for generated suites and files, with the identity that they show.

        Report each that is not its file's, or is missing while others answer. Raises BusError; LocalError if a
        generated suite would be for another device, without `keep_going`.
        """
        under_test = (each.dictionaries[name] for each in suites for name in each.nodes)
        devices = {(each.node_id, each.file): each for each in under_test}.values()
        if self.simulate or not (self.is_made or report.files):
            return [*map(CheckedDevice, devices)]
        from eurobot_od.check.runs import identified
        from eurobot_od.client.description import scan
        from eurobot_od.client.master import Master

        with Master(self.bus.open()) as master:
            found = identified(master, devices)
            is_silent = any(each.shown is None for each in found)
            there = [each.node_id for each in scan(master)] if is_silent else []
        absent = absence((each.node_id for each in devices), there)
        doubts = [each.doubt for each in found if each.doubt and each.shown]
        if doubts and self.is_made and not self.keep_going:
            raise LocalError(f"{'; '.join(doubts)}; --keep-going checks it all the same")
        for doubt in filter(None, [absent, *doubts]):
            complain(doubt)
        return found

    def check_faults(self, suites: Iterable[Suite]) -> None:
        """Check that each fault is one that a device under test can have; raises UnknownName, LocalError."""
        run = [each for each in suites if not self.skips(each)]
        devices = {name: each.dictionaries[name] for each in run for name in each.nodes}
        self.devices.plugins.check_faults(devices.values(), self.fault if run else (), self.made.profile or 0)

    def _identity(self, dictionaries: Iterable[Dictionary]) -> Identity | None:
        """Return the identity of the first node that answers, None if none does."""
        from eurobot_od.client.description import read_identity
        from eurobot_od.client.master import Master

        with Master(self.bus.open()) as master:
            for node_id in sorted({each.node_id for each in dictionaries}):
                with suppress(RemoteError):
                    return read_identity(master.node(node_id))
        return None

    def skips(self, suite: Suite) -> str:
        """Return why a suite is skipped; empty if it is run."""
        if suite.world and not self.simulate and not self.shared_world:
            return "skipped: its nodes have to share a world (--shared-world: they do)"
        folder = self.devices.robot.dialects.folder
        # Compared by folder, as a dialect may be given by its name or path.
        fits = None in (suite.dialect, self.devices.dialect) or folder(suite.dialect) == folder(self.devices.dialect)
        return "" if fits else f"skipped: it is for the dialect {suite.dialect}"

    def run(
        self, suite: Suite, seed: int, interrupt: Interrupt, reported: set[Report], show: Callable[[StepResult], None]
    ) -> SuiteResult:
        """Run a suite, unless it is skipped; `show` is called with each step's result.

        `reported` holds the findings that are reported once per node, of all suites so far.
        """
        if skipped := self.skips(suite):
            return SuiteResult(suite.file, suite.name, self.how(seed), skipped=skipped)
        # A generated suite goes on after a red step, as its steps are independent.
        options = run_options(
            keep_going=self.keep_going,
            is_made=self.is_made,
            steps=self.step,
            interrupt=interrupt,
            reported=reported,
            show=show,
            level=self.level,
        )
        if self.simulate:
            return self.devices.plugins.simulate(suite, options, self.fault, seed, self.made.profile or 0)
        from eurobot_od.check.on_bus import run_live

        return run_live(suite, options, self.bus.open)
