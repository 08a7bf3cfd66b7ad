"""Emergency messages and PDOs of a node, as streams.

A stream has the last item, callbacks, an iterator and the next one. An iterator that is behind loses nothing, up to
`BACKLOG` items; then it loses the oldest ones, and counts them.

TPDOs are heard and RPDOs are sent, by the names of the mapped objects. A PDO is read by its present mapping, as far as
the master knows it: from the file, from what a configuration has written and read back, from what was written with
`drive[...]`, or as `read()` has found it.
"""

from __future__ import annotations

import logging
import struct
from abc import abstractmethod
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Self, TypeVar
from weakref import WeakSet

from eurobot_od.canopen_names import NamedAsInCanopen, missing, remedy_for
from eurobot_od.client.configure import pdo_parameters
from eurobot_od.client.master import Master, Procedure, RemoteNode, blocking, finished, function_of
from eurobot_od.device.broadcasts import REGISTER_BITS
from eurobot_od.errors import (
    EurobotError,
    FieldError,
    FrameLengthError,
    LocalError,
    MappingError,
    NoAnswer,
    UnknownName,
)
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER, ERRORS, ErrorCode
from eurobot_od.od.values import SYNC_COB_ID, Address, PdoDirection, Scalar, Value, typed
from eurobot_od.od.words import error_words
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import plain_name
from eurobot_od.support.texts import columns

PDO_LOG, EMCY_LOG = logging.getLogger("eurobot_od.pdo"), logging.getLogger("eurobot_od.emcy")

Item = TypeVar("Item")

BACKLOG = 10_000
"""Maximum number of items that an iterator keeps: 10 s of a PDO every millisecond."""


class Closed(NamedAsInCanopen):
    """Refuses an attribute that was not there when it was made: `pdo.enabld = True` is a slip, and would say nothing.

    Its `_node` is the last one that it gets.
    """

    if not TYPE_CHECKING:  # with `__setattr__`, type checkers would accept any attribute

        def __setattr__(self, name: str, value: object) -> None:
            if name[0] != "_" and "_node" in vars(self) and name not in vars(self) and not hasattr(type(self), name):
                raise AttributeError(missing(str(self), remedy_for(type(self), name), name))
            object.__setattr__(self, name, value)


class Keyed:
    """Base of classes whose `[...]` raises UnknownName: `in` says whether it would."""

    __slots__ = ()

    @abstractmethod
    def __getitem__(self, key: Any) -> Any:
        """Return what has a name or number; raises UnknownName."""

    def __contains__(self, key: object) -> bool:
        try:
            self[key]
        except UnknownName:
            return False
        return True


class Stream(Closed, Generic[Item]):
    """A stream of items: the `last` one (None before the first), and the `count` of them."""

    def __init__(self, node: RemoteNode, name: str, label: str = "") -> None:
        self.last: Item | None = None
        self.count = 0
        self._hint: Callable[[], str] = str
        """Returns why nothing may have come, as far as that is known."""
        self.name = name
        self.node_id = node.node_id
        self._label = f"{label or name} of node {node.node_id}"
        self._functions: list[Callable[[Item], object]] = []
        self._readers: WeakSet[StreamReader[Item]] = WeakSet()
        self._node = node

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._label}, last: {self.last}>"

    def on(self, function: Callable[[Item], object]) -> Callable[[Item], object]:
        """Call a function with each item, in order; also a decorator.

        It runs on a thread of its own, or in the event loop. An exception it raises is logged, and the next item still
        comes.
        """
        self._functions.append(function_of(function))
        return function

    def off(self, function: Callable[[Item], object]) -> None:
        """Stop calling a function; raises ValueError if it was not registered."""
        self._functions.remove(function)

    def push(self, item: Item) -> None:
        """Process an item."""
        self.last = item
        self.count = self.count + 1
        for function in self._functions:
            self._node.master.call(partial(function, item))
        for reader in [*self._readers]:
            reader.put(item)

    def reader(self) -> StreamReader[Item]:
        """Return an iterator that keeps each item from now on."""
        made = StreamReader[Item](self._node.master)
        self._readers.add(made)
        return made

    async def _next(self, timeout: float) -> Item:
        number = self.count
        await self._node.master.pump.steps(timeout, lambda: self.count > number)
        if self.count == number or self.last is None:
            raise NoAnswer(f"the last one{self._hint()}", self._label, 1, timeout, self.node_id)
        return self.last


