"""Device descriptions in XML: an EDS made an XDD and read again is the same device; XML that is none costs one line."""

from __future__ import annotations

import random
import re
import time
from codecs import BOM_UTF8, BOM_UTF16
from contextlib import suppress
from pathlib import Path

import canopen
import pytest

from eurobot_od.cli import main
from eurobot_od.device.objects import Objects
from eurobot_od.errors import DictionaryError
from eurobot_od.export.xdd import xdd_text
from eurobot_od.lint.diff import compare
from eurobot_od.lint.model import load
from eurobot_od.lint.rules import lint
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import Odd
from eurobot_od.od.formats import plain_value, read
from eurobot_od.od.network import read_network
from eurobot_od.od.normal import in_normal_form
from eurobot_od.od.values import DATA_TYPES, Address, Value
from eurobot_od.sdo.wire import Abort, Reason
from tests.eds_text import DEVICE_TYPE, variable
from tests.kit import lift
from tests.rows import rows

ROOT = Path(__file__).parents[2]
FILES = [
    *sorted(lift.files().glob("*/*.eds")),
    *sorted((ROOT / "tests" / "lint" / "samples").iterdir()),
    *sorted(ROOT.glob("tests/kit/makers/*.eds")),
    *sorted(ROOT.glob("tests/od/samples/*.eds")),
    *sorted(ROOT.glob("docs/*.eds")),
    *sorted(ROOT.glob("docs/*.dcf")),
]
CLEAN = ROOT / "tests" / "lint" / "samples" / "clean.eds"
XDD = xdd_text(Dictionary.load(CLEAN, 1))


@pytest.mark.parametrize("file", FILES)
def test_an_eds_made_an_xdd_and_an_eds_again_is_the_same_device_with_the_same_values(file: Path) -> None:
    loaded = Dictionary.load(file, 1)
    made = xdd_text(loaded).encode()
    back, changes = in_normal_form(made, "made.xdd")
    device, unusable = load(file.read_bytes(), file.name), loaded.normal.refusals
    for other in (made, back):
        found = compare(device, load(other, file.name), with_names=True)
        # what cannot be used as the file has it, such as a variable without a type, need not stay so
        assert [each for each in found if each.where not in {(one.index, one.sub) for one in unusable}] == []
    assert [each for each in changes if not each.standard] == []
    ours, theirs = (Dictionary.read(data, file, 5) for data in (file.read_bytes(), made))
    assert {each: theirs.default(each) for each in theirs.addresses()} == {
        each: ours.default(each) for each in ours.addresses()
    }
    pdos = [
        [(pdo.index, pdo.cob_id, pdo.length) for pdo in each.read_pdos(each.default, str)] for each in (ours, theirs)
    ]
    assert pdos[0] == pdos[1]


ODD = """\
[1000]
ParameterName=Device type
DataType=7
AccessType=ro
DefaultValue=0
[2000]
ParameterName=A type of the maker's own
DataType=0x40
AccessType=RW
LowLimit=0x3
DefaultValue=0x0
[2001]
ParameterName=No bytes
DataType=0x000F
AccessType=rw
DefaultValue=@ABCD
[2002]
ParameterName=Tab
DataType=9
AccessType=rw
DefaultValue=a\tb
[2003]
ParameterName=Both ways, but in no PDO
DataType=7
AccessType=rww
PDOMapping=0
[2004]
ParameterName=Into the process
DataType=7
AccessType=rww
PDOMapping=1
[2005]
ParameterName=From the process
DataType=7
AccessType=rwr
PDOMapping=1
"""


def test_odd_values_of_a_file_are_kept() -> None:
    made = xdd_text(Dictionary.read(ODD.encode(), Path("odd.eds"), 1))
    assert compare(load(ODD.encode(), "odd.eds"), load(made.encode(), "odd.xdd"), with_names=True) == []
    assert made.count('PDOmapping="RPDO"') == made.count('PDOmapping="TPDO"') == 1


# What the schema says where a file is silent (CiA 311, schema 1.1)


