"""Configures a node from a DCF: writes the differences in the order of CiA 301, reads back, stores, verifies.

And the way back: all objects of a node are read, to list them, to compare them, or to make a DCF of the node as it is.
After an object that a node refuses, the next one is read; no answer ends the reading.

Rule of this file: a plan is made first, by reading alone; then either all of it is written, or what was written is
taken back. Nothing is stored before everything reads back as it should, so that a reset undoes whatever is left.
"""

from __future__ import annotations

from asyncio import CancelledError
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from enum import Enum
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from eurobot_od import errors
from eurobot_od.client.description import device_name, read_identity
from eurobot_od.client.master import STORE_WAIT, Procedure, RemoteNode
from eurobot_od.device.nmt import STATE_NAMES, NmtCommand, NmtState
from eurobot_od.device.objects import COMMUNICATION_PROFILE
from eurobot_od.od import dcf, objects, values
from eurobot_od.od.dcf import ChosenCobIds, Dcf, Write, renumbered, with_contents
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import COMMISSIONING
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import address_of, at, data_type, decode, encode, label, shown, unlimited
from eurobot_od.od.pdos import OnRefused, Pdo, fatal, unheard
from eurobot_od.od.standard import ALL_PARAMETERS, RESTORE, SIGNATURES, STORE, VERIFY_CONFIGURATION
from eurobot_od.od.values import COB_ID, MAPPING_OFFSET, Address, Value, pdo_of
from eurobot_od.od.words import written
from eurobot_od.sdo.client import LONGEST_TEXT
from eurobot_od.sdo.wire import EXPEDITED_SIZE, LARGEST, AbortCode
from eurobot_od.support.progress import Progress, reporting, unwatched
from eurobot_od.support.texts import amount

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

    from eurobot_od.lint.diff import EdsDifference

# The order of writes


Bytes: TypeAlias = Mapping[Address, bytes]
"""Contents of objects by address."""


def procedure_objects(addresses: Iterable[Address]) -> Iterator[Address]:
    """Yield the objects that writing a PDO's parameters needs: its COB-ID and number of mapping entries."""
    for address in addresses:
        pdo = pdo_of(address[0])
        if pdo is not None:
            yield pdo, COB_ID
            if address[0] != pdo:
                yield address[0], 0


def in_order(wanted: Bytes, present: Bytes) -> list[Write]:
    """Return the writes that change objects from their `present` bytes to the `wanted` ones, in order.

    Other objects come first. Then all PDOs that change become invalid, each mapping is emptied and gets its entries and
    their number, the rest of the communication records follows, and the PDOs become what is wanted (CiA 301, 7.5.2.36
    and 7.5.2.38). `wanted` or `present` must have the `procedure_objects`.
    """
    former, final = {**wanted, **present}, {**present, **wanted}
    pdos = sorted({pdo for address in wanted if (pdo := pdo_of(address[0])) is not None})
    others = (Write(address, data) for address, data in wanted.items() if pdo_of(address[0]) is None)
    entries = ((pdo, int.from_bytes(former[pdo, COB_ID], "little")) for pdo in pdos)
    invalid = (Write((pdo, COB_ID), (entry | values.NOT_VALID).to_bytes(4, "little")) for pdo, entry in entries)
    mapped = (write for pdo in pdos for write in _mapping(pdo + MAPPING_OFFSET, wanted, final))
    communication = (Write(a, data) for a, data in sorted(wanted.items()) if a[0] in pdos and a[1] > COB_ID)
    valid = (Write((pdo, COB_ID), final[pdo, COB_ID]) for pdo in pdos)
    needed = []
    state = dict(present)
    for write in (*others, *invalid, *mapped, *communication, *valid):
        if state.get(write.address) != write.data:
            needed.append(write)
        state[write.address] = write.data
    return needed


def _mapping(index: int, wanted: Bytes, final: Bytes) -> Iterator[Write]:
    """Yield the writes of one mapping record, without entries beyond the number of entries."""
    entries = sorted(address for address in wanted if address[0] == index)
    if not entries:
        return
    count = final[index, 0]
    yield Write((index, 0), b"\0")
    yield from (Write(address, wanted[address]) for address in entries if 1 <= address[1] <= count[0])
    yield Write((index, 0), count)


