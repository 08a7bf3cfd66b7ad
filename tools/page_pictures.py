"""Makes the pictures of the page for docs/: a simulated match, a live robot, and a file, in a headless Chromium.

They show the page as it is, controlled as its tests control it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # the tests' browser

from eurobot_od.frame import Frame  # noqa: E402
from eurobot_od.robot.match.stage import play_simulated  # noqa: E402
from eurobot_od.robot.model.options import MatchOptions  # noqa: E402
from eurobot_od.robot.scene.files import draw  # noqa: E402
from eurobot_od.web.editor import EditableFile, FileEditor  # noqa: E402
from eurobot_od.web.page import page as html_page  # noqa: E402
from tests.robot.web.scene import live_page, robot  # noqa: E402
from tests.web.browser import Page, running  # noqa: E402
from tests.web.scene import serving  # noqa: E402

SIZE = (1400, 860)
SHOWN = 57.0
"""Time of the match in the picture, in s."""

ROW = "sources[0].row('Kalman Position Response')"


def match_page(folder: Path) -> Path:
    """Play a match and return its page."""
    frames: list[tuple[float, Frame]] = []
    file = folder / "match.html"
    options = MatchOptions(seed=1)
    _, world = play_simulated(options, lambda _: None, lambda now, frame: frames.append((now, frame)))
    draw(file, frames, options, world)
    return file


def log_picture(page: Page, folder: Path) -> None:
    """Show the match with two plots."""
    page.open(match_page(folder).as_uri())
    page.run(f"clock.seek({SHOWN}); for (const each of ['x', 'y']) plots.add(new FieldSeries({ROW}, each))")
    page.run("plots.create().add(new FieldSeries(sources[0].row('Goto State Response'), 'time'))")
    page.click("#tab-plots")


def live_picture(page: Page, address: str) -> None:
    """Show a robot that drives to a place ordered on the page."""
    page.open(address)
    page.wait(f"connection.control && {ROW} && {ROW}.times.length > 1")
    page.wait("document.querySelector('form.goto button').offsetParent")  # the form comes with the control
    page.run("""(() => {
        const [x, y] = document.querySelectorAll('form.goto input');
        [x.value, y.value] = [1500, 1300];
    })()""")
    for _ in range(2):  # what moves something is asked twice
        page.click("form.goto button")
    page.wait(f"{ROW}.columns[0].at(-1) > 900")


def files_picture(page: Page) -> None:
    """Show a motor's file, with an object and a mapping entry chosen."""
    editor = FileEditor(lambda: [EditableFile(ROOT / "docs" / "motor.eds", "named")], control=True)
    with serving(lambda: html_page("motor.eds", [], editor=True), editor=editor) as address:
        page.open(address)
        page.wait("document.querySelector('.item')")
        page.run("""(found => { found.value = 'TPDO1'; found.dispatchEvent(new Event('change')); })
            (document.querySelector('[data-focus=pdo]'))""")
        page.click(".entry:nth-child(2)")
        page.click(".item[data-key='8448']")
        page.wait("document.querySelector('.object-form .finding-list')")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description="Make the pictures of the page for docs/.")
    parser.add_argument("--folder", type=Path, default=ROOT / "docs", help="where to (default: docs)")
    folder: Path = parser.parse_args(arguments).folder
    name = "The bus of the robot"
    with tempfile.TemporaryDirectory() as kept, running() as browser:
        page = browser.page()
        page.size(*SIZE)
        log_picture(page, Path(kept))
        _settle_and_save(page, folder / "page-log.png")
        with robot(name), live_page(name, Path(kept)) as served:
            live_picture(page, served.address)
            _settle_and_save(page, folder / "page-live.png")
            page.click("#tab-trace")
            _settle_and_save(page, folder / "page-trace.png")
        files_picture(page)
        _settle_and_save(page, folder / "page-files.png")
    return 0


def _settle_and_save(page: Page, file: Path) -> None:
    page.run("new Promise(done => setTimeout(done, 400))")
    page.screenshot(file)


if __name__ == "__main__":
    raise SystemExit(main())
