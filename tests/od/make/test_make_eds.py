"""The EDS files are what the protocol table says, other tools accept them, and a bad table is told by its place."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import canopen
import make_eds
import pytest

EDS = Path(__file__).resolve().parents[3] / "eds"
FILES = sorted(EDS.glob("*/*.eds"))
TABLE = """\
file: {version: 1, revision: 0, time: "12:00PM", date: "05-28-2014", author: somebody}
vendor: {name: Somebody, number: 0}
serial_number: 1
hardware_version: "1"
software_version: "1.0"
bit_rates: [500]
heartbeat: 1000
heartbeat_timeout: 2000
nodes:
  core: &core
    node_id: 1
    product_name: Core
    product_number: 1
    order_code: CORE
    watches: [drive]
    communication_error: 1
    settings: {Wait: {index: 0x2101, fields: {Check wait: {bits: 16, range: [1, 0xFFFF], default: 9, unit: ms}}}}
  drive:
    node_id: 2
    product_name: Drive
    product_number: 2
    order_code: DRIVE
    watches: []
    communication_error: 0
    settings: {}
settings: {Node: {index: 0x2100, fields: {Node-ID: {bits: 8, range: [1, 127], default: $NODEID}}}}
objects:
  Target:
    index: 0x2000
    fields:
      X position: {bits: 12, range: [0, 3000], codes: {unknown: 0xFFF}, default: unknown, unit: mm}
      Speed: {bits: 8, range: [0, 100], default: 0}
  Long:
    index: 0x2001
    fields:
      First half: {bits: 32, range: [0, 1], default: 0}
      Second half: {bits: 32, range: [0, 1], default: 0}
      One bit: {bits: 1, range: [0, 1], default: 0}
messages:
  Goto:
    {identifier: 8, priority: normal, protocol: GTP, command: Goto, senders: [core], receivers: [drive], object: Target}
  Confirm: {identifier: 12, priority: normal, protocol: GTP, command: Confirm, senders: [drive], receivers: [core]}
dialects:
  plain: {revision_number: 0x00010000}
  other: {revision_number: 0x00020000, widths: {Target: {Speed: 7}}, most_significant_first: [Target]}
