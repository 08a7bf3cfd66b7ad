"""Write the concise DCF of a DCF, or show what a concise DCF writes, or make a DCF of it again.

The writes stand in the order of CiA 301's PDO procedure (7.5.2.36): a PDO is off while it is mapped.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from eurobot_od.cli import output as files
from eurobot_od.cli import remote
from eurobot_od.errors import DictionaryError, LocalError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", metavar="FILE", help="a DCF to turn into a concise DCF, or a concise DCF")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="left out: the writes are printed")
    parser.add_argument("--eds", metavar="FILE", help="of the device that a concise DCF is for")
    parser.add_argument("--node-id", type=int, metavar="N", help="of the DCF that is made (default: the EDS's)")


def run(arguments: argparse.Namespace) -> None:
    """Convert the file; its suffix says which way."""
    if Path(arguments.file).suffix.lower() in (".dcf", ".eds"):
        write_concise(arguments.file, arguments.output)
    else:
        read_concise(arguments.file, arguments.output, arguments.eds, arguments.node_id)


def write_concise(file: str, output: Path | None) -> None:
    """Write or print the concise DCF of a DCF; raises DictionaryError, LocalError."""
    from eurobot_od.client.configure import all_writes, check_file
    from eurobot_od.client.description import from_file
    from eurobot_od.client.reading import decoded
    from eurobot_od.od.concise import pack

    description = from_file(file)
    check_file(description, description.dictionary.node_id)
    writes = all_writes(description)
    if output is None:
        remote.print_readings(decoded(writes, description.dictionary), as_json=False)
    else:
        files.write_bytes(output, pack(writes))
        print(f"{output}: {len(writes)} writes for node {description.dictionary.node_id}")


def read_concise(file: str, output: Path | None, eds: str | None, node_id: int | None) -> None:
    """Print a concise DCF, or write the DCF that says the same; raises DictionaryError, LocalError, UnknownName."""
    from eurobot_od.client.description import from_file
    from eurobot_od.client.reading import dcf_of_writes, decoded
    from eurobot_od.live import BITRATE
    from eurobot_od.od.concise import Truncated, unpack

    try:
        writes = unpack(Path(file).read_bytes())
    except Truncated as error:
        raise DictionaryError(file, None, f"not a concise DCF: {error}") from error
    description = from_file(eds, node_id) if eds else None
    if output is None:
        remote.print_readings(decoded(writes, description.dictionary if description else None), as_json=False)
    elif description is None:
        raise LocalError("a DCF is made of an EDS and a concise DCF: name the EDS by --eds")
    else:
        files.write_dcf(output, dcf_of_writes(description.dictionary, writes, BITRATE // 1000, output.stem))
        print(f"{output}: for node {description.dictionary.node_id}")
