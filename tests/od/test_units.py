"""Units, factors and offsets: where they stand, and that everything that prints or reads a value says the same."""

from __future__ import annotations

import json
from math import nan
from pathlib import Path

import pytest
from canopen.objectdictionary import ODVariable

from eurobot_od.errors import DictionaryError, FieldError
from eurobot_od.export.dbc import dbc_text
from eurobot_od.frame import Frame
from eurobot_od.od import objects as od
from eurobot_od.od import words
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.patches import read_patch
from eurobot_od.od.units import RAW, UnitScale, scale_of, si_scale
from eurobot_od.pdo.kinds import NOTHING, describe, plain, units
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.traffic.services import content_fields, value_words

DOCS = Path(__file__).parents[2] / "docs"
MOTOR = DOCS / "motor.eds"
CELSIUS = UnitScale("degC", 0.1, -40)
CURRENT = (0x2000, 2)


def motor(tmp_path: Path, entries: str = "Unit=degC\nFactor=0.1\nOffset=-40\n") -> Dictionary:
    """Return a motor whose current has these entries."""
    text = MOTOR.read_text(encoding="utf-8").replace("[2000sub2]\n", f"[2000sub2]\n{entries}")
    file = tmp_path / "motor.eds"
    file.write_text(text, encoding="utf-8")
    return Dictionary.load(file, 5)


def current(dictionary: Dictionary) -> ODVariable:
    found = dictionary.variable(CURRENT)
    assert found is not None
    return found


# What a scale is


@pytest.mark.parametrize(
    ("scale", "raw", "value", "text"),
    [
        (RAW, 215, 215, "215"),
        (UnitScale("rpm"), 215, 215, "215 rpm"),
        (UnitScale("degC", 0.1), 215, 21.5, "21.5 degC"),
        (UnitScale("degC", 0.1), 3, 0.3, "0.3 degC"),  # not 0.30000000000000004
        (CELSIUS, 215, -18.5, "-18.5 degC"),
        (UnitScale("%", -0.5), 3, -1.5, "-1.5 %"),
        (UnitScale("", 1000), 3, 3000, "3000"),
        (UnitScale("V", 0), 3, 3, "3 V"),  # a factor that cannot be is none
        (UnitScale("V", nan), 3, 3, "3 V"),
    ],
)
def test_a_raw_value_is_a_physical_one(scale: UnitScale, raw: int, value: float, text: str) -> None:
    assert (scale.physical(raw), scale.text(raw), round(scale.raw(value))) == (value, text, raw)


# Where it stands


@pytest.mark.parametrize(
    ("entries", "scale"),
    [
        ("", RAW),
        ("Unit=degC\nFactor=0.1\nOffset=-40\n", CELSIUS),
        ("unit=degC\nFACTOR=0,1\noffset=-40.0\n", CELSIUS),  # other letters, a decimal comma
        ("Unit=A\n", UnitScale("A")),
        ("Factor=any\n", RAW),
    ],
)
def test_a_file_has_unit_factor_and_offset(tmp_path: Path, entries: str, scale: UnitScale) -> None:
    assert scale_of(current(motor(tmp_path, entries))) == scale


def test_a_patch_has_them(tmp_path: Path) -> None:
    patch = tmp_path / "patch.yaml"
    patch.write_text("Motor.Current: {unit: degC, factor: 0.1, offset: -40}\n", encoding="utf-8")
    assert scale_of(current(Dictionary.load(MOTOR, 5, patch=[str(patch)]))) == CELSIUS
    patch.write_text("Motor.Current: {factor: some}\n", encoding="utf-8")
    with pytest.raises(DictionaryError, match=r"patch.yaml:1: factor 'some': expected a number"):
        Dictionary.load(MOTOR, 5, patch=[str(patch)])
    assert read_patch(patch).objects[0].line == 1


XDD = """<?xml version="1.0"?>
<ISO15745ProfileContainer><ISO15745Profile><ProfileBody><ApplicationProcess><parameterList>
<parameter uniqueID="P1" access="read" {attributes}><INT/>{unit}</parameter>
</parameterList><unitList><unit uniqueID="U1" multiplier="0.1"><label lang="en">degC</label></unit></unitList>
</ApplicationProcess></ProfileBody></ISO15745Profile>
<ISO15745Profile><ProfileBody><ApplicationLayers><CANopenObjectList>
<CANopenObject index="1000" name="Device type" objectType="7" dataType="0007" accessType="ro" defaultValue="0"/>
<CANopenObject index="2000" name="Current" objectType="7" uniqueIDRef="P1"/>
</CANopenObjectList></ApplicationLayers></ProfileBody></ISO15745Profile></ISO15745ProfileContainer>
"""


@pytest.mark.parametrize(
    ("attributes", "unit"),
    [
        ('offset="-40"', '<unit multiplier="0.1" unitURI=""><label lang="en">degC</label></unit>'),
        ('offset="-40" multiplier="0.1"', "<unit><label lang='en'>degC</label></unit>"),
        ('offset="-40" unitIDRef="U1"', ""),
    ],
)
def test_an_xdd_has_them(tmp_path: Path, attributes: str, unit: str) -> None:
    file = tmp_path / "motor.xdd"
    file.write_text(XDD.format(attributes=attributes, unit=unit), encoding="utf-8")
    variable = Dictionary.load(file, 5).variable((0x2000, 0))
    assert variable is not None
    assert scale_of(variable) == CELSIUS


