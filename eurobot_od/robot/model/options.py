"""What a match is played with, and how far the instruments of a simulated robot are from perfect."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od import plugin
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.model.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.robot.model.facts import Facts


@dataclass(frozen=True)
class Errors:
    """What is wrong with the instruments of a simulated robot.

    Rates are shares 0..1 of all measurements. The noise of the beacons is none of them: it is a setting of the
    navigation (0x2101), by the document's Table 2.
    """

    wheel_scale: float = 0.01
    """Share by which the wheels' distance is off throughout a match, standard deviation."""
    wheel_turn: float = 0.004
    """Share by which the wheels' turning is off throughout a match, standard deviation."""
    wheel_noise: float = 3.0
    """Random error of the distance over one metre, standard deviation in mm; it grows with the root of the way."""
    heading_noise: float = 0.3
    """Random error of the heading over one metre or 90 degrees, standard deviation in degrees."""
    wheel_slip: float = 0.05
    """Share of the commanded way that the encoders still count when something blocks the robot."""
    beacon_latency: float = 0.02
    """Seconds by which a position of the beacons is old."""
    beacon_dropouts: float = 0.02
    """Rate of positions that the beacons do not see: "unknown" on the bus."""
    beacon_outliers: float = 0.01
    """Rate of positions that are somewhere else on the field."""
    beacon_swaps: float = 0.005
    """Rate of positions that are those of another robot."""
    sensor_range: float = 700.0
    """How far the distance sensor sees, mm from the robot's edge to the other's."""
    sensor_angle: float = 35.0
    """How far to either side the distance sensor sees, degrees."""
    sensor_noise: float = 3.0
    """Standard deviation of the measured distance, mm."""
    sensor_false: float = 0.0005
    """Rate of measurements that see something where nothing is."""
    sensor_missed: float = 0.02
    """Rate of measurements that see nothing where something is."""

    def changed_by(self, values: Iterable[tuple[str, str]]) -> Errors:
        """Return a copy with some errors changed, each by its name and value in text; see `changed`."""
        errors = self
        for name, text in values:
            errors = errors.changed(name, text)
        return errors

    def changed(self, name: str, text: str) -> Errors:
        """Return a copy with one error changed; raises UnknownName, LocalError for anything but a number from 0 on."""
        names = [each.name for each in fields(self)]
        if name not in names:
            raise UnknownName("error of the world", name, names)
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        # Written so that "nan" fails it as well: no comparison with it is true.
        if not 0.0 <= value < float("inf"):
            raise LocalError(f"{name}={text}: not a number from 0 on")
        return replace(self, **{name: value})


UNITS = {
    "wheel_noise": "mm over 1 m",
    "heading_noise": "degrees over 1 m or 90 degrees",
    "beacon_latency": "s",
    "sensor_range": "mm",
    "sensor_angle": "degrees",
    "sensor_noise": "mm",
}
"""Units of the errors of the world; the others are shares or rates of 0..1."""

NOISE_ONLY = Errors(beacon_latency=0.0, beacon_dropouts=0.0, beacon_outliers=0.0, beacon_swaps=0.0, sensor_false=0.0)
"""A world whose beacons always answer and are only noisy, as on a test bench."""


@dataclass(frozen=True)
class MatchOptions:
    """A match: our colour, who else is there, the seed of all chance, and times in seconds.

    `emergency_at` is the match time at which the mushroom is hit, None for never. `duration` None takes the core's
    setting. `errors` are those of the instruments in the simulated world, `faults` the names of the faults that our
    nodes have. `settings` are values in place of the EDS files' for our nodes, and of the robot's file, as a person
    writes them: `("drive.Motion.Maximum speed", "600")`, `("body.radius", "250")`. `falling`: once in a match a thing
    falls over in front of our robot. With `solid` False robots drive through everything but the border and never
    stall, as on a test bench. `robot` is who plays,
    as `plugin.find` takes it.
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
        """Return the facts of the robot and its match: those beside the EDS files, with what the settings change.

        Raises UnknownName, FileError, LocalError.
        """
        return facts_for(plugin.find(self.robot).dialects.folder(self.dialect), self.settings)

    @property
    def of_nodes(self) -> tuple[tuple[str, str], ...]:
        """The settings of our nodes."""
        from eurobot_od.robot.model import robot_file

        return tuple(each for each in self.settings if not robot_file.is_fact(each[0]))


def facts_for(eds: Path, settings: Iterable[tuple[str, str]]) -> Facts:
    """Return the facts beside EDS files, with those of some settings that are facts; raises as `robot_file.read`."""
    from eurobot_od.robot.model import robot_file  # YAML, which `--help` does without

    return robot_file.read(robot_file.file_for(eds), [each for each in settings if robot_file.is_fact(each[0])])


def facts_given(settings: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Give settings that have to be facts; raises UnknownName for one that is not."""
    from eurobot_od.robot.model import robot_file

    for name, value in settings:
        if not robot_file.is_fact(name):
            raise UnknownName("fact", name.partition(".")[0], robot_file.SECTIONS)
        yield name, value
