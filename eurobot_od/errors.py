"""The error tree: every error says in one line what is wrong and where; only a YAML file may have several lines.

Local errors are the caller's mistakes, dictionary errors a file's, remote errors a peer's; any other exception is a bug
of ours.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, TypeVar

if TYPE_CHECKING:
    from pathlib import Path


T = TypeVar("T")

LONGEST_NAME = 100
"""Maximum length of a name that is compared with others, as that takes quadratic time."""

ALIKE = 0.75
"""Minimum similarity of two names for one to be suggested for the other, from 0 to 1."""

SHORTEST_PART, MOST_LIKE = 3, 6
"""Minimum length of a part that is searched in known names, and maximum number of suggested names."""

MOST_SHOWN = 700
"""Maximum length of a list of known names in an error; longer ones are left out."""

LISTED_BY = {
    "fault": "; `faults` lists them",
    "rule": "; docs/lint-rules.md lists them",
    **dict.fromkeys(("object", "setting"), "; `show --objects` lists them"),
}
"""Commands that list all names, by the kind of name."""


class EurobotError(Exception):
    """Base of all errors of this package; its `str()` is one line."""


# A caller's mistakes


class LocalError(EurobotError):
    """A request that cannot be done; nothing was sent."""


class UnknownName(LocalError, KeyError):
    """A name that does not exist: of a message, field, dialect, barrier; a KeyError, as mappings raise."""

    __str__ = Exception.__str__  # a KeyError puts its text in quotes

    def __init__(self, kind: str, name: object, known: Iterable[object] = ()) -> None:
        self.kind = kind
        self.name = name
        self.known = tuple(dict.fromkeys(map(str, known)))
        hint = f"; known: {', '.join(self.known)}" if self.known else ""
        if len(hint) > MOST_SHOWN:
            hint = f"; {len(self.known)} are known, and none is like it{LISTED_BY.get(kind, '')}"
        super().__init__(f"unknown {kind} {name!r}{meant(str(name), self.known) or hint}")


def look_up(kind: str, name: str, table: Mapping[str, T]) -> T:
    """Return the value of a name in a table; raises UnknownName."""
    if name not in table:
        raise UnknownName(kind, name, table)
    return table[name]


def meant(written: str, known: Sequence[str], alike: float = ALIKE) -> str:
    """Return a question with the known names that are like the given one; empty if there are none."""
    near = _like(written[:LONGEST_NAME], known, alike)
    more = f", or one of {len(near) - MOST_LIKE} more" if len(near) > MOST_LIKE else ""
    return f"; did you mean {' or '.join(near[:MOST_LIKE])}{more}?" if near else ""


def _like(written: str, known: Sequence[str], alike: float) -> list[str]:
    """Return the known names that are like the given one, once each, ignoring case, the most similar first.

    A name that differs only in case; otherwise names that are similar, otherwise names whose last part is similar; and
    names that contain all its words.
    """
    from difflib import get_close_matches  # here, as every command imports this module

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
    """A field value that cannot be sent: `message`, `field`, `value` and the `allowed` values."""

    def __init__(self, message: str, field: str, value: object, allowed: str) -> None:
        self.message = message
        self.field = field
        self.value = value
        self.allowed = allowed
        try:
            shown = value.name.lower() if isinstance(value, Enum) else repr(value)
        except ValueError:  # an integer with more digits than Python converts
            shown = "a number of thousands of digits"
        super().__init__(f"{message}: {field} = {shown} is not allowed; allowed: {allowed}")


class ListenerError(LocalError):
    """A listener that cannot be registered; the text names it."""


class StateError(LocalError):
    """A call that is not allowed in the node's state, such as a goto after an emergency shutdown."""


class NodeClassError(LocalError):
    """A node class that cannot work: the `place` of the mistake, `file:line`, and what is wrong."""

    def __init__(self, place: str, what: str) -> None:
        self.place = place
        self.what = what
        super().__init__(f"{place}: {what}")


class ProgramFailed(EurobotError):
    """A user's program that hangs, or tried to end the process; the text says where."""


# A file's mistakes


class FileError(EurobotError):
    """A file that cannot be used: `file`, and `what` is wrong."""

    def __init__(self, file: str | Path, what: str) -> None:
        self.file = str(file)
        self.what = what
        super().__init__(f"{file}: {what}")


class YamlError(FileError):
    """YAML that cannot be used: all problems of one or more files, each as `file:line:column: what`."""

    def __init__(self, file: str | Path, problems: Iterable[str]) -> None:
        super().__init__(file, "\n".join(problems))
        self.args = (self.what,)


class DictionaryError(FileError):
    """An EDS or DCF that cannot be used: `file`, `index` (in the object dictionary, or None) and what is wrong."""

    def __init__(self, file: str | Path, index: int | None, what: str) -> None:
        super().__init__(file if index is None else f"{file}: 0x{index:04X}", what)
        self.file = str(file)
        self.index = index


