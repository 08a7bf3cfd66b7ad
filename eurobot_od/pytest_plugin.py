"""The plug-in for pytest: check suites as tests, and fixtures for nodes, simulated or on a bus.

pytest loads this module in every run of an environment with this package, so it imports nothing else of the package
before that is needed.

Without `--eurobot-interface`, suites run in simulated time, and fixtures have a bus inside the process. With it, the
devices on that bus are tested. A suite file is collected if its name ends in `.check.yaml`, or matches a pattern of the
ini option `eurobot_suites`; other YAML files are not read. Steps depend on each other, so the first test of a suite
runs all its steps; each step is a test, which reports how that step ended.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import cached_property, partial
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pytest

if TYPE_CHECKING:
    import can

    from eurobot_od.check.format import SuiteReader
    from eurobot_od.check.report import StepResult, SuitePart, SuiteResult
    from eurobot_od.check.suite import Step, Suite
    from eurobot_od.client.network import Network
    from eurobot_od.client.remote_device import RemoteDevice
    from eurobot_od.plugin import Plugins
    from eurobot_od.support.yaml_places import Place

Result = TypeVar("Result")

PATTERNS = ("*.check.yaml", "*.check.yml")
"""Patterns for the names of suite files."""

SUFFIXES = (".yaml", ".yml")

KEYS = ("eurobot_suites", "eurobot_network")
"""Keys of pytest's configuration file."""


