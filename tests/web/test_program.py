"""A program is downloaded into a device (0x1F50) from the page, in a browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.meaning import Decoder
from tests.kit.devices import SERVO
from tests.web.browser import Page
from tests.web.scene import channel, live_page
from tests.web.test_ended_server import Loader
from tests.web.test_ten_tasks import PROGRAM, drop, settled
from tests.web.test_work import button, press


@pytest.fixture
def loader(tmp_path: Path, window: Page) -> Iterator[Loader]:
    """Open the view Settings of a bus with one drive, which takes programs."""
    file, name = Dictionary.load(SERVO, 7), channel()
    found = Loader(file)
    with (
        Live.node(open_bus("virtual", name), found),
        live_page(name, tmp_path, network=Decoder([file])) as served,
    ):
        window.open(f"{served.address}#settings")
        window.wait("connection.alive && connection.control")
        yield found


def test_a_dropped_program_is_downloaded_once_it_is_confirmed(tmp_path: Path, window: Page, loader: Loader) -> None:
    program = tmp_path / "program.bin"
    program.write_bytes(PROGRAM)
    form = "#view-settings fieldset:nth-of-type(3)"
    drop(window, f"{form} input[type=file]", program)
    window.wait(f"document.querySelector('{form}').textContent.includes('program.bin')")
    window.click(f"{form} input[type=checkbox]")
    press(window, "settings", "Download")
    window.wait("document.querySelector('#view-settings .reason:not([hidden])')")
    assert (loader.commands, loader.programs) == ([], [])
    window.click(button("settings", "Download"))
    settled(window, "settings", "program 1")
    assert (loader.commands, loader.programs, loader.is_running) == ([0, 3, 1], [PROGRAM], True)


def test_download_without_a_program_asks_for_one(window: Page, loader: Loader) -> None:
    press(window, "settings", "Download")
    window.wait("document.querySelector('#toast').textContent === 'drop a program first'")
    assert loader.commands == []
