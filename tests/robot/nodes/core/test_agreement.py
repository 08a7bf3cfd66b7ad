"""Two nodes that map a message differently: it is said at the node check which one and how, and nothing is driven."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from eurobot_od import loading
from eurobot_od.bus.live import Live
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.fingerprints import FINGERPRINTS, NOT_MAPPED, OF_ALL
from eurobot_od.od.make import read_table
from eurobot_od.od.make.text import make_files
from eurobot_od.robot import dialects
from eurobot_od.robot.facade import Robot
from eurobot_od.robot.model.messages import GotoXY
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.nodes.core.agreement import NodeMismatch
from eurobot_od.robot.nodes.node import Component
from tests.client.peers import new_channel, open_bus

CANOPEN, OF_2014 = dialects.names()
ROLES: dict[str, type[Node]] = {"core": Core, "drive": Drive, "navigation": Navigation, "lift": Node}

# Without the optional field's row, in whose presence make-eds refuses some of these changes before any node is made.
TABLE = re.sub(r"\n +optional: .*", "", (dialects.eds_folder() / "protocol.yaml").read_text(encoding="utf-8"))
LIFT = """
extends: eurobot2014
nodes:
  core: {asks: [drive, navigation, lift]}
  lift: {node_id: 4, product_name: Lift, product_number: 4, order_code: L, watches: [], communication_error: 1,
    settings: {}}
objects:
  Lift: {index: 0x2030, fields: {Height: {bits: 8, range: [0, 200], default: 0, unit: mm}}}
messages:
  Lift Set: {identifier: 0x020, senders: [core], receivers: [lift], object: Lift}
"""
Folder = Callable[..., Path]


@cache
def files_of(table: str) -> Mapping[str, str]:
    return make_files(read_table(table, "protocol.yaml", loading.table_of))


def made(table: str, folder: Path) -> Path:
    for name, text in files_of(table).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="ascii")
    return folder


def changed(table: str, old: str, new: str) -> str:
    assert old in table
    return table.replace(old, new, 1)


def loaded(folder: Path, dialect: str, name: str) -> Dictionary:
    return Dictionary.load(folder / dialect / f"{name}.eds")


POSITIONS = """\
      X position: {bits: 12, range: [0, 3000], default: 0, unit: mm}
      Y position: {bits: 12, range: [0, 2000], default: 0, unit: mm}"""
"""Two fields of one width: in the other order, each takes the other's bits."""

CHANGES = [
    # what is changed, whose file has the change, and what is said about Goto XY, Goto State, ...
    (
        "Angle: {bits: 10, range: [0, 359], default: 0",
        "Angle: {bits: 9, range: [0, 359], default: 0",
        "drive",
        "Goto XY",
    ),
    (
        "Goto XY:\n    {identifier: 0x008",
        "Goto XY:\n    {identifier: 0x009",
        "drive",
        "Goto XY has the identifier 0x009",
    ),
    ("bits: 24", "bits: 25", "drive", "Goto State Response"),
    ("yellow: 0, red: 1", "yellow: 1, red: 0", "navigation", "Start Configuration Set (0x2C0): its codes"),
    ("3000], default: 0, unit: mm}", "3000], default: 0, unit: 2 mm}", "drive", "Goto XY (0x008): its codes, units"),
    (POSITIONS, "\n".join(reversed(POSITIONS.split("\n"))), "drive", "Goto XY (0x008): its codes, units or name"),
    ("Enemies: {bits: 2", "Enemies: {bits: 3", "navigation", "Start Configuration Set"),
]


@pytest.mark.parametrize(
    ("dialect", "old", "new", "node", "text"),
    [(CANOPEN, *each) for each in CHANGES]
    + [pytest.param(OF_2014, *each, marks=pytest.mark.long if each[0] != "bits: 24" else ()) for each in CHANGES],
)
def test_a_changed_mapping_is_noticed_and_nothing_is_driven(
    tmp_path: Path, dialect: str, old: str, new: str, node: str, text: str
) -> None:
    # nodes of 2014 are believed without SDO, those here have one
    folders = {"core": made(TABLE, tmp_path / "old"), node: made(changed(TABLE, old, new), tmp_path / "new")}
    network = Simulation()
    frames = list[Frame]()
    network.observers.append(lambda _, frame: frames.append(frame))
    names = ("core", "drive", "navigation")
    nodes = {each: ROLES[each](loaded(folders.get(each, folders["core"]), dialect, each)) for each in names}
    for each in nodes.values():
        network.attach(each)
    core = nodes["core"]
    assert isinstance(core, Core)
    network.run(0.1)
    check = core.check_nodes()
    network.run(30.0)
    with pytest.raises(NodeMismatch, match=re.escape(text)):
        check.result(0)
    with pytest.raises(StateError):
        core.goto(1500, 1000, 90, speed=50)
    configured = core.configure_start(TeamColour.RED)
    network.run(60.0)
    with pytest.raises(NodeMismatch):
        configured.result(0)
    with pytest.raises(StateError):
        core.goto(1500, 1000, 90, speed=50)
    assert GotoXY not in {type(core.device.protocol.decode(*each)) for each in frames if is_message(core, each)}


