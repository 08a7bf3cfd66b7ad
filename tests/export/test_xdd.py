"""The XDD, parsed back and compared with our reading of the file, object by object."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from eurobot_od.errors import DictionaryError
from eurobot_od.export import xdd
from eurobot_od.od import formats
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import NODE_ID, Value, parse_number
from tests.export import made_up
from tests.kit import plant

ROOT = Path(__file__).parents[2]
OWN = sorted(plant.FILES.folder().parent.rglob("*.eds"))
FOREIGN = [
    ROOT / "tests" / "lint" / "samples" / name
    for name in (
        "clean.eds",
        "generated.eds",
        "compact_drive.eds",
        "configured.dcf",
        "crlf_io_module.eds",
        "editor_with_comments.eds",
        "sloppy_sensor.eds",
        "old.eds",
    )
]
CO = f"{{{xdd.SCHEMA}}}"
LIST = f"{CO}ISO15745Profile/ProfileBody/ApplicationLayers/{CO}CANopenObjectList/CANopenObject"

NODE = 42
"""The node-ID for which values are compared."""

ACCESS = {("rw", "RPDO"): "rww", ("rw", "TPDO"): "rwr"}

NUMBERS_AND_VALUES = {"lowLimit": "min", "highLimit": "max", "defaultValue": "default", "actualValue": "value"}
"""Attributes of an object in the XDD, and of canopen's variable."""


def read_back(value: str | None, dictionary: Dictionary, kind: type) -> Value:
    """Read a value of an XDD as CiA 311 means it."""
    if value is None:
        return None
    number = parse_number(value)
    if kind is int and number:
        return number.at(dictionary.node_id)
    if kind is bytes:
        return bytes.fromhex(value)
    return float(value) if kind is float else value


def objects(text: str) -> dict[tuple[int, int], Element]:
    """Return the variables of an XDD, by index and sub-index."""
    found: dict[tuple[int, int], Element] = {}
    for each in ElementTree.fromstring(text).iterfind(LIST):
        index, subs = int(each.attrib["index"], 16), each.findall("CANopenSubObject")
        assert each.get("subNumber", str(len(subs))) == str(len(subs))
        members = {(index, int(sub.attrib["subIndex"], 16)): sub for sub in subs}
        found |= members if "subNumber" in each.attrib else {(index, 0): each}
    return found


def compare(dictionary: Dictionary) -> None:
    """Assert that the XDD of a device says what we read in its file."""
    found = objects(xdd.xdd_text(dictionary))
    assert list(found) == list(dictionary.addresses())
    for (index, sub), each in found.items():
        variable = dictionary.members[index][sub]
        assert each.attrib["name"] == xdd.NOT_XML.sub("\ufffd", variable.name)
        assert int(each.attrib["dataType"], 16) == data_type(variable).code
        access, mapping = each.get("accessType", ""), each.attrib["PDOmapping"]
        assert ACCESS.get((access, mapping), access) == variable.access_type
        assert (mapping != "no") == variable.pdo_mappable
        for attribute, name in NUMBERS_AND_VALUES.items():
            ours: Value = getattr(variable, name)
            if ours not in (None, "", b""):
                assert read_back(each.get(attribute), dictionary, type(ours)) == ours, (index, sub, name)


@pytest.mark.parametrize("file", [*OWN, *FOREIGN])
def test_every_object_has_the_values_of_the_file(file: Path) -> None:
    compare(Dictionary.load(file, NODE))


def test_the_node_id_stays_a_parameter() -> None:
    file = plant.FILES.folder() / "lift.eds"
    text = xdd.xdd_text(Dictionary.load(file, 1))
    assert objects(text)[0x1014, 0].get("defaultValue") == f"{NODE_ID}+0x80"
    assert text == xdd.xdd_text(Dictionary.load(file, NODE))


DEVICE = """[FileInfo]
FileName=odd.eds
FileVersion=1.2
CreationDate=31-12-2020
[DeviceInfo]
VendorName=A & B <"C">
VendorNumber=0x1F
BaudRate_125=1
Granularity=200
[1000]
ParameterName=Bell\a "&<>' ü
DataType=7
AccessType=rww
PDOMapping=1
DefaultValue=0x180+$NODEID
[2000]
ParameterName=Many
ObjectType=8
DataType=4
AccessType=rwr
PDOMapping=1
CompactSubObj=3
LowLimit=0x80000000
HighLimit=010
DefaultValue=-5
[2001]
ParameterName=Real
DataType=8
AccessType=rw
DefaultValue=1.5
[2002]
ParameterName=Text
DataType=9
AccessType=const
DefaultValue=<a>&"
[2003]
ParameterName=File
ObjectType=2
AccessType=ro
[2004]
ParameterName=Set
ObjectType=7
DataType=5
AccessType=rw
DefaultValue=1
ParameterValue=2
Denotation=mine
ObjFlags=1
[DeviceComissioning]
NodeID=7
Baudrate=125
NodeName=left
"""


def odd(text: str = DEVICE) -> Dictionary:
    return Dictionary.read(text.encode(), Path("odd.dcf"), NODE)


