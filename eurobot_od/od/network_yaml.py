"""A network file in YAML: its nodes with their files and node-IDs, and what is declared of them.

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
    robot: .                                  # whose messages and nodes these are, for `--robot` where it is left out
"""

from __future__ import annotations

from pathlib import PurePath

from eurobot_od.errors import FileError, LocalError
from eurobot_od.od.network_file import NetworkFile
from eurobot_od.od.values import parse_number
from eurobot_od.support.yaml_shapes import PLAIN, SCALAR, converted, read_yaml, shape_of


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
