"""Actions with a whole node: its boot-up, NMT state, errors, and a dump of its objects; and steps without a node."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from canopen.objectdictionary import ODVariable

from eurobot_od.check.actions.frames import Expect, Period
from eurobot_od.check.actions.objects import whole_upload
from eurobot_od.check.shapes import DURATION, WITHIN, ActionRow, DocumentShapes, MakeRow
from eurobot_od.check.suite import Group, Mismatch, NodeServices, Reported
from eurobot_od.check.tester import BenchTester, Failed, Gone, Skipped
from eurobot_od.device.broadcasts import HISTORY, REGISTER_BITS
from eurobot_od.device.nmt import COMMAND_NAMES, NmtCommand, NmtState
from eurobot_od.errors import LocalError, NoAnswer, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import COMMANDS, ERROR_FIELD, ERROR_REGISTER, ERRORS
from eurobot_od.od.values import (
    ALL_NODES,
    DOMAIN,
    ERROR_CONTROL_BASE,
    NMT_COB_ID,
    NOT_SCANNED,
    Address,
    PdoDirection,
    label,
)
from eurobot_od.od.words import error_words
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support import texts, yaml_shapes
from eurobot_od.support.texts import amount
from eurobot_od.support.yaml_shapes import SCALAR, TEXT, Key, converted

BOOTED = bytes([NmtState.INITIALISING])
"""Data of a boot-up message (CiA 301, 7.3.2.2.2)."""

ERROR_CONTROL = range(ERROR_CONTROL_BASE + 1, ERROR_CONTROL_BASE + 0x80)

POLLED = 0.1
"""Maximum time for the answer of a node that may still boot, in s."""


class BootUp(NamedTuple):
    """Wait for the boot-up after a reset; without one, ask by SDO for as long again whether the node is there."""

    node: NodeServices
    within: float | None = None

    def __str__(self) -> str:
        return f"boot-up of {self.node.name}"

    async def run(self, tester: BenchTester) -> None:
        """Wait for the boot-up.

        Raises Failed, once per node, if the node answers without a boot-up, Gone if it does not come back.
        """
        missing = Reported.NO_BOOT_UP, self.node
        # For a node without boot-up, only the first step waits for one.
        if missing not in tester.reported and await self._booted(tester):
            return
        deadline = tester.deadline(self.within)
        while tester.trace.now < deadline:
            if await tester.is_there(self.node, POLLED):
                break
        else:
            raise Gone(f"{self._no_boot_up(tester)}, and no answer to an SDO request as long again")
        if missing not in tester.reported:
            tester.reported.add(missing)
            raise Failed(f"{self._no_boot_up(tester)}, but the node answers SDO requests")

    async def _booted(self, tester: BenchTester) -> bool:
        """Wait for a boot-up since the last request; return whether it came."""
        own = frozenset([ERROR_CONTROL_BASE + self.node.node_id])
        deadline = tester.deadline(self.within)
        begun = tester.trace.now
        start = tester.mark
        # Heartbeats and answers to guarding may come first, as they were queued before the reset.
        while (number := await tester.trace.first(own, start, deadline)) is not None:
            start = number + 1
            if tester.trace.frames[number].frame.data == BOOTED:
                tester.use(number)
                tester.note_wait(tester.trace.frames[number].time - begun, tester.longest(self.within))
                return True
        return False

    def _no_boot_up(self, tester: BenchTester) -> str:
        """Return that no boot-up came, and which other node-ID booted instead: the node may have changed its own."""
        seen = (frame for _, frame, own in tester.trace.frames[tester.mark :] if not own and frame.data == BOOTED)
        others = sorted({frame.cob_id - ERROR_CONTROL_BASE for frame in seen if frame.cob_id in ERROR_CONTROL})
        instead = f" (node {', '.join(map(str, others))} booted instead)" if others else ""
        within = texts.text(tester.longest(self.within))
        return f"no boot-up {ERROR_CONTROL_BASE + self.node.node_id:03X}#00 in {within} after a reset{instead}"

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        awaited = Key(yaml_shapes.named({"awaited": True}, "boot-up"), "the boot-up is waited for", needed=True)
        services = shapes.services
        boot_up = services.service("when", awaited, lambda _, given: BootUp(services.of(given)))
        return ActionRow(boot_up, extra=WITHIN)


class Dump(NamedTuple):
    """Read many objects, and keep their values, or compare them with those kept.

    `process_data` are objects that the device's application writes: they are read, but not compared. Objects that
    change between two reads are not compared, either.
    """

    node: NodeServices
    variables: tuple[ODVariable, ...]
    equal: bool
    process_data: frozenset[Address] = frozenset()

    def __str__(self) -> str:
        return f"dump of {amount(len(self.variables), 'object')}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        if self.equal and not tester.dumped:
            raise Skipped("nothing was read before")
        tester.ask()
        dump = await self._values(tester)
        if not self.equal:
            again = await self._values(tester)
            sent = {objects.label(each) for each in self.variables if objects.address_of(each) in self.process_data}
            tester.dumped = again
            tester.process_data = sent | {each for each in dump if dump[each] != again[each]}
            return
        before = {each: tester.dumped.get(each, "not read") for each in dump}
        differing = [each for each in dump if before[each] != dump[each]]
        # Errors can be cleared, but not brought back.
        same = {each for each in dump if dump[each] < before[each] and each.startswith(label(ERRORS))}
        left_out = [each for each in differing if each in tester.process_data and each not in same]
        off = [
            Mismatch(each, before[each], dump[each])
            for each in differing
            if each not in same and each not in tester.process_data
        ]
        if off:
            raise Failed(f"{amount(len(off), 'object')} not as before", mismatches=off)
        if left_out:
            tester.remark = f"not as before, but process data, which is not compared: {', '.join(left_out)}"

    async def _values(self, tester: BenchTester) -> dict[str, str]:
        """Read the objects; a refused one has the abort as its value."""
        dump = {}
        for variable in self.variables:
            try:
                read = partial(whole_upload, variable, tester.timeout)
                data = await tester.asked(read, self.node)
                dump[objects.label(variable)] = data.hex(" ").upper()
            except sdo.Aborted as error:  # a refusal is a value, too: a dump is red only for changes
                dump[objects.label(variable)] = code_and_reason(error.code)
            except sdo.OddAnswer as error:
                dump[objects.label(variable)] = str(error)
        return dump

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        when = Key(yaml_shapes.named({"before": False, "equal": True}, "dump"), "before or equal", needed=True)

        def make(is_equal: bool, given: Dictionary | None) -> Dump:
            node = shapes.services.dictionary(given)
            # Objects that keep their value unless written: `ro` is measured, a DOMAIN is a file of any size. Of the
            # error history only the number, as errors can be cleared only by the client that caused them.
            steady = (each for each in objects.all_objects(node.objects) if each.access_type in ("rw", "const"))
            kept = (each for each in steady if each.index not in COMMANDS or objects.address_of(each) == ERRORS)
            seen = (each for each in kept if not node.flags(objects.address_of(each)) & NOT_SCANNED)
            chosen = (each for each in seen if objects.data_type(each) is not DOMAIN)
            # The device's application writes the objects that TPDOs send.
            pdos = node.read_pdos(node.default, lambda _: None)
            sent = (entry.address for each in pdos if each.direction is PdoDirection.TPDO for entry in each.mapping)
            return Dump(NodeServices.of(node), tuple(chosen), is_equal, frozenset(sent))

        return ActionRow(shapes.services.service("when", when, make))


class SelfReported(NamedTuple):
    """Fail if a node reports an error by its error register 0x1001, with the errors of its history 0x1003."""

    node: NodeServices

    def __str__(self) -> str:
        return "no error"

    async def run(self, tester: BenchTester) -> None:
        """Read the node's errors; raises NoAnswer, Failed with all errors as text, Skipped if it has no 0x1001."""
        tester.ask()
        try:
            register = await tester.asked(
                partial(sdo.upload, ERROR_REGISTER, tester.timeout, room=sdo.A_NUMBER), self.node
            )
        except sdo.Aborted:
            raise Skipped("the node has no error register (0x1001)") from None
        bits = int.from_bytes(register, "little")
        if bits:
            words = [name for bit, name in enumerate(REGISTER_BITS) if bits >> bit & 1]
            with suppress(sdo.Aborted):  # the history 0x1003 is optional (CiA 301, 7.5.2.4)
                count = await tester.asked(partial(sdo.upload, ERRORS, tester.timeout, room=sdo.A_NUMBER), self.node)
                for sub in range(1, min(int.from_bytes(count, "little"), HISTORY) + 1):
                    read = partial(sdo.upload, (ERROR_FIELD, sub), tester.timeout, room=sdo.A_NUMBER)
                    remembered = await tester.asked(read, self.node)
                    # The lower half is the error code, the upper half the manufacturer's.
                    code = int.from_bytes(remembered[:2], "little")
                    words.append(f"0x{code:04X} {error_words(code, {})}")
            tester.reported.add((Reported.OWN_ERROR, self.node))
            raise Failed(f"{self.node.name} reports an error itself", "none", "; ".join(words))

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        none = Key(yaml_shapes.named({"none": True}, "errors"), "none are there", needed=True)
        services = shapes.services
        return ActionRow(services.service("wanted", none, lambda _, given: SelfReported(services.of(given))))


