"""The command decode: a match and a damaged log through every form of output, filters, exit status, pipes."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.frame import Frame
from eurobot_od.loading import ROBOTS
from tests.cli.console import run
from tests.client.wired import WiredBus
from tests.eds_text import DEVICE_TYPE, pdo, variable
from tests.kit import plant
from tests.kit.plant import messages as m

PROTOCOL = plant.protocol()
MOVE = PROTOCOL.encode(m.MoveTo(1200, 900, 90, 80, 2 << 2))
HERE = PROTOCOL.encode(m.PlaceResponse(254, 255, None, m.Source.ENCODER))

GOOD = [
    f"(10.000000) can0 {MOVE}",
    "(10.500000) can0 182#",
    f"(11.000000) can0 {HERE}",
    "(11.250000) can0 702#05",
]
TEXT = """\
    10.000000  can0  Move To                       x=1200 mm, y=900 mm, angle=90 deg, speed=80 %, gates=gate-2:locked
    10.500000  can0  Move Confirm
    11.000000  can0  Place Response                x=254 mm, y=255 mm, angle=unknown, source=encoder
    11.250000  can0  Heartbeat                     lift, operational
"""

PLAIN = {
    # a frame of a bus of which there is no file, and what it is without a robot: by number, CiA 301's predefined set
    "080#": "SYNC",
    "181#3702": "PDO 0x181, 2 bytes            37 02",
    "701#05": "Heartbeat                     node 1, operational",
    "000#0105": "NMT                           start, node 5",
    "605#4000100000000000": "SDO                           node 5, read 0x1000:00",
    "085#1081010000000000": "EMCY                          node 5, 0x8110 overrun, register 0x01, 00 00 00 00 00",
    "100#C0A80C051234": "TIME                          2020-06-30 23:31:55.712",
    "7E5#0401000000000000": "LSS                           all devices into state configuration",
    "181#R": "PDO 0x181                     remote frame: asks for it",
}

SCRIPT = [sys.executable, "-m", "eurobot_od", "decode"]

DAMAGED = [
    GOOD[0],
    "garbage in the log",
    "(10.1) can0 202#D27423",
    "(10.2) can0 18FF0001#AABB",
    "(10.3) can0 202#R",
    "(10.4) can0 20000080#0000000000000000",
    "(10.5) can0 202##1AABB",
    "(10.6) can0 123#01",
    "(10.7) can0 020#",
    "(10.8) can0 202#FFFFFFFFFFFFFFFF",
    "(10.9) can0 282#01020304",
    *GOOD[1:],
    "(12.0) can0 0",
]
REPORT = {
    "unreadable": ("1", "2: garbage in the log"),
    "cut off": ("1", "15: (12.0) can0 0"),
    "error frame": ("1", "6: 20000080#0000000000000000"),
    "unknown identifier": ("2", "8: 123#01: in no file; its identifier is reserved for safety (SRDO)"),
    "wrong length": ("2", "3: Move To (0x202): 3 bytes of data, expected 6 or 8"),
    "out of range": ("4", "10: Move To: x = 4095, allowed: 0..3000 mm"),
}


@pytest.fixture
def good(tmp_path: Path) -> Path:
    file = tmp_path / "good.log"
    file.write_text("\n".join(GOOD) + "\n")
    return file


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    file = tmp_path / "damaged.log"
    file.write_text("\n".join(DAMAGED))
    return file


def test_text(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", str(good)]) == 0
    assert capsys.readouterr() == (TEXT, "")


@pytest.mark.parametrize("words", [[cli.WORKBENCH], [cli.PROGRAM, "--robot", "none"]])
def test_a_bus_without_any_file(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    program, *options = words
    monkeypatch.delenv(ROBOTS.variable, raising=False)
    monkeypatch.setattr(sys, "argv", [program])
    monkeypatch.chdir(tmp_path)
    Path("plain.log").write_text("".join(f"({n}.0) can0 {frame}\n" for n, frame in enumerate(PLAIN)))
    assert cli.main(["decode", "plain.log", "--strict", *options]) == 0
    said, complaint = capsys.readouterr()
    assert [line.partition("can0  ")[2] for line in said.splitlines()] == [*PLAIN.values()]
    assert complaint == ""


def test_several_logs_are_told_apart(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", str(good), str(good)]) == 0
    assert capsys.readouterr().out == "".join(f"{good}:{line}\n" for line in TEXT.splitlines()) * 2


def test_json(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", "--json", str(good)]) == 0
    move, confirm, here, beat = map(json.loads, capsys.readouterr().out.splitlines())
    assert move["fields"] | {"direction": "", "route": ""} == {
        "x": 1200,
        "y": 900,
        "angle": 90,
        "speed": 80,
        "gates": "gate-2:locked",
        "direction": "",
        "route": "",
    }
    assert (move["id"], move["data"], move["time"], move["line"]) == ("0x202", MOVE.data.hex().upper(), 10.0, 1)
    assert (confirm["message"], confirm["protocol"], confirm["fields"]) == ("Move Confirm", "MOVES", {})
    assert here["fields"] == {"x": 254, "y": 255, "angle": None, "source": "encoder"}
    assert (beat["message"], beat["text"], beat["nodes"]) == ("Heartbeat", "lift, operational", ["lift"])


def test_csv(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", "--csv", str(good)]) == 0
    move, confirm, here, beat = csv.DictReader(capsys.readouterr().out.splitlines())
    assert (move["x"], move["gates"], move["timestamp"], move["line"]) == ("1200", "gate-2:locked", "10.000000", "1")
    assert (confirm["message"], confirm["x"]) == ("Move Confirm", "")
    assert (here["angle"], here["source"]) == ("", "encoder")
    assert (beat["protocol"], beat["text"]) == ("CANopen", "lift, operational")


@pytest.mark.parametrize("form", [[], ["--json"], ["--csv"]])
@pytest.mark.parametrize("filters", [[], ["--message", "SET-UP"], ["--since", "99"]])
def test_damage_is_reported_with_any_filter(
    damaged: Path, capsys: pytest.CaptureFixture[str], form: list[str], filters: list[str]
) -> None:
    assert cli.main(["decode", str(damaged), *form, *filters]) == 0
    report = capsys.readouterr().err.splitlines()
    found = {}
    for line in report:
        count, _, rest = line.strip().partition(" x ")
        kind, _, where = rest.partition(" first at ")
        found[kind.strip()] = (count, where.removeprefix(f"{damaged}:"))
    assert found == REPORT
    assert list(found) == list(REPORT)


def test_damage_costs_no_other_line(damaged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["decode", str(damaged)])
    lines = capsys.readouterr().out.splitlines(keepends=True)
    assert len(lines) == len(DAMAGED)
    assert "".join(line for line in lines if not re.search("!|remote frame|CAN FD|29-bit", line)) == TEXT


def test_a_log_of_which_nothing_can_be_read_is_wrong_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "letter.log"
    log.write_text("Dear Sir,\nplease find enclosed\n")
    for words in (["decode"], ["compare", str(log)], ["archive", "-o", str(tmp_path / "season")]):
        assert cli.main([*words, str(log)]) == 2, words
        assert "nothing in it can be read as a frame" in capsys.readouterr().err


@pytest.mark.parametrize("form", [[], ["--json"], ["--csv"]])
def test_strict(good: Path, damaged: Path, form: list[str]) -> None:
    assert cli.main(["decode", "--strict", *form, str(good)]) == 0
    assert cli.main(["decode", "--strict", *form, str(damaged)]) == 1


@pytest.mark.parametrize(
    ("options", "lines"),
    [
        (["--message", "Move To"], [0]),
        (["--message", "move-to", "--message", "heartbeat"], [0, 3]),
        (["--message", "MOVES"], [0, 1]),
        (["--node", "scale"], []),
        (["--node", "lift", "--message", "CANopen"], [3]),
        (["--where", "x>1000"], [0]),
        (["--where", "x>100", "--where", "x<1000"], [2]),
        (["--since", "10.5", "--until", "11"], [1, 2]),
        (["--since", "10500ms", "--until", "11s"], [1, 2]),
    ],
)
def test_filters(good: Path, capsys: pytest.CaptureFixture[str], options: list[str], lines: list[int]) -> None:
    assert cli.main(["decode", str(good), *options]) == 0
    text = TEXT.splitlines(keepends=True)
    assert capsys.readouterr().out == "".join(text[line] for line in lines)


def test_relative_time(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", str(good), "--relative", "--since", "1"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["1.000000", "1.250000"]


WRONG = [
    (["no-such-file.log"], 2, "No such file"),
    (["log.xyz"], 2, "log.xyz: not a known log; --format names its format (log, candump"),
    (["log.log", "--message", "Move"], 2, "unknown message 'Move'; did you mean MOVES or Move Confirm or Move To"),
    (["log.log", "--node", "Hoist"], 2, "unknown node 'Hoist'; known: panel, lift, scale"),
    (["log.log", "--where", "speed>fast"], 2, "Move To: speed = 'fast' is not allowed; allowed: 0..100 %"),
    (["log.log", "--where", "speed=>1"], 2, "'speed=>1': => is none of =, !=, <, <=, >, >="),
    (["log.log", "--where", "fast"], 2, "'fast' is not a comparison"),
    (["log.log"], 0, "log.log: the file is empty"),
    (["log.log", "--dialect", "nowhere"], 2, "unknown dialect 'nowhere'"),
]


@pytest.mark.parametrize(("arguments", "status", "text"), WRONG)
def test_a_mistake_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    text: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("log.log", "log.xyz"):
        Path(name).write_text("")
    assert cli.main(["decode", *arguments]) == status
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


# As a process


def test_standard_input_from_a_file(good: Path) -> None:
    with good.open("rb") as file:
        done = subprocess.run(SCRIPT, stdin=file, capture_output=True, text=True, check=True)
    assert done.stdout == TEXT


def test_standard_input_from_a_pipe_is_decoded_as_it_comes() -> None:
    with subprocess.Popen([*SCRIPT, "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdin
        assert running.stdout
        for line, expected in zip(GOOD, TEXT.splitlines(keepends=True)):
            running.stdin.write(line + "\n")
            running.stdin.flush()
            assert running.stdout.readline() == expected
        running.stdin.close()
        assert running.wait() == 0


def test_a_closed_pipe_is_no_error(good: Path, tmp_path: Path) -> None:
    file = tmp_path / "long.log"
    file.write_text(good.read_text() * 5000)
    with subprocess.Popen([*SCRIPT, str(file)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert running.stdout
        assert running.stderr
        os.read(running.stdout.fileno(), 100)
        running.stdout.close()
        assert running.stderr.read() == b""
        assert running.wait() == 0


# Statistics


def test_statistics_are_a_table_instead_of_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "good.log"
    file.write_text("\n".join(GOOD))
    assert cli.main(["decode", str(file), "--statistics", "-b", "250000"]) == 0
    heading, confirm, move, here, beat, load = capsys.readouterr().out.splitlines()
    assert heading.split()[:5] == ["ID", "message", "from", "count", "load"]
    assert confirm.split()[-2:] == ["500.00", "3.84"]  # half a second late, and the bound at this bit rate
    assert [line.split()[0] for line in (move, here, beat)] == ["202", "382", "702"]
    assert load.startswith("load of 250 kbit/s: lift ")


def test_statistics_of_several_logs_and_of_some_messages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / name for name in ("one.log", "two.log")]
    for file in files:
        file.write_text("\n".join(GOOD))
    assert cli.main(["decode", *map(str, files), "--statistics", "--message", "Move Confirm"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [lines[0], lines[4]] == [f"{file}:" for file in files]
    assert lines[2].split()[:4] == ["182", "Move", "Confirm", "lift"]


def test_statistics_of_two_buses_are_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [f"({number / 20:.2f}) can{number % 2} 182#\n" for number in range(40, 80)]
    (file := tmp_path / "two.log").write_text("".join(lines))
    assert cli.main(["decode", str(file), "--statistics"]) == 0
    first, _, row, _, second, _, other, _ = capsys.readouterr().out.splitlines()
    assert (first, second) == ("can0:", "can1:")
    assert [each.split()[4:7:2] for each in (row, other)] == [["20", "100.00"]] * 2  # count and worst gap


def test_statistics_call_the_master_by_the_name_that_the_network_file_gives_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, eds, network = (tmp_path / name for name in ("nmt.log", "io.eds", "net.yaml"))
    log.write_text("(1.0) can0 000#0100\n")
    eds.write_text(DEVICE_TYPE)
    network.write_text("nodes: {io: {file: io.eds, node_id: 5}}\nmaster: PC\n")
    for words, master in ((["--network", str(network)], "PC"), (["--eds", f"5={eds}"], "master")):
        assert cli.main(["decode", str(log), "--statistics", *words]) == 0
        assert capsys.readouterr().out.splitlines()[1].split()[:3] == ["000", "NMT", master]


@pytest.mark.parametrize(("options", "said"), [([], 1), (["--message", "SDO"], 1), (["--message", "NMT"], 0)])
def test_a_transfer_that_the_end_of_the_log_cuts_off_is_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: int
) -> None:
    log = tmp_path / "cut.log"
    log.write_text("(1.0) can0 000#0100\n(1.1) can0 605#4008100000000000\n(1.2) can0 585#4108100009000000\n")
    assert cli.main(["decode", str(log), "--statistics", *options]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("SDO")]
    assert lines == ["SDO transfers: 1 read; 0 aborted, 1 without an end, 0 bytes"] * said


def test_statistics_name_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "wrong.log"
    file.write_text("(1.000000) can0 123#01\n")
    assert cli.main(["decode", str(file), "--statistics", "--strict"]) == 1
    assert "1 x unknown identifier" in capsys.readouterr().err


def test_statistics_compare_with_the_network_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "good.log"
    folder = plant.FILES.folder()
    file.write_text("\n".join(GOOD))
    said = []
    for words in ([], ["--network", str(folder.parent / "network.yaml")], ["--network", str(folder)]):
        assert cli.main(["decode", str(file), "--statistics", *words]) == 0
        said.append(capsys.readouterr().out)
    assert said[0] == said[1]
    assert "2.42" in said[0]  # the bound of Move Confirm
    assert "2.42" not in said[2]  # a folder says nothing of how often what is sent


def test_each_pdo_that_is_left_out_is_named_with_its_reason(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, log = tmp_path / "servo.eds", tmp_path / "run.log"
    file.write_text(
        DEVICE_TYPE
        + variable("2000", "Speed", "INTEGER16")
        + pdo(0x1800, "0x20000010")
        + pdo(0x1801, "0x2F000010", cob_id="0x285")
        + pdo(0x1802, "0x2F000010", cob_id="0x385")
        + pdo(0x1804, "0x20000010")
        + pdo(0x1805, "0x20000010")
    )
    log.write_text("(1.0) can0 185#0100\n")
    assert cli.main(["decode", "--eds", f"5={file}", str(log)]) == 0
    out, err = capsys.readouterr()
    assert "speed=1" in out
    assert [line for line in err.splitlines() if "PDO left out" in line] == [
        f"eurobot-od: PDO left out: {file}: 0x1A01, 0x1A02: maps 0x2F00 sub 0, which is missing",
        f"eurobot-od: PDO left out: {file}: 0x1804, 0x1805: sub 1 is missing or has no number as its value",
    ]


# compare and replay


LINES = ["(1.000000) can0 202#D27423592C01C3A5", "(1.250000) can0 182#", "(2.000000) can0 282#F40100"]
LATER = ["(1.000000) can0 202#D27423592C01C3A5", "(1.260000) can0 182#", "(2.000000) can0 282#F50100"]


@pytest.fixture
def logs(tmp_path: Path) -> tuple[str, str]:
    names = []
    for name, lines in (("one", LINES), ("other", LATER)):
        file = tmp_path / f"{name}.log"
        file.write_text("".join(f"{line}\n" for line in lines))
        names.append(str(file))
    return names[0], names[1]


def test_equal_logs_are_fine(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "compare", logs[0], logs[0]) == (0, "3 and 3 frames: no difference\n", "")


def test_differences_are_listed_and_counted(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "compare", *logs)
    assert (said.status, said.err) == (1, "")
    assert said.out.splitlines() == [
        "     0.250000  late     Move Confirm                  by 10.000 ms",
        "     1.000000  changed  Move State Response           time = 500 ms -> 501 ms",
        "3 and 3 frames: 1 late, 1 changed",
    ]


def test_differences_as_json(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    lines = run(capsys, "compare", *logs, "--json").out.splitlines()
    assert json.loads(lines[0]) == {
        "time": 0.25,
        "kind": "late",
        "name": "Move Confirm",
        "text": "by 10.000 ms",
    }


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["--time", "10 ms", "--tolerance", "time=1"], 0),
        (["--time", "10 ms", "--tolerance", "Move State Response.time=1"], 0),
        (["--time", "10 ms"], 1),
        (["--tolerance", "time=1"], 1),
        (["--message", "Move To"], 0),
    ],
)
def test_tolerances_and_filters(
    words: list[str], status: int, logs: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "compare", *logs, *words).status == status


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--tolerance", "x"], "argument --tolerance: x: write [MESSAGE.]FIELD=NUMBER"),
        (["--tolerance", "x=-1"], "--tolerance x=-1: not a number, 0 or more"),
        (["--tolerance", "nothing=1"], "unknown field 'nothing'"),
        (["--tolerance", "Goto.x=1"], "unknown message 'Goto'"),
        (["--time", "5 h"], "'5 h' is not a duration"),
    ],
)
def test_wrong_tolerances_are_one_line(
    words: list[str], complaint: str, logs: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "compare", *logs, *words)
    assert (said.status, said.out) == (2, "")
    assert complaint in said.complaint


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> WiredBus:
    """A bus in simulated time."""
    bus = WiredBus()
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: bus)
    monkeypatch.setattr("eurobot_od.client.master.Master.__init__.__defaults__", (0.5, lambda: bus.now, 1 << 20))
    return bus


def test_replay_sends_the_frames_and_says_how_many(
    logs: tuple[str, str], bus: WiredBus, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "replay", logs[0], "--speed", "2")
    assert said == (0, "3 frames sent, 0 of them later than 1 ms, 0.0 ms at most\n", "")
    assert [str(frame) for frame in bus.sent] == [line.split()[2] for line in LINES]
    assert bus.now == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("words", "sent"),
    [(["--only", "lift"], LINES[1:]), (["--except", "lift"], LINES[:1]), (["--only", "panel"], LINES[:1])],
)
def test_replay_of_some_nodes(
    words: list[str], sent: list[str], logs: tuple[str, str], bus: WiredBus, capsys: pytest.CaptureFixture[str]
) -> None:
    bus.sent.clear()
    assert run(capsys, "replay", logs[0], *words).status == 0
    assert bus.sent == [Frame.parse(line.split()[2]) for line in sent]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--speed", "0"], "0 is not a positive number"),
        (["--speed", "inf"], "inf is not a positive number"),
        (["--only", "motor"], "unknown node 'motor'"),
        (["--only", "panel", "--except", "lift"], "not allowed with argument --only"),
    ],
)
@pytest.mark.usefixtures("bus")
def test_replay_refuses_wrong_options(
    words: list[str], complaint: str, logs: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "replay", logs[0], *words)
    assert (said.status, said.out) == (2, "")
    assert complaint in said.complaint


def test_compare_decodes_by_the_mapping_in_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mapped = "605#2300180185010080 585#6000180100000000 605#2F001A0000000000 585#60001A0000000000 "
    mapped += "605#23001A0120006C60 585#60001A0100000000 605#2F001A0001000000 585#60001A0000000000 "
    mapped += "605#2300180185010000 585#6000180100000000 "
    for name, last in (("one.log", "185#E8030000"), ("two.log", "185#E9030000")):
        frames = enumerate((mapped + last).split())
        (tmp_path / name).write_text("".join(f"({number}.0) can0 {each}\n" for number, each in frames))
    logs = [str(tmp_path / name) for name in ("one.log", "two.log")]
    for filters in ([], ["--message", "servo.TPDO1"]):  # the filter is for what is compared, not for what is learned
        out = run(capsys, "compare", *logs, "--eds", "5=docs/servo.eds", *filters).out
        assert "changed  servo.TPDO1                   velocity_actual_value = 1000 rpm -> 1001 rpm\n" in out
        assert "11 and 11 frames: 1 changed" in out or filters


def test_frames_of_other_protocols_have_the_names_and_fields_of_a_dbc(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dbc, log = tmp_path / "car.dbc", tmp_path / "bus.log"
    dbc.write_text('BO_ 291 Lights: 1 Body\n SG_ code : 0|8@1+ (0.5,0) [0|100] "%" Body\nBO_ 292 Wide: 12 Body\n')
    log.write_text(f"(1.000000) can0 123#21\n(2.000000) can0 124##0{bytes(12).hex()}\n(3.000000) can0 123#22\n")
    asked = ("decode", str(log), "--dbc", str(dbc))
    assert run(capsys, *asked).out.splitlines()[0].split() == ["1.000000", "can0", "Lights", "code=16.5", "%"]
    data = json.loads(run(capsys, *asked, "--json").out.splitlines()[0])
    assert (data["message"], data["nodes"], data["fields"]) == ("Lights", ["Body"], {"code": 16.5})
    row = next(csv.DictReader(io.StringIO(run(capsys, *asked, "--csv").out)))
    assert (row["message"], row["code"]) == ("Lights", "16.5")
    assert run(capsys, *asked, "--message", "dbc").out.count("\n") == 3
    counted = run(capsys, *asked, "--statistics").out
    assert "Lights   Body      2" in counted
    assert "not in the load, CAN FD: 1 x Wide" in counted
    assert "Wide Body" in run(capsys, "monitor", str(log), "--dbc", str(dbc), "--plain", "--speed", "max").out
