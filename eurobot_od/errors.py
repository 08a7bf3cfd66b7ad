"""The one error tree: every error says what is wrong and where, in one line; only a YAML file's problems are several.

An error tells whose fault it is. Local errors are a caller's mistake, dictionary errors a file's, remote errors a
peer's; an exception outside this tree is a bug of ours.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, TypeVar

if TYPE_CHECKING:
    from pathlib import Path


T = TypeVar("T")

LONGEST_NAME = 100
"""Most characters of a name that are compared with others: the time for it grows with their square."""

ALIKE = 0.75
"""How much of two names has to be the same for one to be a slip of the other."""

SHORTEST_PART, MOST_LIKE = 3, 6
"""Least characters that are looked for within known names, and most names that are suggested."""

MOST_SHOWN = 700
"""Most characters of known names that are listed where none is like the unknown one: 200 faults would have more."""

LISTED_BY = {"fault": "; `faults` lists them", **dict.fromkeys(("object", "setting"), "; `show --objects` lists them")}
"""What shows all names of a kind of which there may be more."""


class EurobotError(Exception):
    """Base of all errors of this package; `str()` of it is one line for a person."""


# A caller's mistakes


class LocalError(EurobotError):
    """What the caller asked for cannot be done; nothing was sent."""


class UnknownName(LocalError):
    """A name that is not in its list: a message, a field, a dialect, a barrier."""

    def __init__(self, kind: str, name: object, known: Iterable[object] = ()) -> None:
        self.kind, self.name, self.known = kind, name, tuple(dict.fromkeys(map(str, known)))
        hint = f"; known: {', '.join(self.known)}" if self.known else ""
        if len(hint) > MOST_SHOWN:
            hint = f"; {len(self.known)} are known, and none is like it{LISTED_BY.get(kind, '')}"
        super().__init__(f"unknown {kind} {name!r}{meant(str(name), self.known) or hint}")


def look_up(kind: str, name: str, table: Mapping[str, T]) -> T:
    """Return what a table has under a name; raises UnknownName."""
    if name not in table:
        raise UnknownName(kind, name, table)
    return table[name]


def meant(written: str, known: Sequence[str], alike: float = ALIKE) -> str:
    """Return a question for the known names that somebody may have meant; `` if none is like what was written."""
    near = _like(written[:LONGEST_NAME], known, alike)
    more = f", or one of {len(near) - MOST_LIKE} more" if len(near) > MOST_LIKE else ""
    return f"; did you mean {' or '.join(near[:MOST_LIKE])}{more}?" if near else ""


def _like(written: str, known: Sequence[str], alike: float) -> list[str]:
    """Return the known names that somebody may have meant, once each, in any letter case, the likeliest first.

    That is the one that is the same but for its case; or else those that are spelled nearly so, or else after
    their last dot, and those with all words of what was written.
    """
    from difflib import get_close_matches  # not before it is needed: every command starts with this file

    wanted, *spelled = (each.lower().replace("_", " ") for each in (written, *known))
    lower = dict(zip(spelled, known))
    if wanted in lower:
        return [lower[wanted]]
    words = wanted.split() if len(wanted) >= SHORTEST_PART else []
    near = get_close_matches(wanted, lower, n=3, cutoff=alike)
    ends = get_close_matches(wanted, {each.rpartition(".")[2] for each in lower}, n=3, cutoff=alike)
    near = near or [each for each in lower if each.rpartition(".")[2] in ends]
    parts = (each for each in lower if words and all(word in each for word in words))
    return [lower[each] for each in dict.fromkeys([*near, *parts])]


class FieldError(LocalError):
    """A field value that cannot be sent: `message`, `field`, `value` and what is `allowed`."""

    def __init__(self, message: str, field: str, value: object, allowed: str) -> None:
        self.message, self.field, self.value, self.allowed = message, field, value, allowed
        try:
            shown = value.name.lower() if isinstance(value, Enum) else repr(value)
        except ValueError:  # an integer with more digits than Python writes
            shown = "a number of thousands of digits"
        super().__init__(f"{message}: {field} = {shown} is not allowed; allowed: {allowed}")


class ListenerError(LocalError):
    """A listener that cannot be registered; the text names it."""


class StateError(LocalError):
    """A call that does not fit the node's state, such as a goto after an emergency shutdown."""


class NodeClassError(LocalError):
    """A class of a node that cannot work: the `place` of the mistake, `file:line`, and what is wrong."""

    def __init__(self, place: str, what: str) -> None:
        self.place, self.what = place, what
        super().__init__(f"{place}: {what}")


class ProgramFailed(EurobotError):
    """A program that was run for somebody has hung, or has tried to end everything; the text says where."""


# A file's mistakes


class FileError(EurobotError):
    """A file that cannot be used: `file`, and `what` is wrong."""

    def __init__(self, file: str | Path, what: str) -> None:
        self.file, self.what = str(file), what
        super().__init__(f"{file}: {what}")


class YamlError(FileError):
    """YAML that cannot be used: all that is wrong with it, or several files, `file:line:column: what` for each."""

    def __init__(self, file: str | Path, problems: Iterable[str]) -> None:
        super().__init__(file, "\n".join(problems))
        self.args = (self.what,)


