"""A node of a network: its objects by name, NMT state, emergency messages, PDOs, configuration, program.

Objects are read and written by name, with their types, limits, units and words:

    drive["Profile velocity"].value = 1500        # FieldError outside the limits, before anything is sent
    drive["Profile velocity"].value = "1500 rpm"  # as a person writes it, if the file has the unit
    drive["Motion"]["Maximum speed"].value        # or drive["Motion.Maximum speed"], drive[0x2101, 1]

`bytes` are what the SDO carries, `raw` is the number in them, and `value` is what the number means: `raw` times the
Factor of the object, if the file gives one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from functools import partial
from io import StringIO
from numbers import Real
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, NoReturn, Self, TypeAlias, TypeGuard, overload

import canopen
from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.variable import Bits

from eurobot_od.canopen_names import NamedAsInCanopen, opened
from eurobot_od.client import configure, program, streams
from eurobot_od.client.configure import ChangePlan, Configured, read_object
from eurobot_od.client.description import read_identity
from eurobot_od.client.drive402 import AsyncDrive402, Drive402
from eurobot_od.client.master import (
    CLOSED,
    Master,
    PeriodicTask,
    RemoteNode,
    blocking,
    finished,
    function_of,
    seconds,
)
from eurobot_od.client.program import Loaded
from eurobot_od.client.remote_pdo import BlockingPdoStream, PdosOfDirection, RemotePdos
from eurobot_od.device.nmt import TARGET, TOGGLE, NmtCommand, NmtState, canopen_state, command_to
from eurobot_od.errors import DictionaryError, HeartbeatLost, LocalError, StateError, UnknownName, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dcf import ChosenCobIds
from eurobot_od.od.dictionary import NO_NODE_ID, Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import address_of, all_objects, at, data_type, decode, encode, label
from eurobot_od.od.standard import EMCY
from eurobot_od.od.units import scale_of
from eurobot_od.od.values import EMCY_BASE, ERROR_CONTROL_BASE, Address, Scalar, Value, check_node_id, pdo_of, typed
from eurobot_od.od.words import written
from eurobot_od.support.progress import Progress, unwatched

CobIdChoice: TypeAlias = Literal["keep", "move"] | None
"""Treatment of COB-IDs in another node's DCF that do not depend on the node-ID; None refuses them."""

# Objects


ObjectKey: TypeAlias = "str | int | Address | ObjectAtNode"
"""An object's name, a number as a person writes it, an index, an index and sub-index, or an object."""

INDICES, SUBINDICES = range(0x10000), range(0x100)
NUMBERS = ("a name", "an index 0..0xFFFF", "(index, sub-index 0..0xFF)")
"""What an object is known by, for errors."""

Content: TypeAlias = bytes
"""Alias of `bytes`, as a property hides that name in the class."""

Wrote: TypeAlias = Callable[["ODVariable", bytes], object]


