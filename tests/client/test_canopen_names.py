"""Every public name of the canopen package: our classes have it, or the error says what to use instead."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from typing import Any

import canopen
import canopen.emcy
import canopen.network
import pytest

import eurobot_od
from eurobot_od import BaseNode402, RemoteNode
from eurobot_od.client.canopen_names import MISSING
from eurobot_od.client.master import PeriodicTask
from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.client.streams import Emergency
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.errors import HeartbeatLost, LocalError, NoAnswer, RemoteError, UnknownName
from eurobot_od.od.cia402 import State
from tests.client.servo import EDS, SERVO, servo

OUR_MODULES = {"pdo", "sdo"}
"""Packages of ours that have the names of canopen's, and something else in them."""


def public(thing: object) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")} - {*dir(Exception())}


@cache
def theirs() -> canopen.Network:
    network = canopen.Network()
    network.add_node(canopen.BaseNode402(5, str(EDS)))  # type: ignore[no-untyped-call]
    network[5].tpdo[1].add_variable(0x6041)
    return network


@pytest.fixture(scope="module")
def ours() -> Iterator[SimulatedNetwork]:
    with SimulatedNetwork() as network:
        network.simulate(SimulatedDrive(SERVO))
        network.add_node(BaseNode402(5, EDS))
        yield network


# What canopen has, what we have in its place, and the class of ours whose names are listed.
SIDES: list[tuple[str, Callable[[Any], Any], Callable[[Any], Any]]] = [
    ("eurobot_od", lambda _: canopen, lambda _: eurobot_od),
    ("Network", lambda n: n, lambda n: n),
    ("RemoteDevice", lambda _: canopen.RemoteNode(6, str(EDS)), lambda _: RemoteNode(6, EDS)),
    ("RemoteDevice", lambda n: n[5].sdo, lambda n: n[5].sdo),
    ("BaseNode402", lambda n: n[5], lambda n: n[5]),
    ("RemoteObject", lambda n: n[5].sdo[0x6041], lambda n: n[5].sdo[0x6041]),
    ("RemoteObject", lambda n: n[5].sdo[0x1018], lambda n: n[5].sdo[0x6041]),
    ("NodeNmt", lambda n: n[5].nmt, lambda n: n[5].nmt),
    ("NetworkNmt", lambda n: n.nmt, lambda n: n.nmt),
    ("EmergencyStream", lambda n: n[5].emcy, lambda n: n[5].emcy),
    ("Emergency", lambda _: canopen.emcy.EmcyError(1, 2, b"", 0), lambda _: Emergency(0, 5, 1, 2, b"")),
    ("NetworkLss", lambda n: n.lss, lambda n: n.lss),
    ("NodeScanner", lambda n: n.scanner, lambda n: n.scanner),
    ("NetworkSync", lambda n: n.sync, lambda n: n.sync),
    ("NetworkTime", lambda n: n.time, lambda n: n.time),
    ("RemotePdos", lambda n: n[5].pdo, lambda n: n[5].pdo),
    ("PdosOfDirection", lambda n: n[5].tpdo, lambda n: n[5].tpdo),
    ("PdosOfDirection", lambda n: n[5].rpdo, lambda n: n[5].rpdo),
    ("BlockingPdoStream", lambda n: n[5].tpdo[1], lambda n: n[5].tpdo[1]),
    ("PdoSignal", lambda n: n[5].tpdo[1][0], lambda n: n[5].tpdo[1][0]),
    ("PeriodicTask", lambda _: canopen.network.PeriodicMessageTask, lambda _: PeriodicTask),
]


@pytest.mark.parametrize(("listed", "in_canopen", "in_ours"), SIDES)
def test_each_name_of_canopens_is_there_or_says_what_to_use_instead(
    ours: SimulatedNetwork, listed: str, in_canopen: Callable[[Any], Any], in_ours: Callable[[Any], Any]
) -> None:
    thing = in_ours(ours)
    missing = public(in_canopen(theirs())) - {name for name in dir(thing) if name not in OUR_MODULES} - OUR_MODULES
    kinds = {each.__name__ for each in type(thing).__mro__} | {listed}
    remedies = {name: remedy for kind in kinds for name, remedy in MISSING.get(kind, {}).items()}
    assert missing - {*remedies} == set()
    for name in missing:
        with pytest.raises(AttributeError, match=f"use instead: {re.escape(remedies[name])}$"):
            getattr(thing, name)


def test_no_name_that_is_there_is_listed_as_missing(ours: SimulatedNetwork) -> None:
    assert {listed for listed, *_ in SIDES} >= {*MISSING}
    for listed, _, in_ours in SIDES:
        assert [*set(MISSING.get(listed, ())) & {*dir(in_ours(ours))}] == [], listed


def test_a_setting_without_effect_is_told_and_any_other_slip_refused() -> None:
    with servo() as network:
        with pytest.warns(UserWarning, match=r"MAX_RETRIES = 5 has no effect on a RemoteDevice; a higher `RESPONSE_T"):
            network[5].sdo.MAX_RETRIES = 5  # type: ignore[attr-defined]
        with pytest.raises(AttributeError, match="no attribute 'trans_typ'"):
            network[5].tpdo[1].trans_typ = 5  # type: ignore[attr-defined]


def test_the_response_timeout_of_a_node_has_effect() -> None:
    with servo() as network:
        silent = RemoteNode(6, EDS)
        silent.sdo.RESPONSE_TIMEOUT = 2
        network.add_node(silent)
        with pytest.raises(NoAnswer) as raised:
            silent.sdo.upload(0x1000, 0)
        assert (raised.value.waited, network[5].sdo.RESPONSE_TIMEOUT) == (2, 0.5)


