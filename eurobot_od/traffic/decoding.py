"""Turns logs into lines of output, entry by entry, whatever the format of the log and of the output.

A frame has the meaning that the decoder keeps, and what only the frames before it tell: which transfer an SDO frame
belongs to, and that an answer to a guarding master is not a heartbeat. There is one `Following` for each log or bus.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, BinaryIO

from eurobot_od.device.nmt import TOGGLE
from eurobot_od.frame import Frame
from eurobot_od.traffic import formats, words
from eurobot_od.traffic.entries import LARGEST, REMEMBERED, Damage, Raw
from eurobot_od.traffic.filters import Wanted, Window
from eurobot_od.traffic.meaning import CANOPEN, DamageCounts, Decoder, Defect, Meaning, SdoTransfer
from eurobot_od.traffic.output import Output
from eurobot_od.traffic.services import GUARDING, HEARTBEAT, SDO
from eurobot_od.traffic.transfers import Transfers

FOLLOWED = (SDO, HEARTBEAT, GUARDING)
"""The services whose frames are understood by the ones before."""


def is_followed(meaning: Meaning) -> bool:
    """Whether the frames before may change what a frame means."""
    return meaning.group == CANOPEN and meaning.name in FOLLOWED and not meaning.defects


class Follower:
    """Takes the frames of FOLLOWED in their order."""

    def __init__(self, decoder: Decoder) -> None:
        self._decoder = decoder
        self._transfers = Transfers()
        self._asked: set[tuple[str, int]] = set()
        self._last: dict[tuple[str, int], Meaning] = {}

    def __call__(self, time: float, channel: str, meaning: Meaning) -> Meaning:
        """Return what a frame of a log's channel means after those before it; the time is in s."""
        frame = meaning.raw
        assert isinstance(frame, Frame)
        if meaning.name != SDO:
            return self._guarded(channel, frame, meaning)
        end = self._decoder.services[frame.cob_id].end
        if end is None or frame.is_remote:
            return meaning
        self._last[channel, end.channel] = meaning
        said = self._transfers.take(time, channel, end, frame.data)
        if not any(said):
            return meaning
        text = f"{meaning.nodes[0]}, {said.text}" if said.text else meaning.text
        defects = (Defect(Damage.INCOMPLETE, f"{meaning.raw}: {said.lost}"),) if said.lost else ()
        return meaning._replace(text=f"{text}{said.more}", defects=defects, transfer=said.ended)

    def unfinished(self) -> Iterator[tuple[Meaning, SdoTransfer]]:
        """Yield the transfers that the end of the log cuts off, each with the meaning of its last frame."""
        for key, transfer in self._transfers.unfinished():
            yield self._last[key], transfer

    def _guarded(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Name what a node answers to a remote frame: only by its toggle bit would it be told from a heartbeat."""
        key = channel, frame.cob_id
        if frame.is_remote:
            self._asked.add(key)
        elif key in self._asked or frame.data[0] & TOGGLE:
            self._asked.discard(key)
            text = f"{meaning.nodes[0]}, {words.guarding(frame.data)}"
            return meaning._replace(name=GUARDING, text=text)
        return meaning


class Following:
    """Decodes the entries of a log or of a bus in their order."""

    def __init__(self, decoder: Decoder) -> None:
        # Most frames on a bus are requests and confirms without data: their meaning is kept.
        self._decode = lru_cache(REMEMBERED)(decoder)
        self._follow = Follower(decoder)

    def __call__(self, time: float, channel: str, raw: Raw) -> Meaning:
        """Return what an entry means; the time is in s, the channel that of a log."""
        meaning = self._decode(raw)
        return self._follow(time, channel, meaning) if is_followed(meaning) else meaning


EVERYTHING = Window()


class Decoding:
    """What is asked for: the `output`, the entries `wanted` (None: all), their times; `damage` counts what is wrong."""

    def __init__(
        self, decoder: Decoder, output: Output, wanted: Wanted | None = None, window: Window = EVERYTHING
    ) -> None:
        self.damage = DamageCounts()
        self._output, self._window = output, window

        def row(meaning: Meaning) -> Any:
            return output.row(meaning) if wanted is None or wanted(meaning) else None

        # Most frames on a bus are requests and confirms without data: what is made from them is kept.
        @lru_cache(REMEMBERED)
        def known(raw: Raw) -> tuple[Any, tuple[Defect, ...], Meaning | None]:
            meaning = decoder(raw)
            return row(meaning), meaning.defects, meaning if is_followed(meaning) else None

        self._decoder, self._row, self._known = decoder, row, known

    def lines(self, file: BinaryIO, log: str, form: str | None = None, largest: int = LARGEST) -> Iterator[str]:
        """Yield the lines of output for an open log named `log`; errors as `formats.read`.

        What is wrong in the log is counted, whether it is wanted or not.
        """
        known, shown_time, write = self._known, self._window.clock(), self._output.writer(log)
        follow = Follower(self._decoder)
        for number, time, channel, raw in formats.read(file, form, largest):
            row, defects, followed = known(raw)
            if followed and (said := follow(time, channel, followed)) is not followed:
                row, defects = self._row(said), said.defects
            if defects:
                self.damage.add(log, number, defects)
            shown = shown_time(time)
            if row is not None and shown is not None:
                yield write(number, shown, channel, row)
        for last, transfer in follow.unfinished():
            if self._row(last) is not None:
                self._output.cut(transfer)
        if footer := self._output.footer():
            yield footer
