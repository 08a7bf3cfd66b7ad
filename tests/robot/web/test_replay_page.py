"""The page of a log in a real browser: it plays by the wall clock, and shows what was when."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od import cli
from tests.cli.processes import command, line
from tests.web.browser import Page

TOLERANCE = 0.25
"""Longest time of the wall clock by which a picture may be late on a busy machine, in s."""

SHOWN = "Number(document.body.dataset.time)"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Logs of two short matches."""
    found = [tmp_path_factory.mktemp("logs") / f"match-{seed}.log" for seed in (1, 2)]
    for seed, log in enumerate(found, 1):
        assert cli.main(["match", "--seed", str(seed), "--for", "6", "--log", str(log)]) == 0
    return found


@pytest.fixture
def page(logs: list[Path], window: Page, tmp_path: Path) -> Page:
    """A page that is a file on the disk; it begins with the field alone, and here it shows the messages, too."""
    file = tmp_path / "match.html"
    assert cli.main(["field", str(logs[0]), "-o", str(file)]) == 0
    window.open(file.as_uri())
    window.run("document.querySelector('#tab-messages').click()")  # the keyboard stays where it was
    return window


@pytest.fixture
def served_logs(logs: list[Path]) -> Iterator[str]:
    """The address of a page that `serve` shows of logs."""
    with command("serve", "--listen", "127.0.0.1:0", *map(str, logs)) as process:
        yield line(process, "http://").split()[0]


def end(page: Page) -> float:
    return float(page.run("clock.end"))


def choose_speed(page: Page, speed: float) -> None:
    page.run(f"""(() => {{
        const chosen = document.querySelector('#speed');
        chosen.value = '{speed:g}';
        chosen.dispatchEvent(new Event('change'));
    }})()""")


@pytest.mark.parametrize("speed", [1, 4])
def test_play_moves_as_fast_as_the_wall_clock(page: Page, speed: float) -> None:
    choose_speed(page, speed)
    page.click("#play")
    page.wait(f"{SHOWN} > 0.05")
    said = f"[{SHOWN}, performance.now(), document.querySelector('#play').textContent]"
    # Right after a frame of the page: on a busy machine the one before may be long ago.
    watch = f"""new Promise(done => setTimeout(() => {{
        const before = {SHOWN};
        const look = () => {SHOWN} === before ? requestAnimationFrame(look) : done({said});
        look();
    }}, %d))"""
    (first, begun, _), (last, ended, button) = (page.run(watch % wait) for wait in (0, 500))
    wall = (ended - begun) / 1000
    assert last - first == pytest.approx(wall * speed, abs=TOLERANCE * speed)
    assert button == ("Pause" if last < end(page) else "Play")  # a busy machine may have come to the end
    shown, time = page.run(f"[document.querySelector('#shown').textContent, {SHOWN}]")
    assert float(shown.split()[0]) == pytest.approx(time, abs=0.06)


def test_a_replay_plays_to_the_end_and_again_from_the_start(page: Page) -> None:
    choose_speed(page, 16)
    page.click("#play")
    page.wait("!clock.running && clock.time > 0 && document.querySelector('#play').textContent === 'Play'")
    page.wait(f"Math.abs({SHOWN} - clock.end) < 0.001")
    assert float(page.run("document.querySelector('#time').value")) == pytest.approx(end(page))
    choose_speed(page, 1)
    page.click("#play")
    page.wait(f"{SHOWN} < 1 && {SHOWN} > 0.01")


