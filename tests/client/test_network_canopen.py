"""Programs written for canopen, with another import line: they run against our simulated devices."""

from __future__ import annotations

import re
import textwrap
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import distribution
from pathlib import Path
from threading import Event
from typing import Any

import can
import pytest

from eurobot_od.bus.live import Live
from eurobot_od.client.network import (
    BaseNode402,
    Network,
    RemoteNode,
    SimulatedNetwork,
    simulated,
)
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.errors import EurobotError, HeartbeatLost, LocalError, StateError, UnknownName
from eurobot_od.od.standard import LssState
from eurobot_od.pdo.binding import parse
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.sdo import SdoAbortedError, SdoCommunicationError
from tests.client.peers import LIFT, new_channel, open_bus
from tests.client.servo import DOCS, EDS, SERVO, live_servos, servo

GROUP = """
[2F00]
ParameterName=Some group
ObjectType=0x9
SubNumber=2
[2F00sub0]
ParameterName=Highest sub-index supported
ObjectType=0x7
DataType=0x0005
AccessType=const
DefaultValue=1
PDOMapping=0
[2F00sub1]
ParameterName=Some subindex
ObjectType=0x7
DataType=0x0006
AccessType=ro
DefaultValue=77
PDOMapping=1
"""
"""An object that the program of canopen's README maps into a PDO."""


def with_group(eds: str) -> str:
    head, count = re.findall(r"(\[ManufacturerObjects\]\s+SupportedObjects=)(\d+)", eds)[0]
    more = int(count) + 1
    return eds.replace(f"{head}{count}\n", f"{head}{more}\n{more}=0x2F00\n") + GROUP


@contextmanager
def drive(node_id: int, file: Path) -> Iterator[str]:
    """Run the drive of a file on a bus inside the process; gives its channel."""
    channel = new_channel()
    with Live.node(open_bus(channel), SimulatedDrive.load(file, node_id=node_id)):
        yield channel


def with_our_import(program: str) -> str:
    assert program.count("import canopen\n") == 1
    return program.replace("import canopen\n", "import eurobot_od as canopen\n")


def test_the_program_of_canopens_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its file is a place-holder, and its bus is the one of python-can's configuration."""
    readme = distribution("canopen").read_text("METADATA") or ""
    shown = re.findall(r"\.\. code-block:: python\n\n((?:    .*\n|\n)+)", readme)
    program = with_our_import(textwrap.dedent(shown[0]))
    file = tmp_path / "object_dictionary.eds"
    file.write_text(with_group(EDS.read_text()))
    with drive(6, file) as channel:
        monkeypatch.setenv("CAN_INTERFACE", "virtual")
        monkeypatch.setenv("CAN_CHANNEL", channel)
        found: dict[str, Any] = {}
        exec(program.replace("/path/to/object_dictionary.eds", file.as_posix()), found)
    assert [found[each] for each in ("device_name", "vendor_id", "speed", "val")] == ["Servo 100", 0, 0, 77]


# The calls of canopen's example for CiA 402, in their order; it ends where the example begins to print for ever.
PROGRAM_402 = """
import canopen

network = canopen.Network()
network.connect(interface="virtual", channel=CHANNEL, bitrate=1000000)
network.check()
node = canopen.BaseNode402(35, FILE)
network.add_node(node)

node.nmt.state = "RESET COMMUNICATION"
node.nmt.wait_for_bootup(15)
seen = [node.nmt.state, [error.raw for error in node.sdo[0x1003].values()], [network[each] for each in network]]

for index, value in ((0x1006, 1), (0x1014, 163)):
    node.sdo[index].raw = value
node.sdo[0x1003][0].raw = 0
network.sync.start(0.1)
node.load_configuration()
node.setup_402_state_machine()
seen += [node.sdo[0x1008].raw, node.sdo[0x1018][1].raw]
node.state = "SWITCH ON DISABLED"

node.tpdo.read()
node.tpdo[1].clear()
node.tpdo[1].add_variable("Statusword")
node.tpdo[1].add_variable("Velocity actual value")
node.tpdo[1].trans_type = 1
node.tpdo[1].event_timer = 0
node.tpdo[1].enabled = True
node.tpdo.save()

node.rpdo.read()
node.rpdo[1]["Controlword"].raw = 0x80
node.rpdo[1].transmit()
node.rpdo.export(DBC)
for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
    node.state = state
    seen.append(node.state)

node.nmt.state = "OPERATIONAL"
node.nmt.start_node_guarding(0.01)
seen += [node.tpdo[1].wait_for_reception() is not None, node.tpdo[1]["Velocity actual value"].phys]
seen.append(hex(node.sdo[0x6041].raw & 0x6F))

for node_id in network:
    network[node_id].nmt.state = "PRE-OPERATIONAL"
    network[node_id].nmt.stop_node_guarding()
network.sync.stop()
network.disconnect()
"""


