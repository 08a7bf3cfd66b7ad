"""Finds the identities of devices in a log, by their answers for 0x1000 and 0x1018, before decoding.

A scan stands at the beginning of many logs. What comes later is seen while decoding (`pdo.in_force`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import BinaryIO

from eurobot_od.od import standard
from eurobot_od.od.values import NODE_IDS, SDO_RESPONSE_BASE, Address
from eurobot_od.sdo.wire import LENGTH, Initiate
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import LARGEST, Batch

BEGINNING = 100_000
"""Maximum number of entries searched; all of them would take a third of the decoding time."""

ANSWERS = range(SDO_RESPONSE_BASE + NODE_IDS[0], SDO_RESPONSE_BASE + NODE_IDS[-1] + 1)
"""Predefined COB-IDs of SDO answers (CiA 301, 7.3.3)."""


def shown_in(file: BinaryIO, form: str | None = None, largest: int = LARGEST) -> dict[int, dict[Address, int]]:
    """Return the values of 0x1000 and 0x1018 that nodes show at the beginning of a log; errors as `formats.batches`."""
    shown: dict[int, dict[Address, int]] = {}
    for node_id, answer in _answers(_beginning(formats.batches(file, form, largest))):
        is_wanted = answer.address[0] == standard.IDENTITY or answer.address == standard.DEVICE_TYPE
        if is_wanted and answer.content is not None:
            # The first answer counts; a device exchanged later is noticed while decoding.
            numbers = shown.setdefault(node_id, {})
            numbers.setdefault(answer.address, int.from_bytes(answer.content, "little"))
    return shown


def _beginning(batches: Iterable[Batch]) -> Iterator[Batch]:
    seen = 0
    for batch in batches:
        yield batch
        seen += len(batch.heads)
        if seen >= BEGINNING:
            return


def _answers(batches: Iterable[Batch]) -> Iterator[tuple[int, Initiate]]:
    for batch in batches:
        for head, data in zip(batch.heads, batch.data):
            if head.__class__ is int and head in ANSWERS and len(data) == LENGTH:
                yield head - ANSWERS[0] + NODE_IDS[0], Initiate.of(data)
