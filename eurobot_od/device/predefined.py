"""The pre-defined connection set: identifiers that a device has where its file gives none (CiA 301, 7.3.3)."""

from __future__ import annotations

from collections.abc import Mapping

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.sdo_channel import SdoChannel
from eurobot_od.od.standard import EMCY, IDENTITY, SDO_ANSWERS, SDO_REQUESTS, SYNC, TIME
from eurobot_od.od.values import (
    COB_ID,
    DEFAULT_PDO_BASES,
    EMCY_BASE,
    SYNC_COB_ID,
    TIME_COB_ID,
    Address,
)

BROADCASTS: Mapping[Address, int] = {SYNC: SYNC_COB_ID, TIME: TIME_COB_ID}

BASES: Mapping[Address, int] = {
    EMCY: EMCY_BASE,
    **{
        (direction.value + number, COB_ID): base
        for direction, bases in DEFAULT_PDO_BASES.items()
        for number, base in enumerate(bases)
    },
}
"""What the node-ID is added to."""


def predefined(dictionary: Dictionary) -> dict[Address, int]:
    """Return the values of the objects that a file has and gives none: identifiers, and who the device is."""
    identifiers = {**BROADCASTS, **{address: base + dictionary.node_id for address, base in BASES.items()}}
    # Only where the file is silent: an identifier that it gives counts, also one that is not valid.
    silent = (each for each in identifiers if each[1] in dictionary.members.get(each[0], ()))
    identity = {(IDENTITY, sub): number for sub, number in enumerate(dictionary.identity, start=1) if number}
    given = {address: identifiers[address] for address in silent if dictionary.default(address) is None}
    # Where the server is counts here, also where the file's own identifiers are not followed.
    server = zip((SDO_REQUESTS, SDO_ANSWERS), SdoChannel.of(dictionary), strict=True)
    return identity | given | {address: cob_id for address, cob_id in server if dictionary.variable(address)}
