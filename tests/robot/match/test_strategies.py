"""Strategies from files: what plays, and what is wrong with a file as one line that names its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.robot.match import strategy
from eurobot_od.robot.match.referee import Players, StrategyFiles, load_strategy

GOOD = "async def play(core):\n    pass\n"


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.py"
    file.write_text(GOOD)
    return file


def test_without_files_the_shipped_strategy_plays_alone() -> None:
    assert StrategyFiles().load() == Players(strategy.play, None)


def test_both_robots_may_have_files(mine: Path) -> None:
    other = mine.with_name("other.py")
    other.write_text(GOOD)
    players = StrategyFiles(mine, other).load()
    assert players.against is not None
    files = [each.__code__.co_filename for each in (players.ours, players.against)]
    assert files == [str(mine), str(other)]


def test_the_shipped_strategy_is_a_file_like_any_other() -> None:
    assert load_strategy(Path(strategy.__file__)).__name__ == "play"


def test_a_strategy_may_be_in_several_files_and_have_dataclasses(mine: Path) -> None:
    mine.with_name("helper_of_mine.py").write_text("SPEED = 70\n")
    mine.write_text(
        "from __future__ import annotations\nfrom dataclasses import dataclass\nfrom helper_of_mine import SPEED\n"
        "@dataclass\nclass Plan:\n    speed: int = SPEED\n" + GOOD
    )
    assert load_strategy(mine).__globals__["Plan"]().speed == 70


def test_prints_of_a_strategy_file_stay_out_of_the_output(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine.write_text("print('loaded')\n" + GOOD)
    load_strategy(mine)
    assert capsys.readouterr() == ("", "loaded\n")


WRONG = [
    ("x = 1\n", "{file}: no `play` in it; write `async def play(core)`"),
    ("\ndef play(core):\n    pass\n", "{file}:2: `play` is not a coroutine function; write `async def play(core)`"),
    ("play = 5\n", "{file}: `play` is not a coroutine function; write `async def play(core)`"),
    (
        "async def play():\n    pass\n",
        "{file}:1: `play` is called with the core and nothing else: too many positional arguments",
    ),
    (
        "async def play(core, speed):\n    pass\n",
        "{file}:1: `play` is called with the core and nothing else: missing a required argument: 'speed'",
    ),
    ("x = 1\n)\n", "{file}:2: SyntaxError: unmatched ')'"),
    ("def f():\n    return 1 / 0\n\nf()\n", "{file}:2: ZeroDivisionError: division by zero"),
    ("raise ValueError('one\\ntwo')\n", "{file}:1: ValueError: one two"),
    ("import no_such_module\n", "{file}:1: ModuleNotFoundError: No module named 'no_such_module'"),
    ("import sys\nsys.exit('enough')\n", "{file}:2: SystemExit: enough"),
]


@pytest.mark.parametrize(("text", "complaint"), WRONG)
def test_a_faulty_strategy_is_one_line_with_its_place(mine: Path, text: str, complaint: str) -> None:
    mine.write_text(text)
    with pytest.raises(LocalError) as error:
        load_strategy(mine)
    assert str(error.value) == complaint.format(file=mine)


def test_a_strategy_that_is_no_text_is_one_line(mine: Path) -> None:
    mine.write_bytes(b"\x00\xff")
    with pytest.raises(LocalError) as error:
        load_strategy(mine)
    assert str(error.value).startswith(f"{mine}:1: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "complaint"), [("", "is a folder: name a Python file in it"), ("none.py", "No such file or directory")]
)
def test_a_strategy_that_cannot_be_read_is_an_error(tmp_path: Path, name: str, complaint: str) -> None:
    with pytest.raises(LocalError, match=complaint):
        load_strategy(tmp_path / name)
