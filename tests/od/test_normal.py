"""The normal form of a file: what is written differently, which of that CiA 306 allows, what is guessed or lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.od.description import ObjectCode
from eurobot_od.od.normal import CanopenAttribute, Change, in_normal_form, normal

LISTS = Change(1, "lists of objects added")
VARIABLE = "ParameterName=x\nDataType=7\nAccessType=ro\n"
SUBS = f"[2000sub0]\n{VARIABLE}[2000sub1]\n{VARIABLE}"


@pytest.mark.parametrize(
    ("text", "line", "what", "standard", "guessed"),
    [
        ("[2000]\nParameterName=x\nAccessType=ro\n", 1, "[2000]: no DataType, read as DOMAIN", False, True),
        ("[2000]\nObjectType=2\nAccessType=ro\n", 1, "[2000]: DataType=0x000F added", True, False),
        (f"[2000]\nObjectType=6\nSubNumber=2\n{SUBS}", 2, "[2000]: ObjectType=0x9 written", True, False),
        (f"[2000]\nObjectType=7\nSubNumber=2\n{SUBS}", 2, "[2000]: ObjectType=0x9 written", False, False),
        (f"[2000]\nObjectType=9\nSubNumber=3\n{SUBS}", 3, "[2000]: SubNumber=2 written", False, False),
        (f"[2000]\n{VARIABLE}[0x2000]\n{VARIABLE}", 5, "[0x2000] made a comment: [2000] is there", True, False),
        (f"[0x2000]\n{VARIABLE}", 1, "section [0x2000] named [2000]", False, False),
    ],
)
def test_a_change_says_where_it_is_and_whether_the_file_was_right(
    text: str, line: int, what: str, standard: bool, guessed: bool
) -> None:
    assert Change(line, what, standard, guessed) in normal(text.encode()).changes


@pytest.mark.parametrize(
    ("text", "canopen_attributes"),
    [
        (
            f"[2000]\nObjectType=6\nSubNumber=2\n{SUBS}",
            [CanopenAttribute(0x2000, None, "object_code", ObjectCode.DEFSTRUCT)],
        ),
        ("[2000]\nObjectType=2\nAccessType=ro\n", [CanopenAttribute(0x2000, None, "object_code", ObjectCode.DOMAIN)]),
        (f"[2000]\nObjectType=9\nSubNumber=2\n{SUBS}", []),
        (f"[2000]\nObjectType=7\nSubNumber=2\n{SUBS}", []),
    ],
)
def test_attributes_that_canopen_ignores_are_listed(text: str, canopen_attributes: list[CanopenAttribute]) -> None:
    assert normal(text.encode()).canopen_attributes == canopen_attributes


def test_a_file_in_its_normal_form_stays_as_it_is() -> None:
    made = normal(normal(f"[2000]\nObjectType=9\nSubNumber=2\n{SUBS}".encode()).text.encode())
    assert (made.changes, made.refusals, made.canopen_attributes) == ([], [], [])
    assert made.text == normal(made.text.encode()).text


def test_a_key_of_the_commissioning_is_just_a_key_elsewhere() -> None:
    assert "[FileInfo]\nBaudrate=5e2\n" in normal(f"[FileInfo]\nBaudrate=5e2\n[2000]\n{VARIABLE}".encode()).text


ODD = f"""[DeviceInfo]
VendorName=a maker ; of things
VendorNumber=010
a:b=c
[Tools]
x:y=1
key=2
key=3
[2000]
Denotation=of one
SubNumber=2
ParameterName=list
ObjectType=0x8
{SUBS}[2000sub1]
ParameterName=y
"""
WRITTEN = f"""[FileInfo]

[DeviceInfo]
; of things
VendorName=a maker
VendorNumber=8
;a:b=c

[DummyUsage]
{"".join(f"Dummy000{code}=0" + chr(10) for code in range(1, 8))}
[Comments]
Lines=0

[Tools]
;x:y=1
key=2

[MandatoryObjects]
SupportedObjects=0

[OptionalObjects]
SupportedObjects=0

[ManufacturerObjects]
SupportedObjects=1
1=0x2000

;key=3
[2000]
Denotation=of one
SubNumber=2
ParameterName=list
ObjectType=0x8

[2000sub0]
{VARIABLE}
[2000sub1]
{VARIABLE};[2000sub1]
;ParameterName=y
"""


def test_a_whole_file_with_its_comments_and_what_cannot_be_an_entry() -> None:
    made = normal(ODD.encode())
    assert made.text == WRITTEN
    assert made.device.objects.keys() == {0x2000}


def test_a_file_of_another_encoding_is_written_in_utf_8_and_said_so_at_its_beginning() -> None:
    text, changes = in_normal_form(f"[2000]\n{VARIABLE.replace('x', 'Gerät')}".encode("latin-1"))
    assert "ParameterName=Gerät\n".encode() in text
    assert changes[0] == Change(1, "Latin-1 written as UTF-8")


def test_the_objects_of_connected_modules_are_written_in_place_of_their_section() -> None:
    made = normal(Path(__file__).with_name("samples").joinpath("coupler.eds").read_bytes(), modules=["1"])
    assert made.has_modules


def test_keys_of_sub_indices_only_become_comments_in_a_record() -> None:
    head = "[2000]\nParameterName=Axis\nObjectType=9\nSubNumber=1\nAccessType=rw\n"
    text = f"{head}[2000sub0]\nParameterName=Count\nDataType=5\nAccessType=ro\n"
    data, changes = in_normal_form(text.encode())
    assert b"\n;AccessType=rw\n" in data
    assert (5, "[2000]: AccessType made a comment: it is of the sub-indices") in [each[:2] for each in changes]
