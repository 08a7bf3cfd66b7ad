"""The nodes' objects: an SDO, a TPDO and an answer say the same at any time, and a command written over SDO acts."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from typing import Any

import can
import canopen
import pytest

from eurobot_od.bus.live import Live
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.faults import Leaving
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import FieldError
from eurobot_od.frame import Frame
from eurobot_od.od.values import Address
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import (
    ConfederatePositionRequest,
    ConfederatePositionResponse,
    EmergencyShutdown,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    Enemy2PositionResponse,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    PositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.model.values import Obstacle, Outcome, RobotError, Source, TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.sdo.wire import AbortCode
from tests.device.master import NodeWire, with_sync
from tests.robot.nodes.harness import DICTIONARIES, RED, Peer, as_if_started

FACTS = robot_file.read()

DIALECTS = ["canopen", "firmware2014"]
GOTO = GotoXY(1500, 1000, 90, 100)


class Noisy:
    """Beacons that see everybody, each time at another place."""

    def __init__(self) -> None:
        self._chance = random.Random(1)

    def locate(self, _whom: Source, _now: float) -> Fix | None:
        return Fix(self._chance.uniform(0, 3000), self._chance.uniform(0, 2000), self._chance.uniform(0, 360))


class Master(NodeWire):
    """Stock canopen, wired to one node of the robot; `protocol` has the node's messages."""

    def __init__(self, role: str, dialect: str = "canopen") -> None:
        dictionary = dialects.load(role, dialect)
        self.protocol = EurobotProtocol.of(dictionary)
        super().__init__(ROLES[role](dictionary))
        if isinstance(self.node, Navigation):
            self.node.beacons = Noisy()

    def say(self, *messages: Message) -> list[Message]:
        """Send messages as PDOs, and return the messages that the node answers with."""
        return self._messages(frame for each in messages for frame in self.send(self.protocol.encode(each)).frames)

    def answers(self) -> list[Message]:
        """Return and forget the messages that the node has sent."""
        return self._messages(self.sent())

    def _messages(self, frames: Iterable[Frame]) -> list[Message]:
        known = {binding.cob_id for binding in self.protocol.bindings}
        return [self.protocol.decode(*frame) for frame in frames if frame.cob_id in known]

    def put(self, name: str, *values: int) -> None:
        """Write an object's values from sub-index 1 on."""
        index = self.index(name)
        for subindex, value in enumerate(values, 1):
            self.write(index, subindex, value, self.size((index, subindex)))

    def size(self, address: Address) -> int:
        variable = self.device.dictionary.variable(address)
        assert variable is not None
        return len(variable) // 8

    def values_of(self, name: str) -> list[int]:
        """Read all values of an object."""
        index = self.index(name)
        return [self.read(index, subindex) for subindex in range(1, self.read(index) + 1)]

    def index(self, name: str) -> int:
        index = self.device.dictionary.data_index(name)
        assert index is not None
        return index


# What is measured

MEASURED: list[tuple[str, str, Message, type[Message]]] = [
    ("drive", "Goto state", GotoStateRequest(), GotoStateResponse),
    ("drive", "Kalman position", KalmanPositionRequest(), KalmanPositionResponse),
    ("navigation", "Navi position", NaviPositionRequest(), NaviPositionResponse),
    ("navigation", "Enemy 1 position", Enemy1PositionRequest(), Enemy1PositionResponse),
    ("navigation", "Enemy 2 position", Enemy2PositionRequest(), Enemy2PositionResponse),
    ("navigation", "Confederate position", ConfederatePositionRequest(), ConfederatePositionResponse),
]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_how_well_the_drive_knows_its_place_is_read_over_sdo(dialect: str) -> None:
    master = Master("drive", dialect)
    assert master.values_of("Position deviation") == [0xFFFF] * 3  # without a place
    master.say(RED)
    assert master.values_of("Position deviation") == [10, 10, 20]  # as it is put down: mm, and 0.1 degrees
    master.say(NaviPositionResponse(200, 1800, 0, Source.INTERNAL))
    assert master.values_of("Position deviation") == [4, 4, 9]


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize(("role", "name", "request_", "response"), MEASURED)
def test_an_sdo_and_the_answer_to_a_request_agree_at_any_time(
    role: str, name: str, request_: Message, response: type[Message], dialect: str
) -> None:
    master = Master(role, dialect)
    master.say(RED, *([GOTO] if role == "drive" else []))
    seen = set()
    for _ in range(20):
        master.run(0.037)
        read = master.values_of(name)
        (frame,) = master.send(master.protocol.encode(request_)).frames
        assert frame.cob_id == master.protocol.cob_id(response)
        assert list(master.protocol.unpack(*frame)[1].values()) == read == master.values_of(name)
        seen.add(tuple(read))
    assert len(seen) == 20


