"""Reads all objects of a node: for a listing of them, and for a DCF of the node as it is.

Rule of this file: a node that refuses one object is asked for the next; one that does not answer ends the reading.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from canopen.objectdictionary import datatypes

from eurobot_od.client.configure import is_parameter
from eurobot_od.client.description import Description, device_name
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.objects import Object, all_objects, decode
from eurobot_od.errors import NodeRefused
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Value


class Reading(NamedTuple):
    """An object's `value` in a node, or why there is none: the text of the refusal."""

    thing: Object
    value: Value = None
    refusal: str = ""


def read_all(node: RemoteNode, things: Iterable[Object]) -> Iterator[Reading]:
    """Read objects one after the other. Raises NoAnswer, RemoteError, BusError."""
    for thing in things:
        try:
            yield Reading(thing, decode(thing, node.upload(thing.address, thing.name)))
        except NodeRefused as error:
            yield Reading(thing, refusal=error.reason)


def readable(dictionary: Dictionary) -> Iterator[Object]:
    """Give the objects that can be read, files (DOMAIN) not among them."""
    for thing in all_objects(dictionary):
        if thing.variable is not None and thing.variable.readable and thing.variable.data_type != datatypes.DOMAIN:
            yield thing


def parameters(dictionary: Dictionary) -> Iterator[Object]:
    """Give the objects that are a node's configuration: what can be read and written and is no process data."""
    for thing in readable(dictionary):
        if is_parameter(thing) and thing.variable is not None and not thing.variable.pdo_mappable:
            yield thing


def dcf_text(node: RemoteNode, description: Description, baudrate_kbit: int) -> tuple[str, list[Reading]]:
    """Return the DCF of a node as it is, and the objects of its EDS that it refused to tell, left out of the DCF."""
    readings = list(read_all(node, parameters(description.dictionary)))
    values = {each.thing.address: each.value for each in readings}
    text = dcf.with_values(description.text, values, node.node_id, device_name(node), baudrate_kbit)
    return text, [each for each in readings if each.refusal]