class ObjectAtNode(NamedAsInCanopen, streams.Keyed):
    """The common part of the objects of both kinds of networks; nothing in here talks to the node."""

    __slots__ = ("_node", "_variables", "_wrote")  # so that a typo (`object.valu = 5`) is an error

    def __init__(self, node: RemoteNode, variables: Sequence[ODVariable], wrote: Wrote) -> None:
        self._node, self._variables, self._wrote = node, variables, wrote

    @property
    def od(self) -> ODVariable:
        """Canopen's variable; raises LocalError for a record."""
        if len(self._variables) != 1:
            names = ", ".join(map(label, self._variables))
            raise LocalError(f"0x{self._variables[0].index:04X} is not one object but a record of {names}")
        return self._variables[0]

    @property
    def address(self) -> Address:
        """Index and sub-index."""
        return address_of(self.od)

    @property
    def name(self) -> str:
        """The ParameterName in the file, `Record.Member`; empty without a file."""
        return str(self.od.qualname)

    @property
    def unit(self) -> str:
        """Unit from the file, its maker or CiA 402; empty without one."""
        return scale_of(self.od).unit

    @property
    def limits(self) -> objects.Range | None:
        """Lowest and highest `raw` value by limits and type; None for types other than numbers."""
        return objects.limits(self.od)

    @property
    def words(self) -> dict[int, str]:
        """Names of values: canopen's `value_descriptions`."""
        words: dict[int, str] = self.od.value_descriptions
        return words

    def __str__(self) -> str:
        return ", ".join(map(label, self._variables))

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self} of node {self._node.node_id}>"

    def __getitem__(self, key: str | int | ObjectAtNode) -> Self:
        """Return a member of a record by its name or sub-index; raises UnknownName."""
        if isinstance(key, ObjectAtNode):
            key = key.od.subindex
        found = [each for each in self._variables if key in (each.subindex, each.name)]
        if not found:
            raise UnknownName(f"member of 0x{self._variables[0].index:04X}", key, [v.name for v in self._variables])
        return type(self)(self._node, found, self._wrote)

    def __iter__(self) -> Iterator[Self]:
        """Yield the members of a record without sub-index 0, which is their number."""
        return (type(self)(self._node, [each], self._wrote) for each in self._members)

    def __len__(self) -> int:
        return len(self._members)

    def _items(self) -> list[str]:
        return [each.name for each in self._variables] if len(self._variables) > 1 else []

    @property
    def _members(self) -> Sequence[ODVariable]:
        return [each for each in self._variables if each.subindex] or self._variables

    def _typed(self, data: bytes, kind: Any) -> Any:
        value = objects.physical(self.od, decode(self.od, data))
        return value if kind is None else typed(value, kind, str(self))

    def _bytes_of(self, value: Any) -> bytes:
        """Encode a value given by a program; raises FieldError."""
        thing = self.od
        if isinstance(value, bytes):
            return value
        if not objects.is_described(thing):
            raise objects.not_allowed(thing, value, "bytes: no file says its type")
        if isinstance(value, str):
            return encode(thing, objects.parse(thing, value))
        scale = scale_of(thing)
        if isinstance(value, Real) and not isinstance(value, bool) and not scale.is_raw:
            value = scale.raw(float(value))
            value = round(value) if data_type(thing).is_integer else value
        return encode(thing, value)

    def text_of(self, raw: Value) -> str:
        """Return a raw value as text, with its name or its unit."""
        if isinstance(raw, int) and raw in self.words:
            return self.words[raw]
        return written(self.od, raw)

    async def _read(self) -> bytes:
        return await read_object.steps(self._node, self.od)

    async def _read_block(self, progress: Progress) -> bytes:
        return await self._node.upload_block.steps(self.address, self.name, progress)

    async def _write(self, data: bytes, progress: Progress = unwatched) -> None:
        await self._node.download.steps(self.address, data, self.name, progress=progress)
        self._wrote(self.od, data)