def test_a_program_like_canopens_example_for_drives_runs(tmp_path: Path) -> None:
    with drive(35, EDS) as channel:
        found: dict[str, Any] = {"CHANNEL": channel, "FILE": str(EDS), "DBC": tmp_path / "database.dbc"}
        exec(with_our_import(PROGRAM_402), found)
    state, errors, nodes, *rest = found["seen"]
    assert (state, errors, nodes) == ("PRE-OPERATIONAL", [], [found["node"]])
    states = ["READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"]
    assert rest == ["Servo 100", 0, *states, True, 0, "0x27"]
    assert "SG_ controlword" in (tmp_path / "database.dbc").read_text()


# One name after the other, in simulated time


def sent_by_rpdo(network: SimulatedNetwork) -> object:
    network[5].nmt.state = "OPERATIONAL"
    network[5].rpdo[3]["Controlword"].raw = 6
    network[5].rpdo[3]["Target velocity"].phys = -70
    network[5].rpdo[3].transmit()
    network.sleep(0.1)
    return network[5]["Target velocity"].value


def sent_again(network: SimulatedNetwork) -> object:
    network[5].nmt.state = "OPERATIONAL"
    network.sleep(0.1)
    rpdo, sent = network[5].rpdo[3], list[str]()
    network.simulation.observers.append(lambda _, frame: sent.append(frame.data.hex()))
    rpdo.start(0.1)
    network.sleep(0.05)
    rpdo["Target velocity"].raw = 5
    rpdo.update()
    network.sleep(0.05)
    rpdo.stop()
    network.sleep(0.5)
    return [*dict.fromkeys(sent)]


def switched_off(network: SimulatedNetwork) -> object:
    tpdo = network[5].tpdo[1]
    tpdo.enabled = False
    tpdo.save()
    return tpdo.enabled, network[5][0x1800, 1].raw, [each.name for each in network[5].pdo if each.name == "TPDO1"]


def remapped(network: SimulatedNetwork) -> object:
    tpdo = network[5].tpdo[2]
    tpdo.add_variable(0x6077)
    tpdo.inhibit_time = 20
    network[5].tpdo.save()
    return tpdo.names, network[5][0x1801, 3].raw, tpdo.inhibit_time


def called_back(network: SimulatedNetwork) -> object:
    seen: list[object] = []
    network[5].tpdo[1].add_callback(lambda pdo: seen.append((pdo.name, pdo[0x6041].raw, pdo.timestamp is not None)))
    network.subscribe(0x185, lambda cob_id, data, _: seen.append((cob_id, len(data))))
    network[5].nmt.state = "OPERATIONAL"
    network.sync.transmit()
    network.sleep(0.01)
    network.unsubscribe(0x185)
    network.sync.transmit()
    network.sleep(0.01)
    return seen


def unsubscribed_one_of_two(network: SimulatedNetwork) -> object:
    seen: list[str] = []
    both = [lambda *_, name=name: seen.append(name) for name in ("first", "second")]
    for each in both:
        network.subscribe(0x185, each)
    network.unsubscribe(0x185, both[0])
    network[5].nmt.state = "OPERATIONAL"
    network.sync.transmit()
    network.sleep(0.01)
    return seen