def process(parameter: str, said: str = "", lists: str = "", commissioning: str = "") -> bytes:
    """A description with one object, at 0x2000, of one parameter."""
    return f"""\
<ISO15745ProfileContainer xmlns="http://www.canopen.org/xml/1.1"><ISO15745Profile><ProfileBody>
<ApplicationProcess>{lists}<parameterList>{parameter}</parameterList></ApplicationProcess>
<CANopenObjectList><CANopenObject index="1000" name="Device type" objectType="7" dataType="0007" accessType="ro"
 defaultValue="0"/><CANopenObject index="2000" name="Value" objectType="7" uniqueIDRef="P" {said}/></CANopenObjectList>
{commissioning}</ProfileBody></ISO15745Profile></ISO15745ProfileContainer>""".encode()


TEMPLATE = (
    '<templateList><parameterTemplate uniqueID="T" access="readWrite"><UINT/><defaultValue value="7"/>'
    "</parameterTemplate></templateList>"
)
FROM_TEMPLATE = process('<parameter uniqueID="P" templateIDRef="T"/>', lists=TEMPLATE)
OWN = '<parameter uniqueID="P" access="read" templateIDRef="T"><defaultValue value="8"/></parameter>'
DERIVED = (
    '<dataTypeList><derived name="d" uniqueID="D"><dataTypeIDRef uniqueIDRef="E"/></derived>'
    '<enum name="e" uniqueID="E"><USINT/></enum><array name="a" uniqueID="A"><USINT/></array></dataTypeList>'
)
OF_TYPE = '<parameter uniqueID="P"><dataTypeIDRef uniqueIDRef="{}"/></parameter>'
LEFT = '<parameter uniqueID="P"><UINT/><denotation><label lang="en">Left</label></denotation></parameter>'


@pytest.mark.parametrize(
    ("made", "key", "text"),
    [
        (process('<parameter uniqueID="P"><UINT/></parameter>'), "accesstype", "ro"),
        (process('<parameter uniqueID="P" access="readWrite"><UINT/></parameter>'), "accesstype", "rw"),
        (process('<parameter uniqueID="P"><UINT/></parameter>', 'accessType="rw"'), "accesstype", "rw"),
        (process('<parameter uniqueID="P" access="noAccess"><UINT/></parameter>'), "accesstype", "UNKNOWN"),
        (FROM_TEMPLATE, "accesstype", "rw"),
        (FROM_TEMPLATE, "defaultvalue", "7"),
        (FROM_TEMPLATE, "datatype", "0x0006"),
        (process(OWN, lists=TEMPLATE), "accesstype", "ro"),
        (process(OWN, lists=TEMPLATE), "defaultvalue", "8"),
        (process(OF_TYPE.format("D"), lists=DERIVED), "datatype", "0x0005"),
        (process(OF_TYPE.format("A"), lists=DERIVED), "datatype", ""),  # an array is not a value
        (process('<parameter uniqueID="P"><BITSTRING/></parameter>'), "datatype", "0x000F"),
        (process('<parameter uniqueID="P"><BITSTRING/><defaultValue value="01"/></parameter>'), "datatype", "0x000A"),
        (process('<parameter uniqueID="P"><UINT/><actualValue value="9"/></parameter>'), "parametervalue", "9"),
        (process(LEFT), "denotation", "Left"),
    ],
)
def test_missing_attributes_come_from_the_schema_or_a_template(made: bytes, key: str, text: str) -> None:
    assert read(made).text("2000", key) == text


ONE_TO_THREE = '<range><minValue value="1"/><maxValue value="3"/></range>'


def limited(allowed: str) -> str:
    """A parameter of an UNSIGNED16 with what its value may be."""
    return f'<parameter uniqueID="P" access="readWrite"><UINT/>{allowed}</parameter>'


TEMPLATE_OF_LIMITS = (
    f'<templateList><parameterTemplate uniqueID="T"><UINT/><allowedValues>{ONE_TO_THREE}</allowedValues>'
    "</parameterTemplate></templateList>"
)


