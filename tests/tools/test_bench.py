"""The bench in its short form: the rows of a group give their figures, the table and the JSON show them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import run
from bench import command, table
from bench.groups import GROUPS
from bench.measure import Claim, Contender, Gap, NotHere, Quantity, Scale, Series, Verdict, Way, Wrong, compare, measure
from bench.process import PYTHON, until_first_line
from bench.process import run as run_process
from bench.rows import logs

ROOT = Path(__file__).parents[2]
EVERYTHING = [series for group in GROUPS for series in group]
ROUNDS = 1
"""For rows of real programs; that rounds alternate is asked of made-up ones."""


def short(*words: str) -> list[str]:
    return [*words, "--short", "--rounds", str(ROUNDS)]


def test_every_row_of_a_group_gives_figures_or_says_why_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    group = "codec"  # tools/nightly.py goes through all of them
    file = tmp_path / "bench.json"
    assert command.main(short(group, "--json", str(file))) == 0
    written = json.loads(file.read_text())
    assert [each["name"] for each in written["series"]] == [each.name for each in EVERYTHING if each.group == group]
    lines = capsys.readouterr().out.splitlines()[1:]
    claims = [claim for series in written["series"] for claim in series["claims"]]
    for line, claim in zip(lines, claims, strict=True):
        assert claim["name"] in line
        assert ("not measured: " + claim["not_measured"] if "not_measured" in claim else "not judged") in line
    for series in written["series"]:
        measured = {name: rounds for name, rounds in series["rounds"].items() if name not in series["gaps"]}
        assert measured or series["gaps"], series["name"]
        assert all(len(rounds) == ROUNDS for rounds in measured.values()), series["name"]


# The rounds, with contenders of our own


def made_up(contenders: Mapping[str, Contender], *claims: Claim) -> Series:
    @contextmanager
    def opened(_: Scale) -> Iterator[Mapping[str, Contender]]:
        yield contenders

    return Series("made up", "row", opened, claims)


def giving(figures: list[float], called: list[str], name: str) -> Contender:
    left = iter(figures)

    def contender() -> dict[Quantity, float]:
        called.append(name)
        return {Quantity.TIME: next(left)}

    return contender


def test_contenders_take_turns_and_minima_are_compared() -> None:
    called: list[str] = []
    contenders = {"peer": giving([8, 6, 9], called, "peer"), "ours": giving([2, 4, 3], called, "ours")}
    measured = measure(made_up(contenders, Claim("row", "ours", "peer", Way.TIMES_AS_FAST, 3)), Scale(3))
    assert called == ["peer", "ours"] * 3
    comparison = compare(measured, measured.series.claims[0], judged=True)
    assert (comparison.ours, comparison.peer, comparison.value) == (2, 6, 3)
    assert (comparison.least, comparison.greatest) == (1.5, 4)
    assert comparison.verdict is Verdict.REACHED


VERDICTS = [
    (Way.TIMES_AS_FAST, 1.0, 4.0, 4.0, Verdict.REACHED, "exactly as fast as wanted"),
    (Way.TIMES_AS_FAST, 1.0, 3.9, 4.0, Verdict.MISSED, "not fast enough"),
    (Way.RATIO, 1.2, 1.0, 1.2, Verdict.REACHED, "exactly the ratio allowed"),
    (Way.RATIO, 1.3, 1.0, 1.2, Verdict.MISSED, "a greater one"),
    (Way.DIFFERENCE, 0.05, 0.04, 0.02, Verdict.REACHED, "a small difference"),
    (Way.DIFFERENCE, 0.09, 0.04, 0.02, Verdict.MISSED, "a great one"),
    (Way.ALONE, 0.5, 9.0, 1.0, Verdict.REACHED, "the peer does not count"),
    (Way.RATIO, 9.0, 1.0, None, Verdict.REPORTED, "nothing is wanted"),
]


@pytest.mark.parametrize(("way", "ours", "peer", "wanted", "verdict"), [each[:5] for each in VERDICTS])
def test_verdicts(way: Way, ours: float, peer: float, wanted: float | None, verdict: Verdict) -> None:
    called: list[str] = []
    contenders = {"peer": giving([peer], called, "peer"), "ours": giving([ours], called, "ours")}
    measured = measure(made_up(contenders, Claim("row", "ours", "peer", way, wanted)), Scale(1))
    assert compare(measured, measured.series.claims[0], judged=True).verdict is verdict
    assert compare(measured, measured.series.claims[0], judged=False).verdict is Verdict.NOT_JUDGED


def breaking(error: Exception) -> Contender:
    def contender() -> dict[Quantity, float]:
        raise error

    return contender


@pytest.mark.parametrize(
    ("error", "gap", "status"),
    [
        (NotHere("no bus"), Gap("no bus", wrong=False), 0),
        (Wrong("41, not 42"), Gap("41, not 42", wrong=True), 1),
        (ValueError("two\nlines"), Gap("ValueError: two lines", wrong=True), 1),
    ],
)
def test_a_contender_that_fails_leaves_the_others(error: Exception, gap: Gap, status: int) -> None:
    contenders = {"ours": giving([1], [], "ours"), "peer": breaking(error)}
    alone = Claim("alone", "ours", None, Way.ALONE)
    measured = measure(made_up(contenders, alone, Claim("both", "ours", "peer", Way.RATIO)), Scale(1))
    assert [measured.gap(claim) for claim in measured.series.claims] == [None, gap]
    how = "wrong" if gap.wrong else "not measured"
    assert [*table.lines(measured, judged=True)][1].endswith(f"{how}: {gap.why}")
    assert command.status([measured], Scale(1), strict=True) == status


@pytest.mark.parametrize(("strict", "short", "status"), [(True, False, 1), (False, False, 0), (True, True, 0)])
def test_a_missed_row_fails_only_if_asked_to(strict: bool, short: bool, status: int) -> None:
    missed = Claim("row", "ours", None, Way.ALONE, 1)
    measured = measure(made_up({"ours": giving([2], [], "ours")}, missed), Scale(1))
    assert command.status([measured], Scale(1, short), strict) == status


def test_tools_run_starts_the_bench(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared: Callable[..., Path] = lambda extras="": Path("python", extras)  # noqa: E731
    monkeypatch.setattr(run, "prepare", prepared)
    assert run.command(["bench", "--list"]) == (Path("python/bench"), ROOT / "tools" / "bench", "--list")
    assert run.command(["match"]) == (Path("eurobot-od"), "match")
    assert run.command(["canopen-workbench", "decode"]) == (Path("canopen-workbench"), "decode")


# Whole processes and their output


def test_a_failed_process_raises_wrong() -> None:
    with pytest.raises(Wrong, match=r"exit status 3: no bus$"):
        run_process([PYTHON, "-c", "import sys; print('no bus', file=sys.stderr); sys.exit(3)"])


def test_until_first_line_measures_up_to_it_and_needs_one() -> None:
    assert until_first_line([PYTHON, "-c", "import time; print('here', flush=True); time.sleep(1000)"])
    with pytest.raises(Wrong, match="exit status 1"):
        until_first_line([PYTHON, "-c", "print(end='no line')"])


def test_a_program_that_does_not_end_is_killed_with_its_children(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.process.LONGEST", 0.5)
    with pytest.raises(Wrong, match="not ended within"):
        run_process([PYTHON, "-c", "import time; time.sleep(1000)"])


LINES: list[tuple[str, str, bool]] = [
    ("1.0  can0  Goto XY  x=6 mm, speed=23 %", "(1.0) can0 008#06 :: Goto_XY(x: 6 mm, speed: 23 %)", True),
    ("1.0  can0  Goto XY  x=7 mm, speed=23 %", "(1.0) can0 008#06 :: Goto_XY(x: 6 mm, speed: 23 %)", False),
    ("1.0  can0  Goto XY  x=6 mm", "(1.0) can0 008#06 :: Goto_XY(x: 6 mm, speed: 23 %)", False),
    ("1.0  can0  Goto State Response  time=0 ms", "(1.0) can0 014#00 :: Goto_State_Response(time: arrived)", True),
    ("1.0  can0  Heartbeat  core, operational", "(1.0) can0 701#05 :: Unknown frame id 1793 (0x701)", True),
]


@pytest.mark.parametrize(("ours", "peer", "same"), LINES)
def test_lines_are_compared_by_their_values(ours: str, peer: str, same: bool) -> None:
    assert logs.agree(ours, peer) is same


@pytest.mark.parametrize(
    ("ours", "peer", "said"),
    [
        (2, 2, "2 lines for 3 frames"),
        (2, 3, "one output has fewer lines than the other"),
        (3, 3, ""),
    ],
)
def test_outputs_must_be_complete(ours: int, peer: int, said: str, tmp_path: Path) -> None:
    files: dict[str, Any] = {"ours": ours, "peer": peer}
    for name, count in files.items():
        (tmp_path / name).write_text(f"{LINES[0][name == 'peer']}\n" * count)
    if not said:
        return logs.compare(tmp_path / "ours", tmp_path / "peer", 3)
    with pytest.raises(Wrong, match=re.escape(said)):
        logs.compare(tmp_path / "ours", tmp_path / "peer", 3)
    return None
