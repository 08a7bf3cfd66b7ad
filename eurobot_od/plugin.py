"""A robot: what it brings to the workbench, and the door through which it comes in.

The workbench takes any device's EDS. A robot adds what no EDS says: which folders of EDS files are its own, which
classes its messages and nodes have, what can be wrong with them, and commands of its own. All of that comes in here, as
one `Plugin`; nothing else of the workbench knows about a robot. Ours is found like anybody's:

1. What the user names, by `--robot` or the variable EUROBOT_OD_ROBOT: an installed robot, a folder with a `robot.py`,
   or a module; in both the plugin is called `ROBOT`. `none` is the workbench alone.
2. Or else what the network file names by `robot:`, if it is an installed robot. A file is data, and may have come with
   somebody's logs: it runs no code but what is installed.
3. Or else the robot that is installed, by its entry point of the group `eurobot_od.robots`: one of somebody else's
   package before ours. For devices whose files are named, and for the program `canopen-workbench`, there is none.

A robot that the user has named and that cannot be loaded is an error. Any other is a `RobotWarning`, and what does not
need it goes on. What takes time to import is behind a function that imports it, so that a robot's description is there
at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from shlex import quote
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, TypeVar

from eurobot_od.errors import LocalError, PackageWarning, RobotWarning, UnknownName, look_up
from eurobot_od.od import DEFAULT, Dialects

if TYPE_CHECKING:
    from eurobot_od.bus.live import Live, Opener
    from eurobot_od.check.on_bus import NodeUnderTest
    from eurobot_od.check.report import SuiteResult
    from eurobot_od.check.runner import RunOptions
    from eurobot_od.check.shapes import MakeRow, Networks
    from eurobot_od.check.steps import SuiteAction
    from eurobot_od.check.suite import Suite
    from eurobot_od.client.master import Master
    from eurobot_od.client.program import DownloadProcedure
    from eurobot_od.device.faults import Fault
    from eurobot_od.device.node import Node
    from eurobot_od.export.description import Drawings
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.identity import Identity
    from eurobot_od.pdo.kinds import Catalogue
    from eurobot_od.pdo.protocol import Protocol as Messages
    from eurobot_od.season.reports import SeasonReport
    from eurobot_od.traffic.dbc import ForeignMessage
    from eurobot_od.traffic.diagnosis.incidents import Watcher
    from eurobot_od.web.page import Panel

    NodeT = TypeVar("NodeT", bound=Node)

GROUP = "eurobot_od.robots"
"""The group of the entry points that name robots."""

DEVICES = "eurobot_od.devices"
"""The group of the entry points that name device packages."""

PACKAGES = "EUROBOT_OD_PACKAGES"
"""Environment variable that names device packages, as PATH names folders."""

PACKAGE_FILE, PACKAGE_ATTRIBUTE = "device.py", "DEVICE"
"""The module of a folder that is a device package, and what the plugin is called in it."""

VARIABLE = "EUROBOT_OD_ROBOT"
"""Environment variable that names the robot where a command line does not."""

ATTRIBUTE = "ROBOT"
"""What the plugin is called in its module."""

FILE = "robot.py"
"""The module of a folder that is a robot."""

NONE = "none"
"""What `--robot` says for the workbench alone."""

OURS = "eurobot_od."
"""What the names of the modules start with that this package brings itself."""

Program: TypeAlias = Callable[[], Coroutine[Any, Any, None]]
"""What a node does by itself after each boot while it is checked."""

Faults: TypeAlias = "Mapping[type[Node], Mapping[str, Fault]]"
"""Faults with their names, by the class of node that can have them."""


class Command(NamedTuple):
    """A command of a robot's own: what it does, in words, and its module, which has what those in `cli` have."""

    text: str
    module: str


Scene: TypeAlias = "Callable[[Live], int | None]"
"""What a node of the robot does on a bus that the command `node` runs; returns the exit status, None if the node is to
go on by itself."""


class NodeRun(NamedTuple):
    """How the command `node` runs a robot's node: a dialect of the robot's, on which bus, how long in s."""

    robot: Plugin
    dialect: str | None
    open_bus: Opener
    duration: float | None