class RemoteObject(ObjectAtNode):
    """An object of a node of a `Network`, or a record of them.

    Every read and write is an SDO transfer, and raises NodeRefused (the node aborts, with the reason in words),
    NoAnswer, WrongAnswer, BusError. Writing also raises FieldError for a value that type or limits do not allow, before
    anything is sent. Errors name node and object.
    """

    __slots__ = ()

    @overload
    def read(self) -> Any: ...

    @overload
    def read(self, kind: type[Scalar]) -> Scalar: ...

    def read(self, kind: Any = None) -> Any:
        """Return `value`, as a Python type if one is given: `read(int)` raises LocalError for anything else."""
        return self._typed(finished(self._read()), kind)

    def write(self, value: Any) -> None:
        """Write a value; see `value`."""
        finished(self._write(self._bytes_of(value)))

    @property
    def value(self) -> Any:
        """The value of the object's type: int, float, str or bytes; in the file's unit if it has a Factor."""
        return self.read()

    @value.setter
    def value(self, value: Any) -> None:
        self.write(value)

    @property
    def raw(self) -> Any:
        """The value without the Factor."""
        return decode(self.od, finished(self._read()))

    @raw.setter
    def raw(self, value: Value) -> None:
        finished(self._write(encode(self.od, value)))

    @property
    def bytes(self) -> Content:
        """The bytes of the SDO; what is written is not checked."""
        return finished(self._read())

    @bytes.setter
    def bytes(self, data: Content) -> None:
        finished(self._write(data))

    @property
    def text(self) -> str:
        """Value as text: `1500 rpm`, or its name."""
        return self.text_of(self.raw)

    def read_block(self, progress: Progress = unwatched) -> Content:
        """Read a long object by block transfer, or by segments if the node has none; `progress` gets bytes so far."""
        return finished(self._read_block(progress))

    # As canopen calls them

    phys, desc, data = value, text, bytes
    bits = property(Bits, doc="The bits of `raw` by number or range; each may be set, which writes the object.")

    @property
    def index(self) -> int:
        """The index."""
        return self.address[0]

    @property
    def subindex(self) -> int:
        """The sub-index."""
        return self.address[1]

    def open(
        self, mode: str = "rb", encoding: str = "ascii", size: int | None = None, block_transfer: bool = True, **_: Any
    ) -> IO[Any]:
        """Return the object as a file, to read (`r`, `rb`) or to write (`wb`); it is written when that is closed.

        `size` and `block_transfer` need not be given: long contents go by block transfer if the node has it. Raises
        LocalError for another mode, and as `bytes` does.
        """
        return opened(mode, encoding, self.read_block, self._set_bytes)

    def _set_bytes(self, data: Content) -> None:
        self.bytes = data

    def items(self) -> list[tuple[int, RemoteObject]]:
        """Return the members of a record, with their sub-indices, up to the number in sub-index 0."""
        count = self[0].read(int)
        return [(sub, each) for each in self if 0 < (sub := each.subindex) <= count]

    def keys(self) -> list[int]:
        """Return the sub-indices of `items`."""
        return [sub for sub, _ in self.items()]

    def values(self) -> list[RemoteObject]:
        """Return the members of `items`."""
        return [each for _, each in self.items()]


class AsyncRemoteObject(ObjectAtNode):
    """An object of a node of an `AsyncNetwork`, or a record: `await object.read()`, `await object.write(5)`.

    Every read and write is an SDO transfer, and raises the same errors as RemoteObject. `value`, `raw`, `bytes` and
    `text` are awaited and can only be read: a property cannot be written in an event loop.
    """

    __slots__ = ()

    @overload
    async def read(self) -> Any: ...

    @overload
    async def read(self, kind: type[Scalar]) -> Scalar: ...

    async def read(self, kind: Any = None) -> Any:
        """Return the value of the object's type: int, float, str or bytes; in the file's unit if it has a Factor.

        With a Python type, as in `read(int)`, it is of that type; raises LocalError if it is of another one.
        """
        return self._typed(await self._read(), kind)

    async def write(self, value: Any) -> None:
        """Write a value that type and limits allow; raises FieldError for any other."""
        await self._write(self._bytes_of(value))

    @property
    async def value(self) -> Any:
        """Value that `read` returns."""
        return await self.read()

    if not TYPE_CHECKING:  # a type checker refuses it anyway

        @value.setter
        def value(self, value: object) -> NoReturn:
            raise AttributeError(f"in an event loop an object is written by `await ....write({value!r})`")

    @property
    async def raw(self) -> Any:
        """The value without the Factor."""
        return decode(self.od, await self._read())

    @property
    async def bytes(self) -> Content:
        """The bytes of the SDO."""
        return await self._read()

    @property
    async def text(self) -> str:
        """Value as text: `1500 rpm`, or its name."""
        return self.text_of(await self.raw)

    async def read_block(self, progress: Progress = unwatched) -> Content:
        """Read a long object by block transfer, or by segments if the node has none; `progress` gets bytes so far."""
        return await self._read_block(progress)


# The node


