"""A network by name: objects, states, emergencies, PDOs, configuration; errors name node, object and cause."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Mapping
from fractions import Fraction
from itertools import islice
from logging import DEBUG, INFO
from math import inf, nan
from pathlib import Path
from typing import Any, ClassVar

import can
import canopen
import pytest

from eurobot_od.client.network import AsyncNetwork, Network, NetworkLss, SimulatedNetwork, simulated
from eurobot_od.client.remote_device import AsyncRemoteDevice, NodeNmt, RemoteDevice
from eurobot_od.client.watch import NodeChange
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.simulated import ObjectName, SimulatedDevice
from eurobot_od.errors import (
    Cause,
    ConfigurationError,
    DictionaryError,
    DriveError,
    EurobotError,
    FieldError,
    HeartbeatLost,
    LocalError,
    NoAnswer,
    NodeRefused,
    Refused,
    RemoteError,
    UnknownName,
)
from eurobot_od.library.library import Library
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import Range
from eurobot_od.od.values import UNSIGNED32
from eurobot_od.pdo.protocol import Protocol
from tests.client.lss_slave import WAITING, LssStation
from tests.client.peers import new_channel, open_bus
from tests.client.servo import DCF, DOCS, EDS, SERVO, live_servos, servo
from tests.client.wired import wired
from tests.eds_text import DEVICE_TYPE, record, variable

VELOCITY = "Velocity actual value"


# Objects


@pytest.mark.parametrize("key", ["Profile velocity", "profile velocity", "0x6081", "6081h", 0x6081, (0x6081, 0)])
def test_an_object_is_found_by_name_and_by_number(key: str) -> None:
    with servo() as network:
        assert network[5][key].value == 1000


WRITTEN = [
    # (what a program writes, what the device then has)
    (1200, 1200),
    ("1200", 1200),
    ("1200 rpm", 1200),  # with the unit that the file gives
    ("0x4B0", 1200),
]


# COB-IDs of requests and answers in the file of node 5: DefaultValue and ParameterValue of either; where it is then.
SERVERS = [
    (("0x650", ""), ("0x5D5", ""), (0x650, 0x5D5)),
    (("0x605", "0x641"), ("0x585", "0x5C1"), (0x641, 0x5C1)),  # those of node 65, but set for this device
    (("0x605", "0x600"), ("0x585", "0x580"), (0x605, 0x585)),  # the node-ID is forgotten
    (("$NODEID+0x600", "0x6A0"), ("$NODEID+0x580", "0x6A1"), (0x6A0, 0x6A1)),
    (("$NODEID+0x600", ""), ("$NODEID+0x580", "0x5D5"), (0x605, 0x5D5)),
    (("0x601", ""), ("0x581", ""), (0x605, 0x585)),  # written for node 1
    (("0x600", ""), ("0x580", ""), (0x605, 0x585)),  # the node-ID is forgotten
    (("0x80000650", ""), ("0x800005D5", ""), (0x605, 0x585)),  # off: the default one is always there
    (("", ""), ("", ""), (0x605, 0x585)),
]


@pytest.mark.parametrize(("requests", "answers", "server"), SERVERS)
def test_a_file_s_sdo_server_is_where_the_device_serves_and_the_master_asks(
    requests: tuple[str, str], answers: tuple[str, str], server: tuple[int, int]
) -> None:
    members = (
        variable(f"1200sub{sub}", f"COB-ID {sub}", "UNSIGNED32", default, f"ParameterValue={own}\n" if own else "")
        for sub, (default, own) in enumerate((requests, answers), start=1)
    )
    text = DEVICE_TYPE + record(0x1200, "SDO server", (0, "UNSIGNED8", "2")) + "".join(members)
    with SimulatedNetwork() as network:
        device = network.simulate(SimulatedDevice(Dictionary.read(text.encode(), Path("moved.eds"), 5)))
        assert network.master.sdo_server(5) == server
        assert network.master.sdo_server(6) == (0x606, 0x586)
        assert tuple(device[0x1200, sub].value for sub in (1, 2)) == server


def test_objects_of_a_device_with_a_moved_sdo_server_are_read_and_written() -> None:
    said = [variable(f"1200sub{sub}", "COB-ID", "UNSIGNED32", cob_id) for sub, cob_id in ((1, "0x650"), (2, "0x5D5"))]
    head = record(0x1200, "SDO server", (0, "UNSIGNED8", "2")) + "".join(said)
    text = DEVICE_TYPE + head + variable("2000", "Speed", "UNSIGNED16", "7")
    device = SimulatedDevice(Dictionary.read(text.encode(), Path("moved.eds"), 5))
    with SimulatedNetwork() as network:
        moved = network.simulate(device)
        moved["Speed"].value = 9
        assert (moved["Speed"].value, device.value("Speed")) == (9, 9)


@pytest.mark.parametrize(("value", "raw"), WRITTEN)
def test_a_value_is_written_as_a_number_or_as_a_person_writes_it(value: object, raw: int) -> None:
    with servo() as network:
        network[5]["Profile velocity"].value = value
        assert network.devices[5].value("Profile velocity") == raw


def test_a_factor_is_between_value_and_raw(monkeypatch: pytest.MonkeyPatch) -> None:
    with servo(given={"Supply temperature": -40}) as network:
        temperature = network[5]["Supply temperature"]
        assert (temperature.value, temperature.raw, temperature.text) == (-4.0, -40, "-4 degC")
        temperature = network[5]["Brake delay"]
        monkeypatch.setattr(temperature.od, "factor", 0.001)
        temperature.value = 0.25
        assert (temperature.raw, temperature.bytes, temperature.limits) == (250, b"\xfa\0", Range(0, 1000))


def test_a_word_of_canopen_s_value_descriptions_is_a_value(monkeypatch: pytest.MonkeyPatch) -> None:
    with servo() as network:
        mode = network[5]["Modes of operation"]
        monkeypatch.setattr(mode.od, "value_descriptions", {3: "profile velocity"})
        mode.value = "Profile Velocity"
        assert (mode.raw, mode.text) == (3, "profile velocity")


def test_a_record_has_members_by_name_and_number() -> None:
    with servo() as network:
        control = network[5]["Current control"]
        assert [each.name for each in control] == ["Current control.P gain", "Current control.I gain"]
        assert control["P gain"].value == control[1].value == network[5]["Current control.P gain"].value == 1200
        with pytest.raises(LocalError, match="is not one object but a record of"):
            _ = control.value
        with pytest.raises(UnknownName, match="unknown member of 0x2010 'D gain'"):
            control["D gain"]


def test_without_a_file_objects_are_numbers_and_bytes() -> None:
    with servo() as network:
        drive = network.add(5)
        assert (drive["0x6081"].value, drive[0x1018, 4].bytes) == (1000, b"\1\0\0\0")
        drive[0x6081].bytes = UNSIGNED32.write(77)
        assert drive[0x6081].value == 77
        with pytest.raises(LocalError, match="node 5 was added without an EDS"):
            _ = drive.od
        with pytest.raises(FieldError, match="bytes: no file says its type"):
            drive[0x6081].value = 77


def test_canopen_s_dictionary_goes_there_and_back() -> None:
    with servo() as network:
        objects = network[5].od
        assert isinstance(objects, canopen.ObjectDictionary)
        again = network.add(5, objects)
        assert again["Profile velocity"].value == 1000
        assert again.pdo["TPDO1"].names == network[5].pdo["TPDO1"].names


WRONG: list[tuple[Callable[[RemoteDevice], object], type[EurobotError], str]] = [
    # (what a program does, class of the error, what it says)
    (lambda drive: drive["Profil velocity"], UnknownName, "did you mean Profile velocity"),
    (lambda drive: drive["Profile velocity"].write(0), FieldError, r"0x6081:0: Profile velocity = 0 .* 1\.\.12000"),
    (lambda drive: drive["Profile velocity"].write("fast"), FieldError, "'fast' is not allowed; allowed: an integer"),
    (lambda drive: drive["Statusword"].write(1), NodeRefused, "node 5 refused to write 0x6041:0 Statusword: .* read"),
    (lambda drive: drive.pdo["TPDO9"], UnknownName, "unknown PDO of node 5 'TPDO9'"),
    (lambda drive: drive.pdo["TPDO1"]["Speed"], UnknownName, "unknown object of TPDO1 'Speed'; known: Statusword"),
    (lambda drive: drive.pdo["TPDO1"].transmit({}), LocalError, "TPDO1 of node 5 is sent by the node"),
    (lambda drive: drive.pdo["RPDO1"].transmit({}), FieldError, "RPDO1: Controlword = None is not allowed"),
    (
        lambda drive: drive.pdo["TPDO1"].wait(0.1),
        NoAnswer,
        r"no TPDO1 of node 5 within 100 ms after the last one: it comes only with SYNC \(`network.sync`\), from a node",
    ),
    (lambda drive: drive.configure(DOCS / "motor.eds"), DictionaryError, "motor.eds: a DCF is needed, which names"),
    (lambda drive: drive.network.watch(200), LocalError, r"node-ID 200 is not in 1\.\.127"),
]


@pytest.mark.parametrize(("call", "kind", "text"), WRONG)
def test_errors_name_node_object_and_cause(
    call: Callable[[RemoteDevice], object], kind: type[EurobotError], text: str
) -> None:
    with servo() as network, pytest.raises(kind, match=text):
        call(network[5])


def test_a_refusal_and_a_silence_have_node_and_object_as_data() -> None:
    with servo() as network:
        with pytest.raises(NodeRefused) as refused:
            network[5]["Statusword"].value = 1
        assert (refused.value.code, refused.value.object) == (0x06010002, (5, (0x6041, 0), "Statusword"))
        with pytest.raises(NoAnswer, match="no answer from node 6 within 500 ms after read 0x6041:0 Statusword") as no:
            _ = network.add(6, EDS)["Statusword"].value
        assert no.value.object == (6, (0x6041, 0), "Statusword")


def test_a_number_is_taken_as_the_integer_that_it_is() -> None:
    with servo() as network:
        velocity, temperature = network[5]["Profile velocity"], network[5]["Current control.P gain"]
        for value in (1200, 1200.0, Fraction(1200)):
            velocity.value = 5
            velocity.value = value
            assert velocity.value == 1200
        for wrong in (True, 1200.5, nan, inf, 1e30, None):
            with pytest.raises(FieldError, match="is not allowed"):
                velocity.value = wrong
            with pytest.raises(FieldError, match="is not allowed"):
                temperature.value = wrong
        with pytest.raises(FieldError, match=r"1200\.5 is not allowed; allowed: an integer"):
            velocity.value = 1200.5
        with pytest.raises(FieldError, match="Controlword = True is not allowed; allowed: a number"):
            network[5].pdo["RPDO1"].transmit({"Controlword": True})


def test_a_silence_is_explained_by_what_was_heard() -> None:
    with servo() as network:
        network[5].nmt.stop(within=1.0)
        with pytest.raises(NoAnswer) as stopped:
            _ = network[5]["Statusword"].value
        with pytest.raises(NoAnswer) as absent:
            _ = network.add(6)["0x1000"].value
    assert stopped.value.__notes__ == ["its last heartbeat said stopped: a stopped node answers no SDO"]
    assert absent.value.__notes__ == ["node 5 is on this bus, node 6 is not"]


def test_a_session_is_logged_by_its_services(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("DEBUG", "eurobot_od")
    with servo() as network:
        drive = network[5]
        drive["Profile velocity"].value = 1500
        with pytest.raises(NodeRefused):
            drive["Statusword"].value = 1
        drive.nmt.start(within=1.0)
        drive.pdo["RPDO1"].transmit({"Controlword": 6})
        with network.sync(period=0.01):
            drive.pdo["TPDO1"].wait()
        drive.receive(0x085, b"\x10\x82\x11\0\0\0\0\0", 0.0)
        network.lss.find()
    said = {name: [(level, text) for logger, level, text in caplog.record_tuples if logger == name] for name in LOGGERS}
    assert said["eurobot_od.sdo"] == [
        (DEBUG, "node 5: write 0x6081:0 Profile velocity: 4 bytes, dc 05 00 00"),
        (
            INFO,
            "node 5: write 0x6041:0 Statusword: the node aborts: Attempt to write a read only object (0x06010002)",
        ),
    ]
    assert said["eurobot_od.nmt"][:3] == [
        (INFO, "node 5: boot-up"), (INFO, "node 5: command start"), (INFO, "node 5: operational"),
    ]  # fmt: skip
    assert (DEBUG, "node 5: RPDO1 is sent: {'controlword': 6}") in said["eurobot_od.pdo"]
    assert any("TPDO1 heard: TPDO1(statusword=" in text for _, text in said["eurobot_od.pdo"])
    assert said["eurobot_od.emcy"] == [(INFO, str(drive.emcy.last))]
    assert said["eurobot_od.lss"][0] == (DEBUG, "switch global: 04 00 00 00 00 00 00 00")
    assert {each.name for each in caplog.records} <= LOGGERS


def test_a_bus_that_opens_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "eurobot_od.live")
    with Network.open("virtual", "logged"):
        assert "is open" in caplog.text


LOGGERS = {f"eurobot_od.{name}" for name in ("sdo", "nmt", "pdo", "emcy", "lss")}
"""What a session with one node says something to; nothing is said at the root."""


# States and emergencies


def test_nmt_commands_are_followed_and_heartbeats_tell() -> None:
    with servo() as network:
        drive = network[5]
        drive.nmt.start(within=1.0)
        assert [drive.state, drive.heartbeat()] == [NmtState.OPERATIONAL] * 2
        drive.nmt.enter_pre_operational(within=1.0)
        drive.nmt.reset()
        assert drive.state == NmtState.INITIALISING
        network.nmt.stop()
        assert drive.state is None  # what it said before counts no more
        assert drive.heartbeat() is NmtState.STOPPED
        drive.nmt.reset()
        drive["Producer heartbeat time"].value = 0
        with pytest.raises(HeartbeatLost, match="no heartbeat of node 5 within 300 ms"):
            drive.heartbeat(within=0.3)
        with pytest.raises(HeartbeatLost):
            drive.nmt.start(within=0.3)


def test_a_lost_node_is_noticed() -> None:
    with servo() as network:
        watching = network.watch(5, within=0.5)
        assert next(watching).change is NodeChange.FOUND
        station = network.stations[5]
        network.simulation.freeze(station, network.simulation.now + 1.0)
        assert [each.change for each in islice(watching, 2)] == [NodeChange.LOST, NodeChange.BACK]
        watching.close()


def test_an_exception_of_a_simulated_device_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    class Faulty(SimulatedDevice):
        READERS: ClassVar = {VELOCITY: lambda _: 1 / 0}

    with simulated(Faulty(SERVO)) as network, pytest.raises(NoAnswer):
        network[5][VELOCITY].read()
    assert [record.exc_info[0] for record in caplog.records if record.exc_info] == [ZeroDivisionError]


def test_emergencies_are_told_and_remembered() -> None:
    with servo() as network:
        drive, told = network[5], list[str]()
        drive.emcy.on(lambda each: told.append(str(each)))
        network.send(0x205, b"\0")  # too short for RPDO 1
        drive.nmt.start()
        network.send(0x205, b"\0")
        emergency = drive.emcy.wait()
        assert told[0].startswith("node 5: 0x8210 pdo too short (error register 0x11")
        assert [each.code for each in drive.emcy.active] == [emergency.code] == [0x8210]
        assert drive.emcy.history().entries[0].code == 0x8210
        drive.emcy.clear()
        assert drive.emcy.history().entries == []


def test_an_emergency_is_awaited_by_its_error_code() -> None:
    with simulated(MOTOR_EDS, node_id=5) as network:
        emcy = network[5].emcy
        for code in (0x1000, 0x8130, 0x8210):
            network.devices[5].raise_error(code, str(code))
        assert emcy.wait(0x8130).code == 0x8130
        with pytest.raises(NoAnswer, match=r"^no emergency message 0x8130 of node 5 within 500 ms after the last one$"):
            emcy.wait(0x8130, timeout=0.5)
        with pytest.raises(LocalError, match=r"^2\.5 is not an error code; write wait\(timeout=2\.5\) for seconds$"):
            emcy.wait(2.5)  # type: ignore[arg-type]


# PDOs


def test_a_pdo_is_read_as_the_device_has_it_mapped_after_a_configuration() -> None:
    with servo() as network:
        drive = network[5]
        assert drive.pdo["TPDO1"].names == ["Statusword", VELOCITY]
        drive.configure(DCF)
        assert drive.pdo["TPDO1"].names == ["Statusword", VELOCITY, "Torque actual value"]
        drive.nmt.start()
        with network.sync(period=0.01):
            first, second = islice(drive.pdo["TPDO1"], 2)
        assert second.time - first.time == pytest.approx(0.01, abs=0.001)
        assert first.values == {"Statusword": 0x240, VELOCITY: 0, "Torque actual value": 0}
        assert drive.pdo["TPDO1"].last == second
        assert second["Statusword"] == 0x240


def test_a_pdo_that_the_device_had_mapped_so_before_is_read_so_too() -> None:
    with servo() as network:
        network[5].configure(DCF)
        again = network.add(5, SERVO)
        assert again.configure(DCF).changed == 0
        assert again.pdo["TPDO1"].names == ["Statusword", VELOCITY, "Torque actual value"]


def test_a_mapping_that_is_written_as_an_object_or_by_somebody_else_is_followed() -> None:
    with servo() as network:
        drive, other = network[5], network.add(5)
        pdo = drive.pdo["TPDO1"]
        for key, value in (((0x1800, 1), 0x80000185), ((0x1A00, 0), 0), ((0x1A00, 1), 0x60770010), ((0x1A00, 0), 1)):
            drive[key].value = value
        assert "TPDO1" not in [each.name for each in drive.pdo]
        drive[0x1800, 1].value = 0x185
        assert drive.pdo["TPDO1"] is pdo
        assert pdo.names == ["Torque actual value"]
        other[0x1801, 1].bytes = UNSIGNED32.write(0x80000285)
        again = network.add(5, SERVO)
        assert "TPDO2" in [each.name for each in again.pdo]
        again.pdo.read()
        assert "TPDO2" not in [each.name for each in again.pdo]
        assert again.pdo["TPDO1"].names == ["Torque actual value"]


def test_one_value_of_a_pdo_has_callback_iterator_and_time() -> None:
    with servo() as network:
        drive, seen = network[5], list[tuple[float, int]]()
        signal = drive.pdo["TPDO1"][VELOCITY]
        signal.on(seen.append)
        drive.nmt.start()
        with network.sync(period=0.5):
            times = [time for time, _ in islice(signal, 3)]
        assert (
            [time for time, _ in seen]
            == times
            == [pytest.approx(times[0] + 0.5 * each, abs=0.001) for each in range(3)]
        )
        assert (signal.value, signal.count) == (0, 3)


def test_a_frame_too_short_for_its_mapping_is_no_reading() -> None:
    with servo() as network:
        pdo = network[5].pdo["TPDO1"]
        pdo.receive(b"\0\0", 0.0)
        assert pdo.last is None
        assert "2 bytes of data, expected 6" in str(pdo.refused)


def test_an_rpdo_is_sent_by_names() -> None:
    with servo() as network:
        drive = network[5]
        drive.nmt.start()
        drive.pdo["RPDO3"].transmit({"Controlword": 15, "Target velocity": -70})
        network.sleep(0.1)
        assert network.devices[5].value("Target velocity") == -70
        with pytest.raises(FieldError, match=r"RPDO4: target_torque = 2000 is not allowed"):
            drive.pdo["RPDO4"].transmit({"Target torque": 2000})


def test_a_function_that_fails_stops_neither_the_others_nor_the_network(caplog: pytest.LogCaptureFixture) -> None:
    with servo() as network:
        drive, seen = network[5], list[object]()
        drive.pdo["TPDO1"].on(lambda reading: reading["no such object"])
        drive.pdo["TPDO1"].on(seen.append)
        drive.nmt.start()
        with network.sync(period=0.1):
            assert len([*islice(drive.pdo["TPDO1"], 2)]) == len(seen) == 2
    assert "has failed" in caplog.text


# Configuration


def refuse(_device: SimulatedDevice, _value: int) -> None:
    raise Refused(Cause.VALUES, "1000 is enough")


def test_a_configuration_is_written_stored_and_verified_once() -> None:
    with servo() as network:
        drive = network[5]
        assert drive.difference(DCF).changes[0].thing.qualname == "Producer heartbeat time"
        done = drive.configure(DCF)
        assert (done.changed, done.stored, done.verified) == (5, True, True)
        assert drive["Profile velocity"].value == 1500
        assert drive.configure(DCF).changed == 0


def test_a_configuration_that_fails_says_what_is_written_and_what_is_left() -> None:
    with simulated(Stubborn(SERVO)) as network:
        drive = network[5]
        with pytest.raises(ConfigurationError, match="has its former values again") as failed:
            drive.configure(DCF)
        assert failed.value.written == ()
        assert "0x6081:0 Profile velocity" in failed.value.left
        assert drive["Producer heartbeat time"].value == 100


def test_a_configuration_that_cannot_be_taken_back_says_which_objects_have_changed() -> None:
    with servo() as network:
        drive = network[5]
        silence_after_heartbeat(network)
        with pytest.raises(ConfigurationError, match="node 5 is pre-operational; written and not stored") as failed:
            drive.configure(DCF)
        # the second may have come through: it is not known
        assert failed.value.written == ("0x1017:0 Producer heartbeat time", "0x2010:1 Current control.P gain")
        assert len(failed.value.left) == 3


class Stubborn(SimulatedDevice):
    """A device that takes no other profile velocity."""

    WRITERS: ClassVar[Mapping[ObjectName, Callable[[Any, Any], object]]] = {"Profile velocity": refuse}


def silence_after_heartbeat(network: SimulatedNetwork) -> None:
    """Lose the first write of 4 bytes and every request after it."""
    lost = False

    def disturb(_: float, frame: tuple[int, bytes]) -> tuple[float, ...]:
        nonlocal lost
        lost = lost or (frame[0] == 0x605 and frame[1][0] == 0x23)
        return () if lost and frame[0] == 0x605 else (0.0,)

    network.simulation.disturb = disturb


# Networks


def test_nodes_are_found_and_named() -> None:
    with simulated(EDS, EDS, node_id=8) as network:
        assert [each.node_id for each in network.scan(range(1, 20))] == [8, 9]
        assert network["servo"].node_id == 8
        assert [each.node_id for each in network] == [8, 9]
        with pytest.raises(UnknownName, match="unknown node 'sevro'; did you mean servo"):
            _ = network["sevro"]
        with pytest.raises(LocalError, match=r"node-ID 200 is not in 1\.\.127"):
            network.add(200)
        assert network[9].identity().serial == 1


def test_the_messages_of_a_network_are_a_protocol() -> None:
    with simulated(EDS, DOCS / "motor.eds", node_id=5) as network:
        assert {"servo.TPDO1", "motor.TPDO1"} <= {*Protocol.of(network).names()}
    assert Protocol.of(EDS, node_id=7).cob_id("servo.TPDO1") == 0x187
    assert Protocol.of(SERVO).names() == Protocol.of(str(EDS), 5).names()


def test_a_network_file_names_bus_and_nodes(tmp_path: Path) -> None:
    file = tmp_path / "network.yaml"
    file.write_text(f"nodes:\n  axis: {{file: {EDS}, node_id: 5}}\n")
    with live_servos(5) as channel, Network.load(file, "virtual", channel) as network:
        assert network["axis"]["Profile velocity"].value == 1000


def test_an_open_bus_and_a_canopen_network_are_shared_and_stay_open() -> None:
    with live_servos(5) as channel, open_bus(channel) as bus:
        with Network.open(bus) as network:
            assert network.add(5, SERVO)["Profile velocity"].value == 1000
        bus.send(can.Message(arbitration_id=0x100, is_extended_id=False))
        theirs = canopen.Network(open_bus(channel))
        theirs.NOTIFIER_CYCLE = 0.01
        theirs.connect()
        with Network.open(theirs) as network:
            network.add(5, SERVO)["Profile velocity"].value = 900
        node = theirs.add_node(canopen.RemoteNode(5, SERVO.objects))
        assert node.sdo["Profile velocity"].raw == 900
        theirs.disconnect()
    with pytest.raises(LocalError, match=r"nor a connected canopen\.Network"):
        Network.open(canopen.Network())


def test_a_function_may_talk_to_nodes() -> None:
    with live_servos(5) as channel, Network.open("virtual", channel, answer_wait=2.0) as network:
        drive, seen = network.add(5, SERVO), list[int]()
        drive.nmt.start()
        drive.pdo["TPDO1"].on(lambda _: seen.append(drive["Statusword"].value))
        with network.sync(period=0.01):
            network.master.pump(5.0, lambda: len(seen) >= 3)
        assert seen[:3] == [0x240] * 3


def test_a_bus_that_fails_is_told_to_who_waits() -> None:
    with Network.open("virtual", new_channel()) as network:
        assert network.master.states == {}
    with pytest.raises(EurobotError):
        network.send(0x100)


CANOPEN_NAMES = {"connect", "disconnect", "check", "nodes", "add_node", "send_message", "send_periodic"} | {
    "subscribe", "unsubscribe", "id", "object_dictionary", "sdo", "tpdo", "rpdo", "upload", "download",
    "load_configuration", "keys", "values", "items", "bus", "get", "open", "RESPONSE_TIMEOUT", "network",
    "associate_network", "has_network", "remove_network",
}  # fmt: skip
"""Names that only blocking networks and nodes have, as canopen itself has them."""


@pytest.mark.parametrize("pair", [(Network, AsyncNetwork), (RemoteDevice, AsyncRemoteDevice)])
def test_both_kinds_of_networks_have_the_same_names_and_arguments(pair: tuple[type, type]) -> None:
    blocking, awaited = ({name: each for name, each in vars(kind).items() if name[0] != "_"} for kind in pair)
    only_blocking = {"sleep", "add"}  # an event loop has its own sleep; `add` may ask the bus before it returns
    assert set(blocking) - set(awaited) - CANOPEN_NAMES == only_blocking & set(blocking)
    for name in set(blocking) & set(awaited):
        one, other = (inspect.unwrap(getattr(kind, name)) for kind in pair)
        assert not callable(one) or [*inspect.signature(one).parameters] == [*inspect.signature(other).parameters]


def test_help_answers_a_newcomer() -> None:
    for each in (Network, AsyncNetwork, RemoteDevice, AsyncRemoteDevice, NodeNmt, NetworkLss, simulated):
        assert len(inspect.getdoc(each) or "") > 50


@pytest.mark.parametrize("thing", [simulated, RemoteDevice, Protocol])
def test_the_example_of_a_docstring_runs(thing: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(DOCS)
    text, _, _ = (inspect.getdoc(thing) or "").partition("\nArgs:")
    indented = [line for line in text.splitlines() if line.startswith("    ")]
    assert indented
    exec(textwrap.dedent("\n".join(indented)), {"simulated": simulated, "Protocol": Protocol})


def test_devices_without_a_node_id_are_found_and_given_one() -> None:
    identities = [Identity(1, 2, 3, 4), Identity(1, 2, 3, 5)]
    slaves = [LssStation(each) for each in identities]
    with Network(wired(*slaves)) as network:
        assert network.lss.find() == identities
        assert network.lss.assign(7, identities[1], bit_rate=250) == identities[1]
        assert network.lss.find() == identities[:1]
        assert network.lss.assign(8, store=False) == identities[0]
        with pytest.raises(RemoteError, match="no device without a node-ID answers"):
            network.lss.assign(9)
    assert [(slave.node_id, slave.state) for slave in slaves] == [(8, WAITING), (7, WAITING)]


def test_a_node_id_that_another_device_has_is_not_set() -> None:
    with servo() as network:
        with pytest.raises(RemoteError, match="node-ID 5 is taken: a device answers there, with the identity 0x"):
            network.lss.assign(5)
        with pytest.raises(RemoteError, match="no device has the identity"):  # it may keep its own, but has no LSS
            network.lss.assign(5, Identity.of(SERVO))


def test_a_device_that_refuses_its_bit_rate_does_not_obey_the_next_command() -> None:
    slave = LssStation(Identity(1, 2, 3, 4), errors={0x13: (1, 0)})
    with Network(wired(slave)) as network, pytest.raises(RemoteError, match="refuses to configure bit timing"):
        network.lss.assign(7, bit_rate=250)
    assert slave.state == WAITING


# At a prompt

MOTOR_EDS = Path(__file__).parents[2] / "docs" / "motor.eds"


def test_objects_of_a_network_have_a_repr() -> None:
    with simulated(MOTOR_EDS, node_id=5) as network:
        motor = network[5]
        shown = [*map(repr, (network, motor, motor["Temperature"], motor.pdo, motor.pdo["RPDO1"]))]
    assert shown == [
        "<SimulatedNetwork of 5 motor>",
        "<RemoteDevice 5 motor>",
        "<RemoteObject 0x2100:0 Temperature of node 5>",
        "<RemotePdos of node 5: RPDO1, TPDO1>",
        "<BlockingPdoStream RPDO1 of node 5, 0x205: Motor.Target speed>",
    ]


def test_ipython_completes_names_of_nodes_objects_and_pdos() -> None:
    with simulated(MOTOR_EDS, node_id=5) as network:
        assert network._ipython_key_completions_() == ["motor"]
        assert "Motor.Target speed" in network[5]._ipython_key_completions_()
        assert network[5].pdo._ipython_key_completions_() == ["RPDO1", "TPDO1"]
        assert network[5].pdo["RPDO1"]._ipython_key_completions_() == ["Motor.Target speed"]


def test_an_attribute_that_an_object_a_pdo_or_its_commands_do_not_have_is_refused() -> None:
    with simulated(MOTOR_EDS, node_id=5) as network:
        pdo = network[5].pdo["TPDO1"]
        for each in (network[5]["Temperature"], pdo, pdo["Motor.Speed"], network[5].emcy, network[5].nmt):
            with pytest.raises(AttributeError, match="valu"):
                setattr(each, "valu", 5)  # noqa: B010  # a type checker sees it
        pdo.event_timer = 100
        assert pdo.settings == {5: 100}
        assert repr(pdo["Motor.Speed"]) == "<PdoSignal Motor.Speed in TPDO1 of node 5, last: None>"


REFUSED: list[tuple[Callable[[Any], object], type[Exception], str]] = [
    # (what a program does with a drive, the error of Python, what it says)
    (
        lambda drive: drive.configure({0x1017: 5}),
        LocalError,
        "a device's file is a path, such as 'motor.eds', and not {4119: 5}",
    ),
    (
        lambda drive: drive["Statusword"].read("int"),
        LocalError,
        "'int' is not a type; write `int`, `float`, `str` or `bytes`",
    ),
    (lambda drive: drive.drive402.enable("2 s"), LocalError, "a time is a number of seconds, not '2 s'"),
    (
        lambda drive: drive.drive402.home("left"),
        LocalError,
        "'left' is not a homing method of CiA 402; known: 1..14, 17..30, 33..35, 37, and a maker's below 0",
    ),
    (lambda drive: drive.network.scan(["5"]), LocalError, "node-ID '5' is not in 1..127"),
    (
        lambda drive: drive.configure(DCF, cob_ids="same"),
        UnknownName,
        "unknown choice of COB-IDs 'same'; known: keep, move",
    ),
    (
        lambda drive: drive.drive402.choose("velocity"),
        UnknownName,
        "unknown mode of operation 'velocity'; did you mean Mode.VELOCITY or "
        "Mode.PROFILE_VELOCITY or Mode.CYCLIC_VELOCITY?",
    ),
    (
        lambda drive: drive.network.send(0x205, "0F00"),
        FieldError,
        "frame 0x205: data = '0F00' is not allowed; allowed: up to 8 bytes, such as bytes.fromhex('0F00')",
    ),
    (lambda drive: drive[6081], UnknownName, "unknown object 6081; did you mean 0x6081?"),
    (
        lambda drive: drive["Current control"].P_gain,
        AttributeError,
        "RemoteObject has no attribute 'P_gain'; did you mean `['P gain']`?",
    ),
    (lambda drive: drive.pdo.TPDO1, AttributeError, "RemotePdos has no attribute 'TPDO1'; did you mean `['TPDO1']`?"),
    (
        lambda drive: drive.axis402(2).enable(),
        DriveError,
        "node 5 has no axis 2, only axis 1 answers: read 0x6841:0 is refused",
    ),
    (
        lambda _: Network("virtual", "servo"),  # type: ignore[arg-type]
        TypeError,
        "Network(bus) takes a bus that is open; Network.open(interface, channel) opens one",
    ),
    (
        lambda _: setattr(AsyncRemoteDevice(5, EDS)["Profile velocity"], "value", 5),
        AttributeError,
        "in an event loop an object is written by `await ....write(5)`",
    ),
    (lambda drive: drive.start(), AttributeError, "RemoteDevice has no attribute 'start'; did you mean `.nmt.start`?"),
    (
        lambda drive: drive.network.program(b""),
        AttributeError,
        "SimulatedNetwork has no attribute 'program'; did you mean `[node].program`?",
    ),
    (
        lambda drive: drive.heartbeat(period=0.5),
        TypeError,
        "RemoteDevice.heartbeat(within=1.0): got an unexpected keyword argument 'period'",
    ),
    (
        lambda drive: drive.drive402.move_to(),
        TypeError,
        "Drive402.move_to(position, velocity=None, *, relative=False, within=60.0): "
        "missing 1 required positional argument: 'position'",
    ),
    (
        lambda drive: setattr(drive.drive402, "mode", 3),
        AttributeError,
        "<Drive402: the drive of node 5> has no attribute 'mode'",
    ),
]


@pytest.mark.parametrize(("call", "kind", "text"), REFUSED)
def test_a_call_that_does_not_fit_is_told_with_what_fits(
    call: Callable[[Any], object], kind: type[Exception], text: str
) -> None:
    with servo() as network, pytest.raises(kind, match=f"^{re.escape(text)}$"):
        call(network[5])


@pytest.mark.parametrize("bitrate", [500, "500k", 0])
def test_a_bit_rate_is_in_bits_per_second(bitrate: Any) -> None:
    with pytest.raises(LocalError, match=rf"^bitrate = {bitrate!r} is not in 1000\.\.1000000 bit/s"):
        Network.open("virtual", "nobody", bitrate)


def test_a_device_that_is_no_drive_is_not_enabled() -> None:
    with (
        simulated(MOTOR_EDS, node_id=5) as network,
        pytest.raises(DriveError, match=r"^node 5 is no drive of CiA 402: "),
    ):
        network[5].drive402.enable()


def test_an_object_is_not_set_as_an_item() -> None:
    says = r"write node\['Temperature'\]\.value = 5$"
    with simulated(MOTOR_EDS, node_id=5) as network, pytest.raises(TypeError, match=says):
        network[5]["Temperature"] = 5  # type: ignore[index]
    with pytest.raises(TypeError, match=r"write await node\[8192\]\.write\(5\)$"):
        AsyncRemoteDevice(5)[0x2000] = 5  # type: ignore[index]


OPENED: list[Callable[[str], Network]] = [
    lambda channel: Network.open(interface="virtual", channel=channel),
    lambda channel: Network.open(bustype="virtual", channel=channel),
]


@pytest.mark.parametrize("opened", OPENED)
def test_a_bus_is_opened_by_each_name_of_its_interface(opened: Callable[[str], Network]) -> None:
    with live_servos(5) as channel, opened(channel) as network:
        assert [each.node_id for each in network.scan()] == [5]


def test_a_network_for_an_event_loop_is_not_entered_by_a_plain_with() -> None:
    with (
        pytest.raises(TypeError, match=r"^write `async with`: AsyncNetwork is for an event loop, and Network for"),
        AsyncNetwork.open("virtual", "nobody"),  # type: ignore[attr-defined]
    ):
        pass


# By a library


def test_a_node_is_added_by_what_it_is_if_a_library_is_named(tmp_path: Path) -> None:
    (tmp_path / "servo.eds").write_bytes(EDS.read_bytes())
    with live_servos(5) as channel, Network.open("virtual", channel) as network:
        assert network.add(5).dictionary is None, "nobody has named a library"
        network.library = Library([tmp_path])
        assert network.add(5, name="lift")["Profile velocity"].value == 1000
        assert network["lift"].node_id == 5
        with pytest.raises(NoAnswer):
            network.add(6)
