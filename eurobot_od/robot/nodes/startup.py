"""The startup of the robot (document 2.3, 5.1): node checks, the start configuration, and dialects.

Confirms of the start configuration have one identifier and may merge on the wire, so one of them may be anybody's. That
is why a configuration ends with a second check of both nodes.

A node's revision number, read by SDO, tells which EDS it is loaded from (CiA 301, 7.2.4.3.3 and 7.5.2.21). A node that
does not answer, such as those of the 2014 robot, is not a CANopen node: it cannot be asked, and is trusted. One that
answers with another revision speaks another dialect, and is not driven.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from math import inf
from typing import NamedTuple

from eurobot_od.device.device import Device
from eurobot_od.device.flow import START, Ask, Script
from eurobot_od.errors import DictionaryError, NoAnswer, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import REVISION
from eurobot_od.pdo.message import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.model import messages
from eurobot_od.robot.nodes.node import CoreSettings
from eurobot_od.sdo.client import TransferError, download, upload

# The dialect of another node


CHANNEL_NAME = "SDO client parameter {}"
"""ParameterName of the record that says how to reach a node by SDO."""


class DialectMismatch(RemoteError):
    """A node is loaded from the EDS of another dialect than the core; `theirs` and `ours` are revision numbers.

    The dialects get their names where the error is turned into text, not where it is raised: finding a name reads EDS
    files, and the core runs on the thread that receives frames.
    """

    def __init__(self, node: str, node_id: int, theirs: int, ours: int) -> None:
        super().__init__(node, node_id, theirs, ours)
        self.node, self.node_id, self.theirs, self.ours = node, node_id, theirs, ours

    def __str__(self) -> str:
        theirs, ours = _eds(self.node, self.theirs), _eds("core", self.ours)
        what = f"{self.node} (node {self.node_id}) speaks another dialect"
        return f"{what}: it is loaded from {theirs}, the core from {ours}"


def _eds(node: str, revision: int) -> str:
    """Describe the EDS with a revision number, by the dialect that has it."""
    dictionaries = ((name, dictionary) for name in dialects.names() for dictionary in dialects.load_all(name))
    known = [
        name for name, dictionary in dictionaries if (dictionary.name, dictionary.default(REVISION)) == (node, revision)
    ]
    return f"an EDS of revision 0x{revision:08X}" + (f" ({known[0]})" if known else "")


class SdoClientParameter(NamedTuple):
    """How a device reaches another one by SDO (CiA 301, 7.5.2.34)."""

    request: int
    answer: int
    node_id: int

    @classmethod
    def to(cls, node: str, device: Device) -> SdoClientParameter | None:
        """Return how to reach a node, None if the device's EDS does not say."""
        try:
            index, _ = device.dictionary.address(CHANNEL_NAME.format(node))
        except DictionaryError:
            return None
        return cls(*(device.number((index, subindex)) for subindex in (1, 2, 3)))

    def ask(self) -> Frame:
        """Return the request for the revision number."""
        (request,) = upload(REVISION, inf).start(0.0)
        return Frame(self.request, request)

    def order(self, dictionary: Dictionary, name: str, value: int) -> Frame:
        """Return the request that writes a number of up to 4 bytes to an object; raises DictionaryError."""
        address = dictionary.address(name)
        variable = dictionary.variable(address)
        assert variable is not None  # it has an address
        # Least significant byte first, as CiA 301 transfers numbers; up to four bytes fit an expedited transfer.
        content = value.to_bytes((len(variable) + 7) // 8, "little")
        (request,) = download(address, content, inf).start(0.0)
        return Frame(self.request, request)


def revision_in(answer: Frame) -> int | None:
    """Return the revision number in an answer, None if it says something else."""
    # Only one answer is awaited and only the question is sent, so the transfer needs no time and goes no further: a
    # node that would send its number in segments, or an odd answer, has not told its revision.
    question = upload(REVISION, inf)
    question.start(0.0)
    question.receive(answer.data, 0.0)
    try:
        return int.from_bytes(question.result(), "little") if question.done else None
    except TransferError:
        return None


# The startup


NODE_CHECKS: tuple[tuple[str, Message, type[Message]], ...] = (
    ("drive", messages.CheckDriveRequest(), messages.CheckDriveResponse),
    ("navigation", messages.CheckNaviRequest(), messages.CheckNaviResponse),
)
"""The nodes in the order in which they are checked (2014 robot: drive first)."""

CONFIGURED = ("Team colour", "Enemies", "Confederates", "Enemy 1 diameter", "Enemy 2 diameter")
"""The sub-indices of the object `Start configuration`, in the order of the message's fields."""


class Readiness:
    """What has to be there before the first goto: both nodes checked, a start configuration confirmed.

    `checked` has the nodes that have answered in the dialect of this core, and have neither booted nor been lost since.
    `configured` tells whether the latest start configuration was confirmed.
    """

    def __init__(self) -> None:
        self.checked: set[str] = set()
        self.configured = False

    def missing(self, without: Collection[str] = ()) -> str:
        """Say what is missing and what to call, '' if nothing is; nodes to do `without` need no check."""
        unchecked = [f"the {node}" for node, *_ in NODE_CHECKS if node not in {*self.checked, *without}]
        texts = [f"{' and '.join(unchecked)} must answer a check: call check_nodes()"] if unchecked else []
        texts += [] if self.configured else ["a start configuration must be confirmed: call configure_start()"]
        return "; ".join(texts)


def check_nodes(core: CoreSettings, checked: set[str], without: Collection[str] = ()) -> Script[dict[str, float]]:
    """Check both nodes; return the seconds that each took to answer. Raises NoAnswer, DialectMismatch.

    `checked` is filled with the nodes that have answered in the dialect of this core. Nodes to do `without` are not
    checked.
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
    with suppress(NoAnswer):  # the 2014 robot's own nodes do not have SDO
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
    """Set the start configuration, and check both nodes again; return the time of its confirm.

    Raises NoAnswer, DialectMismatch.
    """
    yield START
    # Until the confirm, nobody knows which configuration the nodes use.
    readiness.configured = False
    yield Ask(
        configuration,
        messages.StartConfigurationConfirm,
        core.configuration_wait,
        core.configuration_transmissions,
    )
    confirmed = core.now
    # One confirm may be anybody's, and two equal ones merge on the wire, so both nodes are asked once more.
    yield from check_nodes(core, readiness.checked, without)
    readiness.configured = True
    return confirmed


def take_back(core: CoreSettings, configuration: messages.StartConfigurationSet, checked: set[str]) -> Script[None]:
    """Ask a lost navigation until it answers, and configure it, while the drive keeps driving.

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

    A Start Configuration Set would take the drive's estimate back to its start place, so each sub-index is written by
    SDO; a navigation without SDO does without.
    """
    channel = SdoClientParameter.to("navigation", core.device)
    if channel is not None:
        with suppress(NoAnswer, DictionaryError):  # no SDO, or a file that has the configuration in other pieces
            for name, value in zip(CONFIGURED, configuration):
                order = channel.order(core.device.dictionary, f"Start configuration.{name}", int(value))
                yield Ask(order, channel.answer, core.identity_wait, 1)