def test_an_object_is_a_file() -> None:
    with servo() as network:
        name = network[5].sdo["Manufacturer device name"]
        with name.open("r", encoding="ascii") as text, name.open() as data:
            assert (text.read(), data.read()) == ("Servo 100", b"Servo 100")
        with network[5].sdo.open(0x6081, mode="wb", size=4, block_transfer=True) as file:
            file.write(b"\x05\0")
            file.write(b"\0\0")
        assert network[5]["Profile velocity"].raw == 5
        with pytest.raises(LocalError, match="not with 'w'"):
            name.open("w")


def test_a_file_that_an_exception_ends_is_not_written() -> None:
    with servo() as network:
        before = network[5]["Profile velocity"].raw
        with suppress(KeyError), network[5].sdo[0x6081].open("wb") as file:
            file.write(b"\x05")
            raise KeyError
        assert network[5]["Profile velocity"].raw == before


def iterated(network: SimulatedNetwork) -> object:
    seen: list[object] = []
    network[5].tpdo[1].add_callback(lambda pdo: seen.extend((pdo.name, each.index, each.raw) for each in pdo))
    network[5].nmt.state = "OPERATIONAL"
    network.sync.transmit()
    network.sleep(0.01)
    return seen[0]


def associated(network: SimulatedNetwork) -> object:
    RemoteNode(6, EDS).associate_network(network)
    return network[6].network is network


def alarmed(network: SimulatedNetwork) -> object:
    seen: list[object] = []
    network[5].emcy.add_callback(lambda each: seen.extend([each.code, each.get_desc(), each.timestamp]))
    network[5].receive(0x085, bytes([0x10, 0x81, 0x11, 0, 0, 0, 0, 0]), 0.0)
    network.sleep(0.01)
    logged = [each.code for each in network[5].emcy.log]
    network[5].emcy.reset()
    return seen, logged, network[5].emcy.log, network[5].emcy.active


def beaten(network: SimulatedNetwork) -> object:
    seen: list[int] = []
    network[5].nmt.add_heartbeat_callback(seen.append)
    network[5].nmt.send_command(130)
    network.sleep(0.2)
    return seen[0]


def timed(network: SimulatedNetwork) -> object:
    sent: list[str] = []
    network.simulation.observers.append(lambda _, frame: sent.append(f"{frame.cob_id:03X}#{frame.data.hex()}"))
    network.time.transmit(441763200 + 86400 + 1)  # a day and a second after 1 January 1984
    network.sleep(0.01)
    return sent


def task_updated(network: SimulatedNetwork) -> object:
    sent: list[tuple[int, bytes]] = []
    network.simulation.observers.append(lambda _, frame: sent.append((frame.cob_id, frame.data)))
    task = network.send_periodic(0x300, b"\1", 0.1)
    network.sleep(0.05)
    task.update(b"\2")
    network.sleep(0.05)
    task.stop()
    return [data for cob_id, data in sent if cob_id == 0x300]


@pytest.mark.parametrize(
    ("ask", "answer"),
    [
        (lambda n: n.bus is n.master.bus, True),
        (lambda n: (n.get(5) is n[5], n.get(6)), (True, None)),
        (lambda n: (n.__delitem__(5), n.keys()), (None, [])),
        (lambda n: (n[5].network is n, n[5].has_network(), n[5].remove_network(), n.nodes), (True, True, None, {})),
        (associated, True),
        (lambda n: n[5].tpdo[1].map[0] is n[5].tpdo[1][0], True),
        (lambda n: n[5].tpdo.map[1] is n[5].tpdo[1], True),
        (lambda n: n[5].tpdo[1].read(), None),
        (lambda n: (n[5].sdo[0x6041].bits[6], n[5].sdo[0x6041].bits[range(5, 7)]), (1, 2)),
        (lambda n: (n[5].sdo[0x1018][1].index, n[5].sdo[0x1018][1].subindex), (0x1018, 1)),
        (iterated, ("TPDO1", 0x6041, 0x240)),
        (alarmed, ([0x8110, "overrun", 0.0], [0x8110], [], {})),
        (beaten, 0),
        (timed, ["100#e80300000100"]),
        (task_updated, [b"\1", b"\2"]),
        (lambda _: eurobot_od.import_od(str(EDS), 5)[0x1008].name, "Manufacturer device name"),
        (lambda _: eurobot_od.nmt.NMT_STATES[5], "OPERATIONAL"),
        (lambda _: eurobot_od.profiles.p402.BaseNode402 is BaseNode402, True),
        (lambda _: (eurobot_od.nmt.NmtError, eurobot_od.lss.LssError), (HeartbeatLost, RemoteError)),
        (lambda n: eurobot_od.objectdictionary.ODVariable is type(n[5].od[0x1008]), True),
    ],
)
def test_a_name_of_canopens_does_what_it_does_there(ask: Callable[[SimulatedNetwork], object], answer: object) -> None:
    with servo() as network:
        assert ask(network) == answer


def test_a_node_of_canopens_own_class_is_refused_with_what_to_import() -> None:
    with servo() as network, pytest.raises(LocalError, match="import RemoteNode or BaseNode402 from eurobot_od"):
        network.add_node(canopen.BaseNode402(6, str(EDS)))  # type: ignore[arg-type, no-untyped-call]


def test_a_drive_is_brought_to_a_state_in_words(ours: SimulatedNetwork) -> None:
    drive = ours[5].drive402
    drive.bring_to("Operation enabled")
    assert drive.state is State.ENABLED
    with pytest.raises(UnknownName, match="unknown state of a drive 'RUNNING'"):
        drive.bring_to("RUNNING")
