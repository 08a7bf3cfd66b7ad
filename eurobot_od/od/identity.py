"""The identity of a device, object 0x1018 (CiA 301, 7.5.2.21)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from eurobot_od.od import standard
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import parse_number

MASK = 0xFFFFFFFF
"""Mask of one number of an identity."""

KEYS = {1: "vendornumber", 2: "productnumber", 3: "revisionnumber", 4: ""}
"""Keys of [DeviceInfo] by sub-index of 0x1018; the serial number has none."""


class Identity(NamedTuple):
    """Identity object 0x1018; 0 for a missing number (CiA 301, 7.5.2.21)."""

    vendor: int = 0
    product: int = 0
    revision: int = 0
    serial: int = 0

    def __str__(self) -> str:
        return ":".join(f"0x{number:08X}" for number in self)

    @classmethod
    def of(cls, dictionary: Dictionary) -> Identity:
        """Return a device's identity, from its file or the values that it is `configured` with."""
        there = [sub for sub in KEYS if dictionary.variable((standard.IDENTITY, sub)) is not None]
        return cls._said(dictionary.device, {sub: dictionary.number((standard.IDENTITY, sub)) for sub in there})

    @classmethod
    def described(cls, device: DescribedDevice) -> Identity:
        """Return the identity in a file, without loading it."""
        there = [sub for sub in KEYS if device.variable(standard.IDENTITY, sub)]
        values = {sub: device.value(standard.IDENTITY, sub) for sub in there}
        return cls._said(device, {sub: each.value if each else None for sub, each in values.items()})

    @classmethod
    def _said(cls, device: DescribedDevice, numbers: Mapping[int, int | None]) -> Identity:
        """Return the identity for the numbers in 0x1018, by sub-index.

        Many files have no default in 0x1018, or 0, and the number only in [DeviceInfo].
        """
        info = {sub: parse_number(device.document.text("deviceinfo", key)) for sub, key in KEYS.items()}
        said = {sub: number or (found.value if (found := info[sub]) else 0) for sub, number in numbers.items()}
        return cls(*(said.get(sub, 0) & MASK for sub in KEYS))

    def difference(self, other: Identity) -> str | None:
        """Return how another device's type differs from this one's; None if the types are equal.

        The serial number is ignored. Only the upper half of the revision must agree, because the lower half does not
        change the CANopen behaviour (CiA 301, 7.5.2.21).
        """
        pairs = {
            "vendor-ID": (self.vendor, other.vendor),
            "product code": (self.product, other.product),
            "major revision": (self.revision >> 16, other.revision >> 16),
        }
        return next((f"{name} 0x{b:X}, not 0x{a:X}" for name, (a, b) in pairs.items() if a != b), None)


def contradiction(said: Identity, device: Identity) -> str | None:
    """Return in what a device is of another kind than a file says; what either does not say (0) is no difference."""
    pairs = [(mine or theirs, theirs or mine) for mine, theirs in zip(said, device)]
    return Identity(*(mine for mine, _ in pairs)).difference(Identity(*(theirs for _, theirs in pairs)))


def misfit(dictionary: Dictionary, identity: Identity, device_type: int | None = None) -> str:
    """Return in what a device that has shown its 0x1018, and its 0x1000, is another one than a file describes.

    What either does not say (0) is no difference. Empty if it is the same.
    """
    found = contradiction(Identity.of(dictionary), identity)
    type_ = dictionary.number(standard.DEVICE_TYPE)
    if not found and type_ and device_type and type_ != device_type:
        found = f"device type 0x{device_type:08X}, not 0x{type_:08X}"
    return found or ""


def stranger(dictionary: Dictionary, node_id: int, identity: Identity, device_type: int | None = None) -> str:
    """Return that a node is not the device of a file, and in what; empty if it is. See `misfit`."""
    different = misfit(dictionary, identity, device_type)
    return different and f"{dictionary.file} is for another device: node {node_id} has {different}"


def absence(expected: Iterable[int], heard: Iterable[int]) -> str:
    """Return which nodes are not on a bus although their files are named, and which other ones are.

    Empty if none is missing, or if no other node is there.
    """
    wanted, there = {*expected}, {*heard}
    missing, others = wanted - there, there - wanted
    if not missing or not others:
        return ""
    return f"{_nodes(others)} on this bus, {_nodes(missing)} not"


def _nodes(numbers: Iterable[int]) -> str:
    listed = sorted(numbers)
    return f"nodes {', '.join(map(str, listed))} are" if len(listed) > 1 else f"node {listed[0]} is"
