"""Plots that do not lie, in a real browser: each sample is drawn and saved, and what is shown is said."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.frame import Frame
from tests.kit import plant
from tests.kit.plant import messages as m
from tests.web.browser import Page
from tests.web.scene import channel, live_page

PROTOCOL = plant.protocol()
ROW = "sources[0].row('Place Response')"


def place(x: int, angle: int = 0) -> Frame:
    return PROTOCOL.encode(m.PlaceResponse(x, 1000, angle, m.Source.ENCODER))


@pytest.fixture
def page(tmp_path: Path, window: Page) -> Iterator[Page]:
    """A page with 500 samples of a value that changes with each, as fast as the bus has them."""
    name = channel()
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        window.may_lose_its_server = True
        window.open(served.address)
        window.wait("connection.alive")
        for number in range(500):
            Driver(bus).send(place(2 if number % 2 else 2000, number % 360))
        window.wait(f"{ROW}?.times.length === 500")
        window.run(f"plots.add(new FieldSeries({ROW}, 'x'))")
        window.click("#tab-plots")
        window.wait("plots.all[0].chart")
        yield window


def test_every_sample_is_kept_and_saved(page: Page) -> None:
    values = [2 if number % 2 else 2000 for number in range(500)]
    assert page.run(f"{ROW}.columns[0]") == values
    text = page.run("""(async () => {
        let kept = null;
        URL.createObjectURL = blob => { kept = blob; return '#'; };
        await plots.all[0].save('csv');
        return kept.text();
    })()""")
    assert [int(line.split(",")[1]) for line in text.splitlines()[1:]] == values


def test_no_sample_is_dropped_when_the_adapters_clock_is_set_back(page: Page) -> None:
    last = page.run(f"{ROW}.times.at(-1)")
    page.run(f"{ROW}.append({last} - 1, [7, 1000, 0, 0], '')")
    assert page.run(f"[{ROW}.times.at(-1), {ROW}.columns[0].at(-1)]") == [last, 7]


def test_a_text_has_no_button(page: Page) -> None:
    chips = f"new MessageLine({ROW}).element.querySelectorAll('.value[role=button]').length"
    before = page.run(chips)
    page.run(f"{ROW}.fields[0].is_text = true")
    assert page.run(chips) == before - 1


def test_plots_are_there_again_after_a_reload(page: Page) -> None:
    page.run(f"plots.create().add(new FieldSeries({ROW}, 'angle'))")
    names = "plots.all.map(plot => plot.series.map(each => `${each.name}, ${each.values.length}`))"
    before = page.run(names)
    page.reload()
    page.wait("typeof plots !== 'undefined' && plots.all.length === 2 && plots.all.every(each => each.chart)")
    assert page.run(names) == before


def test_of_more_samples_than_pixels_the_least_and_the_most_are_drawn(page: Page) -> None:
    page.run(f"""(() => {{
        const {{times, columns}} = {ROW};
        for (let each = 0; each < 40000; each++) {{
            times.push(times.at(-1) + 0.0005);
            for (const column of columns) column.push(500);
        }}
        columns[0][20100] = 2999;
        columns[0][20200] = 1;
    }})()""")
    drawn = page.run("thinned(plots.all[0].series[0], 0, 30, 800)")
    assert len(drawn[0]) < 4 * 800 + 4
    assert {2999, 1} <= set(drawn[1])
    assert drawn[0] == sorted(drawn[0])


def test_a_value_that_comes_once_is_drawn_until_now(page: Page) -> None:
    (times, values), now = page.run("[plots.all[0].drawn(), clock.time]")
    assert times[-1] == pytest.approx(now, abs=0.05)
    assert times[-1] > times[-2]
    assert values[-1] == values[-2] == 2


def test_all_is_all_and_a_zoom_says_so_with_a_way_back(page: Page) -> None:
    first = page.run(f"{ROW}.times[0] -= 1000")  # more than any other choice shows
    page.run("plots.window = 0.001")
    assert page.run("plots.range()[0]") > first
    page.run(
        "[...document.querySelectorAll('#view-plots .tools button')].find(each => each.textContent === 'All').click()"
    )
    assert page.run("plots.range()[0]") <= first
    assert page.run("document.querySelector('.held').hidden")
    page.run("plots.zoom([1, 2])")
    page.wait("!document.querySelector('.held').hidden")
    assert page.text(".held") == "Held at 1.00 to 2.00 s"
    page.click("#view-plots .tools .main")
    page.wait("document.querySelector('.held').hidden && plots.zoomed === null")


def test_two_units_have_two_axes_and_no_unit_has_none(page: Page) -> None:
    page.run(f"plots.add(new FieldSeries({ROW}, 'angle')); plots.add(new FieldSeries({ROW}, 'source'))")
    axes = page.run("plots.all[0].chart.axes.slice(1).map(each => [each.label ?? null, each.side])")
    assert axes == [["mm", 3], ["deg", 1], [None, 1]]
    scales = page.run("plots.all[0].chart.series.slice(1).map(each => each.scale)")
    assert len(set(scales)) == 3


def test_cursors_have_values_and_their_difference(page: Page) -> None:
    times = page.run(f"{ROW}.times")
    page.run(f"plots.put('A', {times[10]}); plots.put('B', {times[11]})")
    page.wait("document.querySelector('.plot .legend b').textContent === 'A 2000 mm, B 2 mm, B − A = -1998 mm'")
    assert page.text(".cursors").count("Δ") == 1


def test_plots_fill_the_window(page: Page) -> None:
    bottom = "document.querySelector('.plots').getBoundingClientRect().bottom"
    for height in (720, 900, 1100):
        page.size(1440, height)
        page.wait(f"Math.abs({bottom} - {height}) < 40 && plots.all[0].chart.height === plots.height")
    page.run("plots.create().add(plots.all[0].series[0])")
    page.wait(f"Math.abs({bottom} - 1100) < 40")


def test_a_period_is_not_one_interval(tmp_path: Path, window: Page) -> None:
    name = channel()
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        window.may_lose_its_server = True
        window.open(served.address)
        window.wait("connection.alive")
        for _ in range(2):
            Driver(bus).send(PROTOCOL.encode(m.MoveStateResponse(5)))
        window.click("#tab-messages")
        window.wait("document.querySelector('.messages tbody .count')?.textContent === '2'")
        assert window.text(".messages tbody .period") == "–"
