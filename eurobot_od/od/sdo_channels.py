"""The COB-IDs of a device's SDO server: one rule for the simulated device, the master, logs, checks and the page.

They are those of 0x1200 in the file, ParameterValue before DefaultValue, or else the default ones (CiA 301, 7.3.3).
There are two exceptions: default identifiers of another node are used only if they are ParameterValues, because many
files have the numbers of one node in place of $NODEID; and those of the node for which a DCF is commissioned are not
used for another node.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary


class SdoChannel(NamedTuple):
    """COB-IDs of a node's SDO server: requests and answers."""

    requests: int
    answers: int

    @classmethod
    def default(cls, node_id: int) -> SdoChannel:
        """Return a node's default COB-IDs (CiA 301, 7.3.3)."""
        return cls(values.SDO_REQUEST_BASE + node_id, values.SDO_RESPONSE_BASE + node_id)

    @classmethod
    def of(cls, device: Dictionary) -> SdoChannel:
        """Return the COB-IDs of a device's SDO server."""
        said_at = standard.SDO_REQUESTS, standard.SDO_ANSWERS
        said = cls(*map(device.cob_id, said_at, cls.default(0)))
        node_id = said.usual_for
        if node_id is None:
            return said
        # A ParameterValue was set for this device; a DefaultValue may only be copied.
        is_set = all(map(device.has_own_value, said_at))
        is_for_another = node_id in (0, device.device.commissioned_node_id)
        return said if is_set and not is_for_another else cls.default(device.node_id)

    @property
    def usual_for(self) -> int | None:
        """Node-ID whose default identifiers these are, 0 for the bases alone; None if they are no default ones."""
        node_id = self.requests - values.SDO_REQUEST_BASE
        return node_id if node_id in (0, *values.NODE_IDS) and self == self.default(node_id) else None


def moved_server(device: Dictionary) -> str:
    """Return a sentence about a device's SDO server if it is not at its default COB-IDs; else empty."""
    at = SdoChannel.of(device)
    if at == SdoChannel.default(device.node_id):
        return ""
    others = f": there node {at.usual_for} has its own by default" if at.usual_for else ""
    return f"its SDO server is at 0x{at.requests:03X}, answers at 0x{at.answers:03X}, as its file says (0x1200){others}"


def sdo_channels(dictionary: Dictionary) -> Iterator[tuple[int, int, int, int]]:
    """Yield each SDO channel in a file: node-IDs of server and client, identifiers of requests and answers.

    The client is 0 if the file does not name it; for the default channel it is the master (CiA 301, 7.5.2.33).
    """
    yield dictionary.node_id, 0, *SdoChannel.of(dictionary)
    records = [index for index in (*standard.SDO_SERVERS[1:], *standard.SDO_CLIENTS) if index in dictionary.members]
    for index in records:
        request, answer, other = (dictionary.number((index, sub)) for sub in (1, 2, 3))
        own = dictionary.node_id
        server, client = (own, other or 0) if index in standard.SDO_SERVERS else (other, own)
        if request and answer and server and not (request | answer) & values.NOT_VALID:
            yield server, client, values.identifier(request), values.identifier(answer)
