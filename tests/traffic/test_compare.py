"""Two logs: exactly what was done to the second is found, and nothing else."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from eurobot_od.frame import Frame
from eurobot_od.traffic.compare import Difference, DifferenceKind, Tolerances, compare
from eurobot_od.traffic.entries import Damage, Foreign, Raw, Timed
from tests.kit import plant
from tests.kit.plant import messages as m

DECODER = plant.decoder()
ENCODE = DECODER.protocol.encode
EXACT = Tolerances()


@pytest.fixture(scope="module")
def shift() -> list[Timed]:
    return plant.shift()


def kinds(differences: list[Difference]) -> list[tuple[DifferenceKind, str]]:
    return [(each.kind, each.name) for each in differences]


def position(x: int, angle: int = 0) -> Frame:
    return ENCODE(m.PlaceResponse(x, 500, angle, m.Source.ENCODER))


def places(frames: list[Timed], message: type) -> list[int]:
    cob_id = DECODER.protocol.cob_id(message)
    return [place for place, (_, raw) in enumerate(frames) if raw[0] == cob_id]


def test_a_log_and_itself_do_not_differ(shift: list[Timed]) -> None:
    assert compare(shift, shift, DECODER, EXACT) == []


def test_one_removed_one_late_and_one_changed_are_exactly_these_three(shift: list[Timed]) -> None:
    removed = places(shift, m.WeightRequest)[10]
    late = places(shift, m.MoveStateResponse)[30]
    changed = places(shift, m.PlaceResponse)[20]
    other = list(shift)
    time, raw = other[late]
    other[late] = time + 0.02, raw
    time, raw = other[changed]
    other[changed] = time, ENCODE(DECODER.protocol.decode(*raw)._replace(x=7))
    del other[removed]
    begin = shift[0][0]
    found = compare(shift, other, DECODER, EXACT)
    assert sorted(kinds(found), key=str) == sorted(
        [
            (DifferenceKind.MISSING, "Weight Request"),
            (DifferenceKind.LATE, "Move State Response"),
            (DifferenceKind.CHANGED, "Place Response"),
        ],
        key=str,
    )
    times = {each.kind: each.time for each in found}
    assert times[DifferenceKind.MISSING] == pytest.approx(shift[removed][0] - begin)
    assert times[DifferenceKind.LATE] == pytest.approx(shift[late][0] - begin)
    assert times[DifferenceKind.CHANGED] == pytest.approx(shift[changed][0] - begin)


@pytest.mark.parametrize("number", [0, 1, 100, -1])
def test_any_frame_may_be_missing(shift: list[Timed], number: int) -> None:
    other = list(shift)
    del other[number]
    (found,) = compare(shift, other, DECODER, EXACT)
    assert found.kind is DifferenceKind.MISSING
    (extra,) = compare(other, shift, DECODER, EXACT)
    assert (extra.kind, extra.name) == (DifferenceKind.EXTRA, found.name)


def test_recordings_may_begin_at_any_time(shift: list[Timed]) -> None:
    assert compare(shift, [(time + 1e6, raw) for time, raw in shift], DECODER, EXACT) == []


ROW: list[Timed] = [(number / 10, position(1000 + number)) for number in range(20)]


def moved(time: float) -> Callable[[list[Timed]], None]:
    """Change the time of the sixth frame."""
    return lambda row: row.__setitem__(5, (time, row[5][1]))


def replaced(raw: Raw, time: float = 0.5) -> Callable[[list[Timed]], None]:
    """Replace the sixth frame."""
    return lambda row: row.__setitem__(5, (time, raw))


def added(raw: Raw) -> Callable[[list[Timed]], None]:
    """Insert a frame before the sixth."""
    return lambda row: row.insert(5, (0.45, raw))


def near(message: str, field: str) -> Tolerances:
    return Tolerances(fields={(message, field): 1})


PLACE = "Place Response"

CASES: list[tuple[str, Callable[[list[Timed]], object], Tolerances, list[DifferenceKind]]] = [
    ("in time by 1 ms", moved(0.501), EXACT, []),
    ("2 ms is late", moved(0.502), EXACT, [DifferenceKind.LATE]),
    ("2 ms is early", moved(0.498), EXACT, [DifferenceKind.EARLY]),
    ("2 ms is allowed", moved(0.502), Tolerances(0.002), []),
    ("1 mm is a change", replaced(position(1006)), EXACT, [DifferenceKind.CHANGED]),
    ("1 mm is allowed", replaced(position(1006)), near(PLACE, "x"), []),
    ("2 mm is not", replaced(position(1007)), near(PLACE, "x"), [DifferenceKind.CHANGED]),
    ("another message's tolerance", replaced(position(1006)), near("Move To", "x"), [DifferenceKind.CHANGED]),
    ("angles go round", replaced(position(1005, 359)), near(PLACE, "angle"), []),
    ("late and changed", replaced(position(1), 0.55), EXACT, [DifferenceKind.CHANGED, DifferenceKind.LATE]),
    ("two in a row are missing", lambda row: row.__delitem__(slice(5, 7)), EXACT, [DifferenceKind.MISSING] * 2),
    ("a node was off", lambda row: row.__delitem__(slice(3, 17)), EXACT, [DifferenceKind.MISSING] * 14),
    ("one more", added(position(1)), EXACT, [DifferenceKind.EXTRA]),
    ("the last one", lambda row: row.pop(), EXACT, [DifferenceKind.MISSING]),
    ("unreadable", added(Foreign(Damage.UNREADABLE, "x")), EXACT, [DifferenceKind.EXTRA]),
    ("too short", replaced(position(1005)._replace(data=b"1")), EXACT, [DifferenceKind.CHANGED]),
    ("no message", added(Frame(0x7E6)), EXACT, [DifferenceKind.EXTRA]),
]


@pytest.mark.parametrize(
    ("change", "tolerances", "wanted"),
    [case[1:] for case in CASES],
)
def test_tolerances_decide_on_differences(
    change: Callable[[list[Timed]], object], tolerances: Tolerances, wanted: list[DifferenceKind]
) -> None:
    other = list(ROW)
    change(other)
    assert [each.kind for each in compare(ROW, other, DECODER, tolerances)] == wanted


def test_a_difference_says_what_has_changed() -> None:
    other = [*ROW[:5], (0.5, position(900)), *ROW[6:]]
    assert compare(ROW, other, DECODER, EXACT) == [
        Difference(0.5, DifferenceKind.CHANGED, "Place Response", "x = 1005 mm -> 900 mm")
    ]


def test_unknown_is_near_no_number() -> None:
    known, unknown = (
        [(0.0, position(1000, 90))],
        [(0.0, ENCODE(m.PlaceResponse(None, None, None, m.Source.ENCODER)))],
    )
    tolerant = Tolerances(fields={(PLACE, field): 5000.0 for field in ("x", "y", "angle")})
    assert [each.text for each in compare(known, unknown, DECODER, tolerant)] == [
        "x = 1000 mm -> unknown, y = 500 mm -> unknown, angle = 90 deg -> unknown"
    ]
    assert [each.kind for each in compare(unknown, known, DECODER, tolerant)] == [DifferenceKind.CHANGED]


@pytest.mark.parametrize(("first", "second"), [([], []), ([], ROW), (ROW, [])])
def test_logs_may_be_empty(first: list[Timed], second: list[Timed]) -> None:
    assert len(compare(first, second, DECODER, EXACT)) == abs(len(first) - len(second))


def test_frames_of_another_bus_are_other_frames() -> None:
    first = [(time, raw, "can0") for time, raw in ROW] + [(time, raw, "can1") for time, raw in ROW]
    second = [each for each in first if each[2] == "can0" or each[0] > ROW[0][0]]
    (missing,) = compare(first, second, DECODER, EXACT)
    assert (missing.kind, missing.channel) == (DifferenceKind.MISSING, "can1")
