#!/usr/bin/env python3
"""Puts small changes into the package, one at a time, and lists those that no test notices.

    python3 tools/mutants.py --sample 800 --seed 7          # see CONTRIBUTING
    tools/mutants.py eurobot_od/pdo eurobot_od/od/values.py # all changes of these

A change is another comparison, a constant greater by one, `and` for `or`, a dropped statement or argument, swapped
arguments, a condition that is always true or false, None returned. It runs on a copy of the repository, with the tests
that come by its line, the nearest first and no more than `--seconds` of them, and is noticed when one fails or does not
end. Left out are tests with several processes, browsers, other programs, and those of the tools.

Which tests come by a line is measured once, and kept in build/mutants. Results go to a file as they come; with
`--resume` what was noticed is not tried again. What tests/equivalent_mutants.yaml names, with its reason, is not tried
at all. The exit status is 0 if all was noticed, 1 if not, 2 if there is no such module.

mutmut and cosmic-ray were looked at. mutmut 3 rewrites every function into one that holds all its variants, leaves out
what stands outside of functions (tables, defaults, message types: half of this package), and runs pytest inside itself;
cosmic-ray runs one fixed test command for each change, which is four minutes of ours. Neither takes a sample by a seed.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue

from environment import ROOT, ensure

ensure("coverage", "test")

from mutation import equivalent, reach  # noqa: E402
from mutation.changes import Change, changes_of, sample  # noqa: E402
from mutation.trial import Copy, Outcome, Portion, Source, Verdict, portions  # noqa: E402

ALL_NOTICED, SURVIVORS, WRONG_USAGE = 0, 1, 2

PACKAGE = "eurobot_od"
JUDGED = Path("tests", "equivalent_mutants.yaml")
KEPT = Path("build", "mutants")
"""Paths below the repository's root."""


def modules(root: Path, chosen: Iterable[str]) -> list[str]:
    """Return the modules of the named files and folders, as paths below the root; raises ValueError."""
    found: list[str] = []
    for name in chosen:
        path = root / name
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path] if path.is_file() else []
        if not files:
            raise ValueError(f"{name}: no module and no folder of modules below {root}")
        found += [each.relative_to(root).as_posix() for each in files]
    return found


def all_changes(root: Path, names: Iterable[str]) -> list[Change]:
    """Return the changes of modules, without those that were judged equivalent."""
    known = {each.key for each in equivalent.read(root / JUDGED)} if (root / JUDGED).is_file() else set()
    found = [change for name in names for change in changes_of(name, (root / name).read_bytes())]
    return [each for each in found if equivalent.key(each) not in known]


def noticed_before(results: Path) -> set[str]:
    """Return the names of the changes that were noticed when a results file was written."""
    rows = [json.loads(line) for line in results.read_text("utf-8").splitlines()] if results.is_file() else []
    return {row["name"] for row in rows if Outcome(row["outcome"]).is_noticed}


def verdicts(
    root: Path, changes: Sequence[Change], files: Sequence[reach.Measured], jobs: int, budget: float
) -> Iterator[tuple[Change, Verdict]]:
    """Try changes, as many at a time as there are jobs, each in a copy of its own; in their order."""
    copies: SimpleQueue[Copy] = SimpleQueue()

    def tests(change: Change) -> list[Portion]:
        return list(portions(change, files, sources[change.module], budget))

    def verdict(change: Change) -> tuple[Change, Verdict]:
        copy = copies.get()
        try:
            return change, copy.judge(change, tests(change))
        finally:
            copies.put(copy)

    lines = reach.at_import(root, PACKAGE)
    modules = {each.module for each in changes}
    sources = {each: Source((root / each).read_bytes(), lines.get(each, frozenset())) for each in modules}
    with ExitStack() as stack:
        for _ in range(jobs):
            copy = Copy(root)
            stack.callback(copy.close)
            copies.put(copy)
        first = next((portion for each in changes for portion in tests(each)), None)
        if first:
            copy.check(first)
        pool = stack.enter_context(ThreadPoolExecutor(jobs))
        stack.callback(pool.shutdown, cancel_futures=True)
        yield from pool.map(verdict, changes)


def row(change: Change, verdict: Verdict) -> str:
    """Write a change and what came of it as a line of JSON."""
    return json.dumps(
        {
            "name": change.name,
            "place": f"{change.module}:{change.line}",
            "line": change.statement,
            "change": change.what,
            "outcome": verdict.outcome.value,
            "by": verdict.by,
        }
    )


def said(change: Change, verdict: Verdict) -> str:
    """Say what survived."""
    return f"{change.module}:{change.line}: {change.what}: {verdict.outcome.value}"


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    command = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    command.add_argument(
        "modules", nargs="*", default=[PACKAGE], metavar="MODULE", help="file or folder (default: all)"
    )
    command.add_argument("--sample", type=int, metavar="N", help="only so many of the changes, drawn by the seed")
    command.add_argument("--seed", type=int, default=0, metavar="S", help="seed of the sample (default 0)")
    command.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    command.add_argument("--seconds", type=float, default=60.0, metavar="S", help="of tests for a change (default 60)")
    command.add_argument("--results", type=Path, default=ROOT / KEPT / "results.jsonl", metavar="FILE")
    command.add_argument("--resume", action="store_true", help="leave out what was noticed before, by the results")
    return command


def main(arguments: Sequence[str] | None = None, root: Path = ROOT) -> int:
    """Try the changes; print the survivors as they come, then how many there are."""
    options = parser().parse_args(arguments)
    try:
        changes = all_changes(root, modules(root, options.modules))
    except ValueError as error:
        print(error, file=sys.stderr)
        return WRONG_USAGE
    if options.sample is not None:
        changes = sample(changes, options.sample, options.seed)
    before = noticed_before(options.results) if options.resume else set()
    tried = [each for each in changes if each.name not in before]
    files = reach.measured(root, root / KEPT / "reach", options.jobs)
    survived = 0
    with options.results.open("a" if options.resume else "w", encoding="utf-8") as results:
        for change, verdict in verdicts(root, tried, files, options.jobs, options.seconds):
            print(row(change, verdict), file=results, flush=True)
            if not verdict.outcome.is_noticed:
                survived += 1
                print(said(change, verdict), flush=True)
    share = 1 - survived / len(changes) if changes else 1.0
    print(f"{len(changes)} changes, {len(changes) - survived} noticed ({share:.1%}), {survived} survived")
    return SURVIVORS if survived else ALL_NOTICED


if __name__ == "__main__":
    sys.exit(main())
