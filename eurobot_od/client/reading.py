"""Reads all objects of a node, to list them, to compare them, or to make a DCF of the node as it is.

After an object that a node refuses, the next one is read; no answer ends the reading.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.client.configure import is_parameter, read_object
from eurobot_od.client.description import device_name
from eurobot_od.client.master import Procedure, RemoteNode
from eurobot_od.errors import NodeRefused
from eurobot_od.od.dcf import Dcf, with_contents
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, all_objects, at, data_type, decode
from eurobot_od.od.values import DOMAIN, Address, Value
from eurobot_od.sdo.wire import AbortCode
from eurobot_od.support.texts import amount

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


class ObjectReading(NamedTuple):
    """The `value` of an object in a node, or the text of the `refusal`."""

    thing: ODVariable
    value: Value = None
    refusal: str = ""


def read_all(node: RemoteNode, things: Iterable[ODVariable]) -> Iterator[ObjectReading]:
    """Read objects one after the other. Raises NoAnswer, RemoteError, BusError."""
    for thing in things:
        try:
            yield ObjectReading(thing, decode(thing, read_object(node, thing)))
        except NodeRefused as error:
            yield ObjectReading(thing, refusal=error.reason)


@Procedure
async def read_bytes(node: RemoteNode, addresses: Iterable[Address]) -> dict[Address, bytes | int]:
    """Read objects as bytes; the value of one that is refused is its abort code. Raises as `read_all`.

    Once the node has said that an index does not exist, its other sub-indices are not asked for.
    """
    found: dict[Address, bytes | int] = {}
    missing: set[int] = set()
    for address in addresses:
        try:
            found[address] = AbortCode.NO_OBJECT if address[0] in missing else await node.upload.steps(address)
        except NodeRefused as error:
            found[address] = error.code
            missing |= {address[0]} if error.code == AbortCode.NO_OBJECT else set()
    return found


def readable(dictionary: Dictionary) -> Iterator[ODVariable]:
    """Yield the objects that can be read, except for files (DOMAIN)."""
    return (thing for thing in _readable(dictionary) if data_type(thing) != DOMAIN)


def parameters(dictionary: Dictionary) -> Iterator[ODVariable]:
    """Yield the objects of a node's configuration: those that can be read and written and are not process data."""
    for thing in _readable(dictionary):
        if is_parameter(thing) and not thing.pdo_mappable:
            yield thing


def _readable(dictionary: Dictionary) -> Iterator[ODVariable]:
    return (thing for thing in all_objects(dictionary.objects) if thing.readable)


def decoded(writes: Iterable[tuple[Address, bytes]], dictionary: Dictionary | None) -> Iterator[ObjectReading]:
    """Yield objects with the values that their bytes mean."""
    for address, data in writes:
        thing = at(address, dictionary.objects if dictionary else None)
        yield ObjectReading(thing, decode(thing, data))


def dcf_of_writes(
    dictionary: Dictionary, writes: Iterable[tuple[Address, bytes]], baudrate_kbit: int, stem: str
) -> Dcf:
    """Return a DCF with the values after all writes; raises UnknownName for an object that the EDS does not have."""
    return with_contents(dictionary, dict(writes), dictionary.node_id, dictionary.name, baudrate_kbit, stem)


def dcf_of_node(
    node: RemoteNode,
    dictionary: Dictionary,
    baudrate_kbit: int,
    stem: str,
    things: Iterable[ODVariable] | None = None,
) -> tuple[Dcf, list[ObjectReading]]:
    """Return the DCF of a node as it is, and the objects that are left out, with the reasons.

    `things` are the objects to read, by default all `parameters`. Left out are those that the node refuses to give, or
    gives with fewer bytes than their type has.
    """
    contents, left_out = dict[Address, bytes](), list[ObjectReading]()
    for thing in parameters(dictionary) if things is None else things:
        try:
            data = read_object(node, thing)
        except NodeRefused as error:
            left_out.append(ObjectReading(thing, refusal=error.reason))
            continue
        if len(data) < data_type(thing).size:
            left_out.append(
                ObjectReading(thing, refusal=f"{amount(len(data), 'byte')}, too few for {data_type(thing).name}")
            )
        else:
            contents[address_of(thing)] = data
    return with_contents(dictionary, contents, node.node_id, device_name(node), baudrate_kbit, stem), left_out
