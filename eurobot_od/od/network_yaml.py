"""A network file in YAML: its nodes with their files and node-IDs, and what is declared of them.

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
    robot: .                                  # whose messages and nodes these are, for `--robot` where it is left out
"""

from __future__ import annotations

from pathlib import PurePath

import yaml

from eurobot_od.errors import DictionaryError
from eurobot_od.od.network_file import NetworkFile, NodeFile, TrafficEntry
from eurobot_od.od.values import NODE_IDS, parse_number
from eurobot_od.support.yaml_places import (
    NodeReader,
    Problems,
    ReadError,
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