FOR_THE_ROBOT = (
    "\nwithout a network, suites are for the robot; for other devices, name their network: "
    "eurobot_network in pytest's configuration file, or eurobot-od.yaml beside it"
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options for the bus, and for suite files."""
    group = parser.getgroup("eurobot-od", "CANopen nodes and check suites")
    group.addoption("--eurobot-interface", help="python-can interface of the devices to test; default: simulated ones")
    group.addoption("--eurobot-channel", help="channel of the interface, such as can0")
    group.addoption("--eurobot-bitrate", type=int, help="bit/s")
    suites, network = KEYS
    parser.addini(suites, "patterns of check suites besides *.check.yaml", "args", default=[])
    parser.addini(network, "network file or folder of EDS files of suites; default: eurobot-od.yaml, or the robot's")


def pytest_configure(config: pytest.Config) -> None:
    """Check the options and keys together; raises UsageError for what would have no effect."""
    for option in ("channel", "bitrate"):
        if config.getoption(f"eurobot_{option}") and not config.getoption("eurobot_interface"):
            raise pytest.UsageError(f"--eurobot-{option} needs --eurobot-interface: without it the nodes are simulated")
    for key in _keys(config):
        if key.startswith("eurobot_") and key not in KEYS:
            from eurobot_od.errors import UnknownName

            raise pytest.UsageError(f"{config.inipath or '-o'}: {UnknownName('key', key, KEYS)}")


def _keys(config: pytest.Config) -> list[str]:
    """Return the keys of pytest's configuration file; none if this pytest does not tell them."""
    with warnings.catch_warnings():  # there is no other way to find a misspelt one
        warnings.simplefilter("ignore")
        return [*getattr(config, "inicfg", ())]


# Suites as tests


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect a suite file; patterns with a folder count from pytest's root folder.

    A YAML file that is itself an argument is one whatever its name is.
    """
    config = parent.config
    root = escape(str(config.rootpath))
    own = (f"{root}/{each}" if "/" in each else each for each in config.getini("eurobot_suites"))
    is_named = file_path.suffix in SUFFIXES and parent.session.isinitpath(file_path)
    is_suite = is_named or any(file_path.match(each) for each in (*PATTERNS, *own))
    # A pattern such as *.yaml may match the network file, too.
    return SuiteFile.from_parent(parent, path=file_path) if is_suite and file_path != _network_path(config) else None


class SuiteFile(pytest.File):
    """A file of suites; its problems are collection errors with line and column."""

    def collect(self) -> Iterator[pytest.Collector]:
        from eurobot_od.errors import FileError, LocalError

        try:
            suites = _read(self.config, self.path)
        except (FileError, LocalError) as error:
            hint = "" if _network(self.config)[1] else FOR_THE_ROBOT
            raise self.CollectError(f"{error}{hint}") from None
        for suite in suites:
            yield SuiteTests.from_parent(self, name=suite.name, suite=suite)


class SuiteTests(pytest.Collector):
    """The tests of a suite, one per step."""

    def __init__(self, *, suite: Suite, **options: Any) -> None:
        super().__init__(**options)
        self.suite = suite
        self.extra_keyword_matches.update(suite.tags)

    def collect(self) -> Iterator[pytest.Item]:
        from eurobot_od.check.report import SuitePart

        suite = self.suite
        parts = zip(("setup ", "", "teardown "), SuitePart, (suite.setup, suite.steps, suite.teardown))
        for title, part, steps in parts:
            for number, step in enumerate(steps, 1):
                yield StepTest.from_parent(self, name=f"{title}{number}: {step.name}", part=part, step=step)

    @cached_property
    def steps(self) -> tuple[StepResult, ...]:
        """The results of the steps; the suite is run once."""
        return _run(self.config, self.suite).steps


class StepTest(pytest.Item):
    """A step of a suite as a test."""

    parent: SuiteTests

    def __init__(self, *, part: SuitePart, step: Step, **options: Any) -> None:
        super().__init__(**options)
        self._part = part
        self._step = step

    def runtest(self) -> None:
        """Report how the step ended, for several results by the worst."""
        from eurobot_od.check.report import Status

        # By place, as a step with `repeat`, or a group, has several results, and names may repeat.
        places = set(_places(self._step))
        results = [each for each in self.parent.steps if each.section is self._part and each.place in places]
        _fail(results)
        if all(each.status is Status.SKIPPED for each in results):
            reasons = (each.reason.what for each in results if each.reason)
            pytest.skip(next(reasons, "a step before failed"))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the failure as text; one line for an error of ours."""
        from eurobot_od.errors import EurobotError

        if excinfo.errisinstance(EurobotError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return file, line from 0, and heading."""
        return self.path, self._step.place.line - 1, f"{self.parent.name}: {self.name}"


def _places(step: Step) -> Iterator[Place]:
    """Yield the places of a step and of the steps inside it."""
    yield step.place
    for each in getattr(step.action, "steps", ()):
        yield from _places(each)


def _fail(steps: Iterable[StepResult]) -> None:
    """Fail if a step is red, with its reason and the last frames."""
    from eurobot_od.check.report import GOES_ON, reason_lines

    for step in steps:
        if step.status not in GOES_ON:
            said = reason_lines(step.reason) if step.reason else [step.status.value]
            pytest.fail("\n".join([f"{step.name} (line {step.place.line})", *said]), pytrace=False)


def _network(config: pytest.Config) -> tuple[Path, bool]:
    """Return the network file or folder of the ini file, otherwise of the root folder, and whether it has devices."""
    from eurobot_od.od.network import read_network

    path = _network_path(config)
    return path, bool(config.getini("eurobot_network") or (path.is_file() and read_network(path).nodes))


def _network_path(config: pytest.Config) -> Path:
    from eurobot_od.od import DEFAULT

    return config.rootpath / (config.getini("eurobot_network") or DEFAULT)


def _plugins(config: pytest.Config) -> Plugins:
    """Return the plug-ins to use.

    The robot is that of the environment or the network file, or an installed one if the network file has no devices.
    """
    from eurobot_od.loading import find, packages
    from eurobot_od.plugin import Plugins

    path, names_devices = _network(config)
    return Plugins(find(network=path, alone=names_devices), packages())


READER: pytest.StashKey[SuiteReader] = pytest.StashKey()


def _read(config: pytest.Config, file: Path) -> list[Suite]:
    """Read the suites of a file; raises LocalError, FileError."""
    from eurobot_od.check.format import SuiteReader

    known = _plugins(config).networks()
    (path, names_devices) = _network(config)
    # A warning, as suites that do not need this PDO still run.
    networks = known._replace(refused=lambda error: warnings.warn(f"PDO left out: {error}", stacklevel=2))
    if names_devices:
        networks = networks._replace(find=lambda dialect: known.find(dialect) if dialect else path)
    # One reader for all files, so that each EDS file is loaded once.
    return config.stash.setdefault(READER, SuiteReader(networks)).read_files([file])


def _run(config: pytest.Config, suite: Suite, faults: Iterable[str] = (), seed: int = 1) -> SuiteResult:
    """Run a suite, with its teardown even after Ctrl-C; raises BusError, UnknownName."""
    from eurobot_od.check.on_bus import run_live
    from eurobot_od.check.runner import Interrupt, RunOptions

    live = config.getoption("eurobot_interface")
    if live and suite.world:  # real nodes do not share a simulated world
        pytest.skip("its nodes have to share a world")
    interrupt = Interrupt()
    options = RunOptions(interrupt=interrupt)
    with interrupt.by_ctrl_c():
        result = (
            run_live(suite, options, partial(_open_bus, config))
            if live
            else _plugins(config).simulate(suite, options, faults, seed)
        )
    if interrupt.requested:  # after the teardown pytest has to end, too
        raise KeyboardInterrupt
    return result


def _check_faults(config: pytest.Config, suites: Iterable[Suite], faults: Sequence[str]) -> None:
    """Check that a node under test can have each fault; skips on a bus. Raises UnknownName, LocalError."""
    if faults and config.getoption("eurobot_interface"):
        pytest.skip("a fault is given to simulated nodes, not to those on a bus")
    devices = {name: each.dictionaries[name] for each in suites for name in each.nodes}
    _plugins(config).check_faults(devices.values(), faults)


def _open_bus(config: pytest.Config, otherwise: str = "") -> can.BusABC:
    """Open the bus of the options, otherwise one inside the process; raises BusError."""
    from eurobot_od.bus.live import open_bus

    interface = config.getoption("eurobot_interface")
    if not interface:  # one channel per test, so that no frame reaches another test
        return open_bus("virtual", otherwise)
    return open_bus(interface, config.getoption("eurobot_channel"), config.getoption("eurobot_bitrate"))


def _called_as(name: str, function: Callable[..., Result]) -> Callable[..., Result]:
    """Return a function that fails the test, with its form, if its arguments do not fit."""
    from inspect import signature

    from eurobot_od.support.texts import parameters

    def call(*arguments: Any, **names: Any) -> Result:
        try:
            signature(function).bind(*arguments, **names)
        except TypeError as error:
            raise pytest.fail.Exception(f"{name}{parameters(function)}: {error}", pytrace=False) from None
        return function(*arguments, **names)

    return call


# Fixtures


@pytest.fixture
def eurobot_check(request: pytest.FixtureRequest) -> Callable[..., list[SuiteResult]]:
    """Run a suite file, `eurobot_check("drive.yaml")`, and fail if a step is red; return the results.

    The file is searched next to the test, then among the suites of the package. `faults` are given to simulated nodes,
    whose random numbers come from `seed`.
    """

    def check(file: str, faults: Sequence[str] = (), seed: int = 1) -> list[SuiteResult]:
        from eurobot_od.errors import FileError, LocalError, UnknownName

        faults = [faults] if isinstance(faults, str) else faults
        beside = request.path.with_name(file)
        try:
            plugins = _plugins(request.config)
            path = beside if beside.is_file() else plugins.suite(file)
            if not path.is_file():
                raise UnknownName(
                    "suite, neither beside this test nor of the robot:", path.stem, plugins.shipped_suites()
                )
            suites = _read(request.config, path)
            _check_faults(request.config, suites, faults)
            results = [_run(request.config, suite, faults, seed) for suite in suites]
        except (FileError, LocalError) as error:
            raise pytest.fail.Exception(str(error), pytrace=False) from None
        _fail(step for result in results for step in result.steps)
        return results

    return _called_as("eurobot_check", check)


@pytest.fixture
def eurobot_bus(request: pytest.FixtureRequest) -> Iterator[Callable[[], can.BusABC]]:
    """Open the bus of the options, otherwise one inside the process for this test.

    Each call opens one more participant.
    """
    with ExitStack() as stack:

        def open_one() -> can.BusABC:
            return stack.enter_context(_open_bus(request.config, request.node.nodeid))

        yield open_one


@pytest.fixture
def eurobot_network(request: pytest.FixtureRequest, eurobot_bus: Callable[[], can.BusABC]) -> Iterator[Network]:
    """Provide a `Network` on the bus of the options, otherwise in simulated time, where waiting takes no time.

    In simulated time it has a `simulation`, to which nodes are attached, and `devices`.
    """
    from eurobot_od.client.network import Network, simulated

    is_live = request.config.getoption("eurobot_interface")
    with Network.open(eurobot_bus()) if is_live else simulated() as network:
        yield network


@pytest.fixture
def eurobot_node(request: pytest.FixtureRequest, eurobot_network: Network) -> Callable[..., RemoteDevice]:
    """Connect to a device by its EDS or DCF: `eurobot_node("motor.eds", node_id=5)["Motor.Speed"].value`.

    Without a bus in the options, the device is simulated from its file. The file is searched next to the test.
    """

    def reach(file: str | Path, node_id: int | None = None) -> RemoteDevice:
        from eurobot_od.client.network import SimulatedNetwork
        from eurobot_od.od.dictionary import Dictionary

        dictionary = Dictionary.load(request.path.parent / file, node_id)
        if isinstance(eurobot_network, SimulatedNetwork):
            return eurobot_network.simulate(dictionary)
        return eurobot_network.add(dictionary.node_id, dictionary)

    return _called_as("eurobot_node", reach)
