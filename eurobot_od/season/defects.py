"""What is wrong with frames, all at once: unknown identifiers, wrong lengths, values out of range.

Rule of this file: a defect has the kind and the words that `logs.meaning.Decoder` has for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import polars as pl

from eurobot_od.frame import HIGHEST_IDENTIFIER
from eurobot_od.logs.entries import Damage
from eurobot_od.logs.services import CanopenService
from eurobot_od.pdo.binding import Binding
from eurobot_od.season.columns import LENGTH, flagged, readable

PLACE = ("line", "t", "channel")

HEX_DIGITS = {number: f"{number:03X}" for number in range(HIGHEST_IDENTIFIER + 1)}


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
    start, got = pl.lit(f"{binding.name} (0x{binding.cob_id:03X}): "), pl.col(LENGTH).cast(pl.String)
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


def of_others(frames: pl.DataFrame, services: Mapping[int, CanopenService]) -> Iterator[pl.DataFrame]:
    """Yield the defects of frames that are no message's: services of another length, and unknown identifiers."""
    known = pl.DataFrame(
        [(cob_id, each.name, each.length) for cob_id, each in services.items()],
        {"cob_id": pl.UInt16, "service": pl.String, "wanted": pl.Int64},
        orient="row",
    )
    joined = frames.join(known, on="cob_id", how="left", maintain_order="left")
    yield _defects(joined.filter(pl.col("service").is_null()), Damage.UNKNOWN_IDENTIFIER, FRAME)
    got, wanted = (pl.col(name).cast(pl.String) for name in (LENGTH, "wanted"))
    words = pl.col("service"), pl.lit(" "), FRAME, pl.lit(": "), got, pl.lit(" bytes of data, expected "), wanted
    wrong = joined.filter(pl.col("service").is_not_null() & (pl.col(LENGTH) != pl.col("wanted")))
    yield _defects(wrong, Damage.WRONG_LENGTH, pl.concat_str(*words))


FRAME = pl.concat_str(
    pl.col("cob_id").replace_strict(list(HEX_DIGITS), list(HEX_DIGITS.values()), return_dtype=pl.String),
    pl.lit("#"),
    pl.col("data").bin.encode("hex").str.to_uppercase(),
)
"""A frame as people write it: `008#D27423592C01C3A5`."""


def _defects(frames: pl.DataFrame, damage: Damage, text: pl.Expr) -> pl.DataFrame:
    return frames.select(*PLACE, pl.lit(damage.value).alias("kind"), text.alias("text"))
