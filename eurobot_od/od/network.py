"""Which nodes there are, by a network file: a YAML with their files and node-IDs, and what is declared of them.

Rule of this file: YAML is only taken apart into nodes with marks, so that every complaint has a line; numbers are read
as in an EDS (decimal or 0x), never as YAML 1.1 guesses them.

    nodes:
      core: {file: core.eds, node_id: 1}      # files are relative to this file; node_id where the file does not say it
      drive: {file: drive.dcf}
    shared: [Start Configuration Confirm]     # messages that several nodes may send
    order: [Emergency Shutdown, Emergency Stop]   # the most urgent first
    bit_rate: 500                             # kbit/s
"""

from __future__ import annotations

from pathlib import PurePath
from typing import NamedTuple

import yaml

from eurobot_od.errors import DictionaryError
from eurobot_od.od.values import NODE_IDS, parse_number


class NetworkFile(NamedTuple):
    """What a network file says: files by node name, node-IDs by node name, shared names, order of names, bit rate."""

    files: dict[str, str]
    node_ids: dict[str, int]
    shared: list[str]
    order: list[str]
    bit_rate: int | None


KEYS = ("nodes", "shared", "order", "bit_rate")
NODE_KEYS = ("file", "node_id")


def read_network_file(text: str, file: str) -> NetworkFile:
    """Read the text of a network file; raises DictionaryError with file and line."""
    return _File(file).read(text)


class _File:
    def __init__(self, file: str) -> None:
        self._file = file

    def read(self, text: str) -> NetworkFile:
        try:
            root = yaml.compose(text, yaml.SafeLoader)
        except yaml.YAMLError as error:
            what = str(error).replace("\n", " ")
            raise DictionaryError(self._file, None, f"not readable YAML: {what}") from error
        top = self._mapping(root, KEYS)
        nodes = {name: self._mapping(node, NODE_KEYS) for name, node in self._mapping(top.get("nodes"), None).items()}
        if not nodes:
            raise self._error(root, "it names no nodes")
        return NetworkFile(
            files={name: self._path(each.get("file"), root) for name, each in nodes.items()},
            node_ids={
                name: self._number(each["node_id"], NODE_IDS[0], NODE_IDS[-1])
                for name, each in nodes.items()
                if "node_id" in each
            },
            shared=self._names(top.get("shared")),
            order=self._names(top.get("order")),
            bit_rate=self._number(top["bit_rate"], 1, 1000) if "bit_rate" in top else None,
        )

    def _mapping(self, node: yaml.Node | None, known: tuple[str, ...] | None) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            raise self._error(node, "expected `key: value` lines")
        found: dict[str, yaml.Node] = {}
        for key, value in node.value:
            if key.value in found or (known and key.value not in known):
                raise self._error(key, f"{'repeated' if key.value in found else 'unknown'} key {key.value!r}")
            found[key.value] = value
        return found

    def _names(self, node: yaml.Node | None) -> list[str]:
        if node is None:
            return []
        if not isinstance(node, yaml.SequenceNode):
            raise self._error(node, "expected a list of names")
        return [self._text(each) for each in node.value]

    def _path(self, node: yaml.Node | None, root: yaml.Node | None) -> str:
        if node is None:
            raise self._error(root, "a node without `file`")
        return str(PurePath(self._file).parent / self._text(node))

    def _number(self, node: yaml.Node, low: int, high: int) -> int:
        number = parse_number(self._text(node))
        if number is None or number.relative or not low <= number.value <= high:
            raise self._error(node, f"{self._text(node)!r} is not a number from {low} to {high}")
        return number.value

    def _text(self, node: yaml.Node) -> str:
        if not isinstance(node, yaml.ScalarNode):
            raise self._error(node, "expected one word or number")
        return str(node.value)

    def _error(self, node: yaml.Node | None, what: str) -> DictionaryError:
        line = node.start_mark.line + 1 if node is not None else 1
        return DictionaryError(self._file, None, f"line {line}: {what}")
