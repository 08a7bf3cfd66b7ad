"""What a plug-in adds to the workbench: a robot, or a manufacturer's device package.

The workbench works with any device's EDS. A `Plugin` adds what no EDS says; nothing else of the workbench knows a robot
or a manufacturer. `Plugins` are those that a command uses. Questions about one device, such as its simulated class, go
to the plug-in that knows it: the robot with this role, otherwise the package that fits its identity best. Questions
about a network, such as rules for `diagnose`, go to the robot and the packages of the devices there. `loading` finds
plug-ins.

Slow imports are behind functions, so that a plug-in's description loads at once.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, TypeVar

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od import Dialects
from eurobot_od.season.events import EventsOfLog, no_events

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
    from eurobot_od.device.objects import Store
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

Program: TypeAlias = Callable[[], Coroutine[Any, Any, None]]
"""The program of a node that is checked, started after each boot."""

Faults: TypeAlias = "Mapping[type[Node], Mapping[str, Fault]]"
"""Faults by name, by the class of nodes that can have them."""


class Command(NamedTuple):
    """A command of a plug-in: its description, and its module, which is made like those in `cli`."""

    text: str
    module: str


Scene: TypeAlias = "Callable[[Live], int | None]"
"""Runs a robot's node for the command `node` on a bus; returns the exit status, None to let the node run on."""


class NodeRun(NamedTuple):
    """How the command `node` runs a robot's node: the robot's dialect, the bus, and the duration in s."""

    robot: Plugin
    dialect: str | None
    open_bus: Opener
    duration: float | None


class Stage(Protocol):
    """The options of `node` for a robot's nodes, a dataclass as in `cli.signature`, and what they do with a node."""

    def check(self, role: str) -> None:
        """Check that the options fit a node, empty for a device that is not the robot's; raises LocalError."""

    def values(self, kind: type[Node], dictionary: Dictionary, facts: Sequence[tuple[str, str]]) -> Mapping[str, Any]:
        """Return further arguments for a node's class, by name; `facts` are those of --set."""

    def set_up(self, node: Node, run: NodeRun) -> Scene:
        """Prepare the node, and return what runs it on the bus."""


def _no_catalogue() -> Catalogue:
    from eurobot_od.pdo.kinds import NOTHING

    return NOTHING


class Plugin(NamedTuple):
    """What a robot or a device package adds; each part is optional.

    Its devices are those with its `identity` (vendor-ID, product code, revision, or fewer of these), with the simulated
    class `device`, and those of `nodes`: classes by the names of their EDS files.

    About such a device: `words` is its device.yaml (see `od.maker`), `frames` are its non-CANopen frames, and the
    meaning of its manufacturer-specific EMCY bytes, by COB-ID. `program` is how it takes a program, if not by CiA
    302-3; `address` sets the node-ID of the device with an identity, if it has no LSS.

    About each network with such devices: `watchers` are rules for `diagnose`, `panels` views of the page, `actions`
    steps of suites by key, `faults` additional faults of its nodes, `commands` additional commands.

    About a robot's network: `dialects` are folders of its EDS files, `table` is the protocol table that others may
    extend, `folder` the folder of its other files; `catalogue` has its messages, `drawings` draws them in an MCAP file,
    `suites` is a folder of check suites, `reports` are questions to a season, `beside` returns the events of a log that
    its frames do not show. `partners` connects simulated nodes under test to their surroundings, with random numbers
    from a seed, and returns the programs of some by name; `stored` returns the stored values of such a node. `stage`
    are the options of `node` for them.
    """

    name: str = ""
    identity: Sequence[int] = ()
    device: Callable[[], type[Node]] | None = None
    nodes: Mapping[str, Callable[[], type[Node]]] = MappingProxyType({})
    words: Path | None = None
    frames: Callable[[Dictionary], Mapping[int, ForeignMessage]] = lambda _: {}
    program: Callable[[], DownloadProcedure] | None = None
    address: Callable[[Master, Identity, int], object] | None = None
    watchers: Callable[[], Sequence[type[Watcher]]] = tuple
    panels: Callable[[], Sequence[type[Panel]]] = tuple
    actions: Callable[[], Mapping[str, SuiteAction]] = dict
    faults: Callable[[], Faults] = dict
    commands: Mapping[str, Command] = MappingProxyType({})
    dialects: Dialects = Dialects()
    table: Path | None = None
    folder: Path | None = None
    catalogue: Callable[[], Catalogue] = _no_catalogue
    drawings: Callable[[Messages], Drawings] = lambda _: {}
    suites: Path | None = None
    beside: EventsOfLog = no_events
    reports: Callable[[], Mapping[str, SeasonReport]] = dict
    partners: Callable[[Sequence[Node], int, Callable[[], float]], Mapping[str, Program]] = lambda *_: {}
    stored: Callable[[Dictionary], Store | None] = lambda _: None
    stage: Callable[[], type[Stage]] | None = None

    def role_of(self, device: Dictionary) -> str:
        """Return the name of its node that a file describes, empty if none; the file has known messages."""
        if device.name not in self.nodes:
            return ""
        knows = any(self.catalogue().find(each.name) for each in device.read_pdos(device.default, lambda _: None))
        return device.name if knows else ""

    def is_for(self, identity: Sequence[int]) -> bool:
        """Return whether devices with this identity (0x1018) are its own."""
        return bool(self.identity) and tuple(identity[: len(self.identity)]) == tuple(self.identity)


