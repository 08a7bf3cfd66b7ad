"""Values in words: what a profile says of them, where values are printed, and what stays as it was."""

from __future__ import annotations

import pytest

from eurobot_od.frame import Frame
from eurobot_od.od import objects as od
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.words import OF_PROFILES, error_words, profile_words, words, written
from eurobot_od.traffic.meaning import Decoder
from tests.client.servo import DOCS, SERVO, servo

# From CiA 402-2's figures of the two words; the bits that belong to no word are set here and there.
STATUSWORDS = {
    0x0000: "Not ready to switch on",
    0x0040: "Switch on disabled",
    0x0250: "Switch on disabled",
    0x0021: "Ready to switch on",
    0x0633: "Switched on, target reached",
    0x0237: "Operation enabled",
    0x1637: "Operation enabled, target reached, bit 12",  # which the drive's modes have four meanings for
    0x0017: "Quick stop active",
    0x002F: "Fault reaction active",
    0x0088: "Fault, warning",
    0x0837: "Operation enabled, internal limit active",
    0x0001: "no state",  # the quick stop bit without what belongs to it
}

CONTROLWORDS = {
    0x0000: "Disable voltage",
    0x0006: "Shutdown",
    0x0007: "Switch on",
    0x000F: "Enable operation",
    0x0002: "Quick stop",
    0x000B: "Quick stop",
    0x0009: "Disable voltage",
    0x0080: "Fault reset",
    0x008F: "Fault reset",
    0x010F: "Enable operation, halt",
    0x001F: "Enable operation, new set-point or start homing",
}


@pytest.mark.parametrize(("value", "text"), STATUSWORDS.items())
def test_a_statusword_is_the_state_and_what_else_it_says(value: int, text: str) -> None:
    assert words(od.at((0x6041, 0), SERVO.objects), value) == text


@pytest.mark.parametrize(("value", "text"), CONTROLWORDS.items())
def test_a_controlword_is_its_command(value: int, text: str) -> None:
    assert words(od.at((0x6040, 0), SERVO.objects), value) == text


OTHERS = {
    (0x6060, 0): (6, "homing"),
    (0x6061, 0): (-3, ""),  # a mode of the maker's
    (0x605A, 0): (6, "quick stop ramp, stays in Quick stop active"),
    (0x605D, 0): (1, "slow down ramp"),
    (0x6098, 0): (35, "present position, obsolete number"),
    (0x60FD, 0): (0x0001_0006, "positive limit switch, home switch"),
    (0x6502, 0): (0x21, "profile position, homing"),
    (0x6064, 0): (7, ""),  # a number is a number
    (0x2012, 0): (7, ""),  # the maker's
}


@pytest.mark.parametrize(("address", "value", "text"), [(a, *said) for a, said in OTHERS.items()])
def test_values_listed_in_the_profile_have_a_name(address: tuple[int, int], value: int, text: str) -> None:
    assert words(od.at(address, SERVO.objects), value) == text


@pytest.mark.parametrize(
    ("modes", "value", "text"),
    [
        (0x01, 0x3F, "Enable operation, new set-point, at once"),
        (0x21, 0x1F, "Enable operation, new set-point or start homing"),
        (0x23, 0x1F, "Enable operation, bit 4"),  # three meanings say no more than its number
        (0x00, 0x2F, "Enable operation, at once or ramp unlocked"),  # it does not say which it has
    ],
)
def test_the_mode_bits_are_those_of_the_modes_that_the_drive_has(modes: int, value: int, text: str) -> None:
    file = (DOCS / "servo.eds").read_text(encoding="utf-8").replace("DefaultValue=0x000003AD", f"DefaultValue={modes}")
    drive = Dictionary.read(file.encode(), DOCS / "servo.eds", 5)
    assert words(od.at((0x6040, 0), drive.objects), value) == text


