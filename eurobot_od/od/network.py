"""Which devices there are: files with node-IDs, a folder of files, a network file; and their dictionaries.

Every device gets a node-ID and a name of its own here; otherwise loading ends with one line that says which file is in
the way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from pathlib import Path

from eurobot_od.errors import DictionaryError, FileError
from eurobot_od.od import DEFAULT as DEFAULT
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.formats import files_in
from eurobot_od.od.network_file import NetworkFile, NodeFile, read_nodelist
from eurobot_od.od.values import NODE_IDS, parse_number
from eurobot_od.support.files import read_whole


def node_file(text: str) -> NodeFile:
    """Read `FILE` or `NODE-ID=FILE`; raises DictionaryError for a node-ID that cannot be."""
    head, equals, file = text.partition("=")
    number = parse_number(head) if equals else None
    if number is None:  # a path may have an equals sign, too
        return NodeFile(text)
    if number.value not in NODE_IDS:
        raise DictionaryError(file, None, f"node-ID {head} is not in {NODE_IDS[0]}..{NODE_IDS[-1]}")
    return NodeFile(file, number.value)


def read_network(path: str | Path) -> NetworkFile:
    """Read a network: a folder of EDS and DCF files, `nodelist.cpj`, or a YAML file; raises FileError."""
    if Path(path).is_dir():
        # by their stems, so that a DCF, which comes later, takes the place of its EDS
        return NetworkFile([NodeFile(str(each)) for each in {each.stem: each for each in files_in(path)}.values()])
    read = READERS.get(Path(path).suffix.lower())
    if read is None:
        raise FileError(path, f"not a network: neither a folder nor one of {', '.join(READERS)}")
    return read(read_whole(path).decode("utf-8", "replace"), str(path))


def is_network(path: str | Path) -> bool:
    """Whether a path names a network, by what it is or its suffix."""
    return Path(path).is_dir() or Path(path).suffix.lower() in READERS


def _read_yaml(text: str, file: str) -> NetworkFile:
    from eurobot_od.od.yaml_files import read_network_file  # most commands start without YAML

    return read_network_file(text, file)


READERS: Mapping[str, Callable[[str, str], NetworkFile]] = {
    ".yaml": _read_yaml,
    ".yml": _read_yaml,
    ".cpj": read_nodelist,
}
"""Readers of a network file's text by its suffix."""


def load(nodes: Iterable[NodeFile]) -> tuple[Dictionary, ...]:
    """Load the devices' files, ordered by node-ID; two of one name get their node-IDs after it.

    Raises DictionaryError as `Dictionary.load`, and if two have one node-ID.
    """
    loaded = sorted((Dictionary.load(*each) for each in nodes), key=lambda each: each.node_id)
    # sorted, so two of one node-ID are neighbours
    for one, other in pairwise(loaded):
        if one.node_id == other.node_id:
            raise DictionaryError(other.file, None, f"node-ID {other.node_id} is taken by {one.file.name}")
    counts = Counter(each.name for each in loaded)
    # All of one name get it: a name must not depend on which file comes first.
    return tuple(each.named(f"{each.name}_{each.node_id}") if counts[each.name] > 1 else each for each in loaded)
