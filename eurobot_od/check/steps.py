"""Does the steps of a suite one after the other, and lets a device package add actions of its own."""

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
    """Does actions one after the other, so that no answer to one is taken for an answer to the next."""

    def __init__(self, tester: BenchTester) -> None:
        self._tester, self._unsettled = tester, False

    async def do(self, action: StepAction) -> None:
        """Do one action; raises Failed, LocalError or RemoteError if it is red, Skipped, BusError if the bus failed."""
        tester = self._tester
        await asyncio.sleep(0)  # an interrupt has its turn, whatever is repeated
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
    """An action that a device package adds: a class of its keys, and what it does with them.

    `keys` is a dataclass or named tuple; a suite's keys are its fields, of their types. `run` gets StepTools and the
    keys.
    """

    keys: type[Any]
    run: Callable[[Any, Any], Awaitable[None]]

    def entered_as(self, name: str) -> MakeRow:
        """Return the action as a suite names it by its key."""

        def row(_: DocumentShapes) -> ActionRow:
            return ActionRow(yaml_shapes.shape_of(self.keys), partial(OwnAction, name, self))

        return row


class OwnAction(NamedTuple):
    """Do what a device package has added."""

    name: str
    action: SuiteAction
    keys: Any

    def __str__(self) -> str:
        return self.name

    async def run(self, tester: BenchTester) -> None:
        """Do it with the tools for it."""
        tester.ask()
        try:
            await self.action.run(StepTools(tester), self.keys)
        except (EurobotError, NotPassed):
            raise
        except Exception as error:  # the package's mistake makes the step red, and the others go on
            raise LocalError(extras.complaint(error, self.name, extras.is_foreign)) from None


class StepTools:
    """What a step of a device package can do: objects by SDO, frames, time; it fails as other steps do.

    `node` is the name of a device; without one it is the first.
    """

    def __init__(self, tester: BenchTester) -> None:
        self._tester = tester

    def device(self, node: str = "") -> Dictionary:
        """Return the dictionary of a device; raises UnknownName."""
        named = {each.name: each for each in self._tester.decoder.dictionaries}
        return look_up("node", node, named) if node else next(iter(named.values()))

    async def read(self, name: str, node: str = "") -> Any:
        """Return the physical value of an object; raises as an `sdo` step."""
        device = self.device(node)
        thing = objects.find_one(name, device.objects)
        await SdoRead(NodeServices.of(device), thing, save=name).run(self._tester)
        return objects.physical(thing, self._tester.variables[name])

    async def write(self, name: str, text: str, node: str = "") -> None:
        """Write an object, the value as a person writes it; raises as an `sdo` step."""
        device = self.device(node)
        thing = objects.find_one(name, device.objects)
        operand = Operand(objects.parse(thing, text), None, ObjectValues(thing))
        await SdoWrite(NodeServices.of(device), thing, operand).run(self._tester)

    async def send(self, frame: Frame) -> None:
        """Send a frame."""
        await self._tester.put(frame)

    async def receive(self, cob_id: int, within: float = 1.0) -> bytes:
        """Return the data of the next frame with an identifier; raises Failed if none comes `within` so many s."""
        trace = self._tester.trace
        number = await trace.first(frozenset({cob_id}), self._tester.edge, trace.now + within)
        if number is None:
            raise Failed(f"no 0x{cob_id:03X} within {texts.text(within)}", f"0x{cob_id:03X}", "nothing")
        self._tester.use(number)
        return trace.frames[number].frame.data

    async def wait(self, seconds: float) -> None:
        """Let time pass."""
        await self._tester.trace.sleep(seconds)

    def fail(self, what: str, expected: object = "", came: object = "") -> NoReturn:
        """End the step red."""
        raise Failed(what, str(expected), str(came))
