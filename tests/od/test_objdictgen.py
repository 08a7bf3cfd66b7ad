"""Object dictionaries of CanFestival's editor: values, names and types as its own EDS says them, and nothing is run."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.od import formats
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import Odd
from tests.kit.objdictgen import od_file

USER = {
    0x2000: {
        "name": "Filter",
        "struct": 1,
        "values": [
            {"name": "Filter", "type": 6, "access": "rw", "pdo": True},
            {"name": "Rest", "type": 5, "access": "ro", "pdo": False},  # of no use in a variable
        ],
    },
    0x2001: {
        "name": "Inputs",
        "struct": 7,
        "values": [
            {"name": "Number of inputs", "type": 5, "access": "ro", "pdo": False},
            {"name": "Inputs 0x%X to 0x%X[(sub*8-7,sub*8)]", "type": 5, "access": "ro", "pdo": True, "nbmax": 254},
        ],
    },
    0x2100: {
        "name": "Axis %d[(idx)]",
        "struct": 9,
        "incr": 0x10,
        "nbmax": 4,
        "values": [{"name": "Axis %d[(idx)]", "type": 1, "access": "rw", "pdo": False}],
    },
}
VALUES = {
    0x1000: 401,
    0x1003: [0, 0],
    0x1018: [0x1234, 2, 3, 4],
    0x1200: ['"$NODEID+0x600"', "self.ID+0x580"],
    0x1400: ["{True:self.ID+(base+2)*0x100,False:0x80000000}[base<4]", 255],
    0x1404: ["{True:self.ID+(base+2)*0x100,False:0x80000000}[base<4]", 255],
    0x1A00: [0x20010108],
    0x2000: "300L",
    0x2001: [0, 0],
    0x2110: True,
}


@pytest.fixture(scope="module")
def device() -> DescribedDevice:
    return DescribedDevice(formats.read(od_file(Dictionary=VALUES, UserMapping=USER, Name="Drive", Type="slave")))


ROWS = [
    ("CiA 301's own", 0x1000, 0, "Device type", "UNSIGNED32", "ro", "401"),
    ("sub-index 0 of an error field", 0x1003, 0, "Highest sub-index supported", "UNSIGNED8", "rw", "2"),
    ("named sub-indices", 0x1018, 1, "Vendor-ID", "UNSIGNED32", "ro", "4660"),
    ("a COB-ID in quotes", 0x1200, 1, "COB-ID client to server", "UNSIGNED32", "ro", "$NODEID+0x600"),
    ("a COB-ID by the node", 0x1200, 2, "COB-ID server to client", "UNSIGNED32", "ro", "$NODEID+0x580"),
    ("a COB-ID that is computed", 0x1400, 1, "COB-ID", "UNSIGNED32", "rw", "$NODEID+0x200"),
    ("one of a later PDO", 0x1404, 1, "COB-ID", "UNSIGNED32", "rw", "0x80000000"),
    ("the number of mapped objects", 0x1A00, 0, "Highest sub-index supported", "UNSIGNED8", "rw", "1"),
    ("a long of Python 2", 0x2000, 0, "Filter", "UNSIGNED16", "rw", "300"),
    ("members that are alike", 0x2001, 2, "Inputs 2", "UNSIGNED8", "ro", "0"),
    ("one of several objects", 0x2110, 0, "Axis 2", "BOOLEAN", "rw", "1"),
]


@pytest.mark.parametrize(("index", "sub", "said"), [(r[1], r[2], r[3:]) for r in ROWS], ids=[r[0] for r in ROWS])
def test_a_variable_has_name_type_access_and_value(
    device: DescribedDevice, index: int, sub: int, said: tuple[str, ...]
) -> None:
    found = device.variable(index, sub)
    assert found
    assert found.type
    assert (found.name, found.type.name, found.access, found.section.text("defaultvalue")) == said


def test_objects_of_cia_301_have_its_names() -> None:
    content = od_file(Dictionary=dict.fromkeys(range(4096, 4144), 0), Name="Drive", Type="slave")
    found = DescribedDevice(formats.read(content)).objects
    assert {f"{index:04X}": each.name for index, each in found.items() if not each.name.startswith("Object ")} == {
        "1000": "Device type",
        "1001": "Error register",
        "1002": "Manufacturer status register",
        "1003": "Pre-defined error field",
        "1005": "COB-ID SYNC message",
        "1006": "Communication cycle period",
        "1007": "Synchronous window length",
        "1008": "Manufacturer device name",
        "1009": "Manufacturer hardware version",
        "100A": "Manufacturer software version",
        "100C": "Guard time",
        "100D": "Life time factor",
        "1010": "Store parameters",
        "1011": "Restore default parameters",
        "1012": "COB-ID time stamp message",
        "1013": "High resolution time stamp",
        "1014": "COB-ID EMCY",
        "1015": "Inhibit time EMCY",
        "1016": "Consumer heartbeat time",
        "1017": "Producer heartbeat time",
        "1018": "Identity object",
        "1019": "Synchronous counter overflow value",
        "1020": "Verify configuration",
        "1029": "Error behaviour",
    }


def test_mapped_objects_are_mappable(device: DescribedDevice) -> None:
    assert [each.is_mappable for each in device.objects[0x2001].variables()] == [False, True, True]


def test_an_objdictgen_file_loads_as_a_dictionary() -> None:
    content = od_file(Dictionary=VALUES, UserMapping=USER, Name="Drive", Type="slave")
    dictionary = Dictionary.read(content, Path("drive.od"), 5)
    assert not dictionary.normal.refusals
    assert dictionary.number((0x1018, 1)) == 0x1234


def test_a_document_type_that_declares_anything_is_refused() -> None:
    content = od_file(Dictionary=VALUES).replace(b'"PyObjects.dtd"', b'"PyObjects.dtd" [<!ENTITY a "aaaa">]')
    (found,) = formats.read(content).oddities
    assert (found.kind, found.text) == (Odd.XML, "a document type, which no device description has")
