"""Requests of the view Send, and STOP: messages and frames, once or with a period, and NMT commands."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import NamedTuple

from eurobot_od.device.nmt import COMMAND_NAMES, NmtCommand
from eurobot_od.errors import BusError, EurobotError, LocalError, NoAnswer, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ALL_NODES, NMT_COB_ID
from eurobot_od.pdo.binding import parse
from eurobot_od.pdo.kinds import field_name
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of, whole_of
from eurobot_od.web.desk import Cyclic, Desk
from eurobot_od.web.drives import SILENT
from eurobot_od.web.session import POLL_PERIOD

SHORTEST, LONGEST = 5, 60_000
"""Periods of what is sent again and again, ms."""

MOST_CYCLIC = 20

COMMANDS = {COMMAND_NAMES[command]: command for command in NmtCommand}


class Leader(NamedTuple):
    """A node that sends a message for the page, and the index of the object that is written for it."""

    node: Dictionary
    index: int  # type: ignore[assignment]  # CANopen's term; nobody searches the tuple


async def _message(desk: Desk, said: Arguments) -> Frame:
    """Return the frame of a message, with its fields as a person writes them."""
    fields = said.get("fields", {})
    if not isinstance(fields, dict) or not all(isinstance(each, str) for each in fields.values()):
        raise LocalError("fields are texts by name")
    protocol = desk.session.decoder.protocol
    binding = protocol.binding(text_of(said, "message"))
    message = parse(binding, [f"{name}={value}" for name, value in fields.items()])
    frame = protocol.encode(message)
    await desk.confirm_frame(said, frame)
    # One after the other, as a panel may wait for the answer of a node.
    for panel in desk.session.panels:
        if objection := await asyncio.to_thread(panel.objection, message, desk):
            raise LocalError(objection)
    return frame


async def _frame(desk: Desk, said: Arguments) -> Frame:
    """Return a frame as it is written: `185#0102`."""
    frame = Frame.parse(text_of(said, "frame"))
    await desk.confirm_frame(said, frame)
    return frame


async def send(desk: Desk, said: Arguments) -> str:
    """Send a message, or have the node send it that alone may do so; return the frame."""
    frame = await _message(desk, said)
    leader = _leader(desk, text_of(said, "message"))
    if leader and await desk.ask(partial(_order_from, desk, leader, frame), leader.node.name):
        return f"{frame} by the {leader.node.name}"
    return await _send_once(desk, said, frame)


def _leader(desk: Desk, message: str) -> Leader | None:
    """Return the node to which the sending of a message is left, None if there is none that was heard."""
    names = {key: name for panel in desk.session.panels for key, name in panel.orders.items()}
    senders = desk.session.decoder.protocol.binding(message).senders
    for each in desk.session.decoder.dictionaries:
        index = each.data_index(names.get(message, "")) if each.name in senders else None
        first = each.variable((index, 1)) if index else None
        if index and first is not None and first.writable and desk.drives.has_heard(each.node_id):
            return Leader(each, index)
    return None


def _order_from(desk: Desk, leader: Leader, frame: Frame) -> bool:
    """Have a node send a message by writing its object; return whether it answers at all.

    Raises NodeRefused; NoAnswer if it answers no more in the middle: it may have the order, and must not get two.
    """
    _, raw = desk.session.decoder.protocol.unpack(*frame)
    node = desk.master.node(leader.node.node_id)
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


async def send_frame(desk: Desk, said: Arguments) -> str:
    """Send a frame."""
    return await _send_once(desk, said, await _frame(desk, said))


async def _send_once(desk: Desk, said: Arguments, frame: Frame) -> str:
    await desk.send_raw(said, desk.axes_of(desk.guard.drives_of(frame)), partial(desk.send_gated, frame))
    return str(frame)


def nmt(desk: Desk, said: Arguments) -> str:
    """Send an NMT command to a node, or to all."""
    command, node = text_of(said, "command"), text_of(said, "node")
    known = look_up("NMT command", command, COMMANDS)
    desk.jobs.check_free()
    node_id = ALL_NODES if node == "all" else desk.node_id(node)
    desk.confirm(said, desk.guard.of_nmt(known, node_id))
    return desk.send(Frame(NMT_COB_ID, bytes([known, node_id])))


# With a period


async def cycle(desk: Desk, said: Arguments) -> None:
    """Send a frame or a message again and again, for as long as the page says so: then it is asked `again`."""
    period = whole_of(said, "period")
    if not SHORTEST <= period <= LONGEST:
        raise LocalError(f"a period of {period} ms is not allowed; allowed: {SHORTEST}..{LONGEST} ms")
    key = text_of(said, "key")
    if said.get("again"):
        if key not in desk.cyclic:
            raise LocalError("it is no longer sent again and again")
        desk.cyclic[key].until = desk.session.now + SILENT
        return
    if key in desk.cyclic:
        raise LocalError(f"{key} is sent again and again already: end it first")
    if len(desk.cyclic) >= MOST_CYCLIC:
        raise LocalError(f"{MOST_CYCLIC} frames are sent again and again already: end another one first")
    frame = await (_message(desk, said) if "message" in said else _frame(desk, said))
    axes = desk.axes_of(desk.guard.drives_of(frame))
    await desk.send_raw(said, axes, partial(desk.send_gated, frame))  # what is wrong with it is said at once
    now = desk.session.now
    desk.cyclic[key] = Cyclic(frame, said["who"], axes, period / 1000, now + period / 1000, now + SILENT)


def end_cycle(desk: Desk, said: Arguments) -> None:
    """End that."""
    end(desk, text_of(said, "key"))


def end(desk: Desk, key: str) -> None:
    """End what is sent again and again; what it moves is stopped, and does not go on to the last target."""
    if each := desk.cyclic.pop(key, None):
        desk.drives.end_raw(each.axes, each.who)


def end_of(desk: Desk, who: object) -> None:
    """End what is sent again and again for somebody."""
    for key in [key for key, each in desk.cyclic.items() if each.who is who]:
        end(desk, key)


async def send_cyclic(desk: Desk) -> None:
    """Send what is to be sent again and again; what can no longer be sent, and what no page wants, ends."""
    while True:
        now = desk.session.now
        for key, each in list(desk.cyclic.items()):
            # Whoever has stopped an axis has stopped all that moves it.
            if each.until < now or not desk.drives.is_raw(each.axes, each.who):
                end(desk, key)
            elif each.due <= now:
                try:
                    await asyncio.to_thread(desk.send, each.frame)
                except EurobotError:
                    end(desk, key)
                # Not from `now`: a period that is late once would be late for ever.
                each.due = max(each.due + each.period, desk.session.now)
        soonest = min((each.due for each in desk.cyclic.values()), default=now + POLL_PERIOD)
        await asyncio.sleep(max(min(soonest - desk.session.now, POLL_PERIOD), 0.001))


# Stop


def stop(desk: Desk, _: Arguments) -> str:
    """Stop what can be stopped, past whatever is waiting; raises BusError while the bus is lost."""
    desk.jobs.end(is_stopped=True)
    desk.cyclic.clear()
    done = desk.drives.stop_all() if desk.drives.axes or not desk.stop_message else ""
    done = "; ".join(filter(None, [_stop_plan(desk) if desk.stop_message else "", done]))
    if desk.session.tap.trouble:
        raise BusError(f"STOP cannot be sent: {desk.session.tap.trouble}")
    return done


def _stop_plan(desk: Desk) -> str:
    """Stop a robot by its message, and whoever carries out a plan by NMT; return what is sent."""
    protocol = desk.session.decoder.protocol
    stop = protocol.encode(parse(protocol.binding(desk.stop_message), []))
    plans = [protocol.binding(panel.plan) for panel in desk.session.panels if panel.plan]
    leaders = list(dict.fromkeys(node for plan in plans for node in plan.senders))
    # PRE-OPERATIONAL and not STOPPED: a node does not send a plan's messages there either, but still answers SDO.
    held = [Frame(NMT_COB_ID, bytes([NmtCommand.ENTER_PRE_OPERATIONAL, desk.node_id(node)])) for node in leaders]
    # Once more: what such a node had in its mailbox when it heard the command goes out after the first stop.
    desk.drives.post([stop, *held, *([stop] if held else [])])
    return f"{', '.join(leaders)} held until NMT start or reset; {stop}" if leaders else str(stop)


REQUESTS = {
    "send": PageRequest(send, Way.ORDERS, acts=True),
    "nmt": PageRequest(nmt, Way.SENDS, acts=True),
    "stop": PageRequest(stop, Way.AT_ONCE, acts=True),
    "send frame": PageRequest(send_frame, Way.ORDERS, acts=True),
    "cycle": PageRequest(cycle, Way.ORDERS, acts=True),
    "end cycle": PageRequest(end_cycle, Way.AT_ONCE, acts=True),
}
