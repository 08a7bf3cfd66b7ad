"""What a fault is: a sentence, the class that makes it, and the step of a check that finds it."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from eurobot_od.device.faults.hooks import Mixin
from eurobot_od.device.node import Node

NodeT = TypeVar("NodeT", bound=Node)


class Caught(NamedTuple):
    """The step of a suite that turns red: the one whose name says what is wrong."""

    suite: str
    step: str

    def fault(self, text: str, mixin: Mixin) -> Fault:
        """Return a fault that this step finds."""
        return Fault(text, mixin, self)


class Fault(NamedTuple):
    """Something that is wrong with a node.

    `mixin` is the class that goes in front of the node's class; `text` says what the node does wrong.
    """

    text: str
    mixin: Mixin
    caught_by: Caught

    def given_to(self, role: type[NodeT]) -> type[NodeT]:
        """Return the class of a node that has this fault."""
        return type(role.__name__, (self.mixin, role), {})
