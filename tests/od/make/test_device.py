"""The table of one device: what its EDS says, and what is wrong in a table, with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import LocalError, YamlError
from eurobot_od.lint.findings import Severity
from eurobot_od.lint.rules import lint
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.make.device import device_eds, is_device_table, read_device_table

TABLE = """device: {product: Thermometer, vendor: Example, vendor_number: 0x5F, product_number: 2}
profiles: [301, 401]
objects:
  0x1017: {DefaultValue: 250}
  0x2100: {ParameterName: Filter time, DataType: UNSIGNED16, AccessType: rwr, PDOMapping: 1, DefaultValue: 20}
pdos:
  TPDO1: [0x6401:1]
  TPDO2: [0x6401:2, 0x2100]
  RPDO5: [0x6200:1]
"""


def made(text: str) -> bytes:
    return device_eds(read_device_table(text, "thermometer.yaml"), "thermometer.eds")


def test_the_eds_says_what_the_table_says() -> None:
    assert is_device_table(TABLE)
    data = made(TABLE)
    dictionary = Dictionary.read(data, Path("thermometer.eds"), 5)
    assert Identity.of(dictionary) == (0x5F, 2, 0x00010000, 0)
    assert [dictionary.default(each) for each in ((0x1000, 0), (0x1017, 0), (0x2100, 0))] == [0x000F0191, 250, 20]
    pdos = {each.title: (each.cob_id, each.valid, [m.address for m in each.mapping]) for each in dictionary.pdos}
    assert pdos["TPDO 1"] == (0x185, True, [(0x6401, 1)])
    assert pdos["TPDO 2"] == (0x285, True, [(0x6401, 2), (0x2100, 0)])
    assert (pdos["RPDO 5"][1:]) == (False, [(0x6200, 1)])  # from the fifth on there is no identifier of its own
    assert [each for each in lint(data, "thermometer.eds") if each.severity is Severity.ERROR] == []


def test_the_same_table_gives_the_same_bytes() -> None:
    assert made(TABLE) == made(TABLE)


MISTAKES = [
    ("product: Thermometer, ", "", YamlError, "thermometer.yaml:1:9: key 'product' is missing"),
    (
        "vendor_number: 0x5F",
        "vendor_number: many",
        YamlError,
        "thermometer.yaml:1:64: vendor_number = 'many' is not allowed",
    ),
    ("vendor_number: 0x5F", "vendor_number: -1", YamlError, r"thermometer.yaml:1:.*0x0\.\.0xFFFFFFFF"),
    ("DefaultValue: 250", "DefaultValue: 70000", LocalError, r"0x1017: DefaultValue '70000': expected UNSIGNED16"),
    ("0x6401:1", "0x1008", LocalError, "0x1008: it has no data type of a fixed length"),
    ("TPDO2", "PDO2", LocalError, "PDO2 is not a PDO; write RPDO1 or TPDO1, up to 512"),
    ("401]", "999]", LocalError, "unknown profile '999'; known: 301, 401, 402"),
    ("pdos:", "pods:", YamlError, "thermometer.yaml:6:1: unknown key 'pods'; did you mean pdos"),
]


@pytest.mark.parametrize(("old", "new", "error", "words"), MISTAKES, ids=[each[3][:40] for each in MISTAKES])
def test_a_mistake_in_a_table_is_told(old: str, new: str, error: type[Exception], words: str) -> None:
    assert old in TABLE
    with pytest.raises(error, match=words):
        made(TABLE.replace(old, new))
