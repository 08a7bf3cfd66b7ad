"""Layer setting services on a bus with slaves: found by scanning and by name, configured, and refused in words."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import canopen
import pytest

from eurobot_od.client import lss
from eurobot_od.client.lss import LssSteps, perform
from eurobot_od.errors import LocalError, NoAnswer, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import LssState
from tests.client.lss_slave import (
    CONFIGURATION,
    WAITING,
    LssStation,
    OtherIdentityStation,
    StatelessStation,
    UnreliableStation,
)
from tests.client.wired import Answerer, wired

ONE = Identity(0x12345678, 0xFFFFFFFF, 0, 0x80000001)
NEXT = ONE._replace(serial=0x80000002)
OTHER = Identity(0, 1, 2, 3)


@pytest.mark.parametrize("identities", [[], [ONE], [NEXT, ONE], [ONE, OTHER, NEXT], [Identity(0, 0, 0, 0)]])
def test_all_devices_without_a_node_id_are_found_the_lowest_first(identities: list[Identity]) -> None:
    slaves = [LssStation(each) for each in identities]
    with wired(*slaves, LssStation(Identity(9, 9, 9, 9), node_id=5)) as master:
        assert perform(master, lss.find_all()) == sorted(identities)
    assert {slave.state for slave in slaves} <= {WAITING}


def test_devices_that_answer_fastscan_while_they_are_configured_are_all_found() -> None:
    slaves, asked = [LssStation(each, always_scanned=True) for each in (NEXT, OTHER, ONE)], list[int]()
    with wired(*slaves) as master:
        found = perform(master, lss.find_all(), progress=lambda number, _: asked.append(number))
    assert found == [OTHER, ONE, NEXT]
    assert asked == list(range(1, len(asked) + 1))
    assert len(asked) < 3 * 300
    assert {slave.state for slave in slaves} == {WAITING}


def test_fastscan_goes_on_to_a_part_of_an_identity_and_back_to_the_first() -> None:
    steps, then = lss._Scan().find_one(), list[int]()
    request = next(steps)
    with suppress(StopIteration):
        while True:
            then.append(request.rest[6])
            request = steps.send(b"")  # yes to all
    assert (set(then), then[-1]) == ({0, 1, 2, 3}, 0)


def test_no_device_is_made_of_two() -> None:
    slaves = [StatelessStation(Identity(1, 2, 3, 4)), StatelessStation(Identity(5, 6, 3, 7))]
    with wired(*slaves) as master:
        assert perform(master, lss.find_all()) == [slave.identity for slave in slaves]


def test_the_search_has_a_bound_on_a_bus_that_always_says_yes() -> None:
    asked, yes = list[int](), Answerer(lambda _: [Frame(0x7E4, bytes([each, *bytes(7)])) for each in (0x4F, 0x44)])
    with wired(yes) as master, pytest.raises(RemoteError, match="no identity that it confirms was found"):
        perform(master, lss.find_all(), progress=lambda number, _: asked.append(number))
    assert len(asked) < len(lss.PATIENCE) * 127 * 30


@pytest.mark.parametrize("late", [0.15, 0.25, 0.5])
@pytest.mark.parametrize("identities", [[ONE], [OTHER, ONE, NEXT]])
def test_devices_whose_answers_come_after_the_time_for_them_are_found_by_their_own_identity(
    identities: list[Identity], late: float
) -> None:
    with wired(*(UnreliableStation(each, [late]) for each in identities)) as master:
        assert perform(master, lss.find_all()) == identities


def test_a_device_that_is_too_late_for_every_wait_is_not_made_up() -> None:
    with wired(UnreliableStation(ONE, [1.5])) as master, pytest.raises(RemoteError, match="answers are lost"):
        perform(master, lss.find_all())


@pytest.mark.parametrize("lost", range(0, 140, 7))
def test_a_scan_survives_a_lost_answer(lost: int) -> None:
    behaviour = [0.0] * lost + [None] + [0.0] * 3000
    with wired(UnreliableStation(NEXT, behaviour), LssStation(OTHER)) as master:
        assert perform(master, lss.find_all()) == [OTHER, NEXT]


def test_fastscan_of_a_device_with_late_answers_finds_its_own_identity() -> None:
    station = UnreliableStation(ONE, [0.15])
    with wired(station) as master:
        assert perform(master, lss.fastscan()) == ONE
    assert station.state is CONFIGURATION


def test_a_device_that_says_another_identity_than_fastscan_finds_is_told() -> None:
    with wired(OtherIdentityStation(ONE)) as master, pytest.raises(RemoteError, match="no identity that it confirms"):
        perform(master, lss.find_all())


def test_a_device_that_fastscan_loses_is_an_error() -> None:
    slave = LssStation(ONE)

    def answers(frame: Frame) -> list[Frame]:
        return slave.receive(frame, 0.0) if frame.data[6] < 2 else []  # gone after two parts of its identity

    with wired(Answerer(answers)) as master, pytest.raises(RemoteError, match="no longer answers"):
        perform(master, lss.fastscan())


def test_a_device_is_selected_by_its_identity() -> None:
    slaves = one, other, _ = LssStation(ONE), LssStation(OTHER, node_id=7), LssStation(NEXT)
    with wired(*slaves) as master:
        assert perform(master, lss.select(OTHER))
        assert [slave.state for slave in slaves] == [WAITING, CONFIGURATION, WAITING]
        assert perform(master, lss.inquire_node_id()) == 7
        assert perform(master, lss.select(ONE))  # the other one waits again
        assert (one.state, other.state) == (CONFIGURATION, WAITING)
        assert not perform(master, lss.select(OTHER._replace(serial=4)))


def test_node_id_and_bit_rate_are_set_stored_and_activated() -> None:
    station = LssStation(ONE)
    slave = station.slave
    with wired(station) as master:
        perform(master, lss.switch(LssState.CONFIGURATION))
        perform(master, lss.configure_node_id(5))
        perform(master, lss.configure_bit_rate(250))
        assert (slave.pending, slave.active, slave.stored) == ((5, 250), (255, 500), (255, 500))
        perform(master, lss.store())
        perform(master, lss.activate_bit_rate(0.5))
    assert (slave.stored, slave.active, slave.silent_until) == ((5, 250), (255, 250), 1.0)


SEVERAL = "node-ID 5; another device has no node-ID: --identity tells which one is meant"


@pytest.mark.parametrize(
    ("identities", "identity", "always_scanned", "said"),
    [
        ([ONE], None, False, "node-ID 5"),
        ([NEXT, ONE], None, False, SEVERAL),
        ([NEXT, ONE], ONE, False, "node-ID 5"),  # chosen
        ([ONE], None, True, "node-ID 5"),
        ([NEXT, ONE], None, True, "node-ID 5"),  # the one that is being configured answers for the others
    ],
)
def test_a_device_that_is_taken_without_a_choice_is_told_not_to_be_the_only_one(
    identities: list[Identity], identity: Identity | None, always_scanned: bool, said: str
) -> None:
    slaves = [LssStation(each, always_scanned=always_scanned) for each in identities]
    with wired(*slaves) as master:
        done = perform(master, lss.set_up(identity, False, lss.settings(node_id=5)))
    assert done == f"{ONE}  {said}"
    assert {each.identity: each.slave.pending.node_id for each in slaves} == dict.fromkeys(identities, 255) | {ONE: 5}


def test_the_only_device_is_refused_where_another_one_answers() -> None:
    slaves = [LssStation(ONE), LssStation(NEXT)]
    with wired(*slaves) as master, pytest.raises(RemoteError, match=r"^2 devices answer, .*--identity selects one$"):
        perform(master, lss.set_up(None, True, lss.settings(node_id=5)))
    assert [each.slave.pending.node_id for each in slaves] == [255, 255]
    with wired(slaves[0]) as master:
        assert perform(master, lss.set_up(None, True, lss.settings(node_id=5))) == "the only device  node-ID 5"


@pytest.mark.parametrize(
    ("command", "error", "steps", "said"),
    [
        (0x11, (1, 0), lss.configure_node_id(5), "refuses to configure node id: node-ID out of range"),
        (0x13, (1, 0), lss.configure_bit_rate(800), "refuses to configure bit timing: bit rate not supported"),
        (0x17, (1, 0), lss.store(), "refuses to store: storing is not supported"),
        (0x17, (2, 0), lss.store(), "refuses to store: no access to the storage media"),
        (0x17, (9, 0), lss.store(), "refuses to store: error 9"),
        (0x17, (255, 7), lss.store(), "refuses to store: error 7 of its own"),
    ],
)
def test_a_refusal_is_in_words(command: int, error: tuple[int, int], steps: LssSteps[None], said: str) -> None:
    with wired(LssStation(ONE, errors={command: error})) as master:
        perform(master, lss.switch(LssState.CONFIGURATION))
        with pytest.raises(RemoteError, match=f"^the device {said}$"):
            perform(master, steps)


def test_silence_is_no_answer() -> None:
    with wired() as master:
        with pytest.raises(NoAnswer, match=r"^no answer within 5000 ms after LSS store"):
            perform(master, lss.store())
        assert not master.listeners, "nobody listens any more"


@pytest.mark.parametrize(
    "make",
    [
        lambda: lss.configure_node_id(0),
        lambda: lss.configure_node_id(128),
        lambda: lss.configure_bit_rate(100),  # reserved in the table
        lambda: lss.activate_bit_rate(-1),
        lambda: lss.activate_bit_rate(66),
    ],
)
def test_unknown_lss_values_are_refused_locally(make: Callable[[], LssSteps[None]]) -> None:
    with pytest.raises(LocalError):
        make()


def test_other_frames_under_the_identifier_are_no_answer() -> None:
    noise = [Frame(0x7E4, b""), Frame(0x7E4, b"\x5e\x07"), Frame(0x7E4, bytes([0x44, *bytes(7)]))]
    with wired(Answerer(lambda _: noise), LssStation(ONE, node_id=9)) as master:
        perform(master, lss.switch(LssState.CONFIGURATION))
        assert perform(master, lss.inquire_node_id()) == 9


class StockWire:
    """What canopen's LssMaster takes for a network: requests go to a slave, its answers back at once."""

    def __init__(self, slave: LssStation) -> None:
        make: Any = canopen.lss.LssMaster
        self.master = make()
        self.master.network, self.master.RESPONSE_TIMEOUT = self, 0
        self._slave = slave

    def send_message(self, can_id: int, data: bytes) -> None:
        for answer in self._slave.receive(Frame(can_id, bytes(data)), 0.0):
            self.master.on_message_received(answer.cob_id, answer.data, 0.0)


def test_stock_canopen_finds_and_sets_the_same_in_a_slave(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("canopen.lss.time.sleep", lambda _: None)
    ours, theirs = LssStation(ONE), LssStation(ONE)
    with wired(ours) as master:
        found = perform(master, lss.fastscan())
        perform(master, lss.configure_node_id(5))
        perform(master, lss.configure_bit_rate(250))
        perform(master, lss.store())
    stock = StockWire(theirs).master
    assert stock.fast_scan() == (True, list(found or ()))
    stock.configure_node_id(5)
    stock.configure_bit_timing(3)
    stock.store_configuration()
    assert ours.slave.stored == theirs.slave.stored == (5, 250)
