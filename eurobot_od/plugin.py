"""A robot: what it brings to the workbench, and where it is found.

The workbench takes any device's EDS. A robot adds what no EDS says: which folders of EDS files are its own, which
classes its messages and nodes have, what can be wrong with them, and commands of its own. All of that comes in here, as
one `Plugin`; nothing else of the workbench knows of a robot. Ours is found as anybody's is:

1. `--robot`, or else the variable EUROBOT_OD_ROBOT, or else `robot:` in the `eurobot-od.yaml` of the folder: the name
   of an installed robot, a folder with a `robot.py`, or a module; in both the plugin is called `ROBOT`.
2. Or else the robot that is installed, by its entry point of the group `eurobot_od.robots`. Of several it is one that
   somebody else's package brings.

What costs time to import is a function that imports it: a description of a robot is there at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, TypeVar

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od import DEFAULT
from eurobot_od.od.dialects import Dialects

if TYPE_CHECKING:
    import argparse

    from eurobot_od.bus.live import Live
    from eurobot_od.check.results import SuiteResult
    from eurobot_od.check.runner import RunOptions
    from eurobot_od.check.simulated import NodeUnderTest
    from eurobot_od.check.suite import Suite
    from eurobot_od.check.vocabulary import Networks
    from eurobot_od.device.faults.fault import Fault
    from eurobot_od.device.node import Node
    from eurobot_od.export.mcap import Drawings
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.pdo.catalogue import Catalogue
    from eurobot_od.pdo.protocol import Protocol as Messages
    from eurobot_od.season.reports import SeasonReport
    from eurobot_od.web.panel import Panel

    NodeT = TypeVar("NodeT", bound=Node)

GROUP = "eurobot_od.robots"
"""The group of the entry points that name robots."""

VARIABLE = "EUROBOT_OD_ROBOT"
"""Environment variable that names the robot where a command line does not."""

ATTRIBUTE = "ROBOT"
"""What the plugin is called in its module."""

FILE = "robot.py"
"""The module of a folder that is a robot."""

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


class Scene(Protocol):
    """A node of the robot that the command `node` runs, with what it has besides the bus."""

    def play(self, live: Live) -> int | None:
        """Do what the options say; return the exit status, None if the node is to go on by itself."""


class Stage(Protocol):
    """What the command `node` has to know to run a robot's node: options, and what they make of the node."""

    def add_arguments(self, group: argparse._ActionsContainer) -> None:
        """Describe the options."""

    def check_arguments(self, arguments: argparse.Namespace, role: str) -> None:
        """Raise LocalError for options that do not fit a node, `` for a device that is none of the robot's."""

    def values(self, kind: type[Node], dictionary: Dictionary, arguments: argparse.Namespace) -> Mapping[str, Any]:
        """Return what else a node of the robot is made with, by the names that its class has for it."""

    def set_up(self, node: Node, arguments: argparse.Namespace) -> Scene:
        """Give the node what it has besides the bus."""


def _no_catalogue() -> Catalogue:
    from eurobot_od.pdo.catalogue import NOTHING

    return NOTHING


