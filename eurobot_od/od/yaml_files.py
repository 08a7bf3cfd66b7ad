"""What stands in YAML beside the files of devices: a network, and a maker's words for error codes.

A network file has nodes with their files and node-IDs, and what is declared of them.

Names are read as they are written, whatever YAML 1.1 makes of them: a node may be called `off`. Numbers are read as in
an EDS (decimal, 0x or octal).

    nodes:
      core: {file: core.eds, node_id: 1}      # files are relative to this file; node_id where the file does not say it
      drive: {file: drive.dcf}
      coupler: {file: coupler.eds, node_id: 5, modules: [1, 1, DI8]}   # of a modular device, by number or name
      pump: {file: pump.eds, node_id: 6, patch: [pump.yaml]}           # what is laid over the file
    shared: [Start Configuration Confirm]     # messages that several nodes may send
    order: [Emergency Shutdown, Emergency Stop]   # the most urgent first
    bit_rate: 500                             # kbit/s
    master: PC                                # who leads: a node's name, or any other for a master without a file
    traffic:                                  # how often what is sent, for `load`: a duration, or a setting in ms
      Goto XY: {every: Goto handshake.Confirm wait, deadline: 50 ms, reason: sent again until it is confirmed}
      Goto Confirm: {answers: Goto XY, jitter: 1 ms}
    robot: eurobot2014                        # an installed robot, whose messages and nodes these are without `--robot`
"""

from __future__ import annotations

import re
from pathlib import Path, PurePath

from eurobot_od.errors import FileError, LocalError
from eurobot_od.od.network_file import NetworkFile
from eurobot_od.od.values import parse_number
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_shapes import PLAIN, SCALAR, TEXT, converted, mapping, read_yaml, shape_of


def _as_in_an_eds(text: str) -> int:
    number = parse_number(text)
    if number is None or number.relative:
        raise LocalError(f"{str(text)!r} is not a number")
    return number.value


NUMBER = converted(SCALAR, _as_in_an_eds, {"type": "integer"})
NETWORK = shape_of(NetworkFile, {**PLAIN, str: SCALAR, int: NUMBER})


def read_network_file(text: str, file: str) -> NetworkFile:
    """Read the text of a network file, its own path `file`; raises YamlError, or FileError if it names no nodes."""
    network: NetworkFile = read_yaml(text, NETWORK, file)
    if not network.nodes and not network.robot:
        raise FileError(file, "it names no nodes")
    folder = PurePath(file).parent
    return network._replace(
        nodes=[
            each._replace(file=str(folder / each.file), patch=tuple(str(folder / patch) for patch in each.patch))
            for each in network.nodes
        ]
    )


# A maker's words for emergency error codes: `0x7310: speed`, `0x73xx: sensor`, `0xFF01..0xFF0F: axis`

KEY = re.compile(r"0x(?P<first>[0-9A-F]{1,4}|[0-9A-F]{2,3}X{1,2})(\.\.0x(?P<last>[0-9A-F]{1,4}))?", re.IGNORECASE)
"""A code, a class of codes with an x for any digit, or the first and the last of a range."""


def read_error_words(file: str | Path) -> dict[int, str]:
    """Return the words by code; of several entries for a code the narrowest counts. Raises FileError."""
    ranges = read_yaml(read_whole(file).decode("utf-8", "replace"), mapping(TEXT, converted(SCALAR, _codes)), file)
    # The narrowest comes last, and so replaces what wider entries say about its codes.
    widest_first = sorted(ranges.items(), key=lambda each: len(each[0]), reverse=True)
    return {code: str(text) for codes, text in widest_first for code in codes}


def _codes(key: str) -> range:
    """Return the codes that a key stands for; raises LocalError for a key that stands for none."""
    codes, found = range(0), KEY.fullmatch(key.strip())
    if found is not None and not ("X" in found["first"].upper() and (len(found["first"]) < 4 or found["last"])):
        low, high = (int(found["first"].upper().replace("X", digit), 16) for digit in "0F")
        codes = range(low, (int(found["last"], 16) if found["last"] else high) + 1)
    if not codes:
        raise LocalError(f"{str(key)!r} is not an error code: write 0x7310, 0x73xx or 0x7380..0x738F")
    return codes
