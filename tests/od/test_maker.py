"""`device.yaml` beside a device's file: words of errors, units and words of values, and what does not fit."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import PackageWarning
from eurobot_od.frame import Frame
from eurobot_od.od import words
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.maker import device_yaml_of, read_maker
from eurobot_od.od.objects import parse
from eurobot_od.od.units import UnitScale, scale_of
from eurobot_od.traffic.meaning import Decoder

MOTOR = (Path(__file__).parents[2] / "docs" / "motor.eds").read_bytes()
WORDS = """
emcy: {0xFF01: probe broken, 0x73xx: sensor}
units:
  Motor.Current: {unit: degC, factor: 0.1, offset: -40}
  Motor.Speed: rpm
words:
  0x2000:3: {0: stands, 0x10: creeps, bit 0: slow, bit 1: reverse}
"""
TEMPERATURE = UnitScale("degC", 0.1, -40)


def motor(folder: Path, text: str, name: str = "device.yaml") -> Dictionary:
    (folder / "motor.eds").write_bytes(MOTOR)
    (folder / name).write_text(text, encoding="utf-8")
    read_maker.cache_clear()
    return Dictionary.load(folder / "motor.eds", 5)


def test_values_of_the_maker_file_apply_to_the_device(tmp_path: Path) -> None:
    dictionary = motor(tmp_path, WORDS)
    current, speed, target = (dictionary.members[0x2000][sub] for sub in (2, 1, 3))
    assert (scale_of(current), scale_of(speed).unit) == (TEMPERATURE, "rpm")
    assert [words.words(target, each) for each in (0, 0x10, 3, 4)] == ["stands", "creeps", "slow, reverse", ""]
    assert parse(target, "Creeps") == 0x10
    assert words.written(speed, 3) == "3 rpm"
    again = dictionary.renumbered(6)
    assert (scale_of(again.members[0x2000][2]), again.error_words[0xFF01]) == (TEMPERATURE, "probe broken")


def test_an_emcy_has_the_maker_s_words(tmp_path: Path) -> None:
    decode = Decoder([motor(tmp_path, WORDS)])
    assert "probe broken" in decode(Frame(0x085, bytes.fromhex("01FF010000000000"))).text
    assert "sensor" in decode(Frame(0x085, bytes.fromhex("0573010000000000"))).text


def test_of_two_files_the_one_with_the_device_s_name_counts(tmp_path: Path) -> None:
    motor(tmp_path, WORDS)
    dictionary = motor(tmp_path, "units: {Motor.Speed: m/s}", "motor.device.yaml")
    assert device_yaml_of(tmp_path / "motor.eds") == tmp_path / "motor.device.yaml"
    assert scale_of(dictionary.members[0x2000][1]).unit == "m/s"
    assert dictionary.error_words == {}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("units: {Motor.Sped: rpm}", "device.yaml:1: unknown object .Motor.Sped.; did you mean Motor.Speed"),
        ("words:\n  0x5000: {0: x}", "device.yaml:2: the device has no object 0x5000"),
        ("words:\n  Motor.Speed: {some: x}", "device.yaml:2.*'some' is neither a value, such as 3, nor a bit"),
        ("unit: {Motor.Speed: rpm}", "device.yaml:1.*did you mean units"),
        ("units: {Motor.Speed: {factor: x}}", "device.yaml:1"),
        ("emcy: {0xFF0100: x}", "device.yaml:1.*is not an error code"),
        ("{", "device.yaml:2"),
    ],
)
def test_an_entry_that_does_not_fit_is_one_warning(tmp_path: Path, text: str, said: str) -> None:
    with pytest.warns(PackageWarning, match=said) as caught:
        dictionary = motor(tmp_path, f"{text}\n")
    assert len(caught) == 1
    assert dictionary.node_id == 5
