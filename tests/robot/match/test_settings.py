"""Settings of a match stand in the nodes in place of the EDS files', and nowhere else."""

from __future__ import annotations

import pytest

from eurobot_od.errors import FieldError, LocalError, UnknownName
from eurobot_od.robot.match.stage import EdsFiles, cast_for, stores
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.world import World

FILES = EdsFiles.read(MatchOptions())


def value(setting: str, *settings: tuple[str, str]) -> float:
    """Return a setting of the node that has it, in a match with some settings."""
    options = MatchOptions(settings=settings)
    nodes = {node.name: node for node in cast_for(options, FILES, World(options, lambda: 0.0))[1]}
    name, _, thing = setting.partition(".")
    return nodes[name].setting(thing)


@pytest.mark.parametrize(
    ("setting", "given"),
    [
        ("drive.Motion.Maximum speed", ("drive.Motion.Maximum speed", "600")),
        ("drive.Motion.Maximum speed", ("drive.motion.maximum SPEED", "0x258")),
        ("core.Match.Match duration", ("core.Match.Match duration", "60")),
        ("navigation.Noise.Position deviation", ("navigation.0x2101:1", "30")),
    ],
)
def test_a_given_setting_is_the_nodes_value(setting: str, given: tuple[str, str]) -> None:
    assert value(setting) != value(setting, given) == int(given[1], 0)


def test_the_last_of_two_counts() -> None:
    name = "drive.Motion.Maximum speed"
    assert value(name, (name, "600"), (name, "500")) == 500


@pytest.mark.parametrize(
    ("name", "text", "error", "complaint"),
    [
        ("rive.Motion.Maximum speed", "1", UnknownName, "did you mean drive.Motion.Maximum speed?"),
        ("Motion.maximum speed", "1", LocalError, "did you mean drive.Motion.Maximum speed?"),
        ("Maximum speed", "1", LocalError, "did you mean drive.Motion.Maximum speed?"),
        ("radius", "250", LocalError, "did you mean body.radius or"),
        ("bdy.radius", "250", UnknownName, "unknown setting 'bdy.radius'; did you mean body.radius"),
        ("velocity", "1", UnknownName, "are known, and none is like it; `show --objects` lists them"),
        ("drive.Motion.Speed", "1", UnknownName, "unknown object 'Motion.Speed'"),
        ("drive.Motion", "1", LocalError, "'Motion' is not one object but a record"),
        ("drive.Motion.Maximum speed", "fast", FieldError, "Motion.Maximum speed = 'fast' is not allowed"),
        ("drive.Motion.Maximum speed", "0", FieldError, "Motion.Maximum speed = 0 is not allowed; allowed: 1..65535"),
    ],
)
def test_a_wrong_setting_is_named(name: str, text: str, error: type[Exception], complaint: str) -> None:
    with pytest.raises(error) as raised:
        stores([(name, text)], FILES.dictionaries)
    assert complaint in str(raised.value)
