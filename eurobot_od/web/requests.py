"""What the page may ask for: each request is a row of a table, checked as the command line would check it.

Rule of this file: whatever comes from a browser is answered, and never raises. A request that acts on the bus, or on
this machine's disk, is done only if the server was started with control.
"""

from __future__ import annotations

import asyncio
import json
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Container, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from enum import Enum
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from canopen.objectdictionary import ObjectDictionary, ODVariable

from eurobot_od.client.configure import pdo_parameters, read_object
from eurobot_od.client.lifeline import OWN_ID
from eurobot_od.client.master import Master, RemoteNode
from eurobot_od.client.motion import GIVE_UP, AxisAddress
from eurobot_od.client.streams import read_history
from eurobot_od.device.nmt import COMMAND_NAMES, NmtCommand, NmtState
from eurobot_od.errors import BusError, DriveError, EurobotError, LocalError, NoAnswer, RemoteError, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import REVISION
from eurobot_od.od.values import (
    ALL_NODES,
    DOMAIN,
    ERROR_CONTROL_BASE,
    NMT_COB_ID,
    NODE_IDS,
    SDO_REQUEST_BASE,
    Value,
    label,
)
from eurobot_od.od.words import with_words, words
from eurobot_od.pdo.binding import parse
from eurobot_od.pdo.kinds import Message, field_name
from eurobot_od.web.drives import LOOK, SILENT, STALE, STOPS, Drives, MayMove, MotionThread, OrderMaster
from eurobot_od.web.guard import MotionGuard
from eurobot_od.web.session import MOST_POLLED, POLL_PERIOD, POLLED_FOR, PolledObject, Sample, Session

Arguments = Mapping[str, Any]
"""The fields of a request besides its name."""

SHORTEST, LONGEST = 5, 60_000
"""Periods of what is sent again and again, ms."""

MOST_CYCLIC = 20


class Leader(NamedTuple):
    """A node that sends a message for the page, and the index of the object that is written for it."""

    node: Dictionary
    index: int  # type: ignore[assignment]  # CANopen's term; nobody searches the tuple


@dataclass
class Cyclic:
    """What somebody has sent again and again: `period`, when it is `due` and `until` when, all in s.

    `axes` are those that it moves: they are stopped at its end.
    """

    frame: Frame
    who: object
    axes: Sequence[AxisAddress]
    period: float
    due: float
    until: float


COMMANDS = {COMMAND_NAMES[command]: command for command in NmtCommand}


