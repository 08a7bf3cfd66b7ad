"""Converts logs of any format to batches of columns, and a message's frames to columns of its fields.

A batch has frames with line, time, channel, COB-ID and data, and separately everything that is no classic frame.
`traffic.formats` reads the logs. Memory holds a few batches, however long the log is.

A column has the values that `Protocol.decode` returns for each frame. A value that is not a plain number of the field's
unit (unknown, a code such as `blocked`, out of range) is null in the field's column. The column `FIELD_flag` then says
what it is: `unknown`, the code's word, or `out of range: ` and the raw value; it is null for a plain value.

A field is computed from the data, as one 64-bit word, by shifts and masks as its PDO is mapped. Polars has no shift, so
these are divisions and multiplications by powers of two.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial, reduce
from operator import add
from typing import BinaryIO, NamedTuple

import polars as pl
import pyarrow as pa
import pyarrow.compute as pc

from eurobot_od.errors import shown_identifier
from eurobot_od.frame import MOST_BYTES, identifier_text
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.codec import Run
from eurobot_od.pdo.kinds import UNKNOWN, ColumnForm
from eurobot_od.support.texts import first_free
from eurobot_od.traffic import formats
from eurobot_od.traffic.dbc import ForeignMessage
from eurobot_od.traffic.entries import Batch, Damage, Foreign, Raw
from eurobot_od.traffic.meaning import REWRITTEN, Unmapped
from eurobot_od.traffic.services import CanopenService

ROWS = 1 << 17
"""Approximate number of entries of a batch."""

AHEAD = 2
"""Number of batches made ahead, as the time to write one varies."""

ENTRY: Mapping[str, pl.DataType] = {"line": pl.UInt64(), "t": pl.Float64(), "channel": pl.Categorical()}
KINDS = {"remote": pl.Boolean(), "fd": pl.Boolean(), "brs": pl.Boolean()}
FRAMES = pl.Schema({**ENTRY, "cob_id": pl.UInt32(), "data": pl.Binary(), **KINDS})
FOREIGN = pl.Schema({**ENTRY, "kind": pl.String(), "text": pl.String()})
NOTHING = pl.DataFrame(schema=FOREIGN)


class ColumnBatch(NamedTuple):
    """Consecutive entries of a log: the `frames`, and the `foreign` entries that are no frames.

    `size` is the number of bytes of the log that were read for it, 0 if unknown.
    """

    frames: pl.DataFrame
    foreign: pl.DataFrame
    size: int = 0


def batches(file: BinaryIO, form: str | None = None) -> Iterator[ColumnBatch]:
    """Yield the batches of an open log, and make the next ones meanwhile; raises as `formats.batches`."""
    made = _joined(map(_columns, formats.batches(file, form)), file)
    with ThreadPoolExecutor(1) as thread:  # one, as the batches come from one generator
        coming = deque(thread.submit(next, made, None) for _ in range(AHEAD))
        while (batch := coming.popleft().result()) is not None:
            coming.append(thread.submit(next, made, None))
            yield batch


def _joined(parts: Iterator[ColumnBatch], file: BinaryIO) -> Iterator[ColumnBatch]:
    """Join small batches into batches of about ROWS entries."""
    taken = list[ColumnBatch]()
    rows = 0
    read = 0
    for part in parts:
        taken.append(part)
        rows += len(part.frames) + len(part.foreign)
        if rows >= ROWS:
            yield _one(taken, file.tell() - read)
            taken = []
            rows = 0
            read = file.tell()
    if taken:
        yield _one(taken, file.tell() - read)


def _one(parts: list[ColumnBatch], size: int) -> ColumnBatch:
    frames, foreign, _ = zip(*parts)
    return ColumnBatch(pl.concat(frames), pl.concat(foreign), size)


def _columns(batch: Batch) -> ColumnBatch:
    """Return the entries of a batch as tables."""
    heads = [head if head.__class__ is int else None for head in batch.heads]
    # Usually there is one channel, so its text is made once.
    channels = batch.channels[:1] if batch.is_of_one_channel else batch.channels
    place: tuple[Sequence[object], ...] = batch.lines, list(batch.times), channels
    columns = *place, heads, batch.data, [False], [False], [None]
    made = [pl.Series(name, each, FRAMES[name]) for name, each in zip(FRAMES, columns)]
    frames = pl.DataFrame([each if len(each) > 1 else each.new_from_index(0, len(heads)) for each in made])
    if None not in heads:
        return ColumnBatch(frames, NOTHING)
    others = [entry for entry, head in zip(batch.entries(), heads) if head is None]
    more = [(*place, *found) for *place, raw in others if (found := _odd_frame(raw))]
    foreign = [
        (*place, raw.damage.value, raw.text) for *place, raw in others if isinstance(raw, Foreign) and not raw.frame
    ]
    frames = pl.concat([frames.drop_nulls("cob_id"), pl.DataFrame(more, FRAMES, orient="row")])
    return ColumnBatch(frames.sort("line"), pl.DataFrame(foreign, FOREIGN, orient="row"))


def _odd_frame(raw: Raw) -> tuple[object, ...] | None:
    """Return the columns of a remote or CAN FD frame; None for an entry that is no frame."""
    if isinstance(raw, Foreign):
        return (*raw.frame, False, True, raw.has_bit_rate_switch) if raw.frame else None
    return raw.cob_id, raw.data, True, False, None


# The columns of a message


WORD, LENGTH = "word", "length"
"""Columns for expressions: the data as a little-endian integer, padded with zeros, and its length in bytes."""

FROM_DATA = (
    (pl.col("data") + bytes(8)).bin.head(8).bin.reinterpret(dtype=pl.UInt64).alias(WORD),
    pl.col("data").bin.size().alias(LENGTH),
)
"""The expressions of these columns."""

OUT_OF_RANGE = "out of range: "
"""Text of a flag before a raw value that is out of range."""

SIGNED = {8: pl.Int8, 16: pl.Int16, 32: pl.Int32, 64: pl.Int64}
"""Types of numbers; signed, as SQL raises an error for a negative difference of unsigned ones."""


REALS = {32: (pa.uint32(), pa.float32(), pl.Float32), 64: (pa.uint64(), pa.float64(), pl.Float64)}
"""Types of a floating-point number's bits and of the number, by its width."""