DeviceFile: TypeAlias = "str | Path | Dictionary | ObjectDictionary | None"
"""An EDS or DCF, or a dictionary made from one; None if only the node-ID is known."""


def is_address(key: object) -> TypeGuard[Address]:
    """Return whether a key is an index and a sub-index in their ranges."""
    match key:
        case int(index), int(subindex):
            return index in INDICES and subindex in SUBINDICES
    return False


def _dictionary(file: DeviceFile, node_id: int) -> Dictionary | None:
    if file is None or isinstance(file, Dictionary):
        return file if file is None or file.node_id == node_id else file.renumbered(node_id)
    if not isinstance(file, ObjectDictionary):
        return Dictionary.load(file, node_id)
    text = StringIO()
    canopen.export_od(file, text, "eds")
    return Dictionary.read(text.getvalue().encode(), Path(f"canopen {node_id}"), node_id)


class NoMaster:
    """Placeholder of the master while the network is not open, which says so."""

    def __init__(self, why: str) -> None:
        self._why = why

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):  # `help` looks for optional special methods
            raise AttributeError(name)
        raise StateError(self._why)


UNCONNECTED: Any = NoMaster("the network is not open: `connect`, `with` or `async with` opens it")
DISCONNECTED: Any = NoMaster(CLOSED)


