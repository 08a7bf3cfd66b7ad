"""The options of a match, and the errors of a simulated robot's instruments."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import NamedTuple

from eurobot_od import loading
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.support.connections import Address, parse


@dataclass(frozen=True)
class Errors:
    """Errors of a simulated robot's instruments.

    Rates are shares of all measurements, 0 to 1. The noise of the beacons is not here, but a setting of the navigation
    (0x2101), as in the document's Table 2.
    """

    wheel_scale: float = 0.01
    """Constant relative error of the wheels' distance in a match, standard deviation."""
    wheel_turn: float = 0.004
    """Constant relative error of the wheels' turning in a match, standard deviation."""
    wheel_noise: float = 3.0
    """Random error of the distance over 1 m, standard deviation in mm; it grows with the root of the distance."""
    heading_noise: float = 0.3
    """Random error of the heading over 1 m or 90 degrees, standard deviation in degrees."""
    wheel_slip: float = 0.05
    """Share of the commanded distance that the encoders count while the robot is blocked."""
    beacon_latency: float = 0.02
    """Age of a beacon position, in s."""
    beacon_dropouts: float = 0.02
    """Rate of missing beacon positions, sent as "unknown"."""
    beacon_outliers: float = 0.01
    """Rate of beacon positions somewhere else on the field."""
    beacon_swaps: float = 0.005
    """Rate of beacon positions of another robot."""
    sensor_range: float = 700.0
    """Range of the distance sensor, from edge to edge, in mm."""
    sensor_angle: float = 35.0
    """Angle of the distance sensor to either side, in degrees."""
    sensor_noise: float = 3.0
    """Standard deviation of the measured distance, in mm."""
    sensor_false: float = 0.0005
    """Rate of measurements with an obstacle that does not exist."""
    sensor_missed: float = 0.02
    """Rate of measurements that miss an obstacle."""

    def changed_by(self, values: Iterable[tuple[str, str]]) -> Errors:
        """Return a copy with some errors changed, each given by name and value as text.

        Raises UnknownName, and LocalError unless a value is a number of 0 or more; a share or rate is at most 1.
        """
        changes: dict[str, float] = {}
        for name, text in values:
            if name not in vars(self):
                raise UnknownName("error of the world", name, vars(self))
            try:
                changes[name] = float(text)
            except ValueError:
                changes[name] = -1.0
            is_share = name not in UNITS
            # Every comparison with "nan" is false, so this fails for it.
            if not 0.0 <= changes[name] < inf or (is_share and changes[name] > 1):
                allowed = "0..1, as a share of all" if is_share else f"a number from 0 on, in {UNITS[name]}"
                raise LocalError(f"{name}={text} is not allowed; allowed: {allowed}")
        return replace(self, **changes)


UNITS = {
    "wheel_noise": "mm over 1 m",
    "heading_noise": "degrees over 1 m or 90 degrees",
    "beacon_latency": "s",
    "sensor_range": "mm",
    "sensor_angle": "degrees",
    "sensor_noise": "mm",
}
"""Units of the errors; all others are shares or rates of 0..1."""

NOISE_ONLY = Errors(beacon_latency=0.0, beacon_dropouts=0.0, beacon_outliers=0.0, beacon_swaps=0.0, sensor_false=0.0)
"""A world whose beacons always answer and are only noisy, as on a test bench."""


class WorldAddress(NamedTuple):
    """Address and token of a world; `str()` leaves out the token, which requests from other machines need."""

    address: Address
    token: str = ""

    def __str__(self) -> str:
        return str(self.address)

    @classmethod
    def parse(cls, text: str) -> WorldAddress:
        """Parse [TOKEN@]HOST:PORT; raises LocalError."""
        token, _, address = text.rpartition("@")
        return cls(parse(address), token)


@dataclass(frozen=True)
class MatchOptions:
    """The options of a match; times are in s.

    `seed` is that of all random numbers. `duration` None takes the core's setting. `emergency_at` is the match time at
    which the mushroom is hit, None for never. `errors` are those of the simulated instruments, `faults` the names of
    our nodes' faults. `settings` replace values of our nodes' EDS files and of the robot's file, as text:
    `("drive.Motion.Maximum speed", "600")`, `("body.radius", "250")`. With `falling`, one thing per match falls over in
    front of our robot. If `solid` is False, robots drive through everything but the border and never stall, as on a
    test bench. `robot` is the robot that plays, as for `loading.find`.
    """

    team: TeamColour = TeamColour.RED
    enemies: int = 2
    confederates: int = 1
    seed: int = 1
    duration: float | None = None
    emergency_at: float | None = None
    dialect: str | None = None
    errors: Errors = Errors()
    faults: tuple[str, ...] = ()
    falling: bool = True
    solid: bool = True
    settings: tuple[tuple[str, str], ...] = ()
    robot: str | None = None

    def facts(self) -> Facts:
        """Return the facts of the robot and its match, from the file beside the EDS files, changed by the settings.

        Raises UnknownName, FileError, LocalError.
        """
        return facts_for(loading.find(self.robot).dialects.folder(self.dialect), self.settings)

    @property
    def of_nodes(self) -> tuple[tuple[str, str], ...]:
        """The settings of our nodes."""
        return tuple(each for each in self.settings if not robot_file.is_fact(each[0]))


def facts_for(eds: Path, settings: Iterable[tuple[str, str]]) -> Facts:
    """Return the facts beside EDS files, changed by those settings that are facts; raises as `robot_file.read`."""
    return robot_file.read(robot_file.file_for(eds), [each for each in settings if robot_file.is_fact(each[0])])


def facts_given(settings: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Yield settings that must be facts; raises UnknownName for any other."""
    for name, value in settings:
        if not robot_file.is_fact(name):
            raise UnknownName("fact", name.partition(".")[0], robot_file.SECTIONS)
        yield name, value
