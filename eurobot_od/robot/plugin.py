"""What the robot of 2014 brings to the workbench: the plugin that `pyproject.toml` enters.

Rule of this file: it is imported by `--help`, so whatever costs time is imported in a function.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar

from eurobot_od.od.dialects import Dialects
from eurobot_od.plugin import Command, Faults, Plugin, Program
from eurobot_od.robot import dialects

if TYPE_CHECKING:
    from eurobot_od.device.node import Node
    from eurobot_od.export.mcap import Drawings
    from eurobot_od.pdo.catalogue import Catalogue
    from eurobot_od.pdo.protocol import Protocol
    from eurobot_od.plugin import Stage
    from eurobot_od.season.reports import SeasonReport
    from eurobot_od.web.panel import Panel

HERE = Path(__file__).parent

Value = TypeVar("Value")


def _catalogue() -> Catalogue:
    from eurobot_od.robot.model.messages import CATALOGUE

    return CATALOGUE


def _node(role: str) -> Callable[[], type[Node]]:
    def kind() -> type[Node]:
        from eurobot_od.robot.nodes import ROLES

        return ROLES[role]

    return kind


def _faults() -> Faults:
    from eurobot_od.robot.faults import FAULTS

    return FAULTS


def _partners(nodes: Sequence[Node], seed: int, clock: Callable[[], float]) -> Mapping[str, Program]:
    from eurobot_od.robot.check.partners import partners

    return partners(nodes, seed, clock)


def _panels() -> Sequence[type[Panel]]:
    from eurobot_od.robot.panel import FieldPanel

    return (FieldPanel,)


def _drawings(protocol: Protocol) -> Drawings:
    from eurobot_od.robot.model.poses import drawings

    return drawings(protocol)


def _reports() -> Mapping[str, SeasonReport]:
    from eurobot_od.robot.season import REPORTS

    return REPORTS


def _stage() -> Stage:
    from eurobot_od.robot.commands import node

    return node


def own_robot(
    folder: str | Path, name: str, catalogue: Catalogue, nodes: Mapping[str, type[Node]] = MappingProxyType({})
) -> Plugin:
    """Return a team's own robot: our core, drive and navigation on a table of its own, with nodes of its own.

    The `folder` has the EDS files in `eds/`, with `robot.yaml` and the table, check suites in `checks/`, and what it
    plays in `strategy.py`. The `catalogue` is a copy of ours with the team's messages in it; each message in it that is
    none of ours can have faults. `nodes` are the classes of its own nodes by their EDS files' names.
    """
    home = Path(folder)
    dialects_here = Dialects(home / "eds")

    @cache
    def speaking(role: str) -> type[Node]:
        kind = ROBOT.nodes[role]()
        return type(kind.__name__, (kind,), {"CATALOGUE": catalogue, "__doc__": kind.__doc__})

    kinds: dict[str, Callable[[], type[Node]]] = {role: partial(speaking, role) for role in ROBOT.nodes}
    kinds |= {role: partial(_itself, kind) for role, kind in nodes.items()}

    @cache
    def faults() -> Faults:
        from eurobot_od.faults.messages import generated
        from eurobot_od.pdo.protocol import Protocol

        ours = set(ROBOT.catalogue().types)
        bindings = Protocol.of_devices(dialects_here.load_all(), catalogue).bindings
        own = [each for each in bindings if each.type in catalogue.types and each.type not in ours]
        made = {kinds[role](): [generated(each, role) for each in own] for role in kinds}
        return {**{kind: dict(ChainMap(*reversed(found))) for kind, found in made.items() if any(found)}, **_faults()}

    return ROBOT._replace(
        name=name,
        dialects=dialects_here,
        catalogue=partial(_itself, catalogue),
        nodes=kinds,
        faults=faults,
        suites=home / "checks",
        table=home / "eds" / "protocol.yaml",
        folder=home,
    )


def _itself(value: Value) -> Value:
    return value


COMMANDS = {
    "match": "play a match of the three nodes, in simulated or real time",
    "world": "run the world that simulated nodes in other processes share",
    "new-robot": "write a robot of your own that works at once: table, nodes, strategy, checks",
    "field": "draw the playing field with what a log says of the match: SVG, HTML or PNG",
}

ROBOT = Plugin(
    name="Eurobot 2014",
    dialects=dialects.DIALECTS,
    catalogue=_catalogue,
    nodes={role: _node(role) for role in ("core", "drive", "navigation")},
    faults=_faults,
    suites=HERE / "check" / "suites",
    partners=_partners,
    panels=_panels,
    drawings=_drawings,
    reports=_reports,
    stage=_stage,
    commands={
        name: Command(text, f"eurobot_od.robot.commands.{name.replace('-', '_')}") for name, text in COMMANDS.items()
    },
    table=dialects.eds_folder() / "protocol.yaml",
)
