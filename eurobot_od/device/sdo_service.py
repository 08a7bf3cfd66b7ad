"""The SDO service of a running device: its server, and answers to it as a client (CiA 301, 7.2.4)."""

from __future__ import annotations

from collections.abc import Callable

from eurobot_od.device.nmt import NmtStates
from eurobot_od.device.objects import Objects
from eurobot_od.device.reaction import FrameHandler, Reaction
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.sdo.server import SdoServer


class SdoService(SdoServer):
    """The SDO server of a device from one reset to the next; all times are in s.

    `requests` and `answers` are its COB-IDs, which a master cannot change (CiA 301, 7.5.2.33: ro). `settle` stores the
    values of received PDOs in the objects.
    """

    def __init__(self, objects: Objects, nmt: NmtStates, settle: Callable[[], None]) -> None:
        super().__init__(objects)
        self._objects, self._nmt, self._settle = objects, nmt, settle
        self.requests, self.answers = SdoChannel.of(objects.dictionary)

    @property
    def handlers(self) -> dict[int | None, FrameHandler]:
        """Handlers by COB-ID: of requests, and of other servers' answers to this device."""
        # Sub-index 2 of 0x1280 and following is the COB-ID of a server's answers (7.5.2.34).
        clients = [index for index in standard.SDO_CLIENTS if index in self._objects.dictionary.members]
        answered: dict[int | None, FrameHandler] = {
            self._objects.cob_id((index, 2)): _receive_answer for index in clients
        }
        return {**answered, self.requests: self._receive_request}

    def due(self, now: float) -> list[Frame]:
        """Return the abort of a transfer after the client's time-out."""
        return [Frame(self.answers, data) for data in self.tick(now)]

    def _receive_request(self, frame: Frame, now: float) -> Reaction:
        if not self._nmt.serves:
            return Reaction([])
        self._settle()  # first, so that a read returns the values of the last PDO
        return Reaction([Frame(self.answers, data) for data in self.receive(frame.data, now)])


def _receive_answer(frame: Frame, _: float) -> Reaction:
    return Reaction([], answer=frame)
