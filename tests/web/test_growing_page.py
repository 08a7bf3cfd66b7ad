"""A page that only listens lists a node once the node has shown what it is, in a browser."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.frame import Frame
from eurobot_od.library.library import Library, LibraryDevices
from eurobot_od.traffic.meaning import Decoder
from tests.kit.library import PRODUCT, REVISION, VENDOR, device_text, library_of
from tests.web.browser import Page
from tests.web.scene import channel, live_page

RELOADS = 4
"""How often the page may be on its way while it is asked."""


def test_a_listening_page_lists_a_node_and_its_messages_once_it_is_known(tmp_path: Path, window: Page) -> None:
    library, bus = Library([library_of(tmp_path / "makers", axis=device_text())]), channel()
    network = Decoder((), describe=LibraryDevices(library, print))
    with live_page(bus, tmp_path, control=False, network=network) as served, open_bus("virtual", bus) as other:
        window.open(served.address)
        driver = Driver(other)
        driver.send(Frame(0x185, b"\x07\x00"))
        window.wait("sources[0].rows.size === 1")
        for sub, number in enumerate((VENDOR, PRODUCT, REVISION), 1):
            driver.send(Frame(0x605, bytes([0x40, 0x18, 0x10, sub, 0, 0, 0, 0])))
            driver.send(Frame(0x585, bytes([0x43, 0x18, 0x10, sub]) + number.to_bytes(4, "little")))
        driver.send(Frame(0x185, b"\x08\x00"))
        for _ in range(RELOADS):  # the page loads itself again while it is asked
            with suppress(AssertionError):
                window.wait("typeof sources === 'object' && sources[0].messages.has('axis_5.TPDO1')")
                break
        assert window.run("sources[0].nodes.map(each => each.name)") == ["axis_5"]
        window.wait("document.body.textContent.includes('axis_5.TPDO1')")
