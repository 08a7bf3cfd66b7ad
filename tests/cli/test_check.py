"""`eurobot-od check`: exit status and output for every way to call it."""

from __future__ import annotations

import io
import json
import re
import signal
from contextlib import redirect_stdout
from pathlib import Path
from xml.etree import ElementTree

import pytest
from junitparser import JUnitXml

from eurobot_od import cli
from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from tests.check.suites import HEAD, document
from tests.cli.console import run
from tests.client.servo import DOCS
from tests.device import io_module

GREEN = document("- send: Check Lift Request\n- expect: Check Lift Response", HEAD + "tags: [quick, first]\n")
RED = document("- expect: Move Confirm\n- send: Halt Lift", HEAD.replace("a suite", "red") + "tags: slow\n")
WRONG = document("- send: Stop Drove\n- wait: 1")
FOREIGN = document("- send: Halt Lift", HEAD + "dialect: packed\n")
GUIDE = Path(__file__).parents[2] / "docs" / "checks.md"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with suites, to be the current one."""
    for name, text in {"green": GREEN, "red": RED, "wrong": WRONG, "foreign": FOREIGN}.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


BUS_OPTIONS = {"--help", "--interface", "--channel", "--bitrate"}

CALLS = {
    # green, red, wrong
    "green": ("green.yaml --simulate", 0, "1 suite: 2 ok in 0.0 s of bus time"),
    "red": ("red.yaml --simulate", 1, "1 suite: 1 FAILED, 1 skipped in 1.0 s of bus time"),
    "one of two red": ("red.yaml green.yaml --simulate", 1, "2 suites: 2 ok, 1 FAILED, 1 skipped in 1.0 s of bus time"),
    "keep going": ("red.yaml --simulate --keep-going", 1, "1 suite: 1 ok, 1 FAILED in 1.0 s of bus time"),
    # chosen
    "by tag": ("red.yaml green.yaml --simulate --tag first", 0, "1 suite: 2 ok in 0.0 s of bus time"),
    "by tags": ("red.yaml green.yaml --simulate --tag first --tag slow", 1, "2 suites: 2 ok, 1 FAILED, 1 skipped in"),
    "by step": ("green.yaml --simulate --step SEND", 0, "1 suite: 1 ok in 0.0 s of bus time"),
    "by step behind a red one": ("red.yaml --simulate --step HALT", 1, "1 suite: 1 FAILED, 1 skipped in 1.0 s"),
    # repeated
    "repeated": ("green.yaml --simulate --repeat 3", 0, "3 suites: 6 ok in 0.0 s of bus time"),
    # faults
    "with a fault": ("green.yaml --simulate --fault check-lift-response-not-sent", 1, "1 suite: 1 ok, 1 FAILED in"),
    # dialects
    "of another dialect": (
        "foreign.yaml --simulate --dialect plain",
        1,
        "1 suite: no steps in 0.0 s of bus time; NOT",
    ),
    "of its dialect": ("foreign.yaml --simulate --dialect packed", 0, "1 suite: 1 ok in"),
    "of its own dialect": ("foreign.yaml --simulate", 0, "1 suite: 1 ok in"),
    # on a bus where nobody is
    "only sent where nobody is": ("foreign.yaml -i virtual -c nobody", 1, "1 suite: 1 ok, 1 FAILED in "),
    "nobody there": ("green.yaml -i virtual -c nobody", 1, "1 suite: 1 ok, 1 FAILED in "),
}


@pytest.mark.parametrize(("words", "status", "last"), CALLS.values())
@pytest.mark.usefixtures("folder")
def test_runs(words: str, status: int, last: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", *words.split())
    assert (said.status, said.err) == (status, "")
    assert said.out.splitlines()[-1].startswith(last)


REFUSALS = {
    "conformance of a suite": ("green.yaml --conformance --simulate", 2, "eurobot-od: --conformance makes its suites"),
    "destructive suite": ("green.yaml --destructive --simulate", 2, "eurobot-od: --destructive needs --conformance"),
    "tests of CiA's tool for a suite": ("green.yaml --ctt", 2, "eurobot-od: --ctt needs --conformance"),
    "odd form of a report": ("--conformance --report x.txt", 2, "eurobot-od: unknown document format '.txt'"),
    "written suite": ("green.yaml -o copy.yaml", 2, "eurobot-od: --output needs --conformance"),
    "wrong file": ("green.yaml wrong.yaml --simulate", 2, "wrong.yaml:6:11: '1' is not a duration"),
    "no file": ("nothing.yaml --simulate", 2, "nothing.yaml:1:1: No such file or directory"),
    "no suite": ("nothing --simulate", 2, "eurobot-od: unknown suite 'nothing'"),
    "no tag": (
        "green.yaml red.yaml --simulate --tag x",
        2,
        "eurobot-od: no suite is tagged x; tags: first, quick, slow",
    ),
    "no step": ("green.yaml --simulate --step xyz", 2, "eurobot-od: no step is named like xyz; steps: send Check Lift"),
    "no fault": ("green.yaml --simulate --fault x", 2, "eurobot-od: unknown fault 'x'"),
    "fault of other devices": (
        "green.yaml --simulate --fault overcurrent",
        2,
        "eurobot-od: --fault overcurrent: no simulated device can have it (lift): it is one of drives of CiA 402; ",
    ),
    "a bus for simulated nodes": ("green.yaml --simulate -i virtual", 2, "eurobot-od: --simulate is without a bus"),
    "fault of a real node": ("green.yaml --fault x", 2, "eurobot-od: --fault needs --simulate"),
    "no dialect": ("green.yaml --simulate --dialect latin", 2, "eurobot-od: unknown dialect 'latin'"),
    "no times": (
        "green.yaml --simulate --repeat 0",
        2,
        "eurobot-od check: error: argument --repeat: 0 is not a number",
    ),
    "two forms": ("green.yaml --json --ctt", 2, "eurobot-od check: error: argument --ctt: not allowed with argument"),
    "no bus": ("green.yaml -i socketcan -c nothere", 3, "eurobot-od: cannot open the socketcan bus nothere: "),
}


@pytest.mark.parametrize(("words", "status", "complaint"), REFUSALS.values())
@pytest.mark.usefixtures("folder")
def test_refuses(words: str, status: int, complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", *words.split())
    assert said.status == status
    assert said.complaint.startswith(complaint)


@pytest.mark.usefixtures("folder")
def test_a_wrong_file_is_refused_before_any_step(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "green.yaml", "wrong.yaml", "--simulate")
    assert said.out == ""
    assert [line.partition(" ")[0] for line in said.err.splitlines()] == ["wrong.yaml:5:11:", "wrong.yaml:6:11:"]


@pytest.mark.usefixtures("folder")
def test_failed_steps_are_printed_at_once_and_their_reasons_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "check", "red.yaml", "--simulate", "--seed", "7").out.splitlines()
    assert out[0] == "red.yaml: red (simulated, seed 7)"
    assert out[1] == "  FAILED          0.000 s    1000.0 ms     6  expect Move Confirm"
    assert out[2] == "  1 skipped"
    assert out[3:7] == [
        "red.yaml:6: expect Move Confirm (simulated, seed 7)",
        "    no Move Confirm within 1 s",
        "      expected  Move Confirm",
        "      came      nothing",
    ]


@pytest.mark.usefixtures("folder")
def test_passed_steps_are_counted_and_with_v_shown(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["check", "green.yaml", "--simulate"]
    assert run(capsys, *words).out.splitlines()[1:] == ["  2 ok", "1 suite: 2 ok in 0.0 s of bus time"]
    assert [line[:4] for line in run(capsys, *words, "-v").out.splitlines()[1:]] == ["  ok", "  ok", "1 su"]


@pytest.mark.usefixtures("folder")
def test_quiet_prints_failures_and_the_last_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert len(run(capsys, "check", "green.yaml", "--simulate", "-q").out.splitlines()) == 1
    out = run(capsys, "check", "green.yaml", "red.yaml", "--simulate", "-q").out.splitlines()
    assert out[0] == "red.yaml:6: expect Move Confirm (simulated, seed 1)"


@pytest.mark.usefixtures("folder")
def test_a_report_that_cannot_be_written_is_refused_before_anything_is_done(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = run(capsys, "check", "green.yaml", "--simulate", "--junit", "nowhere/report.xml")
    why = "No such file or directory; make its folder first: nowhere"
    assert said == (3, "", f"eurobot-od: nowhere/report.xml: {why}\n")


def test_writes_a_junit_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "check", "green.yaml", "red.yaml", "--simulate", "--junit", "report.xml")
    suites = list(JUnitXml.fromfile(str(folder / "report.xml")))
    assert [(suite.name, suite.tests, suite.failures) for suite in suites] == [("a suite", 2, 0), ("red", 2, 1)]


def test_a_suite_has_a_page_with_its_facts_and_all_steps(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "check", "green.yaml", "red.yaml", "--simulate", "--report", "report.md")
    text = (folder / "report.md").read_text()
    lines = [
        "# Check of lift",
        "FAILED. 2 suites: 2 ok, 1 FAILED, 1 skipped in ",
        "| Bus | simulated |",
        "| Made by | ",
    ]
    tables = ["## Who is who", "| a suite | 2 | 0 | 0 |", "| red | 0 | 1 | 1 |", "### expect Move Confirm"]
    steps = ["### a suite (green.yaml, simulated, seed 1)", "| 7 | expect Check Lift Response | ok |"]
    assert [each for each in lines + tables + steps if each not in text] == []


@pytest.mark.usefixtures("folder")
def test_reports_have_the_identity_that_the_device_has_shown(capsys: pytest.CaptureFixture[str]) -> None:
    other = re.sub(r"(?ms)^(\[1018sub2\].*?DefaultValue=)\S*", r"\g<1>7", (DOCS / "motor.eds").read_text())
    Path("other.eds").write_text(other)
    Path("own.yaml").write_text("spec: 1\nname: own\nnode: motor\nsteps:\n  - sdo: {read: 0x1000}\n")
    with open_bus("virtual", "shown") as bus, Live.node(bus, SimulatedDevice(Dictionary.load(Path("other.eds"), 5))):
        words = f"own.yaml --eds 5={DOCS / 'motor.eds'} -i virtual -c shown --report own.md --junit own.xml"
        said = run(capsys, "check", *words.split())
    assert said.complaint.endswith("motor.eds is for another device: node 5 has product code 0x7, not 0x5")
    for file in ("own.md", "own.xml"):
        text = Path(file).read_text()
        assert "0x00000000:0x00000007:0x00010000:0x00000001" in text
        assert "motor.eds is for another device: node 5 has product code 0x7, not 0x5" in text


@pytest.mark.usefixtures("folder")
def test_a_file_that_is_not_read_whole_is_said_wherever_the_result_is(capsys: pytest.CaptureFixture[str]) -> None:
    Path("odd.eds").write_text((DOCS / "motor.eds").read_text() + "\n[2300]\nParameterName=Odd\n")
    Path("own.yaml").write_text("spec: 1\nname: own\nnode: odd\nsteps:\n  - sdo: {read: 0x1000}\n")
    words = "own.yaml --eds 5=odd.eds --simulate --report own.md --junit own.xml"
    said = run(capsys, "check", *words.split())
    why = "NOT COMPLETE: 1 object of odd.eds is left out"
    assert (said.status, said.out.splitlines()[-1].partition("; ")[2]) == (1, why)
    page = Path("own.md").read_text()
    assert ("Passed." not in page, why in page) == (True, True)
    suites = [(each.name, each.tests, each.failures) for each in JUnitXml.fromfile("own.xml")]
    assert suites == [("own", 1, 0), ("the file odd.eds", 1, 1)]
    assert "0x2300" in Path("own.xml").read_text()
    *_, files = json.loads(run(capsys, "check", *words.split(), "--json").out)
    assert (files["name"], files["steps"][0]["status"]) == ("the file odd.eds", "failed")


@pytest.mark.usefixtures("folder")
def test_a_generated_suite_is_not_for_another_device(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    monkeypatch.setenv("CAN_CHANNEL", "another")
    words = f"--conformance --tag emcy --eds 5={DOCS / 'servo.eds'} --junit run.xml"
    with open_bus("virtual", "another") as bus, Live.node(bus, SimulatedDevice.load(DOCS / "motor.eds", 5)):
        said = run(capsys, "check", *words.split())
        why = "servo.eds is for another device: node 5 has product code 0x5, not 0x5E401"
        assert said.status == 2
        assert said.complaint.endswith(f"{why}; --keep-going checks it all the same")
        assert why in Path("run.xml").read_text()
        assert 'name="bus" value="virtual another"' in Path("run.xml").read_text()
        assert run(capsys, "check", *words.split(), "--keep-going").out.splitlines()[-1].startswith("1 suite: ")


@pytest.mark.usefixtures("folder")
def test_a_stopped_node_is_said_to_be_stopped(capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.yaml").write_text(
        "spec: 1\nname: own\nnode: motor\nsteps:\n  - nmt: stop\n  - wait: 2 s\n  - sdo: {read: 0x1000}\n"
    )
    said = run(capsys, "check", "own.yaml", "--eds", f"5={DOCS / 'motor.eds'}", "--simulate")
    assert "answer from motor (its last heartbeat says stopped: a stopped node answers no SDO; NMT" in said.out


@pytest.mark.usefixtures("folder")
def test_a_listed_suite_has_as_many_steps_as_its_run_reports(capsys: pytest.CaptureFixture[str]) -> None:
    words = f"check --conformance --tag pdo --eds 5={DOCS / 'motor.eds'}".split()
    counts = run(capsys, *words, "--simulate").out.splitlines()[-1]
    total = sum(map(int, re.findall(r"(\d+) (?:ok|skipped)", counts)))
    assert f" {total} steps " in run(capsys, *words, "--list").out


@pytest.mark.parametrize(
    "words", ["nothing.yaml --simulate", "green.yaml -i socketcan -c nothere"], ids=["wrong file", "no bus"]
)
def test_a_run_without_results_leaves_no_earlier_report(
    words: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("report.xml", "report.md"):
        (folder / name).write_text("yesterday's")
    assert run(capsys, "check", *words.split(), "--junit", "report.xml", "--report", "report.md").status in (2, 3)
    (suite,) = JUnitXml.fromfile(str(folder / "report.xml"))
    assert (suite.tests, suite.errors) == (1, 1)
    why = {"nothing.yaml": "No such file or directory", "green.yaml": "cannot open the socketcan bus"}
    for name in ("report.xml", "report.md"):
        assert why[words.partition(" ")[0]] in (folder / name).read_text()


@pytest.mark.usefixtures("folder")
def test_prints_one_document_for_a_program(capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(run(capsys, "check", "green.yaml", "red.yaml", "--simulate", "--json").out)
    assert [step["status"] for suite in data for step in suite["steps"]] == ["ok", "ok", "failed", "skipped"]


@pytest.mark.usefixtures("folder")
def test_a_listed_suite_has_its_network_and_tags(capsys: pytest.CaptureFixture[str]) -> None:
    (green,) = run(capsys, "check", "green.yaml", "--list").out.splitlines()
    (foreign,) = run(capsys, "check", "foreign.yaml", "--list").out.splitlines()
    assert green == f"{'green':24}    2 steps  a suite (lift; any dialect)  [quick, first]"
    assert foreign == f"{'foreign':24}    1 steps  a suite (lift; packed)"


def test_the_guide_explains_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    options = set(re.findall(r"--[a-z-]+", run(capsys, "check", "--help").out)) - BUS_OPTIONS
    assert {option for option in options if f"`{option}" not in GUIDE.read_text()} == set()


# Conformance

MODULE = f"--eds 5={Path(__file__).parents[1] / 'lint' / 'samples' / 'clean.eds'}"


@pytest.mark.usefixtures("folder")
def test_a_conformance_suite_runs_like_any_other(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "--conformance", *MODULE.split(), "--simulate", "--tag", "emcy")
    assert (said.status, said.err) == (0, "")
    assert said.out.splitlines()[0] == "clean.yaml: CiA 301, emergencies (simulated, seed 1)"


@pytest.mark.long
@pytest.mark.usefixtures("folder")
def test_a_conformance_suite_goes_on_after_a_failed_step(capsys: pytest.CaptureFixture[str]) -> None:
    words = f"--conformance {MODULE} --reversible --simulate --tag pdo --fault sync-ignored --json"
    said = run(capsys, "check", *words.split())
    (result,) = json.loads(said.out)
    assert said.status == 1
    assert [step["status"] for step in result["steps"]].count("failed") == 4


@pytest.mark.usefixtures("folder")
def test_a_lost_device_is_reported_once(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", *f"--conformance {MODULE} --simulate --fault sdo-not-answered --json".split())
    first, *others = json.loads(said.out)
    assert said.status == 1
    assert [step["status"] for step in first["steps"]].count("failed") == 1
    assert len(others) == 7
    assert {step["status"] for each in others for step in each["steps"]} == {"skipped"}


@pytest.mark.usefixtures("folder")
def test_suites_that_cannot_be_run_are_listed_with_the_reason(capsys: pytest.CaptureFixture[str]) -> None:
    words = f"check --conformance {MODULE} --simulate --fault sdo-not-answered --junit report.xml --report report.md"
    why = "7.2.4.3.5 SDO: the device answers [reading]' is red in 'CiA 301, NMT states, boot-up and heartbeat'"
    for form in ("-q", "--ctt"):
        said = run(capsys, *words.split(), form)
        unfinished = [line for line in said.out.splitlines() if ": NOT RUN: " in line]
        assert len(unfinished) == 7
        assert form == "--ctt" or "The places are those in the file that -o FILE writes" in said.out
        assert all(why in line for line in unfinished)
    cases = ElementTree.parse("report.xml").iter("testcase")
    skipped = {each.get("name"): each.find("skipped") for each in cases}
    found = skipped["CiA 301, PDOs"]
    assert found is not None
    assert why in (found.get("message") or "")
    assert Path("report.md").read_text().count("NOT RUN: ") == 7


@pytest.mark.usefixtures("folder")
def test_reports_say_why_a_step_is_skipped(capsys: pytest.CaptureFixture[str]) -> None:
    words = f"check --conformance {MODULE} --simulate --tag storage"
    run(capsys, *words.split(), "--junit", "report.xml")
    assert '<skipped message="only with --destructive">' in Path("report.xml").read_text()
    assert "    only with --destructive" in run(capsys, *words.split(), "-v").out.splitlines()


@pytest.mark.long
@pytest.mark.usefixtures("folder")
def test_a_conformance_suite_is_kept_and_run_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "check", "--conformance", *MODULE.split(), "-o", "kept.yaml").status == 0
    made = run(capsys, "check", "--conformance", *MODULE.split(), "--simulate").out.splitlines()
    kept = run(capsys, "check", "kept.yaml", *MODULE.split(), "--simulate").out.splitlines()
    assert kept[-1] == made[-1]


@pytest.mark.long
@pytest.mark.usefixtures("folder")
def test_a_report_and_the_lines_of_the_tool(capsys: pytest.CaptureFixture[str]) -> None:
    words = f"check --conformance {MODULE} --simulate --tag objects --ctt --report clean.html"
    said = run(capsys, *words.split())
    assert (said.status, said.err) == (0, "")
    lines = said.out.splitlines()
    assert lines[0] == "clean"
    assert "   2.5  ok       0x1000:1 read" in lines
    assert lines[-1].startswith("4 of 127 tests executed: 4 ok")
    assert "<h1>Conformance of clean</h1>" in Path("clean.html").read_text()


class InterruptedAt(io.StringIO):
    """An output whose reader presses Ctrl-C when a text appears."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self._text = text

    def write(self, text: str) -> int:
        if self._text in text:
            signal.raise_signal(signal.SIGINT)
        return super().write(text)


