"""Commands that know devices by the library: nobody names a file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.client.master import Master
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from tests.cli.console import Said, run
from tests.client.lss_slave import LssStation
from tests.client.peers import new_channel, open_bus
from tests.client.wired import WiredBus
from tests.kit.devices import DOCS
from tests.kit.library import LISTS, OTHER_PRODUCT, device_text, library_of

ALONE = "--robot", "none"


@pytest.fixture(autouse=True)
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a library of two files for one product, one for another, and a damaged one."""
    texts = {"axis": device_text(), "axis-old": device_text(revision=0x20001), "broken": "no EDS"}
    other = device_text(product=OTHER_PRODUCT, name="Level")
    monkeypatch.chdir(tmp_path)
    return library_of(tmp_path / "makers", other=other, **texts)


@pytest.fixture
def bus() -> Iterator[tuple[str, ...]]:
    """Two nodes of one product, one of another, and one without a file; yields the options of their bus."""
    channel = new_channel()
    texts = {5: device_text(), 6: device_text(), 7: device_text(product=OTHER_PRODUCT, name="Level")}
    texts[8] = device_text(product=0x9999)
    with ExitStack() as stack:
        for node_id, text in texts.items():
            device = SimulatedDevice(Dictionary.read(text.encode(), Path(f"{node_id}.eds"), node_id))
            stack.enter_context(Live.node(open_bus(channel), device))
        yield "-i", "virtual", "-c", channel


# devices


def test_devices_lists_the_files_and_complains_of_damaged_ones(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "devices", "--library", "makers")
    assert said.status == 0
    assert said.out.splitlines()[:2] == [
        "vendor      product     revision    type        maker    device  file",
        "0x0000029C  0x00001001  0x00020001  0x00020192  A Maker  Axis    axis-old.eds",
    ]
    assert said.complaint.endswith("broken.eds: not a readable EDS (`lint` says more)")
    data = json.loads(run(capsys, "devices", "--library", "makers", "--json").out)
    assert [(Path(each["path"]).name, each["revision"]) for each in data][:2] == [
        ("axis-old.eds", 0x20001),
        ("axis.eds", 0x20003),
    ]


def test_an_empty_library_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert run(capsys, "devices", "--library", "empty").out == "no device files in empty\n"


def test_add_puts_a_file_below_its_maker_with_what_the_maker_says(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "makers" / "device.yaml").write_text("emcy: {}\n")
    said = run(capsys, "devices", "add", "makers/axis.eds", "--library", "own")
    assert said.status == 0
    assert said.out.startswith("own/A-Maker/axis.eds: 0x0000029C:0x00001001:0x00020003 A Maker Axis")
    assert (tmp_path / "own/A-Maker/axis.eds").read_bytes() == (tmp_path / "makers/axis.eds").read_bytes()
    assert (tmp_path / "own/A-Maker/axis.device.yaml").is_file()