@pytest.mark.parametrize(
    ("made", "limits"),
    [
        (process(limited(f"<allowedValues>{ONE_TO_THREE}</allowedValues>")), ("1", "3")),  # as the schema has it
        (process(limited(ONE_TO_THREE)), ("1", "3")),  # as some editors write it
        (process('<parameter uniqueID="P" templateIDRef="T"/>', lists=TEMPLATE_OF_LIMITS), ("1", "3")),
        (
            process(limited(f'<allowedValues><value value="0x10"/>{ONE_TO_THREE}<value value="0"/></allowedValues>')),
            ("0", "16"),
        ),
        (process(limited('<allowedValues><value value="5"/></allowedValues>')), ("5", "5")),
        (process(limited("<allowedValues/>")), ("", "")),
    ],
    ids=["schema", "below the parameter", "template", "values and a range", "one value", "none"],
)
def test_limits_are_the_lowest_and_the_highest_allowed_value(made: bytes, limits: tuple[str, str]) -> None:
    document = read(made)
    assert (document.text("2000", "lowlimit"), document.text("2000", "highlimit")) == limits


NO_ACCESS = process('<parameter uniqueID="P" access="noAccess"><UINT/></parameter>', 'PDOmapping="TPDO"')
NO_ACCESS_IN_EDS = (DEVICE_TYPE + variable("2000", "Value", "UNSIGNED16", "7")).replace("=rw\n", "=UNKNOWN\n").encode()


WRITTEN_BACK = xdd_text(Dictionary.read(NO_ACCESS, Path("a.xdd"), 5)).encode()


@pytest.mark.parametrize("made", [NO_ACCESS, WRITTEN_BACK, NO_ACCESS_IN_EDS], ids=["XDD", "written back", "EDS"])
def test_an_object_without_sdo_access_stays_and_no_sdo_reaches_it(made: bytes) -> None:
    dictionary = Dictionary.read(made, Path("a.xdd"), 5)
    value = dictionary.variable((0x2000, 0))
    assert value is not None
    assert (value.readable, value.writable, value.access_type, value.pdo_mappable) == (False, False, "none", True)
    objects = Objects(dictionary, {}, {})
    for access in (lambda: objects.read((0x2000, 0)), lambda: objects.write((0x2000, 0), b"\0\0")):
        with pytest.raises(Abort) as aborted:
            access()
        assert aborted.value.reason is Reason.NO_ACCESS


DECLARED = '<?xml version="1.0" encoding="{}"?>\n'


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("GB2312", "设备类型"),
        ("gbk", "设备类型"),
        ("Shift_JIS", "デバイス"),
        ("windows-1251", "Тип"),
        ("iso-8859-1", "Gerät"),
        ("UTF-8", "Gerät"),
    ],
)
def test_xml_is_read_in_the_encoding_that_it_declares(encoding: str, name: str) -> None:
    made = DECLARED.format(encoding) + process(limited("")).decode().replace('name="Value"', f'name="{name}"')
    assert read(made.encode(encoding)).text("2000", "parametername") == name


@pytest.mark.parametrize("mark", [b"", BOM_UTF8, BOM_UTF16], ids=["no mark", "UTF-8", "UTF-16"])
@pytest.mark.parametrize("encoding", ["no-such-encoding", "x" * 60, "hex", "punycode", "utf-16-le", "utf-7", "idna"])
def test_whatever_encoding_is_declared_the_mark_counts_or_it_is_one_oddity(encoding: str, mark: bytes) -> None:
    made = DECLARED.format(encoding) + process(limited("")).decode()
    document = read(mark + made.encode("utf-16" if mark == BOM_UTF16 else "utf-8").removeprefix(mark))
    assert [(each.kind, each.line) for each in document.oddities] in ([], [(Odd.XML, 1)])
    assert bool(mark) is not bool(document.oddities) or encoding == "utf-7"  # of which ASCII is a part


