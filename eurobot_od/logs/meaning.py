"""What a frame means: a message of the protocol, a CANopen service, or damage.

Rule of this file: nothing raises, whatever the frame; what is wrong with it is part of its meaning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.errors import FrameLengthError, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.logs.raw import REMEMBERED, Damage, Foreign, Raw
from eurobot_od.od.outline import Outline
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.catalogue import NOTHING, Catalogue
from eurobot_od.pdo.kinds import Kind, OutOfRange
from eurobot_od.pdo.message import Message, flagged_fields
from eurobot_od.pdo.protocol import Protocol

if TYPE_CHECKING:
    from eurobot_od.logs.services import Service

CANOPEN = "CANopen"
"""The group of the services, as messages have theirs in the catalogue."""

NO_GROUP = ""


class Finding(NamedTuple):
    """One thing that is wrong with a frame, and what exactly."""

    damage: Damage
    text: str


class Meaning(NamedTuple):
    """What a frame means: message or service `name`, its `group`, the `nodes` that send or receive it, and in words.

    `message` is None for a service and for what could not be decoded. `name` is empty if nothing is known.
    """

    raw: Raw
    name: str
    group: str
    nodes: tuple[str, ...]
    message: Message | None
    text: str
    findings: tuple[Finding, ...] = ()


class Decoder:
    """Tells what frames mean, by the EDS files of the nodes on the bus and the catalogue of their messages."""

    def __init__(self, outlines: Iterable[Outline], catalogue: Catalogue = NOTHING) -> None:
        self.outlines = tuple(outlines)
        self.protocol = Protocol(((each, each.pdos) for each in self.outlines), catalogue)
        self._bindings = {each.cob_id: each for each in self.protocol.bindings}
        self._readers: dict[int, Callable[[Frame], Meaning]] = {}

    @cached_property
    def _services(self) -> Mapping[int, Service]:
        """The services by identifier; many a log has none of them."""
        from eurobot_od.logs.services import services

        return services(self.outlines, self.protocol.catalogue.errors)

    def __call__(self, raw: Raw) -> Meaning:
        """Tell what a frame means."""
        if isinstance(raw, Foreign):
            return Meaning(raw, "", NO_GROUP, (), None, raw.text, (Finding(raw.damage, raw.text),))
        read = self._readers.get(raw.cob_id) or self._reader(raw.cob_id)
        return read(raw)

    def _reader(self, cob_id: int) -> Callable[[Frame], Meaning]:
        """Return the function for an identifier, made when the first frame with it comes."""
        binding = self._bindings.get(cob_id)
        read = self._readers[cob_id] = _reader(binding, self.protocol) if binding else self._service
        return read

    def _service(self, frame: Frame) -> Meaning:
        found = self._services.get(frame.cob_id)
        if found is None:
            return Meaning(frame, "", NO_GROUP, (), None, str(frame), (Finding(Damage.UNKNOWN_IDENTIFIER, str(frame)),))
        nodes = (found.node,) if found.node else tuple(each.name for each in self.outlines)
        if len(frame.data) != found.length:
            text = f"{len(frame.data)} bytes of data, expected {found.length}"
            finding = Finding(Damage.WRONG_LENGTH, f"{found.name} {frame}: {text}")
            return Meaning(frame, found.name, CANOPEN, nodes, None, text, (finding,))
        text = ", ".join(filter(None, (found.node, found.text(frame.data))))
        return Meaning(frame, found.name, CANOPEN, nodes, None, text)


def _reader(binding: Binding, protocol: Protocol) -> Callable[[Frame], Meaning]:
    """Return the function that tells the meaning of one message's frames."""
    name, group = binding.name, binding.group
    nodes = (*binding.senders, *binding.receivers)
    length, decode, new = binding.layout.length, protocol.decode, tuple.__new__
    texts = [_field_text(field, kind) if field in binding.limits else None for field, kind in binding.kinds.items()]

    def read(frame: Frame) -> Meaning:
        try:
            message = decode(*frame)
        except FrameLengthError as error:
            return _too_short(frame, error)
        text = ", ".join([write(value) for write, value in zip(texts, message) if write])
        findings: tuple[Finding, ...] = ()
        if len(frame.data) > length or OutOfRange in map(type, message):
            findings = tuple(_findings(frame, message, binding))
        return new(Meaning, (frame, name, group, nodes, message, text, findings))

    def _too_short(frame: Frame, error: RemoteError) -> Meaning:
        return Meaning(frame, name, group, nodes, None, str(error), (Finding(Damage.WRONG_LENGTH, str(error)),))

    return read


def _field_text(field: str, kind: Kind) -> Callable[[Any], str]:
    """Return the function that writes a field's values."""
    return lru_cache(REMEMBERED)(lambda value: field_text(field, kind, value))


def field_text(field: str, kind: Kind, value: Any) -> str:
    """Write a field for a person: its name, its value and unit."""
    return f"{field}={kind.text(value)}"


def _findings(frame: Frame, message: Message, binding: Binding) -> Iterator[Finding]:
    if len(frame.data) > binding.layout.length:
        error = FrameLengthError(binding.name, frame.cob_id, len(frame.data), str(binding.layout.length))
        yield Finding(Damage.WRONG_LENGTH, f"{error}; read all the same")
    for field in flagged_fields(message):
        kind, limits = binding.kinds[field], binding.limits[field]
        yield Finding(
            Damage.OUT_OF_RANGE,
            f"{binding.name}: {field} = {int(getattr(message, field))}, allowed: {kind.allowed(limits)}",
        )