# A mapping


def mapping_entries(pdo: Pdo, things: Sequence[ODVariable]) -> list[int]:
    """Return the mapping entries of objects; raises LocalError for objects that the PDO cannot carry."""
    for thing in things:
        where = values.label(address_of(thing), thing.qualname)
        if not thing.pdo_mappable or not data_type(thing).bits:
            raise errors.LocalError(f"{where} cannot be mapped: its file says so")
        if thing.access_type not in values.MAPPABLE[pdo.direction]:
            raise errors.LocalError(f"{where} is {thing.access_type}, which a {pdo.direction.name} cannot carry")
    bits = sum(data_type(thing).bits for thing in things)
    if bits > values.MAX_BITS:
        raise errors.LocalError(f"{amount(bits, 'bit')} are mapped, a PDO has at most {values.MAX_BITS}")
    return [values.MappingEntry(*address_of(thing), data_type(thing).bits).number for thing in things]


@Procedure
async def map_objects(
    node: RemoteNode,
    dictionary: Dictionary,
    pdo: Pdo,
    things: Sequence[ODVariable] | None,
    settings: Mapping[int, int] = MappingProxyType({}),
) -> Bytes:
    """Map objects into a PDO of a node, in their order (None: leave the mapping alone), and read it all back.

    `settings` are further parameters of its communication record, by sub-index. Returns what was written. Raises
    LocalError for what cannot be mapped, ConfigurationError if the node then has something else, RemoteError for a
    write that it refuses (the PDO is then off), BusError.
    """
    cob_id: Address = (pdo.index, COB_ID)
    given = ((at((pdo.index, sub), dictionary.objects), value) for sub, value in settings.items())
    wanted = {address_of(thing): encode(thing, value) for thing, value in given}
    if things is not None:
        entries = mapping_entries(pdo, things)
        wanted[pdo.mapping_index, 0] = bytes([len(entries)])
        wanted |= {(pdo.mapping_index, sub): entry.to_bytes(4, "little") for sub, entry in enumerate(entries, start=1)}
    if cob_id not in wanted:
        # The node's present COB-ID, valid or not, is restored at the end.
        wanted[cob_id] = await node.upload.steps(cob_id)
    await _write(node, dictionary, in_order(wanted, {}), [])
    for address, data in wanted.items():
        found = await node.upload.steps(address, at(address, dictionary.objects).qualname)
        if found != data:
            what = f"{values.label(address)} is 0x{found[::-1].hex().upper()}, not 0x{data[::-1].hex().upper()}"
            raise errors.ConfigurationError(what)
    return wanted


COMMAND_TO: dict[NmtState | None, NmtCommand] = {
    NmtState.OPERATIONAL: NmtCommand.START,
    NmtState.PRE_OPERATIONAL: NmtCommand.ENTER_PRE_OPERATIONAL,
}
"""NMT command that restores a state."""


class ChangedObject(NamedTuple):
    """An object that differs: its bytes `before` in the node (None if unreadable) and `after` from the file."""

    thing: ODVariable
    before: bytes | None
    after: bytes

    @property
    def texts(self) -> tuple[str, str]:
        """Both values as text."""
        return "?" if self.before is None else shown(self.thing, self.before), shown(self.thing, self.after)


class DictionaryArea(Enum):
    """A part of an object dictionary (CiA 301, Table 39); PDO parameters are a part of their own."""

    COMMUNICATION = "communication"
    PDO = "pdo"
    MANUFACTURER = "manufacturer"
    PROFILE = "profile"


AREAS: Mapping[DictionaryArea, Container[int]] = {
    DictionaryArea.COMMUNICATION: frozenset(COMMUNICATION_PROFILE) - frozenset(values.PDO_PARAMETERS),
    DictionaryArea.PDO: values.PDO_PARAMETERS,
    DictionaryArea.MANUFACTURER: values.MANUFACTURER,
    DictionaryArea.PROFILE: range(values.MANUFACTURER.stop, 0x10000),
}
"""Indices of the objects in each area."""


