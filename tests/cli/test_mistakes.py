"""What people get wrong in their first week, on the command line and in YAML, and exactly what is printed then."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.traffic.formats import FORMATS
from tests.check.suites import HEAD
from tests.cli.console import Said, run
from tests.kit import plant

EDS = plant.FILES.folder() / "lift.eds"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run in a folder with an EDS, two logs and a picture, without a configuration of python-can's."""
    (tmp_path / "lift.eds").write_bytes(EDS.read_bytes())
    (tmp_path / "net.yaml").write_text(
        "nodes:\n  lift: {file: lift.eds, node_id: 5}\n  door: {file: lift.eds, node_id: 5}\n"
    )
    (tmp_path / "own.check.yaml").write_text("spec: 1\nname: own\nnode: lift\nsteps: []\n")
    (tmp_path / "frames.txt").write_text("(1.0) can0 705#05\n")
    (tmp_path / "plant.dbc").write_text('VERSION ""\n\nBS_:\n\nBU_: lift\n\nBO_ 5 A: 1 lift\n')
    (tmp_path / "empty.eds").write_bytes(b"")
    (tmp_path / "mine.py").write_text("async def play(core): ...\n")
    (tmp_path / "gone.yaml").write_text("nodes:\n  lift: {file: lift.eds, node_id: 5}\n  door: {file: lft.eds}\n")
    (tmp_path / "damaged.blf").write_bytes(b"LOGG" + bytes(range(256)))
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")
    monkeypatch.chdir(tmp_path)
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)


# The command line: words, exit status, and the one line that is printed

READ = "-o lift.eds is a file that is read: name another one"