"""

NUMBER = "expected a whole number, decimal or 0x hexadecimal, found"
# Each row: a text of the table, what replaces it (with ^ before the place of the problem), what is said of it.
INVALID = {
    # no YAML, or not the one document that is wanted
    "not YAML": ("bit_rates: [500]", "bit_rates: [500\nheartbeat^: 9]", "expected ',' or ']', but got ':'"),
    "two documents": ("dialects:", "^---\ndialects:", "but found another document"),
    "control character": ("name: Somebody", "name: Some^\x07body", "special characters are not allowed"),
    # keys
    "unknown key": ("heartbeat: 1000", "^heart: 5\nheartbeat: 1000", "unknown key 'heart'"),
    "missing key": ("{name: Somebody, number: 0}", "^{name: Somebody}", "key 'number' is missing"),
    "key twice": ("serial_number: 1", "serial_number: 1\n^serial_number: 1", "key 'serial_number' stands twice"),
    "name twice": ("  drive:\n", "  ^core: *core\n  drive:\n", "key 'core' stands twice"),
    "merge key": ("nodes:\n", "nodes:\n  ^<<: {}\n", "expected a text, found '<<', which needs quotes to be one"),
    # YAML 1.1 turns these into other values without a word
    "octal": ("heartbeat: 1000", "heartbeat: ^010", f"{NUMBER} '010'"),
    "base 60": ("heartbeat: 1000", "heartbeat: ^12:30", f"{NUMBER} '12:30'"),
    "underscore": ("heartbeat: 1000", "heartbeat: ^1_0", f"{NUMBER} '1_0'"),
    "truth": ("author: somebody", "author: ^off", "expected a text, found 'off', which needs quotes to be one"),
    "number as text": ('"1.0"', "^1.0", "expected a text, found '1.0', which needs quotes to be one"),
    "nothing as text": ("author: somebody", "author: ^~", "expected a text, found '~', which needs quotes to be one"),
    # wrong types
    "quoted number": ("heartbeat: 1000", 'heartbeat: ^"9"', f"{NUMBER} '9'"),
    "negative": ("heartbeat: 1000", "heartbeat: ^-1", f"{NUMBER} '-1'"),
    "list for number": ("heartbeat: 1000", "heartbeat: ^[1]", f"{NUMBER} a list"),
    "mapping for text": ("author: somebody", "author: ^{}", "expected a text, found a mapping"),
    "text for list": ("watches: [drive]", "watches: ^drive", "expected a list, found 'drive'"),
    "list for mapping": ("{name: Somebody, number: 0}", "^[]", "expected a mapping, found a list"),
    "range of three": ("[0, 100]", "^[0, 1, 2]", "expected a list of 2, found 3"),
    "not ASCII": ("name: Somebody", "name: ^Jürg", "expected printable ASCII characters, found 'Jürg'"),
    "no date": ('"05-28-2014"', '^"28.5.2014"', "expected a date mm-dd-yyyy, found '28.5.2014'"),
    "priority": ("priority: normal", "priority: ^high", "expected one of emergency, normal, information, found 'high'"),
    # what does not hold between the parts
    "unknown node": ("receivers: [drive]", "receivers: [^wheel]", "unknown node 'wheel'"),
    "unknown watched node": ("watches: [drive]", "watches: [^wheel]", "unknown node 'wheel'"),
    "unknown object": ("object: Target", "object: ^Goal", "unknown object 'Goal'"),
    "unknown object in dialect": ("first: [Target]", "first: [^Goal]", "unknown object 'Goal'"),
    "unknown field in dialect": ("{Speed: 7}", "{^Pace: 7}", "unknown field 'Pace'"),
    "identifier twice": ("identifier: 12", "identifier: ^0x8", "identifier 0x008 is used twice, first in line 41"),
    "Node-ID twice": ("node_id: 2", "node_id: ^1", "node_id 1 is used twice, first in line 11"),
    "index twice": ("index: 0x2101", "index: ^0x2100", "index 0x2100 is used twice, first in line 26"),
    "setting twice": ("Check wait:", "^Node-ID:", "setting 'Node-ID' is used twice, first in line 26"),
    "identifier over 11 bits": ("identifier: 12", "identifier: ^0x800", "identifier 0x800 is not in 0x001..0x7FF"),
    "Node-ID over 127": ("node_id: 2", "node_id: ^128", "node_id 128 is not in 1..127"),
    "index of a standard": ("index: 0x2000", "index: ^0x1018", "index 0x1018 is not in 0x2000..0x2FFF"),
    "error behaviour": ("communication_error: 0", "communication_error: ^3", "communication_error 3 is not in 0..2"),
    # fields
    "range over the bits": ("bits: 12", "bits: ^11", "4095 does not fit into 11 bits"),
    "width over the range": ("{Speed: 7}", "{Speed: ^6}", "100 does not fit into 6 bits"),
    "no bits": ("bits: 8, range: [0, 100]", "bits: ^0, range: [0, 0]", "bits 0 is not in 1..32"),
    "empty range": ("[0, 100], default: 0", "[2, ^1], codes: {one: 1, two: 2}, default: one", "range 2..1 is empty"),
    "default outside": ("[0, 100], default: 0", "[0, 100], default: ^101", "default 101 is not in 0..100"),
    "default without code": ("default: unknown", "default: ^lost", "unknown default 'lost'; known: unknown"),
    "Node-ID in a message": ("default: unknown", "default: ^$NODEID", "unknown default '$NODEID'; known: unknown"),
    "message over 64 bits": ("object: Target", "object: ^Long", "'Long' has 65 bits, a PDO at most 64"),
}


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "eds"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "table.yaml"
    path.write_text(TABLE, encoding="utf-8")
    return path


def make(source: Path, output: Path, *more: str) -> int:
    return make_eds.main(["--source", str(source), "--output", str(output), *more])


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.glob("*/*")}


def marked(text: str) -> tuple[str, str]:
    """Take the ^ out of a text; give the text without it and its place as `line:column`."""
    before, after = text.split("^")
    lines = before.split("\n")
    return before + after, f"{len(lines)}:{len(lines[-1]) + 1}"


def test_makes_the_same_bytes_every_time(source: Path, tmp_path: Path) -> None:
    assert make(source, tmp_path / "one") == make(source, tmp_path / "two") == 0
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    assert set(contents(tmp_path / "one")) == {"plain/core.eds", "plain/drive.eds", "other/core.eds", "other/drive.eds"}


def test_writes_plain_lines(source: Path, output: Path) -> None:
    make(source, output)
    assert all(each.isascii() and b"\r" not in each and each.endswith(b"\n") for each in contents(output).values())


def test_the_repositorys_files_are_what_its_table_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert make_eds.main(["--check"]) == 0
    assert capsys.readouterr().out == f"{EDS}: 6 EDS files are what the table says\n"


def test_check_tells_a_changed_width(source: Path, output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make(source, output)
    source.write_text(TABLE.replace("bits: 12", "bits: 13"))
    assert make(source, output, "--check") == 1
    assert {line.rpartition(" ")[0] for line in capsys.readouterr().out.splitlines()} == {
        f"{output / path}: differs first in line" for path in contents(output)
    }


def test_check_tells_the_first_line_that_differs(
    source: Path, output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(source, output)
    changed, shorter = output / "other" / "core.eds", output / "plain" / "core.eds"
    changed.write_bytes(changed.read_bytes().replace(b"FileVersion=1", b"FileVersion=2").replace(b"ro\n", b"rw\n"))
    shorter.write_bytes(b"[FileInfo]\n")
    assert make(source, output, "--check") == 1
    assert capsys.readouterr().out == f"{changed}: differs first in line 3\n{shorter}: differs first in line 2\n"


def test_check_tells_missing_and_superfluous_files(
    source: Path, output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(source, output)
    missing = (output / "other" / "core.eds").rename(output / "other" / "camera.eds")
    assert make(source, output, "--check") == 1
    assert capsys.readouterr().out == (f"{missing}: should not be there\n{output / 'other' / 'core.eds'}: is missing\n")


def test_check_writes_nothing(source: Path, output: Path) -> None:
    assert make(source, output, "--check") == 1
    assert not output.exists()


@pytest.mark.parametrize(("old", "new", "what"), INVALID.values(), ids=INVALID.keys())
def test_tells_place_and_reason(
    old: str, new: str, what: str, source: Path, output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in TABLE
    text, place = marked(TABLE.replace(old, new, 1))
    source.write_text(text, encoding="utf-8")
    assert make(source, output) == 2
    assert capsys.readouterr().err == f"{source}:{place}: {what}\n"
    assert not output.exists()


def test_tells_all_problems_at_once(source: Path, output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source.write_text(
        TABLE.replace("[500]", "no").replace("identifier: 12", "identifier: x").replace("heartbeat:", "h:")
    )
    assert make(source, output) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"{source}:1:1: key 'heartbeat' is missing",
        f"{source}:6:12: expected a list, found 'no'",
        f"{source}:7:1: unknown key 'h'",
        f"{source}:42:25: {NUMBER} 'x'",
    ]


@pytest.mark.parametrize(("text", "what"), [("", "the file is empty"), ("- 1", "expected a mapping, found a list")])
def test_tells_a_file_without_a_table(
    text: str, what: str, source: Path, output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source.write_text(text)
    assert make(source, output) == 2
    assert capsys.readouterr().err == f"{source}:1:1: {what}\n"


def test_tells_a_file_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert make(tmp_path / "nothing.yaml", tmp_path) == 2
    assert capsys.readouterr().err == f"{tmp_path / 'nothing.yaml'}: No such file or directory\n"


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_dcfchk_accepts(file: Path) -> None:
    dcfchk = [sys.executable, "-W", "default", "-m", "dcf.cli", "--node_id", "2", str(file)]
    done = subprocess.run(dcfchk, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_canopen_reads_without_a_word(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        canopen.import_od(str(file), node_id=2)
    assert caplog.messages == []