def is_message(core: Core, frame: Frame) -> bool:
    return frame.cob_id in {each.cob_id for each in core.device.protocol.bindings}


def test_the_bits_that_differ_are_named(tmp_path: Path) -> None:
    new = changed(
        TABLE, "Angle: {bits: 10, range: [0, 359], default: 0", "Angle: {bits: 9, range: [0, 359], default: 0"
    )
    assert "Goto XY (0x008): Angle has 9 bits there, 10 here" in said(
        made(TABLE, tmp_path / "old"), made(new, tmp_path)
    )


def said(core: Path, drive: Path, before: Callable[[Node], object] = lambda _: None) -> str:
    """Return why a core does not drive a drive, both with the files in these folders; '' if it does."""
    network = Simulation()
    nodes = [Core(loaded(core, CANOPEN, "core")), Drive(loaded(drive, CANOPEN, "drive"))]
    for each in (*nodes, Navigation(loaded(core, CANOPEN, "navigation"))):
        network.attach(each)
    network.run(0.1)
    before(nodes[1])
    check = nodes[0].check_nodes()  # type: ignore[attr-defined]
    network.run(30.0)
    return str(check.exception(0) or "")


def edited(folder: Path, old: str, new: str) -> Path:
    file = folder / CANOPEN / "drive.eds"
    file.write_text(changed(file.read_text(encoding="ascii"), old, new), encoding="ascii")
    return folder


ODD_FILES = [
    # a file that somebody changed by hand says the old fingerprints, and its node what it really maps
    ("DefaultValue=0x20000408", "DefaultValue=0x20000407", "Goto XY (0x008): Speed has 7 bits there, 8 here"),
    ("object=0, enemy=1", "object=1, enemy=0", "Emergency Stop (0x002): its codes, units or name"),
]


def test_a_file_changed_by_hand_is_noticed(tmp_path: Path) -> None:
    for number, (old, new, text) in enumerate(ODD_FILES):
        folder = edited(made(TABLE, tmp_path / str(number)), old, new)
        assert text in said(made(TABLE, tmp_path / "core"), folder)


def test_a_drive_remapped_by_a_master_is_noticed_at_the_next_check(tmp_path: Path) -> None:
    folder = made(TABLE, tmp_path)

    def remap(drive: Node) -> None:
        index = next(each.index for each in drive.device.dictionary.pdos if each.name == "Goto XY")
        drive.device.objects.put((index + 0x200, 3), 0x20000309)

    assert said(folder, folder) == ""
    assert "Goto XY (0x008): Angle has 9 bits there, 10 here" in said(folder, folder, remap)


def test_the_mapping_of_a_drive_is_read_again_after_a_loss(tmp_path: Path) -> None:
    """The drive that comes back has other bits: it was exchanged, or flashed anew."""
    old = made(TABLE, tmp_path / "old")
    new = made(changed(TABLE, "Speed: {bits: 8", "Speed: {bits: 7"), tmp_path / "new")
    network = Simulation()
    core = Core(loaded(old, CANOPEN, "core"))
    stations = [network.attach(each(loaded(old, CANOPEN, each.__name__.lower()))) for each in (Drive, Navigation)]
    network.attach(core)
    network.run(0.5)
    core.check_nodes()
    core.configure_start(TeamColour.RED)
    network.run(2.0)
    going = core.goto(600, 1800, 0, 50)
    network.run(3.0)
    network.detach(stations[0])
    network.run(4.5)
    assert going.result(0).outcome.value == "lost"
    network.attach(Drive(loaded(new, CANOPEN, "drive")))
    network.run(5.5)
    again = core.goto(600, 1800, 0, 50)
    network.run(30.0)
    with pytest.raises(NodeMismatch, match="Speed has 7 bits there, 8 here"):
        again.result(0)


LOST_SDO = [
    # what the drive maps, how many of its answers come before its SDO is lost, and what is said
    ("Speed: {bits: 8", 0, "drive (node 2) answers no SDO, so nobody knows how it maps"),
    ("Speed: {bits: 7", 0, "drive (node 2) answers no SDO, so nobody knows how it maps"),
    ("Speed: {bits: 7", 1, "maps messages differently: nobody knows which, as it answers no SDO any more"),
    ("Speed: {bits: 7", 8, "maps messages differently: nobody knows which, as it answers no SDO any more"),
]


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize(("speed", "answers", "text"), LOST_SDO)
def test_a_drive_whose_sdo_is_lost_for_a_while_is_not_driven_until_it_is_compared(
    tmp_path: Path, speed: str, answers: int, text: str, lost: bool
) -> None:
    old, new = made(TABLE, tmp_path / "old"), made(changed(TABLE, "Speed: {bits: 8", speed), tmp_path / "new")
    network = Simulation()
    gotos = list[float]()
    network.observers.append(lambda now, frame: gotos.append(now) if frame.cob_id == 0x008 else None)
    core = Core(loaded(old, CANOPEN, "core"))
    first = Drive(loaded(old if lost else new, CANOPEN, "drive"))
    stations = [network.attach(each) for each in (first, Navigation(loaded(old, CANOPEN, "navigation")))]
    network.attach(core)
    if lost:  # a core that has driven, and whose drive is exchanged
        network.run(0.5)
        core.check_nodes()
        core.configure_start(TeamColour.RED)
        network.run(2.0)
        network.detach(stations[0])
        network.run(4.0)
        network.attach(Drive(loaded(new, CANOPEN, "drive")))
    network.disturb = losing_sdo(answers)
    network.run(5.0)
    refused = core.goto(600, 1800, 0, 50) if lost else core.check_nodes()
    network.run(20.0)
    with pytest.raises(NodeMismatch, match=re.escape(text)):
        refused.result(0)
    assert not gotos
    network.disturb = losing_sdo(10_000)  # it answers again
    again = core.check_nodes()
    network.run(30.0)
    assert ("Speed has 7 bits there" in str(again.exception(0))) == ("7" in speed)
    assert not gotos


