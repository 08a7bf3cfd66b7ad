"""Actions without a question about frames or objects: NMT commands, time, and nothing at all."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.check.shapes import DURATION, ActionRow, DocumentShapes
from eurobot_od.check.suite import Group
from eurobot_od.check.tester import BenchTester, Skipped
from eurobot_od.device.nmt import COMMAND_NAMES, NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ALL_NODES, NMT_COB_ID
from eurobot_od.support import texts, yaml_shapes
from eurobot_od.support.yaml_shapes import TEXT, Key

NMT_COMMANDS = {name: command for command, name in COMMAND_NAMES.items()}


class Nmt(NamedTuple):
    """Send an NMT command to a node, 0 for all."""

    command: NmtCommand
    node_id: int

    def __str__(self) -> str:
        return f"NMT {self.command.name.lower().replace('_', ' ')}"

    async def run(self, tester: BenchTester) -> None:
        """Do it; raises as `suite.StepAction.run`."""
        tester.ask()
        tester.started = self.node_id if self.command is NmtCommand.START else None
        await tester.put(Frame(NMT_COB_ID, bytes([self.command, self.node_id])))

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return how a suite names it."""
        command = Key(yaml_shapes.named(NMT_COMMANDS, "NMT command"), "NMT command", needed=True)

        def make(command: NmtCommand, given: Dictionary | None) -> Nmt:
            # Other services have to ask which node; NMT has a node-ID for all of them, 0 (CiA 301, 7.2.8.2.1).
            is_to_all = given is None and shapes.services.nodes != 1
            return Nmt(command, ALL_NODES if is_to_all else shapes.services.dictionary(given).node_id)

        return ActionRow(shapes.services.service("command", command, make))


class Wait(NamedTuple):
    """Let time pass."""

    seconds: float

    def __str__(self) -> str:
        return f"wait {texts.text(self.seconds)}"

    async def run(self, tester: BenchTester) -> None:
        """Do it; raises as `suite.StepAction.run`."""
        await tester.trace.sleep(self.seconds)
        tester.edge = len(tester.trace)

    @staticmethod
    def row(_: DocumentShapes) -> ActionRow:
        """Return how a suite names it."""
        return ActionRow(DURATION, Wait)


class Skip(NamedTuple):
    """Do nothing, for a reason that the report tells."""

    reason: str

    def __str__(self) -> str:
        return f"skip: {self.reason}"

    async def run(self, tester: BenchTester) -> None:
        """Do it; raises as `suite.StepAction.run`."""
        raise Skipped(self.reason)

    @staticmethod
    def row(_: DocumentShapes) -> ActionRow:
        """Return how a suite names it."""
        return ActionRow(TEXT, lambda text: Skip(str(text)))


def _group(shapes: DocumentShapes) -> ActionRow:
    return ActionRow(yaml_shapes.listing(shapes.step), Group)


ACTIONS = {"nmt": Nmt.row, "wait": Wait.row, "skip": Skip.row, "steps": _group}
"""The actions of this module by their keys."""
