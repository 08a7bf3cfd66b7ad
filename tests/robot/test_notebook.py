"""What a team writes in a program works in a notebook, where an event loop is running already."""

from __future__ import annotations

from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

CELLS = (
    # (what somebody types, what it ends with)
    (
        """
        from eurobot_od import Core, Drive, Live, Navigation, Robot, open_bus, rehearse, rehearse_async
        from eurobot_od.robot import dialects
        from eurobot_od.robot.model.values import TeamColour

        async def play(core):
            await core.check_nodes()
            await core.configure_start(TeamColour.RED)
            return (await core.goto(600, 1700, 90, speed=60)).outcome.name
        """,
        None,
    ),
    ("rehearse(play)", "'ARRIVED'"),
    ("await rehearse_async(play)", "'ARRIVED'"),
    (
        """
        nodes = [Live.node(open_bus("virtual", "a"), kind(dialects.load(name))).start()
                 for name, kind in (("drive", Drive), ("navigation", Navigation))]
        with Robot("virtual", "a") as robot:
            said = robot.play(play), await robot.play_async(play), robot.goto(300, 1700, 90, speed=60).outcome.name
        said
        """,
        "('ARRIVED', 'ARRIVED', 'ARRIVED')",
    ),
)

HANGING = """
from eurobot_od import rehearse
async def play(core):
    while True:
        pass
rehearse(play)
"""


def run(*texts: str) -> list[str | None]:
    """Run cells in a kernel; return what each ends with."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(_dedent(text)) for text in texts])  # type: ignore[no-untyped-call]
    NotebookClient(notebook, timeout=60, kernel_name="python3").execute()
    return [_result(cell) for cell in notebook.cells]


def _dedent(text: str) -> str:
    lines = text.strip("\n").splitlines()
    indent = len(lines[0]) - len(lines[0].lstrip())
    return "\n".join(line[indent:] for line in lines).rstrip()


def _result(cell: Any) -> str | None:
    return next((each.data["text/plain"] for each in cell.outputs if each.output_type == "execute_result"), None)


@pytest.mark.long
def test_strategies_and_blocking_calls_in_a_notebook() -> None:
    assert run(*(text for text, _ in CELLS)) == [result for _, result in CELLS]


@pytest.mark.long
def test_a_hanging_strategy_in_a_notebook_is_ended() -> None:
    with pytest.raises(CellExecutionError, match=r"ProgramFailed.*does not give way"):
        run(HANGING)
