"""How often the robot sends each of its messages, by what its network file says."""

from __future__ import annotations

import pytest

from eurobot_od.cli.load import of_robot
from eurobot_od.od.values import BASE_IDENTIFIER
from eurobot_od.robot import dialects
from eurobot_od.robot.plugin import ROBOT
from eurobot_od.robot.protocol import EurobotProtocol
from tests.robot.document import NAMES


@pytest.mark.parametrize("dialect", dialects.names())
def test_every_message_of_the_robot_has_its_place_and_period(dialect: str) -> None:
    messages = of_robot(ROBOT, dialect)
    sent = {each.name for binding in EurobotProtocol.load(dialect).bindings for each in [binding]}
    named = {name for name in sent for each in messages.messages if each.name.startswith(name)}
    assert named == sent >= set(NAMES)
    assert all(each.reason for each in messages.messages)
    assert messages.mailboxes == dict.fromkeys(("core", "drive", "navigation"), 3)
    assert messages.bit_rate == 500_000


def test_a_setting_of_the_eds_is_the_period() -> None:
    dictionaries = [each.configured({}) for each in dialects.load_all()]
    core = next(each for each in dictionaries if each.name == "core")
    period = core.number(core.address("Position polling.Polling period")) or 0
    polled = [each for each in of_robot(ROBOT).messages if each.name == "Enemy 1 Position Request"]
    assert [each.period for each in polled] == [1000 * period]
    assert all(each.identifier <= BASE_IDENTIFIER for each in polled)
