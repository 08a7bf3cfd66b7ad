"""The changes that are made, the tests that are chosen for one, and survivors told and tried again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("coverage", reason="the extra `test` is not installed")

import mutants
from mutation import equivalent
from mutation.changes import changes_of, sample
from mutation.reach import Measured, Passage, digest, distances
from mutation.trial import Source, mirror, portions

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("a < b", {"a < b -> (a <= b)", "a < b -> pass"}),
        ("x = a <= b != c", {"a <= b != c -> (a < b != c)", "a <= b != c -> (a <= b == c)"}),
        ("x = a is not b", {"a is not b -> (a is b)"}),
        ("x = a not in b", {"a not in b -> (a in b)"}),
        ("x = 0x10", {"0x10 -> 17"}),
        ("x = 1.5", {"1.5 -> 2.5"}),
        ("x = True", {"True -> False"}),
        ("x = a and b", {"a and b -> (a or b)"}),
        ("x = f(a)", {"f(a) -> f()"}),
        ("x = f(a, b)", {"f(a, b) -> f(a)", "f(a, b) -> f(b, a)"}),
        ("x = f(a, a)", {"f(a, a) -> f(a)"}),
        ("x = f(*a, b)", {"f(*a, b) -> f(*a)"}),
        ("x = f(a=b, c=d)", {"f(a=b, c=d) -> f(c=d)", "f(a=b, c=d) -> f(a=b)"}),
        ("x = y if a else z", {"a -> True", "a -> False"}),
        ("x = [y for y in z if y]", {"y -> True"}),
        ("if a:\n  x = y", {"a -> True", "a -> False"}),
        ("while a:\n  x = y", {"a -> False"}),
        ("while True:\n  x = y", {"True -> False"}),
        ("def f():\n  return a", {"a -> None"}),
        ("def f():\n  return", {"return -> pass"}),
        ("a.b = c", {"a.b = c -> pass"}),
        ("x += y", {"x += y -> pass"}),
        ("raise a", {"raise a -> pass"}),
        ("ä = '€', 1", {"1 -> 2"}),  # columns of the syntax tree count bytes
    ],
)
def test_syntax_is_changed(source: str, expected: set[str]) -> None:
    assert {each.what for each in changes_of("m.py", source.encode())} == expected


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("'''A docstring of 1 line.'''", "a text"),
        ("x: Literal[1]\ndef f(a: Literal[1]) -> Literal[1]: ...", "annotations"),
        ("assert a < 1", "assertions tell the type checker"),
        ("if TYPE_CHECKING:\n  import x", "only the type checker comes by"),
        ("@dataclass(frozen=True)\nclass A: ...", "most are the same without"),
        ("T = TypeVar('T', bound=int)", "for the type checker"),
        ("def f():\n  return None", "it is what it would become"),
    ],
)
def test_what_no_test_can_notice_is_left_alone(source: str, reason: str) -> None:
    assert changes_of("m.py", source.encode()) == [], reason


def test_a_change_leaves_all_other_text_as_it_is() -> None:
    source = "def f(a):  # ä\n    return (a\n            < 3)  # why\n".encode()
    (change,) = (each for each in changes_of("m.py", source) if each.new == "(a <= 3)")
    assert change.applied(source).decode() == "def f(a):  # ä\n    return ((a <= 3))  # why\n"
    assert (change.line, list(change.lines)) == (2, [2, 3])


def test_every_change_of_the_package_can_be_compiled() -> None:
    module = "eurobot_od/pdo/layout.py"
    source = (ROOT / module).read_bytes()
    changes = changes_of(module, source)
    assert len({each.name for each in changes}) == len(changes) > 100
    for each in changes:
        compile(each.applied(source), each.name, "exec")


def test_a_sample_stays_as_drawn_when_the_source_grows() -> None:
    source = b"x = 1\ny = a < b\nz = f(a, b)\nw = c and d\n"
    before = {each.name for each in sample(changes_of("m.py", source), 3, seed=7)}
    after = {each.name for each in sample(changes_of("m.py", b"# new\n" + source), 3, seed=7)}
    assert before == after
    assert before != {each.name for each in sample(changes_of("m.py", source), 3, seed=1)}


# Which tests

SOURCE = b"LIMIT = 5\n\n\ndef f(x):\n    if x < LIMIT:\n        return x\n    return g(x)\n"
MODULE = "eurobot_od/pdo/small.py"


def file(path: str, distance: int, seen: str = digest(SOURCE), **functions: tuple[float, list[int]]) -> Measured:
    passages = {name: Passage(seconds, {MODULE: lines}) for name, (seconds, lines) in functions.items()}
    return Measured(path, passages, {MODULE: distance}, {MODULE: seen})


NEAR = file(mirror(MODULE), 2, test_small=(0.5, [5, 6]), test_large=(0.5, [5, 7]))
USER = file("tests/lint/test_user.py", 1, test_uses=(1.0, [5]))
APART = file(mirror(MODULE), 2, test_process=(0.5, []))
FAR = file("tests/cli/test_far.py", 5, test_far=(2.0, [5]), test_else=(9.0, []))
NEVER = file("tests/cli/test_never.py", 1, test_never=(0.1, []))
CHANGED = file("tests/cli/test_old.py", 1, seen="another", test_old=(0.1, [1]))


def chosen(what: str, *files: Measured, budget: float = 60.0) -> list[tuple[str, ...]]:
    change = next(each for each in changes_of(MODULE, SOURCE) if each.what == what)
    return [each.arguments for each in portions(change, files, Source(SOURCE, frozenset({1, 4})), budget)]


@pytest.mark.parametrize(
    ("what", "files", "expected"),
    [
        ("x -> None", [NEAR], [(NEAR.path,)]),  # a quick file is run whole
        ("x -> None", [USER], []),  # no test of it comes by the line
        ("x -> None", [APART], [(APART.path,)]),  # it mirrors the module, and may come by in another process
        (  # what stands in a file beside a test that comes by may use what that one has made
            "x < LIMIT -> True",
            [NEVER, FAR, USER, NEAR],
            [(NEAR.path, USER.path), ("tests/cli/test_far.py::test_far", "tests/cli/test_far.py::test_else")],
        ),
        ("5 -> 6", [USER, NEAR], [(NEAR.path, USER.path)]),  # outside of functions: whoever comes by the module
        ("x -> None", [CHANGED], [(CHANGED.path,)]),  # its lines are of another text
    ],
)
def test_the_nearest_tests_come_first(what: str, files: list[Measured], expected: list[tuple[str, ...]]) -> None:
    assert chosen(what, *files) == expected


def test_no_more_seconds_than_allowed_are_spent() -> None:
    assert chosen("x < LIMIT -> True", NEAR, USER, FAR, budget=2.5) == [(NEAR.path, USER.path)]
    assert chosen("x < LIMIT -> True", FAR, budget=0.5) == [("tests/cli/test_far.py::test_far",)], "but one always"


def test_distances_are_counted_in_imports() -> None:
    imports = {"a": {"b", "c"}, "b": {"d", "a"}, "c": {"d"}, "d": {"e"}, "e": set(), "f": {"a"}}
    assert distances("a", lambda path: frozenset(imports[path])) == {"a": 0, "b": 1, "c": 1, "d": 2, "e": 3}


# The whole, on a package of one module

SMALL = """
def limited(x):
    if x > 10:
        return 10
    return x


