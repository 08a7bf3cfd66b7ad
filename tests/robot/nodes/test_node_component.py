"""A team's own node as a part of the start (document 5.1), and its loss in a match: an arm beside the three."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any, NamedTuple

import pytest

from eurobot_od import loading, messages
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.bound import BoundObject
from eurobot_od.device.node import Node
from eurobot_od.device.station import Station
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.make import read_table
from eurobot_od.od.make.text import make_files
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.nodes.core.settings import LEAVING
from eurobot_od.robot.nodes.node import Component, Loss
from tests.robot.nodes.harness import RED

TABLE = """
extends: eurobot2014
file: {author: we, comment: A table of tests.}
nodes:
  core: {watches: [drive, navigation, arm], asks: [drive, navigation, arm]}
  arm: {node_id: 4, product_name: Arm, product_number: 4, order_code: ARM, watches: [core], communication_error: 1,
    settings: {}}
messages:
  Start Configuration Set: {receivers: [drive, navigation, arm]}
  Arm Check: {identifier: 0x020, senders: [core], receivers: [arm]}
  Arm Here: {identifier: 0x024, senders: [arm], receivers: [core]}
  Arm Ready: {identifier: 0x028, senders: [arm], receivers: [core]}
traffic:
  Arm Check: {every: 1 s, reason: a check}
  Arm Here: {answers: Arm Check, jitter: 1 ms, reason: a check}
  Arm Ready: {answers: Start Configuration Set, jitter: 1 ms, reason: the start}
dialects:
  canopen: {revision_number: 0x00200000}
  firmware2014:
"""

CATALOGUE = messages.CATALOGUE.copy()


@CATALOGUE.message()
class ArmCheck(NamedTuple):
    """Is the arm there?"""


@CATALOGUE.message()
class ArmHere(NamedTuple):
    """It is."""


@CATALOGUE.message()
class ArmReady(NamedTuple):
    """It has taken over the start configuration."""


class Arm(Node):
    """An arm; `configured` are the start configurations that it has got, `confirms` whether it says so."""

    CATALOGUE = CATALOGUE
    confirms = True

    def reset(self) -> None:
        super().reset()
        self.configured: list[messages.StartConfigurationSet] = []

    def _configure(self, configuration: messages.StartConfigurationSet) -> ArmReady | None:
        self.configured.append(configuration)
        return ArmReady() if self.confirms else None

    OBJECTS = {"Start configuration": BoundObject(write=messages.StartConfigurationSet)}  # noqa: RUF012
    HANDLERS = {ArmCheck: lambda *_: ArmHere(), messages.StartConfigurationSet: _configure}  # noqa: RUF012


BY_MESSAGES = Component(ArmCheck(), ArmHere, ArmReady)
BY_SDO = Component()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Dictionary]:
    folder = tmp_path_factory.mktemp("eds")
    made = make_files(read_table(TABLE, "protocol.yaml", loading.table_of))
    for name, text in made.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return {
        name: Dictionary.load(folder / "canopen" / f"{name}.eds") for name in ("core", "drive", "navigation", "arm")
    }


class Robot:
    """The four nodes on a simulated bus, in which the arm is a `part`."""

    def __init__(self, files: dict[str, Dictionary], part: Component, arm: bool = True) -> None:
        own: dict[str, Any] = {"CATALOGUE": CATALOGUE, "COMPONENTS": {"arm": part}}
        self.core: Core = type("Core", (Core,), own)(files["core"])
        self.arm = Arm(files["arm"])
        self.network = Simulation()
        self.frames: list[Frame] = []
        self.network.observers.append(lambda _, frame: self.frames.append(frame))
        nodes = (self.core, Drive(files["drive"]), Navigation(files["navigation"]), *([self.arm] if arm else ()))
        self.stations: dict[str, Station] = {each.name: self.network.attach(each, 0.0) for each in nodes}
        self.run(1.0)  # heartbeats are heard

    def run(self, seconds: float) -> None:
        self.network.run(self.network.now + seconds)

    def start(self) -> tuple[Future[dict[str, float]], Future[float]]:
        checked = self.core.check_nodes()
        self.run(12.0)
        configured = self.core.configure_start(*RED)
        self.run(12.0)
        return checked, configured

    def lose_arm(self) -> None:
        self.network.detach(self.stations["arm"])
        self.run(3.0)


@pytest.mark.parametrize("part", [BY_MESSAGES, BY_SDO])
def test_a_node_that_is_part_of_the_start_is_checked(files: dict[str, Dictionary], part: Component) -> None:
    robot = Robot(files, part)
    checked, configured = robot.start()
    assert [*checked.result(0)] == ["drive", "navigation", "arm"]
    assert configured.result(0) < 0.1
    call = robot.core.goto(600, 1800, 0, 100)
    robot.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


@pytest.mark.parametrize("part", [BY_MESSAGES, BY_SDO])
def test_without_a_needed_node_nothing_is_driven(files: dict[str, Dictionary], part: Component) -> None:
    robot = Robot(files, part, arm=False)
    checked, configured = robot.start()
    assert isinstance(checked.exception(0), NoAnswer)
    assert isinstance(configured.exception(0), NoAnswer)
    with pytest.raises(StateError, match="the arm must answer a check"):
        robot.core.goto(600, 1800, 0, 100)


def test_a_confirm_that_is_lost_is_made_up_for_by_sdo_and_the_drive_is_configured_once(
    files: dict[str, Dictionary],
) -> None:
    robot = Robot(files, BY_MESSAGES)
    robot.arm.confirms = False
    _, configured = robot.start()
    assert configured.result(0) < 0.1
    assert robot.arm.configured == [RED, RED]
    assert len([each for each in robot.frames if each.cob_id == 0x2C0]) == 1


def test_a_node_that_does_not_take_the_start_configuration_blocks_the_start(files: dict[str, Dictionary]) -> None:
    robot = Robot(files, BY_MESSAGES)
    robot.core.check_nodes()
    robot.run(1.0)
    robot.network.detach(robot.stations["arm"])
    configured = robot.core.configure_start(*RED)
    robot.run(5.0)
    assert isinstance(configured.exception(0), NoAnswer)


def test_a_loss_that_stops_ends_the_goto_and_the_next_one_waits_for_the_node(files: dict[str, Dictionary]) -> None:
    robot = Robot(files, BY_MESSAGES)
    robot.start()
    robot.core.start_match(60.0)
    lost = robot.core.loss()
    call = robot.core.goto(2700, 1800, 0, 30)
    robot.run(0.5)
    robot.lose_arm()
    assert call.result(0).outcome is Outcome.LOST
    assert lost.result(0) == "arm"
    again = robot.core.goto(600, 1800, 0, 100)
    robot.run(12.0)
    assert isinstance(again.exception(0), NoAnswer)
    robot.arm.reset()
    robot.network.attach(robot.arm, robot.network.now)
    robot.run(1.0)
    back = robot.core.goto(600, 1800, 0, 100)
    robot.run(8.0)
    assert back.result(0).outcome is Outcome.ARRIVED
    assert robot.arm.configured == [RED]  # by SDO: the drive keeps its place


def test_a_loss_to_go_on_with_leaves_the_goto_alone_and_is_told(files: dict[str, Dictionary]) -> None:
    robot = Robot(files, BY_MESSAGES._replace(loss=Loss.GO_ON))
    robot.start()
    robot.core.start_match(60.0)
    lost = robot.core.loss()
    call = robot.core.goto(1500, 1800, 0, 40)
    robot.run(0.5)
    assert not lost.done()
    robot.lose_arm()
    assert lost.result(0) == "arm"
    assert robot.core.without == ("arm",)
    robot.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert len([each for each in map(str, robot.network.reports) if "the arm is lost" in each]) == 1
    assert robot.core.open_calls == 0
    robot.arm.reset()
    robot.network.attach(robot.arm, robot.network.now)
    robot.run(3.0)
    assert not robot.core.without
    assert robot.arm.configured == [RED]
    assert len([each for each in map(str, robot.network.reports) if "the arm answers again" in each]) == 1


def test_a_node_that_is_missing_at_the_end_of_the_match_has_to_be_checked_again(files: dict[str, Dictionary]) -> None:
    robot = Robot(files, BY_MESSAGES._replace(loss=Loss.GO_ON))
    robot.start()
    robot.core.start_match(5.0)
    robot.lose_arm()
    robot.run(5.0)
    assert not robot.core.without
    robot.core.start_match(5.0)
    with pytest.raises(StateError, match="the arm must answer a check"):
        robot.core.goto(600, 1800, 0, 100)


def test_waiting_for_a_loss_ends_when_the_core_is_switched_off(files: dict[str, Dictionary]) -> None:
    robot = Robot(files, BY_SDO)
    given_up, waiting = robot.core.loss(), robot.core.loss()
    assert given_up.cancel()
    robot.core.switched_off()
    assert str(waiting.exception(0)) == LEAVING


def test_a_node_that_the_core_cannot_ask_is_told(files: dict[str, Dictionary]) -> None:
    robot = Robot(files, BY_SDO)
    type(robot.core).COMPONENTS = {"crane": Component()}
    call = robot.core.check_nodes()
    robot.run(2.0)
    assert "name it in `asks` of the core" in str(call.exception(0))