class FieldColumn(NamedTuple):
    """A column of a message's table: its name, its expression, and its description as texts."""

    name: str
    expression: pl.Expr
    metadata: Mapping[str, str]


def message_columns(binding: Binding, taken: Iterable[str]) -> list[FieldColumn]:
    """Return the columns of a message's mapped fields; `taken` are the names of other columns."""
    names = list(taken)
    columns: list[FieldColumn] = []
    for field in binding.limits:
        for column in _Field(binding, field).columns():
            columns.append(column._replace(name=first_free(column.name, names)))
            names.append(columns[-1].name)
    return columns


class ForeignColumns:
    """The columns of a message of another protocol: a number for each signal, and a word if it has one."""

    def __init__(self, message: ForeignMessage, taken: Iterable[str]) -> None:
        self._message = message
        self._names = dict[str, tuple[str, str]]()
        self.types = dict[str, pl.DataType]()
        self.metadata = dict[str, dict[str, str]]()
        names = list(taken)
        for signal, unit in message.units.items():
            number = first_free(signal, names)
            word = first_free(f"{signal}_flag", [*names, number])
            names += number, word
            self._names[signal] = number, word
            self.types |= {number: pl.Float64(), word: pl.String()}
            self.metadata[number] = {"null": f"see {word}"} | ({"unit": unit} if unit else {})
            self.metadata[word] = {"null": "a plain value, or a frame without it"}

    def rows(self, frames: pl.DataFrame) -> pl.DataFrame:
        """Return the frames with these columns added."""
        different = frames["data"].unique()  # most data repeat
        rows = [{"data": each} | self._row(each) for each in different]
        said = pl.DataFrame(rows, {"data": pl.Binary(), **self.types})
        return frames.join(said, on="data", how="left", maintain_order="left")

    def _row(self, data: bytes) -> dict[str, float | str]:
        row: dict[str, float | str] = {}
        for signal, value in self._message.fields(data).items():
            number, word = self._names[signal]
            if isinstance(value, (int, float)):
                row[number] = float(value)
            else:
                row[word] = str(value)
        return row


def readable(binding: Binding) -> pl.Expr:
    """Return the expression for whether a frame is long enough for its message."""
    is_longer = pl.lit(value=not binding.is_whole) | (pl.lit(value=binding.reads_longer) & _is_longer(binding))
    return pl.col(LENGTH).is_in(binding.lengths) | is_longer


