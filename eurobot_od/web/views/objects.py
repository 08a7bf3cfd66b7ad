"""Requests of the views Objects and Plots: a node's objects are listed, read, watched and written."""

from __future__ import annotations

import asyncio
from functools import partial
from math import isfinite
from typing import Any

from canopen.objectdictionary import ODVariable

from eurobot_od.client.configure import read_object, write_value
from eurobot_od.errors import EurobotError, LocalError
from eurobot_od.od import objects
from eurobot_od.od.values import DOMAIN, Value, label
from eurobot_od.od.words import with_words, words, written
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of
from eurobot_od.web.desk import Desk
from eurobot_od.web.session import MOST_POLLED, POLL_PERIOD, POLLED_FOR, PolledObject, Sample


def list_objects(desk: Desk, said: Arguments) -> list[dict[str, Any]]:
    """List the objects of a node's file."""
    known = desk.objects(desk.node(said).node_id)
    return [_described(thing) for thing in objects.all_objects(known)] if known is not None else []


def _described(thing: ODVariable) -> dict[str, Any]:
    """Return an object of a file as data."""
    address = objects.address_of(thing)
    type_ = objects.data_type(thing)
    limits = objects.limits(thing)
    known = {"object": label(address), "name": thing.qualname, "type": type_.name, "access": thing.access_type}
    is_limited = limits is not None and (thing.min, thing.max) != (None, None)  # not only those of the type
    low, high = limits if limits and is_limited else (None, None)
    default = "" if thing.default is None else objects.measured(thing, thing.default)
    use = {"long": type_ == DOMAIN, "plots": limits is not None}
    return known | {"low": low, "high": high, "default": default} | use


def read(desk: Desk, said: Arguments) -> dict[str, Any]:
    """Read an object of a node."""
    node, thing = desk.named_object(said)
    data = read_object(node, thing)
    value = objects.decode(thing, data)
    return {"value": _plain(value), "text": with_words(objects.shown(thing, data), words(thing, value))}


def _plain(value: Value) -> Any:
    """Return a value for JSON, which has neither bytes nor infinity."""
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value.hex(" ").upper() if isinstance(value, bytes) else value


async def write(desk: Desk, said: Arguments) -> str:
    """Write an object of a node; a value that its file does not allow is not sent."""
    node, thing = desk.named_object(said)
    value = objects.parse(thing, text_of(said, "value"))
    reason = desk.guard.of_object(node.node_id, objects.address_of(thing))
    desk.confirm(said, reason)
    axes = desk.axes_of({node.node_id} if reason else ())
    master = desk.orders if axes else desk.master
    write_it = partial(write_value, master.node(node.node_id), thing, value)
    if not axes:
        return str(await desk.ask(write_it, str(said.get("node"))))
    await desk.send_raw(said, axes, write_it)
    return written(thing, value)


# Polled objects


def watch(desk: Desk, said: Arguments) -> str:
    """Read an object repeatedly from now on, for plots; return its key in snapshots."""
    session = desk.session
    node, thing = desk.named_object(said)
    key = f"{text_of(said, 'node')} {label(objects.address_of(thing))}"
    if key not in session.polled and len(session.polled) >= MOST_POLLED:
        raise LocalError(f"{MOST_POLLED} objects are read again and again already: leave another one out first")
    each = session.polled.get(key) or PolledObject(text_of(said, "node"), node.node_id, thing)
    each.wanted_until = session.now + POLLED_FOR
    # A new dict, as `poll` may be iterating over the old one on another thread.
    session.polled = {**session.polled, key: each}
    return key


async def poll(desk: Desk) -> None:
    """Read the polled objects repeatedly, as long as a page wants them."""
    session = desk.session
    while True:
        session.polled = {key: each for key, each in session.polled.items() if each.wanted_until > session.now}
        asked = [] if desk.jobs.running else list(session.polled.values())
        for each in asked:
            async with desk.turns[each.node]:
                value, each.trouble = await asyncio.to_thread(_read_polled, desk, each)
            # The next turn: also for a browser that already has the present one.
            each.samples += [] if each.trouble else [Sample(session.turn + 1, session.now, value)]
        await asyncio.sleep(POLL_PERIOD)


def _read_polled(desk: Desk, each: PolledObject) -> tuple[Any, str]:
    try:
        data = read_object(desk.polling.node(each.node_id), each.thing)
        return _plain(objects.decode(each.thing, data)), ""
    except EurobotError as error:
        return None, str(error)


REQUESTS = {
    "objects": PageRequest(list_objects, Way.AT_ONCE),
    "read": PageRequest(read),
    "watch": PageRequest(watch, Way.AT_ONCE),
    "write": PageRequest(write, Way.ORDERS, acts=True),
}
