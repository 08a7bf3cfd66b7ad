"""What a network file says, and the one of CiA 306-3: `nodelist.cpj`, the DCF files of a network by node-ID.

[Topology]
Nodes=0x02
Node2Present=0x01
Node2Name=drive
Node2DCFName=drive.dcf
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath, PureWindowsPath
from types import MappingProxyType
from typing import Annotated, NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.od.document import parse
from eurobot_od.od.values import NODE_IDS, Number, parse_number
from eurobot_od.support.declared import ByName, OneOrMore, Within


class NodeFile(NamedTuple):
    """A node: its EDS or DCF, its node-ID if that is said, its name if it is not the file's, its modules if said.

    `patch` are the files that are laid over its own.
    """

    file: str
    node_id: Annotated[int, Within(NODE_IDS[0], NODE_IDS[-1])] | None = None
    name: str = ""
    modules: Sequence[str] | None = None
    patch: Annotated[Sequence[str], OneOrMore()] = ()


class TrafficEntry(NamedTuple):
    """How often a message is sent, as a network file says it, and what depends on that; empty for what is not said.

    `every`, `jitter` and `deadline` are a duration, or the name of a setting in ms.
    """

    every: str = ""
    answers: str = ""
    jitter: str = ""
    deadline: str = ""
    reason: str = ""


class NetworkFile(NamedTuple):
    """What a network file says: its nodes, shared messages, messages by urgency, bit rate, what is sent how often.

    `robot` is the name of an installed robot (see `plugin`); such a file need not name nodes. `master` is the
    node that leads the network, or any other name for a master without a file, such as a PC.
    """

    nodes: Annotated[Sequence[NodeFile], ByName()] = ()
    shared: Sequence[str] = ()
    order: Sequence[str] = ()
    bit_rate: Annotated[int, Within(1, 1000, "kbit/s")] | None = None
    traffic: Mapping[str, TrafficEntry] = MappingProxyType({})
    robot: str = ""
    master: str = ""


NODE_KEY = re.compile(r"node(\d{1,3})(?:present|name|dcfname)")


def read_nodelist(text: str, file: str) -> NetworkFile:
    """Read the text of a nodelist, its own path `file`; of several networks the first. Raises DictionaryError."""
    topology = parse(text).sections.get("topology")
    if topology is None:
        raise DictionaryError(file, None, "not a nodelist: it has no [Topology]")
    # A node may be named by any of its keys alone; one that does not say that it is present counts as present.
    numbers = dict.fromkeys(int(match[1]) for key in topology.entries if (match := NODE_KEY.fullmatch(key)))
    nodes = []
    for number in numbers:
        if parse_number(topology.text(f"node{number}present")) == Number(0):
            continue
        dcf = topology.text(f"node{number}dcfname")
        if not dcf:
            raise DictionaryError(file, None, f"line {topology.line}: node {number} has no Node{number}DCFName")
        path = PurePath(file).parent / PureWindowsPath(dcf)  # both kinds of slashes are in use
        nodes.append(NodeFile(str(path), number, topology.text(f"node{number}name")))
    return NetworkFile(nodes)
