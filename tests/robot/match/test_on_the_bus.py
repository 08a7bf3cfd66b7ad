"""A live match as a CANopen engineer sees it: its nodes are found, and configured from DCF files before it begins."""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path

import pytest

from eurobot_od.bus.live import FrameReader, Live
from eurobot_od.client.configure import Configured, configure
from eurobot_od.client.description import scan
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.od import dcf
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import parse
from eurobot_od.od.values import Address, PdoDirection, Value
from eurobot_od.robot import dialects
from eurobot_od.robot.match import EventKind, MatchEvent, MatchOptions, stage
from eurobot_od.robot.match.referee import Observer, Referee
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import Timeline
from tests.client.peers import master_on, new_channel, open_bus

NOW = datetime(2014, 5, 28, 12, 0)
SHORT = MatchOptions(duration=2.5, falling=False, settings=(("core.Position polling.Start delay", "0"),))
MOVED = 0x018
CORE_HEARTBEAT = 0x701
FEW_RESERVED = 0x20000602


@pytest.mark.long
def test_a_scan_of_a_running_match_finds_its_three_nodes() -> None:
    channel, begun = new_channel(), threading.Event()

    def show(event: MatchEvent) -> None:
        if event.kind is EventKind.MATCH:
            begun.set()

    def play() -> None:
        stage.play_live(MatchOptions(duration=3.0), show, lambda _time, _frame: None, lambda: open_bus(channel))

    match = threading.Thread(target=play)
    match.start()
    assert begun.wait(20)
    with master_on(channel, 0.5) as master:
        found = scan(master, pace=0.001)
    match.join()
    assert [(each.node_id, each.name) for each in found] == [
        (1, "Eurobot 2014 core"),
        (2, "Eurobot 2014 drive"),
        (3, "Eurobot 2014 navigation"),
    ]


def test_a_match_is_not_played_beside_a_drive_that_is_on_the_bus() -> None:
    channel = new_channel()
    frames: list[Frame] = []
    with ExitStack() as stack:
        for role, kind in (("drive", Drive), ("navigation", Navigation)):
            stack.enter_context(Live.node(open_bus(channel), kind(dialects.load(role))))
        stack.enter_context(FrameReader(open_bus(channel), lambda _, frame: frames.append(frame), time.monotonic))
        with pytest.raises(BusError, match=r"^drive, navigation: on this bus already, and `match` brings its own; "):
            stage.play_live(SHORT, lambda _: None, lambda *_: None, lambda: open_bus(channel))
    assert not any(frame.cob_id == CORE_HEARTBEAT for frame in frames)


def goto_changes(node: Node) -> dict[Address, Value]:
    """Return the values with which a node has Goto XY at another COB-ID, with 2 of its 6 reserved bits."""
    [pdo] = [each for each in node.device.dictionary.pdos if each.name == "Goto XY"]
    no_rtr = 0x40000000 if pdo.direction is PdoDirection.TPDO else 0
    return {(pdo.index, 1): MOVED | no_rtr, (pdo.mapping_index, 5): FEW_RESERVED}


async def drive_there(core: Core) -> None:
    await core.goto(300, 1800, 0, 100)


def configured_from_dcf(channel: str, node: Node, file: Path) -> Configured:
    eds = dialects.eds_folder() / dialects.DEFAULT / f"{node.name}.eds"
    file.write_text(
        dcf.with_values(
            DescribedDevice(parse(eds.read_text())), goto_changes(node), node.device.node_id, node.name, 500
        )
    )
    with master_on(channel) as master:
        return configure(master.node(node.device.node_id), Dictionary.load(file), NOW)


def test_a_match_goes_on_as_before_when_a_dcf_has_moved_goto_xy(tmp_path: Path) -> None:
    channel, begin = new_channel(), time.monotonic()

    def clock() -> float:
        return time.monotonic() - begin

    world = World(SHORT, clock)
    core, nodes = stage.cast_for(SHORT, stage.EdsFiles.read(MatchOptions()), world)
    seen: list[Frame] = []
    timeline = Timeline(clock, lambda _: None)
    observer = Observer(core, timeline, lambda: world.robot)
    referee = Referee(core, SHORT, timeline, lambda: world.robot)
    with ExitStack() as stack:
        stack.enter_context(FrameReader(open_bus(channel), lambda _, frame: seen.append(frame), clock))
        for node in reversed(nodes):  # the core leaves first
            stack.enter_context(Live.node(open_bus(channel), node, clock))
        for node in nodes:
            if node.name in ("core", "drive"):
                assert configured_from_dcf(channel, node, tmp_path / f"{node.name}.dcf") == Configured(
                    2, stored=True, verified=True
                )
        asyncio.run(referee.play(drive_there))
    assert observer.errors, "no place was reached"
    assert {frame.cob_id for frame in seen} & {0x008, MOVED} == {MOVED}