class DeviceAtNode(streams.Keyed):
    """Base class of the devices of both networks."""

    def __init__(self, node_id: int, object_dictionary: DeviceFile = None, name: str = "") -> None:
        dictionary = _dictionary(object_dictionary, check_node_id(node_id))
        self.node_id, self.dictionary = node_id, dictionary
        self.name = name or (dictionary.name if dictionary else f"node {node_id}")
        self._node = RemoteNode(UNCONNECTED, node_id)
        self._emcy_id = dictionary.cob_id(EMCY, EMCY_BASE) if dictionary else EMCY_BASE + node_id
        self._pdos: streams.MappedPdos[Any]
        self._emergencies: streams.HeardEmergencies
        self._nmt: NmtOfNode

    if not TYPE_CHECKING:  # a type checker refuses it anyway

        def __setitem__(self, key: ObjectKey, value: object) -> NoReturn:
            raise TypeError(f"an object is set by its value: write {self._how_to_write.format(key=key, value=value)}")

    _how_to_write = "node[{key!r}].value = {value!r}"

    def join(self, master: Master) -> None:
        """Join an open network."""
        self._node.master = master
        if self.dictionary is not None:
            master.follow(self.dictionary)

    def leave(self, master: Master) -> None:
        """Leave a network that is closed, unless it has joined another one."""
        if self._node.master is master:
            self._node.master = DISCONNECTED

    @property
    def od(self) -> ObjectDictionary:
        """Canopen's object dictionary: `canopen.RemoteNode(5, drive.od)`; raises LocalError without a file."""
        if self.dictionary is None:
            raise LocalError(f"node {self.node_id} was added without an EDS or DCF")
        return self.dictionary.objects

    def _variables(self, key: ObjectKey) -> list[ODVariable]:
        """Return the variables that a key names: one, or all of a record; raises UnknownName, LocalError."""
        known = self.dictionary.objects if self.dictionary else None
        if isinstance(key, ObjectAtNode):
            key = key.address
        if isinstance(key, str):
            return objects.find(key, known)
        address = (key, 0) if isinstance(key, int) else key
        if not is_address(address):
            raise UnknownName("object", key, NUMBERS)
        if isinstance(key, int) and known is not None and key not in known and str(key) in {f"{i:X}" for i in known}:
            raise UnknownName("object", key, [f"0x{key}"])  # 6081, where the file has 0x6081 and no 6081
        found = objects.members(known, key) if isinstance(key, int) and known is not None else []
        return found or [at(address, known)]

    def __contains__(self, key: Any) -> bool:
        """Return whether the file has an object with a name, number or address."""
        try:
            return self.dictionary is not None and all(map(objects.is_described, self._variables(key)))
        except UnknownName:
            return False

    def __len__(self) -> int:
        """Return how many objects the file has."""
        return len([*all_objects(self.dictionary.objects)]) if self.dictionary else 0

    def __bool__(self) -> bool:
        return True

    @property
    def state(self) -> NmtState | None:
        """NMT state in the last heartbeat or boot-up message, None before the first one and after a command."""
        self._node.master.drain()
        return self._node.last_state

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.node_id} {self.name}>"

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names of the objects, for completion of `device["` in IPython."""
        return [each.qualname for each in all_objects(self.od)] if self.dictionary else []

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """Process a frame, which may be this node's."""
        if cob_id == self._emcy_id:
            self._emergencies.receive(data, now)
        elif cob_id == ERROR_CONTROL_BASE + self.node_id and data:
            self._nmt.heard(data[0])
        self._pdos.receive(cob_id, data, now)

    def _wrote(self, thing: ODVariable, data: bytes) -> None:
        """Update a PDO's binding if the written object is one of its parameters."""
        address = address_of(thing)
        if pdo_of(address[0]) is not None and len(data) >= data_type(thing).size:
            self._pdos.present({address: decode(thing, data)})

    async def _identity(self) -> Identity:
        """Read the identity object 0x1018, with 0 for missing numbers."""
        return await read_identity.steps(self._node)

    async def _configure(
        self, file: str | Path, *, store: bool = True, reset: bool = True, cob_ids: CobIdChoice = None
    ) -> Configured:
        """Configure the node from a DCF: write the differences, read back, store, reset, verify.

        The DCF may be that of another node of the same kind: what follows the node-ID moves along.

        Args:
            file: the DCF
            store: have the node store the values; otherwise they last until its next reset
            reset: reset the node and verify what it has stored
            cob_ids: what becomes of COB-IDs that somebody chose, in the DCF of another node: `keep`, or `move` by the
                distance of the node-IDs; None: they are an error

        Returns:
            How many objects were changed, and whether they are stored and were verified after the reset.

        Raises:
            DictionaryError: the file is damaged or for another device; nothing was written
            ConfigurationError: the node did not take all of it, or the wait was cancelled; it has its former values
                again, or `written` and `left` say which objects have changed and which have not
        """
        plan = await self._plan(file, cob_ids)
        done = Configured(0, False)
        if plan.changes:
            done = await configure.apply.steps(self._node, plan, datetime.now(), stores=store, resets=reset)
        # The node now has all values of the file.
        has = {address_of(thing): decode(thing, data) for thing, data in configure.settings(plan.dictionary)}
        self._pdos.present({address: value for address, value in has.items() if pdo_of(address[0]) is not None})
        return done

    async def _difference(self, file: str | Path, *, cob_ids: CobIdChoice = None) -> ChangePlan:
        """Return what `configure` would write, without writing.

        Args:
            file: the DCF
            cob_ids: as in `configure`

        Raises:
            DictionaryError: as `configure`
        """
        return await self._plan(file, cob_ids)

    async def _plan(self, file: str | Path, cob_ids: CobIdChoice) -> ChangePlan:
        chosen = look_up("choice of COB-IDs", cob_ids, {each.value: each for each in ChosenCobIds}) if cob_ids else None
        try:
            dictionary = Dictionary.load(file)
        except DictionaryError as error:
            if not error.what.startswith(NO_NODE_ID):
                raise
            raise DictionaryError(
                file, None, "a DCF is needed, which names its node-ID; `dump -o` writes one"
            ) from None
        return await configure.difference.steps(self._node, dictionary, chosen=chosen)

    async def _store(self) -> None:
        """Make the node store all parameters, so that they survive a reset (0x1010); may take 5 s."""
        await configure.store.steps(self._node)

    async def _restore(self) -> None:
        """Make the node restore the defaults of its parameters at its next reset (0x1011)."""
        await configure.restore.steps(self._node)

    async def _heartbeat(self, within: float = 1.0) -> NmtState:
        """Wait for the next heartbeat and return the state in it; raises HeartbeatLost after `within` seconds."""
        state = await self._node.state.steps(within)
        if state is None:
            raise HeartbeatLost(self.node_id, within)
        return state

    async def _program(
        self, content: bytes, number: int = 1, check_crc: bool = True, progress: Progress = unwatched
    ) -> Loaded:
        """Download a program, verify and start it (CiA 302-3).

        Args:
            content: the program
            number: number of the program, 1 to 254
            check_crc: compare the device's CRC (0x1F56) with that of the content
            progress: called with the number of bytes so far, and of all

        Raises:
            ProgramError: a step failed; the text says in which state the node was left, and how to go on
        """
        if not isinstance(content, (bytes, bytearray)):
            raise LocalError(f"a program is bytes, not {content!r}")
        return await program.load.steps(self._node, content, number, check_crc, progress, self.dictionary)


