"""What is wrong with frames, all at once: unknown identifiers, wrong lengths, values out of range.

Rule of this file: a defect has the kind and the words that `logs.meaning.Decoder` has for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import polars as pl

from eurobot_od.logs.entries import MAX_COB_ID, Damage
from eurobot_od.logs.services import CanopenService
from eurobot_od.pdo.binding import Binding
from eurobot_od.season.columns import LENGTH, flagged, readable

PLACE = ("line", "t", "channel")

HEX_DIGITS = {number: f"{number:03X}" for number in range(MAX_COB_ID + 1)}


def of_message(frames: pl.DataFrame, binding: Binding) -> Iterator[pl.DataFrame]:
    """Yield the defects of one message's frames."""
    length = binding.layout.length
    expected = " or ".join(map(str, binding.lengths))
    start, got = f"{binding.name} (0x{binding.cob_id:03X}): ", pl.col(LENGTH).cast(pl.String)
    yield _defects(
        frames.filter(~readable(binding)),
        Damage.WRONG_LENGTH,
        pl.concat_str(pl.lit(start), got, pl.lit(f" bytes of data, expected {expected}")),
    )
    yield _defects(
        frames.filter(pl.col(LENGTH) > length),
        Damage.WRONG_LENGTH,
        pl.concat_str(pl.lit(start), got, pl.lit(f" bytes of data, expected {length}; read all the same")),
    )
    read = frames.filter(readable(binding))
    for field in binding.limits:
        raw = flagged(binding, field)
        if raw is not None:
            allowed = binding.kinds[field].allowed(binding.limits[field])
            wrong = read.with_columns(raw.alias("raw")).filter(pl.col("raw").is_not_null())
            words = (
                pl.lit(f"{binding.name}: {field} = "),
                pl.col("raw").cast(pl.String),
                pl.lit(f", allowed: {allowed}"),
            )
            yield _defects(wrong, Damage.OUT_OF_RANGE, pl.concat_str(*words))


def of_others(frames: pl.DataFrame, services: Mapping[int, CanopenService]) -> Iterator[pl.DataFrame]:
    """Yield the defects of frames that are no message's: services of another length, and identifiers of nothing."""
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
    pl.col("hex").str.to_uppercase(),
)
"""A frame as people write it: `008#D27423592C0D9702`."""


def _defects(frames: pl.DataFrame, damage: Damage, text: pl.Expr) -> pl.DataFrame:
    return frames.select(*PLACE, pl.lit(damage.value).alias("kind"), text.alias("text"))