def scaled(network: SimulatedNetwork) -> object:
    network[5].tpdo[2].add_variable("Supply temperature")
    network[5].tpdo.save()
    signal = network[5].tpdo[2]["Supply temperature"]
    signal.raw = 215
    said = [signal.phys, signal.raw]
    signal.phys = 30
    return [*said, signal.phys, signal.raw]


def heard(network: SimulatedNetwork) -> object:
    network[5]["Producer heartbeat time"].raw = 100
    network.nmt.state = "STOPPED"
    return network[5].nmt.state, network[5].nmt.wait_for_heartbeat(), network.scanner.nodes


def guarded(network: SimulatedNetwork) -> object:
    asked: list[can.Message] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network.master.bus, "send", asked.append)
        network[5].nmt.start_node_guarding(0.1)
        network[5].nmt.stop_node_guarding()
    return [(each.arbitration_id, each.is_remote_frame, each.dlc) for each in asked]


def booted(network: SimulatedNetwork) -> object:
    network[5].nmt.send_command(130)
    network.sleep(1.0)  # it has booted, and sent a heartbeat, before anybody waits
    network[5].nmt.wait_for_bootup()
    with pytest.raises(HeartbeatLost, match="no heartbeat of node 5 within 100 ms"):
        network[5].nmt.wait_for_bootup(0.1)
    return network[5].nmt.state


@pytest.mark.parametrize(
    ("ask", "answer"),
    [
        (lambda n: n[5].sdo is n[5], True),
        (lambda n: n.nodes[5].id, 5),
        (lambda n: (n.keys(), n.values() == [n[5]], n.items() == [(5, n[5])]), ([5], True, True)),
        (lambda n: (5 in n, 6 in n, n[5] in n), (True, False, True)),
        (lambda n: n[5].object_dictionary is n[5].od, True),
        (lambda n: n[n[5]] is n[5], True),
        (lambda n: n[5].sdo.upload(0x1018, 1), b"\0\0\0\0"),
        (lambda n: (n[5].sdo.download(0x6081, 0, b"\x05\0\0\0"), n[5].sdo[0x6081].data), (None, b"\x05\0\0\0")),
        (lambda n: n[5].sdo.open(0x1008).read(), b"Servo 100"),
        (lambda n: n[5].sdo["Supply temperature"].phys, 21.5),
        (lambda n: n[5].sdo["Supply temperature"].desc, "21.5 degC"),
        (lambda n: n[5].sdo[0x1018].keys(), [1, 2, 3, 4]),
        (lambda n: n[5].sdo[0x1018].values()[0].raw, 0),
        (lambda n: [*n[5].tpdo], [1, 2, 3, 4]),
        (lambda n: n[5].tpdo[1] is n[5].pdo["TPDO1"], True),
        (lambda n: n[5].pdo[0x1A00] is n[5].pdo[0x1800] is n[5].pdo.tx[1], True),
        (lambda n: n[5].pdo.rx[1].trans_type, 255),
        (lambda n: n[5].tpdo["Velocity actual value"].name, "Velocity actual value"),
        (sent_by_rpdo, -70),
        (sent_again, ["000000000000", "05", "000005000000"]),
        (switched_off, (False, 0x8000_0185, [])),
        (remapped, (["Statusword", "Position actual value", "Torque actual value"], 20, 20)),
        (called_back, [("TPDO1", 0x240, True), (0x185, 6), ("TPDO1", 0x240, True)]),
        (unsubscribed_one_of_two, ["second"]),
        (scaled, [21.5, 215, 30, 300]),
        (heard, ("UNKNOWN", "STOPPED", [5])),
        (guarded, [(0x705, True, 1)]),
        (booted, "PRE-OPERATIONAL"),
        (lambda n: n[5].tpdo[1].wait_for_reception(0.1), None),
        (lambda n: n.add_node(7, EDS).id, 7),
        (lambda n: (n.scanner.search(10), n.scanner.nodes, n.scanner.reset(), n.scanner.nodes), (None, [5], None, [])),
    ],
)
def test_a_name_of_canopens_is_a_face_of_ours(ask: Callable[[SimulatedNetwork], object], answer: object) -> None:
    with servo() as network:
        assert ask(network) == answer