# CiA 402-2: what bits 12 and 13 of the statusword, and 4 to 6 and 9 of the controlword, say in each mode.
BITS_OF_MODES = {
    "profile position": (0x001, "set-point acknowledged, following error", "new set-point, at once, relative"),
    "velocity": (0x002, "", "ramp enabled, ramp unlocked, reference ramp"),
    "profile velocity": (0x004, "speed is 0, maximum slippage", ""),
    "homing": (0x020, "homing attained, homing error", "start homing"),
    "interpolated position": (0x040, "interpolation active", "interpolation"),
    "cyclic position": (0x080, "follows the command, following error", ""),
    "cyclic velocity": (0x100, "follows the command", ""),
    "cyclic torque": (0x200, "follows the command", ""),
}


@pytest.mark.parametrize(("modes", "status", "control"), BITS_OF_MODES.values(), ids=BITS_OF_MODES)
def test_the_bits_of_each_mode_have_its_words(modes: int, status: str, control: str) -> None:
    file = (DOCS / "servo.eds").read_text(encoding="utf-8").replace("DefaultValue=0x000003AD", f"DefaultValue={modes}")
    drive = Dictionary.read(file.encode(), DOCS / "servo.eds", 5)
    assert words(od.at((0x6041, 0), drive.objects), 0x3237) == ", ".join(filter(None, ["Operation enabled", status]))
    assert words(od.at((0x6040, 0), drive.objects), 0x007F) == ", ".join(filter(None, ["Enable operation", control]))


def test_a_second_axis_has_the_words_of_the_first() -> None:
    drive = Dictionary.read(_axis_2().encode(), DOCS / "servo.eds", 5)
    assert words(od.at((0x6841, 0), drive.objects), 0x40) == "Switch on disabled"


def _axis_2() -> str:
    text = (DOCS / "servo.eds").read_text(encoding="utf-8")
    count = text.partition("[OptionalObjects]\nSupportedObjects=")[2].partition("\n")[0]
    head = f"[OptionalObjects]\nSupportedObjects={int(count) + 1}\n{int(count) + 1}=0x6841\n"
    listed = text.replace(f"[OptionalObjects]\nSupportedObjects={count}\n", head)
    return listed + "\n[6841]\nParameterName=Statusword 2\nObjectType=7\nDataType=6\nAccessType=ro\nPDOMapping=1\n"


def test_undescribed_objects_have_no_value_names() -> None:
    assert words(od.undescribed((0x6041, 0)), 0x40) == ""
    assert written(od.undescribed((0x6041, 0)), 0x40) == "0x40"


def test_a_device_of_another_profile_has_no_words_of_a_drive() -> None:
    text = (DOCS / "servo.eds").read_text(encoding="utf-8").replace("DefaultValue=0x00020192", "DefaultValue=0x191")
    assert words(od.at((0x6041, 0), Dictionary.read(text.encode(), DOCS / "servo.eds", 5).objects), 0x40) == ""


CONTROLWORD = "[6040]\nParameterName=Controlword\nObjectType=0x7\nDataType=0x0006"


@pytest.mark.parametrize(
    ("device_type", "change", "meaning"),
    [
        ("", ("drive", "drive"), "Switch on disabled"),
        ("0", ("drive", "drive"), "Switch on disabled"),
        ("0x0000FFFF", ("drive", "drive"), "Switch on disabled"),
        # without a controlword, or with something else there, as CiA 418 has it
        ("", ("6040", "2040"), ""),
        ("0", (CONTROLWORD, CONTROLWORD.replace("0x0006", "0x0007")), ""),
    ],
)
def test_a_device_type_that_is_open_is_a_drive_s_if_it_has_both_words(
    device_type: str, change: tuple[str, str], meaning: str
) -> None:
    text = (DOCS / "servo.eds").read_text(encoding="utf-8").replace(*change)
    text = text.replace("DefaultValue=0x00020192", f"DefaultValue={device_type}")
    found = Dictionary.read(text.encode(), DOCS / "servo.eds", 5)
    assert words(od.at((0x6041, 0), found.objects), 0x40) == meaning
    assert ((0x6064, 0) in found.parameters.process_data) is bool(meaning)


# Where values are printed


