"""The look: what a person with other eyes, fingers or windows relies on, in every view and on the first page."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.library.library import Library
from eurobot_od.web.page import Columns, page
from eurobot_od.web.start import BusChoice, StartPage
from tests.kit import plant
from tests.web.browser import Page
from tests.web.scene import channel, live_page, serving

TARGETS = """[...document.querySelectorAll("button, a[href], input, select, summary, [role=button], .trace .line")]
    .map(each => ({each, box: (each.closest("label") || each).getBoundingClientRect()}))
    .filter(({each, box}) => each.getClientRects().length && !each.closest(".heard-only") && !each.closest(".head"))
    .filter(({box}) => box.width < 24 || box.height < 24)
    .map(({each, box}) => `${each.outerHTML.slice(0, 80)} ${box.width} x ${box.height}`)"""
"""What can be pressed and is smaller than 24 pixels (WCAG 2.2, 2.5.8)."""


@pytest.fixture
def bus(tmp_path: Path, window: Page) -> Iterator[Driver]:
    """Open the page of the packaging line's bus, on which somebody else sends."""
    name = channel()
    with live_page(name, tmp_path) as served, open_bus("virtual", name) as other:
        window.may_lose_its_server = True
        window.open(served.address)
        window.wait("connection.alive && connection.control")
        yield Driver(other)


def views(window: Page) -> Iterator[str]:
    """Go through the views, and open in each what can be opened."""
    for name in window.run("[...document.querySelectorAll('[role=tab]:not([hidden])')].map(tab => tab.id)"):
        window.run(f"document.querySelector('#{name}').click()")
        window.run("document.querySelectorAll('main details').forEach(each => { each.open = true; })")
        window.run("new Promise(done => setTimeout(done, 200))")
        yield name


@pytest.mark.parametrize("width", [1366, 390])
def test_whatever_can_be_pressed_has_24_pixels(width: int, bus: Driver, window: Page) -> None:
    window.size(width)
    bus.send(Frame(0x181, bytes(8)))
    bus.send(plant.decoder().protocol.encode(plant.messages.MoveTo(1000, 500, 90, 80)))
    window.wait("sources[0].frames.length > 1")
    found = {name: window.run(TARGETS) for name in views(window)}
    assert {name: each for name, each in found.items() if each} == {}


@pytest.mark.parametrize("width", [1920, 1280, 910, 761], ids=["wide", "1920 at 150 %", "1366 at 150 %", "narrow"])
def test_the_header_has_two_lines_at_any_width(width: int, bus: Driver, window: Page) -> None:
    """A log's name may be long, and there are thirteen views: neither makes it higher."""
    window.run("document.querySelector('h1').textContent = 'a log with quite a long name '.repeat(4)")
    window.size(width)
    bus.send(Frame(0x701, b"\x05"))
    window.wait("sources[0].frames.length > 0")
    assert window.run("document.querySelector('header').getBoundingClientRect().height") <= 104


def test_lost_nodes_are_counted_and_the_count_leads_to_them(bus: Driver, window: Page) -> None:
    for node_id in (1, 2, 3):
        bus.send(Frame(0x700 + node_id, b"\x05"))
    window.wait("document.querySelector('#life').textContent.includes('3 lost')")
    assert window.run("document.querySelector('#life').title") == "panel, lift, scale lost: show the nodes"
    window.click("#life")
    window.wait("document.querySelectorAll('#view-nodes .card').length === 3")
    names = "[...document.querySelectorAll('.card h2 small')].map(each => each.textContent.trim())"
    assert window.run(names) == ["node 1", "node 2", "node 3"]


def test_a_node_that_is_lost_again_and_again_is_one_event_with_a_count(window: Page) -> None:
    times = [(1.0, "lost"), (2.0, "back"), (3.0, "lost"), (4.0, "back"), (5.0, "lost")]
    events = [
        {"key": f"{kind} {at}", "kind": kind, "time": at, "text": f"lift is {kind}", "end": None, "mark": "",
         "wrong": kind == "lost", "data": {"node": "lift"}}
        for at, kind in times
    ]  # fmt: skip
    data = Columns("log", plant.decoder(), 500_000).data() | {"events": events, "end": 6.0}
    with serving(lambda: page("log", [data])) as address:
        window.open(address)
        window.run("document.querySelector('#tab-events').click()")
        window.wait("document.querySelectorAll('#view-events li').length > 0")
        lines = window.run("[...document.querySelectorAll('#view-events li')].map(each => each.textContent)")
    assert lines == ["5.00 slostlift is lost, lost 3 times since 1.00 s"]