@pytest.mark.parametrize(
    ("ask", "kind", "text"),
    [
        (lambda n: setattr(n[5].nmt, "state", "SLEEPY"), UnknownName, "unknown NMT state 'SLEEPY'; known: OPERATIONAL"),
        (lambda n: n[5].tpdo[9], UnknownName, "unknown TPDO 9; known: 1, 2, 3, 4"),
        (lambda n: n[5].tpdo["Controlword"], UnknownName, "unknown object of a TPDO 'Controlword'"),
        (lambda n: n[5].pdo[0x1234], UnknownName, "unknown PDO of node 5 '0x1234'"),
        (
            lambda n: n.add_node(5, upload_eds=True),
            EurobotError,
            "node 5 keeps no EDS of itself in plain text (0x1021)",
        ),
        (lambda n: n.send_periodic(0x100, b"", 0), LocalError, "the period is a time longer than 0 s, not 0 s"),
        (lambda n: n[5].sdo.upload(0x5FFF, 0), SdoAbortedError, "node 5 refused to read 0x5FFF:0"),
        (lambda n: n.add(6).sdo.upload(0x1000, 0), SdoCommunicationError, "no answer from node 6"),
        (lambda _: RemoteNode(5, EDS).sdo[0x1000].raw, EurobotError, "the network is not open: `connect`"),
        (lambda _: Network().scan(), EurobotError, "the network is not open: `connect`"),
    ],
)
def test_an_error_is_one_line(ask: Callable[[SimulatedNetwork], object], kind: type[EurobotError], text: str) -> None:
    with servo() as network, pytest.raises(kind, match=re.escape(text)):
        ask(network)


def test_a_field_has_one_name_in_show_page_and_python() -> None:
    """`speed`, as `show` and the page call it, and `Motor.Speed`, as the file does, are the same everywhere."""
    with simulated(DOCS / "motor.eds", node_id=5) as network:
        network[5].nmt.state = "OPERATIONAL"
        tpdo = network[5].pdo["TPDO1"]
        assert tpdo["speed"] is tpdo["Motor.Speed"] is tpdo[0]
        reading = tpdo.wait()
        assert reading["speed"] == reading["Motor.Speed"] == reading.values["speed"] == reading.read("speed", int) == 0
        network[5].pdo["RPDO1"].transmit({"target_speed": 70})
        network.sleep(0.01)
        assert network[5]["Motor.Target speed"].value == 70
    binding = Protocol.of(DOCS / "motor.eds", node_id=5).binding("motor.RPDO1")
    assert parse(binding, ["Motor.Target speed=7"]) == parse(binding, ["target_speed=7"])
    with pytest.raises(UnknownName, match="unknown field of motor\\.RPDO1 'sped'; known: target_speed"):
        parse(binding, ["sped=7"])


# Drives


@pytest.fixture
def node() -> Iterator[BaseNode402]:
    with SimulatedNetwork() as network:
        network.simulate(SimulatedDrive(SERVO))
        made = BaseNode402(5, SERVO)
        network.add_node(made)
        yield made


def test_a_drive_is_brought_to_its_states(node: BaseNode402) -> None:
    for state in ("OPERATION ENABLED", "SWITCHED ON", "READY TO SWITCH ON", "SWITCH ON DISABLED"):
        node.state = state
        assert (node.state, node.powerstate_402.state) == (state, state)
    with pytest.raises(LocalError, match="no command brings a drive to Fault"):
        node.state = "FAULT"
    with pytest.raises(UnknownName, match="unknown state of a drive 'ENABLED'; did you mean"):
        node.state = "ENABLED"


def test_a_drive_has_modes_and_finds_home(node: BaseNode402) -> None:
    node.op_mode = "PROFILED VELOCITY"
    assert (node.op_mode, node.is_op_mode_supported("PROFILED VELOCITY")) == ("PROFILED VELOCITY", True)
    assert node.homing()
    with pytest.raises(UnknownName, match="unknown mode of operation 'SPEED'"):
        node.op_mode = "SPEED"


