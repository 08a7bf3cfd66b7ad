"""What the requests of all views share: the session, its masters, whose turn it is, and what may move something."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from canopen.objectdictionary import ObjectDictionary, ODVariable

from eurobot_od.check.sending import RunningList
from eurobot_od.check.shapes import Networks
from eurobot_od.client.configure import ChangePlan, pdo_parameters
from eurobot_od.client.description import Addressing
from eurobot_od.client.lifeline import OWN_ID
from eurobot_od.client.master import Master, RemoteNode
from eurobot_od.client.motion import AxisAddress
from eurobot_od.client.program import STANDARD, DownloadProcedure
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import LocalError, RemoteError, look_up
from eurobot_od.frame import Frame
from eurobot_od.library.library import Library
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import REVISION
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID, NODE_IDS, SDO_REQUEST_BASE
from eurobot_od.pdo.kinds import Message
from eurobot_od.web.asking import Arguments, text_of
from eurobot_od.web.drives import STALE, Drives, MayMove, OrderMaster
from eurobot_od.web.guard import MotionGuard
from eurobot_od.web.jobs import Job, Jobs
from eurobot_od.web.session import Session


@dataclass
class SentList:
    """A list that a browser has sent: `who` it is, the axes that it moves, and why it has `ended`.

    The axes are stopped at its end.
    """

    title: str
    running: RunningList
    who: object
    axes: Sequence[AxisAddress]
    ended: str = ""

    def data(self) -> dict[str, Any]:
        """Return what the page shows of it."""
        return {"title": self.title, "sent": self.running.sent, "ended": self.ended}


class Equipment(NamedTuple):
    """What whoever starts the page gives it: the user's `library` of device files, and what plug-ins know.

    `networks` are those that suites may be for. For reports, `made_by` is the program and its version, and `bus` is the
    bus in words.
    `procedure` returns how the device with an identity takes a program, and raises LocalError for one that it refuses;
    `address` its maker's procedure that sets its node-ID, None for LSS.
    """

    library: Library = Library(())
    networks: Networks = Networks(lambda _: Path())
    made_by: str = ""
    bus: str = ""
    procedure: Callable[[Sequence[int], bytes, bool], DownloadProcedure] = lambda *_: STANDARD
    address: Callable[[Identity], Addressing | None] = lambda _: None


NO_EQUIPMENT = Equipment()


class Desk:
    """What requests work with; `control` tells whether browsers may act on the bus.

    `stop_message` is the message of the button Stop, empty for NMT stop of all nodes; what is recorded lies in
    `folder`. `own_id` is the node-ID of the heartbeat that drives watch.
    """

    def __init__(
        self,
        session: Session,
        folder: Path,
        control: bool = False,
        stop: str = "",
        own_id: int = OWN_ID,
        equipment: Equipment = NO_EQUIPMENT,
    ) -> None:
        self.equipment = equipment
        self.session = session
        self.folder = folder
        self.control = control
        self.stop_message = stop
        self.master = Master(session.tap)
        self.polling = Master(session.polls)
        self.orders = OrderMaster(session.orders)
        dictionaries = session.decoder.dictionaries
        self.lists: dict[str, SentList] = {}
        """The lists that run, and those that have ended lately, by the keys that browsers have given them."""
        self.heard = asyncio.Event()
        """Set at each frame while lists run: one of them may wait for it."""
        self.stops = 0
        """How often STOP was asked for: what was asked for before the last one, and waits, is not sent."""
        self.previewed: ChangePlan | None = None
        """What the last comparison has shown: it may be applied."""
        self.uploads: dict[object, dict[str, bytearray]] = defaultdict(dict)
        """The files that each browser has sent, by name."""
        self.drives = Drives(self.orders, dictionaries, lambda: session.now, session.tap.send_frame, own_id)
        for each in dictionaries:
            self._follow(each)
        session.first, session.on_learned = self._hear, self._learn
        self._guard = session.decoder, MotionGuard(dictionaries, makers=not session.panels)
        self.jobs = Jobs(session, lambda frame: self.guard.of_frame(frame))
        self._read_from: set[int] = set()
        """Nodes whose PDO parameters were read since they have started."""
        self._silent: set[int] = set()
        """Nodes that did not answer; they are asked again once they are heard."""
        # An SDO frame does not say which transfer it belongs to: two at once would take each other's answers.
        self._one_at_a_time, self._one_order = asyncio.Lock(), asyncio.Lock()
        self.turns: dict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        """Held while a node is asked, by its name: what is polled does not wait for questions to another node."""

    def _follow(self, device: Dictionary) -> None:
        for master in (self.master, self.polling, self.orders):
            master.follow(device)

    def _learn(self, device: Dictionary) -> None:
        """Take in a device that has shown what it is."""
        self._follow(device)
        self.drives.add(device)

    def _hear(self, frame: Frame) -> bool:
        if ERROR_CONTROL_BASE < frame.cob_id <= ERROR_CONTROL_BASE + NODE_IDS[-1] and frame.data == bytes(
            [NmtState.INITIALISING]
        ):
            self._read_from.discard(frame.cob_id - ERROR_CONTROL_BASE)
        for each in self.running_lists:
            each.running.take(self.session.now, frame)
            self.heard.set()
        return self.drives.hear(frame)

    @property
    def running_lists(self) -> list[SentList]:
        """The lists that are being sent."""
        return [each for each in self.lists.values() if not each.ended]

    # What requests name

    def node_id(self, name: str) -> int:
        """Return the node-ID of a node by its name; raises UnknownName."""
        named = {each.name: each.node_id for each in self.session.decoder.dictionaries}
        # `node 5` is the page's name for a node that no file describes.
        number = int(name.removeprefix("node ")) if name.removeprefix("node ").isdecimal() else None
        if number is not None and number in NODE_IDS:
            return number
        return look_up("node", name, named)

    def node(self, said: Arguments) -> RemoteNode:
        """Return the node of a request; raises LocalError."""
        return self.master.node(self.node_id(text_of(said, "node")))

    def device(self, node_id: int) -> Dictionary | None:
        """Return what describes a node, None if nothing does."""
        return next((each for each in self.session.decoder.dictionaries if each.node_id == node_id), None)

    def objects(self, node_id: int) -> ObjectDictionary | None:
        """Return the objects of a node's file, None without one."""
        found = self.device(node_id)
        return found.objects if found else None

    def named_object(self, said: Arguments) -> tuple[RemoteNode, ODVariable]:
        """Return the node and the object of a request; raises LocalError."""
        node = self.node(said)
        return node, objects.find_one(text_of(said, "object"), self.objects(node.node_id))

    @property
    def library(self) -> Library:
        """The user's device files."""
        return self.equipment.library

    @property
    def reports(self) -> Path:
        """The folder of reports, which is there."""
        folder = self.folder / "reports"
        folder.mkdir(exist_ok=True)
        return folder

    # Whose turn it is

    async def ask(self, question: Callable[[], Any], node: str) -> Any:
        """Do something that talks to a node, one transfer after the other; orders and stops never wait for that.

        Raises LocalError while a job runs, as everything that asks or sends.
        """
        self.jobs.check_free()
        async with self._one_at_a_time, self.turns[node]:
            return await asyncio.to_thread(question)

    async def in_turn(self, axes: Sequence[AxisAddress], order: Callable[..., None]) -> None:
        """Carry out an order in its turn; one that comes too late, or that a stop has overtaken, is refused."""
        self.jobs.check_free()
        ticket = self.drives.ticket(*axes)
        asked = self.session.now
        async with self._one_order:
            if self.session.now - asked > STALE:
                raise LocalError(f"other orders took {self.session.now - asked:.1f} s: not carried out")
            await asyncio.to_thread(order, ticket=ticket)

    async def send_raw(self, said: Arguments, axes: Sequence[AxisAddress], send: Callable[[], object]) -> None:
        """Send something that was asked for since the last STOP; what moves axes waits for the orders before it."""
        self.jobs.check_free()
        if said.get("stops", self.stops) != self.stops:
            raise LocalError("it was stopped meanwhile: not carried out")
        if axes:
            order = partial(self.drives.send_raw, axes, send, said["who"], confirmed=said.get("confirmed"))
            await self.in_turn(axes, order)
        else:
            await asyncio.to_thread(send)

    def send(self, frame: Frame) -> str:
        """Send a frame, and return it as text; raises BusError."""
        self.session.tap.send_frame(frame)
        return str(frame)

    def start(self, name: str, title: str, work: Callable[[Job], Any]) -> int:
        """Start a job, and return its number; raises LocalError while another one runs, or a drive may move."""
        if self.drives.is_busy:
            raise LocalError(f"{title}: a drive moves by the page's order, or is being stopped: wait until it stands")
        if running := self.running_lists:
            raise LocalError(f"{title}: {running[0].title} is being sent: end it first")
        return self.jobs.start(name, title, work).number

    def send_gated(self, frame: Frame) -> None:
        """Send a frame unless the order that it is was stopped."""
        with self.drives.gate():
            self.send(frame)

    def axes_of(self, node_ids: Container[int]) -> list[AxisAddress]:
        """Return the axes of some nodes."""
        return [each for each in self.drives.axes if each.node_id in node_ids]

    # What may move something

    @property
    def guard(self) -> MotionGuard:
        """The guard by the PDO mapping that is in force, as far as the bus has shown it."""
        decoder = self.session.in_force
        if self._guard[0] is not decoder:
            self._guard = decoder, MotionGuard(decoder.dictionaries, makers=not self.session.panels)
        return self._guard[1]

    def confirm(self, said: Arguments, reason: str) -> None:
        """Refuse what may move something, unless the person is sure; raises MayMove."""
        if reason and said.get("sure") is not True:
            raise MayMove(reason)

    async def confirm_frames(self, said: Arguments, *frames: Frame) -> None:
        """Refuse frames that may move something, unless the person is sure; raises MayMove."""
        if said.get("sure") is not True:
            reasons = [await self._why(each) for each in frames]
            self.confirm(said, "; ".join(filter(None, dict.fromkeys(reasons))))

    async def _why(self, frame: Frame) -> str:
        """Return why a frame may move something: devices may have mapped their RPDOs anew before we heard them."""
        reason = self.guard.of_frame(frame)
        # An SDO request names its object, whatever is mapped.
        if reason or frame.cob_id == NMT_COB_ID or SDO_REQUEST_BASE < frame.cob_id <= SDO_REQUEST_BASE + NODE_IDS[-1]:
            return reason
        unread = [each for each in self.session.decoder.dictionaries if self._is_unread(each.node_id)]
        unknown = [await self._read_mapping(each) for each in unread]
        # Each answer was on the bus, and is part of what it has shown.
        return self.guard.of_frame(frame) or "; ".join(filter(None, unknown))

    def _is_unread(self, node_id: int) -> bool:
        is_there = node_id not in self._silent or self.drives.has_heard(node_id)
        return is_there and node_id in self.guard.guarded - self._read_from

    async def _read_mapping(self, each: Dictionary) -> str:
        """Read the PDO parameters of a node; return why what it obeys is not known."""
        try:
            async with self._one_order:
                await asyncio.to_thread(pdo_parameters, self.orders.node(each.node_id), each)
        except RemoteError as error:
            self._silent.add(each.node_id)
            # Who was never heard is not there.
            is_there = self.drives.has_heard(each.node_id)
            return f"which frames {each.name} obeys now is not known: {error}" if is_there else ""
        self._read_from.add(each.node_id)
        return ""

    # What a panel may do (`page.Control`)

    def send_message(self, message: Message) -> None:
        """Send a message; raises BusError."""
        self.send(self.session.decoder.protocol.encode(message))

    def is_as_in_its_file(self, node: str) -> bool:
        """Return whether a node has the revision number of its EDS; one that does not answer SDO is trusted."""
        dictionary = next(each for each in self.session.decoder.dictionaries if each.name == node)
        try:
            theirs = self.master.node(self.node_id(node)).upload(REVISION)
        except RemoteError:
            return True
        return int.from_bytes(theirs, "little") == dictionary.default(REVISION)
