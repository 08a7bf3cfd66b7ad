"""Makes the pictures of the documentation: field and monitor of a simulated match, and a device that fails a check.

It is the same match and the same check each time, through the public functions of the package and its command line.
"""

from __future__ import annotations

import argparse
import io
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from eurobot_od.frame import Frame
from eurobot_od.robot.match.stage import play_simulated
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.scene.files import SeenMatch, seen_match
from eurobot_od.robot.scene.one_goto import longest, picture
from eurobot_od.robot.scene.scene import sheet
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.traffic.monitor import Controls, Size, Traffic, screen

DOCS = Path(__file__).parents[1] / "docs"
OPTIONS = MatchOptions(seed=1)
WATCHED = 40.0
"""Simulated time of the monitor's picture, in s."""

CHECKED = "check --conformance --eds 5=motor.eds --simulate --fault heartbeat-every-other --quiet"
"""A command in `docs` that finds a faulty device."""

COLOURS = {
    r"^\$.*": "bold",
    r"\d+\.\d+\.\d+\S* [A-Z].*(?= \[)": "bold red",
    r"expected .*": "green",
    r"came .*|\d+ FAILED": "red",
    r"> \w+#\w+": "cyan",
    r"< \w+#\w+": "green",
}
"""Colours of the words in its picture; later ones count."""

WIDTH, HEIGHT = 150, 36
STEP_WIDTH = 132
BITRATE = 500_000

LEGIBLE = 44
"""Size of its texts: 11 px at a width of 830 px."""

WINDOW = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">
<style>
text {{ font-family: "DejaVu Sans Mono", Menlo, Consolas, monospace; font-size: {char_height}px; }}
{styles}
</style>
<defs>{lines}</defs>
{chrome}
<g transform="translate({terminal_x}, {terminal_y})">{backgrounds}<g class="{unique_id}-matrix">{matrix}</g></g>
</svg>
"""
"""The terminal as rich draws it, without its web font."""


def play() -> tuple[list[tuple[float, Frame]], SeenMatch]:
    """Play the match; return its frames and its recording."""
    frames: list[tuple[float, Frame]] = []
    _, world = play_simulated(OPTIONS, lambda _: None, lambda now, frame: frames.append((now, frame)))
    match = seen_match(frames, OPTIONS, world)
    return frames, match


def one_goto(match: SeenMatch) -> str:
    """Return the picture of the match's longest goto, with texts large enough for a page of 830 px."""
    goto = longest(match.recording.gotos, match.recording.path)
    assert goto is not None, "no goto was reached"
    drawing = picture(match.recording, match.facts, goto)
    return re.sub(r'font-size="(28|31|36|38)"', f'font-size="{LEGIBLE}"', drawing)


def monitor(frames: list[tuple[float, Frame]], decoder: Decoder) -> str:
    """Return the monitor's screen during the match."""
    traffic = Traffic(decoder, BITRATE)
    for now, frame in frames:
        if now < WATCHED:
            traffic.take(now, frame)
        if traffic.now < WATCHED - 1:
            traffic.load(now)
    console = Console(record=True, width=WIDTH, height=HEIGHT, file=io.StringIO())
    console.print(screen(traffic, Controls(), WATCHED, traffic.load(WATCHED), Size(WIDTH, HEIGHT)))
    return console.export_svg(title="eurobot-od monitor", code_format=WINDOW, unique_id="monitor")


def red_step() -> str:
    """Return the terminal after a check that fails."""
    program = [sys.executable, "-m", "eurobot_od", "--robot", "none", *CHECKED.split()]
    ran = subprocess.run(program, cwd=DOCS, capture_output=True, text=True, check=False)
    text = Text(f"$ canopen-workbench {CHECKED}\n{ran.stdout}")
    for pattern, style in COLOURS.items():
        text.highlight_regex(re.compile(pattern, re.MULTILINE), style)
    console = Console(record=True, width=STEP_WIDTH, file=io.StringIO())
    console.print(text)
    return console.export_svg(title="canopen-workbench check", code_format=WINDOW, unique_id="red-step")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pictures of the documentation."""
    parser = argparse.ArgumentParser(description="Make the pictures of the documentation.")
    parser.add_argument("--folder", type=Path, default=DOCS, help="where to (default: docs)")
    folder: Path = parser.parse_args(arguments).folder
    frames, match = play()
    for name, text in (
        ("match.svg", sheet(match.recording, match.facts, f"Match, seed {OPTIONS.seed}")),
        ("field.svg", one_goto(match)),
        ("monitor.svg", monitor(frames, match.decoder)),
        ("red-step.svg", red_step()),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
