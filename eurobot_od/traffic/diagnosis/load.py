"""Watches the load of a bus: the bits in a span of time, and their senders (ISO 11898-1).

To find the stuff bits of a frame takes longer than all else about it. So frames are kept until their span is over, and
counted as the longest of their length; only where that would be too much they are counted exactly.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from eurobot_od.bus import frame_bits, longest_frame
from eurobot_od.frame import EXTENDED, MOST_BYTES, Frame, identifier_text
from eurobot_od.od import values
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, Occurrences
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import DEFAULT_PDOS

ALL = 1.05
"""Load above which the assumed bit rate must be wrong; a tolerance over 1."""

MAIN = 0.3
"""Minimum share of the load from which one identifier is named as its cause."""

MOST = 1 << 15
"""Number of frames in a span that no bus can carry; such a log has no times."""

LONGEST = {
    is_extended: [longest_frame(length, is_extended) for length in range(MOST_BYTES + 1)]
    for is_extended in (False, True)
}
"""Maximum bits of a frame by kind of identifier (29 bits or not) and data length."""


@dataclass
class LoadSpan:
    """A span in which the load is judged: its length in `seconds`, and limits with their rules.

    The present one `began` at a time in s, where it was `seen`, and with which of the frames that are kept.
    """

    seconds: float
    limits: Sequence[tuple[float, BusRule]]
    began: float = 0.0
    seen: Occurrences = field(default_factory=Occurrences)
    first: int = 0


class BusLoad:
    """The load of a bus of `bit_rate` bit/s, next judged at `due`, in s."""

    def __init__(self, bus: ObservedBus, bit_rate: int) -> None:
        self._bus = bus
        self._bit_rate = bit_rate
        self.due = 0.0
        full = (ALL, BusRule.LOAD_HIGH), (0.9, BusRule.LOAD_FULL), (0.8, BusRule.LOAD_HIGH)
        self._spans = LoadSpan(1.0, full), LoadSpan(0.05, ((0.99, BusRule.LOAD_BURST),))
        self._frames: list[Frame] = []

    def take(self, frame: Frame) -> None:
        """Count a frame."""
        self._frames.append(frame)
        if len(self._frames) > MOST:
            self._drop(len(self._frames))

    def judge(self, time: float) -> None:
        """Compare the load of completed spans with their limits, at a time in s."""
        for span in self._spans:
            if time - span.began >= span.seconds:
                self._judge(span)
                self._begin(span, time)

    def restart(self, time: float) -> None:
        """Restart all spans after a gap."""
        for span in self._spans:
            self._begin(span, time)

    def _begin(self, span: LoadSpan, time: float) -> None:
        span.began = time
        span.seen = Occurrences.once(self._bus.at())
        span.first = len(self._frames)
        self._drop(min(each.first for each in self._spans))
        self.due = min(each.began + each.seconds for each in self._spans)

    def _drop(self, number: int) -> None:
        """Drop the first frames."""
        del self._frames[:number]
        for each in self._spans:
            each.first = max(each.first - number, 0)

    def _judge(self, span: LoadSpan) -> None:
        frames = self._frames[span.first :]
        (*_, (least, _)) = span.limits
        most = self._bit_rate * span.seconds
        if sum(LONGEST[frame[0] >= EXTENDED][len(frame[1])] for frame in frames) <= least * most:
            return
        bits = Counter[int]()
        for frame in frames:
            bits[frame[0]] += frame_bits(frame)
        share = sum(bits.values()) / most
        if rule := next((rule for limit, rule in span.limits if limit < share), None):
            wrong = "; more than all: the bus is faster, -b says its bit rate" if share > ALL else ""
            text = f"a load of {share:.0%} of {self._bit_rate / 1000:g} kbit/s{wrong}{self._culprit(frames, bits)}"
            self._bus.found(rule, "", text, seen=span.seen)

    def _culprit(self, frames: Sequence[Frame], bits: Mapping[int, int]) -> str:
        """Return text on the identifier that causes the load, empty if there are several."""
        cob_id = max(bits, key=bits.__getitem__)
        whole = sum(bits.values())
        if bits[cob_id] < MAIN * whole:
            return ""
        meaning = self._bus.decoder(next(each for each in frames if each.cob_id == cob_id))
        owner = values.owner(cob_id, DEFAULT_PDOS)
        guess = f"likely node {owner.node_id(cob_id)}" if owner and not meaning.nodes else ""
        name = ", ".join(filter(None, (meaning.name, meaning.sender or " ".join(meaning.nodes[:1]) or guess)))
        return f"; {bits[cob_id] / whole:.0%} of it is 0x{identifier_text(cob_id)}{f' ({name})' if name else ''}"