class EndlessIterator(Iterator[Item], AsyncIterator[Item]):
    """An endless iterator over the results of `_next`, for blocking programs and event loops."""

    @abstractmethod
    async def _next(self) -> Item:
        """Return the next item."""

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Item:
        return finished(self._next())

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Item:
        return await self._next()


class StreamReader(EndlessIterator[Item]):
    """An endless iterator over a stream; `lost` counts dropped items."""

    def __init__(self, master: Master) -> None:
        self._master = master
        self._waiting = deque[Item]()
        self.lost = 0

    @property
    def waiting(self) -> list[Item]:
        """What `next` has not taken yet, the oldest first."""
        return [*self._waiting]

    def put(self, item: Item) -> None:
        """Append an item, and drop the oldest one if there are too many."""
        if len(self._waiting) == BACKLOG:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(item)

    async def _next(self) -> Item:
        while not self._waiting:
            await self._master.pump.steps(inf, lambda: bool(self._waiting))
        return self._waiting.popleft()


class BlockingStream(Stream[Item]):
    """A stream of a `Network`: `for each in stream` never ends."""

    def wait(self, timeout: float = 1.0) -> Item:
        """Wait for the next item and return it; raises NoAnswer after `timeout` seconds, BusError."""
        return finished(self._next(timeout))

    def __iter__(self) -> StreamReader[Item]:
        return self.reader()


class AsyncStream(Stream[Item]):
    """A stream of an `AsyncNetwork`: `async for each in stream` never ends."""

    async def wait(self, timeout: float = 1.0) -> Item:
        """Wait for the next item and return it; raises NoAnswer after `timeout` seconds, BusError."""
        return await self._next(timeout)

    def __aiter__(self) -> StreamReader[Item]:
        return self.reader()


# The errors that a node remembers


class RememberedError(NamedTuple):
    """One remembered error: its emergency error `code` and the manufacturer's `info`, 16 bits each."""

    code: int
    info: int


class History(NamedTuple):
    """The error register, and the remembered errors, newest first."""

    register: int
    entries: list[RememberedError]

    @property
    def register_bits(self) -> list[str]:
        """Names of the bits set in the register."""
        return [name for bit, name in enumerate(REGISTER_BITS) if self.register >> bit & 1]

    def lines(self, node_id: int, words: Callable[[int], str]) -> Iterator[str]:
        """Yield the lines of the history as text; `words` returns the meaning of a code."""
        register = ", ".join(self.register_bits) or "no error"
        rows = [
            (f"0x{each.code:04X}", words(each.code), f"0x{each.info:04X}" if each.info else "") for each in self.entries
        ]
        yield f"node {node_id}: {register} (error register 0x{self.register:02X})"
        yield from columns(rows) if rows else ["no error remembered"]


@Procedure
async def read_history(node: RemoteNode) -> History:
    """Read the error register and history of a node. Raises NodeRefused, NoAnswer, BusError."""
    register = (await node.upload.steps(ERROR_REGISTER, "Error register"))[0]
    count = (await node.upload.steps(ERRORS, "Number of errors"))[0]
    fields = [await node.upload.steps((ERROR_FIELD, sub)) for sub in range(1, count + 1)]
    return History(register, [RememberedError(*struct.unpack_from("<HH", each)) for each in fields])


@Procedure
async def clear_history(node: RemoteNode) -> None:
    """Clear the history; raises as `read_history`."""
    await node.download.steps(ERRORS, b"\0", "Number of errors")


# Emergency messages


EMCY_BYTES = 8


class Emergency(EurobotError, NamedAsInCanopen):
    """An emergency message: its time in seconds, the node, error code, error register and the maker's 5 bytes.

    Code 0 means that an error has gone. A program may raise it.
    """

    def __init__(self, time: float, node_id: int, code: int, register: int, data: bytes) -> None:
        self.time, self.node_id = time, node_id
        self.code, self.register, self.data = code, register, data
        super().__init__(time, node_id, code, register, data)

    @property
    def text(self) -> str:
        """The words of the code's class in CiA 301."""
        return error_words(self.code, {})

    def get_desc(self) -> str:
        """Return `text`, as canopen calls it."""
        return self.text

    @property
    def timestamp(self) -> float:
        """The time, as canopen calls it."""
        return self.time

    def __str__(self) -> str:
        data = self.data.hex(" ").upper()
        return f"node {self.node_id}: 0x{self.code:04X} {self.text} (error register 0x{self.register:02X}, data {data})"