def test_scrubbing_shows_what_was_then(page: Page) -> None:
    row = "sources[0].row('Kalman Position Response')"
    for time in (3.0, 5.5, 4.0):
        page.run(f"""(() => {{
            const slider = document.querySelector('#time');
            slider.value = {time};
            slider.dispatchEvent(new Event('input'));
        }})()""")
        page.wait(f"{SHOWN} === {time}")
        count, x = page.run(f"[{row}.now({time}).count, {row}.now({time}).values[0]]")
        lines = "[...document.querySelectorAll('table.messages tr')]"
        line = f"{lines}.find(each => each.textContent.includes('Kalman Position Response'))"
        assert page.run(f"{line}.querySelector('.count').textContent") == str(count)
        assert page.run(f"{line}.querySelector('.value').textContent") == f"x {x} mm"
    assert page.text("#shown") == f"4.0 s of {end(page):.1f} s"


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (["ArrowRight", "ArrowRight", "ArrowLeft"], "1"),
        (["End"], "clock.end"),
        (["End", "Home"], "0"),
        (["."], "eventTimes()[0] || eventTimes()[1]"),
        ([".", ".", ","], "eventTimes().filter(each => each > 0)[0]"),
    ],
    ids="-".join,
)
def test_keys_move_the_time(page: Page, keys: list[str], expected: str) -> None:
    for key in ("Home", *keys):
        page.press(key)
    page.wait(f"Math.abs({SHOWN} - ({expected})) < 0.001")


def test_keys_play_and_change_the_speed(page: Page) -> None:
    page.press(" ")
    page.wait("clock.running")
    page.press("+")
    assert page.run("clock.speed") == 2
    page.press("-")
    page.press("-")
    assert page.run("clock.speed") == 0.5
    page.press(" ")
    assert page.run("clock.running") is False


def test_a_click_on_an_event_goes_there(page: Page) -> None:
    page.click("#tab-events")
    page.wait("document.querySelectorAll('.events li').length > 2")
    times = page.run("sources[0].sortedEvents().map(each => each.time).reverse()")  # newest first
    page.run("document.querySelectorAll('.events button')[2].click()")
    page.wait(f"Math.abs({SHOWN} - {times[2]}) < 0.001")


def numbers(text: str) -> list[float]:
    """Return the numbers in a text; the page and the monitor may round half a digit to different sides."""
    return [float(each) for each in re.findall(r"[0-9]+\.[0-9]", text)]


