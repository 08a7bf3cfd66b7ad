"""Every rule for a single file flags its own defects at their lines, and nothing in the clean files."""

from __future__ import annotations

import pytest

from eurobot_od.lint.findings import Severity
from eurobot_od.lint.rules import FILE_RULES, lint
from tests.kit import lift
from tests.lint.mutations import BASES, DEFECTS, Defect, broken_file, expected_line, mutated
from tests.rows import rows

MADE = {name: text.encode() for name, text in lift.texts().items() if name.endswith(".eds")}
"""Files that a table makes."""


@pytest.mark.parametrize("base", BASES)
def test_a_clean_file_has_no_findings(base: str) -> None:
    name, text = BASES[base]
    assert lint(text.encode(), name) == []


@rows("defect", DEFECTS)
def test_a_defect_is_reported_with_its_code_and_line(defect: Defect) -> None:
    found = lint(broken_file(defect), BASES[defect.base][0])
    assert (expected_line(defect), defect.code) in {(each.line, each.code) for each in found}, found


def test_every_rule_has_a_defect() -> None:
    assert {each.code for each in FILE_RULES} - {each.code for each in DEFECTS} == set()


def test_the_table_has_many_different_defects() -> None:
    assert len({each.name for each in DEFECTS}) == len(DEFECTS) >= 120


def test_every_code_belongs_to_one_rule() -> None:
    codes = [each.code for each in FILE_RULES]
    assert len(set(codes)) == len(codes)
    assert len({code[1:] for code in codes}) == len(codes)  # a change of severity never makes two rules look alike


@pytest.mark.parametrize(("file", "content"), MADE.items())
def test_generated_files_have_only_infos(file: str, content: bytes) -> None:
    assert [each for each in lint(content, file) if each.severity is not Severity.INFO] == []


# What is unusual and no mistake: section, old and new text, and the code that stays silent.
NO_DEFECTS = [
    ("2007", "DefaultValue=-5", "DefaultValue=0xFFFB", "E435"),  # an INTEGER16: its bits
    ("2007", "LowLimit=-100", "LowLimit=0x8000", "E437"),
    ("2007", "LowLimit=-100", "LowLimit=0xFF9C", "E438"),
    ("1801sub1", "DefaultValue=$NODEID+0x280", "DefaultValue=0x181", "E610"),  # as TPDO 1 of node 1 and of no other
]


@pytest.mark.parametrize(("section", "old", "new", "code"), NO_DEFECTS)
def test_valid_variants_are_not_reported(section: str, old: str, new: str, code: str) -> None:
    name, text = BASES["eds"]
    head, found, tail = text.partition(f"[{section}]")
    assert old in tail
    assert code not in {each.code for each in lint((head + found + tail.replace(old, new, 1)).encode(), name)}


# The words about what is missing: section, old and new text, and the message.
WORDS = [
    ("2008", "PDOMapping=0", "SubNumber=2", "SubNumber does not belong to [2008], a VAR or DOMAIN; with"),
    ("2002sub1", "AccessType=", "SubNumber=2\nAccessType=", "SubNumber does not belong to [2002sub1], a sub-index"),
    ("1600sub1", "DefaultValue=0x2001", "DefaultValue=0x2F01",
     "RPDO 1 maps 0x2F01 sub 1, but there is no object 0x2F01"),
    ("1600sub1", "DefaultValue=0x200101", "DefaultValue=0x200109",
     "RPDO 1 maps 0x2001 sub 9, but it has no such sub-index; the highest is "),
    ("1600sub1", "DefaultValue=0x200101", "DefaultValue=0x200701",
     "RPDO 1 maps 0x2007 sub 1, but that has no sub-indices: it is mapped as sub 0"),
    ("2007", "AccessType=rww", "ACCESSTYPE=rww\nOBJFLAGS=0",
     "key ACCESSTYPE spelled AccessType is how CiA 306 has it, and 1 more"),
]  # fmt: skip


@pytest.mark.parametrize(("section", "old", "new", "words"), WORDS)
def test_a_finding_names_what_is_missing(section: str, old: str, new: str, words: str) -> None:
    text = mutated(Defect("", "", section, old, new))
    assert any(each.message.startswith(words) for each in lint(text.encode(), "clean.eds"))


def test_a_finding_in_a_compact_array_names_the_sub_index() -> None:
    text = "[2000]\nParameterName=A\nObjectType=8\nDataType=5\nAccessType=rw\nCompactSubObj=3\n[2000Value]\n2=256\n"
    (found,) = (each for each in lint(text.encode(), "a.eds") if each.code == "E435")
    assert (found.line, found.message) == (8, "2=256 of 0x2000 sub 2 is outside UNSIGNED8")


def test_decimal_sub_indices_are_reported_once() -> None:
    head = "[2000]\nParameterName=A\nObjectType=8\nSubNumber=11\n"
    member = "[2000sub{}]\nParameterName=x\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue={}\n"
    text = head + "".join(member.format(sub, "" if sub else 10) for sub in range(11))
    found = [each.code for each in lint(text.encode(), "a.eds")]
    assert ("W121" in found, "E415" in found) == (True, False)
