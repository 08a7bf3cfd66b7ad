"""The words a suite may use: messages and objects of its EDS files, and its variables.

Rule of this file: found before the suite is read in earnest, so that everything in it can be checked where it stands.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import yaml

from eurobot_od.check.values import Scale
from eurobot_od.logs.meaning import Decoder
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Outline
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Kind
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.messages import CATALOGUE


class Dictionaries(Mapping[str, Dictionary]):
    """Dictionaries by node; each is loaded when a suite asks for it, as those without SDO steps do not."""

    def __init__(self, outlines: Iterable[Outline]) -> None:
        self._outlines = {each.name: each for each in outlines}
        self._loaded: dict[str, Dictionary] = {}

    def __getitem__(self, node: str) -> Dictionary:
        if node not in self._loaded:
            self._loaded[node] = Dictionary.load(self._outlines[node].file)
        return self._loaded[node]

    def __iter__(self) -> Iterator[str]:
        return iter(self._outlines)

    def __len__(self) -> int:
        return len(self._outlines)


class Dialect(NamedTuple):
    """What frames mean by a dialect's EDS files, and its dictionaries by node."""

    decoder: Decoder
    dictionaries: Dictionaries


@dataclass(frozen=True)
class Vocabulary:
    """What a `dialect` has, and the names of variables: `constants` with their values, `saved` by a step.

    `nodes` are those under test.
    """

    dialect: Dialect
    constants: Mapping[str, str]
    saved: frozenset[str]
    nodes: tuple[str, ...]

    @property
    def dictionaries(self) -> Mapping[str, Dictionary]:
        """The EDS files by node."""
        return self.dialect.dictionaries

    @property
    def decoder(self) -> Decoder:
        """What frames mean by the EDS files."""
        return self.dialect.decoder

    @property
    def protocol(self) -> Protocol:
        """All messages of the EDS files."""
        return self.decoder.protocol

    def scale(self, kind: Kind, limits: Limits) -> Scale:
        """Return what a field's values are read by."""
        return Scale(kind, limits, self.constants, self.saved)


def load_dialect(dialect: str | Path | None) -> Dialect:
    """Load a dialect's EDS files; raises UnknownName, DictionaryError."""
    outlines = dialects.outlines(dialect)
    return Dialect(Decoder(outlines, CATALOGUE), Dictionaries(outlines))


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