MISTAKES = {
    "a command with a slip": (
        "decod|run.log",
        2,
        "unknown command 'decod'; did you mean decode?",
    ),
    "a command of other programs": ("upload|5|0x1000|-i|virtual", 2, "unknown command 'upload'; here that is read"),
    "a file in place of a form": (
        "export|lift.eds|dbc",
        2,
        "the form comes first: eurobot-od export FORM --eds lift.eds",
    ),
    "a file of a device as a log": (
        "decode|lift.eds",
        2,
        "lift.eds: not a known log; it is a device's file: --eds names it, as in --eds 5=FILE",
    ),
    "a command of a robot": (
        "match|--seed|3",
        2,
        "match is a command of eurobot2014: write eurobot-od match, or eurobot-od --robot eurobot2014 match",
    ),
    "options before the command": (
        "-i|virtual|monitor",
        2,
        "error: unrecognized arguments: -i monitor; the command comes first: eurobot-od COMMAND -i ...; "
        "see eurobot-od --help",
    ),
    "a file of a device without its option": (
        "export|dbc|lift.eds",
        2,
        "export dbc: error: unrecognized arguments: lift.eds; the file of a device is --eds lift.eds; "
        "see eurobot-od export dbc --help",
    ),
    "an adapter without its channel": (
        "monitor|-i|kvaser",
        3,
        "cannot open the kvaser bus: KvaserBus.__init__() missing 1 required positional argument: 'channel'; "
        "name its channel: -c; `doctor` lists what is here",
    ),
    "an adapter without its driver": (
        "monitor|-i|pcan",
        3,
        "cannot open the pcan bus: pcanbasic library not found.; it needs PEAK's driver with PCAN-Basic",
    ),
    "a message with a slip": (
        "send|Move Tx|x=1",
        2,
        "unknown message 'Move Tx'; did you mean Move To?",
    ),
    "a field forgotten": ("send|Move To|x=1|-i|virtual", 2, "Move To: y, angle, speed missing"),
    "a value out of range": (
        "send|Move To|x=5000|y=1|angle=2|speed=3",
        2,
        "Move To: x = 5000 is not allowed; allowed: 0..3000 mm",
    ),
    "a node with a slip": ("node|lft", 2, "unknown node 'lft'; did you mean lift?"),
    "a file of a device as a node": (
        "node|lift.eds",
        2,
        "lift.eds is a device's file: write --eds 5=lift.eds, with its node-ID",
    ),
    "a node of another robot": (
        "node|gripper",
        2,
        "unknown node 'gripper'; known: lift, panel, scale; --robot FOLDER takes another robot's",
    ),
    "a fault with a slip": (
        "node|lift|--fault|move-confrm-not-sent",
        2,
        "unknown fault 'move-confrm-not-sent'; "
        "did you mean move-confirm-not-sent or move-to-not-sent or move-confirm-not-heard?",
    ),
    "an interface with a slip": (
        "scan|-i|socketcn|-c|can0",
        3,
        "cannot open the socketcn bus can0: unknown interface 'socketcn'; did you mean socketcan or socketcand?",
    ),
    "the input as the output": (
        "export|xdd|lift.eds|-o|lift.eds",
        2,
        "-o lift.eds is a file that is read: name another one",
    ),
    "... of an option": (
        "export|docs|--eds|5=lift.eds|-o|./lift.eds",
        2,
        "-o lift.eds is a file that is read: name another one",
    ),
    "... of a repair": (
        "lint|--fix|lift.eds|-o|lift.eds",
        2,
        "-o lift.eds is a file that is read: name another one",
    ),
    "... of a report": (
        "check|--conformance|--eds|5=lift.eds|--simulate|--junit|lift.eds",
        2,
        "--junit lift.eds is a file that is read: name another one",
    ),
    "... of a log": ("monitor|lift.eds|--log|lift.eds", 2, "--log lift.eds is a file that is read: name another one"),
    "lint of a log": (
        "lint|frames.txt",
        2,
        "frames.txt: not an EDS: it has no section of one; it is a log: decode shows it, diagnose judges it",
    ),
    "a log as a device's file": (
        "show|--eds|5=frames.txt",
        2,
        "frames.txt: not an EDS: it describes no object; it is a log: decode shows it, diagnose judges it",
    ),
    "lint of what is not an EDS": ("lint|picture.png", 2, "picture.png: not an EDS: it has no section of one"),
    "a word as a rule": (
        "lint|--select|errors|lift.eds",
        2,
        "ERRORS begins no rule's code: write E for errors, W for warnings, or such as W447",
    ),
    "a name without quotes": (
        "edit|lift.eds|add|0x2102|Filter|time|type=UNSIGNED8",
        2,
        "time: write KEY=VALUE; a name with spaces needs quotes: 'Filter time'",
    ),
    "a rule with a slip": ("lint|--select|E3008|lift.eds", 2, "unknown rule 'E3008'; did you mean E308?"),
    "a file with a slip": ("show|--eds|5=lif.eds", 2, "lif.eds: No such file or directory; did you mean lift.eds?"),
    "a name where a node-ID stands": ("show|--eds|lift=lift.eds", 2, "lift.eds: node-ID lift is not in 1..127"),
    "node and file in the wrong order": (
        "configure|lift.dcf|2|-i|virtual",
        2,
        "lift.dcf is a file, not a node: a node-ID 1..127 goes there; --eds names a device's file",
    ),
    "... without a robot": (
        "--robot|none|configure|lift.dcf|2|-i|virtual",
        2,
        "lift.dcf is a file, not a node: a node-ID 1..127 goes there; --eds names a device's file",
    ),
    "an EDS as a configuration": (
        "configure|2|lift.eds|-i|virtual",
        2,
        "lift.eds: incomplete: no NodeID in [DeviceComissioning]; a DCF has one, such as `dump -o` writes",
    ),
    "an EDS as a suite": (
        "check|lift.eds|--simulate",
        2,
        "lift.eds is a device's file, not a suite; write --conformance --eds 5=lift.eds",
    ),
    "a program as a suite": (
        "check|mine.py|--simulate",
        2,
        "mine.py is a Python program, not a suite: a suite is YAML",
    ),
    "an option that is an argument": (
        "export|xdd|--eds|lift.eds",
        2,
        "export xdd: error: unrecognized arguments: --eds; that is an argument here, not an option; "
        "write eurobot-od export xdd FILE; see eurobot-od export xdd --help",
    ),
    "a time after another one": (
        "decode|frames.txt|--since|2s|--until|1s",
        2,
        "--since 2 s is after --until 1 s: no entry is between them",
    ),
    "a file for a folder": (
        "export|canopennode|lift.eds|-o|OD.c",
        2,
        "-o OD.c is to be a folder, for OD.h and OD.c; write -o firmware",
    ),
    "a folder that is not empty": ("new-device|.", 2, ".: it is there, and not empty; name a new folder"),
    "a mapping without objects": ("edit|lift.eds|map|TPDO1", 2, "write map PDO OBJECT..."),
    "a suite as a device's file": (
        "lint|own.check.yaml",
        2,
        "own.check.yaml: not an EDS: it has no section of one; it is checked by check own.check.yaml",
    ),
    "a version as a command": ("version", 2, "unknown command 'version'; here that is --version"),
    "two conditions in one": (
        "decode|frames.txt|--where|x > 1000 and x < 2000",
        2,
        "'x > 1000 and x < 2000': a filter is one comparison; give several, and an entry has to fit them all",
    ),
    "a colon after a field": ("send|Move To|x:5|-i|virtual", 2, "x:5: write FIELD=VALUE, such as x=5"),
    "a PDO forgotten": (
        "pdo|5|disable|-i|virtual",
        2,
        "disable which PDO, and what? Write `disable TPDO1`; `pdo 5` lists the PDOs",
    ),
    "an object that exists already": (
        "edit|lift.eds|add|0x1017|Heartbeat|type=UNSIGNED16",
        2,
        "0x1017: 0x1017 exists already, with an ObjectType: `set` changes it; a new one takes a free index",
    ),
    "an index too high": (
        "read|2|0x12345|--eds|2=lift.eds|-i|virtual",
        2,
        "'0x12345' is not an index; write INDEX[:SUB], such as 0x1018 or 0x1018:1",
    ),
    "a form with a slip": ("export|wiresark", 2, "unknown form 'wiresark'; did you mean wireshark?"),
    "a log that is not there": ("decode|nowhere.log", 2, "nowhere.log: No such file or directory"),
    "a log of another format": (
        "decode|picture.log",
        2,
        "picture.log: No such file or directory; did you mean picture.png?",
    ),
    "a damaged log": (
        "diagnose|damaged.blf",
        2,
        "damaged.blf: nothing in it can be read as a frame: a file header of 50462976 bytes; at most 1048576 are read",
    ),
    "a filter of candump as a log": (
        "decode|frames.txt|705:7FF",
        2,
        "705:7FF: No such file or directory; a filter is --message, --node or --where; monitor has --filter 705",
    ),
    "a DBC as a log": ("decode|plant.dbc|frames.txt", 2, "plant.dbc: not a known log; it is a DBC: --dbc names it"),
    "a DBC as a device's file": (
        "decode|frames.txt|--eds|plant.dbc",
        2,
        "plant.dbc: not an EDS: it describes no object; it is a DBC: --dbc names it",
    ),
    "an empty file of a device": ("lint|empty.eds", 2, "empty.eds: the file is empty"),
    "a rule that there is not": (
        "lint|--explain|W999",
        2,
        "unknown rule 'W999'; 237 are known, and none is like it; docs/lint-rules.md lists them",
    ),
    "a network's file that is not there": (
        "lint|--network|gone.yaml",
        2,
        "lft.eds: No such file or directory; did you mean lift.eds?; "
        "it is the file of door, line 3 of the network file",
    ),
    "... to show": (
        "show|--network|gone.yaml",
        2,
        "lft.eds: No such file or directory; did you mean lift.eds?; "
        "it is the file of door, line 3 of the network file",
    ),
    "an object before its node": (
        "read|0x2000:1|5|--eds|lift.eds|-i|virtual",
        2,
        "'0x2000:1' is not a node-ID 1..127, which comes first, as in `read 5 0x1018`; "
        "for names there are --eds, --network and --robot",
    ),
    "a device's file as a program": (
        "program|5|lift.eds|-i|virtual",
        2,
        "lift.eds is a device's file, no program; --force downloads it all the same",
    ),
    "a channel as a node": (
        "--robot|none|watch|can0|-i|virtual",
        2,
        "unknown node 'can0'; the bus is -i socketcan -c can0",
    ),
    "a channel as a log": (
        "monitor|can0",
        2,
        "can0: No such file or directory; the bus is -i socketcan -c can0",
    ),
    "a log and a time of listening": (
        "diagnose|frames.txt|--for|10s",
        2,
        "--for is for a bus: leave it out, or frames.txt",
    ),
    "a log and a bus": (
        "diagnose|frames.txt|-i|virtual|-c|a",
        2,
        "a log or a bus, not both: leave out -i and -c, or frames.txt",
    ),
    "a log, played on no bus": (
        "monitor|frames.txt|--no-reconnect",
        2,
        "--no-reconnect is for a bus: leave it out, or frames.txt",
    ),
    "a log on a page, and a bus": (
        "serve|frames.txt|-c|can0",
        2,
        "a log or a bus, not both: leave out -i and -c, or frames.txt",
    ),
    "two files and a bus": (
        "diff|lift.eds|lift.eds|-i|virtual",
        2,
        "two files, or a file and a live node: leave out -i and -c, or lift.eds",
    ),
    "a bit rate of frames that are not counted": (
        "decode|frames.txt|-b|250000",
        2,
        "--bitrate is for --statistics",
    ),
    "a bus and an option of logs": (
        "monitor|--speed|10|-i|virtual",
        2,
        "--speed is for a log: name one, or leave it out",
    ),
    "a condition without its operator": (
        "decode|frames.txt|--where|speed",
        2,
        "'speed' is not a comparison such as `x>1000` or `MESSAGE.x>1000`; "
        "write it in quotes, as a shell takes > and < for itself",
    ),
    "a tolerance with a unit": (
        "compare|frames.txt|frames.txt|--tolerance|speed=5rpm",
        2,
        "--tolerance speed=5rpm: not a number, 0 or more; it is in the unit of the field, and has none itself",
    ),
    "a field without files": (
        "--robot|none|compare|frames.txt|frames.txt|--tolerance|speed=5",
        2,
        "unknown field 'speed'; names come from the devices' files: --eds or --network",
    ),
    "a node without files": (
        "--robot|none|export|suite|frames.txt|--node|motor",
        2,
        "unknown node 'motor'; names come from the devices' files: --eds or --network",
    ),
    "an option as a command": (
        "conformance|--eds|5=lift.eds",
        2,
        "unknown command 'conformance'; here that is check --conformance",
    ),
    "a folder as a log": ("decode|.", 2, ".: Is a directory; name its files, such as ./*"),
    "a pattern without a match": ("decode|*.trc", 2, "*.trc: No such file or directory; no file matches this pattern"),
    "a colon after a node-ID": ("show|--eds|5:lift.eds", 2, "5:lift.eds: No such file or directory; write 5=lift.eds"),
    "a node-ID apart from its file": (
        "check|--conformance|--eds|5|lift.eds|--simulate",
        2,
        "5: a node-ID without its file; write 5=motor.eds",
    ),
    "a node-ID after its file": ("show|--eds|lift.eds=5", 2, "lift.eds=5: the node-ID comes first; write 5=lift.eds"),
    "a folder of suites": ("check|.|--simulate", 2, ". is a folder: name its files, such as *.yaml"),
    "a frame in several words": (
        "send|0x123|01|02|-i|virtual",
        2,
        "a frame is one word: write send 123#0102",
    ),
    "a frame's identifier alone": (
        "--robot|none|send|123|-i|virtual",
        2,
        "a frame is ID#DATA: write send 123#, or with data after the #",
    ),
    "a sub-index as a word": (
        "read|5|0x1018|1|-i|virtual",
        2,
        "1 is not an index; write a sub-index after a colon: 0x1018:1",
    ),
    "a node forgotten": (
        "--robot|none|write|0x1017|500|-i|virtual",
        2,
        "'0x1017' is not a node-ID 1..127, which comes first, as in `read 5 0x1018`; "
        "for names there are --eds, --network and --robot",
    ),
    "an output of a check": (
        "lint|lift.eds|-o|new.eds",
        2,
        "-o new.eds goes with --fix only: without it nothing is written",
    ),
    "a file that is no log": (
        "decode|picture.png",
        2,
        f"picture.png: not a known log; --format names its format ({', '.join(FORMATS)}); any other program's frames "
        "are read as CSV whose first line names the columns: time, id, data",
    ),
    "all nodes by number": ("nmt|0|start|-i|virtual", 2, "node 0 stands for all nodes: write `nmt all start`"),
    "a node-ID in hexadecimal": ("read|0xFF|0x1000|-i|virtual", 2, "node-ID 255 is not in 1..127"),
    "another command of other programs": (
        "heartbeat|5",
        2,
        "unknown command 'heartbeat'; here that is watch NODE, or write NODE 0x1017 MS for its period",
    ),
    "a kernel's interface": (
        "scan|-i|vcan|-c|vcan0",
        3,
        "cannot open the vcan bus vcan0: unknown interface 'vcan'; vcan0 is a channel of socketcan: -i socketcan",
    ),
    "a network file alone": (
        "lint|net.yaml",
        2,
        "net.yaml: not an EDS: it has no section of one; it is checked by lint --network net.yaml",
    ),
    "a node-ID twice": (
        "show|--network|net.yaml",
        2,
        "net.yaml:3: nodes lift and door both have node-ID 5",
    ),
    "a node-ID too high": ("read|200|0x1000|-i|virtual", 2, "node-ID 200 is not in 1..127"),
    "a node that is not there": (
        "read|9|0x1000|-i|virtual|-c|nobody|--timeout|50ms",
        1,
        "no answer from node 9 within 50 ms after the question which device it is; "
        "nothing was heard of it since the last command: is it there, at this node-ID and bit rate?",
    ),
}

