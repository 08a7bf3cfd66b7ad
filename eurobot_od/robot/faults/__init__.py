"""Faults of the robot's nodes, and of any device; see `eurobot_od.faults`.

Every fault names the step of the shipped suite that finds it; `tools/fault_matrix.py` proves it for all of them, which
shows that the suites would find such a fault in a real node.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.faults import conformance, device
from eurobot_od.faults.fault import Caught, Fault
from eurobot_od.robot.faults import any_node, core, drive, navigation
from eurobot_od.robot.nodes import KINDS, ROLES, Core, Drive, Navigation, Node

NodeT = TypeVar("NodeT", bound=Node)

FAULTS: dict[type[Node], dict[str, Fault]] = {
    Core: core.FAULTS,
    Drive: drive.FAULTS,
    Navigation: navigation.FAULTS,
    Node: {**device.FAULTS, **any_node.FAULTS, **conformance.FAULTS},
}
"""The faults with their names, by the class of node that can have them; those of Node any node can have."""


def names() -> list[str]:
    """Return the names of all faults."""
    return [name for faults in FAULTS.values() for name in faults]


def find(name: str) -> tuple[type[Node], Fault]:
    """Return a fault by its name, and the class of node that can have it; raises UnknownName."""
    for owner, faults in FAULTS.items():
        if name in faults:
            return owner, faults[name]
    raise UnknownName("fault", name, names())


def faulty(role: type[NodeT], name: str) -> type[NodeT]:
    """Return the class of a node that has a fault; raises UnknownName, LocalError if such a node cannot have it."""
    owner, fault = find(name)
    if not issubclass(role, owner):
        node = f"the {role.__name__.lower()}" if role in ROLES.values() else "other devices"
        raise LocalError(f"the fault {name} is one of the {owner.__name__.lower()}, not of {node}")
    return fault.given_to(role)


def faulty_kinds(names: Iterable[str]) -> dict[str, type[Node]]:
    """Return the classes of all nodes by their roles, where those that can have one of some faults have it.

    Raises UnknownName.
    """
    kinds = dict(KINDS)
    for name in names:
        owner, _ = find(name)
        kinds |= {role: faulty(kind, name) for role, kind in kinds.items() if issubclass(kind, owner)}
    return kinds


__all__ = ["FAULTS", "Caught", "Fault", "faulty", "faulty_kinds", "find", "names"]
