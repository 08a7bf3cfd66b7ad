"""What CiA 301 and 302 say of the type and access of the communication profile's objects.

Rule of this file: data. Who checks a file compares it with this table; who reads a file that leaves a type out takes it
from here.
"""

from __future__ import annotations

from collections.abc import Container
from typing import NamedTuple

from eurobot_od.od import values
from eurobot_od.od.values import UNSIGNED8, UNSIGNED16, UNSIGNED32, VISIBLE_STRING, DataType

READ_ONLY = ("ro", "const")
DATA_SUBS = range(1, 255)


class Known(NamedTuple):
    """What the standard says of the variables at some indices and sub-indices; without `access` any is allowed."""

    indices: Container[int]
    subs: Container[int]
    type: DataType
    access: tuple[str, ...] = ()


KNOWN = (
    Known((0x1000, 0x1002), (0,), UNSIGNED32, READ_ONLY),
    Known((0x1001,), (0,), UNSIGNED8, READ_ONLY),
    Known((0x1003,), DATA_SUBS, UNSIGNED32, READ_ONLY),
    Known((0x1005, 0x1006, 0x1007, 0x1012, 0x1014, 0x1F80), (0,), UNSIGNED32),
    Known((0x1008, 0x1009, 0x100A), (0,), VISIBLE_STRING, READ_ONLY),
    Known((0x100C, 0x1015, 0x1017), (0,), UNSIGNED16),
    Known((0x100D, 0x1019), (0,), UNSIGNED8),
    Known((0x1010, 0x1011, 0x1016), DATA_SUBS, UNSIGNED32),
    Known((0x1018,), range(1, 5), UNSIGNED32, READ_ONLY),
    Known((0x1020, *range(0x1200, 0x1300)), (1, 2), UNSIGNED32),
    Known((0x1021,), (0,), values.DOMAIN, READ_ONLY),
    Known((0x1029,), DATA_SUBS, UNSIGNED8),
    *(
        Known(indices, (sub,), type_)
        for indices in values.COMMUNICATION_RECORDS.values()
        for sub, type_ in enumerate((UNSIGNED32, UNSIGNED8, UNSIGNED16, UNSIGNED8, UNSIGNED16, UNSIGNED8), start=1)
    ),
    *(Known(indices, DATA_SUBS, UNSIGNED32) for indices in values.MAPPING_RECORDS.values()),
)


def known_type(index: int, sub: int) -> DataType | None:
    """Return the type that the standard gives to a variable; None where it says nothing."""
    return next((each.type for each in KNOWN if index in each.indices and sub in each.subs), None)
