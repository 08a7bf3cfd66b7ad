"""`node`: one node in a process of its own, which `send` meets on a bus that processes share."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest

from eurobot_od.cli.node import _stay
from eurobot_od.device.node import Node
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from tests.cli.console import run
from tests.cli.processes import PATIENCE, line, node, serve_bus
from tests.device import io_module
from tests.eds_text import DEVICE_TYPE, record, variable
from tests.kit import plant
from tests.processes import free_port


@pytest.fixture
def shared_bus() -> Iterator[str]:
    with serve_bus("test-node") as channel:
        yield channel


@pytest.mark.posix
def test_a_drive_and_send_meet_on_a_shared_bus(capsys: pytest.CaptureFixture[str], shared_bus: str) -> None:
    bus = ["-i", "remote", "-c", shared_bus]
    with node("lift", *bus, "--verbose") as lift:
        line(lift, "lift (node-ID 2) on ")
        expect = ["--expect", "Move Confirm", "--within", "30 s"]
        goto = run(capsys, "send", "Move To", "x=1500", "y=1000", "angle=90", "speed=50", *expect, *bus)
        assert (goto.status, goto.err) == (0, "")
        assert goto.out.splitlines()[1].startswith("received  182#  Move Confirm  after ")
        line(lift, "  202#DC853E5AC8000000  Move To  x=1500 mm, y=1000 mm, angle=90 deg, speed=50 %")
        lift.send_signal(signal.SIGINT)
        assert lift.wait(PATIENCE) == 130


@pytest.mark.posix
def test_a_device_makes_a_bus_that_other_programs_join(capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    bus = ["-i", "remote", "-c", f"ws://127.0.0.1:{port}/"]
    with node("--eds", "5=docs/motor.eds", "--share", str(port)) as motor:
        assert line(motor, "a bus").strip() == f"a bus of this machine; join it by {' '.join(bus)}"
        line(motor, "motor (node-ID 5) on ")
        read = run(capsys, "read", "5", "Temperature", "--eds", "5=docs/motor.eds", *bus)
        assert (read.status, read.err) == (0, "")
        assert read.out.split() == ["0x2100:0", "Temperature", "20.0"]
        taken = run(capsys, "node", "--eds", "5=docs/motor.eds", "--share", str(port))
        assert taken.status == 3
        assert taken.err.startswith(f"eurobot-od: cannot share a bus at port {port} of this machine: ")
        motor.send_signal(signal.SIGINT)
        assert motor.wait(PATIENCE) == 130


def test_a_shared_bus_is_not_an_adapter_too(capsys: pytest.CaptureFixture[str]) -> None:
    both = run(capsys, "node", "--eds", "5=docs/motor.eds", "--share", "54701", "-i", "socketcan")
    assert (both.status, both.err) == (
        2,
        "eurobot-od: --share makes a bus, and does not go with -i and -c, which name one\n",
    )


@pytest.mark.long
@pytest.mark.posix
def test_a_terminated_node_ends_as_an_interrupted_one(shared_bus: str) -> None:
    with node("scale", "-i", "remote", "-c", shared_bus) as scale:
        line(scale, "Ctrl-C ends it")
        scale.send_signal(signal.SIGTERM)
        assert scale.wait(PATIENCE) == 130
        assert scale.stderr is not None
        assert scale.stderr.read() == ""


# A panel that is told to end while its goto is under way


def test_no_line_of_a_drivers_log_stands_before_the_error() -> None:
    with node("lift", "-i", "socketcan", "-c", "nosuch0") as lift:
        _, error = lift.communicate(timeout=PATIENCE)
    assert error.startswith("eurobot-od: cannot open the socketcan bus nosuch0: ")
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["lift", "--dialect", "nonsense"], 2, "unknown dialect 'nonsense'; known: packed, plain"),
        (["lift", "--store", "README.md"], 2, "README.md: "),
        (["lift", "-i", "nosuch"], 3, "cannot open the nosuch bus: unknown interface 'nosuch'; known: "),
        (["lift", "-i", "socketcan", "-c", "nosuch0"], 3, "cannot open the socketcan bus nosuch0: "),
    ],
)
def test_a_node_that_cannot_run_is_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], status: int, complaint: str
) -> None:
    said = run(capsys, "node", *words)
    assert (said.status, said.out) == (status, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1


@pytest.mark.long
@pytest.mark.posix
def test_stored_parameters_survive_a_restart(
    capsys: pytest.CaptureFixture[str], shared_bus: str, tmp_path: Path
) -> None:
    bus, store = ("-i", "remote", "-c", shared_bus), ("--store", str(tmp_path / "lift.dcf"))
    with node("lift", *store, *bus) as first:
        line(first, "Ctrl-C ends it")
        assert run(capsys, "write", "2", "Motion.Maximum speed", "650", *bus).status == 0
        assert run(capsys, "store", "2", *bus).status == 0
        first.send_signal(signal.SIGTERM)
    with node("lift", *store, *bus) as second:
        line(second, "Ctrl-C ends it")
        assert "650" in run(capsys, "read", "2", "Motion.Maximum speed", *bus).out
        second.send_signal(signal.SIGTERM)


@pytest.mark.parametrize("node_id", ["0", "128", "-1"])
def test_a_node_id_out_of_range_is_refused(capsys: pytest.CaptureFixture[str], node_id: str) -> None:
    said = run(capsys, "node", "lift", "--node-id", node_id)
    assert (said.status, said.out) == (2, "")
    assert said.err.endswith(f"lift.eds: node-ID {node_id} is not in 1..127\n")


WRONG_USAGE = [
    ([], "eurobot-od: which node? Name one of panel, lift, scale, or give a device's file with --eds"),
    (["engine"], "eurobot-od: unknown node 'engine'; known: lift, panel, scale"),
    (["lift", "--set", "Set point"], "eurobot-od node: error: argument --set: Set point: write OBJECT=VALUE"),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG_USAGE)
def test_wrong_usage(capsys: pytest.CaptureFixture[str], words: list[str], complaint: str) -> None:
    said = run(capsys, "node", *words)
    assert said.status == 2
    assert said.complaint.startswith(complaint)


# Anybody's device


@pytest.fixture
def eds(tmp_path: Path) -> str:
    file = tmp_path / "module.eds"
    file.write_text(f"[FileInfo]\nFileName=module.eds\n{io_module.TEXT}", encoding="ascii")
    return str(file)


@pytest.mark.posix
def test_a_device_from_its_file_has_the_values_that_it_is_given(
    capsys: pytest.CaptureFixture[str], shared_bus: str, eds: str, tmp_path: Path
) -> None:
    bus = ("-i", "remote", "-c", shared_bus)
    values = tmp_path / "values.yaml"
    values.write_text("Channel.Entry 1: 17\n", encoding="ascii")
    given = ("--set", "Channel.Entry 4=a=b", "--set", "0x2100=-3", "--values", str(values))
    with node("--eds", eds, "--node-id", "7", *given, *bus) as device:
        line(device, "module (node-ID 7) on ")
        for name, said in (("Channel.Entry 1", " 17"), ("Channel.Entry 4", " a=b"), ("Set point", " -3")):
            assert run(capsys, "read", "7", name, "--eds", f"7={eds}", *bus).out.rstrip().endswith(said)
        device.send_signal(signal.SIGTERM)
        assert device.wait(PATIENCE) == 130


def test_a_device_whose_file_moves_its_sdo_server_is_served_there(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    usual, moved = ("$NODEID+0x600", "$NODEID+0x580"), ("0x650", "$NODEID+0x5D0")
    more = [f"ParameterValue={each}\n" for each in moved]
    server = (variable(f"1200sub{sub}", f"COB-ID {sub}", "UNSIGNED32", usual[sub - 1], more[sub - 1]) for sub in (1, 2))
    head = record(0x1200, "SDO server", (0, "UNSIGNED8", "2"))
    (tmp_path / "moved.eds").write_text(DEVICE_TYPE + head + "".join(server))
    device = SimulatedDevice.load(tmp_path / "moved.eds", 5)
    device.start(0.0)
    (answer,) = device.receive(Frame(0x650, bytes.fromhex("4000100000000000")), 0.0)
    assert (answer.cob_id, answer.data[:4].hex()) == (0x5D5, "43001000")
    assert device.receive(Frame(0x605, bytes.fromhex("4000100000000000")), 0.0) == []
    said = run(capsys, "node", "--eds", f"5={tmp_path / 'moved.eds'}", "--for", "1 ms", "-i", "virtual")
    assert said.out.endswith("\nits SDO server is at 0x650, answers at 0x5D5, as its file says (0x1200)\n")


def test_of_several_devices_each_says_where_its_sdo_server_was_moved_to(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    server = record(0x1200, "SDO server", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x650"), (2, "UNSIGNED32", "0x5D5"))
    (tmp_path / "moved.eds").write_text(DEVICE_TYPE + server)
    (tmp_path / "plain.eds").write_text(DEVICE_TYPE)
    (tmp_path / "network.yaml").write_text(
        "nodes: {a: {file: plain.eds, node_id: 5}, b: {file: moved.eds, node_id: 6}}"
    )
    said = run(
        capsys, "node", "--network", str(tmp_path / "network.yaml"), "--for", "1 ms", "-i", "virtual"
    ).out.splitlines()
    assert "a (node-ID 5), b (node-ID 6); Ctrl-C" in said[0]
    assert said[1:] == ["b: its SDO server is at 0x650, answers at 0x5D5, as its file says (0x1200)"]


def test_several_devices_are_drives_as_one_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made: list[Node] = []
    monkeypatch.setattr("eurobot_od.cli.node._run_all", lambda nodes, *_: made.extend(nodes))
    file = Path(__file__).parents[2] / "docs" / "servo.eds"
    for words, kinds in (((), [SimulatedDrive] * 2), (("--profile", "none"), [SimulatedDevice] * 2)):
        made.clear()
        assert run(capsys, "node", "--eds", f"5={file}", "--eds", f"6={file}", *words).status == 0
        assert [type(each) for each in made] == kinds


PACKAGE = """
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.plugin import Plugin