class ChangePlan(NamedTuple):
    """Changes that a DCF makes to a node; `present` holds the PDO parameters needed to make them.

    `wanted` is all that the node has to have in the end; `whole` tells whether it covers the whole DCF.
    """

    dictionary: Dictionary
    changes: tuple[ChangedObject, ...]
    present: Bytes
    whole: bool = True
    wanted: tuple[tuple[ODVariable, bytes], ...] = ()

    @property
    def heading(self) -> str:
        """Line with the number of objects that differ."""
        file = Path(self.dictionary.file).name
        node_id = self.dictionary.node_id
        if not self.changes:
            return f"node {node_id} already is as {file} says"
        return f"node {node_id} differs from {file} in {amount(len(self.changes), 'object')}:"

    def writes(self) -> list[Write]:
        """Return all writes in their order."""
        return in_order({address_of(each.thing): each.after for each in self.changes}, self.present)

    def way_back(self, done: Iterable[Write]) -> list[Write]:
        """Return the writes that undo the `done` ones, for objects whose former bytes are known."""
        state = {**self.present, **{write.address: write.data for write in done}}
        touched = {_unit(write.address) for write in done}
        former = {**{address_of(c.thing): c.before for c in self.changes if c.before is not None}, **self.present}
        return in_order({address: data for address, data in former.items() if _unit(address) in touched}, state)

    @property
    def cannot_be_marked(self) -> bool:
        """Whether 0x1020, verify configuration, is read only in the file."""
        found = [self.dictionary.variable(address) for address in VERIFY_CONFIGURATION]
        return all(found) and not all(each and each.writable for each in found)

    def verification(self, now: datetime) -> list[Write]:
        """Return the writes of verify configuration, none if the device does not have it (CiA 301, 7.5.2.23)."""
        # A partial configuration must not be marked: a later start would take it for a complete one.
        is_there = all(self.dictionary.variable(address) for address in VERIFY_CONFIGURATION)
        if not self.whole or not is_there or self.cannot_be_marked:
            return []
        stamps = zip(VERIFY_CONFIGURATION, values.TimeOfDay.of(now))
        return [Write(address, number.to_bytes(4, "little")) for address, number in stamps]


class Configured(NamedTuple):
    """Result of a configuration: the number of changed objects, and whether the node stored them.

    `verified` tells whether the node still had them after a reset.
    """

    changed: int
    stored: bool
    verified: bool = False

    def text(self, node_id: int, was_to_store: bool = True) -> str:
        """Return the result as text; `was_to_store` is whether the node was asked to store."""
        kept = "stored, verified after a reset" if self.verified else "stored"
        if not self.stored:
            kept = "not stored: the node has no 0x1010" if was_to_store else "not stored"
        return f"node {node_id} configured: {amount(self.changed, 'object')} written and read back, {kept}"


@Procedure
async def configure(
    node: RemoteNode, dictionary: Dictionary, now: datetime, chosen: ChosenCobIds | None = None
) -> Configured:
    """Configure a node from a DCF; `now` goes to verify configuration 0x1020, `chosen` is as in `difference`.

    Raises DictionaryError for the file, before anything is written; ConfigurationError if the node did not take all of
    it, with the state it is left in; RemoteError and BusError before anything is written.
    """
    plan = await difference.steps(node, dictionary, chosen=chosen)
    return await apply.steps(node, plan, now) if plan.changes else Configured(0, False)


# The file


def settings(dictionary: Dictionary) -> list[tuple[ODVariable, bytes]]:
    """Return the writable objects for which a DCF has a value, with their bytes.

    Left out are process data and the entries of a mapping beyond its number of entries. Raises DictionaryError for a
    value that its object's type cannot have, and for a file beside the DCF that cannot be read; see `check_limits`.
    """
    found = []
    for thing in objects.all_objects(dictionary.objects):
        index, subindex = address_of(thing)
        # Entries beyond the number of entries are left over from another mapping.
        count = dictionary.default((index, 0)) if pdo_of(index) not in (None, index) else None
        if (index, subindex) in dictionary.parameters and not (isinstance(count, int) and subindex > count):
            data = _configured(dictionary, thing)
            # An object without a value in the DCF keeps the one in the device.
            if data is not None:
                found.append((thing, data))
    return found


