"""What stands in YAML beside the files of devices: a network, and a maker's words for error codes.

A network file has nodes with their files and node-IDs, and what is declared of them.

Rule of this file: names and numbers are read as they are written, and numbers as in an EDS (decimal, 0x or octal):
a node may be called `off`, and what YAML 1.1 makes of it does not count.

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

import yaml

from eurobot_od.errors import DictionaryError
from eurobot_od.od.document import read_bytes
from eurobot_od.od.network_file import NetworkFile, NodeFile, TrafficEntry
from eurobot_od.od.values import NODE_IDS, parse_number
from eurobot_od.support.yaml_places import (
    NodeReader,
    Problem,
    Problems,
    ReadError,
    any_text,
    listing,
    mapping,
    one_or_more,
    read_yaml,
    record,
    refuse,
    scalar,
)


def number_of(numbers: range) -> NodeReader[int]:
    """Make a reader of a number as an EDS has it."""

    def read(node: yaml.Node, problems: Problems) -> int:
        text = scalar(node, problems)
        number = parse_number(text)
        if number is None or number.relative or number.value not in numbers:
            refuse(node, problems, f"expected a number from {numbers[0]} to {numbers[-1]}, found {str(text)!r}")
        return number.value

    return read


NODE = record(
    NodeFile,
    {"file": scalar},
    {"node_id": number_of(NODE_IDS), "modules": listing(scalar), "patch": one_or_more(scalar)},
)


def _nodes(node: yaml.Node, problems: Problems) -> list[NodeFile]:
    named = mapping(NODE, key=scalar)(node, problems)
    return [each._replace(name=str(name)) for name, each in named.items()]


TRAFFIC = mapping(record(TrafficEntry, {}, dict.fromkeys(TrafficEntry._fields, scalar)), key=scalar)

NETWORK = record(
    NetworkFile,
    {},
    {
        "nodes": _nodes,
        "robot": scalar,
        "master": scalar,
        "shared": listing(scalar),
        "order": listing(scalar),
        "bit_rate": number_of(range(1, 1001)),
        "traffic": TRAFFIC,
    },
)


def read_network_file(text: str, file: str) -> NetworkFile:
    """Read the text of a network file, its own path `file`; raises DictionaryError with the line of the first fault."""
    problems: Problems = []
    try:
        network = read_yaml(text, NETWORK, problems)
    except ReadError as error:
        place, what = problems[0]  # the first one: a DictionaryError is one line
        raise DictionaryError(file, None, f"line {place.line}: {what}") from error
    if not network.nodes and not network.robot:
        raise DictionaryError(file, None, "line 1: it names no nodes")
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
    """Return the words by code; of several entries for a code the narrowest counts. Raises DictionaryError."""
    problems: Problems = []
    try:
        words = read_yaml(read_bytes(file).decode("utf-8", "replace"), mapping(any_text, key=scalar), problems)
        ranges = [(_codes(str(key)), str(text)) for key, text in words.items()]
        problems += [
            Problem(key.place, f"{str(key)!r} is no error code: write 0x7310, 0x73xx or 0x7380..0x738F")
            for key, (codes, _) in zip(words, ranges)
            if not codes
        ]
        if problems:
            raise ReadError
    except ReadError as error:
        place, what = problems[0]
        raise DictionaryError(file, None, f"line {place.line}: {what}") from error
    # The narrowest comes last, and so replaces what wider entries say about its codes.
    widest_first = sorted(ranges, key=lambda each: len(each[0]), reverse=True)
    return {code: text for codes, text in widest_first for code in codes}


def _codes(key: str) -> range:
    """Return the codes that a key stands for, none if it stands for no code."""
    found = KEY.fullmatch(key.strip())
    if found is None:
        return range(0)
    first = found["first"].upper()
    low, high = (int(first.replace("X", digit), 16) for digit in "0F")
    if "X" in first and (len(first) < 4 or found["last"]):
        return range(0)
    return range(low, (int(found["last"], 16) if found["last"] else high) + 1)
