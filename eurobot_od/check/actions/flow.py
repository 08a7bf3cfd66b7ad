"""Actions without frames or objects: NMT commands, waiting, skipping, groups."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from eurobot_od.check.shapes import DURATION, ActionRow, DocumentShapes, MakeRow
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
    """Send an NMT command to a node; node-ID 0 is all nodes."""

    command: NmtCommand
    node_id: int

    def __str__(self) -> str:
        return f"NMT {self.command.name.lower().replace('_', ' ')}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        tester.ask()
        tester.started = self.node_id if self.command is NmtCommand.START else None
        await tester.put(Frame(NMT_COB_ID, bytes([self.command, self.node_id])))

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        command = Key(yaml_shapes.named(NMT_COMMANDS, "NMT command"), "NMT command", needed=True)

        def make(command: NmtCommand, given: Dictionary | None) -> Nmt:
            # Other services need a node; NMT has the node-ID 0 for all of them (CiA 301, 7.2.8.2.1).
            is_to_all = given is None and shapes.services.nodes != 1
            return Nmt(command, ALL_NODES if is_to_all else shapes.services.dictionary(given).node_id)

        return ActionRow(shapes.services.service("command", command, make))


class Wait(NamedTuple):
    """Wait for a time in s."""

    seconds: float

    def __str__(self) -> str:
        return f"wait {texts.text(self.seconds)}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        await tester.trace.sleep(self.seconds)
        tester.edge = len(tester.trace)

    @staticmethod
    def row(_: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(DURATION, Wait)


class Skip(NamedTuple):
    """Do nothing, for a reason that the report shows."""

    reason: str

    def __str__(self) -> str:
        return f"skip: {self.reason}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        raise Skipped(self.reason)

    @staticmethod
    def row(_: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(TEXT, lambda text: Skip(str(text)))


ACTIONS: Mapping[str, MakeRow] = {
    "nmt": Nmt.row,
    "wait": Wait.row,
    "skip": Skip.row,
    "steps": lambda shapes: ActionRow(yaml_shapes.listing(shapes.step), Group),
}
"""The actions of this module by key."""