class HeardEmergencies(Stream[Emergency]):
    """Base class of both emergency streams."""

    def __init__(self, node: RemoteNode) -> None:
        self.active: list[Emergency] = []
        super().__init__(node, "emergency message")

    def push(self, item: Emergency) -> None:
        EMCY_LOG.info("%s", item)
        others = [each for each in self.active if each.code != item.code]
        self.active = [] if item.code == ErrorCode.NO_ERROR else [*others, item]
        super().push(item)

    def receive(self, data: bytes, now: float) -> None:
        """Process an emergency message; frames of other lengths are ignored."""
        if len(data) == EMCY_BYTES:
            self.push(Emergency(now, self.node_id, int.from_bytes(data[:2], "little"), data[2], data[3:]))

    async def _wait(self, emcy_code: int | None, timeout: float) -> Emergency:
        """Wait for the next emergency message, or the next with a code; raises LocalError for a code that is none."""
        if emcy_code is None:
            return await self._next(timeout)
        if not isinstance(emcy_code, int):
            raise LocalError(f"{emcy_code!r} is not an error code; write wait(timeout={emcy_code!r}) for seconds")
        coming = self.reader()
        await self._node.master.pump.steps(timeout, lambda: any(each.code == emcy_code for each in coming.waiting))
        found = next((each for each in coming.waiting if each.code == emcy_code), None)
        if found is None:
            label = f"{self.name} 0x{emcy_code:04X} of node {self.node_id}"
            raise NoAnswer("the last one", label, 1, timeout, self.node_id)
        return found

    async def _history(self) -> History:
        """Read the node's error register and history (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return await read_history.steps(self._node)

    async def _clear(self) -> None:
        """Clear the node's error history; raises as `history`."""
        await clear_history.steps(self._node)


class EmergencyStream(HeardEmergencies, BlockingStream[Emergency]):
    """Emergency messages of a node; `active` has the last of each code since the last `no error`."""

    def __init__(self, node: RemoteNode) -> None:
        self._log = deque[Emergency](maxlen=BACKLOG)
        super().__init__(node)

    def wait(self, emcy_code: int | None = None, timeout: float = 1.0) -> Emergency:  # type: ignore[override]
        """Wait for the next one, or the next with an error code; raises NoAnswer, BusError, LocalError."""
        return finished(self._wait(emcy_code, timeout))

    history, clear = blocking(HeardEmergencies._history), blocking(HeardEmergencies._clear)

    # As canopen calls them

    add_callback = HeardEmergencies.on

    @property
    def log(self) -> list[Emergency]:
        """All of them since the begin or `reset`, at most the last 10 000, the oldest first."""
        return [*self._log]

    def push(self, item: Emergency) -> None:
        self._log.append(item)
        super().push(item)

    def reset(self) -> None:
        """Forget what has come; the node is not asked: see `clear`."""
        self.active = []
        self._log.clear()


class AsyncEmergencyStream(HeardEmergencies, AsyncStream[Emergency]):
    """Emergency messages of a node; `active` has the last of each code since the last `no error`."""

    async def wait(self, emcy_code: int | None = None, timeout: float = 1.0) -> Emergency:  # type: ignore[override]
        """Wait for the next one, or the next with an error code; raises NoAnswer, BusError, LocalError."""
        return await self._wait(emcy_code, timeout)

    history, clear = HeardEmergencies._history, HeardEmergencies._clear


# PDOs


class PdoValue(NamedTuple):
    """A value in a TPDO and its time, the driver's time stamp in s (Unix time with SocketCAN)."""

    time: float
    value: Any


class PdoValues(dict[str, Any]):
    """Values by the names of the mapped objects, and also by the names of the fields."""

    def __init__(self, values: Mapping[str, Any], key: Callable[[str], str]) -> None:
        super().__init__(values)
        self._key = key

    def __missing__(self, name: str) -> Any:
        return self[self._key(name)]


class PdoReading(NamedTuple):
    """A received TPDO: `time` as in `PdoValue`, and its `values` by the names of the objects."""

    time: float
    values: Mapping[str, Any]

    def __getitem__(self, name: Any) -> Any:
        """Return the value of an object by its name."""
        return self.values[name] if isinstance(name, str) else tuple(self)[name]

    def read(self, name: str, kind: type[Scalar]) -> Scalar:
        """Return the value of an object as a Python type, such as `int`; raises LocalError for another type."""
        return typed(self[name], kind, name)