@pytest.mark.parametrize(
    ("code", "scale", "why"),
    [
        (0x00000000, RAW, "not set"),
        (0x00B44700, UnitScale("rpm"), "revolutions per minute"),
        (0xFDB44700, UnitScale("rpm", 0.001), "milli"),
        (0xFD010000, UnitScale("mm"), "a prefix that people use"),
        (0xFA010300, UnitScale("um/s"), "... of a fraction"),
        (0xFF410000, UnitScale("deg", 0.1), "tenths of a degree"),
        (0x00B50000, UnitScale("inc"), "increments"),
        (0x00770000, RAW, "a unit that nobody knows"),
    ],
)
def test_an_si_unit_of_a_drive(code: int, scale: UnitScale, why: str) -> None:
    assert si_scale(code) == scale, why


def drive(tmp_path: Path, **defaults: str) -> Dictionary:
    """Return a drive with these objects of its factor group, by `sub_index`."""
    lines, text = [], (DOCS / "servo.eds").read_text(encoding="utf-8")
    for name, value in defaults.items():
        index, _, sub = name[1:].partition("_")
        own = f"ParameterName={name}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue={value}\n"
        lines.append(f"[{index}sub{sub}]\n{own}" if sub else f"[{index}]\n{own}")
        if sub == "1":
            lines.insert(-1, f"[{index}]\nParameterName={index}\nObjectType=0x9\nSubNumber=3\n")
            lines.append(
                f"[{index}sub0]\nParameterName=n\nObjectType=0x7\nDataType=0x0005\nDefaultValue=2\nAccessType=ro\n"
            )
    file = tmp_path / "servo.eds"
    file.write_text(text + "\n" + "\n".join(lines), encoding="utf-8")
    return Dictionary.load(file, 5)


@pytest.mark.parametrize(
    ("defaults", "position"),
    [
        ({"x60A8": "0xFF410000"}, UnitScale("deg", 0.1)),
        ({"x6092_1": "3600", "x6092_2": "1"}, UnitScale("rev", 1 / 3600)),
        ({"x6092_1": "3600", "x6092_2": "1", "x6091_1": "10", "x6091_2": "1"}, UnitScale("motor rev", 10 / 3600)),
        ({"x6092_1": "1", "x6092_2": "1"}, RAW),  # nobody has set it
        ({"x60A8": "0xFF410000", "x6092_1": "3600", "x6092_2": "1"}, UnitScale("deg", 0.1)),
    ],
)
def test_a_drive_says_its_unit_of_position(tmp_path: Path, defaults: dict[str, str], position: UnitScale) -> None:
    variable = drive(tmp_path, **defaults).variable((0x6064, 0))
    if variable is None:
        pytest.skip("the servo has no position")
    assert scale_of(variable) == position


def test_the_unit_in_a_file_takes_precedence_over_the_drives_units(tmp_path: Path) -> None:
    servo = drive(tmp_path, x60A9="0xFD010300")
    units_of = {variable.unit or scale_of(variable).unit for variable in [servo.variable((0x606C, 0))] if variable}
    assert units_of <= {"rpm", "mm/s"}


# What is printed and read


def test_a_person_writes_and_reads_physical_values(tmp_path: Path) -> None:
    variable = current(motor(tmp_path))
    assert [od.parse(variable, each) for each in ("-18.5", "-18.5 degC", "-18.5degC", "raw:215")] == [215] * 4
    assert words.written(variable, 215) == "-18.5 degC"
    assert od.shown(variable, (215).to_bytes(2, "little")) == "-18.5 degC"
    assert od.as_data(variable, 215) == {"value": -18.5, "unit": "degC", "raw": 215}
    assert od.as_data(current(motor(tmp_path, "")), 215) == {"value": 215}


def test_a_value_out_of_its_range_is_refused_in_its_unit(tmp_path: Path) -> None:
    variable = current(motor(tmp_path))
    with pytest.raises(FieldError, match=r"allowed: -40\.\.1960 degC"):
        od.encode(variable, od.parse(variable, "2000"))
    with pytest.raises(FieldError, match="an integer in degC"):
        od.parse(variable, "warm")


def test_logs_say_the_same_of_sdo_transfers(tmp_path: Path) -> None:
    dictionary, octets = motor(tmp_path), (215).to_bytes(2, "little")
    assert value_words(dictionary, CURRENT, octets) == "-18.5 degC"
    assert content_fields(dictionary, CURRENT, octets) == {"value": -18.5, "unit": "degC", "content": octets, "size": 2}


def test_pdos_exports_and_tables_say_the_same(tmp_path: Path) -> None:
    dictionary = motor(tmp_path)
    protocol = Protocol.of_devices([dictionary], NOTHING)
    binding = next(each for each in protocol.bindings if "current" in each.kinds)
    data = binding.pack({field: 215 if field == "current" else 0 for field in binding.layout.fields})
    message = binding.decode(data)
    assert "current=-18.5 degC" in describe(message, binding.kinds)
    assert plain(message)["current"] == -18.5
    assert units(type(message))["current"] == "degC"
    assert binding.encode(message) == Frame(binding.cob_id, data)
    assert binding.kinds["current"].parse("-18.5 degC") == binding.kinds["current"].parse("raw:215") == -18.5
    assert '(0.1,-40) [-40|1960] "degC"' in dbc_text(protocol)
    assert json.dumps(plain(message))