def _configured(dictionary: Dictionary, thing: ODVariable) -> bytes | None:
    """Return the bytes that a DCF has for an object, None without a value. Raises DictionaryError."""
    if not data_type(thing).size:
        return dcf.content(dictionary, address_of(thing))
    return _encoded(dictionary, thing, unlimited(thing)) if objects.value_text(thing) else None


def check_limits(dictionary: Dictionary, things: Iterable[ODVariable]) -> None:
    """Check that values other than defaults are within the limits of their objects; raises DictionaryError."""
    for thing in things:
        if data_type(thing).size and thing.value != thing.default:
            _encoded(dictionary, thing, thing)


def _encoded(dictionary: Dictionary, thing: ODVariable, rule: ODVariable) -> bytes:
    try:
        return encode(rule, thing.value)
    except errors.FieldError as error:
        given = f"sub {thing.subindex} ({thing.qualname}): {objects.value_text(thing)}"
        what = f"{given} is not allowed; allowed: {error.allowed}"
        raise errors.DictionaryError(dictionary.file, thing.index, what) from None


def all_writes(dictionary: Dictionary) -> list[Write]:
    """Return the writes, in order, that configure a device whose present values are unknown.

    Raises as `settings` and `check_limits`.
    """
    found = settings(dictionary)
    check_limits(dictionary, (thing for thing, _ in found))
    wanted = {address_of(thing): data for thing, data in found}
    # A mapping can be changed only while its PDO is invalid (CiA 301, 7.5.2.36), so the COB-ID is needed even if the
    # DCF does not set it.
    for address in set(procedure_objects(wanted)) - set(wanted):
        wanted[address] = encode(unlimited(at(address, dictionary.objects)), dictionary.default(address))
    return in_order(wanted, {})


def check_whole(dictionary: Dictionary, refused: OnRefused = fatal, by_default: OnRefused = unheard) -> None:
    """Check that a DCF is complete; raises DictionaryError.

    `refused` gets the PDOs whose mappings are wrong, `by_default` those that are wrong in the device's own EDS already.
    """
    absent = dcf.missing(dictionary.document)
    if absent:
        raise errors.DictionaryError(dictionary.file, None, f"incomplete: no section [{absent[0]}]")
    stock = set[str]()
    dictionary.read_pdos(dictionary.stock_value, lambda error: stock.add(str(error)))
    dictionary.read_pdos(dictionary.default, lambda error: by_default(error) if str(error) in stock else refused(error))


def check_file(
    dictionary: Dictionary, node_id: int, refused: OnRefused = fatal, by_default: OnRefused = unheard
) -> None:
    """Check that a DCF is complete and for this node-ID, as `check_whole` does; raises DictionaryError."""
    intended = dictionary.device.commissioned_node_id
    # Without a node-ID in [DeviceComissioning] (CiA 306), COB-IDs that depend on it are unknown.
    if intended is None:
        what = f"incomplete: no NodeID in [{COMMISSIONING}]; a DCF has one, such as `dump -o` writes"
        raise errors.DictionaryError(dictionary.file, None, what)
    if intended != node_id:
        raise errors.DictionaryError(dictionary.file, None, f"is for node {intended}, not for node {node_id}")
    check_whole(dictionary, refused, by_default)


# The difference