DEVICE = Plugin("own", (0,), device=lambda: type("Own", (SimulatedDevice,), {}))
"""


@pytest.mark.parametrize(
    ("words", "kind"), [((), "Own"), (("--profile", "none"), "SimulatedDevice")], ids=["a package", "a profile"]
)
def test_an_explicit_profile_takes_precedence_over_a_package(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    words: tuple[str, ...],
    kind: str,
) -> None:
    (tmp_path / "own.py").write_text(PACKAGE)
    made: list[Node] = []
    monkeypatch.setattr("eurobot_od.cli.node._run", lambda _live, node, *_: made.append(node))
    file = Path(__file__).parents[2] / "docs" / "servo.eds"
    run(capsys, "node", "--eds", f"5={file}", "--package", str(tmp_path / "own.py"), "-i", "virtual", *words)
    assert [type(each).__name__ for each in made] == [kind]


def test_a_node_runs_as_long_as_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [1000.0]
    live = Mock(clock=lambda: now[-1], failure=None, controller=Mock(report_failure=None), station=None)
    monkeypatch.setattr("time.sleep", lambda seconds: now.append(now[-1] + seconds))
    assert _stay(live, None, 2.0) is None
    assert now[-1] == pytest.approx(1002.0, abs=0.2)


@pytest.mark.usefixtures("eds")
def test_a_device_of_a_network_is_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "network.yaml"
    file.write_text("nodes: {io: {file: module.eds, node_id: 5}, gate: {file: module.eds, node_id: 6}}")
    said = run(capsys, "node", "gate", "--network", str(file), "--for", "1 ms", "--fault", "babbling", "-i", "virtual")
    assert (said.status, said.out.partition(" on ")[0]) == (0, "gate (node-ID 6)")


WITH_BOTH = [
    (["--node-id", "7"], "eurobot-od: --node-id is for one device: which node? Name one of io, gate"),
    (["--set", "0x2100=1"], "eurobot-od: --set is for one device: which node? Name one of io, gate"),
    (["--fault", "babbling"], "eurobot-od: --fault is for one device: which node? Name one of io, gate"),
]


@pytest.mark.parametrize(("words", "complaint"), WITH_BOTH)
def test_an_option_of_one_device_needs_the_name_of_the_device(
    capsys: pytest.CaptureFixture[str], eds: str, tmp_path: Path, words: list[str], complaint: str
) -> None:
    file = tmp_path / "network.yaml"
    file.write_text(f"nodes: {{io: {{file: {eds}, node_id: 5}}, gate: {{file: {eds}, node_id: 6}}}}")
    assert run(capsys, "node", "--network", str(file), *words).complaint == complaint


@pytest.mark.posix
@pytest.mark.usefixtures("eds")
def test_all_devices_of_a_network_run_in_one_process_and_are_booted(
    capsys: pytest.CaptureFixture[str], shared_bus: str, tmp_path: Path
) -> None:
    file = tmp_path / "network.yaml"
    bus = ("-i", "remote", "-c", shared_bus)
    file.write_text("nodes: {io: {file: module.eds, node_id: 5}, gate: {file: module.eds, node_id: 6}}\nmaster: PC\n")
    with node("--network", str(file), *bus) as devices:
        assert "io (node-ID 5), gate (node-ID 6)" in line(devices, "2 devices on ")
        said = run(capsys, "boot", str(file), *bus)
        assert said.status == 0
        assert [each.partition(":")[0] for each in said.out.splitlines()] == ["node 5 io", "node 6 gate", "io", "gate"]
        file.write_text("nodes: {lost: {file: module.eds, node_id: 9}, gate: {file: module.eds, node_id: 6}}")
        said = run(capsys, "boot", str(file), *bus)
        assert said.status == 1
        assert said.out.splitlines()[0].startswith("node 9 lost: error B: ")
        assert said.out.splitlines()[-1] == "not started: lost did not boot"
        devices.send_signal(signal.SIGTERM)
        assert devices.wait(PATIENCE) == 130


WRONG_DEVICES = [
    (["--set", "Colour=1"], "unknown object 'Colour'"),
    (["--set", "Set point=40000"], "0x2100:0: Set point = 40000 is not allowed; allowed: -32768..32767"),
    (["--set", "Channel=1"], "'Channel' is not one object but a record of "),
    (
        ["--fault", "move-confirm-not-sent", "--robot", str(plant.HERE)],
        "the fault move-confirm-not-sent is one of the lift, not of other devices",
    ),
    (["--fault", "goto-not-confirmed"], "unknown fault 'goto-not-confirmed'"),
    (["motor"], "unknown node 'motor'; known: module"),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG_DEVICES)
def test_a_device_that_cannot_run_is_one_line(
    capsys: pytest.CaptureFixture[str], eds: str, words: list[str], complaint: str
) -> None:
    said = run(capsys, "node", "--eds", f"5={eds}", *words)
    assert (said.status, said.complaint.partition(complaint)[:2]) == (2, ("eurobot-od: ", complaint))


# pdo


@pytest.mark.posix
def test_the_pdos_of_a_device_are_listed_and_mapped(capsys: pytest.CaptureFixture[str], shared_bus: str) -> None:
    bus = ("-i", "remote", "-c", shared_bus)
    motor = f"5={Path(__file__).parents[2] / 'docs' / 'motor.eds'}"
    with node("--eds", motor, *bus) as device:
        line(device, "(node-ID 5)")
        said = run(capsys, "pdo", "5", "--eds", motor, *bus)
        assert [each.split()[:4] for each in said.out.splitlines()] == [
            ["RPDO", "1", "0x205", "on"],
            ["TPDO", "1", "0x185", "on"],
        ]
        said = run(capsys, "pdo", "5", "map", "tpdo1", "Motor.Current", "0x2000:1", "--eds", motor, *bus)
        assert said.out.endswith("every 100 ms  Motor.Current 16, Motor.Speed 16\n")
        said = run(capsys, "pdo", "5", "--json", "--eds", motor, *bus)
        assert [each["name"] for each in json.loads(said.out)[1]["mapping"]] == ["Motor.Current", "Motor.Speed"]
        said = run(capsys, "pdo", "5", "map", "TPDO9", "Motor.Speed", "--eds", motor, *bus)
        assert said.complaint.endswith("unknown PDO 'TPDO9'; did you mean TPDO1?")
        said = run(capsys, "pdo", "5", "map", "TPDO1", "--eds", motor, *bus)
        assert said.complaint.endswith("Write `map TPDO1 OBJECT...`; `pdo 5` lists the PDOs")
        off = run(capsys, "pdo", "5", "disable", "TPDO1", "--eds", motor, *bus)
        assert off.out.split()[:4] == ["TPDO", "1", "0x185", "off"]
        said = run(capsys, "pdo", "5", "map", "TPDO1", "Motor.Speed", "--eds", motor, *bus)
        assert said.complaint.endswith("TPDO 1 stays off; `pdo 5 enable TPDO1` switches it on")
        on = run(capsys, "pdo", "5", "enable", "TPDO1", "--eds", motor, *bus)
        assert on.out.split()[:4] == ["TPDO", "1", "0x185", "on"]
        device.send_signal(signal.SIGTERM)


# faults


def test_all_faults_are_listed_by_node(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "faults")
    lines = said.out.splitlines()
    assert said.status == 0
    nodes = ["panel:", "lift:", "scale:", "any node:", "any drive of CiA 402:"]
    assert [line for line in lines if line.endswith(":")] == nodes
    assert [line.split()[0] for line in lines if line.startswith("  ")] == plant.PLUGINS.fault_names()


def test_the_faults_of_one_node_are_its_own_and_those_of_any_node(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "faults", "scale").out
    assert [line for line in out.splitlines() if line.endswith(":")] == ["scale:", "any node:"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["node", "lift", "--fault", "move-confirm-not-snt"], "unknown fault 'move-confirm-not-snt'; did you mean"),
        (["node", "lift", "--fault", "move-to-not-sent"], "the fault move-to-not-sent is one of the panel, not of the"),
        (["node", "lift", "--fault", "nonsense"], "unknown fault 'nonsense'; 116 are known"),
        (["check", "--conformance", "--eds", "5=docs/io.eds", "--fault", "babbling"], "--fault needs --simulate"),
    ],
)
def test_a_fault_that_is_not_there_is_refused(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    said = run(capsys, *words)
    assert said.status == 2
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1
