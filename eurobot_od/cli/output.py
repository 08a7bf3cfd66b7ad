"""Where a command's file goes: `-o FILE`, written whole, or standard output."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

NAME = "pdo"
"""Begins the identifiers in what goes to standard output."""


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add -o."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="left out: standard output")


def add_name(parser: argparse.ArgumentParser) -> None:
    """Add --name."""
    parser.add_argument("--name", help=f"begins all identifiers; left out: the output's name, or {NAME}")


def name(arguments: argparse.Namespace) -> str:
    """Return what identifiers begin with."""
    return arguments.name or (arguments.output.stem if arguments.output else NAME)


def write(output: Path | None, text: str) -> None:
    """Write a text; raises OSError, and leaves what was in the file then."""
    from eurobot_od.files import write_whole

    if output is None:
        sys.stdout.write(text)
    elif output.exists() and not output.is_file():
        output.write_text(text, encoding="utf-8")  # a pipe or a device, which nothing can take the place of
    else:
        write_whole(output.resolve(), text.encode())