def test_odd_values_are_exported_by_their_meaning() -> None:
    compare(odd())


SAID = [
    ((0x1000, 0), {"name": "Bell\ufffd \"&<>' ü", "accessType": "rw", "PDOmapping": "RPDO"}),
    ((0x1000, 0), {"defaultValue": "$NODEID+0x180"}),
    ((0x2000, 3), {"defaultValue": "-5", "lowLimit": "-2147483648", "highLimit": "0x8", "PDOmapping": "TPDO"}),
    ((0x2001, 0), {"dataType": "08", "defaultValue": "1.5", "PDOmapping": "no"}),
    ((0x2002, 0), {"defaultValue": '<a>&"', "accessType": "const"}),
    ((0x2003, 0), {"objectType": "2", "dataType": "0F"}),
    ((0x2004, 0), {"defaultValue": "0x1", "actualValue": "0x2", "denotation": "mine", "objFlags": "0001"}),
]


@pytest.mark.parametrize(("address", "attributes"), SAID)
def test_attributes_of_an_object(address: tuple[int, int], attributes: dict[str, str]) -> None:
    found = objects(xdd.xdd_text(odd()))[address].attrib
    assert {name: found[name] for name in attributes} == attributes


def test_the_profiles_say_whose_device_it_is_and_what_it_can() -> None:
    root = ElementTree.fromstring(xdd.xdd_text(odd()))
    device, network = root.iterfind(f"{CO}ISO15745Profile/ProfileBody")
    assert device.findtext(f"{CO}DeviceIdentity/{CO}vendorName") == 'A & B <"C">'
    assert device.findtext(f"{CO}DeviceIdentity/{CO}vendorID") == "31"
    assert (device.get("fileVersion"), device.get("fileCreationDate")) == ("1", xdd.NO_DAY)
    rates = [each.get("value") for each in network.iter("supportedBaudRate")]
    general, commissioned = (next(network.iter(tag)) for tag in ("CANopenGeneralFeatures", "deviceCommissioning"))
    assert (rates, general.get("granularity")) == (["125 Kbps"], "64")
    assert commissioned.attrib == {
        "nodeID": "7",
        "nodeName": "left",
        "actualBaudRate": "125",
        "networkNumber": "0",
        "networkName": "",
        "CANopenManager": "false",
    }


@pytest.mark.parametrize(
    ("said", "day", "time"),
    [
        ("CreationDate=12-31-2020\nCreationTime=01:30PM", "2020-12-31", "13:30:00"),
        ("CreationDate=12-31-2020", "2020-12-31", None),
        ("CreationTime=12:05AM", xdd.NO_DAY, "00:05:00"),
        ("CreationTime=25:00", xdd.NO_DAY, None),
    ],
)
def test_creation_date_is_that_of_the_file(said: str, day: str, time: str | None) -> None:
    root = ElementTree.fromstring(xdd.xdd_text(odd(DEVICE.replace("CreationDate=31-12-2020", said))))
    for body in root.iterfind(f"{CO}ISO15745Profile/ProfileBody"):
        assert (body.get("fileCreationDate"), body.get("fileCreationTime")) == (day, time)


def test_dummies_are_used_as_the_file_says() -> None:
    used = "[DummyUsage]\nDummy0001=0\nDummy0005=1\nDummy0006=1\n[1000]\n"
    root = ElementTree.fromstring(xdd.xdd_text(odd(DEVICE.replace("[1000]\n", used, 1))))
    entries = [each.attrib["entry"] for each in root.iter("dummy")]
    assert [each for each in entries if each.endswith("=1")] == ["Dummy0005=1", "Dummy0006=1"]
    assert "Dummy0001=0" in entries
    assert "Dummy0007=0" in entries


def test_any_names_are_well_formed() -> None:
    messages = [(f"{number} {name}", [made_up.Field(name, 7, 8)]) for number, name in enumerate(made_up.BAD_NAMES)]
    compare(made_up.dictionary(messages))


def test_a_file_that_is_no_eds_is_refused() -> None:
    with pytest.raises(DictionaryError, match=r"odd\.dcf: not an EDS"):
        odd("")


CHANGED = """\
[FileInfo]
ModifiedBy=Somebody
ModificationDate=05-28-2014
ModificationTime=05:05PM
[2000]
ParameterName=Axis
ObjectType=9
SubNumber=1
ObjFlags=0x2
Denotation=Left
[2000sub0]
ParameterName=Count
DataType=5
AccessType=ro
"""


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("fileinfo", {"modifiedby": "Somebody", "modificationdate": "05-28-2014", "modificationtime": "05:05PM"}),
        ("2000", {"objflags": "0x0002", "denotation": "Left"}),
    ],
    ids=["who changed the file, and when", "what an object with sub-indices says"],
)
def test_an_xdd_that_is_imported_again_is_equal(section: str, said: dict[str, str]) -> None:
    made = formats.read(xdd.xdd_text(Dictionary.read(CHANGED.encode(), Path("a.eds"), 1)).encode())
    assert {key: made.text(section, key) for key in said} == said