USAGES = {
    "a begin as others call it": (
        "decode|run.log|--from|1s",
        "unrecognized arguments: --from 1s; here that is --since",
    ),
    "a filter as others call it": ("monitor|run.log|--id|5", "unrecognized arguments: --id 5; here that is --filter"),
    "a period as others call it": ("sync|--rate|10", "unrecognized arguments: --rate 10; here that is --period"),
    "... of the error history": ("emcy|5|--reset", "unrecognized arguments: --reset; here that is --clear"),
    "a velocity as others call it": (
        "drive|5|speed|100",
        "argument {status,enable,disable,home,move,jog,stop,reset}: unknown value 'speed'; "
        "known: status, enable, disable, home, move, jog, stop, reset; here that is jog; "
        "write eurobot-od drive NODE ACTION VALUE",
    ),
    "an option as others call it": (
        "monitor|--duration|3s",
        "unrecognized arguments: --duration; here that is --for",
    ),
    "an action as others call it": (
        "lss|scan|-i|virtual",
        "argument {find,set}: unknown value 'scan'; known: find, set; here that is find",
    ),
    "a word for a command without any": (
        "sync|5|-i|virtual",
        "unrecognized arguments: 5; sync takes options only; its options: --counter, --period, --count, --cob-id, "
        "--no-reconnect, --interface, --channel, --bitrate",
    ),
    "a range that is always asked": (
        "scan|--nodes|1-10",
        "unrecognized arguments: --nodes 1-10; it asks every node-ID from 1 to 127",
    ),
    "a mode that the command sets": (
        "drive|5|jog|100|--mode|pv|-i|virtual",
        "unrecognized arguments: --mode pv; the command sets the mode: move and jog, or home",
    ),
    "a long period without its unit": (
        "sync|--period|100|-i|virtual",
        "argument --period: 100 without a unit would be 100 s; write 100ms, or 100s",
    ),
    "a wait that is meant in ms": (
        "drive|5|move|0|--within|3000|-i|virtual",
        "argument --within: 3000 without a unit would be 3000 s; write 3000ms, or 3000s",
    ),
    "a time of listening that is meant in ms": (
        "monitor|--for|5000|-i|virtual",
        "argument --for: 5000 without a unit would be 5000 s; write 5000ms, or 5000s",
    ),
    "a bus where logs are read": (
        "decode|-i|virtual",
        "unrecognized arguments: -i; it reads logs: monitor, diagnose and serve take a bus",
    ),
    "a table as JSON": (
        "decode|frames.txt|--statistics|--json",
        "argument --json: not allowed with argument --statistics",
    ),
    "a channel without its option": ("scan|can0", "unrecognized arguments: can0; the bus is -i socketcan -c can0"),
    "a node as an option": (
        "read|--node|5|0x1000|-i|virtual",
        "unrecognized arguments: --node; that is an argument here, not an option; write eurobot-od read NODE OBJECTS",
    ),
    "an action as an option": (
        "lss|--find|-i|virtual",
        "unrecognized arguments: --find; that is an argument here, not an option; write eurobot-od lss ACTION",
    ),
    "an option as a word": ("emcy|5|clear|-i|virtual", "unrecognized arguments: clear; did you mean --clear?"),
    "a node-ID apart from its file": (
        "check|--conformance|--id|5|--eds|lift.eds",
        "unrecognized arguments: --id; a node-ID stands before the file, as in 5=motor.eds",
    ),
    "an output without its option": (
        "dump|5|new.dcf|-i|virtual",
        "unrecognized arguments: new.dcf; the file to write is -o new.dcf",
    ),
    "a word too many": (
        "write|5|0x1017|=|500|-i|virtual",
        "unrecognized arguments: 500; write eurobot-od write NODE NAME VALUE; a value with spaces needs quotes",
    ),
    "a state in place of a command": (
        "nmt|5|operational|-i|virtual",
        "argument {start,stop,pre-operational,reset,reset-communication}: unknown value 'operational'; "
        "here that is start; write eurobot-od nmt NODE COMMAND",
    ),
    "a port as others call it": ("serve|--port|80", "unrecognized arguments: --port; here that is --listen"),
    "an option that only begins like another one": (
        "serve|--for|3s",
        "unrecognized arguments: --for; did you mean --format?",
    ),
    "a bit rate in words": (
        "scan|-b|fast",
        "argument -b/--bitrate: fast is not in 1000..1000000 bit/s, such as 500000 or 500k",
    ),
    "a speed in words": ("monitor|--speed|fast", "argument --speed: fast is not a positive number nor max"),
    "a time with an unknown unit": (
        "node|lift|--for|10h",
        "argument --for: '10h' is not a duration; write a number and one of us, ms, s, min, such as 500 ms",
    ),
    "a number in words": ("check|--seed|one", "argument --seed: one is not a whole number"),
    "an option with a slip": (
        "check|--confromance|--simulate",
        "unrecognized arguments: --confromance; did you mean --conformance?",
    ),
    "... with another ending": (
        "check|--conformity|--simulate",
        "unrecognized arguments: --conformity; did you mean --conformance?",
    ),
    "an option of pytest": ("check|mine.yaml|-k|Temp", "unrecognized arguments: -k Temp; here that is --step"),
    "an option that a suite has": (
        "check|mine.yaml|--timeout|5s",
        "unrecognized arguments: --timeout 5s; a suite has `timeout:`, a step `within:`",
    ),
    "an option without its value": ("check|--step", "argument --step: expected one argument"),
}


