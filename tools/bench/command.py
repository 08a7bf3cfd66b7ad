"""The bench's command line: chooses rows, measures them, prints the table as it goes, and writes the figures.

Exit status 0; 1 if a result was wrong, or with `--strict` if a row missed its limit; 2 for wrong usage; 3 if the
figures cannot be written.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bench import report, table
from bench.groups import GROUPS
from bench.measure import Measured, Scale, Series, Verdict, compare, measure

ROUNDS, SHORT_ROUNDS = 7, 2
FIGURES = Path("bench.json")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the chosen rows."""
    options = _parser().parse_args(arguments)
    series = chosen(options.rows)
    if options.list:
        print("\n".join(f"{each.group:<{table.WIDTHS[0]}}  {each.name}" for each in series))
        return 0
    scale = Scale(options.rounds or (SHORT_ROUNDS if options.short else ROUNDS), options.short)
    measured: list[Measured] = []
    try:
        measured.extend(_printed(series, scale))
    except KeyboardInterrupt:
        return 130
    file = options.json or (None if options.short else FIGURES)
    return (file and _write(file, measured, scale)) or status(measured, scale, options.strict)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("bench", description="Measure our speed beside that of other people's programs.")
    parser.add_argument("rows", nargs="*", metavar="ROW", help="groups, or parts of rows' names; left out: all")
    parser.add_argument("--list", action="store_true", help="list the rows and end")
    parser.add_argument("--rounds", type=_rounds, metavar="N", help=f"turns of each contender (default: {ROUNDS})")
    parser.add_argument("--short", action="store_true", help="tiny sizes: shows that all rows work, judges nothing")
    parser.add_argument("--json", type=Path, metavar="FILE", help=f"every round's figures ({FIGURES}; --short: none)")
    parser.add_argument("--strict", action="store_true", help="exit status 1 if a row misses what is wanted")
    return parser


def _rounds(text: str) -> int:
    if not text.isdecimal() or not int(text):
        raise argparse.ArgumentTypeError(f"{text} is not a number of rounds")
    return int(text)


def chosen(words: Sequence[str]) -> list[Series]:
    """Return the series of the named groups, and those with a given word in their name.

    Exit with status 2 for a word that names none.
    """
    everything = [series for group in GROUPS for series in group]
    groups = dict.fromkeys(series.group for series in everything)
    found: list[Series] = [] if words else everything
    for word in words:
        named = [each for each in everything if _is_named(each, word, word in groups)]
        if not named:
            _parser().error(f"no row is called {word!r}; groups: {', '.join(groups)}; all rows: --list")
        found += named
    return list(dict.fromkeys(found))


def _is_named(series: Series, word: str, is_group: bool) -> bool:
    return series.group == word if is_group else word.lower() in series.name.lower()


def _printed(series: Iterable[Series], scale: Scale) -> Iterator[Measured]:
    """Measure series after series and print the lines of each."""
    print(table.line(table.HEAD), flush=True)
    for each in series:
        measured = measure(each, scale)
        print("\n".join(table.lines(measured, not scale.short)), flush=True)
        yield measured


def _write(file: Path, measured: Sequence[Measured], scale: Scale) -> int:
    try:
        report.write(file, measured, scale)
    except OSError as error:
        print(f"bench: {file}: {error.strerror}", file=sys.stderr)
        return 3
    return 0


def status(measured: Iterable[Measured], scale: Scale, strict: bool) -> int:
    """Return the exit status for the figures: 1 if a result was wrong or, with `strict`, a limit was missed."""
    return int(any(each.wrong or (strict and not scale.short and _missed(each)) for each in measured))


def _missed(measured: Measured) -> bool:
    claims = (claim for claim in measured.series.claims if not measured.gap(claim))
    return any(compare(measured, claim, True).verdict is Verdict.MISSED for claim in claims)
