"""What is wrong with frames, all at once: unknown identifiers, wrong lengths, values out of range.

Rule of this file: a defect has the kind and the words that `logs.meaning.Decoder` has for it.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import NamedTuple

import polars as pl

from eurobot_od.errors import shown_identifier
from eurobot_od.frame import identifier_text
from eurobot_od.pdo.binding import Binding
from eurobot_od.season.columns import LENGTH, flagged, readable
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.services import CanopenService
from eurobot_od.traffic.unmapped import Unmapped

PLACE = ("line", "t", "channel")


class Check(NamedTuple):
    """A possible defect of a frame: its kind, the condition, and the words for it."""

    damage: Damage
    is_so: pl.Expr
    text: pl.Expr


class MessageChecks:
    """The possible defects of the frames of one message."""

    def __init__(self, binding: Binding) -> None:
        self._checks = list(_checks(binding))
        self._any = [each.is_so.any().alias(str(number)) for number, each in enumerate(self._checks)]

    def defects(self, frames: pl.DataFrame) -> Iterator[pl.DataFrame]:
        """Yield the defects of the message's frames; nearly always there is none, which one test shows."""
        for check, found in zip(self._checks, frames.select(self._any).row(0)):
            if found:
                yield _defects(frames.filter(check.is_so), check.damage, check.text)


def _checks(binding: Binding) -> Iterator[Check]:
    length = binding.layout.length
    expected = " or ".join(map(str, binding.lengths))
    start, got = pl.lit(f"{binding.name} ({shown_identifier(binding.cob_id)}): "), pl.col(LENGTH).cast(pl.String)
    for is_so, end in (
        (~readable(binding), expected),
        (pl.col(LENGTH) > length, f"{length}; read all the same"),
    ):
        text = pl.concat_str(start, got, pl.lit(f" bytes of data, expected {end}"))
        yield Check(Damage.WRONG_LENGTH, is_so, text)
    for field in binding.limits:
        raw = flagged(binding, field)
        if raw is not None:
            start = pl.lit(f"{binding.name}: {field} = ")
            allowed = pl.lit(f", allowed: {binding.kinds[field].allowed(binding.limits[field])}")
            text = pl.concat_str(start, raw.cast(pl.String), allowed)
            yield Check(Damage.OUT_OF_RANGE, readable(binding) & raw.is_not_null(), text)


def of_others(
    frames: pl.DataFrame, services: Mapping[int, CanopenService], messages: Container[int], others: Unmapped
) -> Iterator[pl.DataFrame]:
    """Yield the defects of frames that belong to no message: services of another length, and identifiers of none."""
    for (cob_id,), some in frames.partition_by("cob_id", as_dict=True, maintain_order=True).items():
        number = int(cob_id)
        if number in services:
            yield _of_service(some, number, services[number])
            continue
        damage, why = others.defect(number)
        if damage is not None:
            # A remote frame of a message's identifier asks for the message, and is nobody's defect.
            asks = pl.col("remote") if number in messages else pl.lit(value=False)
            yield _defects(some.filter(~asks), damage, pl.concat_str(_frame(number), pl.lit(why)))


def _of_service(frames: pl.DataFrame, cob_id: int, service: CanopenService) -> pl.DataFrame:
    is_wrong = ~pl.col("remote") & ~pl.col(LENGTH).is_in(service.lengths) if service.lengths else pl.lit(value=False)
    end = pl.lit(f" bytes of data, expected {service.expected}")
    words = pl.lit(f"{service.name} "), _frame(cob_id), pl.lit(": "), pl.col(LENGTH).cast(pl.String), end
    return _defects(frames.filter(is_wrong), Damage.WRONG_LENGTH, pl.concat_str(*words))


def _frame(cob_id: int) -> pl.Expr:
    """Write a frame as people do: `008#D27423592C01C3A5`, or `705#R1` for a remote one."""
    length = pl.when(pl.col(LENGTH) == 0).then(pl.lit("")).otherwise(pl.col(LENGTH).cast(pl.String))
    remote, data = pl.concat_str(pl.lit("R"), length), pl.col("data").bin.encode("hex").str.to_uppercase()
    return pl.concat_str(pl.lit(f"{identifier_text(cob_id)}#"), pl.when("remote").then(remote).otherwise(data))


def _defects(frames: pl.DataFrame, damage: Damage, text: pl.Expr) -> pl.DataFrame:
    return frames.select(*PLACE, pl.lit(damage.value).alias("kind"), text.alias("text"))