class Stage(Protocol):
    """The options that `node` has for a robot's nodes, a dataclass as in `cli.signature`, and what they make of one."""

    def check(self, role: str) -> None:
        """Raise LocalError for options that do not fit a node, `` for a device that does not belong to the robot."""

    def values(self, kind: type[Node], dictionary: Dictionary, facts: Sequence[tuple[str, str]]) -> Mapping[str, Any]:
        """Return what else a node is made with, by the names that its class has for it; `facts` are those of --set."""

    def set_up(self, node: Node, run: NodeRun) -> Scene:
        """Give the node what it has besides the bus, and return what it does there."""


def _no_catalogue() -> Catalogue:
    from eurobot_od.pdo.kinds import NOTHING

    return NOTHING


class Plugin(NamedTuple):
    """What a robot brings.

    `nodes` are its node classes by the names of their EDS files, `faults` what can be wrong with them besides what can
    be wrong with any device. `suites` is a folder of check suites. `partners` gives simulated nodes that are checked
    their surroundings, with all chance from a seed, and returns what some do by themselves, by their names. `panels`
    are views of the page, `drawings` what messages draw in an MCAP file, `reports` questions to a season, `watchers`
    rules of the robot's own for `diagnose`. `stage` are the options that `node` has for its nodes. `table` is the
    protocol table that other tables may build on, `folder` where its other files lie.

    A device package is for the devices of an `identity`: vendor-ID, product code and revision, as many as are said.
    `words` is its device.yaml (see `od.maker`). `frames` are what a device sends outside CANopen, by COB-ID, `device`
    is the class of a simulated one, `actions` are steps of suites by their keys. `program` is how it takes a program,
    where it differs from CiA 302-3; `address` gives the device with an identity its node-ID, where it has no LSS.
    """

    name: str = ""
    dialects: Dialects = Dialects()
    catalogue: Callable[[], Catalogue] = _no_catalogue
    nodes: Mapping[str, Callable[[], type[Node]]] = MappingProxyType({})
    faults: Callable[[], Faults] = dict
    suites: Path | None = None
    partners: Callable[[Sequence[Node], int, Callable[[], float]], Mapping[str, Program]] = lambda *_: {}
    panels: Callable[[], Sequence[type[Panel]]] = tuple
    drawings: Callable[[Messages], Drawings] = lambda _: {}
    reports: Callable[[], Mapping[str, SeasonReport]] = dict
    watchers: Callable[[], Sequence[type[Watcher]]] = tuple
    stage: Callable[[], type[Stage]] | None = None
    commands: Mapping[str, Command] = MappingProxyType({})
    identity: Sequence[int] = ()
    words: Path | None = None
    frames: Callable[[Dictionary], Mapping[int, ForeignMessage]] = lambda _: {}
    device: Callable[[], type[Node]] | None = None
    actions: Callable[[], Mapping[str, SuiteAction]] = dict
    program: Callable[[], DownloadProcedure] | None = None
    address: Callable[[Master, Identity, int], object] | None = None
    table: Path | None = None
    folder: Path | None = None

    # Nodes

    def role_of(self, dictionary: Dictionary) -> str:
        """Return which of the robot's nodes a file describes, ``: none; it has its name, and messages that it knows."""
        if dictionary.name not in self.nodes:
            return ""
        kind = self.nodes[dictionary.name]()
        knows = any(kind.CATALOGUE.find(each.name) for each in dictionary.read_pdos(dictionary.default, lambda _: None))
        return dictionary.name if knows else ""

    def kind(self, role: str, faults: Iterable[str] = (), device: type[Node] | None = None) -> type[Node]:
        """Return the class of a node, `device` (SimulatedDevice) if it has no role; it has the faults that it can have.

        Raises UnknownName for a fault.
        """
        from eurobot_od.device.simulated import SimulatedDevice

        kind: type[Node] = self.nodes[role]() if role else device or SimulatedDevice
        for name in faults:
            owner, fault = self.find_fault(name)
            # A fault of another node's is passed over: `check --fault` gives all nodes the same ones.
            is_meant = issubclass(kind, owner) and name.rpartition(".")[0] in ("", role)
            kind = fault.given_to(kind) if is_meant else kind
        return kind

    # Faults

    def all_faults(self) -> Faults:
        """Return the faults of the robot's nodes, and those that any device can have."""
        from eurobot_od.device.faults import DRIVE_FAULTS, FAULTS
        from eurobot_od.device.node import Node
        from eurobot_od.device.profiles import SimulatedDrive

        own = dict(self.faults())
        return {**own, Node: {**FAULTS, **own.get(Node, {})}, SimulatedDrive: DRIVE_FAULTS}

    def fault_names(self) -> list[str]:
        """Return the names of all faults."""
        return [name for faults in self.all_faults().values() for name in faults]

    def find_fault(self, name: str) -> tuple[type[Node], Fault]:
        """Return a fault by its name, and the class of node that can have it; raises UnknownName, LocalError.

        `arm.heartbeat-stops` is one of the arm alone.
        """
        node, _, plain = name.rpartition(".")
        if node and not self.nodes:
            raise LocalError(
                f"--fault {name}: only a robot's nodes are named; without one write {plain}, for all devices"
            )
        if node and node not in self.nodes:
            raise UnknownName("node", node, self.nodes)
        for owner, faults in self.all_faults().items():
            if plain in faults:
                return owner, faults[plain]
        raise UnknownName("fault", plain, self.fault_names())

    def faulty(self, kind: type[NodeT], name: str) -> type[NodeT]:
        """Return the class of a node that has a fault; raises UnknownName, LocalError if such a node cannot have it."""
        from eurobot_od.device.simulated import SimulatedDevice

        owner, fault = self.find_fault(name)
        if not issubclass(kind, owner):
            node = "other devices" if issubclass(kind, SimulatedDevice) else f"the {kind.__name__.lower()}"
            whose = owner.__name__.removeprefix("Simulated").lower()
            raise LocalError(f"the fault {name} is one of the {whose}, not of {node}")
        return fault.given_to(kind)

    # Checks

    def shipped_suites(self) -> dict[str, Path]:
        """Return the files of the robot's suites by name."""
        files = sorted(self.suites.glob("*.yaml")) if self.suites else ()
        return {file.stem.removesuffix(".check"): file for file in files}

    def suite(self, text: str) -> Path:
        """Return the file that is meant by a path or by the name of one of the robot's suites; raises UnknownName."""
        shipped, path = self.shipped_suites(), Path(text)
        if text in shipped:  # a file of this name is a program, or a folder of one: `./lift` names it
            return shipped[text]
        if not path.is_file() and path.suffix not in (".yaml", ".yml"):
            raise UnknownName("suite", text, shipped)
        return path

    def networks(self) -> Networks:
        """Return the networks that suites may be for: the dialects, and any folder of EDS files."""
        from eurobot_od.check.shapes import Networks

        return Networks(self.dialects.folder, self.catalogue(), actions=all_actions())

    def under_test(
        self,
        dictionaries: Mapping[str, Dictionary],
        seed: int,
        clock: Callable[[], float],
        faults: Iterable[str] = (),
        profile: int = 0,
        named: Sequence[str] = (),
    ) -> list[NodeUnderTest]:
        """Make simulated nodes that have these dictionaries, the robot's in their surroundings; raises UnknownName.

        Those that have no role behave as their device package says, or else as a device `profile` does; `named` are
        packages that are not installed.
        """
        from eurobot_od.check.on_bus import NodeUnderTest
        from eurobot_od.device.profiles import simulated_kind

        roles = {name: self.role_of(each) for name, each in dictionaries.items()}
        own = {name: package_of(each.identity, packages(named)).device for name, each in dictionaries.items()}
        kinds = {
            name: make() if (make := own[name]) and not profile else simulated_kind(each, profile)
            for name, each in dictionaries.items()
        }
        nodes = {name: self.kind(role, faults, kinds[name])(dictionaries[name]) for name, role in roles.items()}
        ours = [nodes[name] for name, role in roles.items() if role]
        programs = self.partners(ours, seed, clock) if ours else {}
        return [NodeUnderTest(node, programs.get(node.name)) for node in nodes.values()]

    def simulate(
        self,
        suite: Suite,
        options: RunOptions,
        faults: Iterable[str] = (),
        seed: int = 1,
        profile: int = 0,
        named: Sequence[str] = (),
    ) -> SuiteResult:
        """Run a suite against simulated nodes, giving the faults to those that can have them; raises UnknownName.

        With a `profile`, devices that do not belong to the robot behave as it says.
        """
        from functools import partial

        from eurobot_od.check.on_bus import run_simulated

        make_nodes = partial(self.under_test, faults=faults, profile=profile, named=named)
        return run_simulated(suite, options, make_nodes, seed)


