"""Single defects to be seeded into a clean EDS, and the code that has to flag each of them.

A defect changes one section (`section` is its name, empty
for the whole file): `old` becomes `new`; WHOLE as `old` takes the section away, with its sub-indices. The finding is
expected in the line of the first key that was changed, or in the section's header if that key is gone, or at `at`:
`section/key`, `section`, a whole line from the change on, or `line n`.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from eurobot_od.export.xdd import xdd_text
from eurobot_od.od.dictionary import Dictionary

CLEAN = (Path(__file__).parent / "samples" / "clean.eds").read_text("ascii")
COMPACT = """
[2009]
ParameterName=Calibration
ObjectType=0x8
DataType=0x0006
AccessType=rw
DefaultValue=10
PDOMapping=0
CompactSubObj=8

[2009Name]
NrOfEntries=2
1=Offset
2=Gain

[2009Value]
NrOfEntries=1
2=12
"""
COMMISSIONING = """
[DeviceComissioning]
NodeID=5
NodeName=left arm
Baudrate=500
NetNumber=1
NetworkName=robot
CANopenManager=0
LSS_SerialNumber=0x00000007
"""


def _with_object(text: str, index: str, sections: str) -> str:
    """Append a manufacturer-specific object, as the ninth of the list, and its sections."""
    text = text.replace("[ManufacturerObjects]\nSupportedObjects=8", "[ManufacturerObjects]\nSupportedObjects=9")
    return text.replace("8=0x2008\n", f"8=0x2008\n9=0x{index}\n") + sections


def _configured(text: str) -> str:
    """Make the DCF of an EDS."""
    text = text.replace("FileName=clean.eds", "FileName=clean.dcf\nLastEDS=clean.eds")
    return text + COMMISSIONING


XML = xdd_text(Dictionary.load(Path(__file__).parent / "samples" / "clean.eds", 1)).replace("made.xdd", "clean.xdd")
XML_2007 = next(number for number, line in enumerate(XML.splitlines(), start=1) if 'index="2007"' in line)
XML_END = next(number for number, line in enumerate(XML.splitlines(), start=1) if "</ApplicationLayers>" in line)
COUPLER = (Path(__file__).parents[1] / "od" / "samples" / "coupler.eds").read_text("ascii")

BASES = {
    "eds": ("clean.eds", CLEAN),
    "compact": ("clean.eds", _with_object(CLEAN, "2009", COMPACT)),
    "dcf": ("clean.dcf", _configured(CLEAN)),
    "fixed": (
        "clean.eds",
        re.sub(r"(\[1[6A]\d\dsub[^[]*AccessType=)rw", r"\g<1>ro", CLEAN).replace("Granularity=8", "Granularity=0"),
    ),
    "coupler": ("coupler.eds", COUPLER),
    "connected": (
        "coupler.dcf",
        COUPLER.replace("FileName=coupler.eds", "FileName=coupler.dcf\nLastEDS=coupler.eds")
        + COMMISSIONING
        + "\n[ConnectedModules]\nNrOfEntries=2\n1=1\n2=1\n",
    ),
    "xdd": ("clean.xdd", XML),
    "guarded": ("clean.eds", re.sub(r"(\[100D\][^[]*DefaultValue=)0", r"\g<1>3", CLEAN)),
}
"""The clean files into which defects are seeded: an EDS, one with a compact array (0x2009), a DCF, one with fixed
mappings, an XDD, a bus coupler, one with modules, and one with a life time factor.
"""

WHOLE = "*"


class Defect(NamedTuple):
    """One defect: the code that flags it, what is wrong, and the change that makes it wrong."""

    code: str
    what: str
    section: str
    old: str
    new: str
    at: str = ""
    base: str = "eds"
    encoding: str = "latin-1"

    @property
    def name(self) -> str:
        """Short name for test reports."""
        return f"{self.code} {self.what}"


DEFECTS = (
    # How the file is written
    Defect("E101", "a NUL byte", "FileInfo", "CreatedBy=a person", "CreatedBy=a per\0son"),
    Defect("E102", "UTF-16", "", "[FileInfo]", "[FileInfo]", at="line 1", encoding="utf-16"),
    Defect("W103", "an umlaut", "DeviceInfo", "VendorName=Example", "VendorName=Ex\u00e4mple"),
    Defect("I104", "a byte order mark", "", "[FileInfo]", "\u00ef\u00bb\u00bf[FileInfo]", at="line 1"),
    Defect("I105", "one line with CR LF", "FileInfo", "FileVersion=1\n", "FileVersion=1\r\n", at="line 1"),
    Defect("E106", "a line of prose", "Comments", "Lines=2\n", "Lines=2\nsome words\n", at="some words"),
    Defect("E107", "a header without its bracket", "2008", "[2008]", "[2008", at="[2008"),
    Defect("E107", "an empty header", "2008", "[2008]\n", "[]\n[2008]\n", at="[]"),
    Defect("E107", "words after a header", "2008", "[2008]", "[2008] unit", at="[2008] unit"),
    Defect("E108", "an entry before the first section", "", "[FileInfo]", "Stray=1\n[FileInfo]", at="line 1"),
    Defect("E109", "a section twice", "2008", "[2008]", "[2007]\nParameterName=Again\n\n[2008]", at="[2007]"),
    Defect("E109", "a section again in other case", "2008", "[2008]", "[1018SUB1]\n\n[2008]", at="[1018SUB1]"),
    Defect("E110", "a key twice", "2008", "AccessType=const\n", "AccessType=const\nAccessType=ro\n",
           at="AccessType=ro"),
    Defect("E110", "a key again in other case", "2008", "PDOMapping=0", "PDOMapping=0\npdomapping=1",
           at="pdomapping=1"),
    Defect("E111", "an entry without key", "2008", "PDOMapping=0", "PDOMapping=0\n=5", at="=5"),
    Defect("E112", "a name of 242 characters", "2008", "ParameterName=Unit", "ParameterName=" + "n" * 242),
    Defect("E112", "a vendor name of 245 characters", "DeviceInfo", "VendorName=Example", "VendorName=" + "v" * 245),
    Defect("I113", "a comment after a value", "2007", "DefaultValue=-5", "DefaultValue=-5 ; minus five"),
    Defect("W114", "a comment with #", "2008", "PDOMapping=0", "PDOMapping=0\n# old style", at="# old style"),
    Defect("E123", "a tag that is not closed", "", "</dummyUsage>", "", base="xdd", at=f"line {XML_END}"),
    Defect("E124", "an index that is not a number", "", 'index="2007"', 'index="20G7"', base="xdd",
           at=f"line {XML_2007}"),
    Defect("W122", "Ctrl-Z at the end", "2008", "PDOMapping=0\n", "PDOMapping=0\n\x1a",
           at=f"line {CLEAN.count(chr(10)) + 1}"),
    Defect("W115", "an indented line", "2008", "PDOMapping=0", "  PDOMapping=0", at="  PDOMapping=0"),
    Defect("W116", "an unknown section", "2008", "[2008]", "[Notes]\nText=x\n\n[2008]", at="Notes"),
    Defect("E117", "0x before an index", "2008", "[2008]", "[0x2008]", at="0x2008"),
    Defect("E117", "a leading zero before an index", "2008", "[2008]", "[02008]", at="02008"),
    Defect("E117", "a leading zero in a sub-index", "2002sub1", "[2002sub1]", "[2002sub01]", at="2002sub01"),
    Defect("E117", "a blank in a sub-index's name", "2002sub1", "[2002sub1]", "[2002 sub1]", at="2002 sub1"),
    Defect("E117", "blanks inside the brackets", "2008", "[2008]", "[ 2008 ]", at="[ 2008 ]"),
    Defect("W118", "an unknown key of an object", "2008", "PDOMapping=0", "PDOMapping=0\nUnit=mm", at="2008/Unit"),
    Defect("W118", "an unknown key of [DeviceInfo]", "DeviceInfo", "OrderCode", "Colour=red\nOrderCode"),
    Defect("W118", "a dummy that is not a data type", "DummyUsage", "Dummy0007=0", "Dummy0007=0\nDummy00FF=0",
           at="DummyUsage/Dummy00FF"),
    Defect("E119", "a list entry numbered 01", "MandatoryObjects", "1=0x1000", "01=0x1000"),
    Defect("E119", "a key in a list that is not a number", "OptionalObjects", "2=0x1005", "2=0x1005\nFirst=0x1003",
           at="OptionalObjects/First"),
    Defect("E120", "no [FileInfo]", "FileInfo", "[FileInfo]\n", "[Tools]\n", at="line 1"),
    Defect("E120", "no [DeviceInfo]", "DeviceInfo", "[DeviceInfo]\n", "[Tools]\n", at="line 1"),
    # [FileInfo]
    Defect("E201", "no FileName", "FileInfo", "FileName=clean.eds\n", ""),
    Defect("E201", "no FileVersion", "FileInfo", "FileVersion=1\n", ""),
    Defect("E202", "no EDSVersion", "FileInfo", "EDSVersion=4.0\n", ""),
    Defect("W203", "no Description", "FileInfo", "Description=A small device without any fault\n", ""),
    Defect("W203", "no CreatedBy", "FileInfo", "CreatedBy=a person\n", ""),
    Defect("E204", "FileVersion 256", "FileInfo", "FileVersion=1", "FileVersion=256"),
    Defect("E204", "FileVersion 1.2", "FileInfo", "FileVersion=1", "FileVersion=1.2"),
    Defect("E205", "FileRevision -1", "FileInfo", "FileRevision=2", "FileRevision=-1"),
    Defect("E206", "EDSVersion in words", "FileInfo", "EDSVersion=4.0", "EDSVersion=four"),
    Defect("W207", "EDSVersion 3.0", "FileInfo", "EDSVersion=4.0", "EDSVersion=3.0"),
    Defect("W208", "a time with 24 hours", "FileInfo", "CreationTime=09:30AM", "CreationTime=21:30"),
    Defect("W208", "a time with 75 minutes", "FileInfo", "CreationTime=09:30AM", "CreationTime=09:75AM"),
    Defect("W209", "a date with the year first", "FileInfo", "CreationDate=03-01-2014", "CreationDate=2014-03-01"),
    Defect("W209", "a date in month 13", "FileInfo", "CreationDate=03-01-2014", "CreationDate=13-01-2014"),
    Defect("W210", "another FileName", "FileInfo", "FileName=clean.eds", "FileName=other.eds"),
    # [DeviceInfo]
    Defect("E212", "no VendorName", "DeviceInfo", "VendorName=Example\n", ""),
    Defect("E212", "an empty ProductName", "DeviceInfo", "ProductName=Clean device", "ProductName="),
    Defect("W213", "no OrderCode", "DeviceInfo", "OrderCode=CLEAN-1\n", ""),
    Defect("W213", "no BaudRate_800", "DeviceInfo", "BaudRate_800=0\n", ""),
    Defect("E214", "BaudRate_500 is yes", "DeviceInfo", "BaudRate_500=1", "BaudRate_500=yes"),
    Defect("E214", "BaudRate_500 is 2", "DeviceInfo", "BaudRate_500=1", "BaudRate_500=2"),
    Defect("W215", "no bit rate", "DeviceInfo",
           "50=1\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\nBaudRate_800=0\nBaudRate_1000=1",
           "50=0\nBaudRate_125=0\nBaudRate_250=0\nBaudRate_500=0\nBaudRate_800=0\nBaudRate_1000=0",
           at="DeviceInfo/BaudRate_10"),
    Defect("E216", "SimpleBootUpSlave is 2", "DeviceInfo", "SimpleBootUpSlave=1", "SimpleBootUpSlave=2"),
    Defect("E216", "GroupMessaging is no", "DeviceInfo", "GroupMessaging=0", "GroupMessaging=no"),
    Defect("E217", "VendorNumber with 33 bits", "DeviceInfo", "VendorNumber=0x00000123", "VendorNumber=0x100000123"),
    Defect("E218", "another VendorNumber", "DeviceInfo", "VendorNumber=0x00000123", "VendorNumber=0x00000124"),
    Defect("E219", "another ProductNumber", "DeviceInfo", "ProductNumber=0x00000456", "ProductNumber=0"),
    Defect("E220", "another RevisionNumber", "DeviceInfo", "RevisionNumber=0x00010002", "RevisionNumber=1"),
    Defect("E221", "NrOfRXPDO too high", "DeviceInfo", "NrOfRXPDO=2", "NrOfRXPDO=3"),
    Defect("E222", "NrOfTXPDO 0", "DeviceInfo", "NrOfTXPDO=2", "NrOfTXPDO=0"),
    Defect("E223", "NrOfTXPDO 513", "DeviceInfo", "NrOfTXPDO=2", "NrOfTXPDO=513"),
    Defect("E224", "Granularity 65", "DeviceInfo", "Granularity=8", "Granularity=65"),
    Defect("W225", "Granularity 0, but mappings are writable", "DeviceInfo", "Granularity=8", "Granularity=0"),
    Defect("W226", "Granularity 8, but all mappings are fixed", "DeviceInfo", "Granularity=0", "Granularity=8",
           base="fixed"),
    Defect("E227", "Granularity 16, but 8 bits are mapped", "DeviceInfo", "Granularity=8", "Granularity=16",
           at="1600sub2/DefaultValue"),
    Defect("E228", "DynamicChannelsSupported is yes", "DeviceInfo", "DynamicChannelsSupported=0",
           "DynamicChannelsSupported=yes"),
    Defect("E229", "CompactPDO 64", "DeviceInfo", "CompactPDO=0", "CompactPDO=64"),
    Defect("W230", "LSS without a serial number", "1018sub4", WHOLE, "", at="DeviceInfo/LSS_Supported"),
    # Dummies and comments
    Defect("E231", "a dummy that is 2", "DummyUsage", "Dummy0005=1", "Dummy0005=2"),
    Defect("W232", "a dummy left out", "DummyUsage", "Dummy0003=0\n", ""),
    Defect("W233", "a dummy of one bit with granularity 8", "DummyUsage", "Dummy0001=0", "Dummy0001=1"),
    Defect("E234", "Lines too high", "Comments", "Lines=2", "Lines=3"),
    Defect("E234", "no Lines", "Comments", "Lines=2\n", ""),
    Defect("E235", "a comment line left out", "Comments", "Line2", "Line3", at="Comments"),
    # Lists of objects
    Defect("E301", "no SupportedObjects", "MandatoryObjects", "SupportedObjects=3\n", ""),
    Defect("E301", "SupportedObjects in words", "MandatoryObjects", "SupportedObjects=3", "SupportedObjects=three"),
    Defect("E302", "SupportedObjects too high", "MandatoryObjects", "SupportedObjects=3", "SupportedObjects=4"),
    Defect("E303", "a number left out", "MandatoryObjects", "3=0x1018", "4=0x1018", at="MandatoryObjects"),
    Defect("E304", "an entry that is not an index", "MandatoryObjects", "3=0x1018", "3=identity"),
    Defect("E304", "an index above 0xFFFF", "MandatoryObjects", "3=0x1018", "3=0x11018"),
    Defect("E305", "an object listed twice", "MandatoryObjects", "3=0x1018", "3=0x1000"),
    Defect("E306", "a listed object without section", "ManufacturerObjects", "=0x2008", "=0x2F08",
           at="ManufacturerObjects/8"),
    Defect("E307", "an object that is not listed", "ManufacturerObjects", "=0x2008", "=0x2007", at="2008"),
    Defect("E308", "no 0x1001", "1001", WHOLE, "", at="MandatoryObjects"),
    Defect("E309", "0x1018 among the optional objects", "OptionalObjects", "1=0x1003", "1=0x1018"),
    Defect("E310", "0x1003 among the mandatory objects", "MandatoryObjects", "3=0x1018", "3=0x1003"),
    Defect("E311", "0x2000 among the optional objects", "OptionalObjects", "1=0x1003", "1=0x2000"),
    Defect("E312", "0x1003 among the manufacturer's objects", "ManufacturerObjects", "1=0x2000", "1=0x1003"),
    Defect("W313", "a data type in a list", "OptionalObjects", "1=0x1003", "1=0x0005"),
    # Objects
    Defect("E401", "no ParameterName", "2008", "ParameterName=Unit\n", ""),
    Defect("E401", "a sub-index without ParameterName", "2002sub2", "ParameterName=Channel 2", "ParameterName="),
    Defect("E402", "ObjectType 3", "2008", "ObjectType=0x7", "ObjectType=0x3"),
    Defect("E402", "ObjectType VAR in words", "2008", "ObjectType=0x7", "ObjectType=VAR"),
    Defect("E403", "no DataType", "2008", "DataType=0x0009\n", ""),
    Defect("E404", "DataType 0x0017", "2008", "DataType=0x0009", "DataType=0x0017"),
    Defect("E404", "DataType in words", "2008", "DataType=0x0009", "DataType=STRING"),
    Defect("E405", "no AccessType", "2008", "AccessType=const\n", ""),
    Defect("E406", "AccessType r", "2008", "AccessType=const", "AccessType=r"),
    Defect("W454", "AccessType UNKNOWN", "2008", "AccessType=const", "AccessType=UNKNOWN"),
    Defect("E406", "AccessType wr", "2002sub1", "AccessType=rwr", "AccessType=wr"),
    Defect("E407", "a sub-index without object", "2008", "[2008]", "[2F08sub1]", at="2F08sub1"),
    Defect("E408", "SubNumber in a VAR", "2008", "PDOMapping=0", "SubNumber=1\nPDOMapping=0"),
    Defect("E409", "DataType in a record", "2001", "SubNumber=4", "SubNumber=4\nDataType=0x0005", at="2001/DataType"),
    Defect("E409", "PDOMapping 1 in a record", "2001", "SubNumber=4", "SubNumber=4\nPDOMapping=1",
           at="2001/PDOMapping"),
    Defect("E410", "a VAR with a sub-index", "2008", "[2008]",
           "[2007sub1]\nParameterName=x\nDataType=0x0005\nAccessType=rw\n\n[2008]", at="2007sub1"),
    Defect("E411", "no SubNumber", "2001", "SubNumber=4\n", ""),
    Defect("E412", "SubNumber too high", "2001", "SubNumber=4", "SubNumber=5"),
    Defect("E412", "SubNumber too low", "2001", "SubNumber=4", "SubNumber=3"),
    Defect("E413", "no sub-index 0", "2001sub0", WHOLE, "", at="2001"),
    Defect("E414", "sub-index 0 an UNSIGNED16", "2001sub0", "DataType=0x0005", "DataType=0x0006"),
    Defect("E415", "sub-index 0 below the highest", "2001sub0", "DefaultValue=3", "DefaultValue=2"),
    Defect("E415", "sub-index 0 is the number of sections", "1018sub0", "DefaultValue=4", "DefaultValue=5"),
    Defect("W416", "an array with two types", "2002sub2", "DataType=0x0006", "DataType=0x0005"),
    Defect("I417", "two sub-indices of one name", "2002sub2", "ParameterName=Channel 2", "ParameterName=Channel 1"),
    # CompactSubObj
    Defect("W420", "CompactSubObj in a record", "2009", "ObjectType=0x8", "ObjectType=0x9", base="compact"),
    Defect("E421", "CompactSubObj 255", "2009", "CompactSubObj=8", "CompactSubObj=255", base="compact"),
    Defect("E422", "CompactSubObj with SubNumber", "2009", "CompactSubObj=8", "CompactSubObj=8\nSubNumber=9",
           at="2009/SubNumber", base="compact"),
    Defect("E423", "NrOfEntries of names too high", "2009Name", "NrOfEntries=2", "NrOfEntries=3", base="compact"),
    Defect("E423", "no NrOfEntries of values", "2009Value", "NrOfEntries=1\n", "", base="compact"),
    Defect("E424", "a name for sub-index 9 of 8", "2009Name", "2=Gain", "9=Gain", base="compact"),
    Defect("E408", "CompactSubObj in a VAR", "2009", "ObjectType=0x8", "ObjectType=0x7", at="2009/CompactSubObj",
           base="compact"),
    # Numbers and values
    Defect("E430", "a default that is not a number", "2007", "DefaultValue=-5", "DefaultValue=five"),
    Defect("E430", "a limit with a unit", "2007", "HighLimit=100", "HighLimit=100mm"),
    Defect("E430", "a SubNumber that is not a number", "2001", "SubNumber=4", "SubNumber=four"),
    Defect("E430", "0x without digits", "2000", "DefaultValue=0", "DefaultValue=0x"),
    Defect("E430", "a default with a decimal point", "2000", "DefaultValue=0", "DefaultValue=1.5"),
    Defect("E431", "018", "2000", "DefaultValue=0", "DefaultValue=018"),
    Defect("W432", "010", "2000", "DefaultValue=0", "DefaultValue=010"),
    Defect("W451", "$NODEID after the number", "1014", "DefaultValue=$NODEID+0x80", "DefaultValue=0x80+$NODEID"),
    Defect("W451", "$NodeID", "1014", "DefaultValue=$NODEID+0x80", "DefaultValue=$NodeID+0x80"),
    Defect("W452", "a value of a DOMAIN", "2005", "DataType=0x000A", "DataType=0x000F", at="2005/DefaultValue"),
    Defect("W453", "a type that is defined nowhere", "2000", "DataType=0x0007", "DataType=0x0055"),
    Defect("W121", "a key in capitals", "2007", "AccessType=rww", "ACCESSTYPE=rww", at="ACCESSTYPE=rww"),
    Defect("W121", "a section in capitals", "FileInfo", "[FileInfo]", "[FILEINFO]", at="line 1"),
    Defect("E430", "a number of C", "2007", "DefaultValue=-5", "DefaultValue=0x10L"),
    Defect("E433", "$NODEID minus", "1014", "DefaultValue=$NODEID+0x80", "DefaultValue=$NODEID-0x80"),
    Defect("E434", "$NODEID in a string", "2008", "DefaultValue=mm", "DefaultValue=$NODEID"),
    Defect("E435", "256 in an UNSIGNED8", "1029sub1", "DefaultValue=0", "DefaultValue=256"),
    Defect("E435", "-1 in an UNSIGNED32", "2000", "DefaultValue=0", "DefaultValue=-1"),
    Defect("E435", "$NODEID+0xF0 in an UNSIGNED8", "2001sub2", "DefaultValue=0", "DefaultValue=$NODEID+0xF0"),
    Defect("E435", "2 in a BOOLEAN", "2006", "DefaultValue=1", "DefaultValue=2"),
    Defect("E436", "a HighLimit above the type", "2007", "HighLimit=100", "HighLimit=40000"),
    Defect("E437", "limits crossed", "2007", "LowLimit=-100", "LowLimit=101"),
    Defect("E438", "a default above HighLimit", "2007", "DefaultValue=-5", "DefaultValue=101"),
    Defect("E438", "a default below LowLimit", "2007", "DefaultValue=-5", "DefaultValue=-101"),
    Defect("W440", "limits of a string", "2008", "PDOMapping=0", "LowLimit=0\nPDOMapping=0"),
    Defect("E441", "a REAL in words", "2004", "DefaultValue=0", "DefaultValue=pi"),
    Defect("W442", "a REAL with a decimal point", "2004", "DefaultValue=0", "DefaultValue=1.5"),
    Defect("W442", "a REAL as bit pattern", "2004", "DefaultValue=0", "DefaultValue=0x3FC00000"),
    Defect("W443", "an OCTET_STRING with an odd digit", "2005", "DefaultValue=00FF10", "DefaultValue=00FF1"),
    Defect("E444", "PDOMapping 2", "2000", "PDOMapping=1", "PDOMapping=2"),
    Defect("E445", "ObjFlags 4", "2000", "PDOMapping=1", "ObjFlags=4\nPDOMapping=1"),
    Defect("W446", "a constant without value", "2008", "DefaultValue=mm\n", ""),
    Defect("W447", "mappable and rw", "2007", "AccessType=rww", "AccessType=rw"),
    Defect("W448", "a mappable string", "2008", "PDOMapping=0", "PDOMapping=1"),
    Defect("I449", "mappable objects, but no PDO", "1400 1401 1600 1601 1800 1801 1A00 1A01", WHOLE, "",
           at="2000/PDOMapping"),
    Defect("W450", "a mappable BOOLEAN with granularity 8", "2006", "PDOMapping=0", "PDOMapping=1"),
    # Objects that CiA 301 knows
    Defect("E501", "0x1000 an UNSIGNED16", "1000", "DataType=0x0007", "DataType=0x0006"),
    Defect("E501", "0x1017 an UNSIGNED32", "1017", "DataType=0x0006", "DataType=0x0007"),
    Defect("E501", "a COB-ID an UNSIGNED16", "1400sub1", "DataType=0x0007", "DataType=0x0006"),
    Defect("E501", "a mapping entry an UNSIGNED16", "1600sub1", "DataType=0x0007", "DataType=0x0006"),
    Defect("E502", "a writable device type", "1000", "AccessType=ro", "AccessType=rw"),
    Defect("E502", "a writable vendor-ID", "1018sub1", "AccessType=ro", "AccessType=rw"),
    Defect("E502", "a read-only configuration date", "1020sub1", "AccessType=rw", "AccessType=ro"),
    Defect("W503", "a mappable heartbeat time", "1017", "PDOMapping=0", "PDOMapping=1"),
    Defect("E504", "COB-ID SYNC with bit 12", "1005", "DefaultValue=0x00000080", "DefaultValue=0x00001080"),
    Defect("E505", "COB-ID TIME with bit 11", "1012", "DefaultValue=0x80000100", "DefaultValue=0x80000900"),
    Defect("E506", "COB-ID EMCY with bit 30", "1014", "DefaultValue=$NODEID+0x80", "DefaultValue=$NODEID+0x40000080"),
    Defect("W507", "COB-ID EMCY elsewhere", "1014", "DefaultValue=$NODEID+0x80", "DefaultValue=$NODEID+0x300"),
    Defect("E508", "a heartbeat of node 128", "1016sub1", "DefaultValue=0x000203E8", "DefaultValue=0x008003E8"),
    Defect("E509", "one heartbeat twice", "1016sub2", "DefaultValue=0x00000000", "DefaultValue=0x000203E9"),
    Defect("W511", "heartbeat and guarding on", "100C", "DefaultValue=0", "DefaultValue=100", at="1017/DefaultValue",
           base="guarded"),
    Defect("E515", "another identifier for SDO", "1200sub1", "DefaultValue=$NODEID+0x600",
           "DefaultValue=$NODEID+0x601"),
    Defect("E516", "an identity of 5 entries", "1018sub0", "DefaultValue=4", "DefaultValue=5"),
    Defect("E517", "a SYNC counter overflow of 1", "1019", "DefaultValue=0", "DefaultValue=1"),
    Defect("E518", "error behaviour 3", "1029sub1", "DefaultValue=0", "DefaultValue=3"),
    Defect("W519", "the signature as default of 0x1010", "1010sub1", "DefaultValue=0x00000001",
           "DefaultValue=0x65766173"),
    Defect("W520", "the signature as default of 0x1011", "1011sub1", "DefaultValue=0x00000001",
           "DefaultValue=0x64616F6C"),
    Defect("W521", "a time after midnight", "1020sub2", "DefaultValue=0", "DefaultValue=86400000"),
    Defect("W522", "NMT startup with bit 8", "1F80", "DefaultValue=0x00000004", "DefaultValue=0x00000104"),
    Defect("W523", "NMT startup: reset all and stop all", "1F80", "DefaultValue=0x00000004", "DefaultValue=0x00000054"),
    Defect("I524", "an object of a profile in a device without", "2008", "[2008]", "[6008]", at="6008"),
    # PDOs: records and identifiers
    Defect("E601", "a mapping without communication", "1801", WHOLE, "", at="1A01"),
    Defect("E602", "communication without a mapping", "1A01", WHOLE, "", at="1801"),
    Defect("E603", "no COB-ID", "1400sub1", WHOLE, "", at="1400"),
    Defect("E604", "a COB-ID with bit 11", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=$NODEID+0xA00"),
    Defect("W605", "a COB-ID with 29 bits", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=0x20012345"),
    Defect("E606", "a PDO under an SDO's identifier", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=0x601"),
    Defect("E606", "a PDO under NMT's identifier", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=0"),
    Defect("E606", "a PDO under a heartbeat's identifier", "1800sub1", "DefaultValue=$NODEID+0x40000180",
           "DefaultValue=0x40000705"),
    Defect("I607", "a PDO under 0x005", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=0x005"),
    Defect("I607", "a PDO under 0x140", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=0x140"),
    Defect("I608", "a PDO under another node's identifier", "1400sub1", "DefaultValue=$NODEID+0x200",
           "DefaultValue=0x385"),
    Defect("I608", "a PDO under SYNC", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=0x080"),
    Defect("W609", "a PDO under the base of its default", "1400sub1", "DefaultValue=$NODEID+0x200",
           "DefaultValue=0x200"),
    Defect("E610", "two TPDOs under one identifier", "1801sub1", "DefaultValue=$NODEID+0x280",
           "DefaultValue=$NODEID+0x180"),
    Defect("E611", "an identifier that leaves 11 bits", "1400sub1", "DefaultValue=$NODEID+0x200",
           "DefaultValue=$NODEID+0x7A0"),
    # PDOs: transmission
    Defect("E620", "transmission type 245 of a TPDO", "1800sub2", "DefaultValue=254", "DefaultValue=245"),
    Defect("E621", "transmission type 241 of an RPDO", "1401sub2", "DefaultValue=255", "DefaultValue=241"),
    Defect("W622", "transmission type 253 of an RPDO", "1401sub2", "DefaultValue=255", "DefaultValue=253"),
    Defect("E623", "on remote frames only, and none allowed", "1800sub2", "DefaultValue=254", "DefaultValue=253"),
    Defect("W624", "synchronous without SYNC", "1005", WHOLE, "", at="1400sub2/DefaultValue"),
    Defect("E512", "a cycle period without SYNC", "1005", WHOLE, "", at="1006"),
    Defect("E513", "a synchronous window without SYNC", "1005", WHOLE, "", at="1007"),
    Defect("E514", "a life time factor without guard time", "100C", WHOLE, "", at="100D"),
    Defect("W510", "no heartbeat, no guarding", "1017 100C", WHOLE, "", at="1000"),
    Defect("W625", "sub-index 4 is used", "1800sub4", "DefaultValue=0", "DefaultValue=1"),
    Defect("W626", "an inhibit time of an RPDO", "1400sub3", "DefaultValue=0", "DefaultValue=10"),
    Defect("E627", "SYNC start value 241", "1800sub6", "DefaultValue=0", "DefaultValue=241"),
    Defect("W628", "an event timer below the inhibit time", "1800sub5", "DefaultValue=100", "DefaultValue=4"),
    # PDOs: mappings
    Defect("E630", "65 mapped objects", "1600sub0", "DefaultValue=2", "DefaultValue=65"),
    Defect("E631", "more mapped objects than entries", "1600sub0", "DefaultValue=2", "DefaultValue=5"),
    Defect("E632", "an empty entry among the mapped ones", "1600sub0", "DefaultValue=2", "DefaultValue=3",
           at="1600sub3/DefaultValue"),
    Defect("I633", "no data", "1600sub0", "DefaultValue=2", "DefaultValue=0"),
    Defect("W634", "an entry after the mapped ones", "1600sub0", "DefaultValue=2", "DefaultValue=1",
           at="1600sub2/DefaultValue"),
    Defect("E635", "80 bits", "1A01sub3", "DefaultValue=0x20020310", "DefaultValue=0x20000030",
           at="1A01sub0/DefaultValue"),
    Defect("E636", "a mapped object that is missing", "1600sub1", "DefaultValue=0x20010110", "DefaultValue=0x2FFF0110"),
    Defect("E636", "a mapped sub-index that is missing", "1600sub1", "DefaultValue=0x20010110",
           "DefaultValue=0x20010910"),
    Defect("E637", "a mapped object that is not mappable", "2001sub1", "PDOMapping=1", "PDOMapping=0",
           at="1600sub1/DefaultValue"),
    Defect("E638", "a mapped length above the type's", "1600sub1", "DefaultValue=0x20010110",
           "DefaultValue=0x20010118"),
    Defect("W639", "a mapped length that cuts values", "1A01sub1", "DefaultValue=0x20020110",
           "DefaultValue=0x20020108"),
    Defect("I640", "a mapped length that cuts no value", "1600sub1", "DefaultValue=0x20010110",
           "DefaultValue=0x2001010A"),
    Defect("E641", "an RPDO onto a read-only object", "1600sub1", "DefaultValue=0x20010110", "DefaultValue=0x20000020"),
    Defect("E641", "an RPDO onto an rwr object", "1600sub1", "DefaultValue=0x20010110", "DefaultValue=0x20010310"),
    Defect("E642", "a TPDO from an rww object", "1A00sub2", "DefaultValue=0x20010310", "DefaultValue=0x20010110"),
    Defect("E642", "a TPDO from a write-only object", "2000", "AccessType=ro", "AccessType=wo",
           at="1A00sub1/DefaultValue"),
    Defect("E643", "a dummy in a TPDO", "1A00sub2", "DefaultValue=0x20010310", "DefaultValue=0x00060010"),
    Defect("E644", "a dummy that is not enabled", "DummyUsage", "Dummy0005=1", "Dummy0005=0",
           at="1601sub1/DefaultValue"),
    Defect("E645", "a dummy of 16 bits with 8", "1601sub1", "DefaultValue=0x00050008", "DefaultValue=0x00060008"),
    Defect("E646", "a mapped object with 0 bits", "1600sub1", "DefaultValue=0x20010110", "DefaultValue=0x20010100"),
    Defect("W647", "an object mapped twice", "1A01sub2", "DefaultValue=0x20020210", "DefaultValue=0x20020110"),
    Defect("W648", "a fixed number of writable entries", "1600sub0", "AccessType=rw", "AccessType=ro"),
    Defect("W649", "a fixed COB-ID with a writable mapping", "1400sub1", "AccessType=rw", "AccessType=const"),
    Defect("E650", "a mapping entry with $NODEID", "1600sub1", "DefaultValue=0x20010110",
           "DefaultValue=$NODEID+0x20010110"),
    # DCF
    Defect("E701", "a DCF that commissions nothing", "DeviceComissioning", "[DeviceComissioning]", "[Tools]",
           at="line 1", base="dcf"),
    Defect("W702", "DeviceCommissioning", "DeviceComissioning", "[DeviceComissioning]", "[DeviceCommissioning]",
           at="DeviceCommissioning", base="dcf"),
    Defect("E703", "NodeID 128", "DeviceComissioning", "NodeID=5", "NodeID=128", base="dcf"),
    Defect("E703", "no NodeID", "DeviceComissioning", "NodeID=5\n", "", base="dcf"),
    Defect("E704", "Baudrate 300", "DeviceComissioning", "Baudrate=500", "Baudrate=300", base="dcf"),
    Defect("E705", "Baudrate 800, not supported", "DeviceComissioning", "Baudrate=500", "Baudrate=800", base="dcf"),
    Defect("E706", "NetNumber -1", "DeviceComissioning", "NetNumber=1", "NetNumber=-1", base="dcf"),
    Defect("E707", "CANopenManager 2", "DeviceComissioning", "CANopenManager=0", "CANopenManager=2", base="dcf"),
    Defect("E708", "another serial number", "DeviceComissioning", "=0x00000007", "=0x00000008",
           at="DeviceComissioning/LSS_SerialNumber", base="dcf"),
    Defect("W709", "no LastEDS", "FileInfo", "LastEDS=clean.eds\n", "", base="dcf"),
    Defect("W710", "ParameterValue in an EDS", "2000", "DefaultValue=0", "DefaultValue=0\nParameterValue=1",
           at="2000/ParameterValue"),
    Defect("W710", "Denotation in an EDS", "2000", "DefaultValue=0", "DefaultValue=0\nDenotation=x",
           at="2000/Denotation"),
    Defect("E711", "another value of a constant", "1018sub0", "DefaultValue=4", "DefaultValue=4\nParameterValue=3",
           at="1018sub0/ParameterValue", base="dcf"),
    Defect("E439", "a ParameterValue above HighLimit", "2007", "DefaultValue=-5",
           "DefaultValue=-5\nParameterValue=101", at="2007/ParameterValue", base="dcf"),
    Defect("E712", "UploadFile of a number", "2000", "DefaultValue=0", "DefaultValue=0\nUploadFile=a.bin",
           at="2000/UploadFile", base="dcf"),
    Defect("E713", "a concise DCF that ends early", "1F22sub1", "DefaultValue=", "DefaultValue=01000000 1710 00",
           base="dcf"),
    # Modules
    Defect("E461", "a wrong number of modules", "SupportedModules", "NrOfEntries=4", "NrOfEntries=3", base="coupler"),
    Defect("E461", "modules without [SupportedModules]", "SupportedModules", WHOLE, "", at="M1ModuleInfo",
           base="coupler"),
    Defect("W462", "a module without an order code", "M1ModuleInfo", "OrderCode=DI8\n", "", at="M1ModuleInfo",
           base="coupler"),
    Defect("E463", "a fixed object without a section", "M3FixedObjects", "2=0x2300", "2=0x2301", base="coupler"),
    Defect("E463", "an extension without a section", "M1SubExtends", "1=0x6000", "1=0x6100", base="coupler"),
    Defect("E464", "Count in words", "M1SubExt6000", "Count=1", "Count=one", base="coupler"),
    Defect("E464", "Count of no bits", "M2SubExt6000", "Count=0;4", "Count=0;", base="coupler"),
    Defect("E464", "ObjExtend 255", "M4SubExt3000", "ObjExtend=2", "ObjExtend=255", base="coupler"),
    Defect("E465", "a module that is not supported", "ConnectedModules", "2=1", "2=9", base="connected"),
    Defect("W466", "modules without a module list", "1027", WHOLE, "", at="SupportedModules", base="coupler"),
    Defect("E467", "an object both fixed and extended", "M3FixedObjects", "2=0x2300", "2=0x6401",
           base="coupler"),
    Defect("E467", "a module's object is the device's, too", "M3FixedObjects", "2=0x2300", "2=0x1017", base="coupler"),
    Defect("E468", "an extension without a type", "M1SubExt6000", "DataType=0x0005\n", "", at="M1SubExt6000",
           base="coupler"),
    Defect("E469", "an extension without access", "M1SubExt6000", "AccessType=ro\n", "", at="M1SubExt6000",
           base="coupler"),
    Defect("E636", "a mapped object that no connected module brings", "1A00sub2", "DefaultValue=0x60000208",
           "DefaultValue=0x60000308",
           base="connected"),
    Defect("W118", "an unknown key of the commissioning", "DeviceComissioning", "NodeID=5", "NodeID=5\nColour=red",
           at="DeviceComissioning/Colour", base="dcf"),
)  # fmt: skip


def broken_file(defect: Defect) -> bytes:
    """Return the clean file with one defect, as bytes."""
    return mutated(defect).encode(defect.encoding)


def mutated(defect: Defect) -> str:
    """Return the clean file's text with one defect."""
    text = BASES[defect.base][1]
    if defect.old == WHOLE:
        for name in defect.section.split():
            text = re.sub(rf"\[{name}(sub\w+)?\]\n([^\[\n].*\n|\n)*", "", text)
        return text
    start = text.index(f"[{defect.section}]\n") if defect.section else 0
    end = text.find("\n\n", start) if defect.section else len(text)
    block = text[start : end + 1 or None]
    if block.count(defect.old) != 1:
        raise ValueError(f"{defect.name}: {defect.old!r} is {block.count(defect.old)} times in [{defect.section}]")
    return text[:start] + block.replace(defect.old, defect.new) + text[start + len(block) :]


def expected_line(defect: Defect) -> int:
    """Return the line, from 1, in which the defect has to be flagged."""
    lines = re.split(r"\r?\n", mutated(defect))
    if defect.at.startswith("line "):
        return int(defect.at.removeprefix("line "))
    section, _, key = (defect.at or f"{defect.section}/{_changed_key(defect)}").partition("/")
    if f"[{section}]" in lines:
        return _line_of(lines, section, key)
    clean = BASES[defect.base][1].split("\n")
    first = next(n for n, pair in enumerate(zip(lines, clean)) if pair[0] != pair[1])
    return lines.index(defect.at, first) + 1


def _changed_key(defect: Defect) -> str:
    """Return the key of the first changed line of the defect, or of what it removed."""
    old, new = defect.old.split("\n"), defect.new.split("\n")
    changed = next((line for line in new if line and line not in old), old[0])
    return changed.partition("=")[0]


def _line_of(lines: list[str], section: str, key: str) -> int:
    """Return the line of a key of a section, or that of the section's header if the key is not there."""
    header = lines.index(f"[{section}]")
    for number, line in enumerate(lines[header + 1 :], start=header + 2):
        if line.startswith("["):
            break
        if key and line.partition("=")[0] == key:
            return number
    return header + 1
