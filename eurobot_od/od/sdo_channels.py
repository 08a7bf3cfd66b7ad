"""Where a device's SDO server is: the one rule for the simulated device, the master, logs, checks and the page.

The file's 0x1200 counts, ParameterValue before DefaultValue, as for every other identifier of the device; without a
valid one it is at its default identifiers (CiA 301, 7.3.3). Only both default identifiers of another node are not
taken at their word unless they are ParameterValues: many files were written for one node and have its numbers where
$NODEID belongs. Nor are those of the node that a DCF is commissioned for, where the DCF is used for another one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary


class SdoChannel(NamedTuple):
    """The COB-IDs of a node's SDO server: of the requests to it, and of its answers."""

    requests: int
    answers: int

    @classmethod
    def default(cls, node_id: int) -> SdoChannel:
        """Return where a node's SDO server is by default (CiA 301, 7.3.3)."""
        return cls(values.SDO_REQUEST_BASE + node_id, values.SDO_RESPONSE_BASE + node_id)

    @classmethod
    def of(cls, device: Dictionary) -> SdoChannel:
        """Return where a device's SDO server is, as its file says."""
        said_at = standard.SDO_REQUESTS, standard.SDO_ANSWERS
        said = cls(*map(device.cob_id, said_at, cls.default(0)))
        node_id = said.usual_for
        if node_id is None:
            return said
        # A ParameterValue was set for this device; a DefaultValue was perhaps only copied.
        is_set = all(map(device.has_own_value, said_at))
        is_for_another = node_id in (0, device.device.commissioned_node_id)
        return said if is_set and not is_for_another else cls.default(device.node_id)

    @property
    def usual_for(self) -> int | None:
        """The node-ID whose default identifiers both are, 0 if they lack one; None if they belong to no node."""
        node_id = self.requests - values.SDO_REQUEST_BASE
        return node_id if node_id in (0, *values.NODE_IDS) and self == self.default(node_id) else None


def moved_server(device: Dictionary) -> str:
    """Say where a device's SDO server is, if its file has moved it from where every tool looks for it; else nothing."""
    at = SdoChannel.of(device)
    if at == SdoChannel.default(device.node_id):
        return ""
    others = f": there node {at.usual_for} has its own by default" if at.usual_for else ""
    return f"its SDO server is at 0x{at.requests:03X}, answers at 0x{at.answers:03X}, as its file says (0x1200){others}"


def sdo_channels(dictionary: Dictionary) -> Iterator[tuple[int, int, int, int]]:
    """Yield node-IDs of server and client, identifiers of requests and answers, of each channel that a file describes.

    The client's is 0 if no file names it: of the default channel it is the master (CiA 301, 7.5.2.33).
    """
    yield dictionary.node_id, 0, *SdoChannel.of(dictionary)
    records = [index for index in (*standard.SDO_SERVERS[1:], *standard.SDO_CLIENTS) if index in dictionary.members]
    for index in records:
        request, answer, other = (dictionary.number((index, sub)) for sub in (1, 2, 3))
        own = dictionary.node_id
        server, client = (own, other or 0) if index in standard.SDO_SERVERS else (other, own)
        if request and answer and server and not (request | answer) & values.NOT_VALID:
            yield server, client, values.identifier(request), values.identifier(answer)
