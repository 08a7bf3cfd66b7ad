"""Faults of other programs that touch our users, each in its smallest form: one that passes says it is mended.

When one does, take it out here, the limit out of `interop_rows`, and the limit out of docs/canopen.md.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import canopen
import pytest
from interop_rows import javascript, recordings, sheets, tools
from interop_rows.row import Differs
from interop_rows.tools import Tool

from tests.kit import plant
from tests.kit.plant import messages as m

EDS = plant.FILES.folder()
MOVE = 2
"""Number of the TPDO Move To of the panel."""


def needs(tool: Tool) -> pytest.MarkDecorator:
    return pytest.mark.skipif(not tool.present(), reason=f"{tool.name} is not here: {tool.remedy}")


@pytest.mark.xfail(raises=AssertionError, reason="canopen: 8 bits at bit 34 of an UNSIGNED8", strict=True)
def test_canopen_reads_whole_bytes_that_begin_within_a_byte(tmp_path: Path) -> None:
    narrow = plant.spoiled(tmp_path, ("panel", "2000sub4", "DataType", "0x0005")) / "panel.eds"
    pdo: Any = canopen.Network().create_node(1, str(narrow)).tpdo[MOVE]
    pdo.read(from_od=True)
    pdo.data = bytearray.fromhex("d27423592c01c3a5")
    assert pdo["Move to.Speed"].raw == 75


@pytest.mark.xfail(
    raises=pytest.fail.Exception, reason="canopen: a mapped object that is missing is only logged", strict=True
)
def test_canopen_refuses_a_mapping_of_an_object_that_is_not_there(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL)
    od: Any = canopen.import_od(str(EDS / "panel.eds"))
    od[0x1A00 + MOVE - 1][2].default = 0x2FFF010C
    pdo: Any = canopen.Network().create_node(1, od).tpdo[MOVE]
    with pytest.raises(KeyError):
        pdo.read(from_od=True)


@pytest.mark.xfail(raises=Differs, reason="dcf2dev: a VISIBLE_STRING's default is read as Python")
def test_dcf2dev_takes_a_string_as_cia_306_writes_it() -> None:
    sheets.dcf2dev(EDS / "lift.eds")


@needs(tools.OBJDICTGEN)
@pytest.mark.xfail(
    raises=AssertionError, reason="objdictgen: sub-index 0 of a mapping becomes the number of its places", strict=True
)
def test_objdictgen_keeps_a_pdo_without_data(tmp_path: Path) -> None:
    sheets.accept(tools.ODG, "--no-color", "convert", EDS / "lift.eds", tmp_path / "lift.eds")
    od: Any = canopen.import_od(str(tmp_path / "lift.eds"))
    assert od[0x1600][0].default == 0


@needs(tools.NPM_CANOPEN)
@pytest.mark.xfail(
    raises=AssertionError, reason="npm canopen: whole objects one behind the other, bit lengths ignored", strict=True
)
def test_npm_canopen_takes_the_mapped_bits() -> None:
    frame = plant.protocol().encode(m.PlaceResponse(x=1234, y=567, angle=89, source=m.Source.ENCODER))
    assert javascript.unpack(EDS / "panel.eds", *frame) == [1234, 567, 89, 0]


@needs(tools.TSHARK)
@pytest.mark.xfail(
    raises=AssertionError, reason="tshark: candump logs with the direction at the line's end are refused", strict=True
)
def test_tshark_reads_a_log_that_python_can_wrote(tmp_path: Path) -> None:
    (tmp_path / "one.log").write_text("(1.000000) can0 702#05 R\n")
    status, _ = recordings.tshark(tmp_path / "one.log")
    assert status == 0
