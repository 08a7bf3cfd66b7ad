"""`_project.xml` of CANopenNode before its version 4: XML of its own, read as an XDD is."""

from __future__ import annotations

import pytest

from eurobot_od.od import formats
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.document import Odd

PROJECT = """\
<?xml version="1.0"?>
<device>
  <features><feature name="RPDO" value="4"/></features>
  <CANopenObjectList>
    <CANopenObject index="2000" name="Filter" objectType="7" memoryType="RAM" dataType="06" accessType="rw"
        PDOmapping="optional" defaultValue="20"/>
    <CANopenObject index="2001" name="Unused" objectType="7" dataType="06" accessType="rw" disabled="true"/>
    <CANopenObject index="2100" name="Inputs" objectType="8" subNumber="3" dataType="05" accessType="ro"
        PDOmapping="TPDO">
      <CANopenSubObject subIndex="00" name="Number" objectType="7" dataType="05" accessType="ro" PDOmapping="no"
          defaultValue="2"/>
      <CANopenSubObject subIndex="01" name="Input" objectType="7" defaultValue="0x00"/>
      <CANopenSubObject subIndex="02" name="Wide input" objectType="7" dataType="07" defaultValue="0x01"/>
    </CANopenObject>
  </CANopenObjectList>
  <other>
    <file fileName="inputs" fileCreator="Somebody" fileCreationDate="2013-03-10" fileCreationTime="17:05:00"
        fileVersion="3"/>
    <DeviceIdentity><vendorName>Somebody</vendorName><productName>Inputs</productName></DeviceIdentity>
    <baudRate><supportedBaudRate value="250 Kbps"/></baudRate>
    <dummyUsage><dummy entry="Dummy0005=1"/></dummyUsage>
  </other>
</device>
"""
DOCUMENT = formats.read(PROJECT.encode())
DEVICE = DescribedDevice(DOCUMENT)

MEMBERS = [
    ("sub-index 0, which says its own", 0, ("UNSIGNED8", "ro", False, "2")),
    ("a member that says nothing", 1, ("UNSIGNED8", "ro", True, "0x00")),
    ("a member with a type of its own", 2, ("UNSIGNED32", "ro", True, "0x01")),
]


@pytest.mark.parametrize(("sub", "said"), [row[1:] for row in MEMBERS], ids=[row[0] for row in MEMBERS])
def test_members_inherit_what_their_array_says(sub: int, said: tuple[str, str, bool, str]) -> None:
    found = DEVICE.variable(0x2100, sub)
    assert found
    assert found.type
    assert (found.type.name, found.access, found.is_mappable, found.section.text("defaultvalue")) == said


def test_a_disabled_object_is_left_out_and_said() -> None:
    assert 0x2001 not in DEVICE.objects
    assert [(each.kind, each.line, each.text) for each in DOCUMENT.oddities] == [(Odd.DISABLED, 7, "0x2001")]


def test_file_maker_and_bit_rates_are_read() -> None:
    keys = ("filename", "fileversion", "createdby", "creationdate", "creationtime")
    assert [DOCUMENT.text("fileinfo", key) for key in keys] == ["inputs", "3", "Somebody", "03-10-2013", "05:05PM"]
    device = [DOCUMENT.text("deviceinfo", key) for key in ("vendorname", "baudrate_250", "baudrate_500")]
    assert device == ["Somebody", "1", "0"]
    assert DOCUMENT.text("dummyusage", "dummy0005") == "1"
