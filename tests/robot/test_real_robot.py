"""The program of docs/real-robot.md plays the tutorial's strategy with a drive and a navigation of other processes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.processes import free_port, node, process, shared
from tests.test_docs import BLOCKS

pytest.importorskip("can_remote")

pytestmark = pytest.mark.live

FILES = {block.title: block.text for page in ("strategy", "real-robot") for block in BLOCKS[f"docs/{page}.md"]}
CORD = 'input("start cord: ")'


@pytest.mark.long
def test_the_program_on_the_robot_plays_the_tutorials_strategy(tmp_path: Path) -> None:
    assert CORD in FILES["on_the_robot.py"]
    program = tmp_path / "on_the_robot.py"
    program.write_text(FILES[program.name].replace(CORD, "print('pulled')"), encoding="utf-8")
    (tmp_path / "mine.py").write_text(FILES["mine.py"], encoding="utf-8")
    port = free_port()
    playing = process(sys.executable, str(program), *shared(port)[1::2])
    with node("drive", "--share", str(port)), node("navigation", *shared(port)), playing as robot:
        robot.line("ready at KalmanPositionResponse(x=")
        robot.line("600 1700 ARRIVED")
        assert robot.wait() == 0, robot.told()
