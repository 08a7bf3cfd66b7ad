"""The commands for any CANopen node: what they print, the exit status, and one line where something is wrong."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from eurobot_od.bus.live import Live
from eurobot_od.cli import main
from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od import dcf
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import parse
from eurobot_od.od.normal import in_normal_form
from eurobot_od.od.standard import ErrorCode
from tests.cli.console import Terminal
from tests.client.peers import LIFT, line, new_channel, open_bus, stock_lift
from tests.eds_text import DEVICE_TYPE, pdo, record, variable

HEARTBEAT = "0x1017:0  Producer heartbeat time"
NAMED = "0x1017:0: Producer heartbeat time"
NOT_ALLOWED = " is not allowed; allowed: "
READ_ONLY = ": Attempt to write a read only object (0x06010002); read it only: its AccessType is ro or const"
NO_OBJECT = "Object does not exist (0x06020000); the device may be another version than its EDS: compare 0x1018"

ONE_OF_THEM = "what to write: give a value or --file FILE, one of them, as in write 2 0x1017 500"

FILES = """\
[200E]
ParameterName=Script
ObjectType=2
DataType=0x000F
AccessType=rw
"""

Run = Callable[..., tuple[int, str, str]]
"""Runs a command on a bus; gives exit status, output and error output."""


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def command(channel: str, *words: str) -> tuple[int, str, str]:
        status = main([*words, "--timeout", "1 s", "-i", "virtual", "-c", channel])
        return (status, *capsys.readouterr())

    return command


@pytest.fixture
def lift(run: Run) -> Iterator[str]:
    """A lift with a quick heartbeat; yields the channel."""
    with line("lift") as channel:
        run(channel, "write", "2", "0x1017", "10")
        yield channel


@pytest.mark.parametrize(
    "words", [("dump", "2"), ("dump", "2", "-o", "{folder}/lift.dcf"), ("diff", str(LIFT), "--node", "2")]
)
def test_a_terminal_sees_how_far_it_is_with_the_objects(
    lift: str, words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Terminal()
    monkeypatch.setattr("eurobot_od.support.progress.SHORT", 0.0)
    monkeypatch.setattr("sys.stderr", terminal)
    main([*(word.format(folder=tmp_path) for word in words), "-i", "virtual", "-c", lift])
    drawn, *_, wiped = terminal.getvalue().split("\r")[1:-1]
    assert re.fullmatch(r"node 2 .* 0 of \d+ objects .*", drawn)
    assert not wiped.strip()


# scan


def test_scan_lists_the_nodes_of_the_robot(run: Run) -> None:
    with line("panel", "lift", "scale") as channel:
        status, out, err = run(channel, "scan", "--listen", "10 ms")
    lines = [line.split() for line in out.splitlines()]
    assert (status, err) == (0, "")
    assert lines[0] == ["node", "name", "state", "vendor", "product", "revision", "serial"]
    assert [(line[0], line[3]) for line in lines[1:]] == [("1", "panel"), ("2", "lift"), ("3", "scale")]


def test_scan_as_json(run: Run, lift: str) -> None:
    status, out, _ = run(lift, "scan", "--json", "--listen", "10 ms")
    assert status == 0
    assert json.loads(out) == [
        {
            "node_id": 2,
            "name": "Packaging line lift",
            "state": "operational",
            "identity": {"vendor": 0, "product": 2, "revision": 0x10000, "serial": 1},
        }
    ]


NETWORK = """nodes:
  wheels: {file: lift.eds, node_id: 2}
  eyes: {file: lift.eds, node_id: 7}
