"""Faults on demand, the kit too: each hook changes what it says and nothing else, and no fault makes a node raise."""

from __future__ import annotations

import re

import pytest

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import Mixin
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.plugin import Plugins
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviResponse,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Obstacle, Source, TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation, Node
from eurobot_od.robot.protocol import EurobotProtocol
from tests.robot.faults import (
    JUMP,
    PLUGINS,
    both,
    exchanged,
    field,
    foreign,
    frozen,
    meaning,
    raw,
)
from tests.robot.nodes.harness import Bench, as_if_started
from tests.rows import rows

PROTOCOL = EurobotProtocol.load()
DICTIONARIES = {name: dialects.load(name) for name in ROLES}
START = StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0)
CHECKED = Frame(PROTOCOL.cob_id(CheckDriveResponse))
PLACE = KalmanPositionResponse(200, 1800, 0, Source.INTERNAL)
GOTO = GotoXY(700, 1750, 90, 60)


def answers(node: Node, *messages: Message, until: float = 0.0) -> list[Frame]:
    """Return what a node sends in answer to messages, up to a time in seconds."""
    frames = [frame for message in messages for frame in node.receive(PROTOCOL.encode(message), 0.0)]
    while node.next_wakeup <= until:
        frames += node.tick(node.next_wakeup)
    return frames


def drive(*mixins: Mixin) -> Drive:
    """Return a drive with hooks in front of it, switched on, at its start place."""
    role: type[Drive] = type("Drive", (*mixins, Drive), {})
    node = role(DICTIONARIES["drive"])
    node.start(0.0)
    answers(node, START)
    return node


# Hooks


LEAVING = [
    (hooks.lost, []),
    (hooks.twice, [CHECKED, CHECKED]),
    (hooks.moved(1), [Frame(CHECKED.cob_id + 1)]),
    (hooks.data(lambda data: data + b"\x07"), [Frame(CHECKED.cob_id, b"\x07")]),
    (hooks.only(lambda data: len(data) > 0), []),
    (foreign(CheckNaviResponse()), [Frame(PROTOCOL.cob_id(CheckNaviResponse))]),
]


@pytest.mark.parametrize(("change", "left"), LEAVING)
def test_a_change_is_applied_to_its_sent_message_only(change: hooks.FrameChange, left: list[Frame]) -> None:
    node = drive(hooks.leaving(CheckDriveResponse, change))
    assert answers(node, CheckDriveRequest()) == left
    assert answers(node, KalmanPositionRequest()) == [PROTOCOL.encode(PLACE)]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (field("x", lambda x: x + 1), PLACE._replace(x=201)),
        (field("angle", lambda angle: -angle - 90), PLACE._replace(angle=270)),
        (meaning(lambda place: place._replace(source=Source.ENEMY_1)), PLACE._replace(source=Source.ENEMY_1)),
        (raw(y=lambda y: y // 2), PLACE._replace(y=900)),
        (exchanged("x", "angle"), PLACE._replace(x=0, angle=200)),
        # a value that may not be sent is not sent
        (field("x", lambda _: 4000), PLACE),
    ],
)
def test_a_change_of_the_meaning(change: hooks.FrameChange, said: KalmanPositionResponse) -> None:
    node = drive(hooks.leaving(KalmanPositionResponse, change))
    assert answers(node, KalmanPositionRequest()) == [PROTOCOL.encode(said)]


@pytest.mark.parametrize("change", [field("x", lambda x: x // 2), raw(x=lambda x: x // 2)])
def test_an_unreadable_frame_arrives_unchanged(change: hooks.FrameChange) -> None:
    node = drive(hooks.arriving(GotoXY, change))
    short = Frame(PROTOCOL.cob_id(GotoXY), b"\x01\x02")
    assert [frame.cob_id for frame in node.receive(short, 0.0)] == [hooks.emcy(node)]


@pytest.mark.parametrize(("change", "count"), [(hooks.lost, 0), (hooks.twice, 2)])
def test_a_change_is_applied_to_received_messages(change: hooks.FrameChange, count: int) -> None:
    assert answers(drive(hooks.arriving(CheckDriveRequest, change)), CheckDriveRequest()) == [CHECKED] * count


@pytest.mark.parametrize(("until", "left"), [(0.29, []), (0.31, [CHECKED])])
def test_late_frames_leave_later(until: float, left: list[Frame]) -> None:
    node = drive(hooks.late(CheckDriveResponse, 0.3))
    assert answers(node, CheckDriveRequest(), until=until) == left


def test_a_reaction_takes_the_place_of_the_healthy_one() -> None:
    node = drive(hooks.handling(StopDrive, lambda node, *_: node.offer(GotoConfirm())))
    assert answers(node, StopDrive()) == [PROTOCOL.encode(GotoConfirm())]


def test_a_reaction_can_call_the_healthy_one() -> None:
    node = drive(hooks.handling(GotoXY, lambda _, goto, healthy: healthy(goto._replace(speed=10))))
    answers(node, GOTO)
    assert node.goto == GOTO._replace(speed=10)


def test_a_preset_setting_takes_the_place_of_the_dictionarys() -> None:
    node = drive(hooks.preset("Motion.Control period", 50))
    assert node.control_period == 0.05
    assert node.limits == drive().limits


def test_an_action_is_done_again_and_again() -> None:
    node = drive(hooks.every(0.1, lambda node: node.offer(GotoConfirm())))
    assert answers(node, until=0.35) == [PROTOCOL.encode(GotoConfirm())] * 3


@pytest.mark.parametrize(("count", "left"), [(1, 1), (2, 2), (3, 2)])
def test_frames_are_changed_by_their_number(count: int, left: int) -> None:
    node = drive(hooks.numbered(CheckDriveResponse, lambda number: hooks.kept if number <= 2 else hooks.lost))
    assert answers(node, *[CheckDriveRequest()] * count) == [CHECKED] * left


def test_numbers_restart_at_a_reset() -> None:
    node = drive(hooks.numbered(CheckDriveResponse, lambda number: hooks.kept if number == 1 else hooks.lost))
    assert answers(node, CheckDriveRequest(), CheckDriveRequest()) == [CHECKED]
    node.receive(Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 0])), 0.0)
    assert answers(node, CheckDriveRequest()) == [CHECKED]