@pytest.mark.parametrize(("role", "name"), [row[:2] for row in MEASURED])
def test_measured_objects_are_read_only(role: str, name: str) -> None:
    master = Master(role)
    index = master.index(name)
    assert master.refused((index, 1), 0, master.size((index, 1))) == AbortCode.READ_ONLY


def test_a_core_reads_what_it_sent_last() -> None:
    master = Master("core")
    master.node.offer(GOTO)
    assert master.values_of("Goto XY") == [1500, 1000, 90, 100, 0, 0]  # the last are the reserved bits
    assert master.refused((master.index("Emergency stop"), 1), 0, size=1) == AbortCode.READ_ONLY  # nobody orders it


# Commands

YELLOW, IN_RED, ENEMY, INTERNAL, CONFEDERATE, ENEMY_1 = 0, 1, 1, 0, 1, 2
"""Codes of the protocol table."""


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_robot_is_configured_driven_and_stopped_by_sdo_alone(dialect: str) -> None:
    master = Master("drive", dialect)
    drive = master.node
    assert isinstance(drive, Drive)
    master.put("Start configuration", IN_RED, 1, 0, 30, 0)
    assert drive.estimate.pose == FACTS.start(TeamColour.RED)
    master.put("Goto XY", 1500, 1000, 90, 100, 0, *([0, 1] if dialect == "firmware2014" else []))
    assert master.answers() == [StartConfigurationConfirm(), GotoConfirm()]
    master.run(1.0)
    assert drive.moving
    assert drive.goto == GOTO
    master.put("Emergency stop", ENEMY)
    master.run(1.0)
    assert not drive.moving
    assert drive.obstacle is Obstacle.ENEMY


def test_a_navigation_is_configured_by_sdo() -> None:
    master = Master("navigation")
    master.put("Start configuration", YELLOW, 0, 1, 0, 0)
    assert master.answers() == [StartConfigurationConfirm()]
    assert master.values_of("Enemy 1 position") == [0xFF, 0xFF, 0x3FF, ENEMY_1]
    assert master.values_of("Confederate position") != [0xFF, 0xFF, 0x3FF, CONFEDERATE]


def test_a_drive_takes_a_navigation_position_by_sdo() -> None:
    master = Master("drive")
    master.put("Navi position", 700, 800, 45, INTERNAL)
    assert master.values_of("Kalman position") == [700, 800, 45, INTERNAL]
    assert master.values_of("Navi position") == [700, 800, 45, INTERNAL]


def test_a_core_takes_what_is_written_as_if_it_had_come() -> None:
    master = Master("core")
    core = master.node
    assert isinstance(core, Core)
    sources: dict[str, tuple[type[PositionResponse], Source]] = {
        "Navi": (NaviPositionResponse, Source.INTERNAL),
        "Enemy 1": (Enemy1PositionResponse, Source.ENEMY_1),
    }
    for name, (response, source) in sources.items():
        master.put(f"{name} position", 700, 800, 45, [INTERNAL, CONFEDERATE, ENEMY_1][[*Source].index(source)])
        assert core.positions[response].position == response(700, 800, 45, source)
    as_if_started(core)
    # Nobody answers how well the place is known: that is waited for, but only once.
    for wait in (0.1, 0.0):
        call = core.goto(*GOTO)
        master.run(0.01)
        master.say(GotoConfirm())
        master.run(0.25)
        master.put("Goto state", 0)
        master.put("Kalman position", *GOTO[:3], INTERNAL)
        assert call.done() is (not wait)
        master.run(wait)
        report = call.result(0)
        assert (report.outcome, report.deviation) == (Outcome.ARRIVED, None)
        assert report.ended == pytest.approx(0.26 + wait)


