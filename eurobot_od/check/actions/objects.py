"""Actions with one object by SDO: read, write, restore."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import yaml
from canopen.objectdictionary import ODVariable

from eurobot_od.check.shapes import ABORTS, NAME, TRANSFERS, WITHIN, ActionRow, DocumentShapes, MakeRow, pairs_at
from eurobot_od.check.suite import AbortCodes, Blocks, Mismatch, NodeServices
from eurobot_od.check.tester import BenchTester, Failed, Skipped
from eurobot_od.check.values import (
    Expected,
    ObjectValues,
    Operand,
    ValueProblem,
    Variables,
    expectation,
    unknown_variable,
)
from eurobot_od.errors import LocalError
from eurobot_od.od import objects, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ERRORS, SYNC_COUNTER, SYNC_PERIOD
from eurobot_od.od.values import COB_ID, DOMAIN, MAPPINGS, Address, label
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support import yaml_shapes
from eurobot_od.support.texts import amount
from eurobot_od.support.yaml_places import Problems, refuse, refusing, taken
from eurobot_od.support.yaml_shapes import SCALAR, TEXT, Key, Shape

NOT_WHILE_VALID = (COB_ID, values.INHIBIT_TIME, values.SYNC_START)
"""Parameters of a PDO that must not be changed while it is valid (CiA 301, 7.5.2.35 and 7.5.2.37)."""


class SdoRead(NamedTuple):
    """Read an object: its value is `expected`, or the node aborts with `abort`; `save` names a variable for the value.

    If the node aborts with one of the codes in `optional`, the step is skipped. `blocks` selects the transfer.
    """

    node: NodeServices
    variable: ODVariable
    expected: Expected | None = None
    abort: AbortCodes | None = None
    optional: AbortCodes | None = None
    blocks: Blocks = Blocks.NONE
    save: str | None = None
    within: float | None = None

    def __str__(self) -> str:
        return f"SDO read {objects.label(self.variable)}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        tester.ask()
        if self.save is not None:
            tester.variables.pop(self.save, None)  # another object may have set this variable
        begin = partial(whole_upload, self.variable, tester.longest(self.within), self.blocks)
        data = await _transferred(tester, self, begin)
        if data is None:
            return
        size = objects.data_type(self.variable).size
        # Size 0 is a type of any length. A wrong length is an error of its own: decoding would pad or cut the value.
        if size not in (0, len(data)):
            raise ValueProblem(f"{amount(len(data), 'byte')} came, the object has {size}")
        value = objects.decode(self.variable, data)
        if self.expected is not None and not self.expected.fits(value, tester.variables):
            tester.skip_if_taken(self.variable)
            label = objects.label(self.variable)
            wanted, came = self.expected.text(tester.variables), self.expected.shown(value)
            raise Failed(f"{label} is not as expected", wanted, came, (Mismatch(label, wanted, came),))
        if self.save is not None:
            tester.variables[self.save] = value
            tester.kept[self.save] = objects.address_of(self.variable)


class SdoWrite(NamedTuple):
    """Write an object; the node accepts the value, or aborts with `abort`. Other fields are as for SdoRead."""

    node: NodeServices
    variable: ODVariable
    value: Operand
    abort: AbortCodes | None = None
    optional: AbortCodes | None = None
    blocks: Blocks = Blocks.NONE
    within: float | None = None

    def content(self, variables: Variables) -> bytes:
        """Return the bytes to write; raises NotSaved, FieldError.

        The value of a variable may exceed the limits in the file: the node has to check it.
        """
        return objects.encode(objects.unlimited(self.variable), self.value.resolve(variables))

    def __str__(self) -> str:
        return f"SDO write {objects.label(self.variable)}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        tester.ask()
        begin = _DOWNLOADS[self.blocks]
        content = self.content(tester.variables)
        address = objects.address_of(self.variable)
        await _transferred(tester, self, partial(begin, address, content, tester.longest(self.within)))


class SdoRestore(NamedTuple):
    """Write the value of a variable back to its object, if it differs; for a PDO as CiA 301, 7.5.2.35, requires."""

    node: NodeServices
    variable: ODVariable
    saved: str
    within: float | None = None

    def content(self, variables: Variables) -> bytes:
        """Return the bytes of the kept value; raises FieldError."""
        value = variables[self.saved]
        return value if isinstance(value, bytes) else objects.encode(self.variable, value)

    def __str__(self) -> str:
        return f"SDO restore {objects.label(self.variable)}"

    async def run(self, tester: BenchTester) -> None:
        """Write back what differs; raises Failed if the node does not have the value afterwards."""
        # After an interrupt the variable may be unset, or hold another object's value.
        if self.saved not in tester.variables or tester.kept[self.saved] != objects.address_of(self.variable):
            raise Skipped("it was not read before, so nothing of it has been changed")
        tester.ask()
        address = objects.address_of(self.variable)
        content = self.content(tester.variables)
        tester.taken.discard(address)
        if await self._read(tester, address) == content:
            return
        if address == ERRORS and any(content):
            raise Skipped("errors can be cleared, but not brought back")  # (CiA 301, 7.5.2.4)
        before = list[tuple[Address, bytes]]()
        after = list[tuple[Address, bytes]]()
        refused = ""
        for other, change in _unlocking(address):
            old = await self._read(tester, other)
            new = change(int.from_bytes(old, "little")).to_bytes(len(old), "little")
            if new != old:
                before.append((other, new))
                if other != address:
                    after.append((other, old))
        for at, data in (*before, (address, content), *reversed(after)):
            try:
                await tester.asked(partial(sdo.download, at, data, tester.longest(self.within)), self.node)
            except sdo.Aborted as error:
                refused = f" ({label(at)}: {error})"
        now = await self._read(tester, address)
        if refused and address[0] in MAPPINGS and address[1] and not any(content):
            # The entry after the last one cannot be cleared: 0 is no object, and no clause allows it there.
            raise Skipped(f"an entry that maps nothing{refused}")
        if now != content:
            what = f"{objects.label(self.variable)} cannot be put back{refused}"
            raise Failed(what, content.hex(" ").upper(), now.hex(" ").upper() or "nothing")

    async def _read(self, tester: BenchTester, address: Address) -> bytes:
        """Read an object; return nothing if it is refused."""
        with suppress(sdo.Aborted):
            return await tester.asked(
                partial(sdo.upload, address, tester.longest(self.within), room=sdo.A_TEXT), self.node
            )
        return b""


SdoAction: TypeAlias = "SdoRead | SdoWrite | SdoRestore"


async def _transferred(
    tester: BenchTester, action: SdoRead | SdoWrite, begin: Callable[[], sdo.Transfer]
) -> bytes | None:
    """Do the transfer of a step; return None if the node refused as expected.

    Raises Failed, Skipped, NoAnswer, OddAnswer.
    """
    wanted = None if action.abort is None else str(action.abort)
    address = objects.address_of(action.variable)
    if action.abort is not None and not action.abort.codes:
        tester.skip_if_taken(action.variable)
    try:
        # A step with a time of its own is a limit, which an answer to a second request would hide.
        data = await tester.asked(begin, action.node, again=action.within is None)
    except sdo.Aborted as error:
        if action.abort is not None and action.abort.fits(error.code):
            return None
        came = f"abort {code_and_reason(error.code)}"
        if action.optional is not None and action.optional.fits(error.code):
            raise Skipped(f"{action}: the node does not do this ({came})") from None
        raise Failed(f"{action}: {error}", wanted or "no abort", came) from None
    if wanted is not None:
        tester.taken.add(address)
        raise Failed(f"{action}: the node does not refuse", wanted, "no abort")
    if isinstance(action, SdoWrite):
        tester.taken.discard(address)
    return data


_UPLOADS: Mapping[Blocks, Callable[..., sdo.Transfer]] = {
    Blocks.NONE: sdo.upload,
    Blocks.PLAIN: sdo.block_upload,
    Blocks.WITHOUT_CRC: partial(sdo.block_upload, crc=0),
}
_DOWNLOADS: Mapping[Blocks, Callable[[Address, bytes, float], sdo.Transfer]] = {
    Blocks.NONE: sdo.download,
    Blocks.PLAIN: sdo.block_download,
    Blocks.WITHOUT_CRC: partial(sdo.block_download, crc=0),
}


def whole_upload(variable: ODVariable, wait: float, blocks: Blocks = Blocks.NONE) -> sdo.Transfer:
    """Return a transfer that reads an object, with `wait` s for each answer and a bound for one without an end."""
    room = sdo.A_NUMBER if objects.data_type(variable).bits else sdo.A_TEXT
    return _UPLOADS[blocks](objects.address_of(variable), wait, room=room)


def _unlocking(address: Address) -> Iterator[tuple[Address, Callable[[int], int]]]:
    """Yield the objects that must have another value while an object is written, with the function for that value."""
    index, sub = address
    if index in MAPPINGS or (index in values.COMMUNICATIONS and sub in NOT_WHILE_VALID):
        record = index - values.MAPPING_OFFSET if index in MAPPINGS else index
        yield (record, COB_ID), lambda cob_id: cob_id | values.NOT_VALID
    if index in MAPPINGS and sub:
        yield (index, 0), lambda _: 0  # (CiA 301, 7.5.2.36)
    if address == SYNC_COUNTER:
        yield SYNC_PERIOD, lambda _: 0  # (CiA 301, 7.5.2.22)


# Reading


class SdoReader:
    """Reads `sdo` steps of one document."""

    def __init__(self, shapes: DocumentShapes) -> None:
        self._words, self._services = shapes.words, shapes.services
        transfer = {"data": Key(TEXT), "transfer": Key(yaml_shapes.named(TRANSFERS, "transfer"))}
        transfer |= dict.fromkeys(("abort", "optional"), Key(ABORTS))
        verbs = {
            "read": {"expect": Key(SCALAR), "save": Key(NAME), **transfer},
            "write": {"value": Key(SCALAR), **transfer},
            "restore": {"saved": Key(NAME, "the variable that keeps its value", needed=True)},
        }
        self._parts: dict[str, Shape[dict[str, Any]]] = {
            verb: yaml_shapes.record(dict, {verb: Key(SCALAR), **keys, "node": self._services.node_key})
            for verb, keys in verbs.items()
        }

    def read(self, node: yaml.Node, problems: Problems) -> SdoAction:
        """Read the step; raises ReadError after adding the problems."""
        verbs = {key for key, _ in pairs_at(node)} & self._parts.keys()
        if len(verbs) != 1:
            refuse(node, problems, "an SDO step has either 'read' or 'write' or 'restore'")
        (verb,) = verbs
        given = self._parts[verb].read(node, problems)
        with refusing(node, problems):
            _check_together(verb, given)
            dictionary = self._services.dictionary(given.get("node"))
            if verb == "restore" and given["saved"] not in self._words.saved:
                raise unknown_variable(given["saved"], sorted(self._words.saved))
        named = taken(given[verb], problems, lambda text: objects.find_one(text, dictionary.objects))
        value = next((given[key] for key in ("data", "expect", "value") if key in given), None)
        where = given[verb] if value is None else value
        variable = taken(where, problems, lambda _: _looked_at(named, given, dictionary))
        scale = self._words.scale(ObjectValues(variable))
        service = NodeServices.of(dictionary)
        refusals = {"abort": given.get("abort"), "optional": given.get("optional")}
        blocks: Blocks = given.get("transfer", Blocks.NONE)
        if verb == "restore":
            return SdoRestore(service, objects.unlimited(named), str(given["saved"]))
        if verb == "read":
            expected = None if value is None else taken(value, problems, lambda text: expectation(text, scale))
            return SdoRead(service, variable, expected, **refusals, blocks=blocks, save=given.get("save"))
        operand = taken(where, problems, scale.operand)
        return SdoWrite(service, variable, operand, **refusals, blocks=blocks)


def _looked_at(variable: ODVariable, given: Mapping[str, Any], dictionary: Dictionary) -> ODVariable:
    """Return an object as a step uses it; raises LocalError if the step has a value and no file describes its type."""
    # `data` is compared as bytes; so is an object that no file describes and the step only reads.
    if "data" in given or not ({"expect", "value"} & given.keys() or objects.is_described(variable)):
        return objects.changed(variable, data_type=DOMAIN.code)
    if not objects.is_described(variable):
        raise LocalError(f"{objects.label(variable)} is not in the EDS of {dictionary.name}; use 'data'")
    # A value to be refused may be any that the type can hold.
    return objects.unlimited(variable) if "abort" in given else variable


def _check_together(verb: str, given: Mapping[str, Any]) -> None:
    """Check that the keys of an SDO step go together; raises LocalError."""
    if verb == "write" and ("value" in given) == ("data" in given):
        raise LocalError("an SDO write has either 'value' or 'data'")
    if verb == "read" and "data" in given and "expect" in given:
        raise LocalError("an SDO read expects either a value or bytes: 'expect' or 'data'")
    if verb == "read" and "abort" in given and any(key in given for key in ("expect", "data", "save")):
        raise LocalError("an SDO read that is refused with 'abort' has nothing to expect or save")


ACTIONS: Mapping[str, MakeRow] = {"sdo": lambda shapes: ActionRow(Shape(SdoReader(shapes).read), extra=WITHIN)}
"""The actions of this module by key."""