def _is_longer(binding: Binding) -> pl.Expr:
    return pl.col(LENGTH) > binding.layout.length


def _has_field(binding: Binding, field: str) -> pl.Expr | None:
    """Return the expression for whether a frame surely has the field; None if every readable frame has."""
    if binding.is_whole:
        return None
    return pl.col(LENGTH).is_in([length for length in range(MOST_BYTES + 1) if field in binding.known_fields(length)])


class _Field:
    """One field of a message, with its expressions."""

    def __init__(self, binding: Binding, field: str) -> None:
        self.binding = binding
        self.field = field
        self.kind = binding.kinds[field]
        self.limits = binding.limits[field]
        self.raws = binding.layout.raws[field]
        self.raw = _raw(binding, field)
        self.whole = None
        self.known = _has_field(binding, field)
        unknown = binding.unknown
        if unknown is not None and field in unknown.codes:  # only all of these fields together mean "unknown"
            self.whole = pl.all_horizontal(*(_raw(binding, each) == code for each, code in unknown.codes.items()))

    def columns(self) -> Iterator[FieldColumn]:
        """Yield the column of the values, and one of flags if there can be any."""
        outside = self.outside()
        flags: list[pl.Expr] = [] if self.whole is None else [pl.when(self.whole).then(pl.lit(UNKNOWN))]
        flags += [] if self.known is None else [pl.when(~self.known).then(pl.lit(UNKNOWN))]
        flags += [pl.when(self.raw == raw).then(pl.lit(word)) for raw, word in self._codes().items()]
        flags += [] if outside is None else [pl.lit(OUT_OF_RANGE) + outside.cast(pl.String)]
        value = FORMS[self.kind.column_form](self)
        said = {"unit": self.kind.unit, "allowed": self.kind.allowed(self.limits)}
        said["null"] = f"see {self.field}_flag" if flags else "never"
        if self.whole is not None:
            value = pl.when(~self.whole).then(value)
        if self.known is not None:
            value = pl.when(self.known).then(value)
        yield FieldColumn(self.field, value, {key: text for key, text in said.items() if text})
        if flags:
            words = ", ".join([*self._codes().values(), f"{OUT_OF_RANGE}RAW VALUE"])
            yield FieldColumn(f"{self.field}_flag", pl.coalesce(flags), {"null": "a plain value", "words": words})

    def outside(self) -> pl.Expr | None:
        """Return the expression for a raw value that is out of range, null otherwise; None if it never is."""
        ranges = self._plain_ranges()
        # If every raw value is plain, a column of flags would only cost time and space.
        if sum(map(_count, ranges)) == _count(self.raws) or self.kind.column_form is ColumnForm.NOTHING:
            return None
        inside = [_between(self.raw, each) for each in ranges] + [self.raw == raw for raw in self._codes()]
        inside += [] if self.whole is None else [self.whole]
        inside += [] if self.known is None else [~self.known]
        return pl.when(~pl.any_horizontal(*inside)).then(self.raw)

    def _plain_ranges(self) -> list[range]:
        """Return the ranges of raw values that are plain values of the column."""
        form = self.kind.column_form
        if form is ColumnForm.WORD:
            return [range(raw, raw + 1) for raw in self.kind.named_values() if raw in self.raws]
        measured = self.kind.measured(self.limits)
        wanted = {
            ColumnForm.NUMBER: self.kind.numbers(self.limits),
            ColumnForm.SCALED: range(measured.low, measured.high + 1),
            ColumnForm.BOOLEAN: range(2),
        }.get(form, self.raws)
        return [range(max(wanted.start, self.raws.start), min(wanted.stop, self.raws.stop))]

    def _codes(self) -> dict[int, str]:
        """Return the words of the raw values that are no number."""
        if self.kind.column_form not in (ColumnForm.NUMBER, ColumnForm.SCALED):
            return {}
        (numbers,) = self._plain_ranges()
        named = self.kind.named_values().items()
        return {raw: word for raw, word in named if raw in self.raws and raw not in numbers}

    # Values

    def number(self) -> pl.Expr:
        """Return the expression for a plain raw value, in the smallest type for all of them."""
        (numbers,) = self._plain_ranges()
        fits = (
            type_
            for bits, type_ in SIGNED.items()
            if not numbers or (-1 << bits - 1 <= numbers.start and numbers.stop <= 1 << bits - 1)
        )
        value = pl.when(_between(self.raw, numbers)).then(self.raw)
        # The smallest type, as most fields have 8 to 16 bits, and a season has a billion of them.
        return value.cast(next(fits, pl.UInt64))  # the upper half of 64 unsigned bits fits no signed type

    def scaled(self) -> pl.Expr:
        """Return the expression for a plain value in the field's unit."""

        def divided(raws: pl.Series) -> pl.Series:
            # By Arrow, as Polars multiplies by 1 / 10: 3 steps of 0.1 would be 0.30000000000000004.
            scale = self.kind.scale
            return pl.Series(raws.name, pc.add(pc.divide(raws.to_arrow(), 1 / scale.factor), float(scale.offset)))

        return self.number().cast(pl.Float64).map_batches(divided, return_dtype=pl.Float64)

    def word(self) -> pl.Expr:
        """Return the expression for the words of the raw values."""
        # As categories, since texts would be most of the file.
        words = self.kind.named_values()
        return self.raw.replace_strict(list(words), list(words.values()), default=None, return_dtype=pl.String).cast(
            pl.Categorical
        )

    def boolean(self) -> pl.Expr:
        """Return the expression for whether the raw value is 1."""
        return pl.when(_between(self.raw, range(2))).then(self.raw == 1)

    def real(self) -> pl.Expr:
        """Return the expression for the floating-point number with these bits."""
        integer, real, type_ = REALS[self.binding.layout.widths[self.field]]

        def seen_as(raws: pl.Series) -> pl.Series:
            # By Arrow, which can view the same bits as another type; a cast would convert the number.
            return pl.Series(raws.name, raws.to_arrow().cast(integer).view(real))

        if not self.kind.scale.is_raw:
            return self.read(pl.Float64)
        return self.raw.map_batches(seen_as, return_dtype=type_)

    def read(self, type_: type[pl.DataType]) -> pl.Expr:
        """Return the expression for the values that the kind reads; it is called once per different raw value."""
        read = partial(self.kind.read, limits=self.limits)

        def values(raws: pl.Series) -> pl.Series:
            # A call in Python for each frame would be the slowest part; there are few different values.
            different = raws.unique().to_frame("raw").with_row_index()
            meanings = pl.Series([read(raw) for raw in different["raw"]], dtype=type_)
            return meanings.gather(raws.to_frame("raw").join(different, on="raw", maintain_order="left")["index"])

        return self.raw.map_batches(values, return_dtype=type_)