NO_ROBOT = Plugin()
"""The workbench alone."""


# The door


class Installed(NamedTuple):
    """An installed robot: its `name`, where its plugin is (`module:attribute`), and the `file` that says so."""

    name: str
    target: str
    file: str

    @property
    def package(self) -> str:
        """What pip calls the package that brings it."""
        return Path(self.file).parent.name.partition("-")[0]

    @property
    def is_ours(self) -> bool:
        """Whether this package brings it itself."""
        return self.target.startswith(OURS)

    def load(self) -> Plugin:
        """Import it; raises LocalError, with the place, whatever goes wrong in it."""
        return _imported(self.target, self.name, self.file)


def find(name: str | None = None, network: str | Path = DEFAULT, *, alone: bool = False) -> Plugin:
    """Return the robot that is meant: `name`, or the environment's, or the `network` file's, or the installed one.

    `alone`: the installed one does not count. Raises UnknownName; LocalError, with the place, for a named one that
    cannot be loaded, and if several are installed; FileError for the network file.
    """
    return named(name, network) or (NO_ROBOT if alone else the_installed())


def named(name: str | None, network: str | Path = DEFAULT) -> Plugin | None:
    """Return the robot that is named: `name`, or the environment's, or the `network` file's; None without a name.

    Raises as `find`.
    """
    if typed := name or os.environ.get(VARIABLE):
        return _typed(typed)
    if os.path.isfile(network):  # noqa: PTH113
        from eurobot_od.od.network import read_network  # costs what most commands do not need

        if written := read_network(network).robot:
            return _written(written, Path(network))
    return None


