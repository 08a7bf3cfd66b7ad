#!/usr/bin/env python3
"""Makes the EDS files from eds/protocol.yaml, or checks that they are what it says.

Rule of this file: only files and the command line; what the EDS files say is `edsgen`'s.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from environment import ROOT, ensure

ensure("yaml")
sys.path.insert(0, str(ROOT))  # the package next door, installed or not

from eurobot_od.od.make.table import Table, TableError, read_table  # noqa: E402
from eurobot_od.od.make.text import eds_text  # noqa: E402

EDS = ROOT / "eds"
FINE, DIFFERENT, WRONG_INPUT = 0, 1, 2


def all_texts(table: Table) -> dict[str, str]:
    """Give the text of every EDS file under its path in the output folder."""
    return {
        f"{dialect}/{node}.eds": eds_text(table, dialect, node) for dialect in table.dialects for node in table.nodes
    }


def write(texts: dict[str, str], output: Path) -> int:
    """Write every file below `output`."""
    for path, text in texts.items():
        target = output / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(text.encode("ascii"))
    return FINE


def differences(texts: dict[str, str], output: Path) -> list[str]:
    """Say in one line each which files below `output` differ, are missing, or should not be there."""
    found = {path.relative_to(output).as_posix() for path in output.glob("*/*") if path.is_file()}
    lines = {path: difference(text, output / path) for path, text in texts.items() if path in found}
    lines |= dict.fromkeys(texts.keys() - found, "is missing")
    lines |= dict.fromkeys(found - texts.keys(), "should not be there")
    return [f"{output / path}: {what}" for path, what in sorted(lines.items()) if what]


def difference(text: str, path: Path) -> str:
    """Say in which line a file first differs from `text`; nothing if it does not."""
    pairs = zip_longest(text.encode("ascii").split(b"\n"), path.read_bytes().split(b"\n"))
    return next((f"differs first in line {n}" for n, (new, old) in enumerate(pairs, start=1) if new != old), "")


def check(texts: dict[str, str], output: Path) -> int:
    """Print every difference, or one line if there is none."""
    found = differences(texts, output)
    print("\n".join(found) or f"{output}: {len(texts)} EDS files are what the table says")
    return DIFFERENT if found else FINE


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    command = argparse.ArgumentParser(description="Make the EDS files of all dialects from the protocol table.")
    command.add_argument("--source", type=Path, default=EDS / "protocol.yaml", metavar="FILE", help="protocol table")
    command.add_argument("--output", type=Path, default=EDS, metavar="DIR", help="folder of the dialects' folders")
    command.add_argument("--check", action="store_true", help="write nothing; say which files differ, exit 1 if any")
    return command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; exit status 0 fine, 1 files differ, 2 the table cannot be used."""
    options = parser().parse_args(arguments)
    try:
        texts = all_texts(read_table(options.source.read_text(encoding="utf-8", errors="replace")))
        return check(texts, options.output) if options.check else write(texts, options.output)
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
    except TableError as error:
        for (line, column), what in error.problems:
            print(f"{options.source}:{line}:{column}: {what}", file=sys.stderr)
    return WRONG_INPUT


if __name__ == "__main__":
    sys.exit(main())