def test_add_names_the_other_files_of_a_product(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    said = run(capsys, "devices", "add", "makers/axis.eds", "makers/axis-old.eds", "--library", "own")
    assert [line for line in said.out.splitlines() if "also" in line] == [
        "own/A-Maker/axis.eds: also of this product: axis-old.eds",
        "own/A-Maker/axis-old.eds: also of this product: axis.eds",
    ]


def test_add_makes_the_users_own_library(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.library.library.users_folder", lambda: Path("mine/devices"))
    assert run(capsys, "devices", "add", "makers/axis.eds").status == 0
    assert Path("mine/devices/A-Maker/axis.eds").is_file()


def test_add_repairs_on_request(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "axis.eds").write_text(device_text().replace(LISTS, ""))
    said = run(capsys, "devices", "add", "axis.eds", "--fix", "--library", "own")
    assert said.status == 0
    fixed = run(capsys, "lint", "--fix", "axis.eds", "-o", "fixed.eds")
    assert said.out.startswith(fixed.out)
    assert fixed.out.startswith("axis.eds:1: ")
    assert (tmp_path / "own/A-Maker/axis.eds").read_bytes() == (tmp_path / "fixed.eds").read_bytes()


WRONG = [
    (["devices", "makers/axis.eds"], "unknown value 'makers/axis.eds'; known: add"),
    (["devices", "add"], "add which files? Name EDS, DCF, XDD or XDC files"),
    (["devices", "--fix"], "--fix is for `devices add`"),
    (["devices", "add", "makers/axis.eds", "makers/broken.eds"], "broken.eds: not a readable EDS (`lint` says more)"),
    (["devices", "add", "nowhere.eds"], "nowhere.eds: No such file or directory"),
    (["devices", "add", "changed/axis.eds"], "axis.eds: another file of this name is there; --replace replaces it"),
    (["devices", "--library", "nowhere"], "library nowhere: no such folder; `mkdir nowhere` makes one"),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG)
def test_a_file_that_cannot_be_added_is_one_line_and_nothing_is_added(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    own = Path("own")
    library_of(own / "A-Maker", axis=device_text())
    library_of(Path("changed"), axis=device_text(revision=1))
    before = {file: file.read_bytes() for file in own.rglob("*.eds")}
    said = run(capsys, *words, *([] if "--library" in words else ["--library", "own"]))
    assert (said.status, len(said.err.splitlines())) == (2, 1)
    assert complaint in said.complaint
    assert {file: file.read_bytes() for file in own.rglob("*.eds")} == before


# A live bus


def scanned(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], *words: str) -> Said:
    return run(capsys, "scan", "--listen", "300 ms", *words, *bus)


def test_scan_says_which_file_fits_each_node(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> None:
    said = scanned(capsys, bus, *ALONE, "--library", "makers")
    lines = said.out.splitlines()
    assert [line.split()[-1] for line in lines[:5]] == ["file", "axis.eds", "axis.eds", "other.eds", "-"]
    assert lines[5:] == ["node 5: also of this product: axis-old.eds", "node 6: also of this product: axis-old.eds"]
    data = json.loads(scanned(capsys, bus, *ALONE, "--library", "makers", "--json").out)
    assert [each["file"] and Path(each["file"]).name for each in data] == ["axis.eds", "axis.eds", "other.eds", None]


def test_scan_without_a_library_has_no_column_of_files(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]
) -> None:
    assert scanned(capsys, bus, *ALONE).out.splitlines()[0].split()[-1] == "serial"


def test_scan_complains_of_a_file_for_another_device(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> None:
    said = scanned(capsys, bus, *ALONE, "--library", "makers", "--eds", "5=makers/other.eds")
    assert said.complaint.endswith("makers/other.eds is for another device: node 5 has product code 0x1001, not 0x1002")
    assert said.err.count("another device") == 1


# Who is another device, or not there, is said before all else


ASKING = ("scan --listen 300ms", "check --conformance --step Identity", "dump")


@pytest.mark.parametrize("words", ASKING)
def test_a_file_of_another_device_is_told_first(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: str
) -> None:
    node = ["5"] * (words == "dump")
    said = run(capsys, *words.split(), *node, *ALONE, "--eds", "5=makers/other.eds", *bus)
    assert "is for another device: node 5 has product code 0x1001, not 0x1002" in said.err.splitlines()[0]


@pytest.mark.parametrize("words", ["scan --listen 300ms", "check --conformance --step Identity"])
def test_a_node_that_is_not_there_is_told_with_those_that_are(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: str
) -> None:
    said = run(capsys, *words.split(), *ALONE, "--eds", "9=makers/axis.eds", *bus)
    assert "nodes 5, 6, 7, 8 are on this bus, node 9 is not" in said.err


def test_lss_says_which_file_fits_a_device_without_a_node_id(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = LssStation(Identity(0x29C, 0x1001, 0x20003, 7)), LssStation(Identity(1, 2, 3, 4))
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(*devices))
    said = run(capsys, "lss", "find", "--timeout", "1 ms", "--library", "makers")
    assert sorted(said.out.splitlines()) == [
        "0x00000001:0x00000002:0x00000003:0x00000004  no node-ID",
        "0x0000029C:0x00001001:0x00020003:0x00000007  no node-ID  axis.eds",
    ]


# A command, and what it prints that only a file knows.
BY_NAME = [
    (["read", "5", "Speed"], "0x2000:0  Speed  7"),
    (["dump", "7"], "Level"),
    (["pdo", "6"], "Speed 16"),
    (["write", "5", "Speed", "9"], "node 5: 0x2000:0 Speed = 9"),
]


@pytest.mark.parametrize(("words", "printed"), BY_NAME)
def test_objects_of_a_node_have_the_names_of_its_library_file(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: list[str], printed: str
) -> None:
    said = run(capsys, *words, *ALONE, "--library", "makers", *bus)
    assert printed in said.out


@pytest.mark.parametrize("configured", ["typed", "variable", "network file"])
def test_a_library_is_named_once(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, configured: str
) -> None:
    words = ["--library", "makers"] if configured == "typed" else []
    monkeypatch.delenv("EUROBOT_OD_LIBRARY", raising=False)
    Path("eurobot-od.yaml").unlink(missing_ok=True)
    if configured == "variable":
        monkeypatch.setenv("EUROBOT_OD_LIBRARY", "makers")
    if configured == "network file":
        Path("eurobot-od.yaml").write_text("library: makers\n")
    assert "Speed" in run(capsys, "read", "5", "Speed", *ALONE, *words, *bus).out


def test_a_named_file_wins(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "mine.eds").write_text(device_text(name="Own speed"))
    said = run(capsys, "read", "5", "Own speed", *ALONE, "--library", "makers", "--eds", "5=mine.eds", *bus)
    assert said.out == "0x2000:0  Own speed  7\n"


SPOKEN_TO = {
    "restore": ("restore", "5"),
    "store": ("store", "5"),
    "program": ("program", "5", "new.bin"),
    "drive": ("drive", "5", "status"),
}


@pytest.mark.parametrize("words", SPOKEN_TO.values(), ids=SPOKEN_TO)
def test_a_command_uses_the_library_file_for_types_too(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    Path("new.bin").write_bytes(b"program")
    followed = list[str]()
    monkeypatch.setattr(Master, "follow", lambda _, device: followed.append(device.file.name))
    run(capsys, *words, *ALONE, *bus)
    assert followed == []
    run(capsys, *words, *ALONE, "--library", "makers", *bus)
    assert followed == ["axis.eds"]


OF_A_NODE = {
    "read": ("read", "5", "Level"),
    "write": ("write", "5", "Level limit", "9"),
    "dump": ("dump", "5"),
    "pdo": ("pdo", "5"),
    "dump -o": ("dump", "5", "-o", "five.dcf"),
    "emcy": ("emcy", "5"),
    "restore": ("restore", "5"),
    "store": ("store", "5"),
}


@pytest.mark.parametrize("words", OF_A_NODE.values(), ids=OF_A_NODE)
def test_a_command_for_a_node_says_that_its_named_file_is_for_another_device(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: tuple[str, ...]
) -> None:
    said = run(capsys, *words, *ALONE, "--library", "makers", "--eds", "5=makers/other.eds", *bus)
    told = [line for line in said.err.splitlines() if "another device" in line]
    assert told == ["eurobot-od: makers/other.eds is for another device: node 5 has product code 0x1001, not 0x1002"]
    right = run(capsys, *words[:2], *words[2:], *ALONE, "--library", "makers", "--eds", "7=makers/other.eds", *bus)
    assert "another device" not in right.err


def test_conformance_of_the_devices_on_the_bus(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> None:
    words = ["check", "--conformance", "--tag", "objects", "--step", "Device type", *ALONE, "--library", "makers"]
    said = run(capsys, *words, "--json", *bus)
    assert {each["file"] for each in json.loads(said.out)} == {"axis_5.yaml", "axis_6.yaml", "other.yaml"}


# Logs

IDENTITY = (0x29C, 0x1001, 0x20003)
SCAN = "".join(
    f"({sub}.0) can0 605#401810{sub:02X}00000000\n"
    f"({sub}.1) can0 585#431810{sub:02X}{number.to_bytes(4, 'little').hex()}\n"
    for sub, number in enumerate(IDENTITY, 1)
)
LOG = f"(0.5) can0 185#0700\n{SCAN}(4.0) can0 185#FEFF\n"

OF_LOGS = [
    (["decode"], "axis_5.TPDO1                  speed=-2"),
    (["decode", "--json"], '"fields": {"speed": -2}'),
    (["decode", "--message", "axis_5.TPDO1"], "speed=-2"),
    (["decode", "--csv"], "axis_5.TPDO1"),
    (["monitor", "--plain", "--speed", "max"], "speed=-2"),
    (["diagnose", "--json"], "verdict"),
    (["compare", "scan.log"], "no difference"),
]


@pytest.mark.parametrize(("words", "printed"), OF_LOGS)
def test_a_log_that_begins_with_a_scan_is_decoded_by_the_library(
    capsys: pytest.CaptureFixture[str], words: list[str], printed: str
) -> None:
    Path("scan.log").write_text(LOG)
    said = run(capsys, *words, "scan.log", *ALONE, "--library", "makers")
    assert printed in said.out
    assert said.err == ""


def test_a_pipe_is_decoded_from_the_answers_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.traffic.identities.shown_in", lambda *_: {})  # nothing is read ahead
    Path("scan.log").write_text(LOG)
    said = run(capsys, "decode", "scan.log", *ALONE, "--library", "makers")
    first, *_, last = said.out.splitlines()
    assert "speed" not in first
    assert "axis_5.TPDO1                  speed=-2" in last


def test_a_log_of_another_device_than_its_file_is_one_complaint(capsys: pytest.CaptureFixture[str]) -> None:
    Path("scan.log").write_text(LOG)
    said = run(capsys, "decode", "scan.log", *ALONE, "--library", "makers", "--eds", "5=makers/other.eds")
    assert [line for line in said.err.splitlines() if "another device" in line] == [
        "eurobot-od: makers/other.eds is for another device: node 5 has product code 0x1001, not 0x1002"
    ]
    assert "level=-2" in said.out


# Clones


def configured(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], *words: str) -> Said:
    return run(capsys, "configure", "6", "five.dcf", "--library", "makers", *ALONE, *words, *bus)


@pytest.fixture
def five(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> tuple[str, ...]:
    """Node 5 as somebody has set it, in five.dcf; gives the bus."""
    for name, value in (("Speed limit", "9"), ("0x1800:5", "250")):
        assert run(capsys, "write", "5", name, value, "--library", "makers", *ALONE, *bus).status == 0
    run(capsys, "dump", "5", "-o", "five.dcf", "--library", "makers", *ALONE, *bus)
    return bus


def test_a_node_becomes_a_clone_of_another(capsys: pytest.CaptureFixture[str], five: tuple[str, ...]) -> None:
    assert "ParameterValue=$NODEID+0x180" in Path("five.dcf").read_text()
    said = configured(capsys, five)
    assert said.status == 0
    assert "written and read back" in said.out
    assert [line.split()[0] for line in said.out.splitlines()[1:-1]] == ["0x1800:5", "0x2001:0"]
    assert run(capsys, "read", "6", "0x1800:1", *ALONE, "--library", "makers", *five).out.split()[-1] == "0x00000186"
    run(capsys, "dump", "6", "-o", "six.dcf", "--library", "makers", *ALONE, *five)
    assert run(capsys, "diff", "five.dcf", "six.dcf") == (0, "", "")
    assert run(capsys, "diff", "five.dcf", "--node", "6", *five) == (0, "", "")


def test_a_clone_asks_about_a_changed_cob_id(capsys: pytest.CaptureFixture[str], five: tuple[str, ...]) -> None:
    text = Path("five.dcf").read_text()
    Path("five.dcf").write_text(text.replace("ParameterValue=$NODEID+0x180", "ParameterValue=0x391"))
    said = configured(capsys, five)
    assert said.status == 2
    assert "0x1800:1 TPDO1 0x391; for node 6 keep them (--keep-cob-ids), or move them by 1" in said.complaint
    read = "read", "6", "0x1800:1", *ALONE, "--library", "makers", *five
    assert run(capsys, *read).out.split()[-1] == "0x00000186"  # nothing was written
    assert configured(capsys, five, "--move-cob-ids").status == 0
    assert run(capsys, *read).out.split()[-1] == "0x00000392"
    assert configured(capsys, five, "--keep-cob-ids").status == 0
    assert run(capsys, *read).out.split()[-1] == "0x00000391"


def test_a_clone_of_another_product_is_refused(capsys: pytest.CaptureFixture[str], five: tuple[str, ...]) -> None:
    said = run(capsys, "configure", "7", "five.dcf", "--library", "makers", *ALONE, *five)
    assert said.status == 2
    assert said.complaint.endswith("is for another device: node 7 has product code 0x1002, not 0x1001")


CONCISE = [([], "", 2), (["--keep-cob-ids"], "0x00000391", 0), (["--move-cob-ids"], "0x00000392", 0)]


@pytest.mark.parametrize(("words", "cob_id", "status"), CONCISE)
def test_a_concise_dcf_is_made_for_another_node(
    capsys: pytest.CaptureFixture[str], words: list[str], cob_id: str, status: int
) -> None:
    commissioned = f"{device_text()}[DeviceComissioning]\nNodeID=5\n"
    chosen = commissioned.replace("[1800sub1]\n", "[1800sub1]\nParameterValue=0x391\n")
    Path("five.dcf").write_text(chosen)
    said = run(capsys, "export", "cdcf", "6=five.dcf", *words)
    assert said.status == status
    assert cob_id in said.out


# Nodes of a network file without a file

NAMED = (
    "library: makers\nnodes: {lift: {node_id: 5, units: {Speed: rpm}}, door: {file: makers/other.eds, node_id: 7}}\n"
)


def test_a_node_without_a_file_is_described_by_the_library_under_its_own_name(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]
) -> None:
    Path("net.yaml").write_text(NAMED)
    said = run(capsys, "dump", "5", "--network", "net.yaml", *ALONE, *bus)
    assert "0x2000:0  Speed                  7 rpm" in said.out
    Path("run.log").write_text(SCAN + "(4.0) can0 185#0500\n(4.1) can0 187#0500\n")
    said = run(capsys, "decode", "run.log", "--network", "net.yaml", *ALONE)
    assert "lift.TPDO1" in said.out
    assert "speed=5 rpm" in said.out
    assert "door.TPDO1" in said.out


ONLY_LIFT = "library: makers\nnodes: {lift: {node_id: 5, units: {Speed: rpm}}}\n"

LIFT_COMMANDS: dict[str, tuple[str, int, str]] = {
    "read": ("read lift Speed", 0, "7 rpm"),
    "dump": ("dump lift", 0, "7 rpm"),
    "nmt": ("nmt lift start", 0, "node 5"),
    "watch": ("watch lift --for 0.1s", 1, "node 5 lift is lost"),  # it has no heartbeat
    "scan": ("scan", 0, "   5  lift        "),
    "boot": ("boot", 0, "lift: "),
    "check": ("check --conformance --tag nmt", 0, "lift"),
    "show": ("show", 2, "no file is named for lift (5): only the bus tells"),
    "node": ("node lift", 2, "name one by --eds 5=FILE"),
    "export": ("export dbc", 2, "name one by --eds 5=FILE"),
}


@pytest.mark.parametrize("name", ["net.yaml", "eurobot-od.yaml"])
@pytest.mark.parametrize(("words", "status", "text"), LIFT_COMMANDS.values(), ids=LIFT_COMMANDS)
def test_commands_know_a_node_without_a_file_by_its_name_or_say_that_it_takes_the_bus(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], name: str, words: str, status: int, text: str
) -> None:
    Path(name).write_text(ONLY_LIFT)
    named = () if name == "eurobot-od.yaml" else ("--network", name)
    on_bus = () if words in ("show", "export dbc") else bus
    said = run(capsys, *words.split(), *named, *on_bus)
    assert (said.status, text in said.out + said.err) == (status, True), said


def test_boot_says_which_node_has_no_file_and_does_not_answer(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]
) -> None:
    Path("net.yaml").write_text("library: makers\nnodes: {lift: {node_id: 9}}\n")
    said = run(capsys, "boot", "net.yaml", *bus)
    assert (said.status, "no file is named for lift (9); it does not answer, or" in said.err) == (1, True), said
    said = run(capsys, "scan", "--network", "net.yaml", *bus)
    assert (said.status, "missing: lift (9)" in said.out) == (1, True), said


def test_show_says_which_nodes_it_leaves_out(capsys: pytest.CaptureFixture[str]) -> None:
    Path("net.yaml").write_text(NAMED)
    said = run(capsys, "show", "--network", "net.yaml")
    assert (said.status, "no file is named for lift (5)" in said.err, "door.TPDO1" in said.out) == (0, True, True)


def test_a_folder_of_eds_files_is_suggested_as_a_library(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "decode", "run.log", "--network", "makers", *ALONE)
    assert said.status == 2
    assert said.complaint.endswith("they are a library: --library makers")


def test_emcy_has_the_error_names_of_the_library_file(capsys: pytest.CaptureFixture[str], library: Path) -> None:
    servo = (DOCS / "servo.eds").read_bytes()
    (library / "servo.eds").write_bytes(servo)
    (library / "servo.device.yaml").write_text("emcy: {0xFF01: gearbox jammed}\n")
    device = SimulatedDevice(Dictionary.read(servo, Path("servo.eds"), 9))
    channel = new_channel()
    device.raise_error(0xFF01, "gearbox")
    with Live.node(open_bus(channel), device):
        said = run(capsys, "emcy", "9", "--library", "makers", *ALONE, "-i", "virtual", "-c", channel)
    assert "0xFF01  gearbox jammed" in said.out