def test_a_frozen_message_repeats_its_first_values_until_a_reset() -> None:
    node = drive(frozen(KalmanPositionResponse, StartConfigurationSet))
    yellow = START._replace(team_colour=TeamColour.YELLOW)
    asked = KalmanPositionRequest()
    first = answers(node, asked)
    answers(node, GOTO, until=1.0)
    assert answers(node, asked) == first == [PROTOCOL.encode(PLACE)]
    assert answers(node, yellow, asked)[1:] == [PROTOCOL.encode(PLACE._replace(x=2800, angle=180))]


def test_an_answer_may_come_before_it_is_awaited() -> None:
    heard: list[Message] = []
    listening = hooks.handling(GotoConfirm, lambda _, message, __: heard.append(message))
    node = drive(listening, hooks.leaving(CheckDriveResponse, hooks.unawaited(GotoConfirm())))
    assert answers(node, CheckDriveRequest()) == [CHECKED]
    assert heard == [GotoConfirm()]


def test_two_changes_of_a_message_both_apply() -> None:
    node = drive(both(hooks.leaving(GotoStateResponse, hooks.lost), hooks.leaving(CheckDriveResponse, hooks.twice)))
    assert answers(node, GotoStateRequest(), CheckDriveRequest()) == [CHECKED, CHECKED]


def test_hooks_of_several_faults_all_apply() -> None:
    state = hooks.leaving(GotoStateResponse, hooks.lost)
    node = drive(state, hooks.leaving(CheckDriveResponse, hooks.twice))
    assert answers(node, GotoStateRequest(), CheckDriveRequest()) == [CHECKED, CHECKED]


# Faults


FITTING = [
    (role, name)
    for role in ROLES.values()
    for owner, faults in PLUGINS.all_faults().items()
    if issubclass(role, owner)
    for name in faults
]


def test_there_are_faults_for_every_node() -> None:
    assert {owner for owner, faults in PLUGINS.all_faults().items() if len(faults) >= 20} >= {
        Core,
        Drive,
        Navigation,
        Node,
    }


def test_names_of_faults_are_unique() -> None:
    assert len(set(PLUGINS.fault_names())) == len(PLUGINS.fault_names())


def test_a_fault_has_a_command_line_name_and_a_description() -> None:
    texts = {name: PLUGINS.find_fault(name)[1].text for name in PLUGINS.fault_names()}
    assert [name for name in texts if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name)] == []
    assert [text for text in texts.values() if not re.fullmatch(r"[a-z].*[^.]", text)] == []


@pytest.mark.parametrize(
    ("role", "name", "error"),
    [
        (Drive, "goto-not-confirmd", UnknownName),  # a typing error
        (Drive, "goto-not-sent", LocalError),  # the core's
        (Core, "goto-not-confirmed", LocalError),  # the drive's
        (Navigation, "", UnknownName),
    ],
)
def test_a_fault_that_a_node_cannot_have_is_refused(role: type[Node], name: str, error: type[LocalError]) -> None:
    with pytest.raises(error):
        PLUGINS.faulty(role, name)


def test_a_near_name_is_suggested() -> None:
    with pytest.raises(UnknownName, match="did you mean goto-not-confirmed"):
        PLUGINS.find_fault("goto-not-confirmd")


def test_a_fault_may_be_meant_for_one_node() -> None:
    of_the_drive = [
        name
        for name in ROLES
        if PLUGINS.kind(DICTIONARIES[name], ["drive.heartbeat-stops"]) is not PLUGINS.kind(DICTIONARIES[name])
    ]
    assert of_the_drive == ["drive"]
    with pytest.raises(UnknownName, match="unknown node 'arm'"):
        PLUGINS.find_fault("arm.heartbeat-stops")
    with pytest.raises(LocalError, match="without one write heartbeat-stops, for all devices"):
        Plugins().find_fault("motor.heartbeat-stops")


