"""Requests of the view Send, and STOP: messages and frames, once or in lists, and NMT commands."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from eurobot_od.check.sending import RunningList, read_list
from eurobot_od.device.nmt import COMMAND_NAMES, NmtCommand
from eurobot_od.errors import BusError, EurobotError, LocalError, NoAnswer, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ALL_NODES, NMT_COB_ID
from eurobot_od.pdo.binding import parse
from eurobot_od.pdo.kinds import Message, field_name
from eurobot_od.support.files import read_whole, write_whole
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of
from eurobot_od.web.desk import Desk, SentList
from eurobot_od.web.session import POLL_PERIOD
from eurobot_od.web.views import files

FOLDER = "sequences"
"""Where the lists are kept."""

MOST_RUNNING = 20
"""Most lists that are sent at once, and most that have ended and are still shown."""

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
    await desk.confirm_frames(said, frame)
    await _confirm_panels(desk, message)
    return frame


async def _confirm_panels(desk: Desk, message: Message | None) -> None:
    """Refuse a message that a panel objects to; raises LocalError."""
    if message is None:
        return
    # One after the other, as a panel may wait for the answer of a node.
    for panel in desk.session.panels:
        if objection := await asyncio.to_thread(panel.objection, message, desk):
            raise LocalError(objection)


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
    """Ask a node to send a message by writing its object; return whether it answers at all.

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
    """Send a frame as it is written: `185#0102`, or `705#R1` for a remote frame."""
    frame = Frame.parse(text_of(said, "frame"))
    await desk.confirm_frames(said, frame)
    return await _send_once(desk, said, frame)


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


# Lists: kept in the folder of the page, and sent until they are over, or nobody wants them any more


def lists(desk: Desk, _: Arguments) -> list[str]:
    """Return the names of the lists that are kept."""
    return sorted(each.stem for each in (desk.folder / FOLDER).glob("*.yaml"))


def kept_list(desk: Desk, said: Arguments) -> list[dict[str, Any]]:
    """Return the rows of a list that is kept, as texts; raises UnknownName, YamlError."""
    name = text_of(said, "name")
    file = look_up("list", name, {each: desk.folder / FOLDER / f"{each}.yaml" for each in lists(desk, said)})
    rows = read_list(read_whole(file).decode("utf-8", "replace"), file.name, desk.session.decoder.protocol)
    return [each.written.as_texts() for each in rows]


def keep_list(desk: Desk, said: Arguments) -> None:
    """Keep rows under a name, as a file that `send` takes, too; a list that is there is replaced."""
    rows = _text(said)
    read_list(rows, text_of(said, "name"), desk.session.decoder.protocol)
    write_whole(_file(desk, said), rows.encode())


def remove_list(desk: Desk, said: Arguments) -> None:
    """Remove a list that is kept, if there is one with the name."""
    _file(desk, said).unlink(missing_ok=True)


def _file(desk: Desk, said: Arguments) -> Path:
    name = text_of(said, "name")
    if not files.NAME.fullmatch(name):
        raise LocalError(f"{name[:60]!r}: a list has letters, digits, blanks and . - + ( ) in its name")
    folder = desk.folder / FOLDER
    folder.mkdir(exist_ok=True)
    return folder / f"{name}.yaml"


def _text(said: Arguments) -> str:
    """Return rows as YAML, one a line: what is wrong with a row is said with its number."""
    rows = said.get("rows")
    if not isinstance(rows, list) or not all(isinstance(each, dict) for each in rows):
        raise LocalError("rows are missing, or not objects")
    return "".join(f"- {json.dumps(each, ensure_ascii=False)}\n" for each in rows)


async def begin_list(desk: Desk, said: Arguments) -> None:
    """Send the rows of a list together, until they are over, or somebody ends it."""
    key = text_of(said, "key")
    title = text_of(said, "title")
    protocol = desk.session.decoder.protocol
    rows = read_list(_text(said), title, protocol)
    if key in desk.lists and not desk.lists[key].ended:
        raise LocalError(f"{title} is being sent already: end it first")
    if len(desk.running_lists) >= MOST_RUNNING:
        raise LocalError(f"{MOST_RUNNING} lists are being sent already: end another one first")
    frames = [each.thing.frame for each in rows]
    await desk.confirm_frames(said, *frames)
    for each in rows:
        await _confirm_panels(desk, each.thing.message)
    axes = desk.axes_of(frozenset().union(*map(desk.guard.drives_of, frames)))

    def begin() -> None:
        desk.lists[key] = SentList(title, RunningList(rows, protocol, desk.session.now), said["who"], axes)

    await desk.send_raw(said, axes, begin)
    desk.heard.set()


def end_list(desk: Desk, said: Arguments) -> None:
    """End a list."""
    if each := desk.lists.get(text_of(said, "key")):
        end(desk, each, "ended")


def end(desk: Desk, each: SentList, why: str) -> None:
    """End a list; what it moves is stopped, and does not go on to the last target."""
    if not each.ended:
        each.ended = why
        desk.drives.end_raw(each.axes, each.who)


def end_all(desk: Desk, why: str) -> None:
    """End all lists, and leave it to the caller to stop what they move."""
    for each in desk.running_lists:
        each.ended = why


def end_of(desk: Desk, who: object) -> None:
    """End the lists of somebody."""
    for each in desk.running_lists:
        if each.who is who:
            end(desk, each, "its page is gone")


async def send_lists(desk: Desk) -> None:
    """Send what is due of the lists; what can no longer be sent, and what no page wants, ends."""
    while True:
        desk.heard.clear()
        for each in desk.running_lists:
            if desk.drives.is_silent(each.who):
                end(desk, each, "its page is not heard")
            elif frames := each.running.due(desk.session.now):
                await asyncio.to_thread(_send_due, desk, each, frames)
            if each.running.is_over:
                end(desk, each, "all is sent")
        for key in [key for key, each in desk.lists.items() if each.ended][:-MOST_RUNNING]:
            del desk.lists[key]
        soonest = min((each.running.next for each in desk.running_lists), default=inf)
        with suppress(TimeoutError):
            await asyncio.wait_for(desk.heard.wait(), max(min(soonest - desk.session.now, POLL_PERIOD), 0.001))


def _send_due(desk: Desk, each: SentList, frames: Iterable[Frame]) -> None:
    """Send frames of a list, unless it has ended, or something has stopped what it moves."""
    try:
        for frame in frames:
            with desk.drives.raw_gate(each.axes, each.who):
                if each.ended:
                    return
                desk.send(frame)
    except EurobotError as error:
        end(desk, each, str(error))


# Stop


def stop(desk: Desk, _: Arguments) -> str:
    """Stop what can be stopped, past whatever is waiting; raises BusError while the bus is lost."""
    desk.stops += 1
    desk.jobs.end(is_stopped=True)
    end_all(desk, "STOP")
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
    "lists": PageRequest(lists, Way.AT_ONCE),
    "list": PageRequest(kept_list, Way.AT_ONCE),
    "keep list": PageRequest(keep_list, Way.AT_ONCE, acts=True),
    "remove list": PageRequest(remove_list, Way.AT_ONCE, acts=True),
    "begin list": PageRequest(begin_list, Way.ORDERS, acts=True),
    "end list": PageRequest(end_list, Way.AT_ONCE, acts=True),
}
