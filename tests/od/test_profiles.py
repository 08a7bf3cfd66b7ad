"""The objects of profiles, for devices without a file: names, types, axes, and which profile a device shows."""

from __future__ import annotations

import pytest

from eurobot_od.od import cia401, cia402
from eurobot_od.od import objects as od
from eurobot_od.od.profiles import PROFILES, dictionary_of, object_of, profile_shown
from eurobot_od.od.values import Address
from eurobot_od.od.words import DRIVE, MODULE, words
from tests.client.servo import SERVO

NAMES: dict[str, tuple[int, Address, str]] = {
    "the first axis": (402, (0x6041, 0), "Statusword"),
    "the second axis": (402, (0x6841, 0), "Statusword (axis 2)"),
    "the eighth axis": (402, (0x9861, 0), "Modes of operation display (axis 8)"),
    "an input of a module": (401, (0x6000, 1), "Read input 8-bit"),
    "an index of two profiles, of a drive": (402, (0x6402, 0), "Motor type"),
    "an index of two profiles, of a module": (401, (0x6402, 2), "Read analogue input 32-bit"),
    "a sub-index that the profile does not have": (402, (0x6041, 5), "Statusword"),
    "an unknown profile, by the sub-index": (0, (0x6402, 2), "Read analogue input 32-bit"),
}


@pytest.mark.parametrize(("profile", "address", "name"), NAMES.values(), ids=NAMES)
def test_an_object_has_the_name_of_its_profile(profile: int, address: Address, name: str) -> None:
    found = object_of(profile, address)
    assert found
    assert found.name == name


@pytest.mark.parametrize("address", [(0x5FFF, 0), (0xA041, 0)], ids=["before", "behind"])
def test_any_other_object_has_no_name(address: Address) -> None:
    assert object_of(402, address) is None


SHOWN: dict[str, tuple[int, set[int], int]] = {
    "0x1000 of a drive": (0x00020192, set(), 402),
    "0x1000 of another profile, whatever is there": (0x00000194, {0x6041, 0x6040}, 404),
    "statusword and mode": (0, {0x6041, 0x6061}, 402),
    "several profiles, with the two words": (0xFFFF, {0x6040, 0x6041}, 402),
    "inputs and outputs": (0, {0x6000, 0x6200}, 401),
    "a statusword alone": (0, {0x6041}, 0),
    "inputs alone": (0, {0x6000, 0x6401}, 0),
    "nothing": (0, set(), 0),
}


@pytest.mark.parametrize(("device_type", "objects", "profile"), SHOWN.values(), ids=SHOWN)
def test_the_profile_that_a_device_shows(device_type: int, objects: set[int], profile: int) -> None:
    assert profile_shown(device_type, objects) == profile


@pytest.mark.parametrize("profile", PROFILES)
def test_the_dictionary_of_a_profile_has_all_its_objects(profile: int) -> None:
    dictionary = dictionary_of(profile)
    assert dictionary
    assert set(PROFILES[profile]) <= set(dictionary.members)


def test_the_objects_of_a_drives_file_that_are_mandatory_in_a_mode_are_in_its_profile() -> None:
    modes = {*range(0x6040, 0x6042), *range(0x6060, 0x606E), *range(0x607A, 0x6087), *range(0x60B0, 0x60B3), 0x60FF}
    assert modes & SERVO.members.keys() <= set(PROFILES[cia402.PROFILE])


def test_touch_probes_are_objects_of_a_drive() -> None:
    probes = {0x60B8: "Touch probe function", 0x60B9: "Touch probe status"}
    assert {index: PROFILES[cia402.PROFILE][index].name for index in probes} == probes


def test_objects_with_value_names_have_a_name() -> None:
    named = {cia402.PROFILE: {index for index, _ in DRIVE}, cia401.PROFILE: set(MODULE)}
    missing = {profile: indices - set(PROFILES[profile]) for profile, indices in named.items()}
    assert missing == {cia402.PROFILE: set(), cia401.PROFILE: set()}


def test_values_have_words_on_all_axes() -> None:
    drive = dictionary_of(cia402.PROFILE)
    assert drive
    assert words(od.at((0x9841, 0), drive.objects), 0x0218) == "Fault"
    assert words(od.at((0x683F, 0), drive.objects), 0x3220) == "0x3220 DC link undervoltage"
    assert words(od.at((0x6061, 0), drive.objects), 8) == "cyclic synchronous position"


def test_names_and_types_are_those_of_a_drives_file() -> None:
    for index in set(PROFILES[cia402.PROFILE]).intersection(SERVO.members):
        for sub in SERVO.members[index]:
            mine, other = object_of(cia402.PROFILE, (index, sub)), SERVO.variable((index, sub))
            if mine and other is not None and bool(mine.members) is bool(sub):
                assert (f"0x{index:04X}", mine.type) == (f"0x{index:04X}", od.data_type(other))
