"""Actions with a whole node by SDO: its boot-up, its errors, and all that it keeps."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import NamedTuple

from canopen.objectdictionary import ODVariable

from eurobot_od.check.actions.frames import Expect, Period
from eurobot_od.check.actions.objects import whole_upload
from eurobot_od.check.shapes import WITHIN, ActionRow, DocumentShapes
from eurobot_od.check.suite import Mismatch, NodeServices, Reported
from eurobot_od.check.tester import BenchTester, Failed, Gone, Skipped
from eurobot_od.device.broadcasts import HISTORY, REGISTER_BITS
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import NoAnswer
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import COMMANDS, ERROR_FIELD, ERROR_REGISTER, ERRORS
from eurobot_od.od.values import DOMAIN, ERROR_CONTROL_BASE, NOT_SCANNED, Address, PdoDirection, label
from eurobot_od.od.words import error_words
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support import texts, yaml_shapes
from eurobot_od.support.texts import amount
from eurobot_od.support.yaml_shapes import Key

BOOTED = bytes([NmtState.INITIALISING])
"""The data of a boot-up (CiA 301, 7.3.2.2.2)."""

ERROR_CONTROL = range(ERROR_CONTROL_BASE + 1, ERROR_CONTROL_BASE + 0x80)

POLLED = 0.1
"""Seconds for an answer to the question whether a node is there."""


class BootUp(NamedTuple):
    """Wait for the boot-up that ends a reset; without one ask by SDO, as long again, whether the node is there."""

    node: NodeServices
    within: float | None = None

    def __str__(self) -> str:
        return f"boot-up of {self.node.name}"

    async def run(self, tester: BenchTester) -> None:
        """Wait for a boot-up; raises Failed once for a node that sends none, Gone for one that does not come back."""
        missing = Reported.NO_BOOT_UP, self.node
        # One that sends none is waited for once, and reported once.
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
        """Wait for the boot-up since the last question; False if none comes in its time."""
        own, deadline = frozenset([ERROR_CONTROL_BASE + self.node.node_id]), tester.deadline(self.within)
        begun, start = tester.trace.now, tester.mark
        # What comes before it was under way when the node heard of the reset: heartbeats, answers to guarding.
        while (number := await tester.trace.first(own, start, deadline)) is not None:
            start = number + 1
            if tester.trace.frames[number].frame.data == BOOTED:
                tester.use(number)
                tester.came(tester.trace.frames[number].time - begun, tester.longest(self.within))
                return True
        return False

    def _no_boot_up(self, tester: BenchTester) -> str:
        """Say that no boot-up came, and whose came instead: a node may come back with another node-ID."""
        seen = (frame for _, frame, own in tester.trace.frames[tester.mark :] if not own and frame.data == BOOTED)
        others = sorted({frame.cob_id - ERROR_CONTROL_BASE for frame in seen if frame.cob_id in ERROR_CONTROL})
        instead = f" (node {', '.join(map(str, others))} booted instead)" if others else ""
        within = texts.text(tester.longest(self.within))
        return f"no boot-up {ERROR_CONTROL_BASE + self.node.node_id:03X}#00 in {within} after a reset{instead}"

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return how a suite names it."""
        awaited = Key(yaml_shapes.named({"awaited": True}, "boot-up"), "the boot-up is waited for", needed=True)
        services = shapes.services
        boot_up = services.service("when", awaited, lambda _, given: BootUp(services.of(given)))
        return ActionRow(boot_up, extra=WITHIN)


