"""Random SDO requests against every node of the robot."""

from __future__ import annotations

import pytest
import sdo_fuzz

from eurobot_od.robot import dialects


@pytest.mark.parametrize("dialect", dialects.names())
@pytest.mark.parametrize("node", ["core", "drive", "navigation"])
def test_every_node_answers_by_the_standard(node: str, dialect: str) -> None:
    assert sdo_fuzz.run(dialects.load(node, dialect), requests=1500, seed=7) > 0