def losing_sdo(answers: int) -> Callable[[float, Frame], tuple[float, ...]]:
    """Return a disturbance that loses all SDO answers of the drive but the first ones."""
    left = iter(range(answers))

    def lose(_: float, frame: Frame) -> tuple[float, ...]:
        return () if frame.cob_id == 0x582 and next(left, None) is None else (0.0,)

    return lose


@pytest.mark.parametrize("dialect", [CANOPEN, OF_2014])
def test_a_teams_own_node_with_other_bits_is_not_driven_with(tmp_path: Path, dialect: str) -> None:
    folders = [
        made(LIFT, tmp_path / "old"),
        made(changed(LIFT, "Height: {bits: 8", "Height: {bits: 9"), tmp_path / "new"),
    ]
    own: dict[str, Any] = {"COMPONENTS": {"lift": Component()}}
    core: Core = type("Core", (Core,), own)(loaded(folders[0], dialect, "core"))
    network = Simulation()
    others = [ROLES[name](loaded(folders[0], dialect, name)) for name in ("drive", "navigation")]
    for each in (core, *others, Node(loaded(folders[1], dialect, "lift"))):
        network.attach(each)
    network.run(0.1)
    check = core.check_nodes()
    network.run(30.0)
    with pytest.raises(
        NodeMismatch, match=r"lift \(node 4\) maps messages differently: Lift Set \(0x020\): Height has 9"
    ):
        check.result(0)
    with pytest.raises(StateError, match="the lift must answer a check"):
        core.goto(1500, 1000, 90, speed=50)


def test_a_node_without_fingerprints_is_not_driven(tmp_path: Path) -> None:
    folder = made(TABLE, tmp_path)
    file = folder / CANOPEN / "drive.eds"
    text = file.read_text(encoding="ascii")
    cut = text[: text.index("[2F00]")] + text[text.index("[2F00sub18]") :].partition("\n\n")[2]
    file.write_text(cut, encoding="ascii")
    assert "has no message fingerprints (0x2F00): make its EDS anew" in said(made(TABLE, tmp_path / "core"), folder)


@pytest.mark.parametrize("dialect", [CANOPEN, OF_2014])
def test_a_mismatched_pair_on_a_live_bus_is_not_driven(tmp_path: Path, dialect: str) -> None:
    new = made(changed(TABLE, "Speed: {bits: 8", "Speed: {bits: 7"), tmp_path)
    channel = new_channel()
    with ExitStack() as stack:
        for node in (Drive(loaded(new, dialect, "drive")), Navigation(dialects.load("navigation", dialect))):
            stack.enter_context(Live.node(open_bus(channel), node))
        robot = stack.enter_context(Robot("virtual", channel, dialect=dialect))
        with pytest.raises(NodeMismatch, match=r"drive \(node 2\) maps messages differently: Goto XY"):
            robot.check_nodes()
        with pytest.raises(StateError, match="the drive"):
            robot.goto(1500, 1000, 90, speed=50)


@pytest.mark.parametrize("dialect", [CANOPEN, OF_2014])
def test_each_node_says_the_fingerprints_that_the_table_made(dialect: str) -> None:
    for dictionary in dialects.load_all(dialect):
        node = ROLES[dictionary.name](dictionary)
        subs = [sub for sub in dictionary.members[FINGERPRINTS] if sub]
        own = {pdo.name for pdo in dictionary.pdos}
        named = {sub: each.name for sub, each in dictionary.members[FINGERPRINTS].items()}
        for sub in subs:
            says = sub == OF_ALL or named[sub] in own
            number = dictionary.number((FINGERPRINTS, sub)) if says else NOT_MAPPED
            assert (named[sub], node.device.objects.number((FINGERPRINTS, sub))) == (named[sub], number)
    assert len({each.number((FINGERPRINTS, OF_ALL)) for each in dialects.load_all(dialect)}) == 1


def test_a_drive_without_sdo_is_believed_where_a_setting_says_so() -> None:
    robot = Robot(
        "virtual", new_channel(), settings={"Node check.Nodes without SDO": 1, "Node check.Check attempts": 3}
    )
    assert (robot.core.trusts_without_sdo, robot.core.check_attempts) == (1, 3)
    robot.live.stop()