class Plugin(NamedTuple):
    """What a robot brings.

    `nodes` are its node classes by the names of their EDS files, `faults` what can be wrong with them besides what can
    be wrong with any device. `suites` is a folder of check suites. `partners` gives simulated nodes that are checked
    their surroundings, with all chance from a seed, and returns what some do by themselves, by their names. `panels`
    are views of the page, `drawings` what messages draw in an MCAP file, `reports` questions to a season. `stage` is
    what the command `node` needs. `table` is the protocol table that other tables may build on, `folder` where its
    other files lie.
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
    stage: Callable[[], Stage] | None = None
    commands: Mapping[str, Command] = MappingProxyType({})
    table: Path | None = None
    folder: Path | None = None

    # Nodes

    def role_of(self, dictionary: Dictionary) -> str:
        """Return which of the robot's nodes a file describes, ``: none; it has its name, and messages that it knows.

        Raises LocalError for a class of a team's own that goes by a message which the file does not have.
        """
        from eurobot_od.od.values import PdoDirection
        from eurobot_od.support import python_file

        if dictionary.name not in self.nodes:
            return ""
        kind = self.nodes[dictionary.name]()
        known = {
            entry.type: pdo.direction
            for pdo in dictionary.read_pdos(dictionary.default, lambda _: None)
            if (entry := kind.CATALOGUE.find(pdo.name))
        }
        if not kind.__module__.startswith(OURS):  # ours may be given fewer messages than they know
            heard = [message for message, direction in known.items() if direction is PdoDirection.RPDO]
            wrong = [f"handles {each.__name__}, and has no RPDO of it" for each in kind.HANDLERS if each not in heard]
            wrong += [f"binds {each!r}, which is no object" for each in kind.OBJECTS if not dictionary.data_index(each)]
            if wrong:
                raise LocalError(f"{python_file.place_of(kind)}: {kind.__name__} {wrong[0]} in {dictionary.file}")
        return dictionary.name if known else ""

    def kind(self, role: str, faults: Iterable[str] = (), device: type[Node] | None = None) -> type[Node]:
        """Return the class of a node, `device` (SimulatedDevice) if it has no role; it has the faults that it can have.

        Raises UnknownName for a fault.
        """
        from eurobot_od.device.simulated import SimulatedDevice

        kind: type[Node] = self.nodes[role]() if role else device or SimulatedDevice
        for owner, fault in map(self.find_fault, faults):
            # A fault of another node's is passed over: `check --fault` gives all nodes the same ones.
            kind = fault.given_to(kind) if issubclass(kind, owner) else kind
        return kind

    # Faults

    def all_faults(self) -> Faults:
        """Return the faults of the robot's nodes, and those that any device can have."""
        from eurobot_od.device.drive import SimulatedDrive
        from eurobot_od.device.faults import device, drive
        from eurobot_od.device.node import Node

        own = dict(self.faults())
        return {**own, Node: {**device.FAULTS, **own.get(Node, {})}, SimulatedDrive: drive.FAULTS}

    def fault_names(self) -> list[str]:
        """Return the names of all faults."""
        return [name for faults in self.all_faults().values() for name in faults]

    def find_fault(self, name: str) -> tuple[type[Node], Fault]:
        """Return a fault by its name, and the class of node that can have it; raises UnknownName."""
        for owner, faults in self.all_faults().items():
            if name in faults:
                return owner, faults[name]
        raise UnknownName("fault", name, self.fault_names())

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
        return {file.stem: file for file in sorted(self.suites.glob("*.yaml"))} if self.suites else {}

    def suite(self, text: str) -> Path:
        """Return the file that is meant by a path or by the name of one of the robot's suites; raises UnknownName."""
        shipped, path = self.shipped_suites(), Path(text)
        if text in shipped and not path.is_file():  # a file that lies here is what was meant, whatever it is called
            return shipped[text]
        if not path.is_file() and path.suffix not in (".yaml", ".yml"):
            raise UnknownName("suite", text, shipped)
        return path

    def networks(self) -> Networks:
        """Return the networks that suites may be for: the dialects, and any folder of EDS files."""
        from eurobot_od.check.vocabulary import Networks

        return Networks(self.dialects.folder, self.catalogue())

    def under_test(
        self,
        dictionaries: Mapping[str, Dictionary],
        seed: int,
        clock: Callable[[], float],
        faults: Iterable[str] = (),
        profile: int = 0,
    ) -> list[NodeUnderTest]:
        """Make simulated nodes that have these dictionaries, the robot's in their surroundings; raises UnknownName.

        Those that have no role behave as a device `profile` says.
        """
        from eurobot_od.check.simulated import NodeUnderTest
        from eurobot_od.device.kinds import simulated_kind

        roles = {name: self.role_of(each) for name, each in dictionaries.items()}
        kinds = {name: simulated_kind(each, profile) for name, each in dictionaries.items()}
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
    ) -> SuiteResult:
        """Run a suite against simulated nodes, those that can have some faults having them; raises UnknownName.

        With a `profile` devices that are none of the robot's behave as it says.
        """
        from functools import partial

        from eurobot_od.check.simulated import run_simulated

        make_nodes = partial(self.under_test, faults=faults, profile=profile)
        return run_simulated(suite, options, make_nodes, seed)