NEEDS_SYNC = ": it comes only with SYNC (`network.sync`), from a node in OPERATIONAL (`nmt.start`)"


Signal = TypeVar("Signal")


class PdoStream(Stream[PdoReading], Keyed):
    """Base class of a PDO in both networks, decoded by its present mapping."""

    def __init__(self, node: RemoteNode, name: str, home: MappedPdos[Any]) -> None:
        self.refused: FrameLengthError | None = None
        """Error of the last frame if it could not be decoded, else None."""
        super().__init__(node, name)
        self._home = home
        self._hint = self._why_silent
        self._signals: dict[str, Any] = {}

    def adopt(self, binding: Binding) -> None:
        """Decode frames by this mapping from now on."""
        self._binding = binding

    def _why_silent(self) -> str:
        if self.refused is not None:
            return f": {self.refused}"
        has_sync = any(task.is_sending(SYNC_COB_ID) for task in self._node.master.periodic)
        return NEEDS_SYNC if self._binding.pdo.is_synchronous and not has_sync else ""

    @property
    def cob_id(self) -> int:
        """The identifier."""
        return self._binding.cob_id

    @property
    def direction(self) -> PdoDirection:
        """Whether the node sends it (TPDO) or receives it."""
        return self._binding.pdo.direction

    @property
    def names(self) -> list[str]:
        """Names of the mapped objects, in mapping order."""
        return [*self._binding.objects]

    def __len__(self) -> int:
        return len(self._binding.objects)

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names of the mapped objects, for completion in IPython."""
        return self.names

    def __repr__(self) -> str:
        names = ", ".join(self.names)
        return f"<{type(self).__name__} {self.name} of node {self.node_id}, 0x{self.cob_id:03X}: {names}>"

    def _key(self, name: str | int) -> str:
        found = self._binding.object_name(name) if isinstance(name, (str, int)) else None
        if found is None:
            raise UnknownName(f"object of {self.name}", name, self.names)
        return found

    def _signal(self, name: str, kind: Callable[[RemoteNode, str, str], Signal]) -> Signal:
        if name not in self._signals:
            self._signals[name] = kind(self._node, name, f"{name} in {self.name}")
            if self.last is not None and name in self.last.values:
                self._signals[name].last = PdoValue(self.last.time, self.last.values[name])
        self._signals[name]._hint = self._why_silent
        made: Signal = self._signals[name]
        return made

    def receive(self, data: bytes, now: float) -> None:
        """Process a frame; one that is too short for the mapping is `refused` (CiA 301, EMCY 0x8210)."""
        try:
            message = self._binding.decode(data)
        except FrameLengthError as error:
            PDO_LOG.log(logging.INFO if self.refused else logging.WARNING, "node %d: %s", self.node_id, error)
            self.refused = error
            return
        self.refused = None
        PDO_LOG.debug("node %d: %s heard: %s", self.node_id, self.name, message)
        values = {name: getattr(message, each.field) for name, each in self._binding.objects.items()}
        for name, signal in self._signals.items():
            if name in values:
                signal.push(PdoValue(now, values[name]))
        self.push(PdoReading(now, PdoValues(values, self._key)))

    def transmit(self, values: Mapping[str, Value]) -> None:
        """Send an RPDO with values for all mapped objects, by name; the node must be OPERATIONAL to act on it.

        Raises FieldError for a value that is missing, or that object or mapping do not allow; UnknownName, LocalError
        for a TPDO, BusError.
        """
        self._node.master.send(*self._frame(values))

    def _frame(self, values: Mapping[str, Value]) -> Frame:
        if self.direction is PdoDirection.TPDO:
            raise LocalError(f"{self.name} of node {self.node_id} is sent by the node; a master sends its RPDOs")
        if not isinstance(values, Mapping):
            raise FieldError(self.name, "values", values, "a value for each name, such as {'Controlword': 6}")
        objects = self._binding.objects
        given = {objects[self._key(name)].field: value for name, value in values.items()}
        absent = [name for name, each in objects.items() if each.field not in given]
        if absent:
            raise FieldError(self.name, absent[0], None, "every object that is mapped has a value")
        for name, each in objects.items():
            if isinstance(given[each.field], bool) and data_type(each.variable).bits != 1:
                raise FieldError(self.name, name, given[each.field], "a number")
        PDO_LOG.debug("node %d: %s is sent: %s", self.node_id, self.name, given)
        return self._binding.encode(self._binding.message(**given))


class AsyncPdoSignal(AsyncStream[PdoValue]):
    """Values of one object in a PDO: `last`, `wait`, `on`, and `async for time, value in signal`."""

    @property
    def value(self) -> Any:
        """The last value, None before the first."""
        return self.last and self.last.value


class AsyncPdoStream(PdoStream, AsyncStream[PdoReading]):
    """A PDO of a node: its readings as they come, its objects by name, and `transmit` for an RPDO."""

    def __getitem__(self, name: str | int) -> AsyncPdoSignal:
        """Return the values of one object by its name, index or position; raises UnknownName."""
        return self._signal(self._key(name), AsyncPdoSignal)


AnyPdo = TypeVar("AnyPdo", bound=PdoStream)


class MappedPdos(Keyed, Generic[AnyPdo]):
    """PDOs of a node by `TPDO1`, `RPDO2`, or the names of their communication records."""

    def __init__(self, node: RemoteNode, dictionary: Dictionary | None, kind: type[AnyPdo]) -> None:
        self._node, self._kind = node, kind
        self._pdos: dict[str, AnyPdo] = {}
        self._made: dict[str, AnyPdo] = {}
        """All PDOs, valid or not; a program keeps the same object when a PDO is remapped or disabled."""
        self._records: dict[str, str] = {}
        self._refused: dict[int, MappingError] = {}
        self.dictionary = dictionary
        self._adopt()

    def _adopt(self) -> None:
        """Use the mappings in the dictionary."""
        if self.dictionary is None:
            return
        refusals = list[MappingError]()
        found = {pdo.key: pdo for pdo in self.dictionary.read_pdos(self.dictionary.default, refusals.append)}
        self._refused = {each.index: each for each in refusals if each.index is not None}
        self._records = {plain_name(pdo.name): key for key, pdo in found.items()}
        valid = dict[str, AnyPdo]()
        for key, pdo in found.items():
            try:
                binding = Binding(self.dictionary.file, pdo, key, None)
            except MappingError as error:
                self._refused |= {pdo.index: error} if pdo.valid else {}
                continue
            if key not in self._made:
                self._made[key] = self._kind(self._node, key, self)
            self._made[key].adopt(binding)
            valid |= {key: self._made[key]} if pdo.valid else {}
        self._pdos = valid

    def present(self, values: Mapping[Address, Value]) -> None:
        """Update the mappings from present values of the node's PDO parameters."""
        if self.dictionary is not None and values:
            self.dictionary = self.dictionary.configured(values)
            self._adopt()

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """Process a frame, if it is one of the node's TPDOs."""
        for pdo in self._pdos.values():
            if pdo.cob_id == cob_id and pdo.direction is PdoDirection.TPDO:
                pdo.receive(data, now)

    def __getitem__(self, name: str) -> AnyPdo:
        """Return a PDO; raises UnknownName, also for a disabled one."""
        key = name.upper() if isinstance(name, str) else name
        key = key if key in self._pdos else self._records.get(plain_name(str(name)), name)
        if key in self._pdos:
            return self._pdos[key]
        for error in self._refused.values():
            raise error
        raise UnknownName(f"PDO of node {self._node.node_id}", name, self._pdos)

    def __iter__(self) -> Iterator[AnyPdo]:
        return iter([*self._pdos.values()])

    def __len__(self) -> int:
        return len(self._pdos)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of node {self._node.node_id}: {', '.join(self._pdos) or 'none is valid'}>"

    def _ipython_key_completions_(self) -> list[str]:
        """Return the valid PDOs, for completion of `pdo["` in IPython."""
        return [*self._pdos]

    _items = _ipython_key_completions_

    async def _read(self) -> None:
        if self.dictionary is not None:
            self.present(await pdo_parameters.steps(self._node, self.dictionary))


class AsyncRemotePdos(MappedPdos[AsyncPdoStream]):
    """PDOs of a node: `drive.pdo["TPDO1"]`."""

    async def read(self) -> None:
        """Read the node's present PDO mapping; raises NoAnswer, RemoteError, BusError."""
        await self._read()
