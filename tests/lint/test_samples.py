"""Files in the styles of different vendors and editors are read as they are meant, and what is wrong is found."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.lint.findings import Severity
from eurobot_od.lint.model import load
from eurobot_od.lint.rules import lint

SAMPLES = Path(__file__).parent / "samples"

ABOVE_INFO: dict[str, list[tuple[int, str]]] = {
    # CR LF, lower-case hexadecimal, no blank lines: unusual, but right
    "crlf_io_module.eds": [],
    # keys in any case, blanks around =, an umlaut, dates without leading zeros, an octal heartbeat time
    "sloppy_sensor.eds": [(1, "W121"), (6, "W103"), (7, "W208"), (8, "W209"), (103, "W432"), (121, "W451")],
    # from before EDSVersion: no ObjectType keys (VAR is the default), keys that are gone today, no identity object
    "old.eds": [
        *[(1, "E202"), (1, "W203"), (1, "W203"), (1, "W203"), *[(10, "W213")] * 11],
        *[(15, "W118"), (16, "W118"), (31, "E308"), (43, "W510")],
    ],
    # CompactSubObj: a mapped sub-index behind the last, a value too large, a value for a sub-index that is not there
    "compact_drive.eds": [(212, "E636"), (239, "E435"), (240, "E424")],
    # a DCF: the identifier set to another PDO's of node 7, a value above its limit
    "configured.dcf": [(650, "E610"), (993, "E439")],
    # an editor that keeps its own keys in comments, a byte order mark, empty values
    "editor_with_comments.eds": [(20, "W213")],
    # broken off in the middle, CR as line end, a header without brackets, a section copied and forgotten
    "broken_by_hand.eds": [
        *[(14, "W213"), (25, "E106"), (48, "E106"), (49, "W118"), (50, "W118"), (51, "W118")],
        *[(line, "E306") for line in (65, 87, 88, *range(92, 100))],
        *[(170, "E109"), *[(line, "E636") for line in (554, 562, 609, 770, 778)]],
        *[(800, "E412"), (806, "W648"), (809, "E631"), (817, "E636"), (820, "E403"), (820, "E405"), (820, "E632")],
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", ABOVE_INFO)
def test_exactly_the_known_defects_are_found(name: str) -> None:
    found = lint((SAMPLES / name).read_bytes(), name)
    assert [(each.line, each.code) for each in found if each.severity is not Severity.INFO] == ABOVE_INFO[name]


def test_a_generated_file_has_a_granularity_that_does_not_fit() -> None:
    found = lint((SAMPLES / "generated.eds").read_bytes(), "generated.eds")
    assert {each.code for each in found} == {"W233", "W609", "E227", "W450", "E409"}


def test_the_table_has_eight_styles() -> None:
    assert len([*SAMPLES.iterdir()]) >= 8


@pytest.mark.parametrize("name", ["crlf_io_module.eds", "sloppy_sensor.eds"])
def test_all_pdos_of_the_file_are_read(name: str) -> None:
    device = load((SAMPLES / name).read_bytes(), name)
    assert [(each.name, each.identifier(5), each.bits) for each in device.pdos if each.name == "TPDO 1"] == [
        ("TPDO 1", 0x185, 8 if name.startswith("crlf") else 32)
    ]


def test_a_compact_object_has_all_its_sub_indices() -> None:
    device = load((SAMPLES / "compact_drive.eds").read_bytes(), "compact_drive.eds")
    names = [variable.name for sub in (1, 2, 32) for variable in [device.variable(0x2100, sub)] if variable]
    values = [device.value(0x2100, sub) for sub in (0, 1, 2, 33)]
    assert names == ["First axis", "Set values", "Last axis"]
    assert [each and each.value for each in values] == [32, 70000, 0, None]
