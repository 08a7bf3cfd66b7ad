"""Page and site as axe-core judges them: no finding in any view; and all of it by the keyboard alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from environment import ROOT
from interop_rows.tools import AXE_CORE, NODE_MODULES

from eurobot_od.web.editor import EditableFile, FileEditor
from eurobot_od.web.page import page
from tests.web.browser import Page
from tests.web.scene import channel, line, live_page, serving
from tests.web.test_drives import Bench, bench
from tests.web.test_look import first_page

AXE = NODE_MODULES / "axe-core" / "axe.min.js"
SITE = ROOT / "build" / "site"
SERIOUS = ("serious", "critical")
SIZES = [(1920, 1080, False), (1366, 768, True), (390, 844, False)]


PAGES = ("index", "api", "any-device", "messages", "page", "reports/io-module")
"""Pages of the site with all that a page can have."""

needs_axe = pytest.mark.skipif(not AXE.is_file(), reason=AXE_CORE.remedy)


@pytest.fixture
def scene(tmp_path: Path, window: Page) -> Iterator[tuple[Page, Bench]]:
    with bench(tmp_path) as served:
        window.may_lose_its_server = True
        window.open(served.served.address)
        window.wait("connection.alive && connection.control")
        yield window, served


@contextmanager
def a_drive(folder: Path) -> Iterator[str]:
    with bench(folder) as served:
        yield served.served.address


@contextmanager
def line_on_a_bus(folder: Path) -> Iterator[str]:
    name = channel()
    with line(name), live_page(name, folder) as served:
        yield served.address


@contextmanager
def a_file(_: Path) -> Iterator[str]:
    """Serve a file alone, without a bus or a log."""
    editor = FileEditor(lambda: [EditableFile(ROOT / "docs" / "motor.eds", "named")], control=True)
    with serving(lambda: page("motor.eds", [], editor=True), editor=editor) as address:
        yield address


OPENED = """
document.querySelectorAll('.tree details').forEach((each, place) => { each.open = place < 9; });
document.querySelectorAll('#view-files details').forEach(each => { each.open = true; });
document.querySelector('.item[data-key="8448"]')?.click();
document.querySelector('#view-files .entry')?.click();
"""
"""What a person opens in the views: groups of objects, findings, an object with a finding, a mapping entry."""


def findings(page: Page) -> list[Any]:
    """Return what axe-core finds of a page as it is."""
    page.run(AXE.read_text() + "; true")
    found: list[Any] = page.run("axe.run().then(said => said.violations.map(each => "
        "[each.impact, each.id, each.nodes.slice(0, 3).map(node => node.html.slice(0, 120))]))")  # fmt: skip
    return found


@needs_axe
@pytest.mark.parametrize(("width", "height", "dark"), SIZES)
@pytest.mark.parametrize("shown", [a_drive, line_on_a_bus, a_file, first_page])
def test_no_finding_in_any_view_and_none_is_wider_than_the_window(
    shown: Callable[[Path], AbstractContextManager[str]],
    tmp_path: Path,
    window: Page,
    width: int,
    height: int,
    dark: bool,
) -> None:
    window.size(width, height, dark)
    found: dict[str, Any] = {}
    with shown(tmp_path) as address:
        window.may_lose_its_server = True
        window.call("Page.navigate", url=address)
        window.wait("document.readyState === 'complete' && location.href !== 'about:blank'")
        window.wait("!live || (connection.alive && connection.control)")
        window.run("new Promise(done => setTimeout(done, 300))")
        for name in window.run("[...document.querySelectorAll('[role=tab]:not([hidden])')].map(tab => tab.id)") or [
            "tab-start"
        ]:
            window.run(f"document.querySelector('#{name}')?.click()")
            window.run(OPENED)
            window.run("new Promise(done => setTimeout(done, 300))")
            found[name] = findings(window), window.run("Math.max(document.documentElement.scrollWidth - innerWidth, 0)")
    assert {name: each for name, each in found.items() if each != ([], 0)} == {}


@needs_axe
@pytest.mark.skipif(not SITE.is_dir(), reason="no site: tools/make_site.py makes it")
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_site_follows_the_system_and_has_no_serious_finding(window: Page, dark: bool) -> None:
    window.size(1280, 720, dark)
    found = {}
    for name in PAGES:
        window.call("Page.navigate", url=(SITE / f"{name}.html").as_uri())
        window.wait(f"location.pathname.endsWith('{name}.html') && document.body?.dataset.mdColorScheme")
        assert window.run("document.body.dataset.mdColorScheme") == ("slate" if dark else "default")
        window.run("new Promise(done => setTimeout(done, 300))")
        found[name] = [each for each in findings(window) if each[0] in SERIOUS]
    window.complaints.clear()  # a site that is read from the disk has no index for its search
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


def test_every_view_is_reached_by_the_keyboard_alone(scene: tuple[Page, Bench]) -> None:
    """Find a message, plot it, read an object, write it, STOP."""
    page, served = scene
    served.ask(do="nmt", command="start", node="servo")
    served.ask(do="send frame", frame="185#370600000000")
    page.wait("sources[0].row('servo.TPDO1')")
    keys = Keys(page)
    keys.tab()
    assert page.run("document.activeElement.id") == "life", "the first Tab reaches the first control"
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