FORMS: Mapping[ColumnForm, Callable[[_Field], pl.Expr]] = {
    ColumnForm.NUMBER: _Field.number,
    ColumnForm.BITS: _Field.number,
    ColumnForm.SCALED: _Field.scaled,
    ColumnForm.BOOLEAN: _Field.boolean,
    ColumnForm.WORD: _Field.word,
    ColumnForm.REAL: _Field.real,
    ColumnForm.TEXT: lambda field: field.read(pl.String),
    ColumnForm.OCTETS: lambda field: field.read(pl.Binary),
    ColumnForm.NOTHING: lambda _: pl.lit(None, pl.Int64),
}


def _between(raw: pl.Expr, values: range) -> pl.Expr:
    return raw.is_between(values.start, values.stop - 1) if values else pl.lit(False)


def _count(values: range) -> int:
    return values.stop - values.start  # `len` is for ranges of less than 64 bits


# Raw values


def _raw(binding: Binding, field: str) -> pl.Expr:
    """Return the expression for a field's raw value; an optional field that a frame lacks has its default."""
    layout = binding.layout
    raw = reduce(add, map(_bits, layout.runs_in["little"][field]))
    if field in layout.signed:
        sign = layout.raws[field].stop  # flipping the sign bit and subtracting its weight extends the sign
        is_whole_word = layout.widths[field] == 64  # whose value a cast would refuse as too large
        raw = raw.reinterpret(signed=True) if is_whole_word else (raw.cast(pl.Int64) ^ sign) - sign
    if field not in binding.defaults:
        return raw
    default = binding.raw(field, binding.defaults[field])
    return pl.when(pl.col(LENGTH) < layout.length).then(default).otherwise(raw)


def _bits(run: Run) -> pl.Expr:
    """Return the expression for a run of bits, at their place in the value."""
    # Polars cannot shift a column, so this divides and multiplies by powers of two.
    down = pl.col(WORD) // (1 << run.offset) if run.offset else pl.col(WORD)
    bits = down & run.mask
    return bits * (1 << run.shift) if run.shift else bits


