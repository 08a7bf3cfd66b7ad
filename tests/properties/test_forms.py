"""A device's file in other forms says the same: EDS, DCF and XDD, in any order."""

from __future__ import annotations

from pathlib import Path

from canopen.objectdictionary import ODVariable
from hypothesis import assume, example, given

from eurobot_od.errors import DictionaryError
from eurobot_od.export.xdd import xdd_text
from eurobot_od.od.dcf import eds_text, with_contents
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import limits
from tests.properties.test_normal import File, files

NODE = 5
NAME = "device.eds"


def read(text: str | bytes, name: str = NAME) -> Dictionary:
    return Dictionary.read(text if isinstance(text, bytes) else text.encode(), Path(name), NODE)


def said(dictionary: Dictionary) -> dict[object, object]:
    """Return all that an EDS and an XDD can both say of each variable.

    An XDD says `rwr` and `rww` by the mapping that it allows: of what is not mapped it says `rw`.
    """
    return {
        address: (v.name, v.data_type, access(v), v.pdo_mappable, v.default, v.value, limits(v))
        for address in dictionary.addresses()
        if (v := dictionary.variable(address)) is not None
    }


def access(variable: ODVariable) -> str:
    said = variable.access_type
    return "rw" if not variable.pdo_mappable and said in ("rwr", "rww") else said


def loaded(file: File) -> Dictionary:
    try:
        dictionary = read(file.data)
    except DictionaryError:
        assume(False)
        raise
    assume(not dictionary.normal.refusals)
    return dictionary


@given(files())
def test_an_xdd_says_what_its_eds_says(file: File) -> None:
    dictionary = loaded(file)
    there = read(xdd_text(dictionary), "device.xdd")
    assert said(there) == said(dictionary)
    assert said(read(eds_text(there, NAME))) == said(read(eds_text(dictionary, NAME)))


@given(files())
def test_the_eds_of_a_dcf_is_the_eds_that_it_was_made_from(file: File) -> None:
    clean = read(eds_text(loaded(file), NAME))
    made = with_contents(clean, {}, NODE, "node", 500, "device")
    assert eds_text(read(made.content, "device.dcf"), NAME) == eds_text(clean, NAME)


MAPS_BY_DEFAULT = b"""[MandatoryObjects]
SupportedObjects=0
[1A00]
ParameterName=mapping
ObjectType=8
SubNumber=2
[1A00sub0]
ParameterName=number
DataType=0x0005
AccessType=ro
[1A00sub1]
ParameterName=first
DataType=0x0007
AccessType=ro
DefaultValue=0x00010000
ParameterValue=0
"""
"""Maps a dummy by its DefaultValue, which alone an EDS has."""


@given(files())
@example(File(MAPS_BY_DEFAULT, {}))
def test_a_clean_eds_stays_as_it_is(file: File) -> None:
    once = eds_text(loaded(file), NAME)
    assert eds_text(read(once), NAME) == once