def test_numbers_are_those_of_the_monitor(page: Page, logs: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert cli.main(["monitor", str(logs[0]), "--speed", "max"]) == 0
    table = capsys.readouterr().out.partition("\nID ")[2].splitlines()[1:]
    told = {int(line[:3], 16): line for line in table if line[:3].strip()}
    rows = page.run("""sources[0].sorted().map(row => {
        const now = row.now(clock.end);
        return [row.id, row.name, now.count, now.period === null ? '' :
            `${(now.period * 1000).toFixed(1)} ± ${(now.jitter * 1000).toFixed(1)}`];
    })""")
    assert sorted(told) == sorted(cob_id for cob_id, *_ in rows if cob_id is not None)
    for cob_id, name, count, period in rows:
        if cob_id is not None:
            assert f" {name} " in told[cob_id]
            assert str(count) in told[cob_id].split()
            assert not period or numbers(period) == pytest.approx(
                numbers(told[cob_id].partition(f" {count} ")[2])[:2], abs=0.11
            )


def test_a_robots_values_have_its_colour(page: Page) -> None:
    page.run("clock.seek(clock.end)")
    for field in ("x", "y"):
        page.run(f"plots.add(new FieldSeries(sources[0].row('Kalman Position Response'), '{field}'))")
    page.run("plots.add(new FieldSeries(sources[0].row('Goto State Response'), 'time'))")
    page.click("#tab-plots")
    lines = "plots.chosen.drawnBy().map(({colour, dash}) => [colour, dash ? 'dashed' : 'solid'])"
    assert page.run(lines) == [["--robot-red", "solid"], ["--robot-red", "dashed"], ["--line-0", "solid"]]
    drawn = "document.querySelector('.robot circle').getAttribute('stroke')"
    assert page.run(drawn) == "var(--robot-red)"


def test_a_plot_is_saved_as_csv(page: Page) -> None:
    text = page.run("""(async () => {
        let kept = null;
        URL.createObjectURL = blob => { kept = blob; return '#'; };
        plots.add(new FieldSeries(sources[0].row('Kalman Position Response'), 'x'));
        document.querySelector('#tab-plots').click();
        await new Promise(done => setTimeout(done, 300));
        await plots.all[0].save('csv');
        return kept.text();
    })()""")
    head, *lines = text.splitlines()
    assert head == '"time in s","Kalman Position Response.x in mm"'
    times, values = page.run("(row => [row.times, row.columns[0]])(sources[0].row('Kalman Position Response'))")
    assert [tuple(map(float, line.split(","))) for line in lines] == list(zip(times, values))


def test_a_plot_is_saved_as_png(page: Page) -> None:
    start = page.run("""(async () => {
        let kept = null;
        URL.createObjectURL = blob => { kept = blob; return '#'; };
        plots.add(new FieldSeries(sources[0].row('Kalman Position Response'), 'x'));
        document.querySelector('#tab-plots').click();
        await new Promise(done => setTimeout(done, 300));
        plots.all[0].save('png');
        while (!kept) await new Promise(done => setTimeout(done, 20));
        return [...new Uint8Array(await kept.arrayBuffer())].slice(0, 4);
    })()""")
    assert bytes(start) == b"\x89PNG"


def test_zooming_is_one_for_all_plots(page: Page) -> None:
    page.run("""(() => {
        const row = sources[0].row('Kalman Position Response');
        plots.add(new FieldSeries(row, 'x'));
        plots.create().add(new FieldSeries(row, 'y'));
        document.querySelector('#tab-plots').click();
    })()""")
    page.wait("plots.all.every(each => each.chart)")
    page.run("plots.zoom([2, 4])")
    scales = "plots.all.map(each => [each.chart.scales.x.min, each.chart.scales.x.max])"
    page.wait(f"JSON.stringify({scales}) === '[[2,4],[2,4]]'")
    page.run("plots.zoom(null)")
    page.wait(f"{scales}[1][1] > 5")


@pytest.mark.long
def test_two_logs_side_by_side_on_one_time_axis(logs: list[Path], window: Page, served_logs: str) -> None:
    window.open(served_logs)
    window.wait("document.querySelectorAll('.lane').length === 2")
    assert window.run("[...document.querySelectorAll('#view-field h2')].map(each => each.textContent)") == [
        each.name for each in logs
    ]
    window.run("clock.seek(5)")
    window.wait(f"{SHOWN} === 5")
    places = window.run("[...document.querySelectorAll('.where')].map(each => each.textContent)")
    assert len(set(places)) == 2
    window.run("sources.forEach(each => plots.add(new FieldSeries(each.row('Kalman Position Response'), 'x')))")
    assert window.run("plots.all[0].series.map(each => each.name)") == [
        f"{each.name}: Kalman Position Response.x" for each in logs
    ]
    window.run("sources.forEach(each => plots.add(new FieldSeries(each.row('Kalman Position Response'), 'y')))")
    lines = window.run("plots.all[0].lines.map(each => `${each.colour} ${each.dash}`)")
    assert len(set(lines)) == 4, "one robot is of one colour; its values, and the logs, differ by their dashes"


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1600, 1280, 390])
def test_every_view_fits_and_names_its_controls(page: Page, width: int, dark: bool) -> None:
    page.size(width, dark=dark)
    page.run("clock.seek(5)")
    unnamed = """[...document.querySelectorAll('button, input, select, [role=button]')].filter(each => each.offsetParent
        && !(each.textContent.trim() || each.getAttribute('aria-label') || each.labels?.length)).length"""
    for name in page.run("[...document.querySelectorAll('[role=tab]')].filter(tab => !tab.hidden).map(tab => tab.id)"):
        page.click(f"#{name}")
        page.run("new Promise(done => setTimeout(done, 150))")
        assert (name, page.run("document.documentElement.scrollWidth - innerWidth")) == (name, 0)
        assert (name, page.run(unnamed)) == (name, 0)
    colour = json.loads(page.run("JSON.stringify(getComputedStyle(document.body).backgroundColor.match(/\\d+/g))"))
    assert (int(colour[0]) < 128) is dark