async def follows_from_own_error(tester: BenchTester, action: object) -> bool:
    """Return whether a missing frame follows from an error that the node has reported before.

    A node with an error may refuse to enter OPERATIONAL or leave it again (0x1029), so after an NMT start its frames
    may be missing.
    """
    nodes = (each for _, each in tester.reported if isinstance(each, NodeServices))
    node = next((each for each in nodes if each.node_id == tester.started), None)
    is_known = node is not None and (Reported.OWN_ERROR, node) in tester.reported
    if node is None or not is_known or not isinstance(action, (Expect, Period)):
        return False
    try:
        return any(await tester.transfer(sdo.upload(ERROR_REGISTER, tester.timeout, room=sdo.A_NUMBER), node))
    except (sdo.Aborted, NoAnswer) as error:
        return isinstance(error, NoAnswer)  # it has stayed in STOPPED


NMT_COMMANDS = {name: NmtCommand(command) for command, name in COMMAND_NAMES.items()}

LEADS_TO = {"operational": "start", "stopped": "stop"}
"""NMT commands by the state that they lead to, where the names differ."""


def _command(text: str) -> NmtCommand:
    """Parse the name of an NMT command; raises LocalError."""
    if text in LEADS_TO:
        raise LocalError(f"{text!r} is a state; the NMT command is {LEADS_TO[text]}")
    return look_up("NMT command", text, NMT_COMMANDS)


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
        command = Key(converted(SCALAR, _command), "NMT command", needed=True)

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
    "dump": Dump.row,
    "boot-up": BootUp.row,
    "errors": SelfReported.row,
    "nmt": Nmt.row,
    "wait": Wait.row,
    "skip": Skip.row,
    "steps": lambda shapes: ActionRow(yaml_shapes.listing(shapes.step), Group),
}
"""The actions of this module by key."""