HEARTBEAT_WAIT = 10.0
"""Default timeout for a heartbeat in canopen's methods, in s."""


class NmtOfNode(streams.Closed):
    """Base class of the NMT commands of both networks."""

    def __init__(self, device: DeviceAtNode) -> None:
        self._functions: tuple[Callable[[int], object], ...] = ()
        self._node = device._node

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of node {self._node.node_id}>"

    def heard(self, state: int) -> None:
        """Call the functions for a heartbeat or boot-up message with its state."""
        for function in self._functions:
            self._node.master.call(partial(function, state & ~TOGGLE))

    async def _start(self, within: float | None = None) -> None:
        """Switch the node to OPERATIONAL, where it sends and receives PDOs."""
        await self._go(NmtCommand.START, within)

    async def _stop(self, within: float | None = None) -> None:
        """Switch the node to STOPPED, where it obeys only NMT."""
        await self._go(NmtCommand.STOP, within)

    async def _enter_pre_operational(self, within: float | None = None) -> None:
        """Switch the node to PRE-OPERATIONAL, with SDO but no PDOs."""
        await self._go(NmtCommand.ENTER_PRE_OPERATIONAL, within)

    async def _reset(self, command: NmtCommand = NmtCommand.RESET_NODE) -> None:
        """Reset the node, or its communication, and wait for its boot-up message; raises NoAnswer."""
        await self._node.reset.steps(command)

    async def _go(self, command: NmtCommand, within: float | None) -> None:
        self._node.command(command)
        if within is not None and not await self._node.wait_for.steps(TARGET[command], within):
            raise HeartbeatLost(self._node.node_id, within)


class NodeNmt(NmtOfNode):
    """NMT commands to one node.

    They are not confirmed. With `within` seconds the heartbeat has to show the state in that time, or HeartbeatLost is
    raised. All raise BusError.
    """

    _guarding: PeriodicTask | None = None

    start, stop = blocking(NmtOfNode._start), blocking(NmtOfNode._stop)
    enter_pre_operational, reset = blocking(NmtOfNode._enter_pre_operational), blocking(NmtOfNode._reset)

    # As canopen calls them

    @property
    def state(self) -> str:
        """The NMT state that was heard last, as canopen writes it; after a boot-up that is `PRE-OPERATIONAL`.

        It is `UNKNOWN` before the first heartbeat, and after a command until the next one. Set it to send a command,
        also `RESET` or `RESET COMMUNICATION`; raises UnknownName, BusError.
        """
        self._node.master.drain()
        return canopen_state(self._node.last_state)

    @state.setter
    def state(self, state: str) -> None:
        self._node.command(command_to(state))

    def send_command(self, command: int) -> None:
        """Send a command by its number."""
        self._node.command(NmtCommand(command))

    def wait_for_bootup(self, timeout: float = HEARTBEAT_WAIT) -> None:
        """Wait for a boot-up message, which may have come since the last command; raises HeartbeatLost."""
        if not self._node.wait_for_bootup(timeout):
            raise HeartbeatLost(self._node.node_id, timeout)

    def wait_for_heartbeat(self, timeout: float = HEARTBEAT_WAIT) -> str:
        """Wait for the next heartbeat and return the state in it, as `state` writes it; raises HeartbeatLost."""
        if self._node.state(timeout) is None:
            raise HeartbeatLost(self._node.node_id, timeout)
        return self.state

    def add_heartbeat_callback(self, function: Callable[[int], object]) -> None:
        """Register a function that is called with the number of the state in each heartbeat and boot-up message."""
        self._functions = (*self._functions, function_of(function))

    add_hearbeat_callback = add_heartbeat_callback  # canopen has both spellings

    def start_node_guarding(self, period: float) -> None:
        """Request the node's state every `period` seconds until `stop_node_guarding`; raises BusError."""
        self.stop_node_guarding()
        asking = [Frame(ERROR_CONTROL_BASE + self._node.node_id)]
        self._guarding = PeriodicTask(self._node.master, asking, period, remote=True)

    def stop_node_guarding(self) -> None:
        """Stop the requests of `start_node_guarding`."""
        if self._guarding is not None:
            self._guarding.stop()


