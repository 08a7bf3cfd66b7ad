"""What a page shows besides frames: events on the time line, and panels that only some networks have."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from eurobot_od.pdo.catalogue import Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.traffic.meaning import Meaning


class PageEvent(NamedTuple):
    """Something that happened at a `time` in seconds, or until `end`; a later one with the same `key` replaces it.

    `kind` is what kind of thing it is, `text` describes it, `mark` is a short sign for it, `wrong` tells whether it
    counts as trouble. `data` is for the script of the panel that made it.
    """

    key: str
    kind: str
    time: float
    text: str
    end: float | None = None
    mark: str = ""
    wrong: bool = False
    data: Mapping[str, Any] = {}


class Beside(NamedTuple):
    """What was not on the bus: events, and rows in the form of the page."""

    events: Sequence[PageEvent] = ()
    rows: Sequence[dict[str, Any]] = ()


NOTHING_BESIDE = Beside()


class Control(typing.Protocol):
    """What a panel may do on the bus when a message is sent from the page."""

    def send_message(self, message: Message) -> None:
        """Send a message; raises BusError."""

    def is_as_in_its_file(self, node: str) -> bool:
        """Tell whether a node has the revision number of its EDS; one that does not answer SDO is trusted."""


class Panel:
    """A view of the page for networks that have certain messages; one object follows one source.

    `script` and `style` are written into the page: the script calls `panel(name, make)`, see `files/page.js`. `stop` is
    the message of the button Stop, empty if that is left to NMT. `plan` is the message that carries out a plan, empty
    if there is none: Stop takes whoever sends it out of OPERATIONAL.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    script: ClassVar[str]
    style: ClassVar[str]
    stop: ClassVar[str] = ""
    plan: ClassVar[str] = ""

    @classmethod
    def fits(cls, protocol: Protocol) -> bool:
        """Tell whether a network has what the panel shows."""
        raise NotImplementedError

    @classmethod
    def of(cls, protocol: Protocol) -> type[Panel]:  # noqa: ARG003 (for those that override it)
        """Return the panel for a network that it fits."""
        return cls

    @classmethod
    def beside(cls, log: Path) -> Beside:  # noqa: ARG003 (for those that override it)
        """Return what is kept beside a log, with times from its first frame; raises LocalError for damage."""
        return NOTHING_BESIDE

    @classmethod
    def setup(cls) -> Mapping[str, Any]:
        """Return what the script needs to know."""
        return {}

    def take(self, time: float, message: Message) -> Iterable[PageEvent]:
        """Take in a message and return the events that are new or have changed."""
        raise NotImplementedError

    def objection(self, message: Message, control: Control) -> str:
        """Return why a message must not be sent from the page now, empty if it may be sent.

        It is called on another thread than `take`, and may wait for answers.
        """
        return ""


def service_events(number: int, time: float, meaning: Meaning) -> Iterator[PageEvent]:
    """Yield the event for a frame of CANopen's own services, if it is one; `number` makes keys unique."""
    is_event = meaning.name in ("NMT", "EMCY") or meaning.text.endswith(", boot-up")
    if is_event and meaning.message is None and not meaning.defects:
        kind = meaning.name if meaning.name in ("NMT", "EMCY") else "boot-up"
        cleared = meaning.text.partition(", ")[2].startswith("0x0000")
        node = meaning.nodes[0] if len(meaning.nodes) == 1 else ""
        wrong = kind == "EMCY" and not cleared
        yield PageEvent(f"{kind} {number}", kind, time, meaning.text, wrong=wrong, data={"node": node})
