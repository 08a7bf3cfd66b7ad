"""Faults on demand: what can be wrong with a node, each as a class of node that does just that.

Every fault names the step of the shipped suite that finds it; `tools/fault_matrix.py` proves it for all of them, which
shows that the suites would find such a fault in a real node.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.faults import core, device, drive, navigation
from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation, Node

NodeT = TypeVar("NodeT", bound=Node)

FAULTS: dict[type[Node], dict[str, Fault]] = {
    Core: core.FAULTS,
    Drive: drive.FAULTS,
    Navigation: navigation.FAULTS,
    Node: device.FAULTS,
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
        raise LocalError(f"the fault {name} is one of the {owner.__name__.lower()}, not of the {role.__name__.lower()}")
    return type(role.__name__, (fault.mixin, role), {})


def faulty_roles(names: Iterable[str]) -> dict[str, type[Node]]:
    """Return the classes of the robot's nodes, where those that can have one of some faults have it.

    Raises UnknownName.
    """
    chosen = list(names)
    return {node: with_faults(role, chosen) for node, role in ROLES.items()}


def with_faults(role: type[NodeT], names: Iterable[str]) -> type[NodeT]:
    """Return the class of a node with those of some faults that it can have; raises UnknownName."""
    for name in names:
        if issubclass(role, find(name)[0]):
            role = faulty(role, name)
    return role


__all__ = ["FAULTS", "Caught", "Fault", "faulty", "faulty_roles", "find", "names", "with_faults"]