@Procedure
async def difference(
    node: RemoteNode,
    dictionary: Dictionary,
    areas: Collection[DictionaryArea] = tuple(DictionaryArea),
    chosen: ChosenCobIds | None = None,
    progress: Progress = unwatched,
) -> ChangePlan:
    """Compare a node with a DCF, or with some areas of it, by reading alone; `progress` counts its objects.

    The DCF may be that of another node of the same kind: what follows the node-ID is that of this node, and `chosen`
    says what becomes of COB-IDs that do not. Raises DictionaryError for a file that is damaged, for another device,
    with objects that the node does not have, or with such COB-IDs if `chosen` is None; RemoteError and BusError.
    """
    dictionary = renumbered(dictionary, node.node_id, chosen)
    check_file(dictionary, node.node_id)
    # First of all, as another device may use the same objects for other purposes.
    other = Identity.of(dictionary).difference(await read_identity.steps(node))
    if other is not None:
        raise errors.DictionaryError(dictionary.file, None, f"is for another device: node {node.node_id} has {other}")
    wanted = [each for each in settings(dictionary) if any(each[0].index in AREAS[one] for one in areas)]
    present = dict[Address, bytes | None]()
    for thing, _ in reporting(wanted, progress):
        present[address_of(thing)] = await _present(node, dictionary, thing)
    read = ((thing, present[address_of(thing)], data) for thing, data in wanted)
    changes = tuple(ChangedObject(*each) for each in read if each[1] != each[2])
    check_limits(dictionary, (each.thing for each in changes))  # unchanged objects are not written
    _check_own_node_id(node, dictionary, changes)
    needed = procedure_objects(address_of(each.thing) for each in changes)
    known = {address: present.get(address) or await node.upload.steps(address) for address in needed}
    return ChangePlan(dictionary, changes, known, set(areas) == set(DictionaryArea), tuple(wanted))


def _check_own_node_id(node: RemoteNode, dictionary: Dictionary, changes: Iterable[ChangedObject]) -> None:
    """Check that no change sets a node-ID other than the file's; raises DictionaryError.

    A maker's object may have the same name and another meaning: it counts only if it has the node's own number.
    """
    for thing, before, after in changes:
        is_own = before is not None and int.from_bytes(before, "little") == node.node_id
        if is_own and address_of(thing) == dictionary.device.node_id_address:
            what = f"{thing.qualname} {shown(thing, after)} is not the NodeID {node.node_id} of [{COMMISSIONING}]"
            raise errors.DictionaryError(dictionary.file, thing.index, what)


@Procedure
async def read_object(node: RemoteNode, thing: ODVariable) -> bytes:
    """Read an object, truncated to the size of its type, as some devices always send 4 bytes."""
    # A DOMAIN may be large: a segmented transfer of 1 MB takes 150 000 requests.
    if data_type(thing) == values.DOMAIN and objects.is_described(thing):
        return await node.upload_block.steps(address_of(thing), thing.qualname)
    size = data_type(thing).size or None
    most = max(size, EXPEDITED_SIZE) if size else LARGEST
    return (await node.upload.steps(address_of(thing), thing.qualname, most=most, unannounced=LONGEST_TEXT))[:size]


@Procedure
async def write_value(node: RemoteNode, thing: ODVariable, value: Value) -> str:
    """Write a value and return its text; without an EDS, the object's length is read first.

    Raises FieldError for a value that its file does not allow, and as `RemoteNode.download`.
    """
    # A device refuses other lengths (0607 0010), and without an EDS only a read tells the length.
    size = 0 if objects.is_described(thing) else len(await node.upload.steps(address_of(thing)))
    await node.download.steps(address_of(thing), encode(thing, value, size), thing.qualname)
    return written(thing, value)


async def _present(node: RemoteNode, dictionary: Dictionary, thing: ODVariable) -> bytes | None:
    """Read an object of a DCF; return None if it is write-only or has no value yet. Raises as `difference`."""
    try:
        return await read_object.steps(node, thing)
    except errors.NodeRefused as error:
        if error.code in (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX):
            what = f"sub {thing.subindex} ({thing.qualname}): node {node.node_id} has no such object"
            raise errors.DictionaryError(dictionary.file, thing.index, what) from error
        if error.code in (AbortCode.WRITE_ONLY, AbortCode.NO_DATA):
            return None
        raise


def _unit(address: Address) -> Address:
    """Return the address of the unit that changes together: a PDO's communication record, or the object itself."""
    pdo = pdo_of(address[0])
    # A mapping without its COB-ID, or the reverse, makes an unintended PDO.
    return address if pdo is None else (pdo, 0)