@pytest.mark.parametrize("error", [KeyError, RecursionError, MemoryError, OverflowError, UnicodeError])
def test_any_exception_of_a_library_becomes_one_line(error: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    def raises(*_: object) -> None:
        raise error("a\nb")

    monkeypatch.setattr("eurobot_od.od.xml_tree.read_xml", raises)
    with pytest.raises(DictionaryError, match=r"^a.xdd: .*line 1: no XML of a device description \(.+\)$"):
        Dictionary.read(XDD.encode(), Path("a.xdd"), 5)
    monkeypatch.setattr("eurobot_od.od.dictionary.imported", raises)
    with pytest.raises(DictionaryError, match=r"^a.eds: .+$"):
        Dictionary.read(CLEAN.read_bytes(), Path("a.eds"), 5)


@pytest.mark.parametrize("name", ["NodeID", "nodeID"])
def test_the_node_id_of_a_commissioned_device(name: str) -> None:
    made = process("", 'dataType="0005" accessType="rw"', commissioning=f'<deviceCommissioning {name}="2"/>')
    assert Dictionary.read(made, Path("a.xdc")).node_id == 2


def test_a_template_of_itself_ends() -> None:
    made = process('<parameter uniqueID="P" templateIDRef="P"><dataTypeIDRef uniqueIDRef="P"/></parameter>')
    assert read(made).text("2000", "accesstype") == "ro"


def test_objects_disabled_by_an_editor_are_left_out_and_reported() -> None:
    made = process('<parameter uniqueID="P"><UINT/><property name="CO_disabled" value="true"/></parameter>')
    dictionary = Dictionary.read(made, Path("a.xdd"), 5)
    assert (0x2000, 0) not in dictionary.addresses()
    assert [each.what for each in dictionary.normal.deviations] == [
        "0x2000 left out: its editor has disabled it (CO_disabled)"
    ]


@pytest.mark.parametrize("depth", [1, 150])
def test_the_time_to_read_is_proportional_to_the_size(depth: int) -> None:
    much = '<property name="p" value="v"/>' * 2000
    one = '<CANopenObject index="2001" objectType="7" uniqueIDRef="P">'
    objects = (one * depth + "</CANopenObject>" * depth) * (2000 // depth)
    made = process(f'<parameter uniqueID="P">{much}<UINT/></parameter>').replace(
        b"</CANopenObjectList>", f"{objects}</CANopenObjectList>".encode()
    )
    began = time.process_time()
    read(made)
    assert time.process_time() - began < 1.0  # 18 s when each reference read its parameter anew


# Sub-indices counted in decimal


def counted(*names: str, highest: int) -> bytes:
    """An array with sub-indices in sections of these names."""
    subs = "".join(variable(f"2000sub{each}", each, "UNSIGNED8", str(highest if each == "0" else 1)) for each in names)
    head = "[2000]\nParameterName=Inputs\nObjectType=8\nSubNumber=13\n"
    return in_normal_form((DEVICE_TYPE + head).encode())[0].replace(b"SubNumber=0", b"SubNumber=13") + subs.encode()


TO_TWELVE = [str(each) for each in range(13)]


@pytest.mark.parametrize(
    ("names", "highest", "subs"),
    [
        (TO_TWELVE, 12, list(range(13))),
        ([*TO_TWELVE[:10], "A", "B", "C"], 12, list(range(13))),
        (TO_TWELVE, 0x12, [*range(10), 0x10, 0x11, 0x12]),  # the highest sub-index is what the names say
        ([*TO_TWELVE[:9], *TO_TWELVE[10:]], 12, [*range(9), 0x10, 0x11, 0x12]),  # no 9: these are not counted on
        ([*TO_TWELVE[:10], "10", "A"], 12, [*range(10), 0xA, 0x10]),
    ],
)
def test_sub_indices_counted_in_decimal_are_read_as_meant(names: list[str], highest: int, subs: list[int]) -> None:
    dictionary = Dictionary.read(counted(*names, highest=highest), Path("a.eds"), 5)
    assert sorted(dictionary.members[0x2000]) == subs
    is_meant = subs == list(range(13)) and "10" in names
    said = [each.what for each in dictionary.normal.deviations if "decimal" in each.what]
    assert said[:1] == ["section [2000sub10] named [2000subA]: its object counts in decimal"] * is_meant
    fixed = in_normal_form(counted(*names, highest=highest))[0]
    assert (b"[2000subC]" in fixed) is (subs == list(range(13)))
    assert in_normal_form(fixed) == (fixed, [])


# Values with one reading


@pytest.mark.parametrize(
    ("text", "type_", "plain"),
    [
        ("0.0", "UNSIGNED32", "0"),
        ("-20.00", "INTEGER16", "-20"),
        ("20.", "INTEGER16", "20"),
        ("1.5", "INTEGER16", None),
        ("+5", "UNSIGNED8", "5"),
        ("+-5", "INTEGER8", None),
        ("+0x1F", "UNSIGNED8", "0x1F"),
        ("TRUE", "BOOLEAN", "1"),
        ("False", "UNSIGNED8", "0"),
        ("100 ms", "UNSIGNED16", "100"),
        ("25 \N{DEGREE SIGN}C", "INTEGER16", "25"),
        ("5 m/s2", "INTEGER16", "5"),
        ("0x10 ms", "UNSIGNED16", "0x10"),
        ("10 h", "UNSIGNED16", None),  # hours, or hexadecimal
        ("10 k", "UNSIGNED16", None),  # ten thousand, or ten of something
        ("1 2", "UNSIGNED16", None),
        ("1_000", "UNSIGNED16", None),  # Python writes numbers so, and nobody else
        ("0b101", "UNSIGNED8", "5"),
        ("10h", "UNSIGNED8", "0x10"),
        ("9" * 5000, "UNSIGNED32", None),
        ("9" * 5000 + ".0", "UNSIGNED32", None),
        ("1.5 V", "REAL32", "1.5"),
        ("365 43200000", "TIME_OF_DAY", "0x16D02932E00"),
        ("365 43200000", "TIME_DIFFERENCE", "0x16D02932E00"),
        ("365 86400000", "TIME_OF_DAY", None),  # a day has fewer
        ("70000 0", "TIME_OF_DAY", None),
    ],
)
def test_a_value_with_one_reading_is_kept(text: str, type_: str, plain: str | None) -> None:
    assert plain_value(text, next(each for each in DATA_TYPES.values() if each.name == type_)) == plain


def test_sub_indices_without_their_object_are_a_record() -> None:
    text = DEVICE_TYPE + variable("2000sub0", "Count", "UNSIGNED8", "1") + variable("2000sub1", "One", "UNSIGNED8", "7")
    dictionary = Dictionary.read(text.encode(), Path("a.eds"), 5)
    assert (dictionary.default((0x2000, 1)), dictionary.normal.refusals) == (7, [])
    assert "[2000] added: its sub-indices are there" in [each.what for each in dictionary.normal.deviations]


def test_entries_of_a_compact_mapping_have_the_access_of_their_number(tmp_path: Path) -> None:
    head = "[1600]\nParameterName=Mapping\nObjectType=9\nCompactSubObj=2\n"
    text = DEVICE_TYPE + head + variable("1600sub0", "Number", "UNSIGNED8", "0")
    dictionary = Dictionary.read(text.encode(), Path("a.eds"), 5)
    assert [each.access_type for each in dictionary.members[0x1600].values()] == ["rw"] * 3
    fixed = tmp_path / "fixed.eds"
    fixed.write_bytes(in_normal_form(text.encode())[0])
    entry = canopen.import_od(str(fixed), 5).get_variable(0x1600, 2)
    assert entry is not None
    assert entry.access_type == "rw"


def test_limits_of_a_type_of_the_files_own() -> None:
    subs = [("sub1", "Type", "4"), ("sub2", "Minimum Value", "1"), ("sub3", "Maximum Value", "0x64")]
    type_ = "[A0]\nParameterName=INTEGER32[1-100]\nObjectType=5\nSubNumber=4\n" + "".join(
        variable(f"A0{sub}", name, "UNSIGNED8", value) for sub, name, value in subs
    )
    level = variable("2000", "Level", "UNSIGNED8", "0x32").replace("DataType=0x0005", "DataType=0x00A0")
    own = variable("2001", "Own", "UNSIGNED8", "1", "HighLimit=7").replace("DataType=0x0005", "DataType=0x00A0")
    text = DEVICE_TYPE + type_ + level + own
    members = Dictionary.read(text.encode(), Path("a.eds"), 5).members
    found = [members[index][0] for index in (0x2000, 0x2001)]
    assert [(each.min, each.max) for each in found] == [(1, 100), (1, 7)]
    assert {"W116", "W453"} & {each.code for each in lint(text.encode(), "a.eds")} == set()


# As other programs write it: no name space prefixes, parameters of an application process, XML's own booleans

PROCESS = """\
<?xml version="1.0"?>
<ISO15745ProfileContainer xmlns="http://www.canopen.org/xml/1.1">
 <ISO15745Profile><ProfileBody fileName="a.xdd">
  <ApplicationProcess><parameterList>
   <parameter uniqueID="P1" access="readWriteInput"><INT/><defaultValue value="-5"/>
    <range><minValue value="-10"/><maxValue value="0x10"/></range></parameter>
  </parameterList></ApplicationProcess>
 </ProfileBody></ISO15745Profile>
 <ISO15745Profile><ProfileBody fileName="a.xdd" fileCreationDate="2014-05-28" fileCreationTime="14:30:00"
   fileVersion="3">
  <ApplicationLayers><CANopenObjectList>
   <CANopenObject index="1000" name="Device type" objectType="7" dataType="0007" accessType="ro"
     defaultValue="0x191"/>
   <CANopenObject index="2000" name="Speed" objectType="7" uniqueIDRef="P1" PDOmapping="TPDO"/>
   <CANopenObject index="2001" name="Lamps" objectType="8" subNumber="2">
    <CANopenSubObject subIndex="00" name="Number" objectType="7" dataType="05" accessType="const" defaultValue="1"/>
    <CANopenSubObject subIndex="01" name="On" objectType="7" dataType="1" accessType="rw" defaultValue="true"
      PDOmapping="RPDO"/>
   </CANopenObject>
  </CANopenObjectList><dummyUsage><dummy entry="Dummy0005=1"/></dummyUsage></ApplicationLayers>
  <NetworkManagement><deviceCommissioning nodeID="9" nodeName="x" actualBaudRate="250 Kbps"/></NetworkManagement>
 </ProfileBody></ISO15745Profile>
</ISO15745ProfileContainer>
"""


def test_a_file_of_another_program_is_read() -> None:
    dictionary = Dictionary.read(PROCESS.encode(), Path("a.xdc"))
    values: dict[Address, Value] = {(0x1000, 0): 0x191, (0x2000, 0): -5, (0x2001, 0): 1, (0x2001, 1): True}
    assert {each: dictionary.default(each) for each in dictionary.addresses()} == values
    speed, lamp = dictionary.variable((0x2000, 0)), dictionary.variable((0x2001, 1))
    assert speed
    assert lamp
    assert (speed.min, speed.max, speed.access_type, speed.pdo_mappable) == (-10, 16, "rwr", True)
    assert (lamp.access_type, lamp.pdo_mappable) == ("rww", True)
    assert (dictionary.node_id, dictionary.device.document.text("devicecomissioning", "baudrate")) == (9, "250")
    info = dictionary.device.document.sections["fileinfo"]
    assert [info.text(key) for key in ("creationdate", "creationtime", "fileversion")] == ["05-28-2014", "02:30PM", "3"]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_any_encoding_of_xml_is_read(encoding: str) -> None:
    text = XDD.replace('encoding="utf-8"', f'encoding="{encoding.removesuffix("-sig")}"').replace(
        "Set value", "Sollwert ü"
    )
    assert Dictionary.read(text.encode(encoding), Path("a.xdd"), 5).address("Sollwert ü") == (0x2007, 0)


@pytest.mark.parametrize(
    ("address", "lost"),
    [
        ('index="0x2000"', []),  # as some editors have it
        ('index="20G0"', ["index '20G0' of 'Value' is not a number"]),
        ("", ["index '' of 'Value' is not a number"]),
    ],
)
def test_an_object_without_an_address_is_lost_and_counted(address: str, lost: list[str]) -> None:
    made = process("", 'dataType="0005" accessType="rw"').replace(b'index="2000"', address.encode())
    dictionary = Dictionary.read(made, Path("a.xdd"), 5)
    assert [each.what for each in dictionary.normal.refusals] == lost
    assert ((0x2000, 0) in dictionary.addresses()) is not bool(lost)


def test_lint_points_at_the_element() -> None:
    wrong = XDD.replace('defaultValue="-5"', 'defaultValue="-500"')
    (found,) = [each for each in lint(wrong.encode(), "clean.xdd") if each.code[0] == "E"]
    assert found.code == "E438"
    assert 'index="2007"' in wrong.splitlines()[found.line - 1]
    assert [each for each in lint(XDD.encode(), "clean.xdd") if each.code != "W210"] == []


# What is not a device description

BOMB = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><x>&b;</x>'
NO_XML = [
    ("cut off", XDD[: len(XDD) // 2], "no XML of a device description ("),
    ("a tag that is not closed", XDD.replace("</dummyUsage>", ""), "mismatched tag"),
    ("entities in entities", BOMB, "line 1: no XML of a device description (a document type"),
    ("another file", '<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>', "(a document type, which no device"),
    ("too deep", "<a>" * 300 + "</a>" * 300, "(more than 200 elements in each other)"),
    ("a page", "<html><body/></html>", "it describes no object"),
]


@pytest.mark.parametrize(("text", "words"), [row[1:] for row in NO_XML], ids=[row[0] for row in NO_XML])
def test_other_xml_is_refused_in_one_line(text: str, words: str) -> None:
    with pytest.raises(DictionaryError) as error:
        Dictionary.read(text.encode(), Path("a.xdd"), 5)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_lint_reports_it_at_its_line() -> None:
    (found,) = read(XDD.replace("</dummyUsage>", "").encode()).oddities
    assert (found.kind, found.line > 100) == (Odd.XML, True)
    codes = [each.code for each in lint(BOMB.encode(), "a.xdd")]
    assert codes[0] == "E123"


def test_a_value_with_a_line_end_stays_one_line() -> None:
    text = XDD.replace('name="Set value"', 'name="Set&#10;[1000]&#10;value"')
    assert Dictionary.read(text.encode(), Path("a.xdd"), 5).address("Set [1000] value") == (0x2007, 0)


@rows("seed", range(60))
def test_damaged_xml_is_read_or_refused(seed: int) -> None:
    chance, data = random.Random(seed), bytearray(PROCESS.encode())
    for _ in range(chance.randint(1, 6)):
        place = chance.randrange(len(data))
        data[place : place + chance.randint(0, 3)] = chance.choice(
            [b"9" * 30, b"", b"&", b"-", b"FFUL", bytes([chance.randrange(256)])]
        )
    lint(bytes(data), "a.xdd")
    with suppress(DictionaryError):
        Dictionary.read(bytes(data), Path("a.xdd"), 5)


# In the commands


def test_fix_writes_the_eds_of_an_xdd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.xdd").write_text(XDD)
    assert main(["lint", "--fix", str(tmp_path / "a.xdd")]) == 2
    assert "is a device description in XML; -o FILE.eds writes the EDS" in capsys.readouterr().err
    assert main(["lint", "--fix", str(tmp_path / "a.xdd"), "-o", str(tmp_path / "a.eds")]) == 0
    assert main(["diff", str(CLEAN), str(tmp_path / "a.eds")]) == 0
    assert main(["diff", str(tmp_path / "a.xdd"), str(CLEAN)]) == 0
    assert main(["export", "cdcf", f"5={tmp_path / 'a.xdd'}"]) == 0


def test_an_eds_goes_before_the_xdd_of_the_same_name(tmp_path: Path) -> None:
    for name in ("a.xdd", "a.eds", "b.xdd"):
        (tmp_path / name).write_text(XDD)
    assert [Path(each.file).name for each in read_network(tmp_path).nodes] == ["a.eds", "b.xdd"]


FOREIGN = [
    (b'$ EZ-EDS\n[File]\n  DescText = "Drive";\n[Device]\n  VendCode = 1;\n', "EtherNet/IP"),
    (b"<?xml version='1.0'?><EtherCATInfo Version='1.6'/>", "EtherCAT (ESI)"),
    (b"<?xml version='1.0'?><ISO15745ProfileContainer xmlns='http://www.ethernet-powerlink.org'/>", "POWERLINK"),
]


@pytest.mark.parametrize(("data", "network"), FOREIGN, ids=[each[1] for each in FOREIGN])
def test_a_file_of_another_network_is_named(data: bytes, network: str) -> None:
    with pytest.raises(DictionaryError, match=re.escape(f"a device description of {network}, not of CANopen")):
        Dictionary.read(data, Path("device.eds"), 5)