@pytest.mark.parametrize(("words", "status", "printed"), MISTAKES.values())
def test_a_mistake_on_the_command_line(
    words: str, status: int, printed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, *words.split("|"))
    assert (said.status, said.out) == (status, "")
    assert said.err in (f"eurobot-od: {printed}\n", f"eurobot-od {printed}\n")


@pytest.mark.parametrize(("words", "printed"), USAGES.values())
def test_a_wrong_usage(words: str, printed: str, capsys: pytest.CaptureFixture[str]) -> None:
    command, *others = words.split("|")
    line = f"eurobot-od {command}: error: {printed}; see eurobot-od {command} --help\n"
    assert run(capsys, command, *others) == Said(2, "", line)


WITH_A_BUS = [
    ["scan"],
    ["read", "lift", "0x1000"],
    ["send", "Halt Lift"],
    ["node", "lift"],
    ["check", "--conformance", "--eds", "2=lift.eds"],
    ["monitor"],
    ["watch", "2"],
    ["sync"],
    ["time"],
    ["nmt", "lift", "start"],
    ["lss", "find"],
    ["diff", "lift.eds", "--node", "2"],
    ["monitor", "-c", "can0"],
]


@pytest.mark.parametrize("words", WITH_A_BUS)
def test_a_command_without_a_bus_names_the_option(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, *words)
    assert said.status == 2
    assert said.err.startswith("eurobot-od: which bus? Name it by -i and -c, such as -i socketcan -c can0; here: ")
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_a_check_without_a_bus_names_the_way_without_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "check", "--conformance", "--eds", "2=lift.eds").err.endswith("; --simulate needs none\n")