# Defects of frames, with the kinds and texts of `traffic.meaning.Decoder`


class Check(NamedTuple):
    """A possible defect of a frame: its kind, the condition, and its text."""

    damage: Damage
    is_so: pl.Expr
    text: pl.Expr


class MessageChecks:
    """The possible defects of the frames of one message."""

    def __init__(self, binding: Binding) -> None:
        self._checks = list(_checks(binding))
        self._any = [each.is_so.any().alias(str(number)) for number, each in enumerate(self._checks)]

    def defects(self, frames: pl.DataFrame) -> Iterator[pl.DataFrame]:
        """Yield the defects of the message's frames; one test finds out that there is none, as usual."""
        for check, found in zip(self._checks, frames.select(self._any).row(0)):
            if found:
                yield _defects(frames.filter(check.is_so), check.damage, check.text)


def _checks(binding: Binding) -> Iterator[Check]:
    expected = " or ".join(map(str, binding.lengths))
    start = pl.lit(f"{binding.name} ({shown_identifier(binding.cob_id)}): ")
    got = pl.col(LENGTH).cast(pl.String)
    if binding.is_whole:
        text = pl.concat_str(start, got, pl.lit(f" bytes of data, expected {expected}"))
        yield Check(Damage.WRONG_LENGTH, ~readable(binding), text)
        if binding.reads_longer:
            end = pl.lit(f" bytes of data, expected {binding.layout.length}; read all the same")
            yield Check(Damage.WRONG_LENGTH, _is_longer(binding), pl.concat_str(start, got, end))
    else:
        yield Check(Damage.UNKNOWN_MAPPING, pl.lit(value=True), pl.lit(f"{binding.name}: {REWRITTEN}"))
    for field in binding.limits:
        raw = _Field(binding, field).outside()
        if raw is not None:
            start = pl.lit(f"{binding.name}: {field} = ")
            allowed = pl.lit(f", allowed: {binding.kinds[field].allowed(binding.limits[field])}")
            text = pl.concat_str(start, raw.cast(pl.String), allowed)
            yield Check(Damage.OUT_OF_RANGE, readable(binding) & raw.is_not_null(), text)


def of_others(
    frames: pl.DataFrame, services: Mapping[int, CanopenService], messages: Container[int], others: Unmapped
) -> Iterator[pl.DataFrame]:
    """Yield the defects of frames without a message: services with a wrong length, and unknown COB-IDs."""
    for (cob_id,), some in frames.partition_by("cob_id", as_dict=True, maintain_order=True).items():
        number = int(cob_id)
        if number in services:
            yield _of_service(some, number, services[number])
            continue
        damage, why = others.defect(number)
        if damage is not None:
            # A remote frame with a message's COB-ID requests the message, and is no defect.
            asks = pl.col("remote") if number in messages else pl.lit(value=False)
            yield _defects(some.filter(~asks), damage, pl.concat_str(_frame(number), pl.lit(why)))


def _of_service(frames: pl.DataFrame, cob_id: int, service: CanopenService) -> pl.DataFrame:
    is_wrong = ~pl.col("remote") & ~pl.col(LENGTH).is_in(service.lengths) if service.lengths else pl.lit(value=False)
    end = pl.lit(f" bytes of data, expected {service.expected}")
    words = pl.lit(f"{service.name} "), _frame(cob_id), pl.lit(": "), pl.col(LENGTH).cast(pl.String), end
    return _defects(frames.filter(is_wrong), Damage.WRONG_LENGTH, pl.concat_str(*words))


def _frame(cob_id: int) -> pl.Expr:
    """Return the expression for a frame as candump shows it: `008#D27423592C01C3A5`, or `705#R1` for a remote one."""
    length = pl.when(pl.col(LENGTH) == 0).then(pl.lit("")).otherwise(pl.col(LENGTH).cast(pl.String))
    remote = pl.concat_str(pl.lit("R"), length)
    data = pl.col("data").bin.encode("hex").str.to_uppercase()
    return pl.concat_str(pl.lit(f"{identifier_text(cob_id)}#"), pl.when("remote").then(remote).otherwise(data))


def _defects(frames: pl.DataFrame, damage: Damage, text: pl.Expr) -> pl.DataFrame:
    return frames.select("run", *ENTRY, pl.lit(damage.value).alias("kind"), text.alias("text"))
