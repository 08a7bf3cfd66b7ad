"""Where a command's file goes: `-o FILE`, written whole, or standard output."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from eurobot_od.od.dcf import Dcf

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
    if output is None:
        sys.stdout.write(text)
    else:
        write_bytes(output, text.encode())


def write_bytes(output: Path, content: bytes) -> None:
    """Write a file; raises as `write`."""
    from eurobot_od.support.files import write_whole

    write_whole(output, content)


def write_dcf(output: Path | None, dcf: Dcf) -> None:
    """Write a DCF, after the files beside it; raises as `write`, and LocalError where there is no place for those."""
    if output is not None:
        for name, content in dcf.files.items():
            write_bytes(output.with_name(name), content)
        write_bytes(output, dcf.content)
    elif dcf.files:
        raise LocalError(f"the DCF needs files beside it ({', '.join(dcf.files)}): write it by -o FILE")
    else:
        sys.stdout.flush()
        sys.stdout.buffer.write(dcf.content)