def test_a_phone_has_the_count_in_place_of_the_title_and_two_lines_for_a_frame(bus: Driver, window: Page) -> None:
    window.size(390, 844)
    bus.send(Frame(0x701, b"\x05"))
    window.wait("sources[0].frames.length > 0")
    window.run("document.querySelector('#tab-trace').click()")
    window.wait("document.querySelector('.trace .lines .line')")
    assert window.run("document.querySelector('h1').getBoundingClientRect().width") <= 1
    assert window.run("document.querySelector('.status .fewer').textContent") == "1"
    assert window.run("document.querySelector('.trace .lines .line').offsetHeight === lineHeight()")
    boxes = window.run("""[...document.querySelector('.trace .lines .line').children]
        .map(each => each.getBoundingClientRect()).filter(box => box.width).map(box => [box.top, box.right])""")
    assert len({top for top, _ in boxes}) == 2
    assert max(right for _, right in boxes) <= 390


def test_each_field_keeps_its_own_colour(bus: Driver, window: Page) -> None:
    bus.send(plant.decoder().protocol.encode(plant.messages.MoveTo(1000, 500, 90, 80)))
    window.wait("sources[0].row('Move To')")
    window.run("document.querySelector('#tab-plots').click()")
    window.run("for (const name of ['x', 'y', 'angle']) plots.add(new FieldSeries(sources[0].row('Move To'), name))")
    window.run("plots.create(); plots.add(new FieldSeries(sources[0].row('Move To'), 'angle'))")
    shown = "plots.all.map(plot => plot.lines.map(each => each.colour))"
    before = window.run(shown)
    assert (len(set(before[0])), before[1]) == (3, [before[0][2]])
    window.run("plots.all[0].series.splice(0, 1); plots.all[0].build()")
    assert window.run(shown) == [before[0][1:], before[1]]


def test_axes_of_several_units_do_not_collide(bus: Driver, window: Page) -> None:
    bus.send(plant.decoder().protocol.encode(plant.messages.MoveTo(1000, 500, 90, 80)))
    window.wait("sources[0].row('Move To')")
    window.run("document.querySelector('#tab-plots').click()")
    window.run(
        "(row => row.fields.forEach(each => plots.add(new FieldSeries(row, each.name))))(sources[0].row('Move To'))"
    )
    axes = "plots.all[0].chart.axes.slice(1).map(each => [each.side, each._pos, each._size])"
    window.wait("plots.all[0].chart && plots.all[0].units.length > 2")
    right = sorted((place, size) for side, place, size in window.run(axes) if side == 1)
    assert len(right) > 1
    assert all(place + size <= after for (place, size), (after, _) in pairwise(right))


def saved(window: Page, form: str) -> str:
    """Save the first plot, and return what the file has."""
    window.run("window.files = []; window.saved = (name, blob) => blob.text().then(text => files.push([name, text]))")
    window.run(f"plots.all[0].save({json.dumps(form)})")
    window.wait("files.length === 1")
    name, text = window.run("files[0]")
    assert name == f"plot.{form}"
    return str(text)


def test_a_plot_is_saved_as_svg_with_axes_names_and_lines(bus: Driver, window: Page) -> None:
    bus.send(plant.decoder().protocol.encode(plant.messages.MoveTo(1000, 500, 90, 80)))
    window.wait("sources[0].row('Move To')")
    window.run("document.querySelector('#tab-plots').click()")
    window.run("for (const name of ['x', 'angle']) plots.add(new FieldSeries(sources[0].row('Move To'), name))")
    window.wait("plots.all[0].chart")
    drawing = saved(window, "svg")
    assert drawing.startswith("<svg ")
    for part in ("Move To.x in mm", "Move To.angle in deg", "time in s", "1,000"):
        assert f">{part}<" in drawing, part
    assert drawing.count("<path ") == 2
    assert "NaN" not in drawing