@pytest.mark.parametrize("width", [1600, 1280, 1100, 390])
def test_no_name_on_the_field_is_smaller_than_11_pixels(page: Page, width: int) -> None:
    page.size(width)
    page.run("clock.seek(clock.end)")
    sizes = "[...document.querySelectorAll('.field text')].map(each => each.getBoundingClientRect().height)"
    page.wait(f"Math.min(...{sizes}.filter(each => each > 0)) >= 11")


@pytest.mark.parametrize(("width", "rows"), [(1440, 14), (1280, 12), (1100, 9)])
def test_a_laptop_has_a_table_of_many_messages(page: Page, width: int, rows: int) -> None:
    page.size(width, 800)
    page.run("clock.seek(clock.end)")
    page.wait("getComputedStyle(document.querySelector('.messages tr')).display === 'table-row'")
    count = page.run("""new Promise(done => {
        const foot = document.querySelector("footer");
        const isSeen = ({height, bottom}) => height && bottom < foot.getBoundingClientRect().top;
        const rows = () => [...document.querySelectorAll(".messages tbody tr")];
        const look = (before, same) => requestAnimationFrame(() => {  // the page draws its parts one after the other
            const now = rows().filter(each => isSeen(each.getBoundingClientRect())).length;
            same === 30 ? done(now) : look(now, now === before ? same + 1 : 0);
        });
        look(-1, 0);
    })""")
    assert count >= rows


def test_columns_are_chosen(page: Page) -> None:
    page.run("clock.seek(clock.end)")
    shown = "getComputedStyle(document.querySelector('.messages .jitter')).display"
    assert page.run(shown) == "none"
    page.click(".columns summary")
    page.click(".columns label:nth-of-type(3) input")
    page.wait(f"{shown} === 'table-cell'")


def test_a_search_that_finds_nothing_says_so(page: Page) -> None:
    page.run("clock.seek(clock.end)")
    page.click("#search")
    for letter in "xyz":
        page.press(letter)
    page.wait("document.body.textContent.includes('No message, protocol or node passes the filter.')")


def test_a_robot_that_is_no_longer_seen_is_hollow_and_says_its_age(page: Page) -> None:
    stale = "document.querySelectorAll('.robots .stale').length"
    page.run("clock.seek(clock.end)")
    assert page.run(stale) == 0
    page.run("sources[0].rows.forEach(row => { row.times = row.times.map(time => time - 5); })")
    page.run("clock.seek(clock.end - 0.01)")
    page.wait(f"{stale} > 0")
    assert "5 s ago" in page.run("document.querySelector('.names').textContent")
    assert "seen 5." in page.text(".field-panel .where")


def test_a_robot_is_drawn_by_its_outline(window: Page, tmp_path: Path) -> None:
    file = tmp_path / "match.html"
    outline = "body.outline=[[120, 60], [-120, 60], [-120, -60], [120, -60]]"
    assert cli.main(["match", "--for", "6", "--set", outline, "--field", str(file)]) == 0
    window.open(file.as_uri())
    window.run("clock.seek(clock.end)")
    window.wait("document.querySelector('.robot polygon')")
    shape = window.run("document.querySelector('.robot polygon').getAttribute('points')")
    assert shape == "120,-60 -120,-60 -120,60 120,60", "y grows downwards on the drawing"
    assert window.run("document.querySelectorAll('.robot polygon').length") == 1, "the others are discs"


def test_a_replay_opens_where_a_robot_is_seen_first(page: Page) -> None:
    first = page.run("""Math.min(...[...sources[0].rows.values()]
        .filter(each => each.name.endsWith('Position Response'))
        .map(each => each.times[each.columns[0].findIndex(x => x !== null)]))""")
    assert 0 < first < end(page)
    page.wait(f"Math.abs({SHOWN} - {first}) < 0.001")
    page.wait("document.querySelector('.robot[visibility=visible]')")