LAST = {"canopen": "Goto XY.Barriers", "firmware2014": "Goto XY.Route"}
"""The last sub-index of Goto XY."""

SAFE = (RED, EmergencyShutdown())
REFUSED: list[tuple[tuple[Message | NmtCommand, ...], str, int, AbortCode, str]] = [
    (SAFE, LAST["canopen"], 0, AbortCode.STATE, "the safe state is held"),
    ((RED, NmtCommand.ENTER_PRE_OPERATIONAL), LAST["canopen"], 0, AbortCode.STATE, "not OPERATIONAL"),
    ((NmtCommand.ENTER_PRE_OPERATIONAL,), "Start configuration.Enemy 2 diameter", 0, AbortCode.STATE, "the same"),
    ((RED,), "Goto XY.X position", 3001, AbortCode.TOO_HIGH, "beyond the field"),
    ((RED,), "Goto XY.Speed", 101, AbortCode.TOO_HIGH, "faster than it can"),
    ((RED,), "Emergency stop.Obstacle", 2, AbortCode.TOO_HIGH, "no such obstacle"),
    ((), "Start configuration.Enemies", 3, AbortCode.TOO_HIGH, "three enemies"),
    ((), "Start configuration.Enemy 2 diameter", 20, AbortCode.INCOMPATIBLE, "an enemy that is not there"),
]


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize(("before", "name", "value", "code", "why"), REFUSED)
def test_a_command_that_would_not_act_is_an_abort_and_changes_nothing(
    before: tuple[Message | NmtCommand, ...], name: str, value: int, code: AbortCode, why: str, dialect: str
) -> None:
    master = Master("drive", dialect)
    for each in before:
        master.command(each) if isinstance(each, NmtCommand) else master.say(each)
    address = master.device.dictionary.address(LAST[dialect] if name == LAST["canopen"] else name)
    state = knowledge(master)
    kept = master.read(*address)
    master.sent()
    assert master.refused(address, value, master.size(address)) == code, why
    assert master.answers() == []
    assert (knowledge(master), master.read(*address)) == (state, kept)


def knowledge(master: Master) -> tuple[object, ...]:
    """Return what messages change in a drive."""
    assert isinstance(master.node, Drive)
    drive = master.node
    return drive.goto, drive.configuration, drive.estimate, drive.stopped_by, drive.safe


def test_a_stop_acts_in_every_state_in_which_there_is_sdo() -> None:
    master = Master("drive")
    master.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    master.put("Emergency stop", ENEMY)
    assert isinstance(master.node, Drive)
    assert master.node.obstacle is Obstacle.ENEMY


# Start configurations that contradict themselves

CONTRADICTIONS = [
    ((0, 0, 30, 0), "enemy_1_diameter", "no enemy, but enemy 1 has a diameter"),
    ((0, 1, 0, 1), "enemy_2_diameter", "no enemy, but enemy 2 has a diameter"),
    ((1, 0, 30, 20), "enemy_2_diameter", "one enemy, two diameters"),
    ((1, 0, 0, 20), "enemy_2_diameter", "one enemy, and the other one's diameter"),
]
AGREEING = [
    ((0, 0, 0, 0), "nobody is there"),
    ((1, 0, 30, 0), "one enemy"),
    ((2, 1, 30, 20), "everybody"),
    ((2, 0, 0, 0), "enemies whose diameters nobody knows"),
]
REFUSED_EMCY = RobotError.CONFIGURATION_REFUSED.to_bytes(2, "little")
CLEARED_EMCY = bytes(2)


