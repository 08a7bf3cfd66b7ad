"""Changes to a file's text: what is asked is there afterwards, and every other byte is as it was."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher
from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.lint.findings import Severity
from eurobot_od.lint.rules import lint
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.editing import PROFILES, Change, edited, mapped, profile, removed, said

DOCS = Path(__file__).parents[2] / "docs"
MOTOR = (DOCS / "motor.eds").read_bytes()
FILTER = {"ParameterName": "Filter", "DataType": "UNSIGNED16", "AccessType": "rw", "PDOMapping": "1"}


def difference(before: bytes, after: bytes) -> tuple[list[bytes], list[bytes]]:
    """Return the lines that are gone, and those that are new."""
    old, new = before.splitlines(), after.splitlines()
    codes = SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
    gone = [line for kind, a, b, _, _ in codes if kind != "equal" for line in old[a:b]]
    return gone, [line for kind, _, _, a, b in codes if kind != "equal" for line in new[a:b]]


# What is changed, the lines that go, and those that come.
CHANGES = [
    ("a value", [said("0x1017", {"DefaultValue": "250"})], ["DefaultValue=500"], ["DefaultValue=250"]),
    ("by name", [said("Producer heartbeat time", {"DefaultValue": "1"})], ["DefaultValue=500"], ["DefaultValue=1"]),
    ("a limit that was not there", [said("1017", {"HighLimit": "900"})], [], ["HighLimit=900"]),
    ("a key taken away", [said("1017", {"DefaultValue": ""})], ["DefaultValue=500"], []),
    ("a sub-index", [said("1018:4", {"DefaultValue": "0x1F"})], None, ["DefaultValue=0x1F"]),
    ("a new object", [said("2103", {**FILTER, "ObjectType": "VAR"})], ["SupportedObjects=2"],
     ["SupportedObjects=3", "3=0x2103", "[2103]", "ParameterName=Filter", "ObjectType=0x7", "DataType=0x0006",
      "AccessType=rw", "PDOMapping=1", ""]),
    ("an object removed", [removed("2100")], None, ["SupportedObjects=1"]),
    ("a mapping", [said("2103", {**FILTER, "ObjectType": "VAR"}), mapped("TPDO1", ["0x2103"])], None, None),
]  # fmt: skip


@pytest.mark.parametrize(("what", "changes", "gone", "new"), CHANGES, ids=[each[0] for each in CHANGES])
@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"], ids=["LF", "CRLF", "CR"])
def test_only_what_is_asked_is_another_line(
    what: str, changes: Sequence[Change], gone: list[str] | None, new: list[str] | None, end: bytes
) -> None:
    before = MOTOR.replace(b"\n", end)
    after = edited(before, "motor.eds", changes)
    assert after.replace(end, b"").count(b"\n") == after.replace(end, b"").count(b"\r") == 0
    found = difference(before, after)
    assert gone is None or found[0] == [each.encode() for each in gone], what
    assert new is None or found[1] == [each.encode() for each in new], what
    assert not [each for each in lint(after, "motor.eds") if each.severity is Severity.ERROR]


ODD = (
    b"\xef\xbb\xbf; a comment\n[1017] ; behind a header\n ParameterName = Beat\t; why\nDataType=6\nAccessType=rw\n"
    b"DefaultValue  =  500   ; ms\n; below\n\n\n; of the next\n[1018]\nParameterName=Who\nObjectType=9"
)


def test_blanks_and_comments_stay_around_a_value() -> None:
    after = edited(ODD, "odd.eds", [said("1017", {"DefaultValue": "7", "HighLimit": "9"})])
    wanted = ODD.replace(b"  500   ; ms\n", b"  7   ; ms\nHighLimit=9\n")
    assert after == wanted


def test_a_file_without_a_last_line_end_gets_one_before_what_is_new() -> None:
    after = edited(ODD, "odd.eds", [said("1018:1", {**FILTER, "DataType": "UNSIGNED32"})])
    assert after.startswith(ODD + b"\n")
    assert after.endswith(b"PDOMapping=1\n")


def test_letters_beyond_ascii_stay_the_same_bytes() -> None:
    before = MOTOR.replace(b"Producer heartbeat time", b"Herzschl\xe4ge")
    after = edited(before, "motor.eds", [said("1017", {"DefaultValue": "250"})])
    assert difference(before, after) == ([b"DefaultValue=500"], [b"DefaultValue=250"])


REFUSED = [
    ([said("1017", {"DefaultValue": "70000"})], DictionaryError, "DefaultValue '70000': expected UNSIGNED16, 0..65535"),
    ([said("2103", {"HighLimit": "1"})], DictionaryError, "the file has no 2103, and a new one needs ParameterName"),
    (
        [said("2100", {**FILTER, "ObjectType": "VAR"})],
        DictionaryError,
        "2100 exists already, with an ObjectType: `set` changes it; a new one takes a free index",
    ),
    ([said("1017", {"Colour": "red"})], DictionaryError, "unknown key 'Colour'"),
    ([said("Nothing", {"LowLimit": "1"})], DictionaryError, "unknown object 'Nothing'"),
    ([removed("2103")], LocalError, "2103: the file does not describe it"),
    (
        [removed("2000:9")],
        LocalError,
        "; 0x2000 has the sub-indices 0, 1, 2, 3",
    ),
    ([mapped("PDO9", ["6064"])], LocalError, "PDO9 is not a PDO; write RPDO1 or TPDO1, up to 512"),
    ([mapped("TPDO1", ["1008"])], LocalError, "1008: it has no data type of a fixed length"),
    ([mapped("TPDO1", ["6064"] * 3)], LocalError, "TPDO1: 96 bits; a PDO has 64"),
]


@pytest.mark.parametrize(("changes", "error", "words"), REFUSED, ids=[each[2][:40] for each in REFUSED])
def test_impossible_edits_are_refused(changes: Sequence[Change], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words.replace(".", r"\.")):
        edited(MOTOR, "motor.eds", changes)


def test_a_file_in_xml_has_no_lines_to_change() -> None:
    with pytest.raises(DictionaryError, match="XML; `export eds` makes the EDS"):
        edited(b"<?xml version='1.0'?><a/>", "motor.xdd", [said("1017", {"DefaultValue": "1"})])


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_makes_a_device_without_an_error(name: str) -> None:
    empty = b"[FileInfo]\nFileName=new.eds\n"
    made = edited(empty, "new.eds", [profile("301"), profile(name)])
    of_objects = [each for each in lint(made, "new.eds") if each.severity is Severity.ERROR and each.code >= "E3"]
    assert of_objects == []
    dictionary = Dictionary.read(made, Path("new.eds"), 5)
    assert {0x1000, 0x1001, 0x1018} < dictionary.members.keys()
    assert dictionary.normal.refusals == []


def test_the_number_of_pdos_is_that_of_their_records() -> None:
    after = edited(MOTOR, "motor.eds", [mapped("TPDO2", ["6064"])])
    assert (b"NrOfTXPDO=1" in MOTOR, b"NrOfTXPDO=2" in after) == (True, True)
    assert edited(after, "motor.eds", [removed("1801"), removed("1A01")]) == MOTOR


def test_an_object_that_is_mapped_already_keeps_its_length_and_spelling() -> None:
    # Half of a value, such as a BOOLEAN in a whole byte; and a line that is written otherwise than we write it.
    before = MOTOR.replace(b"DefaultValue=0x20000110", b"DefaultValue=0x20000108").replace(
        b"0x60640020", b"0x60640020 "
    )
    after = edited(before, "motor.eds", [mapped("TPDO1", ["2000:1", "2000:2"])])
    assert difference(before, after) == (
        [b"DefaultValue=3", b"DefaultValue=0x60640020 "], [b"DefaultValue=2", b"DefaultValue=0x00000000 "],
    )  # fmt: skip
    assert edited(before, "motor.eds", [mapped("TPDO1", ["2000:1", "2000:2", "6064"])]) == before


def test_bits_that_carry_nothing_are_mapped_by_their_data_type() -> None:
    after = edited(MOTOR, "motor.eds", [mapped("RPDO1", ["0x0006", "2000:3"])])
    values = [each for each in difference(MOTOR, after)[1] if each.startswith(b"DefaultValue")]
    assert values == [b"DefaultValue=2", b"DefaultValue=0x00060010"]  # what was there is one line further down


def test_the_mapping_of_a_configuration_is_changed_where_it_has_its_values() -> None:
    before = MOTOR.replace(b"DefaultValue=0x20000110", b"DefaultValue=0x20000110\nParameterValue=0x20000110")
    after = edited(before, "motor.dcf", [mapped("TPDO1", ["2000:2", "2000:1", "6064"])])
    assert b"DefaultValue=0x20000110\nParameterValue=0x20000210\n" in after


def test_a_pdo_is_valid_while_it_carries_something() -> None:
    # An RPDO or TPDO that is valid and maps nothing is an error to some stacks (CANopenNode: EMCY 0x8200).
    made = edited(b"[FileInfo]\nFileName=new.eds\n", "new.eds", [profile("301")])
    for objects, is_valid in ((["1001"], True), ([], False)):
        made = edited(made, "new.eds", [mapped("TPDO1", objects)])
        pdos = {
            each.title: (each.valid, each.cob_id & 0x7FF) for each in Dictionary.read(made, Path("new.eds"), 5).pdos
        }
        assert pdos == {"RPDO 1": (False, 0x205), "TPDO 1": (is_valid, 0x185)}


def test_a_profile_leaves_what_is_there() -> None:
    after = edited(MOTOR, "motor.eds", [profile("301")])
    gone, _ = difference(MOTOR, after)
    assert gone == [b"SupportedObjects=10"]
    assert Dictionary.read(after, Path("motor.eds"), 5).default((0x1017, 0)) == 500


def test_a_change_is_undone_by_its_opposite() -> None:
    there = edited(MOTOR, "motor.eds", [said("2103", {**FILTER, "ObjectType": "VAR"})])
    assert edited(there, "motor.eds", [removed("2103")]) == MOTOR