def test_a_match_opens_playing_unless_it_is_loaded_again(logs: list[Path], window: Page, tmp_path: Path) -> None:
    file = tmp_path / "match.html"
    assert cli.main(["field", str(logs[0]), "-o", str(file)]) == 0
    window.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "no-preference"}])
    window.open(file.as_uri())
    window.wait(f"clock.running && {SHOWN} > 0.5")
    window.run("clock.pause()")
    window.reload()
    assert not window.run("clock.running")
    window.call("Emulation.setEmulatedMedia", features=[])


def test_a_reload_keeps_the_place_in_the_log(page: Page) -> None:
    page.run("clock.seek(4.25); plots.put('A', 3); plots.zoom([2, 5])")
    page.reload()
    page.wait(f"typeof plots !== 'undefined' && {SHOWN} === 4.25")
    assert page.run("[plots.marks.A, plots.zoomed]") == [3, [2, 5]]


ENEMY = "sources[0].row('Enemy 1 Position Response')"


def test_a_place_out_of_reach_is_a_dot_and_no_spike(page: Page) -> None:
    page.run("clock.seek(clock.end)")
    trail = "[...document.querySelectorAll('.trail')].map(each => each.getAttribute('points')).join(' ')"
    dot = "[...document.querySelectorAll('.dots circle')].some(each => each.getAttribute('cx') === '17')"
    page.wait(f"{trail}.length > 0")
    assert not page.run(dot)
    page.run(f"(row => {{ row.columns[0][row.times.length - 6] = 17; }})({ENEMY})")
    page.run("clock.seek(clock.end - 0.01)")
    page.wait(dot)
    assert not any(each.startswith("17,") for each in page.run(trail).split())


def test_a_lost_node_greys_its_part(page: Page) -> None:
    page.run("clock.seek(clock.end)")
    lost = "[...document.querySelectorAll('tr.lost th')].map(each => each.textContent)"
    page.wait("document.querySelectorAll('.messages tbody tr').length > 5")
    assert page.run(lost) == []
    # its heartbeats end in the middle
    page.run("(row => { row.times = row.times.filter(time => time < 3); })(sources[0].rows.get(0x703))")
    page.run("clock.seek(clock.end - 0.01)")
    page.wait(f"{lost}.includes('Navi Position Response')")
    assert "Kalman Position Response" not in page.run(lost), "the drive sends it"
    assert page.run("document.querySelectorAll('.robot.lost').length") > 0
    assert page.run("document.querySelector('.robot').classList.contains('lost')") is False
    page.run("sources[0].rows.get(0x702).times = []")  # it was never heard
    assert page.run("nodeNow(sources[0], sources[0].nodes.find(each => each.name === 'drive'), 3).life") == "unknown"


@pytest.mark.parametrize("size", [(390, 844), (360, 640)], ids=str)
def test_on_a_phone_the_header_takes_a_tenth_at_most(page: Page, size: tuple[int, int]) -> None:
    page.size(*size)
    assert page.run("document.querySelector('header').getBoundingClientRect().height") <= size[1] / 10


@pytest.mark.parametrize("width", [1600, 1280, 390])
def test_the_numbers_of_the_axes_are_off_the_border(page: Page, width: int) -> None:
    page.size(width)
    page.run("document.querySelector('#tab-field').hidden || document.querySelector('#tab-field').click()")
    page.run("clock.seek(clock.end)")
    gaps = page.run("""(() => {
        const box = each => each.getBoundingClientRect(), field = box(document.querySelector('.field rect'));
        return [...document.querySelector('.field > g').querySelectorAll('text')]
            .filter(each => /^[0-9]+$/.test(each.textContent)).map(box)
            .filter(each => each.left < field.left - 9 || each.top > field.bottom - 9)
            .map(each => Math.max(field.left - each.right, each.top - field.bottom));
    })()""")
    assert len(gaps) == 12
    assert min(gaps) >= 2