def emergencies(master: Master) -> list[bytes]:
    return [frame.data[:2] for frame in master.sent() if frame.cob_id == 0x080 + master.device.node_id]


@pytest.mark.parametrize("role", ["drive", "navigation"])
@pytest.mark.parametrize(("numbers", "why"), [(numbers, why) for numbers, _, why in CONTRADICTIONS])
def test_a_contradictory_configuration_is_refused_and_told_once(
    role: str, numbers: tuple[int, int, int, int], why: str
) -> None:
    master = Master(role)
    wrong = StartConfigurationSet(TeamColour.RED, *numbers)
    master.say(RED)
    master.sent()
    assert master.say(wrong, wrong) == [], why
    assert vars(master.node)["configuration"] == RED
    assert emergencies(master) == [REFUSED_EMCY]
    assert master.say(RED) == [StartConfigurationConfirm()]
    assert emergencies(master) == [CLEARED_EMCY]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_of_a_configuration_that_is_refused_no_part_is_kept(dialect: str) -> None:
    master = Master("drive", dialect)
    master.say(RED)
    before = master.values_of("Start configuration")
    with pytest.raises(canopen.SdoAbortedError):
        master.put("Start configuration", 1, 0, 0, 0, 20)
    assert master.values_of("Start configuration") == before


@pytest.mark.parametrize("role", ["drive", "navigation"])
@pytest.mark.parametrize(("numbers", "why"), AGREEING)
def test_a_configuration_that_agrees_is_confirmed(role: str, numbers: tuple[int, int, int, int], why: str) -> None:
    master = Master(role)
    assert master.say(StartConfigurationSet(TeamColour.RED, *numbers)) == [StartConfigurationConfirm()], why
    assert emergencies(master) == []


@pytest.mark.parametrize(("numbers", "field", "why"), CONTRADICTIONS)
def test_a_core_sends_no_contradictory_configuration(numbers: tuple[int, int, int, int], field: str, why: str) -> None:
    core = Core(DICTIONARIES["core"])
    core.start(0.0)
    with pytest.raises(FieldError, match=f"Start Configuration Set: {field} = .*; allowed: 0, as enemies") as error:
        core.configure_start(TeamColour.RED, *numbers)
    assert error.value.field == field, why
    assert core.tick(0.1) == []


# While it drives, in simulated time


SYNC_COB_ID = 0x0F0
"""An identifier that no message of the robot has; CANopen's own, 0x080, is that of Navi Position Response."""


class Witness(Leaving, Drive):
    """A drive that notes with each frame that leaves it where it was then."""

    def __init__(self, dialect: str) -> None:
        super().__init__(with_sync(dialects.load("drive", dialect), SYNC_COB_ID))
        self.left: list[tuple[Frame, list[int]]] = []

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        if pose := self.estimate.pose:
            here = [round(pose.x), round(pose.y), round(pose.angle) % 360, INTERNAL]
            self.left += [(frame, here) for frame in frames]
        return super().outgoing(frames)


KALMAN, TPDO = 0x2011, 0x1802
"""Kalman position, and the communication record of the TPDO that carries it."""

TIMES = 20


class Field:
    """A drive with SYNC that crosses the field, and a peer that is its master, on a simulated bus."""

    def __init__(self, dialect: str) -> None:
        self.protocol = EurobotProtocol.of(dialects.load("drive", dialect))
        self.drive = Witness(dialect)
        self._master = Peer(DICTIONARIES["core"])
        self._network = Simulation()
        for node in (self.drive, self._master):
            self._network.attach(node)
        self.say(NOTHING, self.protocol.encode(RED), self.protocol.encode(GOTO))

    def say(self, *frames: Frame) -> None:
        """Send the master's frames, one every ms."""
        for frame in frames:
            self._master.say(frame)
            self.run(0.001)

    def run(self, seconds: float) -> None:
        self._network.run(self._network.now + seconds)

    def write(self, subindex: int, value: int, size: int) -> None:
        """Write a communication parameter of the TPDO over SDO."""
        self.say(Frame(0x602, bytes([0x23 | 4 - size << 2, 0x02, 0x18, subindex]) + value.to_bytes(4, "little")))

    def tpdos(self) -> list[tuple[list[int], list[int]]]:
        """Return what each TPDO carried, and where the drive was when it left."""
        cob_id = self.protocol.cob_id(KalmanPositionResponse)
        frames = [(frame, here) for frame, here in self.drive.left if frame.cob_id == cob_id]
        return [(list(self.protocol.unpack(*frame)[1].values()), here) for frame, here in frames]


