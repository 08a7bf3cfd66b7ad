"""The PDOs of a node as a master sees them: TPDOs are heard, RPDOs are sent, by the names of the mapped objects.

A PDO is read by its present mapping, as far as the master knows it: from the file, from what a configuration has
written and read back, from what was written with `drive[...]`, or as `read()` has found it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

from eurobot_od.client.master import Procedure, RemoteNode, finished
from eurobot_od.client.reading import read_bytes
from eurobot_od.client.streams import AsyncStream, BlockingStream, Stream
from eurobot_od.errors import FieldError, FrameLengthError, LocalError, MappingError, UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import SLICE, Address, PdoDirection, Value, pdo_of
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.catalogue import plain_name


@Procedure
async def pdo_parameters(node: RemoteNode, dictionary: Dictionary) -> dict[Address, Value]:
    """Read the numbers in the records of a node's PDOs; those that it refuses are left out.

    Raises NoAnswer, RemoteError, BusError.
    """
    found = await read_bytes.steps(node, (each for each in dictionary.addresses() if pdo_of(each[0]) is not None))
    return {address: int.from_bytes(data, "little") for address, data in found.items() if isinstance(data, bytes)}


class PdoValue(NamedTuple):
    """A value in a TPDO, and its time: the driver's time stamp in seconds (Unix time with SocketCAN)."""

    time: float
    value: Any


class PdoReading(NamedTuple):
    """A TPDO that has come: `time` as in `PdoValue`, and its `values` by the names of the objects."""

    time: float
    values: Mapping[str, Any]

    def __getitem__(self, name: Any) -> Any:
        """Return the value of an object by its name."""
        if not isinstance(name, str):
            return tuple(self)[name]
        if name not in self.values:
            raise UnknownName("object of this PDO", name, self.values)
        return self.values[name]


class MappedPdo(Stream[PdoReading]):
    """The common part of the PDOs of both kinds of networks."""

    def __init__(self, node: RemoteNode, name: str) -> None:
        super().__init__(node.master, name, node.node_id)
        self._signals: dict[str, Stream[PdoValue]] = {}
        self._fields: dict[str, str] = {}
        self.refused: FrameLengthError | None = None
        """Why the last frame that could not be read was refused."""

    def adopt(self, binding: Binding) -> None:
        """Read frames by this mapping from now on."""
        self._binding = binding
        entries = zip(binding.pdo.mapping, binding.layout.slots)
        fields = {}
        for entry, slot in entries:
            if slot.field is not None:
                name: str = entry.variable.qualname or "0x{:04X}:{}".format(*address_of(entry.variable))
                # An object may be mapped in slices of a few bits; whoever asks for it means all of it.
                part = SLICE.match(name)
                fields[part["name"] if part else name] = slot.field
        self._fields = fields  # replaced as a whole: another thread may be reading it

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
        """The names of the mapped objects, in the order in which they are mapped."""
        return [*self._fields]

    def _key(self, name: str) -> str:
        found = {plain_name(each): each for each in self._fields}
        if plain_name(name) not in found:
            raise UnknownName(f"object of {self.name}", name, self._fields)
        return found[plain_name(name)]

    def hear(self, data: bytes, now: float) -> None:
        """Take in a frame; one that is too short for the mapping is `refused` (CiA 301, EMCY 0x8210)."""
        try:
            message = self._binding.decode(data)
        except FrameLengthError as error:
            self.refused = error
            return
        values = {name: getattr(message, field) for name, field in self._fields.items()}
        for name, signal in self._signals.items():
            if name in values:
                signal.push(PdoValue(now, values[name]))
        self.push(PdoReading(now, values))

    def transmit(self, values: Mapping[str, Value]) -> None:
        """Send an RPDO with values for all that it maps, by name; the node acts on it when it is OPERATIONAL.

        Raises FieldError for a value that is missing, or that object or mapping do not allow; UnknownName, LocalError
        for a TPDO, BusError.
        """
        if self.direction is PdoDirection.TPDO:
            raise LocalError(f"{self.name} of node {self.node_id} is sent by the node")
        given = {self._fields[self._key(name)]: value for name, value in values.items()}
        absent = [name for name, field in self._fields.items() if field not in given]
        if absent:
            raise FieldError(self.name, absent[0], None, "every object that is mapped has a value")
        self._master.send(*self._binding.encode(self._binding.message(**given)))


class PdoSignal(BlockingStream[PdoValue]):
    """One object's values in a PDO: `last`, `wait`, `on`, and `for time, value in signal`."""

    @property
    def value(self) -> Any:
        """The last value, None before the first."""
        return self.last and self.last.value


