"""Listeners follow what a master changes while the gatekeeper runs: identifiers, mappings, a PDO that is not valid."""

from __future__ import annotations

import threading

import pytest

from eurobot_od.errors import ListenerError
from eurobot_od.frame import Frame
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import Address, Value
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model.messages import CATALOGUE, CheckDriveRequest, GotoStateRequest

DRIVE = dialects.load("drive")
COB_IDS: dict[str, Address] = {pdo.name: (pdo.index, 1) for pdo in DRIVE.pdos}
CHECK, STATE = COB_IDS["Check Drive Request"], COB_IDS["Goto State Request"]


def changed_pdos(values: dict[Address, Value]) -> list[Pdo]:
    """Return the drive's PDOs with other values of objects."""
    return list(DRIVE.read_pdos(lambda address: values.get(address, DRIVE.default(address))))


def changed(values: dict[Address, Value]) -> Protocol:
    """Return the drive's protocol with other values of objects."""
    return Protocol([(DRIVE, changed_pdos(values))], CATALOGUE)


def heard(gatekeeper: Gatekeeper) -> list[object]:
    return [each["can_id"] for each in gatekeeper.filters()]


def test_a_listener_gets_its_message_under_the_new_identifier_only() -> None:
    gatekeeper = Gatekeeper(changed({}))
    queue = gatekeeper.add_queue(CheckDriveRequest)
    gatekeeper.start()
    assert gatekeeper.reroute(changed({CHECK: 0x3C5})) == gatekeeper.filters()
    gatekeeper.receive(Frame(0x3C0), 0.0)
    gatekeeper.receive(Frame(0x3C5), 1.0)
    assert [received.timestamp for received in queue.drain()] == [1.0]
    assert heard(gatekeeper) == [0x3C5]


def test_a_message_without_a_class_of_its_own_is_followed_too() -> None:
    before, after = (Protocol([(DRIVE, changed_pdos({CHECK: cob_id}))]) for cob_id in (0x3C0, 0x3C5))
    gatekeeper = Gatekeeper(before)
    queue = gatekeeper.add_queue(before.binding_of(0x3C0).type)
    gatekeeper.start()
    gatekeeper.reroute(after)
    gatekeeper.receive(Frame(0x3C5), 1.0)
    assert [received.timestamp for received in queue.drain()] == [1.0]


def test_two_messages_can_swap_identifiers() -> None:
    gatekeeper = Gatekeeper(changed({}))
    check, state = gatekeeper.add_queue(CheckDriveRequest), gatekeeper.add_queue(GotoStateRequest)
    gatekeeper.start()
    gatekeeper.reroute(changed({CHECK: 0x80000010}))
    gatekeeper.reroute(changed({CHECK: 0x80000010, STATE: 0x3C0}))
    gatekeeper.reroute(changed({CHECK: 0x010, STATE: 0x3C0}))
    gatekeeper.receive(Frame(0x010), 0.0)
    gatekeeper.receive(Frame(0x3C0), 0.0)
    assert [received.message for received in check.drain()] == [CheckDriveRequest()]
    assert [received.message for received in state.drain()] == [GotoStateRequest()]


def test_a_message_that_is_not_valid_is_not_listened_to_until_it_is_again() -> None:
    gatekeeper = Gatekeeper(changed({}))
    queue = gatekeeper.add_queue(CheckDriveRequest)
    gatekeeper.start()
    gatekeeper.reroute(changed({CHECK: 0x800003C0}))
    gatekeeper.receive(Frame(0x3C0), 0.0)
    assert queue.drain() == []
    assert heard(gatekeeper) == []
    gatekeeper.reroute(changed({}))
    gatekeeper.receive(Frame(0x3C0), 0.0)
    assert len(queue.drain()) == 1


def test_nodes_are_asked_again_for_their_identifiers() -> None:
    wanted = [0x702]
    gatekeeper = Gatekeeper(changed({}))
    gatekeeper.add_frames(lambda: wanted, lambda *_: None, "frames")
    gatekeeper.start()
    wanted[:] = [0x703, 0x704]
    gatekeeper.reroute(changed({}))
    assert heard(gatekeeper) == [0x703, 0x704]


def test_a_change_is_announced_after_it_in_the_receiving_thread() -> None:
    told: list[tuple[list[object], threading.Thread]] = []
    gatekeeper = Gatekeeper(changed({}))
    gatekeeper.add_queue(CheckDriveRequest)
    gatekeeper.add_node(lambda: (0x602,), lambda *_: gatekeeper.reroute(changed({CHECK: 0x3C5})), "master")
    gatekeeper.start()
    gatekeeper.rerouted = lambda: told.append((heard(gatekeeper), threading.current_thread()))
    gatekeeper.receive(Frame(0x3C0), 0.0)
    assert told == []
    reader = threading.Thread(target=gatekeeper.receive, args=(Frame(0x602), 1.0))
    reader.start()
    reader.join()
    assert told == [([0x3C5, 0x602], reader)]


def test_a_change_does_not_open_the_registration_again() -> None:
    gatekeeper = Gatekeeper(changed({}))
    gatekeeper.start()
    gatekeeper.reroute(changed({}))
    with pytest.raises(ListenerError):
        gatekeeper.add_queue(CheckDriveRequest)