class DamagedFile(DictionaryError):
    """A file whose checksum does not match its content."""


class MappingError(DictionaryError):
    """An invalid PDO mapping: object missing, over 64 bits, COB-ID used twice, wrong fields."""


# A peer's mistakes, and those of the bus


class NamedObject(NamedTuple):
    """The object that an error is about: node-ID, `address` (index, sub-index), and `name` if known."""

    node_id: int
    address: tuple[int, int]
    name: str = ""


class RemoteError(EurobotError):
    """A frame that violates the protocol, or is missing."""


class UnknownIdentifier(RemoteError):
    """A frame whose COB-ID belongs to no PDO of the loaded dictionaries."""

    def __init__(self, cob_id: int) -> None:
        self.cob_id = cob_id
        super().__init__(f"no message has the identifier {shown_identifier(cob_id)}")


def shown_identifier(cob_id: int) -> str:
    """Return a COB-ID as errors show it, without the bit that marks 29-bit identifiers."""
    return f"0x{cob_id & 0x1FFF_FFFF:03X}"


class FrameLengthError(RemoteError):
    """A frame too short for its mapping; it is refused as a whole (CiA 301, EMCY 0x8210)."""

    def __init__(self, message: str, cob_id: int, length: int, expected: str) -> None:
        self.message = message
        self.cob_id = cob_id
        self.length = length
        self.expected = expected
        super().__init__(f"{message} ({shown_identifier(cob_id)}): {length} bytes of data, expected {expected}")


class NoAnswer(RemoteError):
    """A peer did not answer in time: `request` (empty if none was sent), `answer` and the number of attempts.

    `waited` is in s; `node_id` and `object` are the node and object, or None.
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
        self.request = request
        self.answer = answer
        self.attempts = attempts
        self.waited = waited
        self.node_id = node_id
        self.object = where
        within = f"{round(waited * 1000, 1):g} ms"
        after = f" after {request}" if request else ""
        asked = f"within {within}{after}" if attempts == 1 else f"after {attempts} x {request} ({within} each)"
        super().__init__(f"no {answer} {asked}")


class HeartbeatLost(NoAnswer):
    """A node's heartbeat did not come in time: `node_id`, and `waited` in s."""

    def __init__(self, node_id: int, waited: float) -> None:
        super().__init__("the last one", f"heartbeat of node {node_id}", 1, waited, node_id)


class WrongAnswer(RemoteError):
    """A node's answer that does not fit the `request`; `object` says which node and object."""

    def __init__(self, request: str, what: str, where: NamedObject) -> None:
        self.request = request
        self.node_id = where.node_id
        self.object = where
        super().__init__(f"node {where.node_id} gave an odd answer to {request}: {what}")


class Cause(Enum):
    """Why a node does not act on a message: its state, or contradicting values."""

    STATE = "state"
    VALUES = "values"


class Refused(RemoteError):
    """A message that a node does not act on: the `cause`, and the reason as text."""

    def __init__(self, cause: Cause, why: str) -> None:
        self.cause = cause
        super().__init__(why)


class NodeRefused(RemoteError):
    """A node aborted an SDO transfer.

    It has `node_id`, `request`, the abort `code`, its `reason` (CiA 301, Table 22), and `object`.
    """

    def __init__(self, node_id: int, request: str, code: int, reason: str, where: NamedObject | None = None) -> None:
        self.node_id = node_id
        self.request = request
        self.code = code
        self.reason = reason
        self.object = where
        super().__init__(f"node {node_id} refused to {request}: {reason} (0x{code:08X})")


class ConfigurationError(RemoteError):
    """A node that could not be configured; the text says what was written, and the node's state.

    `written` are the objects with new values that are not stored, `left` those with their former values, both like
    `0x1017:0 Producer heartbeat time`. If everything was restored, all objects are in `left`.
    """

    def __init__(self, text: str, written: Iterable[str] = (), left: Iterable[str] = ()) -> None:
        self.written, self.left = tuple(written), tuple(left)
        super().__init__(text)


class DriveError(RemoteError):
    """A drive (CiA 402) with a fault, or one that did not follow a command in time; the text says its state."""


class ProgramError(RemoteError):
    """A program that could not be downloaded into a node; the text says the node's state."""


class WorldError(RemoteError):
    """The simulated robot's world, in another process, cannot be reached or does not answer."""


# Ours


class NodeFailed(EurobotError):
    """A node that raised an exception, its own or its hardware's, and was stopped."""


class BusError(EurobotError):
    """The CAN bus, its driver or its configuration failed."""


class RobotWarning(UserWarning):
    """A robot that is left out: it cannot be loaded, or only a file names it and it is not installed."""


class PackageWarning(RobotWarning):
    """A device package, or a part of it, that is left out: it cannot be read or loaded, or does not fit."""


__all__ = [name for name, each in globals().items() if isinstance(each, type) and each.__module__ == __name__]