# The change


@Procedure
async def apply(
    node: RemoteNode, plan: ChangePlan, now: datetime, *, stores: bool = True, resets: bool = True
) -> Configured:
    """Carry out a plan: enter pre-operational, write, read back, mark, store, reset, verify.

    Verify configuration is only for a whole DCF, and the reset only for a node that has stored. Raises
    ConfigurationError or BusError, which name the state of the node.
    """
    former = node.last_state
    mark = plan.verification(now)
    done: list[Write] = []
    try:
        # An OPERATIONAL node would send partly remapped PDOs, and some nodes refuse remapping then.
        node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        await _write(node, plan.dictionary, plan.writes(), done)
        await read_back.steps(node, plan.dictionary, ((each.thing, each.after) for each in plan.changes))
        # The mark comes last, as any change of configuration clears it, but before storing.
        await _write(node, plan.dictionary, mark, [])
        # 0x1010 is optional (CiA 301, 7.5.2.13); a device without it loses its values at the next reset.
        stored = stores and plan.dictionary.variable((STORE, ALL_PARAMETERS)) is not None
        if stored:
            await store.steps(node)
    except (errors.EurobotError, KeyboardInterrupt, CancelledError) as error:
        failed = await _take_back(error, node, plan, done, former)
        if isinstance(error, CancelledError):  # an event loop has to see that its task was cancelled
            raise
        raise failed from error
    if stored and resets:
        await _reset(node, plan)
    else:
        node.command(COMMAND_TO.get(former, NmtCommand.START))
    return Configured(len(plan.changes), stored, stored and resets)


@Procedure
async def read_back(node: RemoteNode, dictionary: Dictionary, wanted: Iterable[tuple[ODVariable, bytes]]) -> None:
    """Check that objects of a node have the wanted bytes; raises ConfigurationError."""
    for thing, after in wanted:
        # For a write-only object, the confirmation of the write is the only evidence.
        if not thing.readable:
            continue
        found = await _present(node, dictionary, thing)
        if found != after:
            reads, wrote = ChangedObject(thing, found, after).texts
            what = f"node {node.node_id}: {label(thing)} reads {reads} after {wrote} was written"
            raise errors.ConfigurationError(what)


@Procedure
async def store(node: RemoteNode) -> None:
    """Make a node store its parameters so that they survive a reset; raises as `RemoteNode.download`."""
    await node.download.steps((STORE, ALL_PARAMETERS), SIGNATURES[STORE], "Save all parameters", STORE_WAIT)


@Procedure
async def restore_and_reset(node: RemoteNode, restored: int | None = None) -> None:
    """Make a node restore its defaults, and reset it; `restored` is its node-ID after that, None for the same."""
    await restore.steps(node)
    if restored in (None, *values.NODE_IDS):
        await node.reset.steps(booting_as=restored)
    else:  # a node without a node-ID sends no boot-up
        node.command(NmtCommand.RESET_NODE)


@Procedure
async def restore(node: RemoteNode) -> None:
    """Make a node restore its defaults at its next reset; raises as `store`."""
    address = (RESTORE, ALL_PARAMETERS)
    name = "Restore all default parameters"
    await node.download.steps(address, SIGNATURES[RESTORE], name, STORE_WAIT)


async def _write(node: RemoteNode, dictionary: Dictionary, writes: Iterable[Write], done: list[Write]) -> None:
    """Write, and add to `done` each write that the node may have accepted."""
    for write in writes:
        done.append(write)
        try:
            await node.download.steps(write.address, write.data, at(write.address, dictionary.objects).qualname)
        except errors.NodeRefused:
            done.pop()
            raise


async def _reset(node: RemoteNode, plan: ChangePlan) -> None:
    """Reset a node that has stored its parameters, and check that they are still there."""
    try:
        await node.reset.steps()
        await read_back.steps(node, plan.dictionary, plan.wanted)
    except errors.EurobotError as error:
        what = f"node {node.node_id} was written completely, stored and reset before that"
        raise _failure(error, what, [label(each.thing) for each in plan.changes]) from error


# The way back


