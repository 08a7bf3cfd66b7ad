"""The files that a protocol table makes: written into a folder, or compared with what is there."""

from __future__ import annotations

from itertools import product, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from eurobot_od.od.make.table import Table
from eurobot_od.od.make.text import eds_text

NETWORK = "network.yaml"
HEAD = """\
# {}
# The network of dialect {} for `eurobot-od lint --network` and `load`: files and node-IDs of the nodes, messages that
# several of them send, the order of priorities, the most urgent first, and how often what is sent.
"""
LINE = 120
"""No text of the network file is broken before this column."""
Texts = dict[str, str]
"""What the files say, by their paths below the folder."""


def make_files(table: Table) -> Texts:
    """Return the text of every file: `DIALECT/NODE.eds`, and the network file."""
    pairs = product(table.dialects, table.nodes)
    texts = {f"{dialect}/{node}.eds": eds_text(table, dialect, node) for dialect, node in pairs}
    return {**texts, NETWORK: network_text(table)}


def network_text(table: Table) -> str:
    """Return the network of the table's first dialect, for `eurobot-od lint --network` and `load`.

    Identifiers are priorities on a CAN bus, so the order of the messages is the order of their identifiers.
    """
    dialect = next(iter(table.dialects))
    messages = table.by_identifier
    network: dict[str, Any] = {
        "nodes": {
            str(name): {"file": f"{dialect}/{name}.eds", "node_id": int(node.node_id)}
            for name, node in table.nodes.items()
        },
        "shared": [str(name) for name, each in messages.items() if len(each.senders) > 1],
        "order": [str(name) for name in messages],
        "bit_rate": int(table.bit_rate),
    }
    if table.traffic:
        network["traffic"] = {  # as plain texts: PyYAML's safe_dump refuses a `Text`
            str(name): {key: str(value) for key, value in vars(row).items() if value}
            for name, row in table.traffic.items()
        }
    return HEAD.format(table.file.comment, dialect) + yaml.safe_dump(network, sort_keys=False, width=LINE)


def write_files(texts: Texts, folder: Path) -> None:
    """Write every file below `folder`; what was there before is whole until all new files are. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in texts:
        (folder / path).parent.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".make-eds-") as scratch:  # a full disk is met here
        for number, text in enumerate(texts.values()):
            Path(scratch, str(number)).write_bytes(text.encode("ascii"))  # bytes: no line ends of the system's own
        for number, path in enumerate(texts):
            Path(scratch, str(number)).replace(folder / path)


def differences(texts: Texts, folder: Path) -> list[str]:
    """Say in one line each which files below `folder` differ, are missing, or should not be there.

    Only an EDS file in a dialect's folder can be too many: it would be loaded as a node. Raises OSError.
    """
    dialects = {path.partition("/")[0] for path in texts if path != NETWORK}
    there = {each.relative_to(folder).as_posix() for name in dialects for each in (folder / name).glob("*.eds")}
    lines = {path: difference(text, folder / path) for path, text in texts.items()}
    lines |= dict.fromkeys(there - texts.keys(), "should not be there")
    return [f"{folder / path}: {what}" for path, what in sorted(lines.items()) if what]


def difference(text: str, file: Path) -> str:
    """Say in which line a file first differs from `text`; nothing if it does not."""
    try:
        pairs = zip_longest(text.encode("ascii").split(b"\n"), file.read_bytes().split(b"\n"))
    except FileNotFoundError:
        return "is missing"
    return next((f"differs first in line {n}" for n, (new, old) in enumerate(pairs, start=1) if new != old), "")
