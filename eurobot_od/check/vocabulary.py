"""The words a suite may use: messages and objects of its EDS files, and its variables.

They are collected before the suite itself is read, so that each of its words can be checked where it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import yaml

from eurobot_od.check.values import Scale, Values
from eurobot_od.errors import LocalError
from eurobot_od.od import network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import OnRefused, fatal
from eurobot_od.pdo.kinds import NOTHING, Catalogue
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support import texts
from eurobot_od.support.yaml_shapes import DURATION as ANY_DURATION
from eurobot_od.support.yaml_shapes import converted, longer_than_0, matching
from eurobot_od.traffic.meaning import Decoder

LONGEST_TIME = 86_400.0
"""The longest time in s that a step may take for anything it does once."""


def _at_most_a_day(seconds: float) -> float:
    if seconds > LONGEST_TIME:
        raise LocalError(f"{seconds:g} s is too long: at most {texts.text(LONGEST_TIME)}, a day")
    return seconds


DURATION = converted(ANY_DURATION, _at_most_a_day)
SOME_TIME = converted(DURATION, longer_than_0)
NAME = matching(r"[A-Za-z_][A-Za-z0-9_]*", "a name of letters, digits and _")


class Networks(NamedTuple):
    """The networks that suites may be for, and the catalogue of their message types.

    `find` returns the path for what a suite has as its `dialect`, or that of the default network for None; it raises
    UnknownName. `load` returns the devices of such a path; `refused` gets their PDOs that do not hold.
    """

    find: Callable[[str | None], Path]
    catalogue: Catalogue = NOTHING
    load: Callable[[Path], tuple[Dictionary, ...]] = lambda path: network.load(network.read_network(path).nodes)
    refused: OnRefused = fatal


class Vocabulary(NamedTuple):
    """What the EDS files of a network have, and the names of variables: `constants` with values, `saved` by a step.

    `nodes` are those under test; `networks` has the others that a suite could be for.
    """

    networks: Networks
    decoder: Decoder
    dictionaries: Mapping[str, Dictionary]
    constants: Mapping[str, str]
    saved: frozenset[str]
    nodes: tuple[str, ...]

    @property
    def protocol(self) -> Protocol:
        """All messages of the EDS files."""
        return self.decoder.protocol

    def scale(self, values: Values) -> Scale:
        """Return what values are read by."""
        return Scale(values, self.constants, self.saved)


def texts_at(root: yaml.Node, key: str) -> dict[str, str]:
    """Return the names and plain values below a key of the whole document: `{name: value}`, a list, or one value."""
    node = next((value for name, value in _pairs(root) if name == key), None)
    if isinstance(node, yaml.ScalarNode):
        return {node.value: node.value}
    if isinstance(node, yaml.SequenceNode):
        return {each.value: each.value for each in node.value if isinstance(each, yaml.ScalarNode)}
    return {name: value.value for name, value in _pairs(node) if isinstance(value, yaml.ScalarNode)}


def saved_names(node: yaml.Node) -> Iterator[str]:
    """Yield the names of all variables that a step below a node saves."""
    if isinstance(node, yaml.SequenceNode):
        for each in node.value:
            yield from saved_names(each)
    for name, value in _pairs(node):
        if name != "save":
            yield from saved_names(value)
        elif isinstance(value, yaml.ScalarNode):  # `sdo: {read: ..., save: t}`
            yield value.value
        else:  # `save: {t: Goto State Response.time}`, the action
            yield from (each for each, _ in _pairs(value))


def _pairs(node: yaml.Node | None) -> list[tuple[str, yaml.Node]]:
    # What has the wrong shape is passed over in silence: the format, which reads all of it again, reports it.
    if not isinstance(node, yaml.MappingNode):
        return []
    return [(key.value, value) for key, value in node.value if isinstance(key, yaml.ScalarNode)]