async def _take_back(
    error: BaseException, node: RemoteNode, plan: ChangePlan, done: list[Write], former: NmtState | None
) -> errors.EurobotError:
    """Restore the former values of a node; return the error with its cause and the state of the node."""
    names = [label(each.thing) for each in plan.changes]
    try:
        await _write(node, plan.dictionary, plan.way_back(done), [])
        # A STOPPED node would not answer SDO, which is needed to find the cause.
        state = former if former is NmtState.OPERATIONAL else NmtState.PRE_OPERATIONAL
        node.command(COMMAND_TO[state])
    except errors.EurobotError:
        units = {_unit(write.address) for write in done}
        is_new = {label(each.thing): _unit(address_of(each.thing)) in units for each in plan.changes}
        new, old = ([name for name in names if is_new[name] is which] for which in (True, False))
        what = (
            f"node {node.node_id} is pre-operational; written and not stored: {', '.join(new) or 'nothing'}; "
            f"not written: {', '.join(old) or 'nothing'}; "
            f"a reset brings the former values back (`nmt {node.node_id} reset`)"
        )
        return _failure(error, what, new, old)
    return _failure(error, f"node {node.node_id} has its former values again and is {STATE_NAMES[state]}", (), names)


def _failure(
    error: BaseException, state: str, written: Iterable[str] = (), left: Iterable[str] = ()
) -> errors.EurobotError:
    text = f"{str(error) or 'interrupted'}; {state}"
    is_bus = isinstance(error, errors.BusError)
    return errors.BusError(text) if is_bus else errors.ConfigurationError(text, written, left)


# A node read whole


class ObjectReading(NamedTuple):
    """An object of a node with its `value`, or the text of the `refusal`."""

    thing: ODVariable
    value: Value = None
    refusal: str = ""


def read_all(node: RemoteNode, things: Iterable[ODVariable]) -> Iterator[ObjectReading]:
    """Read objects one after the other. Raises NoAnswer, RemoteError, BusError."""
    for thing in things:
        try:
            yield ObjectReading(thing, decode(thing, read_object(node, thing)))
        except errors.NodeRefused as error:
            yield ObjectReading(thing, refusal=error.reason)


@Procedure
async def read_bytes(node: RemoteNode, addresses: Iterable[Address]) -> dict[Address, bytes | int]:
    """Read objects as bytes; a refused one has its abort code as its value. Raises as `read_all`.

    Once the node has said that an index does not exist, its other sub-indices are not asked for.
    """
    found: dict[Address, bytes | int] = {}
    missing: set[int] = set()
    for address in addresses:
        try:
            found[address] = AbortCode.NO_OBJECT if address[0] in missing else await node.upload.steps(address)
        except errors.NodeRefused as error:
            found[address] = error.code
            missing |= {address[0]} if error.code == AbortCode.NO_OBJECT else set()
    return found


def differences(node: RemoteNode, dictionary: Dictionary, progress: Progress = unwatched) -> list[EdsDifference]:
    """Compare a node with the defaults of its EDS or the values of its DCF; raises NoAnswer, BusError.

    `progress` counts the objects that are read.
    """
    from eurobot_od.lint import diff, model  # a node is configured without

    device = model.load(dictionary.content, dictionary.file.name)
    answers = read_bytes(node, reporting(diff.readable(device), progress))
    return diff.compare_live(
        device, answers, node.node_id, dictionary.configured(pdo_numbers(answers)).parameters.process_data
    )


@Procedure
async def pdo_parameters(node: RemoteNode, dictionary: Dictionary) -> dict[Address, Value]:
    """Read the PDO parameters of a node as numbers, without the refused ones.

    Raises NoAnswer, RemoteError, BusError.
    """
    records = (each for each in dictionary.addresses() if pdo_of(each[0]) is not None)
    return pdo_numbers(await read_bytes.steps(node, records))


PDO_RECORDS = tuple(chain.from_iterable(values.COMMUNICATION_RECORDS.values()))
"""Indices of all communication records."""


