"""Which test functions come by which lines of the package: measured with coverage, in a process for each test file.

A test file is measured again when its text has changed. What the package's processes of their own execute is not seen,
nor what a test file does while it is imported.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import coverage
import pytest

REPORT = "MUTATION_REACH"
"""Environment variable with the path that a measuring test run writes to."""

SLOW = ("tests/interop/", "tests/tools/", *(f"tests/web/test_{name}_page.py" for name in ("live", "replay")))
OF_THE_REPOSITORY = tuple(f"tests/test_{name}.py" for name in ("layers", "packaging", "readme", "reliability"))
"""Tests of other programs, the tools, a browser, and of the repository: never run for a change."""

WITHOUT_OURS = ("-p", "no:eurobot_od.pytest_plugin")
"""Options of a run of pytest that has the package's own plugin only where a test asks for it: what is installed is not
what is tested."""

MARKED = "not live and not socketcan"
"""Nor are those that run several processes, or need a kernel's bus."""

TOOLS = Path(__file__).parents[1]

Lines = dict[str, list[int]]
"""Lines of modules, by their paths below the root."""


class Passage(NamedTuple):
    """What one test function takes and comes by."""

    seconds: float
    lines: Lines


class Measured(NamedTuple):
    """A test file's functions that passed, and how far away modules are: 1 if it imports one itself."""

    path: str
    functions: dict[str, Passage]
    distances: dict[str, int]
    digests: dict[str, str]
    """Digests of the modules when it was measured."""

    @property
    def seconds(self) -> float:
        """How long all its functions take."""
        return sum(each.seconds for each in self.functions.values())

    def functions_at(self, module: str, lines: range | None) -> frozenset[str]:
        """Return the functions that come by one of the lines; None: by any line of the module."""
        wanted = None if lines is None else set(lines)
        return frozenset(
            name
            for name, passage in self.functions.items()
            if module in passage.lines and (wanted is None or not wanted.isdisjoint(passage.lines[module]))
        )


def digest(data: bytes) -> str:
    """Return what tells a text from another."""
    return hashlib.sha256(data).hexdigest()


def test_files(root: Path) -> list[str]:
    """Return the test files that count, as paths below the root."""
    found = (each.relative_to(root).as_posix() for each in (root / "tests").rglob("test_*.py"))
    return sorted(each for each in found if not each.startswith(SLOW + OF_THE_REPOSITORY))


def measured(root: Path, folder: Path, jobs: int) -> list[Measured]:
    """Measure the test files that are new or have changed; `folder` keeps what was measured before."""
    folder.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(jobs) as pool:
        kept = list(pool.map(lambda path: _kept(root, folder, path), test_files(root)))
    imports = cache(partial(imported, root))
    return [_test_file(path, data, distances(path, imports)) for path, data in zip(test_files(root), kept)]


def _kept(root: Path, folder: Path, path: str) -> dict[str, Any]:
    file = folder / f"{path.replace('/', '.')}.json"
    today = digest((root / path).read_bytes())
    data: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}
    if data.get("digest") != today:
        print(f"measuring {path}", file=sys.stderr, flush=True)
        data = {"digest": today, **_measure(root, path, file)}
        file.write_text(json.dumps(data))
    return data


def _measure(root: Path, path: str, file: Path) -> dict[str, Any]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(root), str(TOOLS))), REPORT: str(file)}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        *WITHOUT_OURS,
        "-p",
        "mutation.reach",
        "-m",
        MARKED,
        path,
    ]
    file.unlink(missing_ok=True)
    subprocess.run(command, cwd=root, env=environment, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL, check=False)
    if not file.is_file():
        raise SystemExit(f"{path}: cannot be measured: pytest does not come to its end")
    measured: dict[str, Any] = json.loads(file.read_text())
    return measured


def _test_file(path: str, data: dict[str, Any], distances: dict[str, int]) -> Measured:
    functions = {name: Passage(each["seconds"], each["lines"]) for name, each in data["functions"].items()}
    return Measured(path, functions, distances, data["modules"])


def distances(path: str, imports: Callable[[str], frozenset[str]]) -> dict[str, int]:
    """Return over how many imports a file has the files that it imports, one way or another."""
    found, edge = {path: 0}, [path]
    while edge:
        steps = found[edge[0]] + 1
        edge = sorted({each for file in edge for each in imports(file)} - found.keys())
        found |= dict.fromkeys(edge, steps)
    return found


def imported(root: Path, path: str) -> frozenset[str]:
    """Return the files below the root that a file imports by name."""
    names: set[str] = set()
    for node in ast.walk(ast.parse((root / path).read_bytes())):
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    paths = (name.replace(".", "/") + end for name in names for end in (".py", "/__init__.py"))
    return frozenset(each for each in paths if (root / each).is_file())


IMPORTING = """
import contextlib, coverage, importlib, json, pathlib, sys
root = pathlib.Path(sys.argv[1])
measured = coverage.Coverage(data_file=None, config_file=False, source=[str(root / sys.argv[2])])
measured.start()
for file in sorted((root / sys.argv[2]).rglob("*.py")):
    if file.name != "__main__.py":
        with contextlib.suppress(ImportError):
            importlib.import_module(".".join(file.relative_to(root).with_suffix("").parts).removesuffix(".__init__"))
measured.stop()
data = measured.get_data()
lines = {pathlib.Path(file).relative_to(root).as_posix(): data.lines(file) for file in data.measured_files()}
print(json.dumps(lines))
"""


def at_import(root: Path, package: str) -> dict[str, frozenset[int]]:
    """Return the lines of a package's modules that are executed when they are imported."""
    command = [sys.executable, "-c", IMPORTING, str(root), package]
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=True)
    return {module: frozenset(lines) for module, lines in json.loads(done.stdout).items()}


# The plugin of a measuring test run


class _Recorder:
    def __init__(self, file: Path, root: Path) -> None:
        self._file, self._root = file, root
        self._coverage = coverage.Coverage(data_file=None, config_file=False, source=[str(root / "eurobot_od")])
        self._coverage.set_option("run:disable_warnings", ["no-data-collected"])  # all tests may be marked
        self._seconds: dict[str, float] = {}
        self._failed: set[str] = set()
        self._coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._coverage.switch_context(_function(item.nodeid))
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name = _function(report.nodeid)
        self._seconds[name] = self._seconds.get(name, 0.0) + report.duration
        if report.failed:
            self._failed.add(name)

    def pytest_sessionfinish(self) -> None:
        self._coverage.stop()
        data = self._coverage.get_data()
        lines: dict[str, Lines] = {name: {} for name in self._seconds.keys() - self._failed}
        modules = {}
        for path in map(Path, data.measured_files()):
            module = path.relative_to(self._root).as_posix()
            modules[module] = digest(path.read_bytes())
            for line, contexts in data.contexts_by_lineno(str(path)).items():
                for name in lines.keys() & contexts:
                    lines[name].setdefault(module, []).append(line)
        functions = {name: {"seconds": self._seconds[name], "lines": lines[name]} for name in lines}
        self._file.write_text(json.dumps({"functions": functions, "modules": modules}))


def _function(node_id: str) -> str:
    return node_id.partition("::")[2].partition("[")[0]


def pytest_configure(config: pytest.Config) -> None:
    """Record, if this run was started to measure."""
    if REPORT in os.environ:
        config.pluginmanager.register(_Recorder(Path(os.environ[REPORT]), config.rootpath))
