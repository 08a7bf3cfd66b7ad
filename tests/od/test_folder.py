"""A folder of EDS files is a network, ordered by node-ID."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.folder import dictionaries, outlines
from eurobot_od.od.outline import Outline

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("load", "kind"), [(outlines, Outline), (dictionaries, Dictionary)])
def test_all_files_are_loaded_by_node_id(load: Callable[[Path], tuple[Outline, ...]], kind: type[Outline]) -> None:
    found = load(ROOT / "eds" / "canopen")
    assert [(each.node_id, each.name, type(each)) for each in found] == [
        (1, "core", kind),
        (2, "drive", kind),
        (3, "navigation", kind),
    ]


@pytest.mark.parametrize("load", [outlines, dictionaries])
def test_two_files_with_one_node_id_are_refused(
    load: Callable[[Path], tuple[Outline, ...]], spoil_eds: Callable[..., Path]
) -> None:
    folder = spoil_eds(("navigation", "2100sub1", "DefaultValue", "2"))
    with pytest.raises(DictionaryError, match="node-ID 2 is taken by drive"):
        load(folder)
