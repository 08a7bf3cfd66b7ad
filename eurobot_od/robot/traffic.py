"""What the robot's three nodes send, and how often: for the analysis of its bus."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.load.network_set import network_set
from eurobot_od.od.network import read_network
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol

if TYPE_CHECKING:
    from eurobot_od.load.message_set import MessageSet


def message_set(dialect: str | Path | None = None) -> MessageSet:
    """Return the messages of a dialect's EDS files, with the periods of these files and of the dialects' network file.

    Raises UnknownName, DictionaryError.
    """
    file, outlines = dialects.network_file(), dialects.outlines(dialect)
    names = {each.cob_id: each.name for each in EurobotProtocol.load(dialect).bindings}
    return network_set(outlines, names, read_network(file), str(file))
