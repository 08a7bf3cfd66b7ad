"""Frames of other protocols, described by DBC files and other formats of cantools (KCD, SYM, ARXML).

Rule of this file: a frame of another protocol is not damage; what cannot be decoded stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.errors import FileError
from eurobot_od.frame import EXTENDED
from eurobot_od.od.formats import SUFFIXES
from eurobot_od.support import extras
from eurobot_od.traffic.services import Fields

if TYPE_CHECKING:
    from cantools.database.can import Message

    from eurobot_od.od.dictionary import Dictionary

DIGITS = 9
"""Decimal places of a value, to hide rounding errors (127 steps of 0.1 are 12.700000000000001)."""


NOBODY = "Vector__XXX"
"""Placeholder for an unknown node in a DBC file."""


class ForeignMessage(NamedTuple):
    """A message of a DBC file: its `name`, its senders, the units of its signals, and their decoder."""

    name: str
    nodes: tuple[str, ...]
    units: Mapping[str, str]
    fields: Callable[[bytes], Fields]

    def text(self, data: bytes) -> str:
        """Format the signals of a frame; the bytes without any."""
        return self.words(self.fields(data)) or data.hex(" ")

    def words(self, fields: Fields) -> str:
        """Format signals with their units."""
        return ", ".join(f"{name}={value} {self.units.get(name, '')}".rstrip() for name, value in fields.items())


FramesOfDevice: TypeAlias = "Callable[[Dictionary], Mapping[int, ForeignMessage]]"
"""Returns the messages that a device sends outside CANopen, by COB-ID."""


def only_canopen(_: Dictionary) -> Mapping[int, ForeignMessage]:
    """Return no messages, for devices that send only CANopen."""
    return {}


def read_dbc(files: Iterable[str]) -> dict[int, ForeignMessage]:
    """Return the messages of files by COB-ID, the first of each; raises LocalError without cantools, FileError."""
    found: dict[int, ForeignMessage] = {}
    for file in files:
        for message in _messages(file):
            cob_id = message.frame_id | EXTENDED * message.is_extended_frame
            units = {each.name: each.unit or "" for each in message.signals}
            nodes = tuple(each for each in message.senders if each != NOBODY)
            found.setdefault(cob_id, ForeignMessage(message.name, nodes, units, partial(_fields, message)))
    return found


def _messages(file: str) -> list[Message]:
    with extras.needed("dbc"):
        from cantools.database import load_file
    try:
        # `strict` would refuse overlapping signals, which are common.
        return list(getattr(load_file(file, strict=False), "messages", ()))
    except OSError:
        raise
    except Exception as error:  # cantools does not document what it raises for a damaged file
        words = " ".join(str(error).split())
        ours = "; a device's file is named by --eds" if Path(file).suffix.lower() in SUFFIXES else ""
        raise FileError(file, f"cantools cannot read it: {words}{ours}") from None


def _fields(message: Message, data: bytes) -> Fields:
    try:
        said: Any = message.decode(data, allow_truncated=True)
    except Exception:  # a value that selects no multiplexed signals, a frame that ends within a container
        return {}
    return {name: _plain(value) for name, value in said.items()} if isinstance(said, dict) else {}


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DIGITS)
    return value if isinstance(value, int) else str(value)