@pytest.mark.usefixtures("folder")
def test_ctrl_c_ends_with_teardown_and_report() -> None:
    endless = "- {name: begun, send: Halt Lift}\n- repeat: 100000\n  steps:\n    - wait: 1 ms\n"
    Path("endless.yaml").write_text(document(endless) + "teardown:\n  - {name: tidy, send: Halt Lift}\n")
    before = signal.getsignal(signal.SIGINT)
    with redirect_stdout(InterruptedAt("begun")) as output:
        assert cli.main(["check", "endless.yaml", "green.yaml", "--simulate", "-v"]) == 130
    *_, tidy, last = output.getvalue().splitlines()
    assert tidy.endswith("[teardown] tidy")
    assert re.match(r"1 suite: \d+ ok, 1 interrupted in", last)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_thousand_steps_are_a_suite_like_any_other(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = "\n".join(["- send: Check Lift Request", "- expect: Check Lift Response"] * 500)
    (folder / "long.yaml").write_text(document(steps))
    assert run(capsys, "check", "long.yaml", "--simulate").out.splitlines()[-1].startswith("1 suite: 1000 ok in 0.1 s")


def test_a_device_without_a_robot_is_simulated_from_its_file(tmp_path: Path) -> None:
    (tmp_path / "module.eds").write_text(io_module.TEXT, encoding="ascii")
    (tmp_path / "network.yaml").write_text("nodes: {module: {file: module.eds, node_id: 5}}", encoding="ascii")
    text = """\
spec: 1
name: a device that nobody here wrote
node: module
steps:
  - nmt: start
  - name: its first values
    expect: {module.TPDO1: {entry_1: -5, set_point: 0}}
  - sdo: {write: 0x2100, value: -2}
  - name: a change
    expect: {module.TPDO1: {entry_1: -5, set_point: -2}}
"""
    (tmp_path / "suite.yaml").write_text(text, encoding="ascii")
    words = ["check", str(tmp_path / "suite.yaml"), "--simulate", "--network", str(tmp_path / "network.yaml")]
    assert (cli.main(words), cli.main([*words, "--fault", "sdo-not-answered"])) == (0, 1)


IO, SERVO = f"5={DOCS / 'io.eds'}", f"5={DOCS / 'servo.eds'}"


def test_a_module_passes_with_its_outputs_switched(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "--profile", "401", "--eds", IO, "--simulate", "--outputs")
    assert (said.status, said.err) == (0, "")
    assert "CiA 401, I/O module" in said.out


@pytest.mark.parametrize("profile", ["401", "402"])
def test_without_an_option_a_suite_only_reads(profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    suite = tmp_path / "suite.yaml"
    run(capsys, "check", "--profile", profile, "--eds", {"401": IO, "402": SERVO}[profile], "-o", str(suite))
    text = suite.read_text(encoding="utf-8")
    assert "read:" in text
    assert not any(word in text for word in ("write:", "nmt:"))


REFUSED = [
    (("--profile", "401", "--motion", "1@1"), "--motion needs --profile 402"),
    (("--profile", "402", "--outputs"), "--outputs needs --profile 401"),
    (("--profile", "402"), "io.eds: 0x1000 says CiA 401, not 402: write --profile 401"),
    (("--profile", "402", "--motion", "100"), "'100': a distance and a velocity above 0, such as 2000@100"),
]


@pytest.mark.parametrize(("words", "complaint"), REFUSED)
def test_options_that_do_not_fit_are_one_line(
    words: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "check", *words, "--eds", IO, "--simulate")
    assert (said.status, said.out) == (2, "")
    assert complaint in said.err
    assert "Traceback" not in said.err
