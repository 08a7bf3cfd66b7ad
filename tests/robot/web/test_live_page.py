"""The page of a live bus in a real browser, against the simulated truth."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot.model.messages import KalmanPositionResponse, StartConfigurationSet
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.world import World
from eurobot_od.traffic.formats import read
from eurobot_od.traffic.meaning import Decoder
from tests.cli.processes import command, line
from tests.eds_text import with_entry
from tests.robot.conftest import EDS
from tests.robot.web.scene import live_page, robot
from tests.web.browser import PATIENCE, Browser, Page
from tests.web.scene import LONG, Served, channel
from tests.web.test_drives import bench

GOAL = (700, 1600)
NEAR = 60.0
"""mm that an estimated place may be off the true one."""

STATE = EurobotProtocol.load().encode(KalmanPositionResponse(700, 1600, 0, Source.INTERNAL))
KALMAN = "sources[0].row('Kalman Position Response')"
DRAWN = """(() => {
    const found = document.querySelector('.robot').getAttribute('transform');
    if (!found) return null;
    const [x, y] = found.match(/-?[\\d.]+/g).map(Number);
    return [x, 2000 - y];
})()"""

RESET_CORE = "connection.ask({do: 'nmt', command: 'reset', node: 'core', sure: true})"
CORE_IS_BACK = "[...sources[0].health].find(each => each.name === 'core').state === 'operational'"


class Scene(NamedTuple):
    served: Served
    world: World
    page: Page
    channel: str


@pytest.fixture
def scene(tmp_path: Path, window: Page) -> Iterator[Scene]:
    """Our robot on a bus, and the page that may control it, in a browser."""
    name = channel()
    with robot(name) as (_, world), live_page(name, tmp_path) as served:
        window.may_lose_its_server = True  # which ends before the window is closed
        window.open(served.address)
        window.wait(f"{KALMAN} && {KALMAN}.times.length > 1 && connection.control")
        yield Scene(served, world, window, name)


def send_goto(page: Page) -> None:
    page.run(f"""(() => {{
        const [x, y] = document.querySelectorAll('form.goto input');
        [x.value, y.value] = {json.dumps(GOAL)};
    }})()""")
    page.click("form.goto button")  # what moves something is asked twice
    page.wait("document.querySelector('form.goto button.armed')")
    page.click("form.goto button")


def true_place(world: World) -> tuple[float, float]:
    _, pose = world.path[-1]
    return pose.x, pose.y


def test_a_goto_from_the_page_arrives_and_the_drawing_goes_with_the_truth(scene: Scene) -> None:
    page = scene.page
    send_goto(page)
    drawn = []
    end = time.monotonic() + PATIENCE
    while not page.run("[...sources[0].events.values()].some(each => each.text.endsWith('arrived'))"):
        assert time.monotonic() < end, page.run("[...sources[0].events.values()].map(each => each.text).join()")
        drawn.append(tuple(page.run(DRAWN)))
        page.run("new Promise(done => setTimeout(done, 50))")
    page.wait(f"Math.hypot({DRAWN}[0] - {GOAL[0]}, {DRAWN}[1] - {GOAL[1]}) < {NEAR}")
    assert math.dist(true_place(scene.world), GOAL) < NEAR
    truth = [(pose.x, pose.y) for _, pose in scene.world.path]
    assert len(set(drawn)) > 4  # it moved, and did not jump; a busy machine draws less often
    assert max(min(math.dist(each, there) for there in truth) for each in drawn) < NEAR
    assert "goto 1" in page.run("[...sources[0].events.values()].map(each => each.text).join()")


def test_how_a_goto_ends_is_asked_although_the_page_hears_late_of_its_beginning(scene: Scene) -> None:
    page = scene.page
    page.run("""(() => {
        const source = sources[0], heard = source.events, late = performance.now() + 2000;
        const old = new Map(heard);
        Object.defineProperty(source, "events", {get: () => performance.now() < late ? old : heard});
    })()""")
    send_goto(page)
    page.wait("[...sources[0].events.values()].some(each => each.text.endsWith('arrived'))")


def test_a_click_on_the_field_is_a_place(scene: Scene) -> None:
    scene.page.click("svg.field")
    x, y = scene.page.run("[...document.querySelectorAll('form.goto input')].map(each => Number(each.value))")[:2]
    assert math.dist((x, y), (1500, 1000)) < 100


def test_stop_stops(scene: Scene) -> None:
    send_goto(scene.page)
    scene.page.wait(f"{DRAWN}[0] > 230")
    scene.page.press("Escape")
    scene.page.wait("[...sources[0].events.values()].some(each => each.kind === 'stop')")
    scene.page.wait(f"{KALMAN}.times.length > 0 && sources[0].row('Stop Drive') !== null")
    x, _ = true_place(scene.world)
    assert 200 < x < GOAL[0] - NEAR
    count = "sources[0].row('Stop Drive').latest.count"
    before = scene.page.run(count)
    scene.page.click("#stop")
    scene.page.wait(f"{count} > {before}")
    scene.page.run(RESET_CORE)  # one that is held could not see whether the robot stands, and would not end
    scene.page.wait(CORE_IS_BACK)


@contextmanager
def plan_of(core: Core) -> Iterator[threading.Event]:
    """Run a core that goes back and forth by a plan that no error ends, but the event."""
    over = threading.Event()

    def carry_out() -> None:
        while not over.wait(0.02):
            for x in (700, 400):
                with suppress(EurobotError):
                    core.goto(x, 1600, 0, 50).result(LONG)

    thread = threading.Thread(target=carry_out, daemon=True)
    thread.start()
    try:
        yield over
    finally:
        over.set()
        core.leave()
        thread.join(LONG)


def test_stop_ends_a_whole_plan_until_go(tmp_path: Path, window: Page) -> None:
    name, window.may_lose_its_server = channel(), True
    with robot(name) as (core, world), live_page(name, tmp_path) as served, plan_of(core) as over:
        window.open(served.address)
        window.wait("connection.control && sources[0].row('Goto XY')")
        window.click("#stop")
        window.wait("!toastLine.hidden")
        assert window.text("#toast").startswith("stop sent: core held until NMT start or reset; 004#")
        window.wait("sources[0].row('Stop Drive')?.latest.count >= 2")
        count = "sources[0].row('Goto XY').latest.count"
        before = window.run(count)
        window.run("new Promise(done => setTimeout(done, 2500))")  # long enough for a dozen gotos of this plan
        assert window.run(count) == before
        stood = true_place(world)
        # The core has shut the drive down, as it may no longer ask whether it stands.
        goto = {"do": "send", "message": "Goto XY", "fields": {"x": "400", "y": "1700", "angle": "0", "speed": "50"}}
        refused = window.run(f"connection.ask({json.dumps(goto)}).catch(error => error.message)")
        assert refused == "no goto: an Emergency Shutdown has ended all of them until a Start Configuration Set"
        assert true_place(world) == stood
        over.set()  # the end of the program: a plan that goes on whatever happens would do so now
        window.run(RESET_CORE)
        window.wait(CORE_IS_BACK)
        names = ("enemies", "confederates", "enemy_1_diameter", "enemy_2_diameter")
        fields = {"team_colour": "red", **dict.fromkeys(names, "0")}
        window.run(f"connection.ask({{do: 'send', message: 'Start Configuration Set', fields: {json.dumps(fields)}}})")
        window.wait(f"{KALMAN}.latest && {KALMAN}.latest.values[0] !== null")
        send_goto(window)
        window.wait(f"{count} === {before + 1}")
        window.wait("[...sources[0].events.values()].some(each => each.text.endsWith('arrived'))")


@pytest.mark.parametrize("width", [390, 820, 1440])
def test_stop_and_go_are_far_apart_however_the_page_is_scrolled(scene: Scene, width: int) -> None:
    page = scene.page
    page.size(width, 844)
    gap = """(() => {
        const box = each => document.querySelector(each).getBoundingClientRect();
        const [one, two] = [box('#stop'), box('form.goto .main')];
        return Math.max(one.left - two.right, two.left - one.right, one.top - two.bottom, two.top - one.bottom);
    })()"""
    if width < 1200:  # on a wider window the field stands beside the other views
        page.wait("!document.querySelector('#tab-field').hidden")
        page.click("#tab-field")
    page.wait("document.querySelector('form.goto .main').offsetParent && !document.querySelector('#stop').hidden")
    for place in ("start", "center", "end"):
        page.run(f"document.querySelector('form.goto .main').scrollIntoView({{block: '{place}'}})")
        assert page.run(gap) > 100


def test_send_opens_on_nothing_and_is_armed_by_a_choice(scene: Scene) -> None:
    page = scene.page
    page.click("#tab-send")
    assert page.run(
        "[document.querySelector('form.send select').value, document.querySelector('form.send .main').disabled]"
    ) == ["", True]
    assert page.run("document.querySelectorAll('.fields label').length") == 0
    assert page.run("[...document.querySelectorAll('form.send button')].every(each => each.disabled)")
    page.run("""(ask => {
        window.asked = [];
        connection.ask = function (said, ...more) { asked.push(said.do); return ask.call(this, said, ...more); };
    })(connection.ask)""")
    page.click("form.send .main")
    assert page.run("asked.filter(each => each !== 'lists')") == [], "nothing was asked of the server"
    page.run("""(() => {
        const chosen = document.querySelector('form.send select');
        chosen.value = 'Goto XY';
        chosen.dispatchEvent(new Event('change'));
    })()""")
    assert page.run("document.querySelectorAll('.fields label').length") > 4
    values = page.run("Object.fromEntries([...document.querySelectorAll('.fields label')].map(each => "
        "[each.firstChild.textContent, each.querySelector('input, select').value]))")  # fmt: skip
    assert {name: values[name] for name in ("x in mm", "y in mm", "angle in deg", "speed in %")} == dict.fromkeys(
        ("x in mm", "y in mm", "angle in deg", "speed in %"), ""
    ), "only what the file gives is filled in"


def sends(page: Page) -> int:
    """Return how many requests to send something the page has made."""
    return int(page.run("window.sends ?? 0"))


def test_nothing_is_sent_before_all_is_filled_in_and_what_moves_asks_twice(scene: Scene) -> None:
    page = scene.page
    page.click("#tab-send")
    page.run("""(() => {
        const ask = connection.ask;
        connection.ask = function (what) {
            if (what.do === 'send') window.sends = (window.sends ?? 0) + 1;
            return ask.call(this, what);
        };
        const chosen = document.querySelector('form.send select');
        chosen.value = 'Goto XY';
        chosen.dispatchEvent(new Event('change'));
    })()""")
    button = "[...document.querySelectorAll('form.send .main')].find(each => each.offsetParent)"
    for _ in range(2):
        page.run(f"{button}.click()")
    page.wait("document.querySelector('.answer').textContent === 'not sent: x, y, angle, speed are empty'")
    assert sends(page) == 0
    page.run(
        "[700, 1600, 0, 50].forEach((value, place) => {"
        " document.querySelectorAll('.fields input')[place].value = value; })"
    )
    page.run(f"{button}.click()")
    assert page.run(f"{button}.textContent") == "Send: press again"
    assert sends(page) == 0
    page.run(f"{button}.click()")
    page.wait("document.querySelector('.answer').textContent.startsWith('sent 008#')")
    assert sends(page) == 1
    for view, button in (("send", ".card > .buttons button"), ("nodes", ".card .sure:nth-child(4) button")):
        page.click(f"#tab-{view}")
        page.wait(f"document.querySelector('#view-{view} {button}')?.offsetParent")
        page.click(f"#view-{view} {button}")
        page.wait(f"document.querySelector('#view-{view} {button}').textContent.endsWith('press again')")
        assert page.text(f"#view-{view} .reason:not([hidden])").startswith(("NMT start lets all nodes", "a reset of "))
    assert not page.run("sources[0].rows.has(0)"), "no NMT command is on the bus"


def test_a_plot_ends_with_the_last_value(scene: Scene) -> None:
    page = scene.page
    page.click("#tab-messages")
    page.run("""(() => {
        const lines = [...document.querySelectorAll('table.messages tr')];
        const line = lines.find(each => each.textContent.includes('Kalman Position Response'));
        line.querySelector('.value').click();
    })()""")
    page.click("#tab-plots")
    page.wait("plots.all[0].chart !== null")
    shown, last = page.run(f"plots.all[0].data().then(found => [found[1].at(-1), {KALMAN}.columns[0].at(-1)])")
    assert shown == last
    assert abs(last - true_place(scene.world)[0]) < NEAR
    page.wait("document.querySelector('.legend b').textContent.endsWith(' mm')")
    names = page.run("plots.all[0].series.map(each => each.name)")
    assert names == ["Kalman Position Response.x"]


def test_dragging_a_value_into_a_plot(scene: Scene) -> None:
    page = scene.page
    page.click("#tab-plots")
    page.run("""(() => {
        const data = new DataTransfer();
        data.setData('text/plain', JSON.stringify([0, 'Kalman Position Response', 'angle']));
        document.querySelector('.plot').dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true}));
    })()""")
    assert page.run("plots.all[0].series[0].name") == "Kalman Position Response.angle"


def test_objects_are_read_written_and_plotted(scene: Scene) -> None:
    page = scene.page
    page.click("#tab-objects")
    page.run("""(() => {
        const chosen = document.querySelector('#view-objects select');
        chosen.value = 'drive';
        chosen.dispatchEvent(new Event('change'));
    })()""")
    line = """[...document.querySelectorAll('table.objects tr')].find(each => each.textContent.includes('0x1017:0'))"""
    page.wait("document.querySelector('.tree details')")
    closed = "document.querySelectorAll('.tree details:not([open])').length"
    assert page.run(closed) > 0
    assert page.run("document.querySelectorAll('.tree details:not([open]) table').length") == 0
    page.wait(line)
    page.run(f"{line}.querySelector('.acts button').click()")
    page.wait(f"{line}.querySelector('.read').textContent === '1000'")
    page.run(f"{line}.querySelector('input').value = '200'; {line}.querySelector('.write button').click()")
    page.wait(f"{line}.querySelector('.read').textContent === '200'")
    page.wait(f"{line}.matches('.changed') && {line}.querySelector('small').textContent === 'was 1000'")
    page.run(f"{line}.querySelector('input').value = '70000'; {line}.querySelector('.write button').click()")
    page.wait("document.querySelector('#toast').textContent.includes('allowed: 0..65535')")
    page.run(f"{line}.querySelectorAll('.acts > button')[1].click()")
    page.wait("plots.all[0].series.length === 1 && plots.all[0].series[0].values.at(-1) === 200")
    times = "plots.all[0].series[0]?.times"
    page.wait(f"{times}.length > 2")
    first = page.run(f"{times}.slice(0, 3)")
    page.reload()
    page.wait(f"typeof plots !== 'undefined' && {times}?.length > 2")
    assert page.run(f"{times}.slice(0, 3)") == first, "the server has what was read before"


def test_without_control_there_is_nothing_to_change_anything_with(tmp_path: Path, window: Page) -> None:
    name = channel()
    with robot(name), live_page(name, tmp_path, control=False) as served:
        window.open(served.address)
        window.wait(f"{KALMAN} && {KALMAN}.times.length > 1")
        for tab in ("nodes", "objects"):
            window.click(f"#tab-{tab}")
        window.wait("document.querySelector('.tree details')")
        window.run("document.querySelector('.tree details').open = true")
        window.wait("document.querySelector('table.objects tbody tr')")
        assert window.run("document.querySelector('#stop').hidden && document.querySelector('#tab-send').hidden")
        seen = "[...document.querySelectorAll('form.goto, .write, .card .buttons')].some(each => each.offsetParent)"
        assert window.run(seen) is False
        window.press("Escape")
        refused = window.run("connection.ask({do: 'stop'}).catch(error => error.message)")
        assert refused == "this page is read-only: start the server with --control"


def test_any_message_is_sent_by_its_form(scene: Scene) -> None:
    page = scene.page
    message = StartConfigurationSet(TeamColour.RED, 1, 0, 45, 0)
    page.click("#tab-send")
    page.run("""(() => {
        const chosen = document.querySelector('form.send select');
        chosen.value = 'Start Configuration Set';
        chosen.dispatchEvent(new Event('change'));
        const inputs = document.querySelectorAll('.fields select, .fields input');
        ['red', 1, 0, 45, 0].forEach((value, place) => { inputs[place].value = value; });
    })()""")
    page.click("form.send button")
    page.wait(
        f"document.querySelector('.answer').textContent === 'sent {EurobotProtocol.load().encode(message)} by the core'"
    )
    page.wait("sources[0].row('Start Configuration Confirm') !== null")  # the nodes heard it
    page.run("document.querySelectorAll('.fields input')[2].value = 99")
    page.click("form.send button")
    page.wait("document.querySelector('.answer.is-wrong')")
    assert "enemy_1_diameter = 99 is not allowed; allowed: 0..50 cm" in page.text(".answer")


def test_nodes_tell_how_they_are(scene: Scene) -> None:
    page = scene.page
    page.click("#tab-nodes")
    state = "String(document.querySelectorAll('.card .state')[1]?.textContent)"  # the cards come with their frames
    page.wait(f"{state}.includes('alive operational, heard')")
    page.run("[...document.querySelectorAll('.card')][1].querySelectorAll('.buttons button')[2].click()")
    page.wait(f"{state}.includes('alive pre-operational')")
    page.wait("[...sources[0].events.values()].some(each => each.text === 'pre-operational, drive')")
    with open_bus("virtual", scene.channel) as bus:
        Driver(bus).send(Frame(0x083, bytes.fromhex("3081 11 0000000000")))
    page.wait("document.querySelectorAll('.errors')[2].textContent.includes('0x8130 ')")


def test_faults_are_red(scene: Scene) -> None:
    with open_bus("virtual", scene.channel) as bus:
        Driver(bus).send(Frame(0x008, bytes(3)))
    scene.page.wait("document.querySelector('tr.is-wrong .defects')")
    assert "Goto XY (0x008): 3 bytes of data, expected 6 or 8" in scene.page.text("tr.is-wrong .defects")


def test_searching_and_freezing(scene: Scene) -> None:
    page = scene.page
    page.press("/")
    page.wait("document.activeElement.id === 'search'")
    for letter in "kalman":
        page.press(letter)
    shown = "[...document.querySelectorAll('table.messages tbody tr')].filter(each => !each.hidden).length"
    page.wait(f"{shown} === 2")
    page.run("document.activeElement.blur()")
    page.press("f")
    page.wait("document.querySelector('#freeze').getAttribute('aria-pressed') === 'true'")
    page.run("new Promise(done => setTimeout(done, 100))")
    count = page.run("document.body.dataset.time")
    page.run("new Promise(done => setTimeout(done, 300))")
    assert page.run("document.body.dataset.time") == count
    page.click("#freeze")
    page.wait(f"Number(document.body.dataset.time) > {count}")


def test_a_recording_is_a_log_of_what_was_seen(scene: Scene, tmp_path: Path) -> None:
    page = scene.page
    page.click("#record")
    page.wait("connection.state.recording.frames > 20")  # a heartbeat of the core among them
    page.click("#record")
    page.wait("document.querySelector('.status a[href]')")
    text = page.run("fetch(document.querySelector('.status a').href).then(answer => answer.text())")
    log = tmp_path / "kept.log"
    log.write_text(text)
    with log.open("rb") as file:
        frames = [raw for *_, raw in read(file)]
    page.wait(f"connection.state.recording.frames === {len(frames)}")  # the count comes a moment after the last frame
    assert 0x701 in {each.cob_id for each in frames if isinstance(each, Frame)}


def test_names_from_files_and_buses_are_text(tmp_path: Path, window: Page) -> None:
    evil = "<img src=x onerror=alert(1)>"
    file = tmp_path / "evil.eds"
    text = (EDS / "canopen" / "drive.eds").read_text()
    file.write_text(with_entry(with_entry(text, "1017", "ParameterName", evil), "1800", "ParameterName", evil))
    network = Decoder([Dictionary.load(file, 2, f"</script>{evil}")])
    name = f"</script><script>alert(1)</script>{evil}"
    with open_bus("virtual", name) as bus, live_page(name, tmp_path, network=network, panels=()) as served:
        window.open(served.address)
        window.wait("connection.up")
        sender = next(each for each in network.protocol.bindings if each.name.startswith("<img"))
        Driver(bus).send(Frame(sender.cob_id, bytes(sender.layout.length)))
        window.click("#tab-messages")
        window.wait("document.querySelector('table.messages tbody th')")
        assert window.text("table.messages tbody th") == evil
        assert window.text("h1") == name
        window.click("#tab-nodes")
        window.click("#tab-objects")
        window.wait("document.querySelector('.tree details')")
        window.run("for (const each of document.querySelectorAll('.tree details')) each.open = true")
        names = "[...document.querySelectorAll('table.objects th')].map(each => each.textContent)"
        window.wait(f"{names}.some(each => each.includes('onerror'))")
        assert window.run("document.querySelectorAll('img').length") == 0


def test_any_network_without_a_field_has_the_rest(tmp_path: Path, window: Page) -> None:
    name = channel()
    network = Decoder([Dictionary.load(EDS / "canopen" / "navigation.eds", 3)])
    with open_bus("virtual", name) as bus, live_page(name, tmp_path, network=network, panels=()) as served:
        window.open(served.address)
        window.wait("connection.control")
        assert window.run("[...document.querySelectorAll('[role=tab]')].map(each => each.textContent)") == [
            "Messages", "Trace", "Plots", "Nodes", "Objects", "Send", "Settings", "Checks", "Events", "Diagnosis",
            "Files",
        ]  # fmt: skip
        window.wait("!document.querySelector('#stop').hidden")
        window.click("#stop")
        heard = bus.recv(5.0)
    assert heard is not None
    assert (heard.arbitration_id, bytes(heard.data)) == (0x000, bytes([NmtCommand.STOP, 0]))


def test_a_second_browser_sees_the_same(scene: Scene, browser: Browser) -> None:
    other = browser.page()
    other.open(scene.served.address)
    other.wait(f"{KALMAN} && {KALMAN}.times.length > 1")
    other.close()


# What goes away and comes back


@contextmanager
def bus_server(port: int) -> Iterator[None]:
    """Serve a bus in a process of its own, and kill it in the end."""
    words = ["--interface=virtual", "--channel=served", "--host=127.0.0.1", f"--port={port}"]
    with subprocess.Popen([sys.executable, "-m", "can_remote", *words], stderr=subprocess.DEVNULL) as process:
        try:
            wait_for(port)
            yield
        finally:
            process.kill()


def wait_for(port: int) -> None:
    """Wait until somebody listens."""
    for _ in range(200):
        with suppress(ConnectionError), socket.create_connection(("127.0.0.1", port)):
            return
        time.sleep(0.05)
    raise AssertionError("no bus server")


@pytest.mark.long
def test_the_bus_server_is_killed_and_back(window: Page) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    bus = f"ws://127.0.0.1:{port}/"
    with ExitStack() as stack:
        with bus_server(port):
            process = stack.enter_context(command("serve", "--listen", "127.0.0.1:0", "-i", "remote", "-c", bus))
            window.open(line(process, "http://").split()[0])
            window.wait("connection.up && !connection.state.trouble")
        window.wait("connection.state.trouble.includes('failed') && document.querySelector('.status.is-wrong')")
        stack.enter_context(bus_server(port))
        window.wait("!connection.state.trouble && !document.querySelector('.status.is-wrong')")
        with open_bus("remote", bus) as other:
            Driver(other).send(Frame(0x702, b"\x05"))
            window.wait("sources[0].rows.has(0x702)")


@contextmanager
def beating(channel: str) -> Iterator[None]:
    """Send heartbeats and positions of the drive, five times a second."""
    over = threading.Event()

    def beat() -> None:
        with open_bus("virtual", channel) as bus:
            while not over.wait(0.2):
                for frame in (STATE, Frame(0x702, b"\x05")):
                    Driver(bus).send(frame)

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(LONG)


def test_the_page_finds_a_server_that_was_started_again(tmp_path: Path, window: Page) -> None:
    name, window.may_lose_its_server = channel(), True
    with live_page(name, tmp_path) as served, ExitStack() as stack:
        window.open(served.address)
        window.wait("connection.up")
        port = int(served.address.rstrip("/").rpartition(":")[2])
        stack.enter_context(beating(name))
        window.wait("sources[0].rows.has(0x702) && sources[0].row('Kalman Position Response')")
        window.run("plots.add(new FieldSeries(sources[0].row('Kalman Position Response'), 'x'))")
        for tab in ("plots", "nodes"):
            window.click(f"#tab-{tab}")
        window.wait("document.querySelector('#view-nodes .card[data-life=alive]')")
        window.click("#record")
        window.wait("connection.state.recording.on")
    window.wait("!connection.up && document.querySelector('.status.is-wrong')")
    # Nothing looks alive any more, in words, colours and signs, in the header and in the view; STOP says so at once.
    window.wait("document.querySelector('header .life').textContent === '⊘ not connected'")
    window.wait(
        "[...document.querySelectorAll('#view-nodes .card')].every(each => each.dataset.life === 'not connected')"
    )
    told = window.run("[...document.querySelectorAll('#view-nodes .card .state')].map(each => each.textContent).join()")
    assert "alive" not in told
    assert " ago" not in told
    window.wait("document.querySelector('#stop').textContent === 'STOP cannot be sent'")
    window.press("Escape")
    assert window.text("#toast") == "no connection to the server"
    with open_bus("virtual", name) as bus, live_page(name, tmp_path, port=port):
        window.wait("connection.alive")
        window.wait("document.querySelector('#stop').textContent === 'STOP'")
        assert window.text("#toast").startswith("the server was started again: the recording ")
        Driver(bus).send(EurobotProtocol.load().encode(KalmanPositionResponse(800, 1600, 0, Source.INTERNAL)))
        window.wait("plots.all[0].series[0].values.at(-1) === 800")
        window.click("#tab-plots")
        window.wait("plots.all[0].drawn()[1].at(-1) === 800")


def test_a_server_that_hangs_is_not_there(tmp_path: Path, window: Page) -> None:
    window.may_lose_its_server = True
    with live_page(channel(), tmp_path) as served:
        window.open(served.address)
        window.wait("connection.alive")
        window.run("clock.received -= 1e6; connection.hear = () => {}")  # as if nothing came any more
        window.wait("document.querySelector('header .life').textContent === '⊘ not connected'")
        refused = window.run("connection.ask({do: 'stop'}).catch(error => error.message)")
        assert refused == "no connection to the server"


def test_a_node_is_late_then_lost_then_back_everywhere(tmp_path: Path, window: Page) -> None:
    name, window.may_lose_its_server = channel(), True
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        window.open(served.address)
        window.wait("connection.alive")
        window.click("#tab-nodes")
        window.wait("document.querySelectorAll('#view-nodes .card').length === 3")
        life, card = (
            "document.querySelector('header .life').dataset.life",
            "document.querySelectorAll('#view-nodes .card')[1]",
        )
        edge = f"getComputedStyle({card}).borderLeftColor"
        sign = "getComputedStyle(document.querySelector('header .sign')).color"
        colours = [window.run(f"[{edge}, {sign}]")]
        assert window.run(f"{card}.dataset.life") == "unknown"
        assert "never heard" in window.run(f"{card}.textContent")
        seen = []
        Driver(bus).send(Frame(0x702, b"\x05"))
        look = f"getComputedStyle({card}).borderLeftStyle + {card}.querySelector('.sign').textContent"
        for expected in ("alive", "late", "lost"):
            seen.append(window.wait(f"{life} === '{expected}' && {card}.dataset.life === '{expected}' && {look}"))
            colours.append(window.run(f"[{edge}, {sign}]"))
        assert [len(set(each)) for each in zip(*colours)] == [4, 4], "unknown, alive, late and lost, in card and header"
        assert len(set(seen)) == 3, "told apart without colour"
        Driver(bus).send(Frame(0x701, b"\x05"))
        window.wait(f"document.querySelector('#view-nodes .card').dataset.life === 'alive' && {life} === 'lost'")
        for node in (1, 2):  # also the first again: a busy machine has lost it meanwhile
            Driver(bus).send(Frame(0x700 + node, b"\x05"))
        window.wait(f"{life} === 'alive'")
        window.wait("[...sources[0].events.values()].some(each => each.text === 'drive is back')")
        assert "drive is lost" in window.run("[...sources[0].events.values()].map(each => each.text)")


def test_the_tpdo_of_a_device_without_groups_has_no_edge(tmp_path: Path, window: Page) -> None:
    window.may_lose_its_server = True
    with bench(tmp_path) as scene:
        window.open(scene.served.address)
        scene.ask(do="send frame", frame="185#370600000000")
        window.click("#tab-messages")
        window.wait("document.querySelector('.messages tbody th')?.textContent === 'servo.TPDO1'")
        edge = window.run("getComputedStyle(document.querySelector('.messages tbody th')).borderLeftColor")
    assert edge == "rgba(0, 0, 0, 0)", "as if it were faulty"


def test_foreign_frames_are_named_once_in_grey(tmp_path: Path, window: Page) -> None:
    name, window.may_lose_its_server = channel(), True
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        window.open(served.address)
        window.wait("connection.alive")
        Driver(bus).send(Frame(0x555, b"\1\2"))
        window.click("#tab-messages")
        window.wait("document.querySelector('tr.foreign')")
        assert window.text("tr.foreign").startswith("555not in any file1")
        assert window.text("tr.foreign").endswith("01 02")
        assert window.run("document.querySelectorAll('.is-wrong').length") == 0
        assert window.run("getComputedStyle(document.querySelector('tr.foreign th')).color") == window.run(
            "(made => { document.body.append(made); made.style.color = 'var(--pale)'; "
            "return getComputedStyle(made).color; })(document.createElement('i'))"
        )
