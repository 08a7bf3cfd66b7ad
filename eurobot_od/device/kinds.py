"""Which class simulates a device, by its profile."""

from __future__ import annotations

from collections.abc import Mapping

from eurobot_od.device.drive import SimulatedDrive
from eurobot_od.device.module import SimulatedModule
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.profiles import cia401, cia402
from eurobot_od.od.profiles.words import profile_of

KINDS: Mapping[int, type[SimulatedDevice]] = {cia401.PROFILE: SimulatedModule, cia402.PROFILE: SimulatedDrive}
"""The classes by the low word of 0x1000."""


def simulated_kind(dictionary: Dictionary, profile: int | None = None) -> type[SimulatedDevice]:
    """Return the class for a device of a `profile`, of the one that its 0x1000 says without it, 0 for none."""
    return KINDS.get(profile_of(dictionary.objects) if profile is None else profile, SimulatedDevice)
