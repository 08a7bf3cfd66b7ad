"""A long log on the page: what is told of all of it, and any part of it as on a page that has the whole."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.formats import lines
from eurobot_od.traffic.formats.index import LogIndex
from eurobot_od.web import longlog
from eurobot_od.web.asking import number_of
from eurobot_od.web.longlog import LongLog, LongLogs, ThinnedSeries
from eurobot_od.web.page import Columns, page
from tests.kit import plant
from tests.kit.plant import messages as m
from tests.web.browser import Page
from tests.web.scene import serving

DECODER = plant.decoder()
SECONDS = 60
PLACE, STATE = "Place Response", "encoder"


def line(time: float, frame: str) -> str:
    return f"({1000 + time:.6f}) can0 {frame}\n"


def log_of(folder: Path) -> Path:
    """Write a minute of two nodes: places ten times a second, heartbeats, an EMCY, a boot-up, a node that is lost."""
    place = [DECODER.protocol.encode(m.PlaceResponse(each, 1800, None, m.Source.ENCODER)) for each in range(600)]
    found = [(each / 10, str(frame)) for each, frame in enumerate(place)]
    found += [(second + 0.05, "702#05") for second in range(SECONDS) if second < 40]
    found += [(second + 0.07, "701#05") for second in range(SECONDS)]
    found += [(0.01, "702#00"), (5.03, "082#1081110000000000")]
    file = folder / "minute.log"
    file.write_text("".join(line(*each) for each in sorted(found)))
    return file


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make places of some lines, and windows of some places."""
    monkeypatch.setattr(lines, "PIECE", 600)
    monkeypatch.setattr(longlog, "BEFORE", 20)
    monkeypatch.setattr(longlog, "AFTER", 60)


def long_log(file: Path) -> LongLog:
    index = LogIndex.of(file)
    assert index is not None
    return LongLog("minute.log", index, DECODER, 500_000, partial(Diagnosis, DECODER))


@pytest.fixture
def log(tmp_path: Path) -> LongLog:
    made = long_log(log_of(tmp_path))
    made.build()
    return made


@pytest.fixture
def whole(tmp_path: Path) -> dict[str, Any]:
    """What the page has of the same log if it is a short one."""
    columns, following = Columns("minute.log", DECODER, 500_000), TrackingDecoder(DECODER)
    with log_of(tmp_path).open("rb") as file:
        for _, time, channel, raw in formats.read(file):
            columns.take(time, following(time, channel, raw))
    return columns.data()


def row(data: dict[str, Any], name: str) -> dict[str, Any]:
    return next(each for each in data["rows"] if each["name"] == name)


def test_the_index_has_the_rows_and_the_events_of_the_whole_log(log: LongLog, whole: dict[str, Any]) -> None:
    told = log.told({})
    assert {(each["name"], each["id"]) for each in told["rows"]} == {
        (each["name"], each["id"]) for each in whole["rows"]
    }
    assert [(each["kind"], each["time"]) for each in told["events"]] == [
        (each["kind"], each["time"]) for each in whole["events"]
    ]
    assert [each["kind"] for each in told["events"]] == ["boot-up", "EMCY", "lost"]
    assert (told["frames"], told["end"], told["is_complete"]) == (702, whole["end"], True)


@pytest.mark.parametrize("time", [0.0, 12.34, 59.9])
def test_a_window_has_the_same_frames_as_the_whole_log(time: float, log: LongLog, whole: dict[str, Any]) -> None:
    window = log.window({"time": time})
    assert window["from"] <= time <= window["to"]
    found, all_of_it = row(window, PLACE), row(whole, PLACE)
    first = next(place for place, number in enumerate(all_of_it["numbers"]) if number == found["numbers"][0])
    part = slice(first, first + len(found["times"]))
    assert 0 < len(found["times"]) < 150
    for name in ("times", "numbers", "data"):
        assert found[name] == all_of_it[name][part], name
    assert [list(column) for column in found["values"]] == [list(column[part]) for column in all_of_it["values"]]


def test_a_window_knows_the_last_frame_of_each_row_before_it_and_how_many_there_were(log: LongLog) -> None:
    window = log.window({"time": 50.0})
    emergency = row(window, "EMCY lift")
    assert (emergency["times"], window["counts"][0x82]) == ([5.03], 1)
    lost = row(window, "Heartbeat lift")
    assert (lost["times"], window["counts"][0x702]) == ([39.05], 41)
    assert all(number < window["first"] for number in (*emergency["numbers"], *lost["numbers"]))


def test_a_series_with_pixels_keeps_the_least_and_the_most_of_each(log: LongLog) -> None:
    span = {"row": PLACE, "field": "x", "from": 0.0, "to": 60.0}
    every, thinned = log.series(span), log.series({**span, "pixels": 10})
    assert every["values"] == list(range(600))
    assert (min(thinned["values"]), max(thinned["values"]), len(thinned["times"]) < 45) == (0, 599, True)


def test_a_thinned_series_keeps_first_least_most_and_last_value() -> None:
    thinned = ThinnedSeries(10.0)
    for time, value in enumerate([5, 9, None, 1, "word", 4, 20]):
        thinned.take(float(time), value)
    assert thinned.data() == {"times": [0.0, 3.0, 6.0], "values": [5, 1, 20]}