class AsyncPdoSignal(AsyncStream[PdoValue]):
    """One object's values in a PDO: `last`, `wait`, `on`, and `async for time, value in signal`."""

    @property
    def value(self) -> Any:
        """The last value, None before the first."""
        return self.last and self.last.value


class RemotePdo(MappedPdo, BlockingStream[PdoReading]):
    """A PDO of a node: its readings as they come, its objects by name, and `transmit` for an RPDO."""

    def __getitem__(self, name: str) -> PdoSignal:
        """Return one object's values; raises UnknownName."""
        key = self._key(name)
        signal = self._signals.setdefault(key, PdoSignal(self._master, f"{key} in {self.name}", self.node_id))
        assert isinstance(signal, PdoSignal)
        return signal


class AsyncRemotePdo(MappedPdo, AsyncStream[PdoReading]):
    """A PDO of a node: its readings as they come, its objects by name, and `transmit` for an RPDO."""

    def __getitem__(self, name: str) -> AsyncPdoSignal:
        """Return one object's values; raises UnknownName."""
        key = self._key(name)
        signal = self._signals.setdefault(key, AsyncPdoSignal(self._master, f"{key} in {self.name}", self.node_id))
        assert isinstance(signal, AsyncPdoSignal)
        return signal


AnyPdo = TypeVar("AnyPdo", bound=MappedPdo)


class MappedPdos(Generic[AnyPdo]):
    """The PDOs of a node, as `TPDO1`, `RPDO2`, or by the names of their communication records."""

    def __init__(self, node: RemoteNode, dictionary: Dictionary | None, kind: type[AnyPdo]) -> None:
        self._node, self._kind = node, kind
        self._pdos: dict[str, AnyPdo] = {}
        self._made: dict[str, AnyPdo] = {}
        """All that were ever valid: a program that holds one keeps it while it is remapped."""
        self._records: dict[str, str] = {}
        self._refused: dict[int, MappingError] = {}
        self.dictionary = dictionary
        self._adopt()

    def _adopt(self) -> None:
        """Take over the mappings in the dictionary."""
        if self.dictionary is None:
            return
        refusals = list[MappingError]()
        found = {pdo.key: pdo for pdo in self.dictionary.read_pdos(self.dictionary.default, refusals.append)}
        self._refused = {each.index: each for each in refusals if each.index is not None}
        self._pdos = {}
        self._records = {plain_name(pdo.name): key for key, pdo in found.items()}
        for key, pdo in found.items():
            if pdo.valid:
                self._bind(key, pdo, self.dictionary)

    def _bind(self, key: str, pdo: Pdo, dictionary: Dictionary) -> None:
        try:
            binding = Binding(dictionary.file, pdo, key, None)
        except MappingError as error:
            self._refused[pdo.index] = error
            return
        if key not in self._made:
            self._made[key] = self._kind(self._node, key)
        self._made[key].adopt(binding)
        self._pdos = {**self._pdos, key: self._made[key]}

    def present(self, values: Mapping[Address, Value]) -> None:
        """Take over the present values of a node's PDO parameters."""
        if self.dictionary is not None and values:
            self.dictionary = self.dictionary.configured(values)
            self._adopt()

    def hear(self, cob_id: int, data: bytes, now: float) -> None:
        """Take in a frame, if it is one of the node's TPDOs."""
        for pdo in self._pdos.values():
            if pdo.cob_id == cob_id and pdo.direction is PdoDirection.TPDO:
                pdo.hear(data, now)

    def __getitem__(self, name: str) -> AnyPdo:
        """Return a PDO; raises UnknownName, also if it is switched off (its COB-ID is not valid)."""
        key = name.upper() if name.upper() in self._pdos else self._records.get(plain_name(name), name)
        if key in self._pdos:
            return self._pdos[key]
        for error in self._refused.values():
            raise error
        raise UnknownName(f"valid PDO of node {self._node.node_id}", name, self._pdos)

    def __iter__(self) -> Iterator[AnyPdo]:
        return iter([*self._pdos.values()])

    def __len__(self) -> int:
        return len(self._pdos)

    async def _read(self) -> None:
        if self.dictionary is not None:
            self.present(await pdo_parameters.steps(self._node, self.dictionary))


class RemotePdos(MappedPdos[RemotePdo]):
    """The PDOs of a node: `drive.pdo["TPDO1"]`."""

    def read(self) -> None:
        """Ask the node how its PDOs are mapped now; raises NoAnswer, RemoteError, BusError."""
        finished(self._read())


class AsyncRemotePdos(MappedPdos[AsyncRemotePdo]):
    """The PDOs of a node: `drive.pdo["TPDO1"]`."""

    async def read(self) -> None:
        """Ask the node how its PDOs are mapped now; raises NoAnswer, RemoteError, BusError."""
        await self._read()
