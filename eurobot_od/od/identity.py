"""What a device is: the identity object 0x1018 (CiA 301, 7.5.2.21)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from eurobot_od.od import standard
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import parse_number

MASK = 0xFFFFFFFF
"""The bits of one number of an identity."""

KEYS = {1: "vendornumber", 2: "productnumber", 3: "revisionnumber", 4: ""}
"""Keys of [DeviceInfo] by the sub-indices of 0x1018; there is no key for the serial number."""


class Identity(NamedTuple):
    """The identity object 0x1018; 0 for a number that a device does not have (CiA 301, 7.5.2.21)."""

    vendor: int = 0
    product: int = 0
    revision: int = 0
    serial: int = 0

    def __str__(self) -> str:
        return ":".join(f"0x{number:08X}" for number in self)

    @classmethod
    def of(cls, dictionary: Dictionary) -> Identity:
        """Return the identity that a device has by its file, or by the values that it is `configured` with."""
        there = [sub for sub in KEYS if dictionary.variable((standard.IDENTITY, sub)) is not None]
        return cls._said(dictionary.device, {sub: dictionary.number((standard.IDENTITY, sub)) for sub in there})

    @classmethod
    def described(cls, device: DescribedDevice) -> Identity:
        """Return the identity that a file describes, without loading it."""
        there = [sub for sub in KEYS if device.variable(standard.IDENTITY, sub)]
        values = {sub: device.value(standard.IDENTITY, sub) for sub in there}
        return cls._said(device, {sub: each.value if each else None for sub, each in values.items()})

    @classmethod
    def _said(cls, device: DescribedDevice, numbers: Mapping[int, int | None]) -> Identity:
        """Return it from the numbers of the sub-indices that are there.

        Many files give 0x1018 no default, or 0, and say it in [DeviceInfo] only.
        """
        info = {sub: parse_number(device.document.text("deviceinfo", key)) for sub, key in KEYS.items()}
        said = {sub: number or (found.value if (found := info[sub]) else 0) for sub, number in numbers.items()}
        return cls(*(said.get(sub, 0) & MASK for sub in KEYS))

    def difference(self, other: Identity) -> str | None:
        """Return in what another device is of another kind than this one; None if it is of the same kind.

        The serial number tells devices of one kind apart. Only the upper half of the revision must agree: the lower
        half does not change the CANopen behaviour (CiA 301, 7.5.2.21).
        """
        pairs = {
            "vendor-ID": (self.vendor, other.vendor),
            "product code": (self.product, other.product),
            "major revision": (self.revision >> 16, other.revision >> 16),
        }
        return next((f"{name} 0x{b:X}, not 0x{a:X}" for name, (a, b) in pairs.items() if a != b), None)