def test_a_plot_takes_the_same_fields_of_all_logs_over_one_another(window: Page) -> None:
    logs = []
    for name in ("one", "two", "three"):
        columns = Columns(f"{name}.log", plant.decoder(), 500_000)
        columns.take(0.0, plant.decoder()(plant.decoder().protocol.encode(plant.messages.MoveTo(1000, 500, 90, 80))))
        logs.append(columns.data())
    with serving(lambda: page("logs", logs)) as address:
        window.open(address)
        window.run("document.querySelector('#tab-plots').click()")
        window.run("plots.add(new FieldSeries(sources[1].row('Move To'), 'x'))")
        window.run(
            "[...document.querySelectorAll('.plot button')].find(each => each.textContent === 'All logs').click()"
        )
        names = window.run("plots.all[0].series.map(each => each.name)")
        assert sorted(names) == ["one.log: Move To.x", "three.log: Move To.x", "two.log: Move To.x"]
        assert window.run("new Set(plots.all[0].lines.map(each => each.colour)).size") == 3


def test_a_filter_of_messages_takes_lists_ranges_and_exclusions_and_says_what_it_does_not_understand(
    bus: Driver, window: Page
) -> None:
    for cob_id in (0x701, 0x702, 0x703, 0x081):
        bus.send(Frame(cob_id, bytes(8 if cob_id == 0x081 else 1)))
    window.wait("document.querySelectorAll('table.messages tbody tr').length === 4")

    def passing(text: str) -> Any:
        typed = f"box.value = {json.dumps(text)}; box.dispatchEvent(new Event('input'))"
        window.run(f"(box => {{ {typed}; }})(document.querySelector('#search'))")
        window.run("new Promise(done => setTimeout(done, 300))")
        shown = "document.querySelectorAll('table.messages tbody tr:not([hidden]) .id')"
        return window.run(f"[...{shown}].map(each => each.textContent)")

    assert passing("701, 703") == ["701", "703"]
    assert passing("700-702") == ["701", "702"]
    assert passing("!heartbeat") == ["081"]
    assert passing("heartbeat, !702") == ["701", "703"]
    assert passing("702-700") == ["081", "701", "702", "703"]
    assert "the first is more than the last" in window.text("#view-messages .tools .is-wrong")
    assert passing("!") == ["081", "701", "702", "703"]
    assert "is not understood" in window.text("#view-messages .tools .is-wrong")


def test_identity_is_open_at_first_and_a_long_group_has_only_the_rows_in_sight(window: Page) -> None:
    known = {
        "type": "UNSIGNED8",
        "access": "ro",
        "low": None,
        "high": None,
        "default": "",
        "plots": False,
        "long": False,
    }
    objects = [{**known, "object": f"0x{0x2000 + n:04X}:0", "name": f"Number {n}"} for n in range(3001)]
    identity = [{**known, "object": f"0x1018:{sub}", "name": f"Identity object.Part {sub}"} for sub in range(5)]
    data = Columns("log", plant.decoder(), 500_000).data()
    with serving(lambda: page("log", [data])) as address:
        window.open(address)
        window.run(f"""(() => {{
            window.view = new ObjectsView(sources[0]);
            document.querySelector('main').append(view.element);
            view.lines = {json.dumps(identity + objects)}.map(each => new ObjectLine(view, 'panel', each));
            view.draw();
        }})()""")
        rows = "document.querySelectorAll('.tree tbody tr').length"
        window.wait(f"{rows} === 5")
        window.run("document.querySelectorAll('.object-group > details')[1].open = true")
        window.wait(f"{rows} > 50")
        window.run("new Promise(done => setTimeout(done, 300))")
        assert window.run(rows) < 300
        window.run("scrollTo(0, document.body.scrollHeight)")
        window.wait(f"{rows} > 120")


@contextmanager
def first_page(folder: Path) -> Iterator[str]:
    def refuse(choice: BusChoice) -> None:
        raise BusError(str(choice))

    (folder / "devices").mkdir()
    (folder / "run.log").write_text("(1.000000) can0 181#00\n")
    start = StartPage(Library([folder / "devices"]), folder, True, refuse, lambda _: None)
    with ExitStack() as stack:
        yield stack.enter_context(serving(start.page, posts={"/start": start.answer}))


def test_the_first_page_has_targets_of_24_pixels(tmp_path: Path, window: Page) -> None:
    with first_page(tmp_path) as address:
        window.call("Page.navigate", url=address)
        window.wait("document.body && document.querySelectorAll('.card').length > 2")
        assert window.run(TARGETS) == []
        window.may_lose_its_server = True
