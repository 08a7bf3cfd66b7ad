"""The SDO service of a running device: its server at its COB-IDs, and what answers it as a client (CiA 301, 7.2.4)."""

from __future__ import annotations

from collections.abc import Callable

from eurobot_od.device.nmt import NmtStates
from eurobot_od.device.objects import Objects
from eurobot_od.device.reaction import Ear, Reaction
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.sdo.server import SdoServer


class SdoService(SdoServer):
    """The SDO server of a device from one reset to the next; all times are in s.

    `requests` and `answers` are its COB-IDs; a master cannot change them (CiA 301, 7.5.2.33: ro). `settle` stores in
    the objects what PDOs have brought.
    """

    def __init__(self, objects: Objects, nmt: NmtStates, settle: Callable[[], None]) -> None:
        super().__init__(objects)
        self._objects, self._nmt, self._settle = objects, nmt, settle
        self.requests, self.answers = SdoChannel.of(objects.dictionary)

    @property
    def ears(self) -> dict[int | None, Ear]:
        """What it does with each COB-ID: requests, and what servers answer to this device as their client."""
        # Sub-index 2 of 0x1280 and following: where a server answers (7.5.2.34).
        clients = [index for index in standard.SDO_CLIENTS if index in self._objects.dictionary.members]
        answered: dict[int | None, Ear] = {self._objects.cob_id((index, 2)): _receive_answer for index in clients}
        return {**answered, self.requests: self._receive_request}

    def due(self, now: float) -> list[Frame]:
        """Return the abort of a transfer whose client has fallen silent."""
        return [Frame(self.answers, data) for data in self.tick(now)]

    def _receive_request(self, frame: Frame, now: float) -> Reaction:
        if not self._nmt.serves:
            return Reaction([])
        self._settle()  # first, so that a read gives the values of the latest PDO
        return Reaction([Frame(self.answers, data) for data in self.receive(frame.data, now)])


def _receive_answer(frame: Frame, _: float) -> Reaction:
    return Reaction([], answer=frame)
