"""What a device is: the identity object 0x1018 (CiA 301, 7.5.2.21)."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.od import standard
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import IDENTITY_KEYS, Dictionary
from eurobot_od.od.values import parse_number

MASK = 0xFFFFFFFF
"""The bits of one number of an identity."""


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
        """Return the identity that an EDS or DCF is for."""
        return cls(*dictionary.identity)

    @classmethod
    def described(cls, device: DescribedDevice) -> Identity:
        """Return the identity that a file describes, without loading it.

        Many files give 0x1018 no default, or 0, and say it in [DeviceInfo] only.
        """
        numbers = []
        for sub, key in enumerate(IDENTITY_KEYS, start=1):
            variable = device.variable(standard.IDENTITY, sub)
            said = (variable and variable.value, parse_number(device.document.text("deviceinfo", key)))
            known = (each.value & MASK for each in said if each and each.value)
            numbers.append(next(known, 0) if variable else 0)
        return cls(*numbers)

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