NOTHING = Plugin()
"""A plug-in without anything."""


def _owner(kind: type[Node]) -> str:
    """Return in words the nodes that can have the faults of a class."""
    from eurobot_od.device.profiles import SimulatedDrive

    return "drives of CiA 402" if kind is SimulatedDrive else f"the {kind.__name__.removeprefix('Simulated').lower()}"


class Plugins(NamedTuple):
    """The plug-ins that a command uses: the `robot`, NOTHING without one, and the device `packages`."""

    robot: Plugin = NOTHING
    packages: Sequence[Plugin] = ()

    def for_identity(self, identity: Sequence[int]) -> Plugin:
        """Return the package that fits a device's identity (0x1018) best; NOTHING if there is none."""
        fitting = (each for each in self.packages if each.is_for(identity))
        return max(fitting, key=lambda each: len(each.identity), default=NOTHING)

    def package_of(self, device: Dictionary) -> Plugin:
        """Return the package that fits a device best; NOTHING if there is none."""
        from eurobot_od.od.identity import Identity

        return self.for_identity(Identity.of(device))

    def of(self, device: Dictionary) -> Plugin:
        """Return the plug-in that knows a device, NOTHING if none does."""
        return self.robot if self.robot.role_of(device) else self.package_of(device)

    def present(self, devices: Iterable[Dictionary]) -> list[Plugin]:
        """Return the robot, and the packages of a network's devices, without repetition."""
        found = [self.robot, *(self.package_of(each) for each in devices)]
        return [each for number, each in enumerate(found) if each is not NOTHING and each not in found[:number]]

    def procedure(self, identity: Sequence[int], content: bytes, force: bool = False) -> DownloadProcedure:
        """Return how a device with an identity takes a program: by CiA 302-3 unless its package says otherwise.

        Raises LocalError if its package objects to the file, unless `force` is set.
        """
        from eurobot_od.client.program import STANDARD

        made = self.for_identity(identity).program
        found = made() if made else STANDARD
        if not force and (why := found.objection(content)):
            raise LocalError(f"{why}; --force downloads it all the same")
        return found

    def commands(self) -> Mapping[str, Command]:
        """Return the commands of all plug-ins, by name."""
        return {name: each for plugin in (*self.packages, self.robot) for name, each in plugin.commands.items()}

    def actions(self) -> Mapping[str, MakeRow]:
        """Return the actions of all plug-ins for suites, by key."""
        brought = {name: each for plugin in (*self.packages, self.robot) for name, each in plugin.actions().items()}
        return {name: each.entered_as(name) for name, each in brought.items()}

    # Simulated nodes

    def kind(self, device: Dictionary, faults: Iterable[str] = (), otherwise: type[Node] | None = None) -> type[Node]:
        """Return the class of a simulated node, with those faults that it can have; raises UnknownName.

        `otherwise` is the class for a device without a plug-in's class (default: SimulatedDevice).
        """
        from eurobot_od.device.simulated import SimulatedDevice

        role = self.robot.role_of(device)
        make = self.robot.nodes[role] if role else self.package_of(device).device
        kind: type[Node] = (make() if make else None) or otherwise or SimulatedDevice
        for name in faults:
            # Faults of other nodes are ignored, as `check --fault` gives all nodes the same ones.
            kind = self.find_fault(name)[1].given_to(kind) if self._can_have(kind, role, name) else kind
        return kind

    def _can_have(self, kind: type[Node], role: str, fault: str) -> bool:
        """Return whether nodes of a class, in a robot's role, can have a fault; raises as `find_fault`."""
        return issubclass(kind, self.find_fault(fault)[0]) and fault.rpartition(".")[0] in ("", role)

    def check_faults(self, devices: Iterable[Dictionary], faults: Iterable[str], profile: int = 0) -> None:
        """Check that each fault is one that a simulated device can have; raises UnknownName, LocalError."""
        simulated = self._simulated(devices, (), profile)
        names = ", ".join(dict.fromkeys(each.name for each, _ in simulated))
        for name in faults:
            if not any(self._can_have(kind, self.robot.role_of(each), name) for each, kind in simulated):
                raise LocalError(
                    f"--fault {name}: no simulated device can have it ({names}): "
                    f"it is one of {_owner(self.find_fault(name)[0])}; `faults` lists those of any device"
                )

    def all_faults(self) -> Faults:
        """Return the faults of the plug-ins' nodes, and those of any device."""
        from eurobot_od.device.faults import DRIVE_FAULTS, FAULTS
        from eurobot_od.device.node import Node
        from eurobot_od.device.profiles import SimulatedDrive

        own = {kind: faults for each in (*self.packages, self.robot) for kind, faults in each.faults().items()}
        return {**own, Node: {**FAULTS, **own.get(Node, {})}, SimulatedDrive: DRIVE_FAULTS}

    def fault_names(self) -> list[str]:
        """Return the names of all faults."""
        return [name for faults in self.all_faults().values() for name in faults]

    def find_fault(self, name: str) -> tuple[type[Node], Fault]:
        """Return a fault by its name, and the class of nodes that can have it; raises UnknownName, LocalError.

        `arm.heartbeat-stops` is a fault of the arm only.
        """
        node, _, plain = name.rpartition(".")
        if node and not self.robot.nodes:
            raise LocalError(
                f"--fault {name}: only a robot's nodes are named; without one write {plain}, for all devices"
            )
        if node and node not in self.robot.nodes:
            raise UnknownName("node", node, self.robot.nodes)
        for owner, faults in self.all_faults().items():
            if plain in faults:
                return owner, faults[plain]
        raise UnknownName("fault", plain, self.fault_names())

    def faulty(self, kind: type[NodeT], name: str) -> type[NodeT]:
        """Return the class of a node with a fault; raises UnknownName, LocalError if such a node cannot have it."""
        from eurobot_od.device.simulated import SimulatedDevice

        owner, fault = self.find_fault(name)
        if not issubclass(kind, owner):
            node = "other devices" if issubclass(kind, SimulatedDevice) else f"the {kind.__name__.lower()}"
            raise LocalError(f"the fault {name} is one of {_owner(owner)}, not of {node}")
        return fault.given_to(kind)

    # Checks

    def shipped_suites(self) -> dict[str, Path]:
        """Return the files of the robot's suites by name."""
        files = sorted(self.robot.suites.glob("*.yaml")) if self.robot.suites else ()
        return {file.stem.removesuffix(".check"): file for file in files}

    def suite(self, text: str) -> Path:
        """Return the file of a suite, given by its path or the name of one of the robot's; raises UnknownName."""
        shipped = self.shipped_suites()
        path = Path(text)
        if text in shipped:  # `./lift` names a file of this name
            return shipped[text]
        if not path.is_file() and (named := text.removesuffix(".yaml").removesuffix(".check")) in shipped:
            return shipped[named]
        if path.is_dir():
            raise LocalError(f"{text} is a folder: name its files, such as {path / '*.yaml'}")
        if not path.is_file() and path.suffix not in (".yaml", ".yml"):
            if not shipped:
                raise LocalError(
                    f"unknown suite {text!r}; a suite is a file, such as {text}.yaml, or comes with a robot: --robot"
                )
            raise UnknownName("suite", text, shipped)
        return path

    def networks(self) -> Networks:
        """Return the networks that suites may be for: the robot's dialects, and any folder of EDS files."""
        from eurobot_od.check.shapes import Networks

        return Networks(self.robot.dialects.folder, self.robot.catalogue(), actions=self.actions())

    def under_test(
        self,
        dictionaries: Mapping[str, Dictionary],
        seed: int,
        clock: Callable[[], float],
        faults: Iterable[str] = (),
        profile: int = 0,
    ) -> list[NodeUnderTest]:
        """Return simulated nodes with these dictionaries, the robot's in their surroundings; raises UnknownName.

        With a `profile`, devices that are not the robot's behave by it, even if a package has a class for them.
        """
        from eurobot_od.check.on_bus import NodeUnderTest

        simulated = self._simulated(dictionaries.values(), faults, profile)
        kinds = dict(zip(dictionaries, (kind for _, kind in simulated)))
        stores = {name: self.robot.stored(each) for name, each in dictionaries.items() if self.robot.role_of(each)}
        nodes = {name: kind(dictionaries[name], store=stores.get(name)) for name, kind in kinds.items()}
        ours = [nodes[name] for name, each in dictionaries.items() if self.robot.role_of(each)]
        programs = self.robot.partners(ours, seed, clock) if ours else {}
        return [NodeUnderTest(node, programs.get(node.name)) for node in nodes.values()]

    def _simulated(
        self, devices: Iterable[Dictionary], faults: Iterable[str], profile: int
    ) -> list[tuple[Dictionary, type[Node]]]:
        """Return the class of each simulated device, as in `under_test`."""
        from eurobot_od.device.profiles import simulated_kind

        counting = Plugins(self.robot) if profile else self
        return [(each, counting.kind(each, faults, simulated_kind(each, profile))) for each in devices]

    def simulate(
        self, suite: Suite, options: RunOptions, faults: Iterable[str] = (), seed: int = 1, profile: int = 0
    ) -> SuiteResult:
        """Run a suite against simulated nodes, with the faults that these can have; raises UnknownName."""
        from functools import partial

        from eurobot_od.check.on_bus import run_simulated

        return run_simulated(suite, options, partial(self.under_test, faults=faults, profile=profile), seed)