def test_a_pdo_is_decoded_with_words() -> None:
    decode = Decoder([SERVO])
    assert decode(Frame(0x305, bytes.fromhex("0F0040420F00"))).text.startswith("controlword=15 (Enable operation)")
    assert (
        "statusword=1591 (Operation enabled, target reached)"
        in decode(Frame(0x285, bytes.fromhex("370600000000"))).text
    )


def test_an_sdo_is_decoded_with_words() -> None:
    text = Decoder([SERVO])(Frame(0x605, bytes.fromhex("2B40600006000000"))).text
    assert text == "servo, write 0x6040:00 Controlword = 6 (Shutdown)"


def test_a_program_reads_the_words() -> None:
    with servo() as network:
        assert network[5]["Statusword"].text == "0x0240 (Switch on disabled)"
        assert network[5]["Controlword"].value == 0  # a value stays a number


CODES = [
    # of a drive: the code itself, a code in its class, the class of that class
    (402, 0x7310, "speed"),
    (402, 0x7312, "speed"),
    (402, 0x7333, "sensor"),
    (402, 0x8611, "following error"),
    (402, 0x2332, "earth leakage at the output, phase V"),
    (402, 0x630F, "data record no. 15"),
    (402, 0x6010, "software reset by the watchdog"),
    (402, 0x6301, "data record no. 1"),
    (402, 0x6310, "loss of parameters"),
    (402, 0x6320, "parameter error"),
    (402, 0x7110, "brake chopper"),
    (402, 0x7121, "motor blocked"),
    (402, 0x4310, "drive temperature too high"),
    # of an I/O module the same code is something else
    (401, 0x2330, "load dump at the outputs"),
    (401, 0x7310, None),
    # nobody's
    (402, 0xFF00, None),
    (406, 0x7310, None),
    (0, 0x7310, None),
]


@pytest.mark.parametrize(("profile", "code", "words"), CODES)
def test_words(profile: int, code: int, words: str | None) -> None:
    assert profile_words(profile, code) == words


@pytest.mark.parametrize("profile", OF_PROFILES)
def test_codes_are_codes_and_words_are_words(profile: int) -> None:
    for code, meaning in OF_PROFILES[profile].items():
        assert 0x1000 <= code <= 0xFFFF
        assert meaning == meaning.strip() != ""


CLASSES_OF_CIA_301 = (
    (0x0000, "no error"),
    (0x1000, "generic error"),
    (0x2000, "current"),
    (0x2100, "current, device input side"),
    (0x2200, "current inside the device"),
    (0x2300, "current, device output side"),
    (0x3000, "voltage"),
    (0x3100, "mains voltage"),
    (0x3200, "voltage inside the device"),
    (0x3300, "output voltage"),
    (0x4000, "temperature"),
    (0x4100, "ambient temperature"),
    (0x4200, "device temperature"),
    (0x5000, "device hardware"),
    (0x6000, "device software"),
    (0x6100, "internal software"),
    (0x6200, "user software"),
    (0x6300, "data set"),
    (0x7000, "additional modules"),
    (0x8000, "monitoring"),
    (0x8100, "communication"),
    (0x8200, "protocol error"),
    (0x9000, "external error"),
    (0xF000, "additional functions"),
    (0xFF00, "device specific"),
)
"""The upper bytes as the standard lists them (Table 26), once more."""


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0xFF02, "drive blocked"),  # the device's own
        (ErrorCode.PDO_TOO_SHORT, "pdo too short"),
        (0x2310, "current, device output side"),  # CiA 301's classes
        (0x5530, "device hardware"),  # of a class without a finer one
        (0xFF77, "device specific"),
        (0xFF00, "device specific"),  # ours means a value out of range by it, a foreign device something else
        (0xA000, "reserved"),
        *((code | 0xEE, text) for code, text in CLASSES_OF_CIA_301),
    ],
)
def test_an_error_has_a_name(code: int, text: str) -> None:
    assert error_words(code, {0xFF02: "drive blocked"}) == text