def test_the_healthy_node_stays_healthy() -> None:
    before = dict(vars(Drive))
    PLUGINS.faulty(Drive, "goto-not-confirmed")
    assert dict(vars(Drive)) == before
    assert answers(drive(), GOTO)[:1] == [PROTOCOL.encode(GotoConfirm())]


@pytest.mark.parametrize("role", ROLES.values())
def test_every_node_can_have_the_faults_of_any_node(role: type[Node]) -> None:
    assert [name for name in PLUGINS.all_faults()[Node] if not issubclass(PLUGINS.faulty(role, name), role)] == []


@rows("role, name", FITTING, sample=40)
def test_a_faulty_node_survives_any_frame(role: type[Node], name: str) -> None:
    node = PLUGINS.faulty(role, name)(DICTIONARIES[role.__name__.lower()])
    node.start(0.0)
    for command in (None, NmtCommand.STOP, NmtCommand.RESET_NODE):
        if command is not None:
            node.receive(Frame(NMT_COB_ID, bytes([command, 0])), 0.0)
        for identifier in set(node.device.identifiers) - {NMT_COB_ID}:
            for length in (0, 2, 7, 8):
                node.receive(Frame(identifier, b"\xa5" * length), 0.0)
        node.tick(0.0)


def test_a_node_can_have_two_faults() -> None:
    role = PLUGINS.faulty(PLUGINS.faulty(Drive, "drive-check-answered-twice"), "state-not-answered")
    node = role(DICTIONARIES["drive"])
    node.start(0.0)
    assert answers(node, GotoStateRequest(), CheckDriveRequest()) == [CHECKED, CHECKED]


def faulty_drive(name: str) -> Drive:
    """Return a drive with a fault, switched on and configured."""
    node = PLUGINS.faulty(Drive, name)(DICTIONARIES["drive"])
    node.start(0.0)
    answers(node, START)
    return node


def test_a_goto_that_is_confirmed_on_arrival_is_not_confirmed_before() -> None:
    node = faulty_drive("goto-confirmed-on-arrival")
    assert PROTOCOL.encode(GotoConfirm()) not in answers(node, GOTO, until=0.5)
    assert PROTOCOL.encode(GotoConfirm()) in answers(node, until=30.0)


def test_a_jumping_time_stays_a_valid_time() -> None:
    node = faulty_drive("time-jumps")
    answers(node, GOTO)
    first, second = (PROTOCOL.decode(*frame) for frame in answers(node, *[GotoStateRequest()] * 2))
    assert isinstance(first, GotoStateResponse)
    assert isinstance(first.time, int)
    assert second == GotoStateResponse(first.time + JUMP)


def test_a_place_is_swapped_within_the_field() -> None:
    node = faulty_drive("goto-place-swapped")
    answers(node, GotoXY(2500, 700, 90, 60))
    assert node.goto == GotoXY(700, 2000, 90, 60)


def test_three_enemies_are_taken_for_two() -> None:
    node = faulty_drive("three-enemies-taken")
    three = Frame(PROTOCOL.cob_id(StartConfigurationSet), bytes([3 << 1, 0]))
    assert node.receive(three, 0.0) == [PROTOCOL.encode(StartConfigurationConfirm())]


GOING = GotoXY(2000, 1750, 0, 60)


def stopped_with(name: str) -> Bench:
    """Send a drive off and stop it, by a core with a fault."""
    bench = Bench()
    bench.replace("core", PLUGINS.faulty(Core, name)(DICTIONARIES["core"]))
    bench.run(0.1)
    bench.core.configure_start(*START)
    bench.run(0.5)
    as_if_started(bench.core)
    bench.core.goto(*GOING)
    bench.run(1.0)
    bench.core.emergency_stop(Obstacle.ENEMY)
    return bench


@pytest.mark.parametrize(("name", "asks"), [("state-asked-after-stop", True), ("obstacle-not-told", False)])
def test_a_core_that_keeps_asking_does_so_for_a_second_after_the_stop(name: str, asks: bool) -> None:
    bench = stopped_with(name)
    bench.run(1.0)
    since = bench.now
    bench.run(0.35)
    assert (max(bench.times(GotoStateRequest)) > since) is asks


@pytest.mark.parametrize(("name", "stops"), [("late-confirm-ignored", 1), ("position-not-polled", 2)])
def test_a_core_that_ignores_a_late_confirm_sends_no_second_stop(name: str, stops: int) -> None:
    bench = Bench("drive", "navigation")
    bench.replace("core", PLUGINS.faulty(Core, name)(DICTIONARIES["core"]))
    bench.run(0.1)
    as_if_started(bench.core)
    bench.core.goto(*GOING)
    bench.run(0.01)
    bench.core.stop()
    bench.run(0.05)
    bench.say("drive", GotoConfirm())
    assert len(bench.sent(StopDrive)) == stops
