"""The panel of a device package, in a browser: as `new-device --package` writes it."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.loading import packages
from eurobot_od.od.identity import Identity
from eurobot_od.plugin import Plugins
from eurobot_od.traffic.meaning import Decoder
from tests.cli.console import run
from tests.client.servo import EDS, SERVO
from tests.web.browser import Page
from tests.web.scene import channel, live_page


def test_the_panel_of_a_package_is_on_the_page(
    tmp_path: Path, window: Page, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "new-device", "gripper", "--package", "--eds", str(EDS)).status == 0
    package = Plugins(packages=packages([str(tmp_path / "gripper" / "gripper")])).for_identity(Identity.of(SERVO))
    decoder, bus = Decoder([SERVO]), channel()
    decoder.others = dict(package.frames(SERVO))
    assert package.device is not None
    with live_page(bus, tmp_path, network=decoder, panels=tuple(package.panels())) as served:
        window.open(served.address)
        window.wait("document.body.textContent.includes('gripper: no beacon yet')")
        with Live.node(open_bus("virtual", bus), package.device()(SERVO)):
            window.wait("/gripper: uptime=[1-9][0-9.]* s, restarts=0/.test(document.body.textContent)")
