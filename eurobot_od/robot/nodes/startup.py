"""The startup of the robot (document 2.3, 5.1): node checks, the start configuration, and whether all is understood.

Confirms of the start configuration have one identifier and may merge on the wire, so one of them may be anybody's. That
is why a configuration ends with a second check of both nodes.
"""

from __future__ import annotations

from contextlib import suppress

from eurobot_od.device.flow import START, Ask, Script
from eurobot_od.errors import NoAnswer
from eurobot_od.pdo.message import Message
from eurobot_od.robot import messages
from eurobot_od.robot.nodes.identity import REVISION, Channel, DialectMismatch, revision_in
from eurobot_od.robot.nodes.node import RobotNode

NODE_CHECKS: tuple[tuple[str, Message, type[Message]], ...] = (
    ("drive", messages.CheckDriveRequest(), messages.CheckDriveResponse),
    ("navigation", messages.CheckNaviRequest(), messages.CheckNaviResponse),
)
"""The nodes in the order in which they are checked (2014 robot: drive first)."""

CHECK_SETTINGS = ("Node check.Check wait", "Node check.Check attempts")
CONFIGURATION_SETTINGS = (
    "Configuration handshake.Configuration confirm wait",
    "Configuration handshake.Configuration transmissions",
)
"""How long to wait for an answer, and how often to ask."""


def check_nodes(core: RobotNode) -> Script[dict[str, float]]:
    """Check both nodes; return the seconds that each took to answer. Raises NoAnswer, DialectMismatch."""
    took = {}
    yield START
    for node, request, answer in NODE_CHECKS:
        asked = core.now
        yield core.asking(request, answer, *CHECK_SETTINGS)
        took[node] = core.now - asked
    for node in took:
        yield from _compare(core, node)
    return took


def _compare(core: RobotNode, node: str) -> Script[None]:
    """Make sure that a node speaks our dialect, if it can be asked."""
    channel = Channel.to(node, core.device)
    if channel is None:
        return
    with suppress(NoAnswer):  # the 2014 robot's own nodes know no SDO
        answer = yield Ask(channel.ask(), channel.answer, core.seconds("Node check.Identity wait"), 1)
        theirs, ours = revision_in(answer), core.device.number(REVISION)
        if theirs is not None and theirs != ours:
            raise DialectMismatch(node, channel.node_id, theirs, ours)


def configure(core: RobotNode, configuration: messages.StartConfigurationSet) -> Script[float]:
    """Set the start configuration, and check both nodes again; return when it was confirmed. Raises NoAnswer."""
    yield START
    yield core.asking(configuration, messages.StartConfigurationConfirm, *CONFIGURATION_SETTINGS)
    confirmed = core.now
    for _, request, answer in NODE_CHECKS:
        yield core.asking(request, answer, *CHECK_SETTINGS)
    return confirmed
