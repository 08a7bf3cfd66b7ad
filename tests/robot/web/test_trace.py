"""The trace in a real browser: every frame in the order of the bus, found, held, copied and exported."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import can
import pytest

from eurobot_od import cli
from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.frame import Frame
from eurobot_od.traffic.formats import read
from tests.robot.web.scene import live_page
from tests.web.browser import Page
from tests.web.scene import channel

PLACE = "x=197 mm, y=1802 mm, angle=359 deg, source=internal"
LINES = "[...document.querySelectorAll('.trace .lines .line')]"


class Scene(NamedTuple):
    page: Page
    bus: can.BusABC

    def send(self, *frames: str) -> None:
        """Send frames, and wait until the page has them."""
        before = self.page.run("sources[0].frames.length")
        for each in frames:
            Driver(self.bus).send(Frame.parse(each))
        self.page.wait(f"sources[0].frames.length === {before + len(frames)}")

    def cells(self) -> list[list[str]]:
        """Return what is written in the lines that are in sight, but for the times and the channel."""
        self.page.run("traces[0].show(clock.time)")
        found: list[list[str]] = self.page.run(
            f"{LINES}.map(each => [...each.children].slice(2).map(cell => cell.textContent))"
        )
        return found

    def choose(self, name: str, value: str) -> None:
        self.page.run(f"traces[0].filter({json.dumps(name)}, {json.dumps(value)})")

    def kept(self, act: str) -> str:
        """Return the text of a file that the page saves."""
        return str(
            self.page.run(f"""(async () => {{
            let kept = null;
            URL.createObjectURL = blob => {{ kept = blob; return '#'; }};
            {act};
            return kept.text();
        }})()""")
        )


@pytest.fixture
def scene(tmp_path: Path, window: Page) -> Iterator[Scene]:
    name = channel()
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        window.may_lose_its_server = True
        window.open(served.address)
        window.wait("connection.alive && connection.control")
        window.click("#tab-trace")
        yield Scene(window, bus)


def test_a_line_for_each_frame_in_the_order_of_the_bus(scene: Scene) -> None:
    scene.send("701#05", "100#C5A0706701", "555#0102", "008#0000", "701#05")
    assert scene.cells() == [
        ["701", "1", "05", "Heartbeat core", "core, operational"],
        ["100", "5", "C5 A0 70 67 01", "Kalman Position Response", PLACE],
        ["555", "2", "01 02", "not in any file", ""],
        ["008", "2", "00 00", "Goto XY", "! wrong length: Goto XY (0x008): 2 bytes of data, expected 6 or 8"],
        ["701", "1", "05", "Heartbeat core", "core, operational"],
    ]  # fmt: skip
    assert scene.page.run(f"{LINES}.map(each => each.matches('.is-wrong'))") == [False, False, False, True, False]


def test_a_request_stands_before_its_answer(scene: Scene) -> None:
    """With nobody to answer, the requests of the page are in the trace all the same."""
    scene.page.run("connection.ask({do: 'send frame', frame: '612#4000100000000000'})")
    scene.page.wait("sources[0].frames.length === 1")
    scene.send("592#43001000920102 00".replace(" ", ""))
    assert [each[0] for each in scene.cells()] == ["612", "592"]


FRAMES = ("701#05", "702#05", "100#C5A0706701", "080#C5A0706701", "185#00")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("node", "core", ["701", "100"]),
        ("message", "Heartbeat drive", ["702"]),
        ("identifier", "100", ["100"]),
        ("identifier", "100-1ff", ["100", "185"]),
        ("text", "position", ["100", "080"]),
        ("text", "c5a0", ["100", "080"]),
        ("text", "nothing has this", []),
    ],
)
def test_filters(scene: Scene, name: str, value: str, expected: list[str]) -> None:
    scene.send(*FRAMES)
    scene.choose(name, value)
    assert [each[0] for each in scene.cells()] == expected
    assert scene.page.text(".trace .hint").startswith(f"{len(expected)} frame")
    scene.choose(name, "")
    assert len(scene.cells()) == len(FRAMES)


def test_filtered_frames_are_exported_and_can_be_read_again(scene: Scene, tmp_path: Path) -> None:
    scene.send(*FRAMES)
    scene.choose("identifier", "100-7FF")
    log = tmp_path / "trace.log"
    log.write_text(scene.kept("traces[0].export('log')"))
    with log.open("rb") as file:
        assert [str(raw) for *_, raw in read(file)] == [each for each in FRAMES if not each.startswith("080")]
    head, *lines = scene.kept("traces[0].export('csv')").splitlines()
    assert head == '"time","channel","identifier","length","data","message","meaning"'
    assert len(lines) == 4


def test_times_are_relative_absolute_and_from_line_to_line(scene: Scene) -> None:
    scene.send("701#05", "702#05")
    times: dict[str, Any] = scene.page.run("""Object.fromEntries(Object.entries(TIMES).map(([name, form]) =>
        [name, form(sources[0].frames[1], sources[0].frames[0], traces[0])]))""")
    one, two = scene.page.run("sources[0].frames.map(each => each.time)")
    assert float(times["Relative"]) == pytest.approx(two, abs=1e-5)
    assert float(times["Delta"]) == pytest.approx(two - one, abs=2e-5)
    assert times["Absolute"].count(":") == 2
    assert times["To mark"] == "mark a line"


def test_the_trace_is_paused_and_goes_on(scene: Scene) -> None:
    scene.send("701#05")
    scene.page.run("traces[0].follow(false)")
    scene.send("702#05")
    assert [each[0] for each in scene.cells()] == ["701"]
    scene.page.run("traces[0].pauser.click()")
    assert [each[0] for each in scene.cells()] == ["701", "702"]


def test_one_line_for_each_message(scene: Scene) -> None:
    scene.send("701#05", "100#C5A0706701", "701#7F", "100#C4A0706701")
    scene.page.run("[...document.querySelectorAll('.trace button')].find(each => each.textContent === 'Fixed').click()")
    assert [each[:3] for each in scene.cells()] == [["100", "5", "C4 A0 70 67 01"], ["701", "1", "7F"]]


def test_an_event_leads_to_its_frame(scene: Scene) -> None:
    scene.send("701#05", "082#3081110000000000", *["701#05"] * 100)
    scene.page.click("#tab-events")
    emcy = "[...document.querySelectorAll('.events button')].find(each => each.textContent.includes('0x8130'))"
    scene.page.wait(emcy)
    scene.page.run(f"{emcy}.click()")
    scene.page.wait("document.querySelector('.trace .marked')")
    assert "0x8130" in scene.page.text(".trace .marked")


def test_a_hundred_thousand_frames_are_quick_to_filter_and_to_scroll(scene: Scene) -> None:
    scene.send("701#05")
    scene.page.run("""(() => {
        const {frames} = sources[0], [one] = frames;
        for (let number = 1; number < 100000; number++) {
            frames.push({...one, number, time: number / 1000, data: number.toString(16).padStart(8, '0')});
        }
    })()""")
    ms = scene.page.run("""(() => {
        const begin = performance.now();
        traces[0].filter('text', '0001');
        traces[0].filter('text', '');
        for (const place of [0, 0.5, 0.9]) {
            traces[0].box.scrollTop = place * traces[0].box.scrollHeight;
            traces[0].draw(false);
        }
        return performance.now() - begin;
    })()""")
    assert scene.page.run(f"{LINES}.length") < 100, "only what is in sight is in the page"
    assert scene.page.run("document.querySelector('.trace .space').offsetHeight") == 100_000 * 24
    assert ms < 5000  # a third of a second on a machine that has nothing else to do


def test_the_history_is_there_after_a_reload(scene: Scene) -> None:
    scene.send(*FRAMES)
    scene.page.reload()
    scene.page.wait("typeof sources !== 'undefined' && sources[0].frames.length === 5")
    assert scene.page.run("sources[0].frames.map(each => identifier(each.row.id))") == [each[:3] for each in FRAMES]
    assert scene.page.run("sources[0].row('Kalman Position Response').times.length") == 1


def test_a_log_has_a_trace_too(tmp_path: Path, window: Page) -> None:
    log, file = tmp_path / "match.log", tmp_path / "match.html"
    assert cli.main(["match", "--for", "3", "--log", str(log)]) == 0
    assert cli.main(["field", str(log), "-o", str(file)]) == 0
    window.open(file.as_uri())
    window.click("#tab-trace")
    window.wait(f"{LINES}.length > 10")
    with log.open("rb") as opened:
        frames = [raw for *_, raw in read(opened)]
    assert window.run("traces[0].lines().map(each => `${each[2]}#${each[4].replaceAll(' ', '')}`)") == [
        str(each) for each in frames
    ]
    for time in ("0", "clock.end"):
        window.run(f"clock.seek({time})")
        window.wait(f"{LINES}.some(each => Math.abs(each.frame.time - {time}) < 0.1)")
    assert window.run("document.documentElement.scrollHeight - innerHeight") == 0, "the player covers no line"
    window.run(f"{LINES}[3].click()")
    window.wait("Math.abs(Number(document.body.dataset.time) - traces[0].marked.time) < 0.001")
