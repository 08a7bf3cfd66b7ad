"""A log as columns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.web import page
from eurobot_od.web.events import PageEvent
from eurobot_od.web.page import Columns, Panel
from tests.kit import plant
from tests.kit.plant import messages as m
from tests.web.test_drives import NETWORK
from tests.web.test_events import REMAPPED

DECODER = plant.decoder()
MOVE = DECODER.protocol.encode(m.MoveTo(1000, 500, 90, 80))
HERE = DECODER.protocol.encode(m.PlaceResponse(200, 1800, None, m.Source.ENCODER))
SHORT = Frame(MOVE.cob_id, b"\1\2")


class Marking(Panel):
    """Makes an event of each message that moves something or stops it."""

    def take(self, time: float, message: Message) -> Iterator[PageEvent]:
        kinds = {m.HaltLift: "halt", m.MoveTo: "move"}
        if type(message) in kinds:
            yield PageEvent(f"{kinds[type(message)]} {time}", kinds[type(message)], time, "")


def data_of(*entries: tuple[float, Raw]) -> dict[str, Any]:
    found = Columns("log", DECODER, 500_000, [Marking])
    for time, raw in entries:
        found.take(time, DECODER(raw))
    return found.data()


def row(data: dict[str, Any], name: str) -> dict[str, Any]:
    return next(each for each in data["rows"] if each["name"] == name)


def test_times_count_from_the_first_entry_whatever_it_is() -> None:
    data = data_of((100.0, Foreign(Damage.FD, "702##1AA")), (100.5, HERE), (101.25, HERE))
    assert row(data, "Place Response")["times"] == [0.5, 1.25]
    assert data["end"] == 1.25


def test_values_are_numbers_words_and_nothing_for_unknown() -> None:
    found = row(data_of((0.0, HERE)), "Place Response")
    assert found["values"] == [(200,), (1800,), (None,), ("encoder",)]
    assert found["texts"] == []


def test_a_field_has_the_least_and_the_greatest_value_that_it_may_have() -> None:
    (move,) = (each for each in data_of()["messages"] if each["name"] == "Move To")
    limits = {each["name"]: (each.get("low"), each.get("high")) for each in move["fields"]}
    assert (limits["x"], limits["angle"]) == ((0, 3000), (0, 359))


@pytest.mark.parametrize("frames", [(SHORT, MOVE), (MOVE, SHORT)])
def test_a_frame_that_cannot_be_read_is_text_among_values(frames: tuple[Frame, Frame]) -> None:
    found = row(data_of(*enumerate(frames)), "Move To")
    place = frames.index(SHORT)
    assert "2 bytes of data" in found["texts"][place]
    assert found["texts"][1 - place] == ""
    assert [each[1 - place] for each in found["values"][:2]] == [1000, 500]
    assert [each[place] for each in found["values"][:2]] == [None, None]
    assert list(found["wrong"]) == [place]


def test_entries_that_are_no_frames_have_rows_by_their_kind() -> None:
    found = row(data_of((0.0, Foreign(Damage.FD, "702##1AA"))), "CAN FD, 1 byte")
    assert (found["id"], found["times"], found["bits"]) == (None, [0.0], 0)


def test_events_are_services_and_what_panels_make_of_messages() -> None:
    data = data_of(
        (0.0, HERE), (1.0, MOVE), (2.0, Frame(0x702, b"\0")), (3.0, Frame(0x082, bytes.fromhex("1081110000000000")))
    )
    assert [(each["kind"], each["time"], each["wrong"]) for each in data["events"]] == [
        ("move", 1.0, False),
        ("boot-up", 2.0, False),
        ("EMCY", 3.0, True),
    ]


def test_frames_beyond_the_limit_of_the_page_are_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "MOST_FRAMES", 3)
    assert data_of(*((float(time), HERE) for time in range(5)))["left_out"] == 2


def test_frames_that_are_mapped_otherwise_now_have_a_text_in_place_of_values() -> None:
    following, found = TrackingDecoder(NETWORK), Columns("log", NETWORK, 500_000)
    for time, text in enumerate(["285#370600000000", *REMAPPED, "285#40E20100"]):
        found.take(time, following(time, "", Frame.parse(text)))
    remapped = row(found.data(), "servo.TPDO2")
    assert [each[1] for each in remapped["values"]] == [None] * len(remapped["values"])
    assert remapped["texts"] == ["", "position_actual_value=123456"]
