"""`export` and `make-eds`: where files go, what they are called, and what a mistake costs."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.cli.files import export
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import load, read_network
from tests.cli.console import run
from tests.kit import plant
from tests.od.make.tables import TABLE

LIFT = str(plant.FILES.folder() / "lift.eds")

DOCS = Path(__file__).parents[2] / "docs"
SERVO, SERVO_DCF = str(DOCS / "servo.eds"), str(DOCS / "servo.dcf")

CALLS = [
    # (form and options, begin of the output)
    (["c"], "/* Messages of panel.eds"),
    (["dbc"], 'VERSION ""'),
    (["docs"], "# CANopen network: panel, lift, scale"),
    (["docs", "--format", "html"], "<!DOCTYPE html>"),
    (["wireshark"], "-- Messages of panel.eds"),
    (["xdd", LIFT], "<?xml version="),
    (["eds", SERVO_DCF], "[FileInfo]"),
]


@pytest.mark.parametrize(("words", "begin"), CALLS)
def test_a_form_goes_to_standard_output_or_into_a_file(
    words: list[str], begin: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    said = run(capsys, "export", *words)
    assert (said.status, said.err) == (0, "")
    assert said.out.startswith(begin)
    file = tmp_path / ("pdo.md" if words == ["docs"] else "pdo.html")
    file.write_text("old")
    assert run(capsys, "export", *words, "-o", str(file)) == (0, "", "")
    named = (
        file.read_text().replace(file.name, Path(words[-1]).stem + ".eds") if words[0] == "eds" else file.read_text()
    )
    assert named == said.out
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("file", ["eurobot-od.yaml", "bench.yaml"])
def test_a_suite_of_a_log_names_its_node_as_the_network_file_does(
    file: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(file).write_text(f"nodes:\n  hoist: {{file: {LIFT}, node_id: 5}}\n")
    Path("run.log").write_text("(1.0) can0 605#4000100000000000\n(1.1) can0 585#4300100000000000\n")
    said = run(capsys, "export", "suite", "run.log", "--node", "hoist", "--network", file)
    assert (said.status, said.err, "\nnode: hoist\n" in said.out) == (0, "", True)


NAMED = [
    (["c"], "robot_move_to_pack"),
    (["c", "--name", "Our bus"], "our_bus_move_to_pack"),
    (["wireshark"], 'local SHORT_NAME = "robot"'),
    (["wireshark", "--name", "bus"], 'local SHORT_NAME = "bus"'),
]


@pytest.mark.parametrize(("words", "part"), NAMED)
def test_identifiers_begin_with_the_output_s_name(
    words: list[str], part: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "robot.out"
    assert run(capsys, "export", *words, "-o", str(file)).status == 0
    assert part in file.read_text()


@pytest.fixture
def silent(tmp_path: Path) -> Path:
    """Return a folder with one device that has no PDO."""
    folder = tmp_path / "silent"
    folder.mkdir()
    text = "[1000]\nParameterName=Type\nDataType=7\nAccessType=ro\n[DeviceComissioning]\nNodeID=1\n"
    (folder / "mute.eds").write_text(text)
    return folder


@pytest.mark.parametrize("form", ["c", "dbc", "wireshark"])
def test_a_network_without_messages_is_one_line(form: str, silent: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "export", form, "--dialect", str(silent))
    assert (said.status, said.out) == (2, "")
    assert said.err == "eurobot-od: no messages: none of the loaded files has a valid PDO\n"


MISTAKES = [
    (["c", "--dialect", "nowhere"], 2, "eurobot-od: unknown dialect 'nowhere'"),
    (["c", "-o", "nowhere/bus.h"], 3, "No such file or directory"),
    (["docs", "-o", "bus.pdf"], 2, "unknown document format '.pdf'"),
    (["docs", "--format", "pdf"], 2, "argument --format: unknown value 'pdf'; known: markdown, html"),
    (["xdd", "none.eds"], 2, "none.eds: No such file or directory"),
    (["xdd", os.__file__], 2, "not an EDS: it describes no object"),
    (["nonsense"], 2, "unknown form 'nonsense'; known: c, canopennode, dbc, docs"),
]


@pytest.mark.parametrize(("words", "status", "part"), MISTAKES)
def test_a_mistake_costs_one_line(words: list[str], status: int, part: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "export", *words)
    assert (said.status, said.out) == (status, "")
    assert part in said.complaint
    assert said.err.count("\n") == 1


@pytest.mark.posix
@pytest.mark.parametrize("words", [["export", "c"], ["export", "docs"], ["export", "dbc"], ["check", "--conformance"]])
def test_the_name_of_a_device_is_written_although_its_file_has_a_name_that_is_not_text(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / os.fsdecode(b"dr\xffve.eds")
    shutil.copy(LIFT, file)
    made = tmp_path / "made.md"
    assert run(capsys, *words, "--eds", str(file), "-o", str(made)).status == 0
    made.read_text(encoding="utf-8")


def test_a_device_is_written_into_and_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    before = Path(os.devnull).stat().st_ino
    assert run(capsys, "export", "c", "-o", os.devnull).status == 0
    assert Path(os.devnull).stat().st_ino == before


@pytest.mark.parametrize("form", export.functions)
def test_every_form_explains_itself(form: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "export", form, "--help")
    assert said.status == 0
    assert said.out.startswith("usage: eurobot-od export " + form)


def test_a_log_becomes_mcap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcap", reason="the extra `mcap` is not installed")
    log, file = tmp_path / "some.log", tmp_path / "some.mcap"
    log.write_text("(1.000000) can0 202#D27423592C01C3A5\n(1.250000) can0 7E6#\n")
    said = run(capsys, "export", "mcap", str(log), "-o", str(file))
    assert said == (0, f"{file}: 1 message, 0 poses, 1 defect\n", "")
    assert file.read_bytes().startswith(b"\x89MCAP")


def test_an_xdd_says_what_was_repaired_for_it(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "export", "xdd", "tests/lint/samples/broken_by_hand.eds")
    assert said.status == 0
    assert ["repaired to be read" in said.err, "left out: line 820: 0x1A01" in said.err] == [True, True]


@pytest.mark.parametrize("form", ["xdd", "cdcf"])
def test_of_a_network_each_node_has_a_file(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("net.yaml").write_text(f"nodes: {{left: {{file: {LIFT}, node_id: 5}}, right: {{file: {LIFT}, node_id: 6}}}}")
    assert cli.main(["export", form, "net.yaml", "-o", "made"]) == 0
    assert sorted(each.name for each in Path("made").iterdir()) == [f"left.{form}", f"right.{form}"]


@pytest.mark.parametrize("form", ["canopennode", "eds", "dcf", "xdd", "cdcf"])
def test_a_patch_counts_in_each_form_of_one_device(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    values = ", ".join(f"{key}: 0x1F3" for key in ("DefaultValue", "ParameterValue"))
    Path("ours.yaml").write_text(f"0x1017: {{{values}}}\n")
    made = Path("made/OD.c" if form == "canopennode" else "made")
    run(capsys, "export", form, f"5={SERVO_DCF}", "--patch", "ours.yaml", "-o", "made")
    numbers = (b"0x1F3", b"499", (0x1F3).to_bytes(2, "little"))
    assert any(each in made.read_bytes() for each in numbers), made.read_bytes()[:2000]


OF_A_NETWORK = [
    ("export xdd", ["export", "xdd", "net.yaml", "-o", "made"]),
    ("export cdcf", ["export", "cdcf", "net.yaml", "-o", "made"]),
    ("lint --network", ["lint", "--network", "net.yaml"]),
    ("lint --fix", ["lint", "--fix", LIFT, "-o", "made"]),
]


@pytest.mark.parametrize("words", [row[1] for row in OF_A_NETWORK], ids=[row[0] for row in OF_A_NETWORK])
def test_a_patch_for_several_devices_is_refused(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("net.yaml").write_text(f"nodes: {{left: {{file: {LIFT}, node_id: 5}}}}")
    Path("ours.yaml").write_text("0x1017: {ParameterValue: 250}\n")
    said = run(capsys, *words, "--patch", "ours.yaml")
    assert (said.status, "--module and --patch are for one device's file" in said.err) == (2, True)
    assert not Path("made").exists()


def test_a_dcf_is_made_without_a_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    patch, file = tmp_path / "ours.yaml", tmp_path / "arm.dcf"
    patch.write_text("0x1017: {ParameterValue: 250}\n")
    assert (
        run(capsys, "export", "dcf", f"5={SERVO}", "--patch", str(patch), "-b", "250000", "-o", str(file)).status == 0
    )
    made = Dictionary.load(file)
    assert (made.node_id, made.default((0x1017, 0)), made.stock_value((0x1017, 0))) == (5, 250, 100)
    assert [each for each in file.read_text().splitlines() if "=arm" in each or "=250" in each][-2:] == [
        "NodeName=arm",
        "Baudrate=250",
    ]
    assert run(capsys, "lint", "--select", "E", str(file)).status == 0


def test_a_dcf_is_for_a_node(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "export", "dcf", SERVO) == (2, "", f"eurobot-od: say which node the DCF is for: 5={SERVO}\n")


def test_code_for_canopennode_names_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "firmware"
    said = run(capsys, "export", "canopennode", SERVO, "-o", str(folder), "--storage", "2000=MINE")
    assert said == (0, f"{folder}: OD.h and OD.c, 101 objects\n", "")
    assert "OD_MINE" in (folder / "OD.h").read_text()
    motor = str(DOCS / "motor.eds")
    said = run(capsys, "export", "canopennode", motor, "-o", str(folder), "--name", "motor")
    lacks = f"{motor}:1:1: E901 CANopenNode needs 0x1016:1; add: Consumer heartbeat time, UNSIGNED32, rw\n"
    assert said == (1, f"{lacks}{folder}: motor.h and motor.c, 15 objects\n", "")
    assert run(capsys, "lint", "--for", "canopennode", "--select", "E9", motor).out.startswith(lacks)


@pytest.mark.parametrize("form", ["eds", "xdd"])
def test_an_exported_form_has_the_patch(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    patch, file = tmp_path / "ours.yaml", tmp_path / f"made.{form}"
    patch.write_text("0x1017: {DefaultValue: 250}\n")
    assert run(capsys, "export", form, SERVO, "--patch", str(patch), "-o", str(file)).status == 0
    assert Dictionary.load(file, 1).default((0x1017, 0)) == 250


def test_modules_become_objects_of_an_eds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    coupler = "tests/od/samples/coupler.eds"
    file = tmp_path / "flat.eds"
    assert run(capsys, "export", "eds", coupler, "--module", "1,1", "-o", str(file)).status == 0
    flat, modular = Dictionary.load(file, 1), Dictionary.load(coupler, 1, modules=["1", "1"])
    assert flat.members.keys() == modular.members.keys() > Dictionary.load(coupler, 1).members.keys()
    assert (flat.normal.has_modules, flat.idle_modules) == (False, ())
    assert run(capsys, "lint", coupler, "--module", "77").complaint.startswith(
        f"eurobot-od: {coupler}: module 77 is not supported"
    )


# make-eds


@pytest.fixture
def table(tmp_path: Path) -> Path:
    file = tmp_path / "table.yaml"
    file.write_text(TABLE)
    return file


def test_makes_the_files_of_a_teams_own_table(table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("make-eds", str(table), "-o", str(tmp_path / "new" / "eds"))
    assert run(capsys, *words) == (0, "", "")
    assert run(capsys, *words, "--check").status == 0
    files = [str(each) for each in (tmp_path / "new" / "eds" / "plain").iterdir()]
    assert run(capsys, "lint", "--strict", *files).status == 0
    assert run(capsys, "lint", "--network", str(tmp_path / "new" / "eds" / "network.yaml")).status == 0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("bits: 12, range: [0, 3000]", "bits: 13, range: [0, 3000]"),
        ("identifier: 12", "identifier: 13"),
        ("unknown: 0xFFF", "unknown: 0xFFE"),
        ("unit: mm", "unit: 0.1 mm"),
    ],
)
def test_changed_bits_need_a_new_revision_or_an_option(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str
) -> None:
    words = ("make-eds", str(table), "-o", str(tmp_path / "eds"))
    assert run(capsys, *words).status == 0
    changed = TABLE.replace(old, new)
    assert changed != TABLE
    table.write_text(changed)
    said = run(capsys, *words)
    assert (said.status, said.out) == (2, "")
    line = next(n for n, each in enumerate(changed.split("\n"), start=1) if "revision_number" in each)
    assert said.err.startswith(f"eurobot-od: {table}:{line}:") or said.err.startswith(f"{table}:{line}:")
    assert "under the same revision" in said.err
    assert "--same-revision" in said.err
    assert run(capsys, *words, "--check").status == 1  # nothing was written
    assert run(capsys, *words, "--same-revision").status == 0
    table.write_text(TABLE.replace("revision_number: 0x000", "revision_number: 0x001"))
    assert run(capsys, *words).status == 0


def test_check_names_differences_and_writes_nothing(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "make-eds", str(table), "-o", str(tmp_path / "eds"), "--check")
    assert (said.status, said.err) == (1, "")
    assert said.out.splitlines()[0] == f"{tmp_path / 'eds' / 'network.yaml'}: is missing"
    assert not (tmp_path / "eds").exists()


def test_every_problem_of_a_table_is_a_line_and_nothing_is_written(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table.write_text(
        TABLE.replace("object: Target", "object: Goal").replace("receivers: [drive]", "receivers: [wheel]")
    )
    said = run(capsys, "make-eds", str(table), "-o", str(tmp_path / "eds"))
    assert (said.status, said.out) == (2, "")
    assert [line.partition(": ")[2] for line in said.err.splitlines()] == [
        "unknown node 'wheel'; known: core, drive",
        "unknown object 'Goal'; known: Target, Long",
    ]
    lines = [n for n, line in enumerate(table.read_text().split("\n"), start=1) if "wheel" in line or "Goal" in line]
    assert [int(line.split(":")[1]) for line in said.err.splitlines()] == 2 * lines
    assert not (tmp_path / "eds").exists()


def test_a_table_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "make-eds", str(tmp_path / "none.yaml"), "-o", str(tmp_path))
    assert said == (2, "", f"eurobot-od: {tmp_path / 'none.yaml'}: No such file or directory\n")


def test_a_folder_that_cannot_be_written(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "make-eds", str(table), "-o", str(table / "eds"))
    assert said == (3, "", f"eurobot-od: {table / 'eds'}: Not a directory\n")


def test_a_command_without_folder_is_wrong_usage(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "make-eds", str(table)).status == 2


@pytest.mark.parametrize("form", ["xdd", "cdcf"])
def test_a_failed_export_leaves_no_folder(tmp_path: Path, form: str) -> None:
    network, output = tmp_path / "network.yaml", tmp_path / "out"
    good = Path(__file__).parents[2] / "docs" / "servo.dcf"
    (tmp_path / "bad.eds").write_text("nothing\n")
    network.write_text(f"nodes:\n  good: {{file: '{good}', node_id: 5}}\n  bad: {{file: bad.eds, node_id: 6}}\n")
    assert cli.main(["export", form, str(network), "-o", str(output)]) == 2
    assert not output.exists()


def test_a_network_as_bus_yml_means_the_same(tmp_path: Path) -> None:
    docs = Path(__file__).parents[2] / "docs"
    network, output = tmp_path / "network.yaml", tmp_path / "bus.yml"
    network.write_text(
        f"nodes:\n  servo: {{file: '{docs / 'servo.dcf'}'}}\n  motor: {{file: '{docs / 'motor.eds'}', node_id: 7}}\n"
    )
    assert cli.main(["export", "bus", "--network", str(network), "-o", str(output)]) == 0
    ours, theirs = (load(read_network(each).nodes) for each in (network, output))
    for one, other in zip(ours, theirs, strict=True):
        assert (one.name, one.node_id) == (other.name, other.node_id)
        assert {each: one.default(each) for each in one.addresses()} == {
            each: other.default(each) for each in other.addresses()
        }


def test_a_wrong_object_of_a_devices_table_is_told_with_its_place(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    table = tmp_path / "hoist.yaml"
    table.write_text("device: {product: hoist}\nobjects:\n  0x2001: {ParameterName: A}\n")
    said = run(capsys, "make-eds", str(table), "-o", str(tmp_path))
    wrong = "0x2001: the file has no 0x2001, and a new one needs DataType and AccessType"
    assert said == (2, "", f"{table}:3:3: {wrong}\n")