NO_ROBOT = Plugin()
"""The workbench alone."""


# Where it is found


def find(name: str | None = None, folder: str | Path = "") -> Plugin:
    """Return the robot that is meant: `name`, or the environment's, or the `folder`'s, or the one that is installed.

    Raises UnknownName; LocalError, with the place, for one that cannot be loaded; DictionaryError for a network file.
    """
    named, file = name or os.environ.get(VARIABLE), Path(folder) / DEFAULT
    if not named and os.path.isfile(file):  # noqa: PTH113
        from eurobot_od.od.network import read_network  # costs what most commands do not need

        named = read_network(file).robot
        # A path in the file is relative to the file; what is not a folder there is an installed robot's name.
        named = str(file.parent / named) if named and (file.parent / named).is_dir() else named
    if named:
        return _load(named)
    # Ours last: who has installed a robot of their own means that.
    for entered in sorted(installed().values(), key=lambda module: module.startswith(OURS)):
        robot = _entered(entered)
        if robot is not None:
            return robot
    return NO_ROBOT


@lru_cache
def installed() -> dict[str, str]:
    """Return where the plugins of installed robots are, `module:attribute` by their names.

    The entry points are read from where packages have them (PyPA's "Entry points specification"), as
    `importlib.metadata` takes 40 ms for that.
    """
    found: dict[str, str] = {}
    for folder in dict.fromkeys(each or os.curdir for each in sys.path):  # "" in `sys.path` is the working folder
        for file in _entry_points(folder):
            with open(file, encoding="utf-8") as lines:  # noqa: PTH123 (pathlib takes as long as all of this)
                _, group, rest = lines.read().partition(f"[{GROUP}]")
            for line in rest.partition("\n[")[0].splitlines() if group else ():
                name, equals, module = line.partition("=")
                if equals:  # the first one counts, as it does for an import
                    found.setdefault(name.strip(), module.strip())
    return found


def _entry_points(folder: str) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            packages = [each.path for each in entries if each.name.endswith(".dist-info")]
    except OSError:  # a zip file, or nothing
        return []
    files = (f"{each}/entry_points.txt" for each in packages)
    return [each for each in files if os.path.isfile(each)]  # noqa: PTH113


def _entered(module: str) -> Plugin | None:
    """Import the plugin of an entry point, None if its module is no longer there."""
    try:
        return _attribute(module)
    except ModuleNotFoundError as error:
        # A package that was removed by hand leaves its entry point; any other missing module is the robot's own fault.
        if error.name and module.startswith(error.name):
            return None
        raise LocalError(f"the robot {module} cannot be imported: {error}") from None


@lru_cache
def _load(named: str) -> Plugin:
    if named in installed():
        robot = _entered(installed()[named])
        if robot is None:
            raise LocalError(f"robot {named}: there is no {installed()[named]}")
        return robot
    folder = Path(named)
    if folder.is_dir():
        from eurobot_od.support import python_file

        return _checked(getattr(python_file.load(folder / FILE), ATTRIBUTE, None), f"{folder / FILE}")
    try:
        return _attribute(named)
    except ModuleNotFoundError:
        raise UnknownName("robot", named, installed()) from None
    except ValueError:  # no name of a module
        raise UnknownName("robot", named, installed()) from None


def _attribute(named: str) -> Plugin:
    module, _, attribute = named.partition(":")
    return _checked(getattr(import_module(module), attribute or ATTRIBUTE, None), named)


def _checked(found: object, where: str) -> Plugin:
    if not isinstance(found, Plugin):
        raise LocalError(f"{where}: no `{ATTRIBUTE}` in it that is an eurobot_od.plugin.Plugin")
    return found
