"""Does the steps of a suite one after the other; a device package can add actions of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, NamedTuple, NoReturn

from eurobot_od.check.actions import LOOKS
from eurobot_od.check.actions.frames import Save, Send
from eurobot_od.check.actions.objects import SdoRead, SdoWrite
from eurobot_od.check.shapes import ActionRow, DocumentShapes, MakeRow
from eurobot_od.check.suite import NodeServices, StepAction
from eurobot_od.check.tester import BenchTester, Failed, NotPassed
from eurobot_od.check.values import ObjectValues, Operand
from eurobot_od.errors import EurobotError, LocalError, RemoteError, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.support import extras, texts, yaml_shapes


class StepRunner:
    """Does actions one after the other; a late answer to one is not taken for an answer to the next."""

    def __init__(self, tester: BenchTester) -> None:
        self._tester = tester
        self._unsettled = False

    async def do(self, action: StepAction) -> None:
        """Do one action.

        Raises Failed, LocalError or RemoteError if it is red, Skipped, and BusError if the bus failed.
        """
        tester = self._tester
        await asyncio.sleep(0)  # lets an interrupt in, also while a step is repeated
        if self._unsettled and isinstance(action, LOOKS):
            await tester.settle()
            self._unsettled = False
        try:
            await action.run(tester)
        except (Failed, LocalError, RemoteError):
            self._unsettled = True
            raise
        tester.is_asking = isinstance(action, Send) or (tester.is_asking and isinstance(action, Save))


# Actions of device packages


class SuiteAction(NamedTuple):
    """An action that a device package adds.

    `keys` is a dataclass or named tuple: its fields and their types are the keys of the action in a suite. `run` is
    called with StepTools and an instance of `keys`.
    """

    keys: type[Any]
    run: Callable[[Any, Any], Awaitable[None]]

    def entered_as(self, name: str) -> MakeRow:
        """Return the row of the action for the table of actions, where `name` is its key."""

        def row(_: DocumentShapes) -> ActionRow:
            return ActionRow(yaml_shapes.shape_of(self.keys), partial(OwnAction, name, self))

        return row


class OwnAction(NamedTuple):
    """An action that a device package has added."""

    name: str
    action: SuiteAction
    keys: Any

    def __str__(self) -> str:
        return self.name

    async def run(self, tester: BenchTester) -> None:
        """Run it with StepTools; an exception of the package's code becomes a LocalError."""
        tester.ask()
        try:
            await self.action.run(StepTools(tester), self.keys)
        except (EurobotError, NotPassed):
            raise
        except Exception as error:  # a bug in the package makes this step red; the other steps go on
            raise LocalError(extras.complaint(error, self.name, extras.is_foreign)) from None


class StepTools:
    """What an action of a device package can use: objects by SDO, frames, time. Each raises as other steps do.

    `node` is the name of a device; empty means the first one.
    """

    def __init__(self, tester: BenchTester) -> None:
        self._tester = tester

    def device(self, node: str = "") -> Dictionary:
        """Return the dictionary of a device; raises UnknownName."""
        named = {each.name: each for each in self._tester.decoder.dictionaries}
        return look_up("node", node, named) if node else next(iter(named.values()))

    async def read(self, name: str, node: str = "") -> Any:
        """Return the physical value of an object; raises as an `sdo` step does."""
        device = self.device(node)
        thing = objects.find_one(name, device.objects)
        await SdoRead(NodeServices.of(device), thing, save=name).run(self._tester)
        return objects.physical(thing, self._tester.variables[name])

    async def write(self, name: str, text: str, node: str = "") -> None:
        """Write a value, as a person writes it, to an object; raises as an `sdo` step does."""
        device = self.device(node)
        thing = objects.find_one(name, device.objects)
        operand = Operand(objects.parse(thing, text), None, ObjectValues(thing))
        await SdoWrite(NodeServices.of(device), thing, operand).run(self._tester)

    async def send(self, frame: Frame) -> None:
        """Send a frame."""
        await self._tester.put(frame)

    async def receive(self, cob_id: int, within: float = 1.0) -> bytes:
        """Return the data of the next frame with this COB-ID; raises Failed if none comes `within` this time, in s."""
        trace = self._tester.trace
        number = await trace.first(frozenset({cob_id}), self._tester.edge, trace.now + within)
        if number is None:
            raise Failed(f"no 0x{cob_id:03X} within {texts.text(within)}", f"0x{cob_id:03X}", "nothing")
        self._tester.use(number)
        return trace.frames[number].frame.data

    async def wait(self, seconds: float) -> None:
        """Wait for a time in s."""
        await self._tester.trace.sleep(seconds)

    def fail(self, what: str, expected: object = "", came: object = "") -> NoReturn:
        """Fail the step: it is red, with `what` as the reason."""
        raise Failed(what, str(expected), str(came))