class Requests:
    """Answers what browsers ask of a session; `control` tells whether they may act on the bus.

    `stop` is the message of the button Stop, empty for NMT stop of all nodes; recordings are written in `folder`.
    `own_id` is the node-ID of the heartbeat that drives watch.
    """

    def __init__(
        self, session: Session, folder: Path, control: bool = False, stop: str = "", own_id: int = OWN_ID
    ) -> None:
        self.session, self.folder, self.control, self.stop_message = session, folder, control, stop
        self.master, self._polling, orders = Master(session.tap), Master(session.polls), OrderMaster(session.orders)
        dictionaries = session.decoder.dictionaries
        self._masters = self.master, self._polling, orders
        self._cyclic: dict[str, Cyclic] = {}
        self.drives = Drives(orders, dictionaries, lambda: session.now, session.tap.send_frame, own_id)
        for each in dictionaries:
            self._follow(each)
        session.first, session.on_learned = self._hear, self._learn
        self._orders = orders
        self._guard = session.decoder, MotionGuard(dictionaries, makers=not session.panels)
        self._read_from: set[int] = set()
        """Nodes whose PDO parameters were read since they have started."""
        self._silent: set[int] = set()
        """Nodes that did not answer; they are asked again once they are heard."""
        # An SDO frame does not say which transfer it belongs to: two at once would take each other's answers.
        self._one_at_a_time, self._one_order = asyncio.Lock(), asyncio.Lock()
        self._turns: dict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        """Held while a node is asked, by its name: what is polled does not wait for questions to another node."""

    def _follow(self, device: Dictionary) -> None:
        for master in self._masters:
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
        return self.drives.hear(frame)

    async def answer(self, text: str, who: object = None) -> str:
        """Answer a request of somebody, both as JSON; `asks` in an answer is a question.

        A request that says `sure` and repeats the question as `confirmed` says yes to it.
        """
        number: Any = None
        try:
            said = json.loads(text)
            if not isinstance(said, dict):
                raise LocalError("a request is a JSON object")
            number, name = said.get("id"), str(said.get("do"))
            function, way, acts = look_up("request", name[:40], REQUESTS)
            if acts and not self.control:
                raise LocalError("this page is read-only: start the server with --control")
            done = partial(function, self, {**said, "who": who})
            if way is Way.AT_ONCE:
                return json.dumps({"re": number, "ok": done()})
            if way is Way.ORDERS:
                return json.dumps({"re": number, "ok": await done()})
            if way is Way.ASKS:
                return json.dumps({"re": number, "ok": await self._ask(done, str(said.get("node")))})
            return json.dumps({"re": number, "ok": await asyncio.to_thread(done)})
        except MayMove as question:
            return json.dumps({"re": number, "error": f"not sent: {question}", "asks": str(question)})
        except (ValueError, RecursionError):  # RecursionError: too many nested brackets
            return json.dumps({"re": number, "error": "a request is JSON"})
        except (EurobotError, OSError) as error:
            return json.dumps({"re": number, "error": str(error)})

    async def _ask(self, question: Callable[[], Any], node: str) -> Any:
        """Do something that talks to a node, one transfer after the other; orders and stops never wait for that."""
        async with self._one_at_a_time, self._turns[node]:
            return await asyncio.to_thread(question)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Send what ends motions while this goes on; at its end whatever we have ordered is halted first."""
        with MotionThread(self.drives):
            try:
                yield
            finally:
                self._cyclic.clear()
                self.drives.begin_end()
                while not self.drives.may_end:
                    await asyncio.sleep(LOOK)
                await asyncio.to_thread(self.drives.put_back)

    def left(self, who: object) -> None:
        """Stop what somebody has ordered who is gone, and end what is sent again and again for them."""
        for key in [key for key, each in self._cyclic.items() if each.who is who]:
            self._end_cycle(key)
        self.drives.left(who)

    async def poll(self) -> None:
        """Read the polled objects again and again, as long as a page wants them."""
        while True:
            now = self.session.now
            self.session.polled = {key: each for key, each in self.session.polled.items() if each.wanted_until > now}
            for each in self.session.polled.values():
                async with self._turns[each.node]:
                    value, each.trouble = await asyncio.to_thread(self._read_polled, each)
                # The next turn: also for a browser that already has the present one.
                each.samples += [] if each.trouble else [Sample(self.session.turn + 1, self.session.now, value)]
            await asyncio.sleep(POLL_PERIOD)

    def _read_polled(self, each: PolledObject) -> tuple[Any, str]:
        try:
            data = read_object(self._polling.node(each.node_id), each.thing)
            return _plain(objects.decode(each.thing, data)), ""
        except EurobotError as error:
            return None, str(error)

    # What requests name

    def _node(self, said: Arguments) -> RemoteNode:
        return self.master.node(self._node_id(_text(said, "node")))

    def _node_id(self, name: str) -> int:
        named = {each.name: each.node_id for each in self.session.decoder.dictionaries}
        # `node 5` is the page's name for a node that no file describes.
        number = int(name.removeprefix("node ")) if name.removeprefix("node ").isdecimal() else None
        if number in NODE_IDS:
            return int(name.removeprefix("node "))
        return look_up("node", name, named)

    def _objects(self, node_id: int) -> ObjectDictionary | None:
        return next((each.objects for each in self.session.decoder.dictionaries if each.node_id == node_id), None)

    def _object(self, said: Arguments) -> tuple[RemoteNode, ODVariable]:
        node = self._node(said)
        return node, objects.find_one(_text(said, "object"), self._objects(node.node_id))

    # Questions

    def list_objects(self, said: Arguments) -> list[dict[str, Any]]:
        """List the objects of a node's file."""
        known = self._objects(self._node(said).node_id)
        return [_described(thing) for thing in objects.all_objects(known)] if known is not None else []

    def read(self, said: Arguments) -> dict[str, Any]:
        """Read an object of a node."""
        node, thing = self._object(said)
        data = read_object(node, thing)
        value = objects.decode(thing, data)
        return {"value": _plain(value), "text": with_words(objects.shown(thing, data), words(thing, value))}

    def history(self, said: Arguments) -> list[str]:
        """Read the errors that a node remembers, newest first."""
        node = self._node(said)
        words = self.session.decoder.errors.of(node.node_id)
        return [f"0x{each.code:04X} {words(each.code)}" for each in read_history(node).entries]

    def diagnosis(self, _: Arguments) -> dict[str, Any]:
        """Say what is wrong on the bus so far."""
        return self.session.diagnosis.as_data(self.session.now)

    def watch(self, said: Arguments) -> str:
        """Read an object for a while from now on, for plots; returns its key in snapshots."""
        node, thing = self._object(said)
        key = f"{_text(said, 'node')} {label(objects.address_of(thing))}"
        if key not in self.session.polled and len(self.session.polled) >= MOST_POLLED:
            raise LocalError(f"{MOST_POLLED} objects are read again and again already: leave another one out first")
        each = self.session.polled.get(key) or PolledObject(_text(said, "node"), node.node_id, thing)
        each.wanted_until = self.session.now + POLLED_FOR
        # A new dict, as `poll` may be iterating over the old one on another thread.
        self.session.polled = {**self.session.polled, key: each}
        return key

    # What acts on the bus

    def _confirm(self, said: Arguments, reason: str) -> None:
        """Raise MayMove for what may move something, unless the person is sure."""
        if reason and said.get("sure") is not True:
            raise MayMove(reason)

    @property
    def guard(self) -> MotionGuard:
        """The guard by the PDO mapping that is in force, as far as the bus has shown it."""
        decoder = self.session.in_force
        if self._guard[0] is not decoder:
            self._guard = decoder, MotionGuard(decoder.dictionaries, makers=not self.session.panels)
        return self._guard[1]

    async def _confirm_frame(self, said: Arguments, frame: Frame) -> None:
        if said.get("sure") is not True:
            self._confirm(said, await self._why(frame))

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
                await asyncio.to_thread(pdo_parameters, self._orders.node(each.node_id), each)
        except RemoteError as error:
            self._silent.add(each.node_id)
            # Who was never heard is not there.
            is_there = self.drives.has_heard(each.node_id)
            return f"which frames {each.name} obeys now is not known: {error}" if is_there else ""
        self._read_from.add(each.node_id)
        return ""

    async def _message(self, said: Arguments) -> Frame:
        """Return the frame of a message, with its fields as a person writes them."""
        fields = said.get("fields", {})
        if not isinstance(fields, dict) or not all(isinstance(each, str) for each in fields.values()):
            raise LocalError("fields are texts by name")
        protocol = self.session.decoder.protocol
        binding = protocol.binding(_text(said, "message"))
        message = parse(binding, [f"{name}={value}" for name, value in fields.items()])
        frame = protocol.encode(message)
        await self._confirm_frame(said, frame)
        # One after the other, as a panel may wait for the answer of a node.
        for panel in self.session.panels:
            if objection := await asyncio.to_thread(panel.objection, message, self):
                raise LocalError(objection)
        return frame

    async def _frame(self, said: Arguments) -> Frame:
        """Return a frame as it is written: `185#0102`."""
        frame = Frame.parse(_text(said, "frame"))
        await self._confirm_frame(said, frame)
        return frame

    def _axes_of(self, node_ids: Container[int]) -> list[AxisAddress]:
        return [each for each in self.drives.axes if each.node_id in node_ids]

    async def send(self, said: Arguments) -> str:
        """Send a message, or have the node send it that alone may do so; return the frame."""
        frame = await self._message(said)
        leader = self._leader(_text(said, "message"))
        if leader and await self._ask(partial(self._order_from, leader, frame), leader.node.name):
            return f"{frame} by the {leader.node.name}"
        return await self._send_once(said, frame)

    def _leader(self, message: str) -> Leader | None:
        """Return the node to which the sending of a message is left, None if there is none that was heard."""
        names = {key: name for panel in self.session.panels for key, name in panel.orders.items()}
        senders = self.session.decoder.protocol.binding(message).senders
        for each in self.session.decoder.dictionaries:
            index = each.data_index(names.get(message, "")) if each.name in senders else None
            first = each.variable((index, 1)) if index else None
            if index and first is not None and first.writable and self.drives.has_heard(each.node_id):
                return Leader(each, index)
        return None

    def _order_from(self, leader: Leader, frame: Frame) -> bool:
        """Have a node send a message by writing its object; return whether it answers at all.

        Raises NodeRefused; NoAnswer if it answers no more in the middle: it may have the order, and must not get two.
        """
        _, raw = self.session.decoder.protocol.unpack(*frame)
        node = self.master.node(leader.node.node_id)
        answers = False
        for subindex, variable in leader.node.members[leader.index].items():
            if (field := field_name(variable.name)) in raw:
                try:
                    node.download((leader.index, subindex), objects.encode(variable, raw[field]), variable.qualname)
                except NoAnswer:
                    if answers:
                        raise
                    return False
                answers = True
        return answers

    async def send_frame(self, said: Arguments) -> str:
        """Send a frame."""
        return await self._send_once(said, await self._frame(said))

    async def _send_once(self, said: Arguments, frame: Frame) -> str:
        await self._send_raw(said, self._axes_of(self.guard.drives_of(frame)), partial(self._send_gated, frame))
        return str(frame)

    def _send_gated(self, frame: Frame) -> None:
        """Send a frame unless the order that it is was stopped."""
        with self.drives.gate():
            self._send(frame)

    async def _send_raw(self, said: Arguments, axes: Sequence[AxisAddress], send: Callable[[], object]) -> None:
        """Send something; what moves axes waits for the orders before it, and is one."""
        if axes:
            order = partial(self.drives.send_raw, axes, send, said["who"], confirmed=said.get("confirmed"))
            await self._in_turn(axes, order)
        else:
            await asyncio.to_thread(send)

    async def cycle(self, said: Arguments) -> None:
        """Send a frame or a message again and again, for as long as the page says so: then it is asked `again`."""
        period = _whole(said, "period")
        if not SHORTEST <= period <= LONGEST:
            raise LocalError(f"a period of {period} ms is not allowed; allowed: {SHORTEST}..{LONGEST} ms")
        key = _text(said, "key")
        if said.get("again"):
            if key not in self._cyclic:
                raise LocalError("it is no longer sent again and again")
            self._cyclic[key].until = self.session.now + SILENT
            return
        if key in self._cyclic:
            raise LocalError(f"{key} is sent again and again already: end it first")
        if len(self._cyclic) >= MOST_CYCLIC:
            raise LocalError(f"{MOST_CYCLIC} frames are sent again and again already: end another one first")
        frame = await (self._message(said) if "message" in said else self._frame(said))
        axes = self._axes_of(self.guard.drives_of(frame))
        await self._send_raw(said, axes, partial(self._send_gated, frame))  # what is wrong with it is said at once
        now = self.session.now
        self._cyclic[key] = Cyclic(frame, said["who"], axes, period / 1000, now + period / 1000, now + SILENT)

    def end_cycle(self, said: Arguments) -> None:
        """End that."""
        self._end_cycle(_text(said, "key"))

    def _end_cycle(self, key: str) -> None:
        """End what is sent again and again; what it moves is stopped, and does not go on to the last target."""
        if each := self._cyclic.pop(key, None):
            self.drives.end_raw(each.axes, each.who)

    async def send_cyclic(self) -> None:
        """Send what is to be sent again and again; what can no longer be sent, and what no page wants, ends."""
        while True:
            now = self.session.now
            for key, each in list(self._cyclic.items()):
                # Whoever has stopped an axis has stopped all that moves it.
                if each.until < now or not self.drives.is_raw(each.axes, each.who):
                    self._end_cycle(key)
                elif each.due <= now:
                    try:
                        await asyncio.to_thread(self._send, each.frame)
                    except EurobotError:
                        self._end_cycle(key)
                    # Not from `now`: a period that is late once would be late for ever.
                    each.due = max(each.due + each.period, self.session.now)
            soonest = min((each.due for each in self._cyclic.values()), default=now + POLL_PERIOD)
            await asyncio.sleep(max(min(soonest - self.session.now, POLL_PERIOD), 0.001))

    def send_message(self, message: Message) -> None:
        """Send a message; raises BusError."""
        self._send(self.session.decoder.protocol.encode(message))

    def is_as_in_its_file(self, node: str) -> bool:
        """Tell whether a node has the revision number of its EDS; one that does not answer SDO is trusted."""
        dictionary = next(each for each in self.session.decoder.dictionaries if each.name == node)
        try:
            theirs = self.master.node(self._node_id(node)).upload(REVISION)
        except RemoteError:
            return True
        return int.from_bytes(theirs, "little") == dictionary.default(REVISION)

    def _send(self, frame: Frame) -> str:
        self.session.tap.send_frame(frame)
        return str(frame)

    def nmt(self, said: Arguments) -> str:
        """Send an NMT command to a node, or to all."""
        command, node = _text(said, "command"), _text(said, "node")
        known = look_up("NMT command", command, COMMANDS)
        node_id = ALL_NODES if node == "all" else self._node_id(node)
        self._confirm(said, self.guard.of_nmt(known, node_id))
        return self._send_nmt(known, node_id)

    def _send_nmt(self, command: NmtCommand, node_id: int) -> str:
        return self._send(Frame(NMT_COB_ID, bytes([command, node_id])))

    def stop(self, _: Arguments) -> str:
        """Stop what can be stopped, past whatever is waiting; raises BusError while the bus is lost."""
        self._cyclic.clear()
        done = self.drives.stop_all() if self.drives.axes or not self.stop_message else ""
        done = "; ".join(filter(None, [self._stop_plan() if self.stop_message else "", done]))
        if self.session.tap.trouble:
            raise BusError(f"STOP cannot be sent: {self.session.tap.trouble}")
        return done

    def _stop_plan(self) -> str:
        """Stop a robot by its message, and whoever carries out a plan by NMT; return what is sent."""
        protocol = self.session.decoder.protocol
        stop = protocol.encode(parse(protocol.binding(self.stop_message), []))
        plans = [protocol.binding(panel.plan) for panel in self.session.panels if panel.plan]
        leaders = list(dict.fromkeys(node for plan in plans for node in plan.senders))
        # PRE-OPERATIONAL and not STOPPED: a node does not send a plan's messages there either, but still answers SDO.
        held = [Frame(NMT_COB_ID, bytes([NmtCommand.ENTER_PRE_OPERATIONAL, self._node_id(node)])) for node in leaders]
        # Once more: what such a node had in its mailbox when it heard the command goes out after the first stop.
        self.drives.post([stop, *held, *([stop] if held else [])])
        return f"{', '.join(leaders)} held until NMT start or reset; {stop}" if leaders else str(stop)

    async def write(self, said: Arguments) -> None:
        """Write an object of a node; a value that its file does not allow is not sent."""
        node, thing = self._object(said)
        address = objects.address_of(thing)
        value = objects.parse(thing, _text(said, "value"))
        reason = self.guard.of_object(node.node_id, address)
        self._confirm(said, reason)
        if not objects.is_described(thing):
            raise LocalError(f"{label(address)} is not in an EDS, so its length is unknown")
        axes = self._axes_of({node.node_id} if reason else ())
        master = self._orders if axes else self.master
        content = objects.encode(thing, value)
        write = partial(master.node(node.node_id).download, address, content, thing.qualname)
        if axes:
            await self._send_raw(said, axes, write)
        else:
            await self._ask(write, str(said.get("node")))

    # Drives of CiA 402

    def _axis(self, said: Arguments) -> AxisAddress:
        return self.drives.axis(self._node_id(_text(said, "node")), said.get("axis"))

    async def drive(self, said: Arguments) -> str | None:
        """Have a drive carry out a command; of a stop it waits until the axis stands."""
        numbers = {name: _whole(said, name) for name in ("position", "distance", "velocity", "method") if name in said}
        command, axis = _text(said, "command"), self._axis(said)
        if command in STOPS:
            return await self._stop_axis(axis, command)
        missing = {"move": "position", "move by": "distance"}.get(command)
        if missing and missing not in numbers:
            raise LocalError(f"{missing} is missing")
        await self._order(said, axis, partial(self.drives.command, axis, command, numbers, said["who"]))
        return None

    async def _stop_axis(self, axis: AxisAddress, command: str) -> str:
        self.drives.stop(axis, STOPS[command])
        begun = self.session.now
        while (stop := self.drives.stopping(axis)) is not None and self.session.now < begun + GIVE_UP:
            await asyncio.sleep(LOOK)
        if stop is not None:
            raise DriveError(f"{command}: not known to stand: {stop.text(self.session.now)}")
        return f"{command}: it stands"

    async def _order(self, said: Arguments, axis: AxisAddress, order: Callable[..., None]) -> None:
        """Carry out an order in its turn; one that comes too late, or that a stop has overtaken, is refused."""
        seen = said.get("seen")
        if isinstance(seen, (int, float)) and self.session.now - seen > STALE:
            raise LocalError(f"the page was {self.session.now - seen:.1f} s behind the bus: not carried out")
        await self._in_turn([axis], order)

    async def _in_turn(self, axes: Sequence[AxisAddress], order: Callable[..., None]) -> None:
        ticket, asked = self.drives.ticket(*axes), self.session.now
        async with self._one_order:
            if self.session.now - asked > STALE:
                raise LocalError(f"other orders took {self.session.now - asked:.1f} s: not carried out")
            await asyncio.to_thread(order, ticket=ticket)

    async def jog(self, said: Arguments) -> None:
        """Turn a drive for as long as the page reports the button as held."""
        target, axis = "torque" if "torque" in said else "velocity", self._axis(said)
        value = _whole(said, target)
        self.drives.hold(axis, said["who"])
        await self._order(said, axis, partial(self.drives.jog, axis, value, target, said["who"]))

    def hold(self, said: Arguments) -> None:
        """Report a motion as still wanted: the button of a jog is held, the page of a move is seen."""
        self.drives.hold(self._axis(said), said["who"])

    def hidden(self, said: Arguments) -> None:
        """Stop the drives that a page moves, in whatever way: nobody looks at it any more."""
        self.drives.left(said["who"])

    def accept(self, said: Arguments) -> None:
        """Accept that a drive goes on if this program fails."""
        self.drives.accept(self._axis(said).node_id)

    # Recording

    def record(self, _: Arguments) -> None:
        """Begin to record."""
        self.session.recording.start(self.folder)

    def stop_recording(self, _: Arguments) -> None:
        """End the recording."""
        self.session.recording.stop()


