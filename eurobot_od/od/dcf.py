"""A device's DCF: its EDS with the values it is configured for, and which device it is (CiA 306-1, 4.6 and 5)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from eurobot_od.errors import UnknownName
from eurobot_od.od.description import COMMISSIONING as COMMISSIONING
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.document import Document, parse
from eurobot_od.od.keys import OBJECT_LISTS
from eurobot_od.od.values import Address, Value, label, parse_number
from eurobot_od.od.writing import Rewriting

NOT_SAID = {"NetNumber": 0, "NetworkName": "", "CANopenManager": 0, "LSS_SerialNumber": ""}
"""The other keys of the commissioning, with the values they have where nobody knows better."""

COB_ID_DIGITS = 8
"""Hexadecimal digits of a value whose default is `$NODEID+...`: COB-IDs are UNSIGNED32."""


def with_values(
    eds_text: str, values: Mapping[Address, Value], node_id: int, node_name: str, baudrate_kbit: int
) -> str:
    """Return the DCF of a device: its EDS (or DCF), the ParameterValue of each address in `values`, and who it is.

    Numbers are written in the form of the object's DefaultValue, bytes in hexadecimal digits; None changes nothing.
    The commissioning stands last, so that a file that was cut off has none. Lines end in LF.
    Raises UnknownName for an address that the EDS does not describe.
    """
    device = DescribedDevice(parse(eds_text))
    rewriting = Rewriting(device.document)
    for (index, subindex), value in values.items():
        if value is not None:
            variable = device.objects[index].subs.get(subindex) if index in device.objects else None
            if variable is None:
                raise UnknownName("object", label((index, subindex)))
            form = variable.section.text("defaultvalue").lower()
            rewriting.set(variable.section, "ParameterValue", _written(value, form))
    info = device.section("fileinfo")
    if info and not info.text("lasteds"):
        eds = info.text("filename")
        rewriting.set(info, "LastEDS", eds)
        rewriting.set(info, "FileName", f"{eds.rpartition('.')[0]}.dcf")
    if device.commissioning:
        rewriting.drop(device.commissioning)
    own = {"NodeID": node_id, "NodeName": node_name, "Baudrate": baudrate_kbit}
    rewriting.append(COMMISSIONING, own | NOT_SAID)
    return rewriting.text()


def missing(text: str) -> list[str]:
    """Return the sections that an EDS or DCF announces and does not have: listed objects and counted sub-indices."""
    document = parse(text)
    members = Counter(name.partition("sub")[0] for name in document.sections if "sub" in name)
    wanted = [name for each in OBJECT_LISTS for name in _listed(document, each)]
    counts = [(name, parse_number(document.text(name.lower(), "subnumber"))) for name in wanted]
    return [
        *(name for name in wanted if name.lower() not in document.sections),
        *(f"{name}sub" for name, count in counts if count and members[name.lower()] < count.value),
    ]


def _listed(document: Document, name: str) -> Iterator[str]:
    """Give the names of the sections that a list of objects announces; the list itself where it is not there."""
    section = document.sections.get(name.lower())
    if section is None:
        yield name
        return
    for key, entry in section.entries.items():
        if key.isdecimal():
            yield entry.value.lower().removeprefix("0x").zfill(4).upper()


def _written(value: Value, like: str) -> str:
    if isinstance(value, bytes):
        return value.hex().upper()
    if not isinstance(value, int):
        return str(value)
    if value < 0 or not like.startswith(("0x", "$nodeid")):
        return str(int(value))
    width = len(like) - 2 if like.startswith("0x") else COB_ID_DIGITS
    return f"0x{value:0{width}X}"
