"""Every public name of the canopen package: our classes have it, or the error says what to use instead."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

import canopen
import canopen.emcy
import canopen.network
import pytest

import eurobot_od
from eurobot_od import BaseNode402, RemoteNode
from eurobot_od.canopen_names import MISSING
from eurobot_od.client.master import PeriodicTask
from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.client.streams import Emergency
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.errors import HeartbeatLost, LocalError, NoAnswer, NodeRefused, RemoteError, UnknownName
from eurobot_od.od.cia402 import State
from tests.client.servo import EDS, SERVO, servo


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
    missing = public(in_canopen(theirs())) - {*dir(thing)} - {"pdo", "sdo"}  # modules that are loaded with others
    kinds = {each.__name__ for each in type(thing).__mro__} | {listed}
    remedies = {name: remedy for kind in kinds for name, remedy in MISSING.get(kind, {}).items()}
    assert missing - {*remedies} == set()
    for name in missing:
        with pytest.raises(AttributeError, match=f"use instead: {re.escape(remedies[name])}$"):
            getattr(thing, name)


MODULES = ("emcy", "lss", "network", "nmt", "node", "objectdictionary", "pdo", "profiles.p402", "sdo", "sdo.exceptions")


def defined_in(module: ModuleType) -> set[str]:
    """Return the constants of a module of canopen's, and its classes, functions and modules; all that a package has."""
    inside = canopen.__name__ if hasattr(module, "__path__") else module.__name__

    def is_own(name: str, value: object) -> bool:
        if isinstance(value, ModuleType):
            return value.__name__.startswith(f"{module.__name__}.")
        return name.isupper() or getattr(value, "__module__", "").startswith(inside)

    return {name for name, value in vars(module).items() if name[0] != "_" and is_own(name, value)}


@pytest.mark.parametrize("name", MODULES)
def test_each_name_in_a_module_of_canopens_can_be_imported_or_says_what_to_use_instead(name: str) -> None:
    module = import_module(f"eurobot_od.{name}")
    assert f"eurobot_od.{name}" in {*sys.modules}
    for each in sorted(defined_in(import_module(f"canopen.{name}"))):
        line = f"from eurobot_od.{name} import {each}"
        remedy = MISSING.get(module.__name__, {}).get(each)
        if remedy is None:
            exec(line)
            continue
        with pytest.raises(ImportError, match=f"'{each}', which canopen has; use instead: {re.escape(remedy)}$"):
            exec(line)
        with pytest.raises(AttributeError, match=f"use instead: {re.escape(remedy)}$"):
            getattr(module, each)


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("from eurobot_od import LocalNode", "use instead: a `SimulatedDevice`"),
        ("from eurobot_od.sync import SyncProducer", "use instead: `network.sync`"),
        ("from eurobot_od.node.base import BaseNode", "use instead: `RemoteNode`"),
        ("from eurobot_od import nonsense", "cannot import name 'nonsense'"),
        ("import eurobot_od.nonsense", "No module named 'eurobot_od.nonsense'"),
    ],
)
def test_an_import_that_cannot_be_done_says_so(line: str, error: str) -> None:
    with pytest.raises(ImportError, match=error):
        exec(line)


def test_no_name_that_is_there_is_listed_as_missing(ours: SimulatedNetwork) -> None:
    assert {listed for listed, *_ in SIDES} | {f"eurobot_od.{each}" for each in MODULES} >= {*MISSING}
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
    network[5].tpdo[1].add_callback(
        lambda pdo: seen.extend((pdo.name, each.name, each.index, each.raw) for each in pdo)
    )
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
    with pytest.raises(eurobot_od.emcy.EmcyError, match="node 5: 0x8110 overrun"):
        raise network[5].emcy.active[-1]
    logged += [each.code for each in network[5].emcy.active]
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


YES_AND_NO = [True, True, False, False]


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
        (iterated, ("TPDO1", "Statusword", 0x6041, 0x240)),
        (lambda n: ["Controlword" in n[5].sdo, 0x6040 in n[5].sdo, "Wrong" in n[5].sdo, 0x5FFF in n[5]], YES_AND_NO),
        (
            lambda n: [
                "Vendor-ID" in n[5].sdo[0x1018],
                4 in n[5].sdo[0x1018],
                5 in n[5].sdo[0x1018],
                "x" in n[5][0x1018],
            ],
            YES_AND_NO,
        ),
        (lambda n: ["TPDO1" in n[5].pdo, 0x1A00 in n[5].pdo, "TPDO9" in n[5].pdo, 0x1A09 in n[5].pdo], YES_AND_NO),
        (lambda n: [1 in n[5].tpdo, "Statusword" in n[5].tpdo[1], 9 in n[5].tpdo, "Wrong" in n[5].tpdo[1]], YES_AND_NO),
        (lambda n: (len(n[5].sdo[0x1018]), len(n[5].tpdo[1]), len(n[5].sdo)), (4, 2, 187)),
        (lambda n: [n[5].sdo[0x1018][each].subindex for each in n[5].sdo[0x1018]], [1, 2, 3, 4]),
        (lambda n: [n[5].sdo[each].index for each in n[5].sdo][:2], [0x1000, 0x1001]),
        (
            lambda n: (n[5].tpdo.get(9), RemoteNode(6).sdo is not None, bool(RemoteNode(6)), 1 in RemoteNode(6)),
            (None, True, True, False),
        ),
        (alarmed, ([0x8110, "overrun", 0.0], [0x8110, 0x8110], [], [])),
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


@pytest.mark.parametrize(
    "ask",
    [
        lambda n: n[5].sdo["Operation Mode"],
        lambda n: n[5].sdo["Identity object.Wrong"],
        lambda n: n[5].sdo[0x1018][9],
        lambda n: n[5].pdo["TPDO9"],
        lambda n: n[5].tpdo[9],
        lambda n: n[5].tpdo[1]["Wrong"],
        lambda n: n[6],
        lambda n: n.__delitem__(6),
    ],
)
def test_an_unknown_name_is_a_key_error_in_one_line(ask: Callable[[SimulatedNetwork], object]) -> None:
    with servo() as network, pytest.raises(KeyError) as raised:
        ask(network)
    assert str(raised.value).startswith("unknown ")


def test_an_abort_is_caught_by_each_name_of_its_class() -> None:
    import eurobot_od.sdo  # as any network does

    names = (eurobot_od.SdoAbortedError, eurobot_od.sdo.SdoAbortedError, eurobot_od.sdo.exceptions.SdoAbortedError)
    for each in names:
        with servo() as network, pytest.raises(each):
            network[5].sdo.upload(0x5FFF, 0)
    assert names[0] is NodeRefused


def test_a_node_of_canopens_own_class_is_refused_with_what_to_import() -> None:
    with servo() as network, pytest.raises(LocalError, match="import RemoteNode or BaseNode402 from eurobot_od"):
        network.add_node(canopen.BaseNode402(6, str(EDS)))  # type: ignore[arg-type, no-untyped-call]


def test_a_drive_is_brought_to_a_state_in_words(ours: SimulatedNetwork) -> None:
    drive = ours[5].drive402
    drive.bring_to("Operation enabled")
    assert drive.state is State.ENABLED
    with pytest.raises(UnknownName, match="unknown state of a drive 'RUNNING'"):
        drive.bring_to("RUNNING")