# YAML: a suite's text, and all that is printed; steps stand below HEAD, from line 5 on

TEXTS = {
    "no version": ("name: a\nsteps: [skip: x]\n", ["1:1: key 'spec' is missing: version of the format, `spec: 1`"]),
    "another version": ("spec: 2\nname: a\nsteps: [skip: x]\n", ["1:7: unknown version '2'; known: 1"]),
    "a key with a slip": (
        "spec: 1\nname: a\nstep: []\n",
        ["1:1: key 'steps' is missing: the steps", "3:1: unknown key 'step'; did you mean steps?"],
    ),
    "a node with a slip": (
        "spec: 1\nname: a\nnode: lft\nsteps: [skip: x]\n",
        ["3:7: unknown node 'lft'; did you mean lift?"],
    ),
    "a colon in a text": (
        "spec: 1\nname: the lift: stops\nsteps: [skip: x]\n",
        ["2:15: a ': ' in a text needs quotes; or this line is indented wrongly"],
    ),
    "nothing": ("", ["1:1: the file is empty"]),
    "no steps yet": (f"{HEAD}steps:\n", ["4:7: expected a list, found nothing"]),
}

STEPS = {
    "indented otherwise": (
        "  - send: Halt Lift\n   - wait: 1 s\n",
        "6:4: this line is not indented like those it belongs to",
    ),
    "a tab": ("\t- send: Halt Lift\n", "5:1: a tab; YAML is indented by spaces"),
    "a colon forgotten": (
        "  - send Halt Lift\n",
        "5:5: expected a mapping, `key: value`, found 'send Halt Lift'",
    ),
    "a bracket forgotten": (
        "  - send: {Move To: {x: 1, y: 1, angle: 2, speed: 3}\n",
        "6:1: a mapping in { } lacks a comma, or its }; behind ' #' all is a comment",
    ),
    "a quote forgotten": ("  - wait: '1 s\n", "6:1: a quote that begins a text is never closed"),
    "an expectation without quotes": (
        "  - expect: {Move State Response: {time: > 0}}\n",
        "5:42: a text with > or | at its start needs quotes: '> 0'",
    ),
    "a variable without quotes": (
        "  - expect: {Move State Response: {time: {t}}}\n",
        "5:42: expected a single value, found a mapping; a text in { } needs quotes: '{t}'",
    ),
    "a variable that nobody has saved": (
        "  - expect: {Move State Response: {time: '{t}'}}\n",
        "5:42: unknown variable 't'; a step before it saves one, `save: t`, or the head has `variables:`",
    ),
    "an action with a slip": ("  - sned: Halt Lift\n", "5:5: unknown action 'sned'; did you mean send?"),
    "two actions": (
        "  - send: Halt Lift\n    wait: 1 s\n",
        "6:5: a step has one action, and 'send' is one already",
    ),
    "a key of another action": (
        "  - send: Halt Lift\n    within: 1 s\n",
        "6:5: unknown key 'within'; known: send, name, repeat, needed, undo, above",
    ),
    "a message with a slip": (
        "  - send: Halt Lyft\n",
        "5:11: unknown message 'Halt Lyft'; did you mean Halt Lift?",
    ),
    "a field with a slip": (
        "  - send: {Move To: {x: 1, y: 1, angle: 2, sped: 3}}\n",
        "5:44: unknown field of Move To 'sped'; did you mean speed?",
    ),
    "a field forgotten": ("  - send: {Move To: {x: 1, y: 1, angle: 2}}\n", "5:11: Move To: speed missing"),
    "a value out of range": (
        "  - send: {Move To: {x: 3001, y: 1, angle: 2, speed: 3}}\n",
        "5:25: '3001' is not allowed; allowed: 0..3000 mm; {raw: '202#...'} sends any bits",
    ),
    "a time without its unit": (
        "  - wait: 500\n",
        "5:11: '500' is not a duration; write a number and one of us, ms, s, min, such as 500 ms",
    ),
    "an object's name with a slip": (
        "  - sdo: {read: Identity objct}\n",
        "5:17: unknown object 'Identity objct'; did you mean Identity object?",
    ),
    "an object's value out of range": (
        "  - sdo: {write: 0x1017, value: 70000}\n",
        "5:33: 0x1017:0: Producer heartbeat time = 70000 is not allowed; allowed: 0..65535",
    ),
    "a state with a slip": (
        "  - heartbeat: operationl\n",
        "5:16: unknown NMT state 'operationl'; did you mean operational or pre-operational?",
    ),
    "a command with another name": (
        "  - nmt: restart\n",
        "5:10: unknown NMT command 'restart'; did you mean start?",
    ),
    "an error code without 0x": ("  - emcy: 8130\n", "5:11: '8130' is hexadecimal; did you mean 0x8130?"),
    "... of a node": ("  - emcy: {code: FF00}\n", "5:18: 'FF00' is hexadecimal; did you mean 0xFF00?"),
    "an abort code without 0x": (
        "  - sdo: {read: 0x5000, abort: 06020000}\n",
        "5:32: '06020000' is hexadecimal; did you mean 0x06020000?",
    ),
    "an identifier without 0x": ("  - unheard: 705\n", "5:14: '705' is hexadecimal; did you mean 0x705?"),
    "a span forgotten": ("  - never: Move Confirm\n", "5:5: key 'for' is missing: how long none may come"),
    "a period forgotten": (
        "  - poll: {send: Move State Request}\n    until: {Move State Response: {time: 0}}\n",
        "5:11: key 'every' is missing: time from one to the next",
    ),
    "a frame as it is not written": (
        "  - send: {raw: 008 0102}\n",
        "5:17: expected a frame such as 008#D27423, found '008 0102'",
    ),
    "a word that YAML reads as another": (
        "  - name: off\n    wait: 1 s\n",
        "5:11: expected a text, found 'off', which needs quotes to be one",
    ),
}
ALL = TEXTS | {f"step: {name}": (f"{HEAD}steps:\n{text}", [line]) for name, (text, line) in STEPS.items()}


@pytest.mark.parametrize(("text", "printed"), ALL.values())
def test_a_mistake_in_yaml(text: str, printed: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.yaml").write_text(text)
    lines = "".join(f"mine.yaml:{line}\n" for line in printed)
    assert run(capsys, "check", "mine.yaml", "--simulate") == Said(cli.ExitStatus.WRONG_INPUT, "", lines)


def test_a_log_as_a_suite_is_told_as_one(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "frames.txt", "--simulate")
    assert (said.status, said.complaint) == (
        2,
        "eurobot-od: frames.txt: it is a log: decode shows it, diagnose judges it",
    )
