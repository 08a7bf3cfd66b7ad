"""Write the concise DCF of a DCF, or show what a concise DCF writes, or make a DCF of it again.

Rule of this file: the file that is read says the direction; the writes stand in the order of CiA 301's PDO procedure.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import remote
from eurobot_od.errors import DictionaryError, LocalError

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.values import Address

SOURCES = (".dcf", ".eds")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", metavar="FILE", help="a DCF to turn into a concise DCF, or a concise DCF")
    parser.add_argument("-o", "--output", metavar="FILE", help="left out: the writes are printed")
    parser.add_argument("--eds", metavar="FILE", help="of the device that a concise DCF is for")
    parser.add_argument("--node-id", type=int, metavar="N", help="of the DCF that is made (default: the EDS's)")


def run(arguments: argparse.Namespace) -> int:
    """Convert the file."""
    from_dcf = Path(arguments.file).suffix.lower() in SOURCES
    return write_concise(arguments) if from_dcf else read_concise(arguments)


def write_concise(arguments: argparse.Namespace) -> int:
    """Write or print the concise DCF of a DCF."""
    from eurobot_od.client.configure import all_writes, check_file
    from eurobot_od.client.description import from_file
    from eurobot_od.od.concise import pack

    description = from_file(arguments.file)
    check_file(description, description.dictionary.node_id)
    writes = all_writes(description)
    if not arguments.output:
        return _print(writes, description.dictionary)
    Path(arguments.output).write_bytes(pack(writes))
    print(f"{arguments.output}: {len(writes)} writes for node {description.dictionary.node_id}")
    return 0


def read_concise(arguments: argparse.Namespace) -> int:
    """Print a concise DCF, or write the DCF that says the same."""
    from eurobot_od.client.description import from_file
    from eurobot_od.client.reading import dcf_of_writes
    from eurobot_od.live import BITRATE
    from eurobot_od.od.concise import Truncated, unpack

    try:
        writes = unpack(Path(arguments.file).read_bytes())
    except Truncated as error:
        raise DictionaryError(arguments.file, None, f"not a concise DCF: {error}") from error
    description = from_file(arguments.eds, arguments.node_id) if arguments.eds else None
    if not arguments.output:
        return _print(writes, description.dictionary if description else None)
    if description is None:
        raise LocalError("a DCF is made of an EDS and a concise DCF: name the EDS by --eds")
    text = dcf_of_writes(description, writes, BITRATE // 1000)
    Path(arguments.output).write_text(text, encoding="utf-8", errors="surrogateescape")
    print(f"{arguments.output}: for node {description.dictionary.node_id}")
    return 0


def _print(writes: Iterable[tuple[Address, bytes]], dictionary: Dictionary | None) -> int:
    from eurobot_od.client.reading import decoded

    remote.print_readings(decoded(writes, dictionary), as_json=False)
    return 0