class AsyncNodeNmt(NmtOfNode):
    """NMT commands to one node: those of NodeNmt, awaited."""

    start, stop = NmtOfNode._start, NmtOfNode._stop
    enter_pre_operational, reset = NmtOfNode._enter_pre_operational, NmtOfNode._reset


class RemoteDevice(DeviceAtNode, NamedAsInCanopen):
    """A device on a `Network`.

    `drive["Profile velocity"].value` reads and writes an object; `drive.nmt`, `drive.state`, `drive.emcy` and
    `drive.pdo["TPDO1"]` are its NMT commands, state, emergency messages and PDOs; `drive.od` is canopen's dictionary.
    Whatever waits for the node raises NodeRefused, NoAnswer, WrongAnswer or BusError, which name node and object.

        with simulated("motor.eds", node_id=5) as network:
            motor = network[5]
            motor.nmt.start()
            print(motor["Temperature"].value)
    """

    _parts = {".nmt": NodeNmt, ".emcy": streams.EmergencyStream, ".drive402": Drive402, "[name]": RemoteObject}  # noqa: RUF012

    def __init__(self, node_id: int, object_dictionary: DeviceFile = None, name: str = "") -> None:
        super().__init__(node_id, object_dictionary, name)
        self.nmt = self._nmt = NodeNmt(self)
        self.emcy = self._emergencies = streams.EmergencyStream(self._node)
        self.pdo = self._pdos = RemotePdos(self._node, self.dictionary, BlockingPdoStream)

    def __getitem__(self, key: ObjectKey) -> RemoteObject:
        """Return an object by name, `0x6081`, `0x1018:1`, index, or (index, sub-index); raises UnknownName."""
        return RemoteObject(self._node, self._variables(key), self._wrote)

    def __iter__(self) -> Iterator[RemoteObject]:
        """Yield every object of the file."""
        things = all_objects(self.dictionary.objects) if self.dictionary else ()
        return (RemoteObject(self._node, [each], self._wrote) for each in things)

    # As canopen calls them

    @property
    def id(self) -> int:
        """The node-ID."""
        return self.node_id

    @property
    def object_dictionary(self) -> ObjectDictionary:
        """`od`."""
        return self.od

    network: Any = None
    """The network that it was added to."""

    def associate_network(self, network: Any) -> None:
        """Add it to a network."""
        network.add_node(self)

    def has_network(self) -> bool:
        """Return whether it was added to a network."""
        return self.network is not None

    def remove_network(self) -> None:
        """Remove it from its network."""
        del self.network[self.node_id]

    @property
    def sdo(self) -> Self:
        """The node itself: `drive.sdo["Profile velocity"].raw`."""
        return self

    @property
    def tpdo(self) -> PdosOfDirection:
        """Its TPDOs by number: `drive.tpdo[1]` is `drive.pdo["TPDO1"]`."""
        return self.pdo.tx

    @property
    def rpdo(self) -> PdosOfDirection:
        """Its RPDOs by number."""
        return self.pdo.rx

    RESPONSE_TIMEOUT = property(
        lambda self: self._node.answer_wait,
        lambda self, wait: setattr(self._node, "own_wait", seconds(wait)),
        doc="Seconds that this node has for an answer; see `answer_wait` of `Network.open`.",
    )

    def open(self, index: int | str, subindex: int = 0, mode: str = "rb", **options: Any) -> IO[Any]:
        """Return an object as a file; see `RemoteObject.open`."""
        return self[(index, subindex) if isinstance(index, int) else index].open(mode, **options)

    def upload(self, index: int, subindex: int) -> bytes:
        """Read the bytes of an object; raises as an object does."""
        return self[index, subindex].bytes

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write the bytes of an object, unchecked."""
        self[index, subindex].bytes = data

    def load_configuration(self) -> None:
        """Write the ParameterValues of the file, in the order of CiA 301.

        It is neither read back nor stored, and the device may be another one: see `configure`.
        """
        if self.dictionary is None or not any(map(self.dictionary.has_own_value, self.dictionary.addresses())):
            return
        for write in configure.all_writes(self.dictionary):
            self._node.download(write.address, write.data)

    @property
    def drive402(self) -> Drive402:
        """The node as a drive of CiA 402: enabled, homed, moved."""
        return self.axis402(1)

    def axis402(self, axis: int) -> Drive402:
        """Return an axis of a drive by its number from 1 on; raises LocalError."""
        return Drive402(self._node, self.dictionary, axis)

    identity, heartbeat = blocking(DeviceAtNode._identity), blocking(DeviceAtNode._heartbeat)
    configure, difference = blocking(DeviceAtNode._configure), blocking(DeviceAtNode._difference)
    store, restore = blocking(DeviceAtNode._store), blocking(DeviceAtNode._restore)
    program = blocking(DeviceAtNode._program)


class AsyncRemoteDevice(DeviceAtNode):
    """A device on an `AsyncNetwork`: what RemoteDevice has, awaited.

    `await drive["Profile velocity"].read()`, `await drive.configure("drive.dcf")`,
    `async for reading in drive.pdo["TPDO1"]`.
    """

    _how_to_write = "await node[{key!r}].write({value!r})"

    def __init__(self, node_id: int, object_dictionary: DeviceFile = None, name: str = "") -> None:
        super().__init__(node_id, object_dictionary, name)
        self.nmt = self._nmt = AsyncNodeNmt(self)
        self.emcy = self._emergencies = streams.AsyncEmergencyStream(self._node)
        self.pdo = self._pdos = streams.AsyncRemotePdos(self._node, self.dictionary, streams.AsyncPdoStream)

    def __getitem__(self, key: ObjectKey) -> AsyncRemoteObject:
        """Return an object by name, `0x6081`, `0x1018:1`, index, or (index, sub-index); raises UnknownName."""
        return AsyncRemoteObject(self._node, self._variables(key), self._wrote)

    def __iter__(self) -> Iterator[AsyncRemoteObject]:
        """Yield every object of the file."""
        things = all_objects(self.dictionary.objects) if self.dictionary else ()
        return (AsyncRemoteObject(self._node, [each], self._wrote) for each in things)

    @property
    def drive402(self) -> AsyncDrive402:
        """The node as a drive of CiA 402: enabled, homed, moved."""
        return self.axis402(1)

    def axis402(self, axis: int) -> AsyncDrive402:
        """Return one axis of a drive with several, by its number from 1 on; raises LocalError."""
        return AsyncDrive402(self._node, self.dictionary, axis)

    identity, heartbeat = DeviceAtNode._identity, DeviceAtNode._heartbeat
    configure, difference = DeviceAtNode._configure, DeviceAtNode._difference
    store, restore = DeviceAtNode._store, DeviceAtNode._restore
    program = DeviceAtNode._program
