"""What the documentation shows of the simulated drive: it is what the drive does, and as CiA 402 says."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import make_motion
import pytest

DOCS = Path(__file__).parents[2] / "docs"

# Written from the figure and the table of commands in CiA 402-2, and not from the package's table: the numbers of the
# transitions that each command causes in each state, and the state then. `.`: none.
MACHINE = """
                 shutdown switch-on enable      voltage     quick-stop  reset       fault
disabled         2>ready  .         .           .           .           .           13,14>fault
ready            .        3>on      3,4>enabled 7>disabled  7>disabled  .           13,14>fault
on               6>ready  .         4>enabled   10>disabled 10>disabled .           13,14>fault
enabled          8>ready  5>on      .           9>disabled  11>quick    .           13,14>fault
quick            .        .         16>enabled  12>disabled .           .           13,14>fault
reaction         .        .         .           .           .           .           .
fault            .        .         .           .           .           15>disabled .
"""

WORDS = {
    "disabled": "Switch on disabled",
    "ready": "Ready to switch on",
    "on": "Switched on",
    "enabled": "Operation enabled",
    "quick": "Quick stop active",
    "reaction": "Fault reaction active",
    "fault": "Fault",
}
COMMANDS = ["Shutdown", "Switch on", "Enable operation", "Disable voltage", "Quick stop", "Fault reset", "a fault"]


def _wanted() -> list[list[str]]:
    def cell(text: str) -> str:
        numbers, _, after = text.partition(">")
        return f"{numbers.replace(',', ', ')}: {WORDS[after]}" if after else "-"

    rows = [line.split() for line in MACHINE.strip().splitlines()[1:]]
    return [["", *COMMANDS], *([WORDS[state], *map(cell, cells)] for state, *cells in rows)]


def _shown(page: str) -> list[list[str]]:
    found = make_motion.TABLE.search(page)
    assert found is not None
    lines = [line for line in found[0].splitlines() if not re.fullmatch(r"[| -]+", line)]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_the_page_shows_the_state_machine_of_cia_402() -> None:
    assert _shown((DOCS / "profiles.md").read_text(encoding="utf-8")) == _wanted()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("docs")
    for name in (make_motion.EDS, make_motion.PAGE):
        shutil.copy(DOCS / name, folder)
    assert make_motion.main(["--folder", str(folder)]) == 0
    return folder


@pytest.mark.long
@pytest.mark.parametrize("name", [make_motion.PAGE, make_motion.PICTURE])
def test_the_documentation_has_what_the_tool_makes(made: Path, name: str) -> None:
    assert (made / name).read_text(encoding="utf-8") == (DOCS / name).read_text(encoding="utf-8")


@pytest.mark.long
def test_the_picture_has_a_panel_for_each_motion(made: Path) -> None:
    text = (made / make_motion.PICTURE).read_text(encoding="utf-8")
    assert text.count("translate(") == len(make_motion.PANELS) == 8


ENDS = [
    # motion; turns and revolutions a minute at its end
    ("_positions", 0, 0),
    ("_home", 0, 0),
    ("_cyclic_positions", 8, 0),
    ("_halt", None, 1200),
    ("_quick_stop", None, 0),
]


@pytest.mark.parametrize(("motion", "turns", "speed"), ENDS)
def test_each_motion_ends_at_its_target(motion: str, turns: float | None, speed: float) -> None:
    panel = next(each for each in make_motion.PANELS if each.motion.__name__ == motion)
    bench = make_motion.Bench(DOCS, **panel.options)
    panel.motion(bench)
    last = bench.samples[-1]
    assert last.speed == pytest.approx(speed, abs=1)
    assert turns is None or last.turns == pytest.approx(turns, abs=0.1)