def unused():
    return 1
"""
TESTS = """
from eurobot_od.small import limited
def test_limited():
    assert [limited(x) for x in (3, 12)] == [3, 10]
"""
JUDGED = """
eurobot_od/small.py:
  - line: "if x > 10:"
    change: "x > 10 -> (x >= 10)"
    reason: ten is ten either way
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in {
        "pyproject.toml": "[tool.pytest.ini_options]\nmarkers = ['live', 'socketcan']\n",
        "eurobot_od/__init__.py": "",
        "eurobot_od/pytest_plugin.py": "",  # which pytest loads here from whatever has the package's name
        "eurobot_od/small.py": SMALL,
        "tests/test_small.py": TESTS,
        "tests/equivalent_mutants.yaml": JUDGED,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_survivors_are_listed_and_tried_again(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--jobs", "1", "--results", str(root / "results.jsonl")]
    assert mutants.main([*options, "eurobot_od"], root) == mutants.SURVIVORS
    survivors = [
        "eurobot_od/small.py:3: 10 -> 11: survived",
        "eurobot_od/small.py:9: 1 -> None: survived",
        "eurobot_od/small.py:9: 1 -> 2: survived",
    ]
    *lines, total = capsys.readouterr().out.splitlines()
    assert sorted(lines) == sorted(survivors)
    assert total == "8 changes, 5 noticed (62.5%), 3 survived"
    rows = [json.loads(line) for line in (root / "results.jsonl").read_text().splitlines()]
    assert {row["by"] for row in rows if row["outcome"] == "noticed"} == {"tests/test_small.py::test_limited"}

    (root / "tests/test_small.py").write_text(
        TESTS.replace("3, 12", "3, 11").replace("import limited", "import limited, unused")
        + "    assert unused() == 1\n"
    )
    assert mutants.main([*options, "eurobot_od", "--resume"], root) == mutants.ALL_NOTICED
    assert capsys.readouterr().out == "8 changes, 8 noticed (100.0%), 0 survived\n"
    assert len((root / "results.jsonl").read_text().splitlines()) == len(rows) + 3


def test_a_module_that_is_not_there_is_one_line(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert mutants.main(["eurobot_od/nowhere.py"], root) == mutants.WRONG_USAGE
    assert capsys.readouterr().err == f"eurobot_od/nowhere.py: no module and no folder of modules below {root}\n"


def test_every_judged_change_is_still_one_of_the_package_and_has_its_reason() -> None:
    judged = equivalent.read(ROOT / mutants.JUDGED)
    modules = {each.module for each in judged}
    possible = {equivalent.key(each) for name in modules for each in changes_of(name, (ROOT / name).read_bytes())}
    assert [each for each in judged if each.key not in possible or not each.reason] == []
