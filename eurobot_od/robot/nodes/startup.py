"""The startup of the robot (document 2.3, 5.1): node checks, the start configuration, and whether all is understood.

Confirms of the start configuration have one identifier and may merge on the wire, so one of them may be anybody's. That
is why a configuration ends with a second check of both nodes.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress

from eurobot_od.device.flow import START, Ask, Script
from eurobot_od.errors import DictionaryError, NoAnswer
from eurobot_od.od.standard import REVISION
from eurobot_od.pdo.message import Message
from eurobot_od.robot.model import messages
from eurobot_od.robot.nodes.identity import DialectMismatch, SdoClientParameter, revision_in
from eurobot_od.robot.nodes.node import CoreSettings

NODE_CHECKS: tuple[tuple[str, Message, type[Message]], ...] = (
    ("drive", messages.CheckDriveRequest(), messages.CheckDriveResponse),
    ("navigation", messages.CheckNaviRequest(), messages.CheckNaviResponse),
)
"""The nodes in the order in which they are checked (2014 robot: drive first)."""

CONFIGURED = ("Team colour", "Enemies", "Confederates", "Enemy 1 diameter", "Enemy 2 diameter")
"""The sub-indices of the object `Start configuration`, in the order of the message's fields."""


class Readiness:
    """What has to be there before the first goto: both nodes checked, a start configuration confirmed.

    `checked` has the nodes that have answered in the dialect of this core, and have neither booted nor been lost since;
    `configured` is whether the latest start configuration was confirmed.
    """

    def __init__(self) -> None:
        self.checked: set[str] = set()
        self.configured = False

    def missing(self, without: Collection[str] = ()) -> str:
        """Say what is missing and what to call, '' if nothing is; the check of some nodes may be done `without`."""
        unchecked = [f"the {node}" for node, *_ in NODE_CHECKS if node not in {*self.checked, *without}]
        texts = [f"{' and '.join(unchecked)} must answer a check: call check_nodes()"] if unchecked else []
        texts += [] if self.configured else ["a start configuration must be confirmed: call configure_start()"]
        return "; ".join(texts)


def check_nodes(core: CoreSettings, checked: set[str], without: Collection[str] = ()) -> Script[dict[str, float]]:
    """Check both nodes; return the seconds that each took to answer. Raises NoAnswer, DialectMismatch.

    `checked` has the nodes that have answered in the dialect of this core; it is made anew. Nodes to do `without` are
    not checked.
    """
    took = {}
    # Before anything is asked: a node that does not answer now must not count as checked from before.
    checked.clear()
    yield START
    for node, request, answer in NODE_CHECKS:
        if node in without:
            continue
        # Answers are told apart by their identifiers: in 2014 either node's answer satisfied either check.
        asked = core.now
        yield Ask(request, answer, core.check_wait, core.check_attempts)
        took[node] = core.now - asked
        yield from _compare(core, node)
        checked.add(node)
    return took


def _compare(core: CoreSettings, node: str) -> Script[None]:
    """Make sure that a node speaks our dialect, if it can be asked."""
    channel = SdoClientParameter.to(node, core.device)
    if channel is None:
        return
    with suppress(NoAnswer):  # the 2014 robot's own nodes know no SDO
        answer = yield Ask(channel.ask(), channel.answer, core.identity_wait, 1)
        theirs, ours = revision_in(answer), core.device.number(REVISION)
        if theirs is not None and theirs != ours:
            raise DialectMismatch(node, channel.node_id, theirs, ours)


def configure(
    core: CoreSettings,
    configuration: messages.StartConfigurationSet,
    readiness: Readiness,
    without: Collection[str] = (),
) -> Script[float]:
    """Set the start configuration, and check both nodes again; return when it was confirmed.

    Raises NoAnswer, DialectMismatch.
    """
    yield START
    # Until the confirm nobody knows which configuration the nodes go by.
    readiness.configured = False
    yield Ask(
        configuration,
        messages.StartConfigurationConfirm,
        core.configuration_wait,
        core.configuration_transmissions,
    )
    confirmed = core.now
    # One confirm may be anybody's, and two equal ones merge on the wire: so both nodes are asked once more.
    yield from check_nodes(core, readiness.checked, without)
    readiness.configured = True
    return confirmed


def take_back(core: CoreSettings, configuration: messages.StartConfigurationSet, checked: set[str]) -> Script[None]:
    """Ask a navigation that was lost until it answers, and configure it: the drive drives on meanwhile.

    Raises DialectMismatch.
    """
    node, request, answer = NODE_CHECKS[1]
    yield START
    while True:
        with suppress(NoAnswer):
            yield Ask(request, answer, core.check_wait, core.check_attempts)
            break
    yield from _compare(core, node)
    yield from tell_navigation(core, configuration)
    checked.add(node)


def tell_navigation(core: CoreSettings, configuration: messages.StartConfigurationSet) -> Script[None]:
    """Configure the navigation alone.

    A Start Configuration Set would send the drive's estimate back to its start place, so each sub-index is written by
    SDO; a navigation without SDO goes without.
    """
    channel = SdoClientParameter.to("navigation", core.device)
    if channel is not None:
        with suppress(NoAnswer, DictionaryError):  # no SDO; a file that has the configuration in other pieces
            for name, value in zip(CONFIGURED, configuration):
                order = channel.order(core.device.dictionary, f"Start configuration.{name}", int(value))
                yield Ask(order, channel.answer, core.identity_wait, 1)
