"""PDOs of a node of a `Network`, under this package's names and those of canopen.

`drive.pdo["TPDO1"]` and `drive.tpdo[1]` are the same PDO. What is set of it (`trans_type`, `enabled`, `add_variable`)
is kept until `save`, which writes it in the order of CiA 301 and reads it back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, overload

from canopen.objectdictionary import ODVariable
from canopen.variable import Bits

from eurobot_od.canopen_names import NamedAsInCanopen
from eurobot_od.client.configure import map_objects
from eurobot_od.client.master import PeriodicTask, finished
from eurobot_od.client.streams import BlockingStream, MappedPdos, PdoReading, PdoStream, PdoValue
from eurobot_od.errors import NoAnswer, UnknownName
from eurobot_od.export.dbc import text_of
from eurobot_od.export.description import described
from eurobot_od.od import objects, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import at, find_one
from eurobot_od.od.units import scale_of
from eurobot_od.od.values import COB_ID, PdoDirection, Value
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.files import write_whole

RECEPTION_WAIT = 10.0
"""Default timeout of `wait_for_reception`, in s."""


class PdoSignal(BlockingStream[PdoValue]):
    """Values of one object in a PDO: `last`, `wait`, `on`, and `for time, value in signal`.

    `od` is canopen's variable. Set `raw` or `phys` of one in an RPDO, then `transmit()` the PDO.
    """

    od = ODVariable("", 0)
    _given: Value = None

    @property
    def value(self) -> Any:
        """The last value, None before the first."""
        return self.last and self.last.value

    @property
    def raw(self) -> Any:
        """Raw value to be sent, or else of the last frame."""
        scale = scale_of(self.od)
        value = self.phys
        return value if scale.is_raw or not isinstance(value, (int, float)) else round(scale.raw(value))

    @raw.setter
    def raw(self, value: Value) -> None:
        self._given = objects.physical(self.od, value)

    @property
    def phys(self) -> Any:
        """Physical value to be sent, or else of the last frame."""
        return self.value if self._given is None else self._given

    @phys.setter
    def phys(self, value: float) -> None:
        self._given = value

    bits = property(Bits, doc="The bits of `raw` by number or range, as canopen has them; each may be set.")

    @property
    def index(self) -> int:
        """The index of the object."""
        return self.od.index

    @property
    def subindex(self) -> int:
        """The sub-index of the object."""
        return self.od.subindex


def _setting(sub: int, what: str) -> Any:
    """Return a property for a communication parameter; its value is None if the PDO does not have it."""

    def read(pdo: BlockingPdoStream) -> int | None:
        return pdo.setting(sub)

    def write(pdo: BlockingPdoStream, value: int) -> None:
        pdo.settings[sub] = value

    return property(read, write, doc=what)


class BlockingPdoStream(PdoStream, BlockingStream[PdoReading]):
    """A PDO of a node: its readings as they come, its objects by name, and `transmit` for an RPDO.

    What canopen calls a PdoMap: settings are written by `save`, `transmit()` without values sends those that were set.
    """

    trans_type = _setting(values.TRANSMISSION_TYPE, "The transmission type, 0..255.")
    inhibit_time = _setting(values.INHIBIT_TIME, "The least time between two of them, in 100 us.")
    event_timer = _setting(values.EVENT_TIMER, "The longest time between two of them, in ms; of an RPDO, its deadline.")
    _home: RemotePdos
    sync_start_value = _setting(values.SYNC_START, "The number of the SYNC with which it starts.")

    def __init__(self, *given: Any) -> None:
        self.settings: dict[int, int] = {}
        """Communication parameters that `save` writes, by sub-index."""
        super().__init__(*given)
        self._mapped: list[ODVariable] | None = None
        self._task: PeriodicTask | None = None

    def __getitem__(self, name: str | int) -> PdoSignal:
        """Return the values of one object by its name, index or position; raises UnknownName."""
        key = self._key(name)
        signal = self._signal(key, PdoSignal)
        signal.od = self._binding.objects[key].variable
        return signal

    # Reading and sending

    def transmit(self, values: Mapping[str, Value] | None = None) -> None:
        """Send an RPDO with values for all that it maps, by name, or with those that were set (0 for the others).

        The node acts on it when it is OPERATIONAL. Raises FieldError for a value that is missing, or that object or
        mapping do not allow; UnknownName, LocalError for a TPDO, BusError.
        """
        self._node.master.send(*self._frame(self._set_values() if values is None else values))

    def _set_values(self) -> dict[str, Value]:
        return {name: self[name].phys or 0 for name in self.names}

    def start(self, period: float) -> None:
        """Send the RPDO every `period` seconds with the present values; see `update`. Raises as `transmit`."""
        self.stop()
        self._task = PeriodicTask(self._node.master, [self._frame(self._set_values())], period)

    def update(self) -> None:
        """Send the present values from now on, if the RPDO was started."""
        if self._task is not None:
            self.start(self._task.period)

    def stop(self) -> None:
        """Stop the sending of `start`."""
        if self._task is not None:
            self._task.stop()
            self._task = None

    def wait_for_reception(self, timeout: float = RECEPTION_WAIT) -> float | None:
        """Wait for the next frame and return its time stamp; None after `timeout` seconds."""
        try:
            return self.wait(timeout).time
        except NoAnswer:
            return None

    def add_callback(self, function: Callable[[PdoAsHeard], object]) -> None:
        """Register a function that is called with this PDO each time that it has come; see `on`."""
        self.on(lambda _: function(PdoAsHeard(self)))

    @property
    def map(self) -> list[PdoSignal]:
        """The objects that it maps."""
        return [self[name] for name in self.names]

    def read(self, from_od: bool = False) -> None:
        """Ask the node how its PDOs are mapped now; raises as `RemotePdos.read`."""
        self._home.read(from_od)

    def remote_request(self) -> None:
        """Ask the node for it by a remote frame; raises BusError."""
        self._node.master.request(self.cob_id)

    @property
    def timestamp(self) -> float | None:
        """Time of the last frame, None before the first."""
        return self.last and self.last.time

    # Its parameters

    @property
    def records(self) -> values.PdoRecords:
        """Records of the PDO, as far as the master knows them."""
        return self._binding.pdo

    @property
    def _dictionary(self) -> Dictionary:
        assert self._home.dictionary is not None  # without it there are no PDOs
        return self._home.dictionary

    def setting(self, sub: int) -> int | None:
        """Return a communication parameter: the value to be written, or else the known one."""
        return self.settings.get(sub, self._dictionary.number((self.records.index, sub)))

    @property
    def enabled(self) -> bool:
        """Whether the PDO is valid."""
        wanted = self.settings.get(COB_ID)
        return self._binding.pdo.valid if wanted is None else not wanted & values.NOT_VALID

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        entry = self.setting(COB_ID) or self.cob_id
        self.settings[COB_ID] = entry & ~values.NOT_VALID if enabled else entry | values.NOT_VALID

    def clear(self) -> None:
        """Empty the mapping."""
        self._mapped = []

    def add_variable(self, name: str | int, member: str | int = 0) -> ODVariable:
        """Map an object by name or index, and member or sub-index; raises UnknownName, LocalError."""
        objects = self._dictionary.objects
        if isinstance(name, int):
            thing = at((name, int(member)), objects)
        else:
            thing = find_one(f"{name}.{member}" if isinstance(member, str) else name, objects)
        if self._mapped is None:
            self._mapped = [each.variable for each in self._binding.pdo.mapping]
        self._mapped.append(thing)
        return thing

    def save(self) -> None:
        """Write the changed settings in the order of CiA 301 and read them back; without changes do nothing.

        Raises LocalError for what cannot be mapped, ConfigurationError if the node then has something else, NodeRefused
        for a write that it refuses (the PDO is then off), NoAnswer, BusError.
        """
        if not self.settings and self._mapped is None:
            return
        written = map_objects(self._node, self._dictionary, self._binding.pdo, self._mapped, self.settings)
        self.settings = {}
        self._mapped = None
        self._home.present({address: int.from_bytes(data, "little") for address, data in written.items()})


class PdoAsHeard:
    """A PDO as canopen gives it to a function: iterating over it gives the objects that it maps."""

    def __init__(self, pdo: BlockingPdoStream) -> None:
        self._pdo = pdo

    def __getattr__(self, name: str) -> Any:
        return getattr(self._pdo, name)

    def __getitem__(self, name: str | int) -> PdoSignal:
        return self._pdo[name]

    def __iter__(self) -> Iterator[PdoSignal]:
        return iter(self._pdo.map)

    def __len__(self) -> int:
        return len(self._pdo.map)


class RemotePdos(MappedPdos[BlockingPdoStream], NamedAsInCanopen):
    """The PDOs of a node: `drive.pdo["TPDO1"]`; `tx` and `rx` are those of one direction, by number."""

    @property
    def tx(self) -> PdosOfDirection:
        """The TPDOs: `drive.tpdo`."""
        return PdosOfDirection(self, PdoDirection.TPDO)

    @property
    def rx(self) -> PdosOfDirection:
        """The RPDOs: `drive.rpdo`."""
        return PdosOfDirection(self, PdoDirection.RPDO)

    def __getitem__(self, name: str | int) -> BlockingPdoStream:
        """Return a PDO by name or by the index of a record; raises UnknownName, also for a disabled one."""
        valid = self._pdos.items()
        indices = {i: key for key, pdo in valid for i in (pdo.records.index, pdo.records.mapping_index)}
        if isinstance(name, int):
            name = indices.get(name, f"0x{name:04X}")
        return super().__getitem__(name)

    def of(self, direction: PdoDirection) -> dict[int, BlockingPdoStream]:
        """Return the PDOs of one direction by number, valid or not."""
        records = (pdo.records for pdo in self._made.values())
        return {each.number: self._made[each.key] for each in records if each.direction is direction}

    def read(self, from_od: bool = False) -> None:
        """Read the node's present PDO mapping; raises NoAnswer, RemoteError, BusError.

        With `from_od` nothing is asked: what the file says counts until the node has said something else.
        """
        if not from_od:
            finished(self._read())

    def save(self) -> None:
        """Save the changed PDOs; raises as `BlockingPdoStream.save`."""
        for pdo in self._made.values():
            pdo.save()

    def stop(self) -> None:
        """Stop those that were started."""
        for pdo in self._made.values():
            pdo.stop()

    @property
    def map(self) -> RemotePdos:
        """The same: `node.pdo.map[0x1A00]`."""
        return self


class PdosOfDirection(Mapping[int, BlockingPdoStream], NamedAsInCanopen):
    """The TPDOs or RPDOs of a node by number from 1 on, valid or not; by name, the objects that the valid ones map."""

    def __init__(self, pdos: RemotePdos, direction: PdoDirection) -> None:
        self._pdos, self._direction = pdos, direction
        self.read, self.save, self.stop = pdos.read, pdos.save, pdos.stop
        self.map = self

    @overload
    def __getitem__(self, key: int) -> BlockingPdoStream: ...

    @overload
    def __getitem__(self, key: str) -> PdoSignal: ...

    def __getitem__(self, key: int | str) -> BlockingPdoStream | PdoSignal:
        """Return a PDO by number, or the values of an object by name; raises UnknownName."""
        numbered = self._pdos.of(self._direction)
        if isinstance(key, int):
            if key not in numbered:
                raise UnknownName(self._direction.name, key, numbered)
            return numbered[key]
        for pdo in numbered.values():
            with suppress(UnknownName):
                return pdo[key]
        names = (name for pdo in numbered.values() for name in pdo.names)
        raise UnknownName(f"object of a {self._direction.name}", key, names)

    def __iter__(self) -> Iterator[int]:
        return iter(self._pdos.of(self._direction))

    def __len__(self) -> int:
        return len(self._pdos.of(self._direction))

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {', '.join(pdo.name for pdo in self.values())}>"

    def export(self, file: str | Path) -> None:
        """Write the valid PDOs to a DBC file; raises MappingError, LocalError, OSError."""
        assert self._pdos.dictionary is not None  # without it there are no PDOs
        dictionary = self._pdos.dictionary
        messages = described(Protocol([(dictionary, dictionary.pdos)]))
        sent = self._direction is PdoDirection.TPDO
        chosen = (each for each in messages if (each.senders if sent else each.receivers))
        write_whole(Path(file), text_of(chosen).encode())
