"""The faults of a bad table are reported with their places, all at once."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from eurobot_od.errors import YamlError
from eurobot_od.od.make import read_table
from eurobot_od.support import yaml_places
from tests.marks import marked
from tests.od.make.tables import TABLE
from tests.rows import rows

REFUSED = "is not allowed; allowed: whole numbers"
BEAT = "0..65535 ms"
HEART = "did you mean heartbeat or heartbeat_timeout?"
WAIT = "bits: 16, range: [1, 0xFFFF]"
KEYS = (
    "known: file, vendor, serial_number, hardware_version, software_version, bit_rate, bit_rates, heartbeat, "
    "heartbeat_timeout, nodes, settings, objects, messages, dialects, traffic"
)
# Each row: a text of the table, what replaces it (with ^ before the place of the problem), what is said about it.
INVALID = {
    # no YAML, or not the one document that is wanted
    "not YAML": ("bit_rates: [500]", "bit_rates: [500\nheartbeat^: 9]", "a list in [ ] lacks a comma, or its ]"),
    "two documents": ("dialects:", "^---\ndialects:", "a second document, where one is all there can be"),
    "control character": ("name: Somebody", "name: Some^\x07body", "special characters are not allowed"),
    # keys
    "unknown key": ("heartbeat: 1000", "^heart: 5\nheartbeat: 1000", f"unknown key 'heart'; {HEART}"),
    "missing key": ("{name: Somebody, number: 0}", "^{name: Somebody}", "key 'number' is missing"),
    "key twice": ("serial_number: 1", "serial_number: 1\n^serial_number: 1", "key 'serial_number' is given twice"),
    "name twice": ("  drive:\n", "  ^core: *core\n  drive:\n", "key 'core' is given twice"),
    "merge key": ("nodes:\n", "nodes:\n  ^<<: {}\n", "expected a text, found '<<', which needs quotes to be one"),
    # YAML 1.1 turns these into other values without a word
    "octal": ("heartbeat: 1000", "heartbeat: ^010", f"heartbeat = '010' {REFUSED} {BEAT}"),
    "base 60": ("heartbeat: 1000", "heartbeat: ^12:30", f"heartbeat = '12:30' {REFUSED} {BEAT}"),
    "underscore": ("heartbeat: 1000", "heartbeat: ^1_0", f"heartbeat = '1_0' {REFUSED} {BEAT}"),
    "truth": ("author: somebody", "author: ^off", "expected a text, found 'off', which needs quotes to be one"),
    "number as text": ('"1.0"', "^1.0", "expected a text, found '1.0', which needs quotes to be one"),
    "nothing as text": ("author: somebody", "author: ^~", "expected a text, found '~', which needs quotes to be one"),
    # wrong types
    "quoted number": ("heartbeat: 1000", 'heartbeat: ^"9"', f"heartbeat = '9' {REFUSED} {BEAT}"),
    "negative": ("heartbeat: 1000", "heartbeat: ^-1", f"heartbeat = '-1' {REFUSED} {BEAT}"),
    "list for number": ("heartbeat: 1000", "heartbeat: ^[1]", f"heartbeat = a list {REFUSED} {BEAT}"),
    "mapping for text": ("author: somebody", "author: ^{}", "expected a text, found a mapping"),
    "text for list": ("watches: [drive]", "watches: ^drive", "expected a list, found 'drive'"),
    "list for mapping": ("{name: Somebody, number: 0}", "^[]", "expected a mapping (keys: name, number), found a list"),
    "range of three": ("[0, 100]", "^[0, 1, 2]", "expected a list of 2, found 3"),
    "not ASCII": ("name: Somebody", "name: ^Jürg", "expected printable ASCII characters, found 'Jürg'"),
    "no date": ('"05-28-2014"', '^"28.5.2014"', "expected a date mm-dd-yyyy, found '28.5.2014'"),
    # empty, or not the name of a file
    "no dialects": (TABLE[TABLE.index("dialects:") :], "dialects: ^{}\n", "expected at least one entry"),
    "no fields": (
        "fields: {Node-ID: {bits: 8, range: [1, 127], default: $NODEID}}",
        "fields: ^{}",
        "expected at least one entry",
    ),
    "node as a path": ("  drive:\n", "  ^../drive:\n", "expected a name of letters, digits, _ and -, found '../drive'"),
    "dialect as a path": ("  other:", "  ^o/ther:", "expected a name of letters, digits, _ and -, found 'o/ther'"),
    # what does not hold between the parts
    "unknown node": ("receivers: [drive]", "receivers: [^wheel]", "unknown node 'wheel'"),
    "misspelt node": ("receivers: [drive]", "receivers: [^dirve]", "unknown node 'dirve'; did you mean drive?"),
    "unknown watched node": ("watches: [drive]", "watches: [^wheel]", "unknown node 'wheel'"),
    "unknown object": ("object: Target", "object: ^Goal", "unknown object 'Goal'"),
    "unknown object in dialect": ("first: [Target]", "first: [^Goal]", "unknown object 'Goal'"),
    "unknown field in dialect": ("{Speed: 7}", "{^Pace: 7}", "unknown field 'Pace'"),
    "identifier twice": ("identifier: 12", "identifier: ^0x8", "identifier 0x008 is used twice, first in line 42"),
    "Node-ID twice": ("node_id: 2", "node_id: ^1", "node_id 1 is used twice, first in line 12"),
    "index twice": ("index: 0x2101", "index: ^0x2100", "index 0x2100 is used twice, first in line 27"),
    "setting twice": ("Check wait:", "^Node-ID:", "setting 'Node-ID' is used twice, first in line 27"),
    "identifier over 11 bits": (
        "identifier: 12",
        "identifier: ^0x800",
        f"identifier = '0x800' {REFUSED} 0x001..0x7FF",
    ),
    "Node-ID over 127": ("node_id: 2", "node_id: ^128", f"node_id = '128' {REFUSED} 1..127"),
    "index of a standard": (
        "index: 0x2000",
        "index: ^0x1018",
        f"index = '0x1018' {REFUSED} 0x2000..0x2FFF",
    ),
    "error behaviour": (
        "communication_error: 0",
        "communication_error: ^3",
        f"communication_error = '3' {REFUSED} 0..2",
    ),
    "heartbeat over 16 bits": (
        "heartbeat: 1000",
        "heartbeat: ^65536",
        f"heartbeat = '65536' {REFUSED} 0..65535 ms",
    ),
    "serial number over 32 bits": (
        "serial_number: 1",
        "serial_number: ^0x100000000",
        f"serial_number = '0x100000000' {REFUSED} 0..4294967295",
    ),
    "bit rate of no device": (
        "bit_rates: [500]",
        "bit_rates: [500, ^333]",
        "bit rate 333 is not one of 10, 20, 50, 125, 250, 500, 800, 1000 kbit/s",
    ),
    "bit rate of no node": ("bit_rate: 500", "bit_rate: ^250", "bit rate 250 is not one of 500 kbit/s"),
    # fields
    "range over the bits": ("bits: 12", "bits: ^11", "4095 does not fit into 11 bits"),
    "identifier of SDO": (
        "identifier: 8",
        "identifier: ^0x601",
        "identifier 0x601 is CANopen's own: the SDO request of node 1",
    ),
    "identifier of an EMCY": (
        "identifier: 8",
        "identifier: ^0x082",
        "identifier 0x082 is CANopen's own: the EMCY of drive",
    ),
    "identifier of a heartbeat": (
        "identifier: 8",
        "identifier: ^0x701",
        "identifier 0x701 is CANopen's own: the heartbeat of node 1",
    ),
    "optional tail within a byte": (
        "  Target:\n    index: 0x2000\n",
        "  Target:\n    index: 0x2000\n    optional: ^Speed\n",
        "'Speed' is optional and begins at bit 4 of byte 1; a dialect with 4 reserved bits before it has it on a byte",
    ),
    "unknown optional field": (
        "  Target:\n    index: 0x2000\n",
        "  Target:\n    index: 0x2000\n    optional: ^Pace\n",
        "unknown field 'Pace'",
    ),
    "two codes of one number": (
        "codes: {unknown: 0xFFF}",
        "codes: {unknown: 0xFFF, lost: ^0xFFF}",
        "codes 'unknown' and 'lost' are both 4095",
    ),
    "below the bits": (WAIT, "bits: ^16, range: [-32769, 9]", "-32769 does not fit into 16 signed bits"),
    "code over signed bits": (
        WAIT,
        "bits: ^16, range: [-1, 9], codes: {far: 0xFFFF}",
        "65535 does not fit into 16 signed bits",
    ),
    "negative width": (WAIT, "bits: ^-16, range: [0, 9]", f"bits = '-16' {REFUSED} 1..32"),
    "no range": (WAIT, "bits: ^16", "a field needs its range, or codes"),
    "REAL32 with a range": (
        WAIT,
        "bits: ^32, type: REAL32, range: [0, 9]",
        "a REAL32 has 32 bits, and neither range nor codes",
    ),
    "a fraction of whole numbers": (
        "default: 9, unit: ms",
        "default: ^1.5, unit: 0.1 mm",
        "default 1.5 is not a whole number: in steps of 0.1 mm",
    ),
    "short REAL32": (WAIT, "bits: ^16, type: REAL32", "a REAL32 has 32 bits, and neither range nor codes"),
    "width over the range": ("{Speed: 7}", "{Speed: ^6}", "100 does not fit into 6 bits"),
    "no bits": ("bits: 8, range: [0, 100]", "bits: ^0, range: [0, 0]", f"bits = '0' {REFUSED} 1..32"),
    "empty range": ("[0, 100], default: 0", "[2, ^1], codes: {one: 1, two: 2}, default: one", "range 2..1 is empty"),
    "default outside": ("[0, 100], default: 0", "[0, 100], default: ^101", "default 101 is not in 0..100"),
    "default without code": ("default: unknown", "default: ^lost", "unknown default 'lost'; known: unknown"),
    "Node-ID in a message": ("default: unknown", "default: ^$NODEID", "unknown default '$NODEID'; known: unknown"),
    "unknown object of reserved bits": ("plain: {", "plain: {reserved: {^Goal: {Speed: 4}}, ", "unknown object 'Goal'"),
    "reserved bits before nothing": ("plain: {", "plain: {reserved: {Target: {^Mass: 4}}, ", "unknown field 'Mass'"),
    "reserved bits before themselves": (
        "plain: {",
        "plain: {reserved: {Target: {^Reserved: 4}}, ",
        "unknown field 'Reserved'",
    ),
    "no reserved bits": ("plain: {", "plain: {reserved: {Target: {Speed: ^0}}, ", f"reserved = '0' {REFUSED} 1..32"),
    "name of reserved bits": (
        "      One bit: ",
        "      ^Reserved 2: ",
        "'Reserved 2' names bits that carry nothing; a dialect has them under reserved",
    ),
    "name of padding in a dialect": (
        "plain: {",
        "plain: {fields: {Target: {^Padding: {bits: 1, range: [0, 1], default: 0}}}, ",
        "'Padding' names bits that carry nothing; a dialect has them under reserved",
    ),
    "message over 64 bits": ("object: Target", "object: ^Long", "'Long' has 65 bits, a PDO at most 64"),
    "reading at the index of a setting": (
        "settings: {}",
        "settings: {}\n    readings: {Now: {index: ^0x2100, fields: {Rate: {bits: 8, range: [0, 9], default: 0}}}}",
        "index 0x2100 is used twice, first in line 28",
    ),
    "reading over the bits": (
        "settings: {}",
        "settings: {}\n    readings: {Now: {index: 0x2102, fields: {Rate: {bits: ^3, range: [0, 9], default: 0}}}}",
        "9 does not fit into 3 bits",
    ),
    "order of what is not sent": (
        "watches: [drive]",
        "watches: [drive]\n    orders: [^Confirm]",
        "unknown message of the core 'Confirm'",
    ),
    # traffic
    "traffic of nothing": ("messages:", "traffic: {^Go: {every: 1 s}}\nmessages:", "unknown message 'Go'"),
    "traffic without a time": (
        "messages:",
        "traffic: {^Goto: {reason: so}}\nmessages:",
        "'Goto' needs either every or answers",
    ),
    "answer to nothing": ("messages:", "traffic: {Confirm: {answers: ^Go}}\nmessages:", "unknown message 'Go'"),
    "time of nothing": ("messages:", "traffic: {Goto: {every: ^Wait.Wait}}\nmessages:", "unknown setting 'Wait.Wait'"),
}


def complaints(text: str) -> list[str]:
    with pytest.raises(YamlError) as error:
        read_table(text, "table.yaml")
    return str(error.value).split("\n")


def test_a_name_that_is_not_known_is_told_with_the_known_ones() -> None:
    text, place = marked(TABLE.replace("receivers: [drive]", "receivers: [^wheel]", 1))
    assert complaints(text) == [f"table.yaml:{place}: unknown node 'wheel'; known: core, drive"]


@rows("old, new, what", INVALID.values())
def test_tells_place_and_reason(old: str, new: str, what: str) -> None:
    assert old in TABLE
    text, place = marked(TABLE.replace(old, new, 1))
    told, *others = complaints(text)
    assert not others
    assert told.removeprefix(f"table.yaml:{place}: {what}").partition(" ")[0] in ("", ";")


def test_tells_all_problems_at_once() -> None:
    text = TABLE.replace("[500]", "no").replace("identifier: 12", "identifier: x").replace("heartbeat:", "h:")
    assert complaints(text) == [
        "table.yaml:1:1: key 'heartbeat' is missing",
        "table.yaml:7:12: expected a list, found 'no'",
        f"table.yaml:8:1: unknown key 'h'; {KEYS}",
        f"table.yaml:43:25: identifier = 'x' {REFUSED} 0x001..0x7FF",
    ]


@pytest.mark.parametrize(
    ("text", "what"), [("", "the file is empty"), ("- 1", "expected a mapping (keys: file, vendor, ")]
)
def test_tells_a_file_without_a_table(text: str, what: str) -> None:
    (problem,) = complaints(text)
    assert problem.startswith(f"table.yaml:1:1: {what}")


BASE = """
a: &shared {x: 1, y: 2}
b: *shared
c: [1, 2]
d: {e: 3}
"""
MERGED = [
    # what is said beside the base, and what both come to
    ("a: {y: 5}", {"a": {"x": "1", "y": "5"}, "b": {"x": "1", "y": "2"}, "c": ["1", "2"], "d": {"e": "3"}}),
    ("{b: , c: [7], f: 8}", {"a": {"x": "1", "y": "2"}, "c": ["7"], "d": {"e": "3"}, "f": "8"}),
    ("d: 9", {"a": {"x": "1", "y": "2"}, "b": {"x": "1", "y": "2"}, "c": ["1", "2"], "d": "9"}),
]


def plain(node: yaml.Node) -> object:
    if isinstance(node, yaml.MappingNode):
        return {key.value: plain(value) for key, value in node.value}
    return [plain(each) for each in node.value] if isinstance(node, yaml.SequenceNode) else node.value


@pytest.mark.parametrize(("own", "both"), MERGED)
def test_a_table_that_extends_another_says_only_what_is_different(own: str, both: object) -> None:
    base = yaml_places.compose(BASE, [])
    assert plain(yaml_places.merged(base, yaml_places.compose(own, []))) == both


def test_errors_in_an_included_table_name_its_file(tmp_path: Path) -> None:
    beneath = tmp_path / "base.yaml"
    beneath.write_text("bit_rate: [1]\nnodse: {}\n")
    with pytest.raises(YamlError) as error:
        read_table("extends: base\nserial_number: x\n", "own.yaml", lambda name: tmp_path / f"{name}.yaml")
    lines = str(error.value).splitlines()
    assert any(line.startswith(f"{beneath}:2:1: unknown key 'nodse'") for line in lines)
    assert any(line.startswith(f"{beneath}:1:11: expected a whole number") for line in lines)
    assert any(line.startswith("own.yaml:2:16: serial_number = 'x' is not allowed") for line in lines)


def test_a_table_beneath_that_is_not_there_is_told_with_its_place() -> None:
    with pytest.raises(YamlError, match=r"^own\.yaml:1:10: there is no table to build on that is called 'none'$"):
        read_table("extends: none\n", "own.yaml")
