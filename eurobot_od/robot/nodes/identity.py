"""Which EDS another node is loaded from: its revision number, read by SDO (CiA 301, 7.2.4.3.3 and 7.5.2.19).

A node that does not answer is not a CANopen node, such as the 2014 robot's own; it cannot be asked and is
believed. One that answers with another revision speaks another dialect, and is not driven.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from eurobot_od.device.device import Device
from eurobot_od.errors import DictionaryError, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import REVISION
from eurobot_od.robot import dialects
from eurobot_od.sdo.client import TransferError, download, upload

CHANNEL_NAME = "SDO client parameter {}"
"""ParameterName of the record that says how to reach a node by SDO."""


class DialectMismatch(RemoteError):
    """A node is loaded from the EDS of another dialect than the core; `theirs` and `ours` are revision numbers.

    The dialects are named where the error is turned into text, not where it is raised: to find a name, EDS files are
    read, and the core runs on the thread that receives frames.
    """

    def __init__(self, node: str, node_id: int, theirs: int, ours: int) -> None:
        super().__init__(node, node_id, theirs, ours)
        self.node, self.node_id, self.theirs, self.ours = node, node_id, theirs, ours

    def __str__(self) -> str:
        theirs, ours = _eds(self.node, self.theirs), _eds("core", self.ours)
        what = f"{self.node} (node {self.node_id}) speaks another dialect"
        return f"{what}: it is loaded from {theirs}, the core from {ours}"


def _eds(node: str, revision: int) -> str:
    """Say in words what EDS has a revision number, by the dialect that has it."""
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
        """Return the way to a node, None if the device's EDS knows none."""
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
    # One answer is awaited and nothing but the question is sent, so the transfer needs no time and goes no further: a
    # node that would send its number in segments, or an odd answer, has not said what its revision is.
    question = upload(REVISION, inf)
    question.start(0.0)
    question.receive(answer.data, 0.0)
    try:
        return int.from_bytes(question.result(), "little") if question.done else None
    except TransferError:
        return None