class Way(Enum):
    """How a request is done."""

    AT_ONCE = "in the session's own thread"
    SENDS = "beside all others: it waits for the driver at most"
    ORDERS = "in its own turn: what moves drives after all other orders to them, and past all questions"
    ASKS = "after all others that ask: a node has to answer"


class PageRequest(NamedTuple):
    """The function of a request, how it is done, and whether it acts on bus or disk, which takes control."""

    function: Callable[[Requests, Arguments], Any]
    way: Way = Way.ASKS
    acts: bool = False


REQUESTS: Mapping[str, PageRequest] = {
    "record": PageRequest(Requests.record, Way.AT_ONCE, acts=True),
    "stop recording": PageRequest(Requests.stop_recording, Way.AT_ONCE, acts=True),
    "objects": PageRequest(Requests.list_objects),
    "read": PageRequest(Requests.read),
    "history": PageRequest(Requests.history),
    "watch": PageRequest(Requests.watch),
    "diagnosis": PageRequest(Requests.diagnosis, Way.AT_ONCE),
    "send": PageRequest(Requests.send, Way.ORDERS, acts=True),
    "nmt": PageRequest(Requests.nmt, Way.SENDS, acts=True),
    "stop": PageRequest(Requests.stop, Way.AT_ONCE, acts=True),
    "send frame": PageRequest(Requests.send_frame, Way.ORDERS, acts=True),
    "cycle": PageRequest(Requests.cycle, Way.ORDERS, acts=True),
    "end cycle": PageRequest(Requests.end_cycle, Way.AT_ONCE, acts=True),
    "write": PageRequest(Requests.write, Way.ORDERS, acts=True),
    "drive": PageRequest(Requests.drive, Way.ORDERS, acts=True),
    "jog": PageRequest(Requests.jog, Way.ORDERS, acts=True),
    "accept": PageRequest(Requests.accept, Way.AT_ONCE, acts=True),
    "hidden": PageRequest(Requests.hidden, Way.AT_ONCE, acts=True),
    "hold": PageRequest(Requests.hold, Way.AT_ONCE, acts=True),
}


def _described(thing: ODVariable) -> dict[str, Any]:
    """Return what a file says of an object, as data."""
    address, type_, limits = objects.address_of(thing), objects.data_type(thing), objects.limits(thing)
    known = {"object": label(address), "name": thing.qualname, "type": type_.name, "access": thing.access_type}
    is_limited = limits is not None and (thing.min, thing.max) != (None, None)  # those of the type tell nothing new
    low, high = limits if limits and is_limited else (None, None)
    default = "" if thing.default is None else objects.measured(thing, thing.default)
    use = {"long": type_ == DOMAIN, "plots": limits is not None}
    return known | {"low": low, "high": high, "default": default} | use


def _text(said: Arguments, name: str) -> str:
    value = said.get(name)
    if not isinstance(value, str):
        raise LocalError(f"{name} is missing, or not a text")
    return value


def _whole(said: Arguments, name: str) -> int:
    value = said.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise LocalError(f"{name} is missing, or not a whole number")
    return value


def _plain(value: Value) -> Any:
    """Return a value for JSON, which has neither bytes nor infinity."""
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value.hex(" ").upper() if isinstance(value, bytes) else value
