"""The whole job in a real browser: a scan, a file for who has none, a check, settings compared and applied."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.library.library import Library
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web.desk import Equipment
from tests.kit.devices import MOTOR, SERVO
from tests.web.browser import Browser, Page
from tests.web.scene import Served, channel, live_page


class Scene(NamedTuple):
    """Two motors and a servo drive that no file is named for, and the page of their bus."""

    served: Served
    motors: Sequence[Node]
    folder: Path


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    known = [Dictionary.load(MOTOR, node_id).named(title) for title, node_id in (("one", 5), ("two", 6))]
    (tmp_path / "library").mkdir()
    (tmp_path / "suites").mkdir()
    name, library = channel(), Library([tmp_path / "library"])
    decoder = Decoder(known)
    nodes = [SimulatedDevice(each) for each in (*known, Dictionary.load(SERVO, 7))]
    with ExitStack() as stack:
        for node in nodes:
            stack.enter_context(Live.node(stack.enter_context(open_bus("virtual", name)), node))
        equipment = Equipment(library)
        served = stack.enter_context(live_page(name, tmp_path, network=decoder, equipment=equipment))
        yield Scene(served, nodes[:2], tmp_path)


def opened(window: Page, scene: Scene, view: str) -> None:
    window.open(f"{scene.served.address}#{view}")
    window.wait("connection.alive && connection.control")


def chosen(window: Page, selector: str, value: str) -> None:
    """Choose in a list as a person does."""
    window.run(f"""(() => {{
        const list = document.querySelector({json.dumps(selector)});
        list.value = {json.dumps(value)};
        list.dispatchEvent(new Event("change", {{bubbles: true}}));
    }})()""")


def button(view: str, words: str) -> str:
    """Return the selector of a button, which is marked for that."""
    return f"#view-{view} button[data-test='{words}']"


def press(window: Page, view: str, words: str) -> None:
    """Press the button with some words."""
    window.wait(f"""(() => {{
        const found = [...document.querySelectorAll("#view-{view} button")].find(
            each => each.textContent === {json.dumps(words)} && !each.disabled);
        if (found) found.dataset.test = {json.dumps(words)};
        return Boolean(found);
    }})()""")
    window.click(button(view, words))


def test_a_scan_shows_each_node_and_takes_a_file_for_who_has_none(window: Page, scene: Scene) -> None:
    opened(window, scene, "nodes")
    press(window, "nodes", "Scan")
    window.wait("document.querySelectorAll('.found tbody tr').length === 3 && !runningJob()")
    rows = window.run("[...document.querySelectorAll('#view-nodes .found tbody tr')].map(each => each.textContent)")
    assert [row[0] for row in rows] == ["5", "6", "7"]
    assert "motor.eds" in rows[0]
    assert "no file: drop one" in rows[2]
    document = window.call("DOM.getDocument")["root"]["nodeId"]
    inputs = window.call("DOM.querySelector", nodeId=document, selector="#view-nodes .found input[type=file]")
    window.call("DOM.setFileInputFiles", files=[str(SERVO)], nodeId=inputs["nodeId"])
    window.wait("document.querySelector('#view-nodes .found tbody tr:nth-child(3)')?.textContent.includes('servo.eds')")
    assert [each.name for each in (scene.folder / "library").rglob("*.eds")] == ["servo.eds"]


def test_a_check_shows_red_steps_with_their_frames_and_gives_the_reports(window: Page, scene: Scene) -> None:
    text = "spec: 1\nname: speed\nnode: one\nsteps:\n  - sdo: {read: Motor.Speed, expect: 1}\n"
    (scene.folder / "suites" / "speed.yaml").write_text(text)
    opened(window, scene, "checks")
    window.wait("[...document.querySelectorAll('#view-checks option')].some(each => each.value === 'speed.yaml')")
    chosen(window, "#view-checks [aria-label=suites]", "speed.yaml")
    press(window, "checks", "Start")
    window.wait("document.querySelector('#view-checks .reason').textContent.includes('what hangs on it may move')")
    window.click(button("checks", "Start"))
    window.wait(
        "document.querySelector('#view-checks .run-end a') && document.querySelector('#view-checks .steps pre')"
    )
    assert "> 605#40" in window.text("#view-checks .steps pre")
    links = window.run("[...document.querySelectorAll('#view-checks .run-end a')].map(each => each.href)")
    assert [each.rpartition(".")[2] for each in links] == ["json", "xml", "html"]
    assert window.run("Boolean(document.querySelector('#view-checks .run-end .verdict.is-wrong'))")
    found = window.run(f"fetch({json.dumps(links[1])}).then(answer => answer.text())")
    assert "<testsuites" in found


def test_another_node_s_settings_are_compared_and_applied(window: Page, scene: Scene) -> None:
    opened(window, scene, "settings")
    words = {"do": "write", "node": "two", "object": "0x1017", "value": "250", "sure": True}
    window.run(f"connection.ask({json.dumps(words)})")
    chosen(window, "#view-settings [aria-label='compare with']", "two")
    press(window, "settings", "Compare")
    window.wait("document.querySelector('#view-settings .found tbody tr')?.textContent.includes('250')")
    press(window, "settings", "Apply")
    window.wait("document.querySelector('#view-settings .reason:not([hidden])')")
    window.click(button("settings", "Apply"))
    window.wait("document.querySelector('#view-settings .verdict').textContent.includes('written and read back')")
    assert scene.motors[0].device.objects.kept((0x1017, 0)) == 250


def test_two_windows_see_the_same_job(window: Page, scene: Scene, browser: Browser) -> None:
    opened(window, scene, "nodes")
    other = browser.page()
    other.open(f"{scene.served.address}#nodes")
    press(window, "nodes", "Scan")
    other.wait("document.querySelectorAll('#view-nodes .found tbody tr').length === 3")
    other.close()


def test_the_trace_takes_lists_ranges_and_exclusions_and_says_what_it_does_not_understand(
    window: Page, scene: Scene
) -> None:
    opened(window, scene, "trace")
    identifiers = "[0x080, 0x181, 0x200, 0x705]"
    taken = {
        text: window.run(f"{identifiers}.filter(identifierTest({json.dumps(text)})).map(each => each.toString(16))")
        for text in ("181,200", "0x180-0x1FF", "!080", "180-700 !200")
    }
    assert taken == {
        "181,200": ["181", "200"],
        "0x180-0x1FF": ["181"],
        "!080": ["181", "200", "705"],
        "180-700 !200": ["181"],
    }
    window.run("""(() => {
        const box = document.querySelector("#view-trace input[aria-label='frames with this identifier']");
        box.value = "18x";
        box.dispatchEvent(new Event("input"));
    })()""")
    window.wait("document.querySelector('#view-trace .hint.is-wrong')?.textContent.includes('“18x” is no identifier')")


def test_back_and_forward_lead_from_view_to_view(window: Page, scene: Scene) -> None:
    opened(window, scene, "nodes")
    for view in ("trace", "checks"):
        window.run(f"document.querySelector('#tab-{view}').click()")
    seen = "document.querySelector('[role=tab][aria-selected=true]').id"
    window.run("history.back()")
    window.wait(f"{seen} === 'tab-trace'")
    window.run("history.back()")
    window.wait(f"{seen} === 'tab-nodes'")
    window.run("history.forward()")
    window.wait(f"{seen} === 'tab-trace'")


def test_a_link_and_a_layout_show_the_same_view_with_its_filters(window: Page, scene: Scene) -> None:
    opened(window, scene, "trace?identifier=705,706")
    box = "document.querySelector(\"#view-trace input[aria-label='frames with this identifier']\")"
    window.wait(f"{box}.value === '705,706'")
    words = {"do": "keep layout", "name": "heartbeats"}
    window.run(f"connection.ask({{...{json.dumps(words)}, layout: presentLayout()}})")
    opened(window, scene, "messages")
    window.run("document.querySelector('#tab-messages').click()")
    window.click("#layouts")
    window.wait("document.querySelector('dialog .layouts button')?.textContent === 'heartbeats'")
    window.click("dialog .layouts button")
    window.wait(f"document.querySelector('#tab-trace[aria-selected=true]') && {box}.value === '705,706'")


def test_a_search_right_after_the_groups_are_drawn_lists_what_it_finds(window: Page, scene: Scene) -> None:
    opened(window, scene, "objects")
    window.wait("document.querySelectorAll('#view-objects details').length > 1")
    # The browser tells a group that it is open only after the search has replaced it.
    window.run("""(box => {
        for (const text of ["", "1017"]) {
            box.value = text;
            box.dispatchEvent(new Event("input"));
        }
        return new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done())));
    })(document.querySelector("#view-objects input[type=search]"))""")
    assert window.run("document.querySelectorAll('#view-objects tbody tr').length") == 1


def test_a_list_is_started_together_kept_and_ended_by_stop(window: Page, scene: Scene) -> None:
    opened(window, scene, "send")
    chosen(window, "#view-send select[aria-label=message]", "(a frame as bytes)")
    rows = [
        {"period in ms, empty for once": "20"},
        {"frames at once": "2", "ms between the frames of a burst": "5", "trigger": "one.TPDO1.speed becomes >= 0"},
    ]
    for number, row in enumerate(rows):
        what = {"identifier, hexadecimal": f"12{number}", "bytes, hexadecimal": "R1" if number else "AB", **row}
        for label, value in what.items():
            window.run(f"document.querySelector('#view-send [aria-label={json.dumps(label)}]').value = '{value}'")
        press(window, "send", "Add to list")
    texts = window.run("[...document.querySelectorAll('#view-send ol li > span:first-child')].map(e => e.textContent)")
    second = "121#R1 · 2 at once, 5 ms apart · each 20 ms · on one.TPDO1.speed becomes >= 0"
    assert texts == ["120#AB · each 20 ms", second]
    window.run("document.querySelector('[aria-label=\"name of the list\"]').value = 'both'")
    press(window, "send", "Keep list")
    window.wait("document.querySelector('[aria-label=\"kept lists\"]').value === 'both'")
    assert [each.name for each in (scene.folder / "sequences").iterdir()] == ["both.yaml"]
    press(window, "send", "Start all")
    state = "Object.values(connection.state.lists)[0]"
    window.wait(f"{state}?.title === 'both' && {state}.sent > 3")
    window.wait("document.querySelector('#view-send .running .hint').textContent.includes('sent')")
    window.press("Escape")
    window.wait(f"{state}.ended === 'STOP'")
    window.wait("document.querySelector('[aria-label=\"lists that are sent\"]').textContent.includes('; STOP')")
