"""Layouts that are kept by name in the folder of the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.frame import Frame
from tests.kit import plant
from tests.web.browser import Browser, Page
from tests.web.scene import channel, live_page
from tests.web.test_server import answer, talk

HEARTBEAT = Frame(0x701, b"\x05")

LAYOUT = {"address": "#trace?identifier=180", "kept": {"columns": ["count"]}}


async def kept(opened: Any, **words: Any) -> Any:
    return await answer(opened, json.dumps({"id": 1, **words}))


def test_a_layout_is_there_for_the_next_server(tmp_path: Path) -> None:
    with live_page(channel(), tmp_path) as served:
        talk(served, lambda opened: kept(opened, do="keep layout", name="tracing", layout=LAYOUT))
    with live_page(channel(), tmp_path) as served:
        assert talk(served, lambda opened: kept(opened, do="layouts"))["ok"] == {"tracing": LAYOUT}
        talk(served, lambda opened: kept(opened, do="remove layout", name="tracing"))
        assert talk(served, lambda opened: kept(opened, do="layouts"))["ok"] == {}


def test_saving_or_removing_a_layout_keeps_the_others(tmp_path: Path) -> None:
    async def several(opened: Any) -> list[Any]:
        for name, layout in (("one", LAYOUT), ("two", {}), ("one", {})):
            await kept(opened, do="keep layout", name=name, layout=layout)
        both = (await kept(opened, do="layouts"))["ok"]
        await kept(opened, do="remove layout", name="one")
        return [both, (await kept(opened, do="layouts"))["ok"]]

    with live_page(channel(), tmp_path) as served:
        assert talk(served, several) == [{"one": {}, "two": {}}, {"two": {}}]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"name": "", "layout": LAYOUT}, "a layout has a name of 1 to 60 characters"),
        ({"name": "a\nb", "layout": LAYOUT}, "a layout has a name of 1 to 60 characters"),
        ({"name": "a"}, "layout is missing"),
    ],
)
def test_an_invalid_layout_is_refused_in_one_line(tmp_path: Path, words: dict[str, Any], error: str) -> None:
    with live_page(channel(), tmp_path) as served:
        assert talk(served, lambda opened: kept(opened, do="keep layout", **words))["error"] == error
    assert not (tmp_path / "layouts.json").exists()


def test_a_damaged_file_of_layouts_is_reported(tmp_path: Path) -> None:
    (tmp_path / "layouts.json").write_text("{")
    with live_page(channel(), tmp_path) as served:
        assert "layouts.json: not JSON" in talk(served, lambda opened: kept(opened, do="layouts"))["error"]


FILTERED = """(box => {
    box.value = '!move';
    box.dispatchEvent(new Event('input'));
})(document.querySelector('#search'))"""

CHOSEN = """new Layouts().open().then(() =>
    [...document.querySelectorAll('.layouts button')].find(each => each.textContent === 'mine').click())"""


def test_a_layout_brings_view_filter_and_plots_to_another_browser(
    tmp_path: Path, browser: Browser, window: Page
) -> None:
    name, move = channel(), plant.decoder().protocol.encode(plant.messages.MoveTo(1000, 500, 90, 80))
    shown = "document.querySelectorAll('table.messages tbody tr:not([hidden])').length"
    with live_page(name, tmp_path) as served, open_bus("virtual", name) as other:
        bus = Driver(other)
        bus.send(move)
        bus.send(HEARTBEAT)
        window.open(served.address)
        window.wait("connection.control && sources[0].frames.length === 2")
        window.run("plots.add(new FieldSeries(sources[0].row('Move To'), 'angle'))")
        window.click("#tab-messages")
        window.run(FILTERED)
        window.wait(f"{shown} === 1")
        window.run("connection.ask({do: 'keep layout', name: 'mine', layout: presentLayout()})")
        second = browser.page()
        second.open(served.address)
        second.wait("connection.control")
        second.run(CHOSEN)
        second.wait("typeof plots === 'object' && plots.all[0].series[0]?.field.name === 'angle'")
        second.wait(f"location.hash === '#messages?search=%21move' && {shown} === 1")
        second.close()
        window.may_lose_its_server = True
