"""The events on a bus besides its frames, for the page's list.

This module has no clock and no bus: the meanings of frames go in, with the time in seconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from eurobot_od.client.watch import Life
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import AXIS_STEP, MOST_AXES, STATUSWORD, State
from eurobot_od.od.values import Address
from eurobot_od.pdo.binding import Binding, Placed
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.monitor import NodeHealth
from eurobot_od.traffic.services import EMCY_NAME, object_words


class PageEvent(NamedTuple):
    """An event at a `time` in seconds, or until `end`; a later one with the same `key` replaces it.

    `kind` is the kind of event, `text` describes it, `mark` is a short sign for it, `wrong` tells whether it counts as
    trouble. `data` is for the script of the panel that made it.
    """

    key: str
    kind: str
    time: float
    text: str
    end: float | None = None
    mark: str = ""
    wrong: bool = False
    data: Mapping[str, Any] = {}


TROUBLE = (State.FAULT, State.FAULT_REACTION, State.QUICK_STOP)
"""States of a drive that count as trouble."""

STATUSWORDS = {(STATUSWORD + axis * AXIS_STEP, 0): axis + 1 for axis in range(MOST_AXES)}
"""The axis of each statusword."""


class BusEvents:
    """Makes events: NMT commands, EMCY, boot-ups, aborts of SDO transfers, states of drives, nodes lost and back."""

    def __init__(self, decoder: Decoder) -> None:
        self._lost: set[str] = set()
        self._drives: dict[tuple[str, int], State | None] = {}
        self.learn(decoder)

    def learn(self, decoder: Decoder) -> None:
        """Process the devices of a new decoder and the mapping of their PDOs."""
        self._nodes = {each.node_id: each for each in decoder.dictionaries}
        # Messages, and the statuswords in them; not by identifiers alone: what is damaged has none.
        self._carriers: dict[int | Damage, tuple[Binding, Sequence[Placed]]] = {
            each.cob_id: (each, [word for word in each.placed if word.address in STATUSWORDS])
            for each in decoder.protocol.bindings
            if each.senders
        }

    def take(self, number: int, time: float, meaning: Meaning) -> Iterator[PageEvent]:
        """Yield the events of a frame, which is the `number`-th."""
        if meaning.message is None:
            yield from _service(number, time, meaning)
            yield from self._transfer(number, time, meaning)
            return
        raw = meaning.raw
        carrier = self._carriers.get(meaning.raw[0])
        # A device that was remapped since has another type of message.
        if carrier and isinstance(raw, Frame) and type(meaning.message) is carrier[0].type:
            frame = int.from_bytes(raw.data, "little")
            for each in carrier[1]:
                yield from self._drive(number, time, meaning.sender, each.address, frame >> each.offset & each.mask)

    def _transfer(self, number: int, time: float, meaning: Meaning) -> Iterator[PageEvent]:
        ended = meaning.transfer
        if ended is None or ended.end is None or ended.address is None:
            return
        dictionary = self._nodes.get(ended.end.server)
        node = dictionary.name if dictionary else f"node {ended.end.server}"
        if ended.aborted is not None:
            words = f"{node}, {object_words(dictionary, ended.address)}: {code_and_reason(ended.aborted)}"
            yield PageEvent(f"abort {number}", "abort", time, words, wrong=True, data={"node": node})
        elif ended.is_upload and ended.content:
            value = int.from_bytes(ended.content[:2], "little")
            yield from self._drive(number, time, node, ended.address, value)

    def _drive(self, number: int, time: float, node: str, address: Address, value: int) -> Iterator[PageEvent]:
        """Yield the change of a drive's state, if its statusword shows one."""
        axis = STATUSWORDS.get(address)
        if axis is None:
            return
        state = cia402.state_of(value)
        key = (node, axis)
        if key in self._drives and self._drives[key] is not state:
            words = f"{node}{f', axis {axis}' if axis > 1 else ''}: {state.words if state else 'no state'}"
            yield PageEvent(f"drive {number} {axis}", "drive", time, words, wrong=state in TROUBLE, data={"node": node})
        self._drives[key] = state

    def look(self, time: float, nodes: Mapping[str, NodeHealth]) -> Iterator[PageEvent]:
        """Yield the nodes lost or back since the last call."""
        for name, node in nodes.items():
            lost = node.pulse.life(time) is Life.LOST
            if lost is (name in self._lost):
                continue
            (self._lost.add if lost else self._lost.discard)(name)
            when = node.pulse.deadline if lost else node.pulse.heard or time
            kind = "lost" if lost else "back"
            yield PageEvent(f"{kind} {name} {when}", kind, when, f"{name} is {kind}", wrong=lost, data={"node": name})


def _service(number: int, time: float, meaning: Meaning) -> Iterator[PageEvent]:
    """Yield the event of a frame of CANopen's own services, if it is one; `number` makes keys unique."""
    is_event = meaning.name in ("NMT", EMCY_NAME) or meaning.text.endswith(", boot-up")
    if is_event and not meaning.defects:
        kind = meaning.name if meaning.name in ("NMT", EMCY_NAME) else "boot-up"
        cleared = meaning.text.partition(", ")[2].startswith("0x0000")
        node = meaning.nodes[0] if len(meaning.nodes) == 1 else ""
        text = f"{node}: error cleared" if kind == EMCY_NAME and cleared else meaning.text
        wrong = kind == EMCY_NAME and not cleared
        yield PageEvent(f"{kind} {number}", kind, time, text, wrong=wrong, data={"node": node})
