"""Decides whether a frame or a write may move something, for all ways in which the page sends.

Rule of this file: the answer is the reason, in words for the person who has to confirm; an empty text lets a frame or a
write pass. What cannot be known, such as the effect of a frame on a node without a file, counts as moving.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od import cia401
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import Pdo, unheard
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.values import (
    ALL_NODES,
    NMT_COB_ID,
    NODE_IDS,
    SDO_REQUEST_BASE,
    SYNC_COB_ID,
    Address,
    PdoDirection,
    label,
)
from eurobot_od.od.words import profile_of
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import ClientCommand, Initiate
from eurobot_od.web.drives import axes_of, moves

MAKERS = range(0x2000, 0x6000)
"""Objects of the device's maker (CiA 301, 7.4.1)."""

RPDO_PARAMETERS = range(0x1400, 0x1800)
"""Communication and mapping of RPDOs: with another COB-ID a drive obeys other frames."""

PDO_COB_IDS = range(0x180, 0x580)
"""Default COB-IDs of PDOs (CiA 301, 7.3.3)."""

NMT_REASONS = {
    NmtCommand.START: "NMT start lets {} obey PDOs, with the targets that they have",
    NmtCommand.RESET_NODE: "a reset of {} ends what it is doing, and starts it anew",
    NmtCommand.RESET_COMMUNICATION: "a reset of the communication of {} ends its heartbeat watch, and starts it anew",
}


SYNC_REASON = "SYNC has {} obey the targets that it was sent"

NAMED = 4
"""Bytes of an SDO request that name its object."""


