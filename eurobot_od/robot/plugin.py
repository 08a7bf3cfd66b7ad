"""The robot of 2014 as a plug-in, which `pyproject.toml` registers.

`--help` imports this module, so slow imports are in functions.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from eurobot_od.errors import look_up
from eurobot_od.od import Dialects
from eurobot_od.plugin import Command, Faults, Plugin
from eurobot_od.robot import dialects

if TYPE_CHECKING:
    from eurobot_od.device.node import Node
    from eurobot_od.pdo.kinds import Catalogue

HERE = Path(__file__).parent


def _imported(module: str, name: str) -> Any:
    """Return an object of this package, imported on first use."""
    return getattr(import_module(f"{__package__}.{module}"), name)


def own_robot(
    folder: str | Path, name: str, catalogue: Catalogue, nodes: Mapping[str, type[Node]] = MappingProxyType({})
) -> Plugin:
    """Return a team's own robot: our core, drive and navigation with the team's table, and the team's own nodes.

    Args: folder: has the EDS files in `eds/`, with `robot.yaml` and the table, check suites in `checks/`, and
    `strategy.py`. name: the robot's name. catalogue: a copy of ours with the team's messages added; each of these can
    have faults. nodes: the classes of the team's nodes by the names of their EDS files; one with a `COMPONENT` is part
    of the start (see `robot.nodes.node.Component`).

    Raises UnknownName for a node without an EDS file.
    """
    home = Path(folder)
    dialects_here = Dialects(home / "eds")
    for role in nodes:
        look_up("node with an EDS file", role, {each.stem: each for each in home.glob("eds/**/*.eds")})

    parts = {name: part for name, kind in nodes.items() if (part := getattr(kind, "COMPONENT", None)) is not None}

    @cache
    def speaking(role: str) -> type[Node]:
        kind = ROBOT.nodes[role]()
        own = {"CATALOGUE": catalogue, "COMPONENTS": parts, "__doc__": kind.__doc__}
        return type(kind.__name__, (kind,), own)

    kinds: dict[str, Callable[[], type[Node]]] = {role: partial(speaking, role) for role in ROBOT.nodes}
    kinds |= {role: partial(nodes.__getitem__, role) for role in nodes}

    @cache
    def faults() -> Faults:
        from eurobot_od.device.faults import generated
        from eurobot_od.pdo.protocol import Protocol

        ours = set(ROBOT.catalogue().types)
        bindings = Protocol.of_devices(dialects_here.load_all(), catalogue).bindings
        own = [each for each in bindings if each.type in catalogue.types and each.type not in ours]
        made = {kinds[role](): [generated(each, role) for each in own] for role in kinds}
        theirs = {kind: dict(ChainMap(*reversed(found))) for kind, found in made.items() if any(found)}
        return {**theirs, **_imported("faults", "FAULTS")}

    return ROBOT._replace(
        name=name,
        dialects=dialects_here,
        catalogue=lambda: catalogue,
        nodes=kinds,
        faults=faults,
        suites=home / "checks",
        table=home / "eds" / "protocol.yaml",
        folder=home,
    )


COMMANDS = {
    "match": "play a match of the three nodes, in simulated or real time",
    "world": "run the world that simulated nodes in other processes share",
    "new-robot": "write a robot of your own that works at once: table, nodes, strategy, checks",
    "field": "draw the playing field with what a log says about the match: SVG, HTML or PNG",
}

ROBOT = Plugin(
    name="Eurobot 2014",
    dialects=dialects.DIALECTS,
    catalogue=partial(_imported, "model.messages", "CATALOGUE"),
    nodes={
        role: partial(lambda name: _imported("nodes", "ROLES")[name], role) for role in ("core", "drive", "navigation")
    },
    faults=partial(_imported, "faults", "FAULTS"),
    suites=HERE / "check" / "suites",
    partners=lambda *nodes: _imported("check", "partners")(*nodes),
    stored=lambda dictionary: _imported("check", "stored")(dictionary),
    panels=lambda: (_imported("scene.panel", "FieldPanel"),),
    drawings=lambda protocol: _imported("scene.files", "drawings")(protocol),
    beside=lambda log: _imported("season", "events_of")(log),
    reports=partial(_imported, "season", "REPORTS"),
    watchers=lambda: (_imported("check.diagnosis", "EurobotWatcher"),),
    stage=partial(_imported, "commands.node", "NodeOptions"),
    commands={
        name: Command(text, f"eurobot_od.robot.commands.{name.replace('-', '_')}") for name, text in COMMANDS.items()
    },
    table=dialects.eds_folder() / "protocol.yaml",
)
