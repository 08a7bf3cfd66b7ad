"""OD.h and OD.c for CANopenNode, judged by a strict compiler, and by what the compiled dictionary holds."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.export.canopennode import c_name, object_dictionary, storage_groups
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address

HERE = Path(__file__).parent / "canopennode"
DOCS = Path(__file__).parents[2] / "docs"
LINT = Path(__file__).parents[1] / "lint" / "samples"
WHOLE = ("clean", "generated", "old", "editor_with_comments", "crlf_io_module")
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror")

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


class Compiled(NamedTuple):
    """A variable of a compiled dictionary: kind, attributes, length, and its bytes; None without memory."""

    kind: int
    attributes: int
    length: int
    data: bytes | None


VAR, ARR, REC = 1, 2, 3


def compiled(made: Mapping[str, str], folder: Path) -> dict[Address, Compiled]:
    """Compile a dictionary with a program that prints it, and return what that prints."""
    for name, text in made.items():
        (folder / name).write_text(text, "ascii")
    sources = [str(folder / "OD.c"), str(HERE / "dump.c")]
    subprocess.run(["cc", *STRICT, f"-I{HERE}", f"-I{folder}", *sources, "-o", str(folder / "dump")], check=True)
    printed = subprocess.run([str(folder / "dump")], check=True, capture_output=True, text=True).stdout
    rows = (line.split(" ") for line in printed.splitlines())
    return {
        (int(index, 16), int(sub)): Compiled(
            int(kind), int(attributes, 16), int(length), None if data == "-" else bytes.fromhex(data)
        )
        for index, sub, kind, attributes, length, data in rows
    }


def device(text: str, name: str = "made.eds") -> Dictionary:
    return Dictionary.read(text.encode(), Path(name), 1)


def variable(index: str, **entries: str) -> str:
    said = {"ParameterName": f"Object {index}", "DataType": "0x0007", "AccessType": "rw", "PDOMapping": "0"} | entries
    return f"[{index}]\n" + "".join(f"{key}={value}\n" for key, value in said.items())


@needs_compiler
@pytest.mark.parametrize(
    "file",
    [
        DOCS / "motor.eds",
        DOCS / "io.eds",
        DOCS / "servo.eds",
        DOCS / "servo.dcf",
        *(LINT / f"{each}.eds" for each in WHOLE),
    ],
    ids=lambda file: file.name,
)
def test_a_compiled_dictionary_has_what_the_file_says(file: Path, tmp_path: Path) -> None:
    dictionary = Dictionary.load(file, 1)
    found = compiled(object_dictionary(dictionary), tmp_path)
    described = {each: v for each in dictionary.addresses() if each[0] >= 0x1000 and each[1] < 255
                 if (v := dictionary.device.variable(*each))}  # fmt: skip
    assert found.keys() == described.keys()
    for address, each in described.items():
        number = each.value
        if each.type and each.type.is_integer and number and number.value:
            data = found[address].data
            signed = each.type.is_signed
            assert data is not None
            assert int.from_bytes(data, "little", signed=signed) == number.value, address
        assert bool(found[address].attributes & 2) == each.is_writable, address
        assert bool(found[address].attributes & 12) == each.is_mappable, address


# What a variable becomes: its entries in the EDS, and the attributes, length and bytes of the compiled one.
VARIABLES = [
    ("a number", {"DefaultValue": "0x12345678"}, 0x43, bytes.fromhex("78563412")),
    ("without a default it is 0", {}, 0x43, bytes(4)),
    ("the node-ID is the stack's", {"DefaultValue": "$NODEID+0x180"}, 0x43, bytes.fromhex("80010000")),
    ("one byte is not multi-byte", {"DataType": "5", "DefaultValue": "7"}, 0x03, b"\7"),
    ("lowest of 32 bits", {"DataType": "4", "DefaultValue": "-2147483648"}, 0x43, bytes.fromhex("00000080")),
    ("lowest of 64 bits", {"DataType": "0x15", "DefaultValue": "-9223372036854775808"}, 0x43, bytes(7) + b"\x80"),
    ("highest of 64 bits", {"DataType": "0x1B", "DefaultValue": "0xFFFFFFFFFFFFFFFF"}, 0x43, b"\xff" * 8),
    ("24 bits are bytes", {"DataType": "0x16", "DefaultValue": "0x010203"}, 0x03, bytes.fromhex("030201")),
    ("40 bits with a sign", {"DataType": "0x12", "DefaultValue": "-2"}, 0x03, bytes.fromhex("FEFFFFFFFF")),
    ("a REAL32", {"DataType": "8", "DefaultValue": "1.5"}, 0x43, bytes.fromhex("0000C03F")),
    ("a REAL64", {"DataType": "0x11", "DefaultValue": "-0.1"}, 0x43, bytes.fromhex("9A9999999999B9BF")),
    ("a BOOLEAN", {"DataType": "1", "DefaultValue": "1"}, 0x03, b"\1"),
    ("a time", {"DataType": "0x0C", "DefaultValue": "0x020000000001"}, 0x03, bytes.fromhex("010000000002")),
    ("a text that is read only", {"DataType": "9", "AccessType": "const", "DefaultValue": 'a"b\\?ü'}, 0x81,
     'a"b\\?ü'.encode()),
    ("a text that is written has room", {"DataType": "9", "DefaultValue": "abc"}, 0x83, b"abc" + bytes(29)),
    ("16-bit letters", {"DataType": "0x0B", "AccessType": "ro", "DefaultValue": "aé"}, 0x81, b"a\0\xe9\0"),
    ("bytes", {"DataType": "0x0A", "AccessType": "ro", "DefaultValue": "C83DBB"}, 0x01, bytes.fromhex("C83DBB")),
    ("a DOMAIN has no memory", {"DataType": "0x0F"}, 0x03, None),
    ("write only", {"AccessType": "wo", "PDOMapping": "1"}, 0x4A, bytes(4)),
    ("into TPDOs", {"AccessType": "rwr", "PDOMapping": "1"}, 0x47, bytes(4)),
    ("into RPDOs", {"AccessType": "rww", "PDOMapping": "1"}, 0x4B, bytes(4)),
    ("into both", {"PDOMapping": "1"}, 0x4F, bytes(4)),
    ("read only into TPDOs", {"AccessType": "ro", "PDOMapping": "1"}, 0x45, bytes(4)),
    ("no access", {"AccessType": "UNKNOWN"}, 0x40, bytes(4)),
]  # fmt: skip


@needs_compiler
def test_each_kind_of_variable(tmp_path: Path) -> None:
    sections = [variable(f"{0x2000 + at:04X}", **said) for at, (_, said, *_) in enumerate(VARIABLES)]
    found = compiled(object_dictionary(device("\n".join(sections))), tmp_path)
    for at, (what, _, attributes, data) in enumerate(VARIABLES):
        expected = Compiled(VAR, attributes, len(data or b""), data)
        assert found[0x2000 + at, 0] == expected, what


LIST = """[{index}]
ParameterName=List
ObjectType={kind}
SubNumber={count}
[{index}sub0]
ParameterName=Highest sub-index
DataType=5
AccessType=ro
DefaultValue=2
[{index}sub1]
ParameterName={name}
DataType=6
AccessType=rw
DefaultValue=11
[{index}sub{last}]
ParameterName={name}
DataType={type}
AccessType=rw
DefaultValue=12
"""

# Objects with sub-indices: entries of the text, and what the object is in C.
LISTS = [
    ("an array", {}, ARR),
    ("elements of two types are no C array", {"type": "7"}, REC),
    ("a gap is no C array", {"last": "3"}, REC),
    ("a record, two variables of one name", {"kind": "9"}, REC),
    ("names that are words of C", {"kind": "9", "name": "default"}, REC),
    ("names without a letter", {"kind": "9", "name": "+"}, REC),
]


@needs_compiler
def test_each_kind_of_object_with_sub_indices(tmp_path: Path) -> None:
    common = {"kind": "8", "count": "3", "name": "Value", "last": "2", "type": "6"}
    sections = [LIST.format(index=f"{0x2000 + at:04X}", **(common | said)) for at, (_, said, _) in enumerate(LISTS)]
    found = compiled(object_dictionary(device("\n".join(sections))), tmp_path)
    for at, (what, said, kind) in enumerate(LISTS):
        index = 0x2000 + at
        assert found[index, 1] == Compiled(kind, 0x43, 2, b"\x0b\0"), what
        assert found[index, int(said.get("last", "2"))].data == (12).to_bytes(4 if "type" in said else 2, "little"), (
            what
        )


def test_the_same_device_gives_the_same_bytes() -> None:
    file = DOCS / "servo.eds"
    assert object_dictionary(Dictionary.load(file, 1)) == object_dictionary(Dictionary.load(file, 100))


NAMES = [
    ("Device type", "deviceType"),
    ("COB-ID SYNC message", "COB_ID_SYNCMessage"),
    ("COB-ID EMCY", "COB_ID_EMCY"),
    ("Pre-defined error field", "pre_definedErrorField"),
    ("Vendor-ID", "vendor_ID"),
    ("Node-ID of the SDO server", "node_IDOfTheSDOServer"),
    ("RPDO communication parameter", "RPDOCommunicationParameter"),
    ("X", "x"),
    ("2nd value", "_2ndValue"),
    ("Größe (mm)", "gr_eMm"),
    ("", ""),
]


@pytest.mark.parametrize(("text", "name"), NAMES)
def test_names_are_those_of_the_stacks_own_editor(text: str, name: str) -> None:
    if text != "Größe (mm)":  # it keeps letters beyond ASCII, which not every compiler takes
        assert c_name(text) == name
    assert c_name(text).isascii()


XDD = """<?xml version="1.0"?>
<ISO15745ProfileContainer xmlns="http://www.canopen.org/xml/1.1"><ISO15745Profile><ProfileBody>
<ApplicationProcess><parameterList>
  <parameter uniqueID="A" access="readWrite"><UDINT/><defaultValue value="5"/>
    <property name="CO_storageGroup" value="ROM"/><property name="CO_countLabel" value="MINE"/></parameter>
  <parameter uniqueID="B" access="readWrite"><UDINT/><property name="CO_accessSRDO" value="tx"/></parameter>
  <parameter uniqueID="C" access="readWrite"><STRING/><defaultValue value="ab"/>
    <property name="CO_stringLengthMin" value="5"/></parameter>
  <parameter uniqueID="D" access="readWrite"><UDINT/><property name="CO_disabled" value="true"/></parameter>