def test_a_drive_is_freed_of_its_fault(node: BaseNode402) -> None:
    node.state = "OPERATION ENABLED"
    node[0x6065].raw, node[0x6066].raw, node[0x6083].raw = 1, 0, 2**32 - 1  # it cannot follow
    node[0x607A].raw = 8000
    node.controlword = 0x1F
    node._node.master.pump(1.0)
    assert node.is_faulted()
    assert not node.homing(timeout=5.0)
    node.reset_from_fault()
    assert node.state == "OPERATION ENABLED"
    assert node.statusword & 0x6F == 0x27


# What goes another way than one answer


@pytest.mark.long
def test_a_node_gives_its_own_eds() -> None:
    with simulated(LIFT) as network:
        assert network.add_node(2, upload_eds=True)["Motion.Maximum speed"].raw == 800


def test_states_of_lss_are_the_standards() -> None:
    with live_servos(5) as channel, Network().connect(interface="virtual", channel=channel) as network:
        network.check()
        assert [*LssState] == [network.lss.WAITING_STATE, network.lss.CONFIGURATION_STATE]
        assert network.lss.fast_scan() == (False, None)
        assert not network.lss.send_switch_state_selective(1, 2, 3, 4)


# Opening and closing


def test_arguments_have_the_names_of_canopens() -> None:
    bus = open_bus(new_channel())
    with Network(bus=bus) as network, Network(bus) as other:
        assert network.connect() is network
        assert (network.bus, other.bus) == (bus, bus)
        node = RemoteNode(node_id=5, object_dictionary=EDS)
        assert network.add_node(node).sdo[0x1000].name == "Device type"
    bus.shutdown()


def test_a_network_without_an_interface_says_what_to_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.client.network.is_named", bool)
    for opened in (Network.open, Network().connect):
        with pytest.raises(LocalError, match='which bus\\? Name interface and channel, such as "socketcan"'):
            opened()


def threads_of(channel: str) -> list[str]:
    return [each.name for each in threading.enumerate() if channel in each.name]


def test_a_network_that_connects_again_has_one_bus_and_its_functions() -> None:
    heard: list[int] = []
    node = RemoteNode(5, EDS)
    node.nmt.add_heartbeat_callback(heard.append)
    network = Network()
    network.add_node(node)
    channels = [new_channel(), new_channel()]
    for channel in channels:
        network.connect(interface="virtual", channel=channel)
    assert [bool(threads_of(channel)) for channel in channels] == [False, True]
    network._receive(0x705, b"\x05", 0.0)
    network.disconnect()
    assert (network.bus, threads_of(channels[1]), heard) == (None, [], [5])


def test_a_node_that_has_moved_to_another_network_outlives_the_first() -> None:
    with servo() as network:
        first = Network.open("virtual", new_channel())
        node = first.add(5, EDS)
        network.add_node(node)
        first.close()
        assert node["Manufacturer device name"].value == "Servo 100"


@pytest.mark.parametrize(
    "call",
    [
        lambda n: n[5].sdo[0x1000].raw,
        lambda n: n[5].pdo["TPDO1"].wait(),
        lambda n: n[5].emcy.wait(),
        lambda n: n.sync(0.1),
        lambda n: n.send(0x80),
        lambda n: n.scan(),
        lambda n: n.check(),
        lambda n: n.__enter__(),
        lambda n: n[5].pdo["RPDO1"].start(0.1),
        lambda n: next(n.watch(5)),
    ],
)
def test_a_call_after_the_end_says_that_the_network_is_closed(call: Callable[[Network], object]) -> None:
    with Network.open("virtual", new_channel()) as network:
        network.add(5, EDS)
    with pytest.raises(StateError, match="the network is closed"):
        call(network)


