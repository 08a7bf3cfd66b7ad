"""An object that is read again and again: as data, when it is shown, and how many there are at once."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import find_one
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web.desk import Desk
from eurobot_od.web.session import PolledObject, Sample, Session
from eurobot_od.web.views import objects
from tests.eds_text import DEVICE_TYPE, record, variable
from tests.kit import plant
from tests.web.scene import LONG, channel


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    """What a page asks on a bus without nodes."""
    session = Session(partial(open_bus, "virtual", channel()), plant.decoder(), 500_000)
    found = Desk(session, tmp_path)
    found.master.answer_wait = 0.01
    yield found
    session.close()


@pytest.fixture
def moved(tmp_path: Path) -> Iterator[Desk]:
    """What a page asks of a device whose file has its SDO server elsewhere."""
    server = record(0x1200, "SDO server", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x650"), (2, "UNSIGNED32", "0x6A1"))
    text = DEVICE_TYPE + server + variable("2000", "Speed", "UNSIGNED16", "7")
    dictionary, name = Dictionary.read(text.encode(), Path("moved.eds"), 5), channel()
    session = Session(partial(open_bus, "virtual", name), Decoder([dictionary]), 500_000)
    with open_bus("virtual", name) as bus, Live.node(bus, SimulatedDevice(dictionary)):
        yield Desk(session, tmp_path)
    session.close()


def test_an_object_is_read_where_a_file_says_that_the_sdo_server_is(moved: Desk) -> None:
    with ThreadPoolExecutor(1) as pool:
        reading = pool.submit(objects.read, moved, {"node": "moved", "object": "Speed"})
        while not reading.done():
            moved.session.poll()
    assert reading.result()["value"] == 7


def test_the_time_of_a_value_has_a_tenth_of_a_millisecond() -> None:
    polled = PolledObject("5", 5, find_one("0x1017", None))
    polled.samples.append(Sample(0, 1.23456, 1000))
    assert polled.shown(-1) == {"samples": [(1.2346, 1000)], "trouble": ""}


def test_a_browser_gets_the_values_since_its_turn_and_a_new_one_all_that_are_kept() -> None:
    polled = PolledObject("5", 5, find_one("0x1017", None))
    for turn in range(4):
        polled.samples.append(Sample(turn, turn / 4, turn))
    seen = [[value for _, value in polled.shown(since)["samples"]] for since in (-1, 1, 3)]
    assert seen == [[0, 1, 2, 3], [2, 3], []]


def test_a_value_just_read_is_sent_to_a_browser_with_the_present_turn(moved: Desk) -> None:
    session, key = moved.session, objects.watch(moved, {"node": "moved", "object": "Speed"})

    async def read_once() -> None:
        polling = asyncio.create_task(objects.poll(moved))
        while not session.polled[key].samples:
            session.poll()
            await asyncio.sleep(0)
        polling.cancel()

    asyncio.run(asyncio.wait_for(read_once(), LONG))
    [(_, value)] = json.loads(session.snapshot(session.turn))["objects"][key]["samples"]
    assert value == 7


def test_an_object_that_no_page_wants_any_more_is_read_no_more(desk: Desk) -> None:
    session = desk.session
    key = objects.watch(desk, {"node": "lift", "object": "0x1017"})
    session.polled[key].wanted_until = session.now

    async def poll_once() -> None:
        polling = asyncio.create_task(objects.poll(desk))
        await asyncio.sleep(0)
        polling.cancel()

    asyncio.run(poll_once())
    assert not session.polled


def test_a_further_object_is_refused_when_all_places_are_taken(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "MOST_POLLED", 1)
    known = {"node": "lift", "object": "0x1017"}
    key = objects.watch(desk, known)
    before = desk.session.polled[key].wanted_until
    objects.watch(desk, known)
    assert desk.session.polled[key].wanted_until > before
    with pytest.raises(LocalError, match="1 objects are read again and again already"):
        objects.watch(desk, {"node": "lift", "object": "0x1018:1"})
