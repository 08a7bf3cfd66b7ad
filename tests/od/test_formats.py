"""Device descriptions in XML: an EDS made an XDD and read again is the same device; XML that is none costs one line."""

from __future__ import annotations

import random
import time
from contextlib import suppress
from pathlib import Path

import pytest

from eurobot_od.cli import main
from eurobot_od.errors import DictionaryError
from eurobot_od.export.xdd import load as load_any
from eurobot_od.export.xdd import xdd_text
from eurobot_od.lint.diff import compare
from eurobot_od.lint.model import load
from eurobot_od.lint.rules import lint
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import Odd
from eurobot_od.od.formats import read
from eurobot_od.od.network import read_network
from eurobot_od.od.normal import in_normal_form
from eurobot_od.od.values import Address, Value
from tests.rows import rows

ROOT = Path(__file__).parents[2]
FILES = [
    *sorted(ROOT.glob("eds/*/*.eds")),
    *sorted((ROOT / "tests" / "lint" / "samples").iterdir()),
    *sorted(ROOT.glob("tests/kit/makers/*.eds")),
    *sorted(ROOT.glob("tests/od/samples/*.eds")),
    *sorted(ROOT.glob("docs/*.eds")),
    *sorted(ROOT.glob("docs/*.dcf")),
]
CLEAN = ROOT / "tests" / "lint" / "samples" / "clean.eds"
XDD = xdd_text(load_any(CLEAN))


@rows("file", FILES)
def test_an_eds_made_an_xdd_and_an_eds_again_is_the_same_device_with_the_same_values(file: Path) -> None:
    loaded = load_any(file)
    made = xdd_text(loaded).encode()
    back, changes = in_normal_form(made, "made.xdd")
    device, unusable = load(file.read_bytes(), file.name), loaded.left_out
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


def test_what_a_file_says_oddly_stays_as_it_is() -> None:
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


@rows(
    "made, key, text",
    [
        (process('<parameter uniqueID="P"><UINT/></parameter>'), "accesstype", "ro"),
        (process('<parameter uniqueID="P" access="readWrite"><UINT/></parameter>'), "accesstype", "rw"),
        (process('<parameter uniqueID="P"><UINT/></parameter>', 'accessType="rw"'), "accesstype", "rw"),
        (process('<parameter uniqueID="P" access="noAccess"><UINT/></parameter>'), "accesstype", ""),
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
def test_what_a_file_does_not_say_the_schema_or_a_template_says(made: bytes, key: str, text: str) -> None:
    assert read(made).text("2000", key) == text


@pytest.mark.parametrize("name", ["NodeID", "nodeID"])
def test_the_node_id_of_a_commissioned_device(name: str) -> None:
    made = process("", 'dataType="0005" accessType="rw"', commissioning=f'<deviceCommissioning {name}="2"/>')
    assert Dictionary.read(made, Path("a.xdc")).node_id == 2


def test_a_template_of_itself_ends() -> None:
    made = process('<parameter uniqueID="P" templateIDRef="P"><dataTypeIDRef uniqueIDRef="P"/></parameter>')
    assert read(made).text("2000", "accesstype") == "ro"


def test_what_an_editor_has_disabled_is_left_out_and_said() -> None:
    made = process('<parameter uniqueID="P"><UINT/><property name="CO_disabled" value="true"/></parameter>')
    dictionary = Dictionary.read(made, Path("a.xdd"), 5)
    assert (0x2000, 0) not in dictionary.addresses()
    assert [each.what for each in dictionary.changes] == ["0x2000 left out: its editor has disabled it (CO_disabled)"]


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
def test_what_is_no_device_description_costs_one_line(text: str, words: str) -> None:
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
