"""The page as axe-core judges it: no serious finding in any view; and all of it by the keyboard alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from interop_rows.tools import AXE_CORE, NODE_MODULES

from tests.web.browser import Page
from tests.web.test_drives import Bench, bench

AXE = NODE_MODULES / "axe-core" / "axe.min.js"
SERIOUS = ("serious", "critical")
SIZES = [(1280, 720, False), (1440, 900, True), (390, 844, False), (390, 844, True)]


@pytest.fixture
def scene(tmp_path: Path, window: Page) -> Iterator[tuple[Page, Bench]]:
    with bench(tmp_path) as served:
        window.may_lose_its_server = True
        window.open(served.served.address)
        window.wait("connection.alive && connection.control")
        yield window, served


@pytest.mark.skipif(not AXE.is_file(), reason=AXE_CORE.remedy)
@pytest.mark.parametrize(("width", "height", "dark"), SIZES)
def test_no_serious_finding_in_any_view(scene: tuple[Page, Bench], width: int, height: int, dark: bool) -> None:
    page, _ = scene
    page.size(width, height, dark)
    page.run(AXE.read_text() + "; true")
    found: dict[str, list[Any]] = {}
    for name in page.run("[...document.querySelectorAll('[role=tab]')].map(tab => tab.id)"):
        page.run(f"document.querySelector('#{name}').click()")
        page.run(
            "for (const each of document.querySelectorAll('.tree .object-group:first-child details')) each.open = true"
        )
        page.run("new Promise(done => setTimeout(done, 300))")
        seen = page.run("axe.run().then(said => said.violations.map(each => "
            "[each.impact, each.id, each.nodes.slice(0, 3).map(node => node.html.slice(0, 120))]))")  # fmt: skip
        found[name] = [each for each in seen if each[0] in SERIOUS]
    assert {name: each for name, each in found.items() if each} == {}


class Keys:
    """Somebody at the keyboard, without a mouse."""

    def __init__(self, page: Page) -> None:
        self._page = page

    def tab(self) -> None:
        self._page.call("Input.dispatchKeyEvent", type="keyDown", key="Tab", code="Tab", windowsVirtualKeyCode=9)
        self._page.call("Input.dispatchKeyEvent", type="keyUp", key="Tab", code="Tab", windowsVirtualKeyCode=9)

    def tab_to(self, condition: str) -> None:
        """Go on by Tab until the focused element fulfils a condition on `it`."""
        for _ in range(150):
            if self._page.run(f"(it => Boolean({condition}))(document.activeElement)"):
                return
            self.tab()
        raise AssertionError(f"Tab does not lead to {condition}")

    def type(self, text: str) -> None:
        for letter in text:
            self._page.press(letter)

    def enter(self) -> None:
        self._page.call(
            "Input.dispatchKeyEvent", type="keyDown", key="Enter", code="Enter", windowsVirtualKeyCode=13, text="\r"
        )
        self._page.call("Input.dispatchKeyEvent", type="keyUp", key="Enter", code="Enter", windowsVirtualKeyCode=13)


def test_by_the_keyboard_alone(scene: tuple[Page, Bench]) -> None:
    """Find a message, plot it, read an object, write it, STOP."""
    page, served = scene
    served.ask(do="nmt", command="start", node="servo")
    served.ask(do="send frame", frame="185#370600000000")
    page.wait("sources[0].row('servo.TPDO1')")
    keys = Keys(page)
    keys.tab()
    assert page.run("document.activeElement.id") == "freeze", "the first Tab reaches the first control"
    page.press("/")
    keys.type("TPDO1")
    page.wait("document.querySelectorAll('table.messages tbody tr:not([hidden])').length === 1")
    keys.tab_to("it.matches('.value') && it.textContent.includes('velocity')")
    keys.enter()
    page.wait("plots.all[0].series.length === 1")
    page.run("document.activeElement.blur()")
    place = page.run(
        "[...document.querySelectorAll('[role=tab]:not([hidden])')].findIndex(tab => tab.id === 'tab-objects') + 1"
    )
    page.press(str(place))
    page.wait("document.querySelector('.tree details')")
    keys.tab_to("it.getAttribute('aria-label') === 'search objects'")
    keys.type("Producer heartbeat")
    page.wait("document.querySelectorAll('table.objects tbody tr').length === 1")
    keys.tab_to("it.textContent === 'Read' && it.closest('table.objects')")
    keys.enter()
    page.wait("document.querySelector('table.objects .read').textContent === '100'")
    keys.tab_to("it.matches('table.objects .write input')")
    keys.type("200")
    keys.enter()
    page.wait("document.querySelector('table.objects .read').textContent === '200'")
    page.press("Escape")
    page.wait("document.querySelector('#toast').textContent.startsWith('stop sent: ')")
    assert json.loads(json.dumps(served.drive.axes[0].state.words)) == "Switch on disabled"