class MotionGuard:
    """Returns why frames and SDO writes may move something, by the mapping of the dictionaries.

    Without `makers`, manufacturer objects move only drives: a robot knows itself which of its messages move something.
    """

    def __init__(self, dictionaries: Iterable[Dictionary], makers: bool = True) -> None:
        self._dictionaries = {each.node_id: each for each in dictionaries}
        self._makers = makers
        self.drives = frozenset(each.node_id for each in self._dictionaries.values() if axes_of(each))
        self._modules = {at for at, each in self._dictionaries.items() if profile_of(each.objects) == cia401.PROFILE}
        self._servers = {SdoChannel.of(each).requests: node_id for node_id, each in self._dictionaries.items()}
        pdos = [(node_id, pdo) for node_id, each in self._dictionaries.items() for pdo in _pdos(each)]
        self._described = {pdo.cob_id for _, pdo in pdos}
        self._received = defaultdict[int, dict[int, str]](dict)
        """Why a frame may move something, by its COB-ID and the node-ID of who receives it."""
        for node_id, pdo in pdos:
            reason = self._of_pdo(node_id, pdo) if pdo.direction is PdoDirection.RPDO else ""
            if reason:
                self._received[pdo.cob_id].setdefault(node_id, reason)
            if reason and pdo.is_synchronous:
                self._received[SYNC_COB_ID][node_id] = SYNC_REASON.format(self._name(node_id))

    @property
    def guarded(self) -> frozenset[int]:
        """The node-IDs of the nodes whose RPDOs may move something, whatever they carry now."""
        return frozenset(self._dictionaries) if self._makers else self.drives

    def _name(self, node_id: int) -> str:
        if node_id == ALL_NODES:
            return "all nodes"
        return self._dictionaries[node_id].name if node_id in self._dictionaries else f"node {node_id}"

    def of_object(self, node_id: int, address: Address) -> str:
        """Return why a write to an object may move something, empty if it cannot."""
        where = f"{label(address)} of {self._name(node_id)}"
        if moves(address):
            return f"{where} commands a drive"
        is_unknown = self._makers and node_id not in self._dictionaries
        if is_output(address) and (is_unknown or node_id in self._modules):
            return f"{where} sets an output: what hangs on it no file says"
        if (is_unknown or node_id in self.drives) and address[0] in RPDO_PARAMETERS:
            return f"{where} has {'the drive' if node_id in self.drives else 'it'} obey other frames"
        if node_id in self.drives and address[0] in MAKERS:
            return f"{where} is an object of the drive's maker: what it moves no file says"
        if is_unknown and address[0] in MAKERS:
            return f"{where} is an object of a maker: what it moves no file says"
        return ""

    def _of_pdo(self, node_id: int, pdo: Pdo) -> str:
        """Return why an RPDO may move something by an object that it carries."""
        is_guarded = self._makers or node_id in self.drives
        if pdo.multiplex is not None and is_guarded:
            return f"each frame of {self._name(node_id)}.{pdo.name} names the object that it writes"
        carried = [each for each in pdo.mapping if not each.is_padding]
        for address in (each.address for each in carried):
            if moves(address):
                return f"it carries {label(address)} to {self._name(node_id)}, which commands a drive"
            if node_id in self._modules and is_output(address):
                return f"it carries {label(address)} to {self._name(node_id)}, which sets an output"
            if is_guarded and address[0] in MAKERS:
                return f"it carries {label(address)} of the maker of {self._name(node_id)}: what it moves no file says"
        if is_guarded and any(each.is_unknown for each in carried):
            return f"what it carries to {self._name(node_id)} now is not known"
        return ""

    def of_cob_id(self, cob_id: int) -> str:
        """Return why the frames of a PDO or of SYNC may move something."""
        if cob_id in PDO_COB_IDS and cob_id not in self._described:
            return f"no file says what a node does with {cob_id:03X}"
        return next(iter(self._received.get(cob_id, {}).values()), "")

    def of_nmt(self, command: int, node_id: int) -> str:
        """Return why an NMT command may move something."""
        reason = NMT_REASONS.get(NmtCommand(command)) if command in set(NmtCommand) else None
        return reason.format(self._name(node_id)) if reason else ""

    def of_frame(self, frame: Frame) -> str:
        """Return why a frame may move something."""
        cob_id, data = frame.cob_id, frame.data
        if cob_id == NMT_COB_ID:  # some nodes take a longer one, too
            return self.of_nmt(*data[:2]) if len(data) >= 2 else ""
        node_id = self._asked(cob_id)
        return self.of_cob_id(cob_id) if node_id is None else self._of_request(node_id, data)

    def drives_of(self, frame: Frame) -> frozenset[int]:
        """Return the node-IDs of the drives with a file that a frame may move."""
        node_id = self._asked(frame.cob_id)
        if node_id is not None:
            return self.drives & ({node_id} if self._of_request(node_id, frame.data) else set())
        return self.drives & self._received.get(frame.cob_id, {}).keys()

    def _asked(self, cob_id: int) -> int | None:
        """Return the node-ID of the SDO server that a frame asks, None for any other frame."""
        node_id = self._servers.get(cob_id, cob_id - SDO_REQUEST_BASE)
        return node_id if cob_id in self._servers or node_id in NODE_IDS else None

    def _of_request(self, node_id: int, data: bytes) -> str:
        command = data[0] >> 5 if data else -1
        # Some servers accept fewer than 8 bytes, too; 4 of them name the object.
        if len(data) >= NAMED and command in (ClientCommand.DOWNLOAD, ClientCommand.BLOCK_DOWNLOAD):
            return self.of_object(node_id, Initiate.of(data.ljust(wire.LENGTH, b"\0")).address)
        if command == ClientCommand.DOWNLOAD_SEGMENT:
            return f"it goes on with a write to {self._name(node_id)}, of an object that the frame does not name"
        return ""


def is_output(address: Address) -> bool:
    """Return whether a new value of an object may change an output of an I/O module (CiA 401-1)."""
    above = address[0] - cia401.FIRST
    return above >= 0 and cia401.FIRST + above % cia401.MODULE_STEP in cia401.OUTPUTS and address[1] > 0


def _pdos(dictionary: Dictionary) -> list[Pdo]:
    # A wrong PDO was reported when the file was read; no file then describes its frames.
    return [pdo for pdo in dictionary.read_pdos(dictionary.default, unheard) if pdo.valid]