@lru_cache
def _typed(name: str) -> Plugin:
    """Return the robot that a user names; raises UnknownName, LocalError."""
    if name == NONE:
        return NO_ROBOT
    if name in installed():
        return installed()[name].load()
    if Path(name).is_dir():
        return _of_file(Path(name) / FILE, ATTRIBUTE, f"robot {name}")
    from importlib.util import find_spec

    package = name.partition(".")[0]
    if not package.isidentifier() or find_spec(package) is None:
        raise UnknownName("robot", name, installed())
    return _imported(name, name, name)


def _of_file(file: Path, attribute: str, what: str) -> Plugin:
    """Return the plugin in a Python file that a user names; raises LocalError."""
    from eurobot_od.support import extras

    loaded = extras.load(file)
    found = _checked(getattr(loaded, attribute, None), f"{file}: no `{attribute}` in it")
    return _guarded(found, what, loaded.__name__, str(file))


# Device packages: those that the user names, before those that are installed


def packages(named: Sequence[str] = ()) -> tuple[Plugin, ...]:
    """Return the device packages that are `named`, those of the environment and the installed ones.

    One that cannot be loaded is a PackageWarning.
    """
    variable = [each for each in os.environ.get(PACKAGES, "").split(os.pathsep) if each]
    return _packages(tuple(dict.fromkeys((*named, *variable))))


@lru_cache
def _packages(named: tuple[str, ...]) -> tuple[Plugin, ...]:
    files = [Path(each) / PACKAGE_FILE if Path(each).is_dir() else Path(each) for each in named]
    makers = [partial(_of_file, each, PACKAGE_ATTRIBUTE, f"device package {each}") for each in files]
    loaders: list[Callable[[], Plugin]] = [*makers, *(each.load for each in _installed(DEVICES).values())]
    return tuple(each for each in map(_package_if_it_can_be, loaders) if each)


def _package_if_it_can_be(load: Callable[[], Plugin]) -> Plugin | None:
    from warnings import warn

    try:
        return load()
    except (LocalError, OSError) as error:
        warn(f"{error}; going on without this device package", PackageWarning, stacklevel=2)
        return None


def package_of(identity: Sequence[int], among: Iterable[Plugin]) -> Plugin:
    """Return the package for a device of an identity (0x1018), the most exact one; an empty one if there is none."""
    said = tuple(identity)
    fitting = [each for each in among if each.identity and said[: len(each.identity)] == tuple(each.identity)]
    return max(fitting, key=lambda each: len(each.identity), default=NO_ROBOT)


def all_actions(named: Sequence[str] = ()) -> Mapping[str, MakeRow]:
    """Return the steps that device packages add to suites, by their keys; `named` as in `packages`."""
    return {name: action.entered_as(name) for each in packages(named) for name, action in each.actions().items()}


def _written(name: str, file: Path) -> Plugin:
    """Return the robot that a network file names, none if it is not an installed one that can be loaded."""
    if name == NONE:
        return NO_ROBOT
    if name in installed():
        return _loaded_if_it_can_be(installed()[name]) or NO_ROBOT
    path = file.parent / name
    typed = quote(str(path if path.is_dir() else name))
    what = f"{file}: robot: {name} is not an installed robot, and a file runs no code"
    _warn(f"{what}; to run it, set {VARIABLE}, or type --robot {typed}")
    return NO_ROBOT