class Dump(NamedTuple):
    """Read many objects, and keep what they have, or see that it is what was kept.

    `process_data` are those that the device's own application writes: they are read, but not compared. So are those
    that change while nobody writes them.
    """

    node: NodeServices
    variables: tuple[ODVariable, ...]
    equal: bool
    process_data: frozenset[Address] = frozenset()

    def __str__(self) -> str:
        return f"dump of {amount(len(self.variables), 'object')}"

    async def run(self, tester: BenchTester) -> None:
        """Do it; raises as `suite.StepAction.run`."""
        if self.equal and not tester.dumped:
            raise Skipped("nothing was read before")
        tester.ask()
        dump = await self._values(tester)
        if not self.equal:
            again = await self._values(tester)
            sent = {objects.label(each) for each in self.variables if objects.address_of(each) in self.process_data}
            tester.dumped, tester.process_data = again, sent | {each for each in dump if dump[each] != again[each]}
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
        """Read the objects; one that is refused has the abort in place of its value."""
        dump = {}
        for variable in self.variables:
            try:
                read = partial(whole_upload, objects.address_of(variable), tester.timeout)
                data = await tester.asked(read, self.node)
                dump[objects.label(variable)] = data.hex(" ").upper()
            except sdo.Aborted as error:  # a dump is red only if something has changed, a refusal too
                dump[objects.label(variable)] = code_and_reason(error.code)
            except sdo.OddAnswer as error:
                dump[objects.label(variable)] = str(error)
        return dump

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return how a suite names it."""
        when = Key(yaml_shapes.named({"before": False, "equal": True}, "dump"), "before or equal", needed=True)

        def make(is_equal: bool, given: Dictionary | None) -> Dump:
            node = shapes.services.dictionary(given)
            # What keeps its value while nobody writes it: `ro` is measured, a DOMAIN a file of any size. Of the
            # history it is the number: what is left there is to be cleared by who left it.
            steady = (each for each in objects.all_objects(node.objects) if each.access_type in ("rw", "const"))
            kept = (each for each in steady if each.index not in COMMANDS or objects.address_of(each) == ERRORS)
            seen = (each for each in kept if not node.flags(objects.address_of(each)) & NOT_SCANNED)
            chosen = (each for each in seen if objects.data_type(each) is not DOMAIN)
            # What a TPDO carries out of the device, its own application writes.
            pdos = node.read_pdos(node.default, lambda _: None)
            sent = (entry.address for each in pdos if each.direction is PdoDirection.TPDO for entry in each.mapping)
            return Dump(NodeServices.of(node), tuple(chosen), is_equal, frozenset(sent))

        return ActionRow(shapes.services.service("when", when, make))


class SelfReported(NamedTuple):
    """See that a node reports no error itself: by its error register 0x1001, and its error history 0x1003."""

    node: NodeServices

    def __str__(self) -> str:
        return "no error"

    async def run(self, tester: BenchTester) -> None:
        """Read what errors the node has; raises NoAnswer, Failed with all of them in words, Skipped without 0x1001."""
        tester.ask()
        try:
            register = await tester.asked(partial(sdo.upload, ERROR_REGISTER, tester.timeout), self.node)
        except sdo.Aborted:
            raise Skipped("the node has no error register (0x1001)") from None
        bits = int.from_bytes(register, "little")
        if bits:
            words = [name for bit, name in enumerate(REGISTER_BITS) if bits >> bit & 1]
            with suppress(sdo.Aborted):  # no device has to remember its errors: 0x1003 is optional (CiA 301, 7.5.2.4)
                count = await tester.asked(partial(sdo.upload, ERRORS, tester.timeout), self.node)
                for sub in range(1, min(int.from_bytes(count, "little"), HISTORY) + 1):
                    read = partial(sdo.upload, (ERROR_FIELD, sub), tester.timeout)
                    remembered = await tester.asked(read, self.node)
                    # Its lower half is the error code, the upper half the maker's.
                    code = int.from_bytes(remembered[:2], "little")
                    words.append(f"0x{code:04X} {error_words(code, {})}")
            tester.reported.add((Reported.OWN_ERROR, self.node))
            raise Failed(f"{self.node.name} reports an error itself", "none", "; ".join(words))

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return how a suite names it."""
        none = Key(yaml_shapes.named({"none": True}, "errors"), "none are there", needed=True)
        services = shapes.services
        return ActionRow(services.service("wanted", none, lambda _, given: SelfReported(services.of(given))))


async def follows_from_own_error(tester: BenchTester, action: object) -> bool:
    """Return whether a node that does not send what is awaited has a known error, and was just told to be OPERATIONAL.

    By 0x1029 such a node may refuse that, or leave it again.
    """
    nodes = (each for _, each in tester.reported if isinstance(each, NodeServices))
    node = next((each for each in nodes if each.node_id == tester.started), None)
    is_known = node is not None and (Reported.OWN_ERROR, node) in tester.reported
    if node is None or not is_known or not isinstance(action, (Expect, Period)):
        return False
    try:
        return any(await tester.transfer(sdo.upload(ERROR_REGISTER, tester.timeout), node))
    except (sdo.Aborted, NoAnswer) as error:
        return isinstance(error, NoAnswer)  # it has stayed in STOPPED


ACTIONS = {"dump": Dump.row, "boot-up": BootUp.row, "errors": SelfReported.row}
"""The actions of this module by their keys."""
