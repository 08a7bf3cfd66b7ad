"""The words a suite may use: messages and objects of its EDS files, and its variables.

Rule of this file: found before the suite is read in earnest, so that everything in it can be checked where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import yaml

from eurobot_od import dialects
from eurobot_od.check.values import Scale
from eurobot_od.dictionary import Dictionary
from eurobot_od.kinds import Kind, Limits
from eurobot_od.logs.meaning import Decoder
from eurobot_od.outline import Outline
from eurobot_od.protocol import Protocol


@dataclass(frozen=True)
class Vocabulary:
    """The EDS files by node, and the names of variables: `constants` with their values, `saved` by a step.

    `nodes` are those under test.
    """

    dictionaries: Mapping[str, Dictionary]
    constants: Mapping[str, str]
    saved: frozenset[str]
    nodes: tuple[str, ...]

    @cached_property
    def decoder(self) -> Decoder:
        """What frames mean by the EDS files."""
        return Decoder(map(Outline.of, self.dictionaries.values()))

    @property
    def protocol(self) -> Protocol:
        """All messages of the EDS files."""
        return self.decoder.protocol

    def scale(self, kind: Kind, limits: Limits) -> Scale:
        """Return what a field's values are read by."""
        return Scale(kind, limits, self.constants, self.saved)


def load_dictionaries(dialect: str | None) -> dict[str, Dictionary]:
    """Load a dialect's EDS files by node; raises UnknownName, DictionaryError."""
    return {each.name: each for each in dialects.load_all(dialect)}


def texts_at(root: yaml.Node, key: str) -> dict[str, str]:
    """Return the names and plain values below a key of the whole document: `{name: value}`, a list, or one value."""
    node = next((value for name, value in _pairs(root) if name == key), None)
    if isinstance(node, yaml.ScalarNode):
        return {node.value: node.value}
    if isinstance(node, yaml.SequenceNode):
        return {each.value: each.value for each in node.value if isinstance(each, yaml.ScalarNode)}
    return {name: value.value for name, value in _pairs(node) if isinstance(value, yaml.ScalarNode)}


def saved_names(root: yaml.Node) -> frozenset[str]:
    """Return the names of all variables that a step of the document saves."""
    return frozenset(_saved(root))


def _saved(node: yaml.Node) -> Iterator[str]:
    if isinstance(node, yaml.SequenceNode):
        for each in node.value:
            yield from _saved(each)
    for name, value in _pairs(node):
        if name != "save":
            yield from _saved(value)
        elif isinstance(value, yaml.ScalarNode):
            yield value.value
        else:
            yield from (each for each, _ in _pairs(value))


def _pairs(node: yaml.Node | None) -> list[tuple[str, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode):
        return []
    return [(key.value, value) for key, value in node.value if isinstance(key, yaml.ScalarNode)]