def the_installed() -> Plugin:
    """Return the robot that counts where none is named; raises LocalError if two do."""
    for ours in (False, True):  # ours last: who has installed a robot of their own means that
        robots = [each for each in installed().values() if each.is_ours is ours]
        loaded = {each.name: robot for each in robots if (robot := _loaded_if_it_can_be(each))}
        if len(loaded) > 1:
            raise LocalError(f"several robots are installed: name one by --robot: {', '.join(sorted(loaded))}")
        for robot in loaded.values():
            return robot
    return NO_ROBOT


def _loaded_if_it_can_be(robot: Installed) -> Plugin | None:
    try:
        return robot.load()
    except LocalError as error:
        _warn(f"{error}; going on without it")
        return None


def _warn(what: str) -> None:
    from warnings import warn

    warn(what, RobotWarning, stacklevel=2)


def table_of(name: str) -> Path | None:
    """Return the protocol table of an installed robot, which another table `extends`.

    Raises UnknownName, LocalError: a table is data, and runs no code but what is installed.
    """
    return look_up("installed robot", name, installed()).load().table


@lru_cache
def installed() -> Mapping[str, Installed]:
    """Return the installed robots by their names.

    The entry points are read from where packages have them (PyPA's "Entry points specification"), as
    `importlib.metadata` takes 40 ms for that.
    """
    return _installed(GROUP)


def _installed(group: str) -> Mapping[str, Installed]:
    found: dict[str, Installed] = {}
    for folder in dict.fromkeys(each or os.curdir for each in sys.path):  # "" in `sys.path` is the working folder
        for file in _entry_points(folder):
            with open(file, encoding="utf-8", errors="replace") as lines:  # noqa: PTH123 (pathlib takes longer)
                rest = lines.read().partition(f"[{group}]")[2]
            for line in rest.partition("\n[")[0].splitlines():
                name, equals, target = map(str.strip, line.partition("="))
                if equals:  # the first one counts, as it does for an import
                    found.setdefault(name, Installed(name, target, file))
    return found


def _entry_points(folder: str) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            packages = [each.path for each in entries if each.name.endswith(".dist-info")]
    except OSError:  # a zip file, or nothing
        return []
    files = (f"{each}/entry_points.txt" for each in packages)
    return [each for each in files if os.access(each, os.R_OK)]


def _imported(target: str, name: str, file: str) -> Plugin:
    """Import a plugin, `module:attribute`, of which `file` tells; raises LocalError for all that it raises."""
    module, _, attribute = target.partition("[")[0].strip().partition(":")
    with blaming(f"robot {name}", module, file):
        found: object = import_module(module)
        for each in (attribute or ATTRIBUTE).split("."):
            found = getattr(found, each, None)
    robot = _checked(found, f"robot {name}: {file}: no `{target}` there")
    return robot if target.startswith(OURS) else _guarded(robot, f"robot {name}", module, file)


def _guarded(robot: Plugin, what: str, module: str, file: str) -> Plugin:
    """Return a robot whose parts raise LocalError, with the place: what is imported late can be broken, too."""

    def guarded(part: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any) -> Any:
            with blaming(what, module, file):
                return part(*args)

        return call

    parts: dict[str, Any] = {name: guarded(part) for name, part in robot._asdict().items() if callable(part)}
    return robot._replace(**parts, nodes={name: guarded(kind) for name, kind in robot.nodes.items()})


@contextmanager
def blaming(what: str, module: str, otherwise: str) -> Iterator[None]:
    """Turn all that somebody's `module` raises into a LocalError with its place there, or with `otherwise`."""
    try:
        with redirect_stdout(sys.stderr):  # standard output may be a document, such as --json
            yield
    except (KeyboardInterrupt, LocalError):
        raise
    except BaseException as error:  # SystemExit, and what `pytest.skip` raises, must not end what needs no robot
        from eurobot_od.support import extras

        inside = f"{module.rpartition('.')[0] or module}."
        said = extras.complaint(error, otherwise, lambda frame: f"{frame.f_globals['__name__']}.".startswith(inside))
        raise LocalError(f"{what}: {said}") from None


def _checked(found: object, otherwise: str) -> Plugin:
    if not isinstance(found, Plugin):
        raise LocalError(f"{otherwise} that is an eurobot_od.plugin.Plugin")
    return found
