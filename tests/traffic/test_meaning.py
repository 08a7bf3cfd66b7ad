"""What frames mean: messages as the protocol decodes them, and damage by its name."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from eurobot_od.frame import Frame
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import describe, flagged_fields
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.traffic.meaning import Decoder
from tests.kit import plant
from tests.kit.plant import messages as m

POSITION = m.PlaceResponse(1200, 900, 90, m.Source.ENCODER)


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return plant.decoder()


def test_a_message(decoder: Decoder) -> None:
    frame = decoder.protocol.encode(POSITION)
    meaning = decoder(frame)
    assert meaning.raw == frame
    assert meaning.message == POSITION
    assert meaning.text == describe(POSITION, decoder.protocol.binding(type(POSITION)).kinds)
    assert (meaning.name, meaning.group, meaning.nodes) == ("Place Response", "PLACES", ("lift", "panel"))
    assert meaning.defects == ()


@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_fields_that_the_dialect_does_not_map_are_not_in_the_words(dialect: str) -> None:
    decoder = plant.decoder(dialect)
    meaning = decoder(decoder.protocol.encode(m.MoveTo(1, 2, 3, 4, 0)))
    assert ("direction" in meaning.text) is ("direction" in decoder.protocol.binding(m.MoveTo).limits)


def move(protocol: Protocol, **values: int) -> bytes:
    return protocol.pack("Move To", **({"x": 1, "y": 2, "angle": 3, "speed": 4} | values))


DAMAGED: list[tuple[str, Callable[[Protocol], Raw], list[tuple[Damage, str]], bool]] = [
    ("unknown", lambda _: Frame(0x123, b"\1"), [(Damage.UNKNOWN_IDENTIFIER, "123#01")], False),
    ("nobody's", lambda _: Frame(0x7FE), [(Damage.UNKNOWN_IDENTIFIER, "7FE#")], False),
    (
        "too short",
        lambda p: Frame(0x202, move(p)[:3]),
        [(Damage.WRONG_LENGTH, "3 bytes of data, expected 6 or 8")],
        False,
    ),
    ("too long", lambda _: Frame(0x282, bytes(4)), [(Damage.WRONG_LENGTH, "4 bytes of data, expected 3; read")], True),
    (
        "out of range",
        lambda p: Frame(0x202, move(p, x=3001)),
        [(Damage.OUT_OF_RANGE, "x = 3001, allowed: 0..3000 mm")],
        True,
    ),
    (
        "out of range, and as short as it may be",
        lambda p: Frame(0x202, move(p, x=3001)[:6]),
        [(Damage.OUT_OF_RANGE, "x = 3001, allowed: 0..3000 mm")],
        True,
    ),
    (
        "out of range twice",
        lambda p: Frame(0x202, move(p, speed=101, angle=360)),
        [(Damage.OUT_OF_RANGE, "angle = 360"), (Damage.OUT_OF_RANGE, "speed = 101, allowed: 0..100 %")],
        True,
    ),
    ("error", lambda _: Foreign(Damage.ERROR_FRAME, "20000080#"), [(Damage.ERROR_FRAME, "20000080#")], False),
    (
        "no data where there is some",
        lambda _: Frame(0x382),
        [(Damage.WRONG_LENGTH, "0 bytes of data, expected 5")],
        False,
    ),
]


@pytest.mark.parametrize(("raw", "defects", "read"), [row[1:] for row in DAMAGED], ids=[row[0] for row in DAMAGED])
def test_damage(
    decoder: Decoder, raw: Callable[[Protocol], Raw], defects: list[tuple[Damage, str]], read: bool
) -> None:
    meaning = decoder(raw(decoder.protocol))
    assert [found.damage for found in meaning.defects] == [damage for damage, _ in defects]
    assert all(text in found.text for found, (_, text) in zip(meaning.defects, defects))
    assert (meaning.message is not None) is read


def regular(binding: Binding, chance: random.Random) -> bytes:
    return binding.pack({field: chance.randint(*limits) for field, limits in binding.limits.items()})


def any_bits(binding: Binding, chance: random.Random) -> bytes:
    return chance.randbytes(binding.layout.length)


def unknown(binding: Binding, chance: random.Random) -> bytes:
    values = {field: getattr(kind, "UNKNOWN", 0) for field, kind in binding.kinds.items() if field in binding.limits}
    return binding.pack({field: chance.choice((0, value)) for field, value in values.items()})


@pytest.mark.parametrize("make", [regular, any_bits, unknown])
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_every_field_is_written_as_its_kind_writes_it(
    dialect: str, make: Callable[[Binding, random.Random], bytes]
) -> None:
    decoder, chance = plant.decoder(dialect), random.Random(7)
    for binding in decoder.protocol.bindings:
        for _ in range(30):
            meaning = decoder(Frame(binding.cob_id, make(binding, chance)))
            assert meaning.message is not None
            values = {field: getattr(meaning.message, field) for field in binding.kinds if field in binding.limits}
            assert meaning.text == ", ".join(f"{f}={binding.kinds[f].text(value)}" for f, value in values.items())
            assert len(meaning.defects) == len(flagged_fields(meaning.message))