@Procedure
async def all_pdo_parameters(node: RemoteNode, records: Iterable[int] = PDO_RECORDS) -> dict[Address, Value]:
    """Read the PDO parameters of a node without a file, at their standard indices.

    Raises as `pdo_parameters`.
    """
    found: dict[Address, bytes | int] = {}
    for index in records:
        found |= await read_bytes.steps(node, ((index, sub) for sub in range(COB_ID, values.EVENT_TIMER + 1)))
        if found[index, COB_ID] == AbortCode.NO_OBJECT:  # devices leave gaps, so the next one may be there
            continue
        mapping = index + MAPPING_OFFSET
        found |= await read_bytes.steps(node, [(mapping, 0)])
        count = pdo_numbers(found).get((mapping, 0), 0)
        if isinstance(count, int) and count <= values.MAX_BITS:  # in a multiplexed PDO it has another meaning
            found |= await read_bytes.steps(node, ((mapping, sub) for sub in range(1, count + 1)))
    return pdo_numbers(found)


def pdo_numbers(found: Mapping[Address, bytes | int]) -> dict[Address, Value]:
    """Return the PDO parameters among the results of `read_bytes`, as numbers."""
    records = ((address, data) for address, data in found.items() if pdo_of(address[0]) is not None)
    return {address: int.from_bytes(data, "little") for address, data in records if isinstance(data, bytes)}


def readable(dictionary: Dictionary) -> Iterator[ODVariable]:
    """Yield the objects that can be read, except for files (DOMAIN)."""
    return (
        each for each in objects.all_objects(dictionary.objects) if each.readable and data_type(each) != values.DOMAIN
    )


def parameters(dictionary: Dictionary) -> Iterator[ODVariable]:
    """Return the configuration objects of a node: readable and writable ones that are not process data.

    For the mapping that a node has now, `dictionary` is the file's, `configured` with the node's PDO parameters.
    """
    things = objects.all_objects(dictionary.objects)
    return (each for each in things if each.readable and address_of(each) in dictionary.parameters)


def process_data(dictionary: Dictionary) -> list[ODVariable]:
    """Return the readable and writable objects that are process data."""
    things = (each for each in objects.all_objects(dictionary.objects) if each.readable and each.writable)
    return [each for each in things if address_of(each) in dictionary.parameters.process_data]


def decoded(writes: Iterable[tuple[Address, bytes]], dictionary: Dictionary | None) -> Iterator[ObjectReading]:
    """Yield objects with decoded values."""
    for address, data in writes:
        thing = at(address, dictionary.objects if dictionary else None)
        yield ObjectReading(thing, decode(thing, data))


class DcfOfNode(NamedTuple):
    """The DCF of a node; the parameters that are `left_out`, with reasons; and its process data."""

    dcf: Dcf
    left_out: list[ObjectReading]
    process_data: list[ODVariable]


def dcf_of_node(
    node: RemoteNode, dictionary: Dictionary, baudrate_kbit: int, stem: str, progress: Progress = unwatched
) -> DcfOfNode:
    """Return the DCF of a node as it is now.

    Left out are parameters that the node refuses to give, or gives with fewer bytes than their type has.

    Args:
        node: the node, which is read.
        dictionary: its EDS.
        baudrate_kbit: bit rate for the DCF, in kbit/s.
        stem: beginning of the names of the files beside the DCF.
        progress: called with the number of parameters that were read, and of all.
    """
    contents = dict[Address, bytes]()
    left_out = list[ObjectReading]()
    present = dictionary.configured(pdo_parameters(node, dictionary))
    for thing in reporting(list(parameters(present)), progress):
        try:
            data = read_object(node, thing)
        except errors.NodeRefused as error:
            left_out.append(ObjectReading(thing, refusal=error.reason))
            continue
        if len(data) < data_type(thing).size:
            what = f"{amount(len(data), 'byte')}, too few for {data_type(thing).name}"
            left_out.append(ObjectReading(thing, refusal=what))
        else:
            contents[address_of(thing)] = data
    dcf = with_contents(dictionary, contents, node.node_id, device_name(node), baudrate_kbit, stem)
    return DcfOfNode(dcf, left_out, process_data(present))