</parameterList></ApplicationProcess>
<ApplicationLayers><CANopenObjectList>
  <CANopenObject index="2000" name="First" objectType="7" PDOmapping="no" uniqueIDRef="A"/>
  <CANopenObject index="2001" name="Second" objectType="7" PDOmapping="no" uniqueIDRef="B"/>
  <CANopenObject index="2002" name="Third" objectType="7" PDOmapping="no" uniqueIDRef="C"/>
  <CANopenObject index="2003" name="Fourth" objectType="7" PDOmapping="no" uniqueIDRef="D"/>
</CANopenObjectList></ApplicationLayers></ProfileBody></ISO15745Profile></ISO15745ProfileContainer>
"""


@needs_compiler
def test_the_stacks_own_file_takes_precedence(tmp_path: Path) -> None:
    made = object_dictionary(device(XDD, "made.xdd"))
    assert "OD_ROM.x2000_first" in made["OD.c"]
    assert "#define OD_CNT_MINE 1" in made["OD.h"]
    assert compiled(made, tmp_path) == {
        (0x2000, 0): Compiled(VAR, 0x43, 4, b"\5\0\0\0"),
        (0x2001, 0): Compiled(VAR, 0x53, 4, None),  # no value: the program serves it
        (0x2002, 0): Compiled(VAR, 0x83, 5, b"ab\0\0\0"),
    }


def test_the_comment_of_its_editor_in_an_eds_counts() -> None:
    text = variable("2000").replace("[2000]\n", "[2000]\n;StorageLocation=PERSIST_APP\n")
    assert "OD_PERSIST_APP.x2000_object2000" not in object_dictionary(device(text))["OD.c"]  # it has no value
    assert "OD_PERSIST_APP.x2000_object2000" in object_dictionary(device(f"{text}DefaultValue=1\n"))["OD.c"]


STORES = LIST.format(index="1010", kind="8", count="3", name="Save", last="2", type="6")

# Storage groups where the file says none: what else the file has, the object, and the group.
GROUPS = [
    ("communication settings", "", "1017", "PERSIST_COMM"),
    ("who the device is", "", "1018", "PERSIST_COMM"),
    ("the error register", "", "1001", "RAM"),
    ("settings of a device that stores nothing", "", "2000", "RAM"),
    ("settings of a device that stores all", STORES, "2000", "PERSIST_APP"),
]


@pytest.mark.parametrize(("what", "more", "index", "group"), GROUPS, ids=[each[0] for each in GROUPS])
def test_storage_groups_of_other_files(what: str, more: str, index: str, group: str) -> None:
    text = object_dictionary(device(f"{more}\n{variable(index)}"))["OD.c"]
    assert f"&OD_{group}.x{index}_" in text, what


def test_a_storage_group_that_is_given_comes_first() -> None:
    groups = storage_groups([("2000", "MINE"), ("0x2001", "MINE")], "OD")
    text = object_dictionary(device(variable("2000") + variable("2001")), groups=groups)["OD.c"]
    assert "OD_MINE.x2000_object2000" in text
    assert "OD_MINE.x2001_object2001" in text


@pytest.mark.parametrize(
    ("pair", "name", "said"),
    [
        (("99", "A"), "OD", "the index is not in 1000..FFFF"),
        (("two", "A"), "OD", "the index is not in 1000..FFFF"),
        (("2000", "A B"), "OD", "'A B' is not a C identifier"),
        (("2000", "A"), "1", "'1' is not a C identifier"),
    ],
)
def test_names_that_no_compiler_accepts_are_refused(pair: tuple[str, str], name: str, said: str) -> None:
    with pytest.raises(LocalError, match=said):
        storage_groups([pair], name)


def test_a_value_that_does_not_fit_its_type_is_refused() -> None:
    with pytest.raises(DictionaryError, match=r"0x2000 sub 0: value 256 is not UNSIGNED8, 0\.\.255"):
        object_dictionary(device(variable("2000", DataType="5", DefaultValue="256")))


@needs_compiler
def test_text_of_a_file_cannot_end_a_comment(tmp_path: Path) -> None:
    text = f"[DeviceInfo]\nVendorName=*/ #error\nProductName=??/\n{variable('2000', ParameterName='*/ #error')}"
    assert compiled(object_dictionary(device(text)), tmp_path).keys() == {(0x2000, 0)}


@needs_compiler
def test_several_dictionaries_in_one_program_have_names_of_their_own() -> None:
    made = object_dictionary(device(variable("1017")), "motor")
    assert made.keys() == {"motor.h", "motor.c"}
    assert "(config).ENTRY_H1017 = motor_ENTRY_H1017;" in made["motor.h"]
    assert "(config).ENTRY_H1001 = NULL;" in made["motor.h"]