@pytest.mark.parametrize(
    "wait",
    [
        lambda n: next(iter(n[5].pdo["TPDO1"])),
        lambda n: n[5].pdo["TPDO1"].wait(60),
        lambda n: n[5].emcy.wait(timeout=60),
        lambda n: n[5].emcy.wait(0x8210, 60),
        lambda n: next(n.watch(6, within=60)),
        lambda n: n[5].heartbeat(60),
        lambda n: n.sleep(60),
    ],
)
def test_a_thread_that_waits_is_woken_when_the_network_is_closed(wait: Callable[[Network], object]) -> None:
    with ThreadPoolExecutor(1) as pool:
        with Network.open("virtual", new_channel()) as network:
            network.add(5, EDS)
            waiting = Event()
            network.master.take_in = noting(waiting, network.master.take_in)  # type: ignore[method-assign]
            waits = pool.submit(wait, network)
            assert waiting.wait(30)
        with pytest.raises(StateError, match="the network is closed"):
            waits.result(30)


def noting(event: Event, take_in: Callable[..., Any]) -> Callable[..., Any]:
    def noted(*arguments: Any) -> Any:
        event.set()
        return take_in(*arguments)

    return noted


# Arguments that cannot be


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            lambda n: setattr(n[5]["Profile velocity"], "bytes", "abc"),
            "Profile velocity = 'abc' is not allowed; allowed: bytes",
        ),
        (lambda n: n[5].sdo.download(0x6081, 0, "abcd"), "= 'abcd' is not allowed; allowed: bytes"),
        (lambda n: n[5].program("x"), "a program is bytes, not 'x'"),
        (lambda n: n[5][1.5], "unknown object 1.5; known: a name, an index 0..0xFFFF"),
        (lambda n: n[5][0x12345], "unknown object 74565; known: a name, an index 0..0xFFFF"),
        (lambda n: n[5].sdo.upload(0x1018, 300), "unknown object (4120, 300); known: a name"),
        (lambda n: n[5].pdo[None], "unknown PDO of node 5 None; known: RPDO1"),
        (lambda n: n[5].pdo["TPDO1"][None], "unknown object of TPDO1 None; known: Statusword"),
        (lambda n: n[5].pdo["RPDO1"].transmit(5), "RPDO1: values = 5 is not allowed; allowed: a value for each name"),
        (lambda n: n.sync("fast"), "a time is a number of seconds, not 'fast'"),
        (lambda n: n[5].pdo["TPDO1"].wait("x"), "a time is a number of seconds, not 'x'"),
        (lambda n: setattr(n[5].sdo, "RESPONSE_TIMEOUT", "x"), "a time is a number of seconds, not 'x'"),
        (lambda n: n[5].drive402.move_to("4000"), "a position is a whole number, not '4000'"),
        (lambda n: setattr(n[5].drive402, "velocity", 1.5), "a velocity is a whole number, not 1.5"),
        (lambda n: n.send("hello world"), "frame: identifier = 'hello world' is not allowed; allowed: 0..0x7FF"),
        (lambda n: n.send_message(0x100, bytes(9)), "is not allowed; allowed: up to 8 bytes"),
        (lambda n: n.send_message(0x100, "abc"), "frame 0x100: data = 'abc' is not allowed; allowed: up to 8 bytes"),
        (lambda n: n.add("5", EDS), "node-ID '5' is not in 1..127"),
        (lambda n: n.subscribe(0x185, None), "None is no function, and cannot be called"),
        (lambda n: n[5].emcy.on(5), "5 is no function, and cannot be called"),
        (lambda n: n[5].nmt.add_heartbeat_callback(None), "None is no function, and cannot be called"),
    ],
)
def test_a_wrong_argument_is_refused_in_one_line(call: Callable[[Any], object], text: str) -> None:
    with servo() as network, pytest.raises(LocalError, match=re.escape(text)):
        call(network)


def test_a_list_of_numbers_is_data() -> None:
    with servo() as network:
        sent: list[bytes] = []
        network.simulation.observers.append(lambda _, frame: sent.append(frame.data))
        network.send_message(0x300, [1, 2])  # type: ignore[arg-type]
        network.sleep(0.01)
        assert sent == [b"\1\2"]