"""


@pytest.fixture
def network(tmp_path: Path) -> str:
    """A network file whose node 7 is not there."""
    (tmp_path / "lift.eds").write_bytes(LIFT.read_bytes())
    (tmp_path / "network.yaml").write_text(NETWORK)
    return str(tmp_path / "network.yaml")


def test_scan_of_a_network_names_its_nodes_and_says_which_are_missing(run: Run, network: str) -> None:
    with line("panel", "lift") as channel:
        status, out, err = run(channel, "scan", "--listen", "10 ms", "--network", network)
    head, panel, lift, missing = out.splitlines()
    assert (status, err) == (1, "eurobot-od: node 1 is on this bus, node 7 is not\n")
    assert head.split()[:4] == ["node", "in", "network", "name"]
    assert panel.split()[:5] == ["1", "-", "Packaging", "line", "panel"]
    assert lift.split()[:5] == ["2", "wheels", "Packaging", "line", "lift"]
    assert missing == "missing: eyes (7)"


def test_scan_of_a_network_as_json(run: Run, lift: str, network: str) -> None:
    status, out, _ = run(lift, "scan", "--json", "--listen", "10 ms", "--network", network)
    rows = [(each["node_id"], each["network_name"], each["missing"], each["name"]) for each in json.loads(out)]
    assert (status, rows) == (1, [(2, "wheels", False, "Packaging line lift"), (7, "eyes", True, "")])


def test_scan_of_a_network_that_is_complete_is_fine(run: Run, lift: str) -> None:
    status, out, _ = run(lift, "scan", "--listen", "10 ms", "--eds", f"2={LIFT}")
    assert (status, "missing" in out) == (0, False)


def test_scan_of_an_empty_bus(run: Run) -> None:
    assert run(new_channel(), "scan", "--listen", "10 ms") == (1, "no node answers\n", "")


# read, write, dump


@pytest.mark.parametrize(
    ("words", "out"),
    [
        (["2", "0x1018:2"], "0x1018:2  Identity object.Product code  0x00000002\n"),
        (["lift", "Motion.Maximum speed"], "0x2101:1  Motion.Maximum speed  800 mm/s\n"),  # names of node and object
        (
            ["2", "0x1017", "0x1008"],
            f"{HEARTBEAT}   10\n0x1008:0  Manufacturer device name  Packaging line lift\n",
        ),
        (["2", "0x1017", "--eds", str(LIFT)], "0x1017:0  Producer heartbeat time  10\n"),
    ],
)
def test_read(run: Run, lift: str, words: list[str], out: str) -> None:
    assert run(lift, "read", *words) == (0, out, "")


# The same node by a file of anybody's, with and without its node-ID, and by its name in a network file.
DEVICES = [
    ("5", ["--eds", "thing.eds"]),
    ("5", ["--eds", "5=thing.eds"]),
    ("thing", ["--eds", "5=thing.eds"]),
    ("thing", ["--network", "net.yaml"]),
    ("5", ["--network", "net.yaml"]),
]


@pytest.mark.parametrize(("node", "options"), DEVICES)
def test_any_device_is_read_by_the_names_of_its_file(
    run: Run, node: str, options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text, _ = in_normal_form((DEVICE_TYPE + variable("2000", "Heat", "INTEGER16", "-5")).encode(), "thing.eds")
    Path("thing.eds").write_text(text.decode().replace("PDOMapping=1", "PDOMAPPING=1"))
    Path("net.yaml").write_text("nodes: {thing: {file: thing.eds, node_id: 5}}")
    thing = Node(Dictionary.load("thing.eds", 5))
    channel = new_channel()
    with can.Bus(channel, interface="virtual") as bus, Live.node(bus, thing):
        status, out, err = run(channel, "read", node, "Heat", *options)
    assert (status, out) == (0, "0x2000:0  Heat  -5\n")
    assert err.count("\n") == err.count("thing.eds: repaired to be read: ") == 1


def test_a_name_that_no_device_has_is_told(run: Run) -> None:
    assert run(new_channel(), "read", "thing", "0x1000") == (
        2,
        "",
        "eurobot-od: unknown node 'thing'; known: panel, lift, scale\n",
    )


def test_read_as_json(run: Run, lift: str) -> None:
    _, out, _ = run(lift, "read", "2", "0x1017", "0x5000", "--json")
    assert json.loads(out) == [
        {"index": 0x1017, "subindex": 0, "name": "Producer heartbeat time", "type": "UNSIGNED16", "value": 10},
        {"index": 0x5000, "subindex": 0, "name": "", "type": "", "refused": "Object does not exist"},
    ]


def test_a_node_without_an_eds_is_read_and_written_by_number(run: Run, tmp_path: Path) -> None:
    eds = tmp_path / "foreign.eds"
    eds.write_text(LIFT.read_text().replace("[1018sub2]\n", "[1018sub2]\nParameterValue=99\n"))
    with stock_lift(eds) as (channel, _):
        assert run(channel, "write", "2", "0x1017", "0x1F4")[:2] == (0, "node 2: 0x1017:0 = 0x1F4\n")
        assert run(channel, "read", "2", "0x1017")[:2] == (0, "0x1017:0    0x1F4\n")
        status, _, err = run(channel, "read", "2", "Motion")
        unnamed = "without an EDS no object is known as 'Motion'; give its number, such as 0x1018:1"
        assert (status, err) == (2, f"eurobot-od: {unnamed}\n")
        status, out, _ = run(channel, "pdo", "2")
        assert (status, out.splitlines()[-1].split()[:4]) == (0, ["TPDO", "5", "0x483", "on"])
        status, _, err = run(channel, "pdo", "2", "map", "TPDO1", "0x2000:1")
        assert (status, err[:60]) == (2, "eurobot-od: no EDS has the identity of node 2, and it keeps ")
        status, _, err = run(channel, "dump", "2")
        assert (status, err[:60]) == (2, "eurobot-od: no EDS has the identity of node 2, and it keeps ")


def test_a_node_without_pdos_or_an_eds_is_said_to_have_none(run: Run, tmp_path: Path) -> None:
    eds = tmp_path / "plain.eds"
    eds.write_text(DEVICE_TYPE)
    with stock_lift(eds) as (channel, _):
        assert run(channel, "pdo", "2")[::2] == (
            2,
            "eurobot-od: node 2 has no PDO, and no EDS has its identity: name one by --eds\n",
        )


@pytest.mark.parametrize(
    ("words", "status", "err"),
    [
        (
            ["read", "9", "0x1017"],
            1,
            "no answer from node 9 within 1000 ms after the question which device it is; "
            "node 2 is on this bus, node 9 is not",
        ),
        (["read", "128", "0x1017"], 2, "node-ID 128 is not in 1..127"),
        (["read", "nobody", "0x1017"], 2, "unknown node 'nobody'; known: panel, lift, scale"),
        (["read", "2", "Motoin"], 2, "unknown object 'Motoin'; did you mean Motion?"),
        (["write", "2", "0x1017", "65536"], 2, f"{NAMED} = 65536" + NOT_ALLOWED + "0..65535"),
        (["write", "2", "0x1017", "often"], 2, f"{NAMED} = 'often'" + NOT_ALLOWED + "an integer"),
        (
            ["write", "2", "0x1018:1", "5"],
            1,
            "node 2 refused to write 0x1018:1 Identity object.Vendor-ID" + READ_ONLY,
        ),
        (["write", "2", "0x5000", "5"], 1, f"node 2 refused to read 0x5000:0: {NO_OBJECT}"),
        (["read", "2", "0x1017", "--eds", "none.eds"], 2, "none.eds: No such file or directory"),
        (["configure", "2", "none.dcf"], 2, "none.dcf: No such file or directory"),
    ],
)
def test_one_line_where_something_is_wrong(run: Run, lift: str, words: list[str], status: int, err: str) -> None:
    assert run(lift, *words) == (status, "", f"eurobot-od: {err}\n")


def test_a_refused_object_is_listed_with_its_reason(run: Run, lift: str) -> None:
    status, out, err = run(lift, "read", "2", "0x1003:1", "0x1017")
    assert (status, err) == (1, "")
    assert out.splitlines()[0].endswith("(No data available)")


def test_dump_lists_every_object(run: Run, lift: str) -> None:
    status, out, err = run(lift, "dump", "2")
    assert (status, err) == (0, "")
    assert any(line.split() == ["0x2101:1", "Motion.Maximum", "speed", "800", "mm/s"] for line in out.splitlines())
    _, out, _ = run(lift, "dump", "2", "--json")
    assert {
        "index": 0x2101,
        "subindex": 1,
        "name": "Motion.Maximum speed",
        "type": "UNSIGNED16",
        "value": 800,
        "unit": "mm/s",
    } in json.loads(out)


def test_a_bus_that_cannot_be_opened(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", "-i", "nonsense", "-c", "x"]) == 3
    assert capsys.readouterr().err.startswith("eurobot-od: cannot open the nonsense bus x:")


def test_files_go_in_and_out(run: Run, tmp_path: Path) -> None:
    eds, there, back = tmp_path / "lift.eds", tmp_path / "there", tmp_path / "back"
    eds.write_bytes(in_normal_form((LIFT.read_text() + FILES).encode())[0])  # which lists the object, too
    there.write_bytes(bytes(range(256)) * 4)
    object_ = "2", "Script", "--eds", str(eds), "--file"
    with stock_lift(eds) as (channel, _):
        said = "node 2: 0x200E:0 Script = 1024 bytes (CRC-32 0xB70B4C26)\n"
        assert run(channel, "write", *object_, str(there)) == (0, said, "")
        said = f"{back}: 1024 bytes of node 2, 0x200E:0 Script\n"
        assert run(channel, "read", *object_, str(back)) == (0, said, "")
    assert back.read_bytes() == there.read_bytes()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["write", "2", "0x1017"], ONE_OF_THEM),
        (["write", "2", "0x1017", "5", "--file", "x"], ONE_OF_THEM),
        (["read", "2", "0x1018", "--file", "x"], "--file takes one object, not 5"),
        (["write", "2", "0x1017", "--file", "none.bin"], "none.bin: No such file or directory"),
    ],
)
def test_a_file_is_for_one_object(run: Run, lift: str, words: list[str], said: str) -> None:
    assert run(lift, *words)[1:] == ("", f"eurobot-od: {said}\n")


# A device whose file moves its SDO server

MOVED = (
    DEVICE_TYPE
    + record(0x1010, "Store", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "1"))
    + record(0x1200, "SDO server", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x650"), (2, "UNSIGNED32", "0x5D5"))
    + variable("2000", "Speed", "UNSIGNED16", "7")
).replace("PDOMapping=1", "PDOMapping=0")  # a parameter, which a DCF has; what is mapped comes and goes


@pytest.fixture
def moved(tmp_path: Path) -> Iterator[tuple[str, str]]:
    """A device with its SDO server elsewhere; yields its channel and its file."""
    file = tmp_path / "moved.eds"
    channel = new_channel()
    file.write_text(MOVED)
    with can.Bus(channel, interface="virtual") as bus, Live.node(bus, SimulatedDevice.load(file, 5)):
        yield channel, str(file)


def test_commands_talk_to_a_moved_sdo_server_where_the_file_says(
    run: Run, moved: tuple[str, str], tmp_path: Path
) -> None:
    channel, file = moved
    own = tmp_path / "own.dcf"
    assert run(channel, "read", "5", "0x2000")[0] == 1  # without the file nobody knows where it is
    assert run(channel, "write", "5", "Speed", "9", "--eds", file)[0] == 0
    assert run(channel, "read", "5", "Speed", "--eds", f"5={file}")[1].split()[-1] == "9"
    assert run(channel, "dump", "5", "-o", str(own), "--eds", file)[0] == 0
    own.write_text(own.read_text().replace("ParameterValue=9", "ParameterValue=11"))
    assert run(channel, "configure", "5", str(own), "--no-store", "--no-reset")[0] == 0
    assert run(channel, "read", "5", "Speed", "--eds", f"5={file}")[1].split()[-1] == "11"
    status, out, _ = run(channel, "scan", "--listen", "10 ms", "--eds", f"5={file}")
    assert (status, out.splitlines()[1].split()[:2]) == (0, ["5", "moved"])


def test_a_file_is_compared_with_its_device_where_it_says_that_the_sdo_server_is(
    capsys: pytest.CaptureFixture[str], moved: tuple[str, str]
) -> None:
    channel, file = moved
    assert main(["diff", file, "--node", "5", "-i", "virtual", "-c", channel]) == 0
    assert capsys.readouterr().out == ""


def test_errors_are_asked_for_where_a_file_says_that_the_sdo_server_is(run: Run, moved: tuple[str, str]) -> None:
    channel, file = moved
    assert "node 5 refused to read 0x1001:0" in run(channel, "emcy", "5", "--eds", file)[2]


# the DCF of a node, configure, store, restore


@pytest.fixture
def new_dcf(tmp_path: Path) -> Path:
    """A DCF for node 2 with two new values."""
    file = tmp_path / "new.dcf"
    file.write_text(
        dcf.with_values(DescribedDevice(parse(LIFT.read_text())), {(0x1017, 0): 20, (0x1403, 1): 0x18}, 2, "lift", 500)
    )
    return file


DIFFERENCE = """\
node 2 differs from new.dcf in 2 objects:
0x1017:0 Producer heartbeat time        10 -> 20
0x1403:1 Halt Cause.COB-ID used by PDO  0x00000281 -> 0x00000018
"""


def test_a_dry_run_prints_the_difference_and_writes_nothing(run: Run, lift: str, new_dcf: Path) -> None:
    assert run(lift, "configure", "2", str(new_dcf), "--dry-run") == (1, DIFFERENCE, "")
    assert run(lift, "configure", "2", str(new_dcf), "--dry-run") == (1, DIFFERENCE, "")


def test_configure_writes_stores_and_verifies(run: Run, lift: str, new_dcf: Path) -> None:
    done = "node 2 configured: 2 objects written and read back, stored, verified after a reset\n"
    assert run(lift, "configure", "lift", str(new_dcf)) == (0, DIFFERENCE + done, "")
    assert run(lift, "configure", "2", str(new_dcf)) == (0, "node 2 already is as new.dcf says\n", "")


@pytest.mark.parametrize(
    ("option", "kept"), [("--no-store", "not stored"), ("--no-reset", "stored"), ("--only=profile", "")]
)
def test_configure_does_only_the_chosen_steps(run: Run, lift: str, new_dcf: Path, option: str, kept: str) -> None:
    done = f"node 2 configured: 2 objects written and read back, {kept}\n"
    said = DIFFERENCE + done if kept else "node 2 already is as new.dcf says\n"
    assert run(lift, "configure", "lift", str(new_dcf), option) == (0, said, "")


def test_changed_cob_ids_are_asked_about_before_the_bus_is_opened(
    capsys: pytest.CaptureFixture[str], new_dcf: Path
) -> None:
    assert main(["configure", "3", str(new_dcf), "-i", "nonsense"]) == 2
    assert capsys.readouterr().err == (
        f"eurobot-od: {new_dcf}: is of node 2; these COB-IDs do not follow the node-ID: 0x1403:1 RPDO4 0x018; "
        "for node 3 keep them (--keep-cob-ids), or move them by 1 (--move-cob-ids)\n"
    )


def test_the_dcf_of_a_live_node(run: Run, lift: str, tmp_path: Path) -> None:
    file = tmp_path / "live.dcf"
    names = "0x2000 Move to, 0x2001 Halt cause, 0x2011 Weight, 0x2020 Order"
    said = f"eurobot-od: left out as process data: {names}\n"
    assert run(lift, "dump", "2", "-o", str(file)) == (0, "", said)
    assert Dictionary.load(file).default((0x1017, 0)) == 10
    assert run(lift, "configure", "2", str(file), "--dry-run")[0] == 0


def test_no_dcf_is_written_by_the_eds_of_another_device(run: Run, lift: str, tmp_path: Path) -> None:
    other, file = tmp_path / "other.eds", tmp_path / "other.dcf"
    other.write_text(re.sub(r"(\[1018sub2\][^\[]*DefaultValue=)\S+", r"\g<1>77", LIFT.read_text()))
    status, out, err = run(lift, "dump", "2", "--eds", str(other), "-o", str(file))
    assert (status, out, file.exists()) == (2, "", False)
    assert err.endswith(f"{file} is not written: {other} is not its file\n")


def test_values_that_fit_no_line_are_in_a_file_beside_the_dcf(run: Run, tmp_path: Path) -> None:
    eds, file = tmp_path / "lift.eds", tmp_path / "live.dcf"
    eds.write_bytes(in_normal_form((LIFT.read_text() + FILES).encode())[0])  # which lists the object, too
    with stock_lift(eds) as (channel, node):
        node.set_data(0x200E, 0, b"a\nb")
        assert run(channel, "dump", "2", "--eds", str(eds), "-o", str(file))[0] == 0
        assert (tmp_path / "live-200E-0.bin").read_bytes() == b"a\nb"
        node.set_data(0x200E, 0, b"c")
        change = "node 2 differs from live.dcf in 1 object:\n0x200E:0 Script  63 -> 61 0A 62\n"
        assert run(channel, "configure", "2", str(file), "--dry-run") == (1, change, "")


def test_stored_parameters_survive_a_reset_and_defaults_come_back(run: Run, lift: str) -> None:
    assert run(lift, "store", "2") == (0, "node 2 has stored all parameters\n", "")
    assert run(lift, "nmt", "2", "reset")[0] == 0
    assert run(lift, "read", "2", "0x1017")[1].split()[-1] == "10"
    assert run(lift, "restore", "2")[1] == "node 2 will have, from its next reset on, the defaults of all parameters\n"
    assert run(lift, "read", "2", "0x1017")[1].split()[-1] == "10"
    assert run(lift, "restore", "2", "--reset")[1] == "node 2 has the defaults of all parameters\n"
    assert run(lift, "read", "2", "0x1017")[1].split()[-1] == "1000"


# nmt, emcy


@pytest.mark.parametrize(
    ("command", "out"),
    [
        ("pre-operational", "node 2 is pre-operational\n"),
        ("stop", "node 2 is stopped\n"),
        ("start", "node 2 is operational\n"),
    ],
)
def test_nmt_prints_the_state_of_the_heartbeat(run: Run, lift: str, command: str, out: str) -> None:
    assert run(lift, "nmt", "2", command) == (0, out, "")


@pytest.mark.parametrize("command", ["reset", "reset-communication"])
def test_a_reset_is_a_boot_up(run: Run, lift: str, command: str) -> None:
    run(lift, "store", "2")
    assert run(lift, "nmt", "2", command) == (0, "node 2 has booted and is operational\n", "")


def test_nmt_to_all_nodes(run: Run, lift: str) -> None:
    assert run(lift, "nmt", "all", "stop") == (0, "stop sent to all nodes\n", "")
    assert run(lift, "scan", "--listen", "10 ms")[1].splitlines()[1].split() == ["2", *"-", "stopped", *"----"]


def test_emcy_lists_and_clears_a_node_s_error_history(run: Run, lift: str) -> None:
    assert run(lift, "emcy", "2") == (0, "node 2: no error (error register 0x00)\nno error remembered\n", "")
    with can.Bus(interface="virtual", channel=lift) as bus:
        bus.send(can.Message(arbitration_id=0x202, data=b"\1\2", is_extended_id=False))  # half a Move To
    status, out, _ = run(lift, "emcy", "2")
    assert status == 1
    assert out.splitlines()[0] == "node 2: generic error, communication (error register 0x11)"
    assert out.splitlines()[1].startswith("0x8210  pdo too short")
    _, out, _ = run(lift, "emcy", "2", "--json")
    assert json.loads(out)["history"][0]["code"] == ErrorCode.PDO_TOO_SHORT
    assert "no error remembered" in run(lift, "emcy", "2", "--clear")[1]


# export cdcf


def test_a_concise_dcf_is_written(capsys: pytest.CaptureFixture[str], new_dcf: Path, tmp_path: Path) -> None:
    concise = tmp_path / "lift.cdcf"
    assert main(["export", "cdcf", str(new_dcf), "-o", str(concise)]) == 0
    assert capsys.readouterr().out == f"{concise}: 3 writes for node 2\n"


def test_a_concise_dcf_is_shown_in_the_order_of_its_writes(
    capsys: pytest.CaptureFixture[str], new_dcf: Path, tmp_path: Path
) -> None:
    concise = tmp_path / "lift.cdcf"
    main(["export", "cdcf", str(new_dcf), "-o", str(concise)])
    capsys.readouterr()
    assert main(["export", "cdcf", str(concise)]) == 0
    assert capsys.readouterr().out.split() == ["0x1017:0", "0x14", "0x1403:1", "0x80000018", "0x1403:1", "0x18"]
    assert main(["export", "cdcf", str(concise), "--eds", str(LIFT)]) == 0
    assert "0x1403:1  Halt Cause.COB-ID used by PDO  0x80000018" in capsys.readouterr().out


def test_a_damaged_concise_dcf_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    concise = tmp_path / "lift.cdcf"
    concise.write_bytes(b"\1\0\0\0\x17")
    assert main(["export", "cdcf", str(concise)]) == 2
    told = f"eurobot-od: {concise}: not a concise DCF: ends at byte 5, 7 bytes expected at byte 4\n"
    assert capsys.readouterr().err == told


def test_a_concise_dcf_is_printed_only(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    concise = tmp_path / "lift.cdcf"
    concise.write_bytes(b"\0\0\0\0")
    assert main(["export", "cdcf", str(concise), "-o", str(tmp_path / "lift.dcf")]) == 2
    assert "is printed, without -o" in capsys.readouterr().err


PDOS = pdo(0x1400, "0x20000010", cob_id="$NODEID+0x200") + pdo(0x1401, "0x2F000008", cob_id="$NODEID+0x300")
LIST = "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
CONFIGURED = (LIST + DEVICE_TYPE + variable("2000", "Speed", "INTEGER16") + PDOS).replace(
    "DefaultValue=$NODEID", "ParameterValue=$NODEID"
)


@pytest.fixture
def configured(tmp_path: Path) -> Path:
    """A DCF without lists of other objects, whose second PDO maps what is not there."""
    (tmp_path / "motor.dcf").write_text(f"{CONFIGURED}[DeviceComissioning]\nNodeID=7\n")
    return tmp_path / "motor.dcf"


FOR_WHOM = [(["{}"], 0x207), (["5={}"], 0x205)]


@pytest.mark.parametrize(("words", "identifier"), FOR_WHOM)
def test_a_concise_dcf_is_made_for_the_node_that_is_said(
    capsys: pytest.CaptureFixture[str], configured: Path, words: list[str], identifier: int
) -> None:
    assert main(["export", "cdcf", *(each.format(configured) for each in words)]) == 0
    said = capsys.readouterr()
    rows = [each.split() for each in said.out.splitlines()]
    # off, and on again; nothing of the PDO that maps what is not there
    assert [(row[0], int(row[-1], 0)) for row in rows] == [("0x1400:1", identifier | 1 << 31), ("0x1400:1", identifier)]
    assert said.err == f"eurobot-od: PDO left out: {configured}: 0x1601: maps 0x2F00 sub 0, which is missing\n"


def test_the_concise_dcfs_of_a_network_are_written_into_a_folder(
    capsys: pytest.CaptureFixture[str], configured: Path
) -> None:
    network = configured.with_name("network.yaml")
    network.write_text("nodes:\n  left: {file: motor.dcf, node_id: 5}\n  right: {file: motor.dcf, node_id: 6}\n")
    folder = configured.with_name("made")
    assert main(["export", "cdcf", str(network), "-o", str(folder)]) == 0
    assert sorted(each.name for each in folder.iterdir()) == ["left.cdcf", "right.cdcf"]
    assert capsys.readouterr().out.splitlines()[1].endswith("right.cdcf: 2 writes for node 6")
    assert main(["export", "cdcf", str(network)]) == 0
    assert [each for each in capsys.readouterr().out.splitlines() if each.endswith(":")] == ["left:", "right:"]


NODE_ID_IS_A_SETTING = DEVICE_TYPE + "".join(
    (
        record(0x1011, "Restore", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "1")),
        record(0x5900, "CANopen setup", (0, "UNSIGNED8", "1")),
        variable("5900sub1", "Node-ID", "UNSIGNED8", "1"),
    )
).replace("SubNumber=1\n", "SubNumber=2\n")


def test_a_node_with_restored_defaults_is_awaited_under_its_default_node_id(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "mover.eds"
    file.write_bytes(in_normal_form(NODE_ID_IS_A_SETTING.encode())[0])
    channel = new_channel()
    with Live.node(open_bus(channel), SimulatedDevice(Dictionary.load(file, 5))):
        words = ("restore", "5", "--reset", "--eds", f"5={file}")
        assert run(channel, *words) == (
            0,
            "node 5 has the defaults of all parameters\n",
            "eurobot-od: the node-ID of node 5 is a setting, too: from its next reset on it is 1\n",
        )
        assert run(channel, "read", "1", "0x5900:1", "--eds", f"1={file}")[1].split()[-1] == "1"