NOTHING = Frame(0x7FF, b"")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_an_sdo_reads_where_the_driving_drive_is(dialect: str) -> None:
    field = Field(dialect)
    for _ in range(TIMES):
        field.run(0.0613)
        for subindex in range(1, 5):
            field.say(Frame(0x602, bytes([0x40, 0x11, 0x20, subindex, 0, 0, 0, 0])))
    read = [(frame.data, here) for frame, here in field.drive.left if frame.data[1:3] == KALMAN.to_bytes(2, "little")]
    assert [int.from_bytes(data[4:], "little") for data, _ in read] == [here[data[3] - 1] for data, here in read]
    assert len(read) == TIMES * 4
    assert len({data for data, _ in read}) > TIMES


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_timed_tpdo_carries_where_the_driving_drive_is(dialect: str) -> None:
    field = Field(dialect)
    field.write(5, 100, size=2)
    field.run(TIMES * 0.1 + 0.05)
    carried = field.tpdos()
    assert [values for values, _ in carried] == [here for _, here in carried]
    assert len(carried) == TIMES
    assert len({tuple(values) for values, _ in carried}) > TIMES // 2


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_tpdo_under_sync_carries_where_the_driving_drive_is(dialect: str) -> None:
    field = Field(dialect)
    field.write(2, 1, size=1)
    for _ in range(TIMES):
        field.run(0.0613)
        field.say(Frame(SYNC_COB_ID, b""))
    carried = field.tpdos()
    assert [values for values, _ in carried] == [here for _, here in carried]
    assert len(carried) == TIMES
    assert len({tuple(values) for values, _ in carried}) > TIMES // 2


# Stock canopen on a live bus

PATIENCE = 60.0
"""Longest time for which an answer is awaited, in s."""


@pytest.fixture
def live_drive(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Drive, Any]]:
    """Yield a live drive, and stock canopen's node for it, on an in-process bus."""
    monkeypatch.setattr("canopen.sdo.client.SdoClient.RESPONSE_TIMEOUT", PATIENCE)
    buses = (can.Bus(interface="virtual", channel=request.node.name) for _ in range(2))
    drive = Drive(DICTIONARIES["drive"])
    network = canopen.Network(next(buses))
    network.NOTIFIER_CYCLE = 0.05
    with Live.node(next(buses), drive), network.connect():
        yield drive, network.add_node(2, str(DICTIONARIES["drive"].file))


def test_stock_canopen_drives_the_robot_by_sdo_alone(live_drive: tuple[Drive, Any]) -> None:
    drive, remote = live_drive
    for subindex, value in enumerate((IN_RED, 1, 0, 30, 0), 1):
        remote.sdo["Start configuration"][subindex].raw = value
    assert [remote.sdo["Kalman position"][n].raw for n in range(1, 4)] == list(FACTS.start(TeamColour.RED))
    for subindex, value in enumerate((1500, 1000, 90, 1, 0), 1):
        remote.sdo[0x2000][subindex].raw = value
    assert drive.moving
    assert 0 < remote.sdo["Goto state"][1].raw < 0x0FFFFF
    remote.sdo["Emergency stop"][1].raw = 0  # object
    assert drive.goto is None
    assert remote.sdo["Goto state"][1].raw == 0x0FFFFF
    with pytest.raises(canopen.SdoAbortedError, match="0x06010002"):
        remote.sdo["Kalman position"][1].raw = 5