@pytest.mark.parametrize(
    ("said", "time"),
    [
        ({"rows": ["EMCY lift"], "time": 0.0}, 5.03),
        ({"rows": ["EMCY lift"], "time": 50.0, "back": True}, 5.03),
        ({"rows": ["EMCY lift"], "time": 5.03}, None),
        ({"rows": ["EMCY lift"], "time": 5.03, "back": True}, None),
        ({"rows": ["Heartbeat lift", PLACE], "time": 39.01}, 39.05),
        ({"rows": ["Heartbeat lift"], "time": 0.0}, 0.01),
    ],
    ids=["later", "back", "none later", "none before", "of two rows", "at the begin of the log"],
)
def test_the_next_frame_of_some_rows_is_found_in_the_whole_log(
    said: dict[str, Any], time: float | None, log: LongLog
) -> None:
    assert log.next_of(said) == time


def test_the_diagnosis_is_that_of_the_whole_log_once_it_is_asked_for(tmp_path: Path) -> None:
    log = long_log(log_of(tmp_path))
    assert log.diagnosis({})["incidents"] == []
    log.work()
    whole = Diagnosis(DECODER)
    with log.index.file.open("rb") as file:
        whole.begin(log.index.file.name)
        for number, time, channel, raw in formats.read(file):
            whole.take(time, channel, raw, number)
        whole.end()
    found = log.diagnosis({})
    assert found == whole.as_data(0.0) | {"is_complete": True}
    assert found["incidents"]


def test_an_ended_request_reads_no_further(tmp_path: Path) -> None:
    log = long_log(log_of(tmp_path))
    log.end()
    log.build()
    assert (len(log.index.places), log.index.is_complete) == (1, False)


def test_a_deleted_log_is_reported(tmp_path: Path) -> None:
    log = long_log(log_of(tmp_path))
    log.index.file.unlink()
    log.work()
    assert "minute.log" in log.told({})["trouble"]


@pytest.mark.parametrize(
    ("said", "error"),
    [
        ({"log": "7", "do": "index"}, "log"),
        ({"log": "0", "do": "else"}, "request"),
        ({"log": "0", "do": "window"}, "time is missing, or not a number"),
        ({"log": "0", "do": "next", "time": 1}, "rows is missing, or not a list"),
        ({"log": "0", "do": "series", "row": PLACE, "field": "x", "from": 0}, "to is missing, or not a number"),
        ([], "a request is a JSON object"),
    ],
    ids=["no such log", "no such request", "no time", "no rows", "no end", "no object"],
)
def test_a_wrong_request_is_refused_with_the_reason(said: object, error: str, log: LongLog) -> None:
    answer = json.loads(asyncio.run(LongLogs([log]).post(json.dumps(said))))
    assert error in answer["error"]


def test_fields_of_requests_are_told_apart_from_text() -> None:
    with pytest.raises(LocalError, match="time is missing, or not a number"):
        number_of({"time": float("nan")}, "time")


# In a browser


@contextmanager
def shown(log: LongLog) -> Iterator[str]:
    logs = LongLogs([log])
    with serving(lambda: page("minute.log", [log.data()]), posts={"/log": logs.post}) as address:
        yield address


def test_the_page_is_usable_while_the_log_is_read_and_jumps_to_any_time(tmp_path: Path, window: Page) -> None:
    log = long_log(log_of(tmp_path))
    with shown(log) as address:
        window.open(address)
        window.wait("document.querySelector('.status').textContent.includes('the log is')")
        log.build()
        window.wait("clock.end > 59 && sources[0].frames.length > 0")
        assert window.run("sources[0].frames.length") < 200
        window.run("clock.seek(clock.end)")
        window.wait("document.querySelector('table.messages').textContent.includes('x 599')")
        counts = "[...document.querySelectorAll('table.messages tbody .count')].map(each => each.textContent)"
        assert window.run(counts) == ["1", "600", "60", "41"]
        window.run("clock.seek(0)")
        window.wait("document.querySelector('table.messages').textContent.includes('x 0')")
        window.complaints[:] = [each for each in window.complaints if "Failed to load" not in each]


def test_the_trace_goes_on_at_its_ends_and_finds_the_next_frame_that_passes(tmp_path: Path, window: Page) -> None:
    log = long_log(log_of(tmp_path))
    log.build()
    with shown(log) as address:
        window.size(1366, 500)
        window.open(address)
        window.run("document.querySelector('#tab-trace').click()")
        window.wait("traces[0].found.length > 0 && !sources[0].long.asking")
        before = window.run("sources[0].long.to")
        window.run("traces[0].box.scrollTop = traces[0].box.scrollHeight")
        window.wait(f"sources[0].long.to > {before} && !sources[0].long.asking")
        window.run("clock.seek(30)")
        window.wait("sources[0].long.has(30, 30) && !sources[0].long.asking")
        window.run("traces[0].filter('identifier', '082'); traces[0].next(true)")
        window.wait("traces[0].marked?.row.name === 'EMCY lift'")
        assert window.run("traces[0].marked.time") == 5.03


def test_a_plot_of_the_whole_log_asks_for_what_its_pixels_need(tmp_path: Path, window: Page) -> None:
    log = long_log(log_of(tmp_path))
    log.build()
    with shown(log) as address:
        window.open(address)
        window.wait("sources[0].row('Place Response')")
        window.run("plots.add(new FieldSeries(sources[0].row('Place Response'), 'x'))")
        window.run("document.querySelector('#tab-plots').click()")
        window.wait("plots.all[0].chart?.data[1].length > 500")
        assert window.run("[Math.min(...plots.all[0].chart.data[1]), Math.max(...plots.all[0].chart.data[1])]") == [
            0,
            599,
        ]
