"""Ten tasks from nothing in a real browser: an empty workspace, and a bus with two motors and a gripper.

`pytest -s -m long tests/web/test_ten_tasks.py` prints how long each took, from the first click to the last thing seen.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.loading import packages
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.plugin import Plugins
from tests.cli.console import run
from tests.cli.processes import PATIENCE, command, line, serve_bus
from tests.kit.devices import MOTOR, SERVO
from tests.web.browser import Page
from tests.web.scene import channel
from tests.web.test_start import arrives
from tests.web.test_work import chosen, press

PROGRAM = bytes(range(256)) * 200

LONG = 500.0
"""Time after which the server is killed, in s: on a busy machine the tasks take minutes."""


class Bench(NamedTuple):
    """A served page that begins with nothing: its address, its workspace, and the channel of the bus beside it."""

    address: str
    workspace: Path
    bus: str


@pytest.fixture
def bench(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "new-device", "gripper", "--package", "--eds", str(SERVO)).status == 0
    folder, name = tmp_path / "gripper" / "gripper", channel()
    servo = Dictionary.load(SERVO, 7)
    kind = Plugins(packages=packages([str(folder)])).for_identity(Identity.of(servo)).device
    assert kind is not None
    gripper = kind()(servo)
    nodes = [*(SimulatedDevice(Dictionary.load(MOTOR, each)) for each in (5, 6)), gripper]
    workspace = tmp_path / "bench"
    workspace.mkdir()
    with ExitStack() as stack:
        for node in nodes:
            stack.enter_context(Live.node(stack.enter_context(open_bus("virtual", name)), node))
        bus = stack.enter_context(serve_bus(name))
        words = ("serve", str(workspace), "--control", "--listen", "127.0.0.1:0", "--package", str(folder))
        process = stack.enter_context(command(*words, "--robot", "none", patience=LONG))
        yield Bench(line(process, "http://127.0.0.1:").split()[0], workspace, bus)
        process.terminate()
        process.communicate(timeout=PATIENCE)
        assert process.returncode == 0


def drop(window: Page, selector: str, file: Path) -> None:
    """Choose a file in an input for files."""
    document = window.call("DOM.getDocument")["root"]["nodeId"]
    place = window.call("DOM.querySelector", nodeId=document, selector=selector)
    window.call("DOM.setFileInputFiles", files=[str(file)], nodeId=place["nodeId"])


def typed(window: Page, selector: str, text: str) -> None:
    window.run(f"document.querySelector({json.dumps(selector)}).focus()")
    window.call("Input.insertText", text=text)


def settled(window: Page, view: str, words: str) -> None:
    """Wait until the verdict of a view says something, and no job runs."""
    said = f"document.querySelector('#view-{view} .verdict')?.textContent.includes({json.dumps(words)})"
    window.wait(f"{said} && !runningJob()")


def connect(window: Page, bench: Bench) -> None:
    window.open(bench.address)
    typed(window, "[aria-label='interface of python-can']", "remote")
    typed(window, "[aria-label=channel]", bench.bus)
    window.run("[...document.querySelectorAll('.start button')].find(each => each.textContent === 'Connect').click()")
    arrives(window, "typeof Tabs === 'function' && connection.alive && connection.state.frames > 2")


def scan(window: Page, _: Bench) -> None:
    """Scan, and give a file for each node that has none; one file describes both motors."""
    window.click("#tab-nodes")
    press(window, "nodes", "Scan")
    rows = "[...document.querySelectorAll('#view-nodes .found tbody tr')].map(each => each.textContent)"
    arrives(window, f"{rows}.length === 3 && !runningJob()")
    for file, place, known in ((MOTOR, 1, 2), (SERVO, 3, 3)):
        drop(window, f"#view-nodes .found tbody tr:nth-child({place}) input[type=file]", file)
        listed = f"{rows}.length === 3 && {rows}[{place - 1}].includes('{file.name}')"
        # The page loads itself again once it has heard of a device.
        arrives(window, f"connection.alive && sources[0].nodes.length === {known} && {listed} && !runningJob()")


def browse(window: Page, _: Bench) -> None:
    window.click("#tab-objects")
    chosen(window, "#view-objects select[aria-label=node]", window.run("sources[0].nodes[0].name"))
    window.wait("document.querySelectorAll('#view-objects details').length > 1")
    typed(window, "#view-objects input[type=search]", "1017")
    press(window, "objects", "Read")
    window.wait("document.querySelector('#view-objects .read.known')?.textContent.includes('500')")


def write(window: Page, _: Bench) -> None:
    typed(window, "#view-objects input[aria-label^='new value']", "250")
    press(window, "objects", "Write")
    window.wait("document.querySelector('#view-objects .read.known')?.textContent.includes('250')")


def trace(window: Page, _: Bench) -> None:
    window.click("#tab-trace")
    typed(window, "#view-trace input[aria-label='frames with this identifier']", "705")
    window.wait("[...document.querySelectorAll('#view-trace .frames > *, #view-trace tbody tr')].length > 0")
    window.wait("document.querySelector('#view-trace').textContent.includes('705')")


def check(window: Page, _: Bench) -> None:
    window.click("#tab-checks")
    press(window, "checks", "Start")
    window.wait("document.querySelectorAll('#view-checks .run-end a').length === 4 && !runningJob()")
    assert " ok" in window.run("document.querySelector('#view-checks .counts:not(.is-wrong)').textContent")


def download(window: Page, bench: Bench) -> None:
    window.click("#tab-settings")
    chosen(window, "#view-settings select[aria-label=node]", window.run("sources[0].nodes[2].name"))
    file = bench.workspace.parent / "program.bin"
    file.write_bytes(PROGRAM)
    drop(window, "#view-settings fieldset:nth-of-type(3) input[type=file]", file)
    window.wait("document.querySelector('#view-settings fieldset:nth-of-type(3)').textContent.includes('program.bin')")
    window.run("document.querySelector('#view-settings fieldset:nth-of-type(3) input[type=checkbox]').click()")
    press(window, "settings", "Download")
    press(window, "settings", "Download: press again")
    settled(window, "settings", "program 1")


def clone(window: Page, _: Bench) -> None:
    """Save the settings of the first motor, and give them to the second."""
    one, two = window.run("sources[0].nodes.map(each => each.name)")[:2]
    chosen(window, "#view-settings select[aria-label=node]", one)
    press(window, "settings", "Save as DCF")
    settled(window, "settings", "is saved")
    chosen(window, "#view-settings select[aria-label=node]", two)
    chosen(window, "#view-settings [aria-label='compare with']", one)
    press(window, "settings", "Compare")
    window.wait("document.querySelector('#view-settings .found tbody tr')?.textContent.includes('250')")
    press(window, "settings", "Apply")
    press(window, "settings", "Apply: press again")
    settled(window, "settings", "written and read back")


def report(window: Page, bench: Bench) -> None:
    window.click("#tab-checks")
    link = "[...document.querySelectorAll('#view-checks .run-end a')].find(each => each.textContent === 'Report')"
    assert "<html" in window.run(f"fetch({link}.href).then(answer => answer.text())")
    kept = {each.suffix for each in (bench.workspace / "reports").iterdir()}
    assert kept == {".html", ".xml", ".txt", ".json", ".dcf"}


def panel(window: Page, _: Bench) -> None:
    window.wait("/gripper: uptime=[1-9]/.test(document.body.textContent)")


TASKS: tuple[Callable[[Page, Bench], None], ...] = (
    connect, scan, browse, write, trace, check, download, clone, report, panel,
)  # fmt: skip


def test_ten_tasks_are_done_from_nothing(window: Page, bench: Bench) -> None:
    window.may_lose_its_server = True
    for task in TASKS:
        begun = time.monotonic()
        task(window, bench)
        print(f"{task.__name__:10} {time.monotonic() - begun:5.1f} s")


def test_the_keyboard_alone_connects_and_scans(window: Page, bench: Bench) -> None:
    window.may_lose_its_server = True
    window.open(bench.address)
    for label, text in (("interface of python-can", "remote"), ("channel", bench.bus)):
        tab_to(window, f"document.activeElement.getAttribute('aria-label') === {json.dumps(label)}")
        window.call("Input.insertText", text=text)
    tab_to(window, "document.activeElement.textContent === 'Connect'")
    enter(window)
    arrives(window, "typeof Tabs === 'function' && connection.alive && connection.control")
    tab_to(window, "document.activeElement.getAttribute('role') === 'tab'")
    while not window.run("document.activeElement.id === 'tab-nodes'"):
        window.press("ArrowRight")
    tab_to(window, "document.activeElement.textContent === 'Scan'")
    enter(window)
    arrives(window, "document.querySelectorAll('#view-nodes .found tbody tr').length === 3 && !runningJob()")


def tab_to(window: Page, is_there: str) -> None:
    """Press Tab until the focus is where it is wanted."""
    for _ in range(60):
        if window.run(f"Boolean({is_there})"):
            return
        key = {"key": "Tab", "code": "Tab", "windowsVirtualKeyCode": 9}
        for kind in ("rawKeyDown", "keyUp"):
            window.call("Input.dispatchKeyEvent", type=kind, **key)
    raise AssertionError(f"Tab never leads to it: {is_there}")


def enter(window: Page) -> None:
    key = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13}
    window.call("Input.dispatchKeyEvent", type="keyDown", text="\r", **key)
    window.call("Input.dispatchKeyEvent", type="keyUp", **key)