def test_a_match_has_the_window_with_its_clock_points_nodes_and_words(
    window: Page, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strategy, file = tmp_path / "talks.py", tmp_path / "match.html"
    strategy.write_text("""async def play(core):
        core.say("to the <b>frescos</b>")
        while (await core.goto(1400, 1800, 90, 80)).outcome.value != "arrived":
            pass
        await core.act("frescos")
    """)
    words = [
        "--strategy",
        str(strategy),
        "--for",
        "12",
        "--enemies",
        "0",
        "--confederates",
        "0",
        "--set",
        "tasks.frescos.chance=1",
    ]
    assert cli.main(["match", *words, "--field", str(file)]) == 0
    assert "says       to the <b>frescos</b>\n" in capsys.readouterr().out
    window.size(1400)
    window.open(file.as_uri())
    assert window.run("document.querySelector('svg.field').clientWidth") > 1000
    begin = float(window.run("sources[0].sortedEvents().find(each => each.kind === 'said').time"))
    for time, shown in ((begin + 1, "to the <b>frescos</b>"), (begin + 11.5, "")):
        window.run(f"clock.seek({time})")
        window.wait(f"Number(document.body.dataset.time) === {round(time, 3)}")
        assert window.text(".board .caption") == (f"ours: {shown}" if shown else "")
    points = "sources[0].sortedEvents().filter(each => each.kind === 'points').map(each => each.data.points)"
    made = sum(window.run(points))
    assert made
    assert window.text(".board .points") == f"ours {made}"
    assert [each in window.text(".board") for each in ("core operational", "drive operational")] == [True, True]


FITS = """(() => {
    const page = document.documentElement, main = document.querySelector('main');
    const box = each => each.getBoundingClientRect();
    const drawn = [...document.querySelectorAll('svg.field:not(.sample), .legend.hint')];
    return page.scrollHeight === page.clientHeight && main.scrollHeight === main.clientHeight
        && drawn.every(each => box(each).bottom <= box(document.querySelector('footer')).top);
})()"""
"""Whether a page's field and its legend are seen without scrolling."""


@pytest.mark.parametrize("size", [(1440, 900), (1280, 720), (1000, 1300)])
def test_a_field_with_its_legend_fits_into_the_window(page: Page, size: tuple[int, int]) -> None:
    page.size(*size)
    page.run("document.querySelector('#tab-field').click()")
    page.run("clock.seek(5)")
    page.wait(FITS)
    assert page.run("document.querySelector('svg.field').getBoundingClientRect().height") > 0.6 * size[1]


@pytest.mark.parametrize("size", [(1440, 900), (1280, 720)])
def test_two_fields_are_of_one_size_with_one_legend(
    logs: list[Path], window: Page, served_logs: str, size: tuple[int, int]
) -> None:
    window.size(*size)
    window.open(f"{served_logs}#field")
    window.run("clock.seek(5)")
    window.wait(FITS)
    sizes = window.run("""[...document.querySelectorAll('svg.field:not(.sample)')].map(each => {
        const box = each.getBoundingClientRect();
        return `${box.top} ${box.width} ${box.height}`;
    })""")
    assert (len(sizes), len(set(sizes))) == (len(logs), 1)
    assert window.run("document.querySelectorAll('.legend.hint').length") == 1


def test_names_of_robots_cover_neither_each_other_nor_other_words(page: Page) -> None:
    # Our confederate where we are: both names would stand at the same place.
    page.run("""(() => {
        const [ours, other] = ['Kalman', 'Confederate'].map(each => sources[0].row(`${each} Position Response`));
        other.columns = other.columns.map((column, place) => column.map((_, each) =>
            place < 2 ? ours.columns[place][Math.min(each, ours.times.length - 1)] : column[each]));
    })()""")
    covered = page.run("""(async () => {
        let covered = 0;
        for (let time = 0; time < clock.end; time += 0.5) {
            clock.seek(time);
            await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
            const boxes = [...document.querySelectorAll('.field .names text, .field:not(.sample) text')]
                .filter(each => each.textContent && each.getAttribute('visibility') !== 'hidden')
                .sort((one, two) => two.matches('.names text') - one.matches('.names text'));
            const names = boxes.filter(each => each.matches('.names text')).length;
            const all = boxes.map(each => each.getBoundingClientRect());
            all.slice(0, names).forEach((one, place) => all.slice(place + 1).forEach(other => {
                const beside = one.left >= other.right || other.left >= one.right;
                if (!beside && one.top + 4 < other.bottom && other.top + 4 < one.bottom) covered += 1;
            }));
        }
        return covered;
    })()""")
    assert covered == 0


def test_gotos_of_an_earlier_match_leave_the_field(page: Page) -> None:
    page.run("clock.seek(clock.end)")
    page.wait("document.querySelectorAll('.field .targets > *, .field .marks > *').length > 0")
    page.run("""(() => {
        const start = sources[0].sortedEvents().find(each => each.kind === 'start');
        sources[0].events.set('again', {...start, key: 'again', time: clock.end, data: {...start.data, items: []}});
        stale = true;
    })()""")
    page.wait("document.querySelectorAll('.field .targets > *, .field .marks > *').length === 0")


@pytest.mark.long
def test_each_served_log_has_its_diagnosis(logs: list[Path], window: Page, tmp_path: Path) -> None:
    (broken := tmp_path / "broken.log").write_text("(0.000000) can0 081#1081110000000000\n")
    with command("serve", "--listen", "127.0.0.1:0", str(logs[0]), str(broken)) as process:
        window.open(f"{line(process, 'http://').split()[0]}#diagnosis")
        said = window.run("[...document.querySelectorAll('#view-diagnosis section')].map(each => each.innerText)")
    fine, wrong = (each.split("\n") for each in said)
    assert [each[0] for each in (fine, wrong)] == [logs[0].name, "broken.log"]
    assert next(filter(None, fine[1:])).startswith("Nothing is wrong in")
    assert "core: EMCY 0x8110" in next(filter(None, wrong[1:]))


def test_a_served_log_has_what_lies_beside_it(logs: list[Path], window: Page, served_logs: str) -> None:
    assert [each.with_name(f"{each.name}.truth.json").is_file() for each in logs] == [True, True]
    window.open(served_logs)
    assert window.run("sources.map(each => each.row('True position').times.length > 10)") == [True, True]


def test_tabs_go_by_arrows_home_and_end_and_lead_into_their_view(page: Page) -> None:
    page.size(390)
    page.click("#tab-field")
    for key, tab in (("ArrowRight", "messages"), ("End", "events"), ("ArrowRight", "field"), ("ArrowLeft", "events"),
                     ("Home", "field")):  # fmt: skip
        page.press(key)
        assert page.run("[document.activeElement.id, document.activeElement.getAttribute('aria-selected')]") == [
            f"tab-{tab}", "true",
        ]  # fmt: skip
    page.call("Input.dispatchKeyEvent", type="keyDown", key="Tab", code="Tab", windowsVirtualKeyCode=9)
    assert page.run("document.activeElement.id") == "view-field"
    assert page.run("document.activeElement.getAttribute('role')") == "tabpanel"


def test_faults_are_said_to_who_does_not_see_the_page(page: Page) -> None:
    assert page.run("document.querySelector('#alarms').getAttribute('role')") == "alert"
    page.run("clock.seek(clock.end)")
    assert page.text("#alarms") == ""
    page.run("""sources[0].events.set('e', {key: 'e', kind: 'EMCY', time: 1, text: 'drive, 0x8130 heartbeat',
        end: null, wrong: true, data: {node: 'drive'}})""")
    page.run("(row => { row.times = row.times.filter(time => time < 3); })(sources[0].rows.get(0x703))")
    page.run("clock.seek(clock.end - 0.01)")
    page.wait("document.querySelector('#alarms').textContent === 'navigation is lost; drive, 0x8130 heartbeat'")
