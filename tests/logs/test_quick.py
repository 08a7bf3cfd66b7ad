"""The short way from a candump log to text gives what the long way gives, to the byte."""

from __future__ import annotations

import io
import random
from collections.abc import Iterator

import pytest

from eurobot_od import dialects
from eurobot_od.logs import formats
from eurobot_od.logs.filters import Window
from eurobot_od.logs.lines import IRREGULAR
from eurobot_od.logs.meaning import Decoder
from eurobot_od.logs.output import Text, showing, written
from eurobot_od.logs.quick import QuickRows
from eurobot_od.logs.tally import Tally
from eurobot_od.protocol import Binding, Protocol

FRAMES = 3_000


def random_lines(protocol: Protocol) -> Iterator[str]:
    """Yield lines with regular frames, spoilt ones, and some that are no frames of the protocol."""
    chance = random.Random(7)
    for number in range(FRAMES):
        binding = chance.choice(protocol.bindings)
        data = chance.choice((regular, random_bits, unknown, short))(binding, chance)
        identifier = f"{binding.cob_id:03X}" if chance.random() < 0.9 else f"{chance.getrandbits(11):03x}"
        text = f"({number / 7:.6f}) can{number % 2} {identifier}#{data.hex()}"
        yield text[: chance.choice((None, None, None, -1))] + "\n"


def regular(binding: Binding, chance: random.Random) -> bytes:
    return binding.pack({field: chance.randint(*limits) for field, limits in binding.limits.items()})


def random_bits(binding: Binding, chance: random.Random) -> bytes:
    return chance.randbytes(binding.layout.length)


def unknown(binding: Binding, chance: random.Random) -> bytes:
    values = {field: getattr(kind, "UNKNOWN", 0) for field, kind in binding.kinds.items() if field in binding.limits}
    return binding.pack(values | {field: chance.choice((0, value)) for field, value in values.items()})


def short(_: Binding, chance: random.Random) -> bytes:
    return bytes(chance.randint(0, 8))


@pytest.mark.parametrize("dialect", dialects.names())
def test_both_ways_write_and_count_the_same(dialect: str) -> None:
    decoder, output = Decoder(dialects.outlines(dialect)), Text()
    log = "".join(random_lines(decoder.protocol)).encode()
    found = []
    rows, long = QuickRows(decoder.protocol, output), showing(decoder, None, output)
    for show, quick in ((long, None), (long, rows.line), (rows.over(long), None), (rows.over(long), rows.line)):
        tally = Tally()
        entries = formats.read(io.BytesIO(log), show, "log", quick)
        found.append((list(written(entries, "x", output, tally, Window())), list(tally.report())))
    assert all(each == found[0] for each in found)
    assert len(found[0][0]) == FRAMES


@pytest.mark.parametrize("dialect", dialects.names())
def test_regular_frames_go_the_short_way(dialect: str) -> None:
    protocol, chance = Protocol.load(dialect), random.Random(1)
    quick = QuickRows(protocol, Text())
    for binding in protocol.bindings:
        values = {field: chance.randint(limits.low, min(limits.high, 300)) for field, limits in binding.limits.items()}
        row, findings = quick.line(f"{binding.cob_id:03X}#{binding.pack(values).hex()}".encode())
        assert str(row).startswith(binding.name)
        assert findings == ()


@pytest.mark.parametrize(
    "rest", [b"123#00", b"008#", b"008#XY", b"014#0", b"00C#00", b"008#FFFFFFFFFFFFFFFF", b"#", b""]
)
def test_other_frames_are_left_to_the_long_way(rest: bytes) -> None:
    with pytest.raises(IRREGULAR):
        QuickRows(Protocol.load(dialects.DEFAULT), Text()).line(rest)
