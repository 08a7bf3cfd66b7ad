"""Make EDS files from a protocol table: a folder for each dialect, a file for each node, and the network file."""

from __future__ import annotations

import argparse
from pathlib import Path

from eurobot_od.cli import ExitStatus
from eurobot_od.support.files import read_whole
from eurobot_od.support.texts import amount


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("table", type=Path, metavar="TABLE", help="YAML in the form of eds/protocol.yaml")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="folder to put the dialects' folders in"
    )
    parser.add_argument(
        "--check", action="store_true", help="write nothing; list the files that differ, with exit status 1 if any do"
    )


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Write the files, or compare them."""
    from eurobot_od import plugin
    from eurobot_od.od.make.table import read_table
    from eurobot_od.od.make.text import differences, make_files, write_files

    # What is not UTF-8 becomes a sign that the table refuses, with its line and column.
    source = read_whole(arguments.table).decode(errors="replace")
    texts = make_files(read_table(source, arguments.table, plugin.table_of))
    if not arguments.check:
        write_files(texts, arguments.output)
        return ExitStatus.FINE
    found = differences(texts, arguments.output)
    print("\n".join(found) or f"{arguments.output}: as the table says: {amount(len(texts), 'file')}")
    return ExitStatus.FOUND if found else ExitStatus.FINE