class DictionaryError(FileError):
    """An EDS or DCF that cannot be used: `file`, `index` (object dictionary index or None) and what is wrong."""

    def __init__(self, file: str | Path, index: int | None, what: str) -> None:
        super().__init__(file if index is None else f"{file}: 0x{index:04X}", what)
        self.file, self.index = str(file), index


class DamagedFile(DictionaryError):
    """A file that is not as it was written: its checksum is not that of what it holds."""


class MappingError(DictionaryError):
    """A PDO mapping that does not hold: object missing, over 64 bits, identifier used twice, wrong fields."""


# A peer's mistakes, and the wire's


class NamedObject(NamedTuple):
    """Which object of which node an error is about: node-ID, `address` (index, sub-index), and `name` if known."""

    node_id: int
    address: tuple[int, int]
    name: str = ""


class RemoteError(EurobotError):
    """What came from the bus is not what the protocol says."""


class UnknownIdentifier(RemoteError):
    """A frame whose COB-ID no PDO of the loaded dictionaries has."""

    def __init__(self, cob_id: int) -> None:
        self.cob_id = cob_id
        super().__init__(f"no message has the identifier {shown_identifier(cob_id)}")


def shown_identifier(cob_id: int) -> str:
    """Write an identifier as errors do, one of 29 bits without the bit that marks it."""
    return f"0x{cob_id & 0x1FFF_FFFF:03X}"


class FrameLengthError(RemoteError):
    """A frame too short for its mapping; it is refused whole (CiA 301, EMCY 0x8210)."""

    def __init__(self, message: str, cob_id: int, length: int, expected: str) -> None:
        self.message, self.cob_id, self.length, self.expected = message, cob_id, length, expected
        super().__init__(f"{message} ({shown_identifier(cob_id)}): {length} bytes of data, expected {expected}")


class NoAnswer(RemoteError):
    """A peer did not answer in its time: `request`, empty if nothing was asked, `answer` and how often was asked.

    `waited` is in seconds; `node_id` and `object` say of whom and what, None where it is of no one node or object.
    """

    def __init__(
        self,
        request: str,
        answer: str,
        attempts: int,
        waited: float,
        node_id: int | None = None,
        where: NamedObject | None = None,
    ) -> None:
        self.request, self.answer, self.attempts, self.waited = request, answer, attempts, waited
        self.node_id, self.object = node_id, where
        within = f"{waited * 1000:.0f} ms"
        after = f" after {request}" if request else ""
        asked = f"within {within}{after}" if attempts == 1 else f"after {attempts} x {request} ({within} each)"
        super().__init__(f"no {answer} {asked}")


class HeartbeatLost(NoAnswer):
    """No heartbeat of a node came in its time: `node_id`, and `waited` in seconds."""

    def __init__(self, node_id: int, waited: float) -> None:
        super().__init__("the last one", f"heartbeat of node {node_id}", 1, waited, node_id)


class WrongAnswer(RemoteError):
    """A node gave an answer that does not fit the `request`; `object` says which node and object."""

    def __init__(self, request: str, what: str, where: NamedObject) -> None:
        self.request, self.node_id, self.object = request, where.node_id, where
        super().__init__(f"node {where.node_id} gave an odd answer to {request}: {what}")


class Cause(Enum):
    """Why a node does not act on a message: the state it is in, or values that contradict each other."""

    STATE = "state"
    VALUES = "values"


class Refused(RemoteError):
    """A message that a node does not act on: the `cause`, and why in words."""

    def __init__(self, cause: Cause, why: str) -> None:
        self.cause = cause
        super().__init__(why)


class NodeRefused(RemoteError):
    """A node aborted an SDO transfer: `node_id`, `request`, abort `code` and `reason` (CiA 301, Table 22).

    `object` is the object concerned.
    """

    def __init__(self, node_id: int, request: str, code: int, reason: str, where: NamedObject | None = None) -> None:
        self.node_id, self.request, self.code, self.reason, self.object = node_id, request, code, reason, where
        super().__init__(f"node {node_id} refused to {request}: {reason} (0x{code:08X})")


class ConfigurationError(RemoteError):
    """A node that could not be configured; the text says what was written and in which state the node is.

    `written` are the objects that have their new values and are not stored, `left` those that still have their former
    ones, both as `0x1017:0 Producer heartbeat time`; everything is in `left` once it was taken back.
    """

    def __init__(self, text: str, written: Iterable[str] = (), left: Iterable[str] = ()) -> None:
        self.written, self.left = tuple(written), tuple(left)
        super().__init__(text)


class DriveError(RemoteError):
    """A drive (CiA 402) has a fault, or did not do in its time what it was commanded; the text says its state."""


class ProgramError(RemoteError):
    """A program that could not be downloaded into a node; the text says in which state the node is."""


class WorldError(RemoteError):
    """The world of a simulated robot, in another process, cannot be reached, or does not answer."""


# Ours


class NodeFailed(EurobotError):
    """A node that has raised an exception, its own or its hardware's, and was stopped and ended."""


class BusError(EurobotError):
    """The CAN bus, its driver or its configuration failed."""


class RobotWarning(UserWarning):
    """A robot is left out: it cannot be loaded, or only a file names it and it is not an installed one."""


class PackageWarning(RobotWarning):
    """What a device's maker brings is left out, or a part of it: it cannot be read or loaded, or does not fit."""


__all__ = [name for name, each in globals().items() if isinstance(each, type) and each.__module__ == __name__]
