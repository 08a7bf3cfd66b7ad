"""Frames of other protocols on the same wire, named by DBC files and by what else cantools reads: KCD, SYM, ARXML.

Rule of this file: a frame of another protocol is not damage; what cannot be decoded stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.errors import FileError
from eurobot_od.frame import EXTENDED
from eurobot_od.support import extras
from eurobot_od.traffic.services import Fields

if TYPE_CHECKING:
    from cantools.database.can import Message

    from eurobot_od.od.dictionary import Dictionary

DIGITS = 9
"""Decimal places of a value: further ones come from its scale, 127 steps of 0.1 being 12.700000000000001."""


NOBODY = "Vector__XXX"
"""What a DBC names in place of a node that it does not know."""


class ForeignMessage(NamedTuple):
    """A message of a DBC: its `name`, the nodes that send it, its signals with their units, and what data says."""

    name: str
    nodes: tuple[str, ...]
    units: Mapping[str, str]
    fields: Callable[[bytes], Fields]

    def text(self, data: bytes) -> str:
        """Write the fields for a person; the bytes if there are none."""
        return self.words(self.fields(data)) or data.hex(" ")

    def words(self, fields: Fields) -> str:
        """Write fields for a person."""
        return ", ".join(f"{name}={value} {self.units.get(name, '')}".rstrip() for name, value in fields.items())


FramesOfDevice: TypeAlias = "Callable[[Dictionary], Mapping[int, ForeignMessage]]"
"""Returns what a device sends outside CANopen, by COB-ID."""


def only_canopen(_: Dictionary) -> Mapping[int, ForeignMessage]:
    """Return that a device sends nothing outside CANopen."""
    return {}


def read_dbc(files: Iterable[str]) -> dict[int, ForeignMessage]:
    """Return the messages of files by COB-ID, the first one of each; raises LocalError without cantools, FileError."""
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
        # With `strict` it refuses a file for signals that overlap, of which there are many.
        return list(getattr(load_file(file, strict=False), "messages", ()))
    except OSError:
        raise
    except Exception as error:  # what cantools raises for a damaged file is not documented: of five kinds at least
        words = " ".join(str(error).split())
        raise FileError(file, f"cantools cannot read it: {words}") from None


def _fields(message: Message, data: bytes) -> Fields:
    try:
        said: Any = message.decode(data, allow_truncated=True)
    except Exception:  # a value that selects no multiplexed signals, a frame that ends within a container
        return {}
    return {name: _plain(value) for name, value in said.items()} if isinstance(said, dict) else {}


def _plain(value: Any) -> Any:
    return round(value, DIGITS) if isinstance(value, float) else value if isinstance(value, int) else str(value)
