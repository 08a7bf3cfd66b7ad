"""The C header, judged by a strict compiler and by its own functions against our codec."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from interop_rows import exports
from interop_rows.row import Differs

from eurobot_od.export import c
from eurobot_od.export.description import DescribedMessage, described
from tests.export import made_up
from tests.kit import plant

FRAMES = 500
"""Random frames for each message; `tools/interop.py` takes more."""

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


@needs_compiler
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_the_header_reads_and_writes_frames_of_a_catalogue_as_we_do(dialect: str, tmp_path: Path) -> None:
    protocol = plant.protocol(dialect)
    exports.compare_c(protocol, described(protocol), tmp_path, FRAMES)


@needs_compiler
def test_the_header_reads_and_writes_numbers_of_any_type_and_place_as_we_do(tmp_path: Path) -> None:
    messages = list(made_up.ANY_NUMBERS.items())
    protocol = made_up.protocol(messages)
    exports.compare_c(protocol, made_up.typed(protocol, messages), tmp_path, FRAMES)


@needs_compiler
def test_the_comparison_with_c_detects_a_wrong_bit(tmp_path: Path) -> None:
    protocol = plant.protocol()
    messages = described(protocol)
    halt = messages[5]
    moved = [*messages[:5], halt._replace(fields=[halt.fields[0]._replace(places=[1])]), *messages[6:]]
    with pytest.raises(Differs, match="Halt Cause"):
        exports.compare_c(protocol, moved, tmp_path, FRAMES)


@needs_compiler
@pytest.mark.parametrize(
    ("messages", "name"),
    [(made_up.many(), ""), *((made_up.badly_named(), name) for name in ("int", "", "x" * 1000, "*/ #error"))],
)
def test_any_names_compile(messages: list[DescribedMessage], name: str, tmp_path: Path) -> None:
    header = c.header_of(messages, name)
    assert re.fullmatch(r"[\x20-\x7E\n]+", header)
    assert max(map(len, re.findall(r"\w+", re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)))) <= 140
    exports.compiled(header, f'#include "{exports.NAME}.h"\nint main(void) {{ return 0; }}\n', tmp_path)


USER = """
#include <stdio.h>
#include "bus.h"
int main(void)
{
    uint8_t data[8];
    bus_move_to_t m = { 1234, 567, 89, 75, 0xA5C3 };
    for (size_t i = 0, length = bus_move_to_pack(data, sizeof data, &m); i < length; i++) printf("%02X ", data[i]);
    m.angle = 1024;
    printf("%zu ", bus_move_to_pack(data, sizeof data, &m));
    printf("%d %d ", bus_move_to_unpack(&m, data, 7), bus_move_to_unpack(&m, data, 6));
    printf("%u %u %u", m.speed, m.gates, BUS_MOVE_STATE_RESPONSE_TIME_BLOCKED);
    return 0;
}
"""


def test_limits_are_macros_of_the_type_and_a_real_has_none() -> None:
    fields = [
        made_up.Field("Trim", made_up.INTEGER8, 8),
        made_up.Field("Level", made_up.UNSIGNED8, 8),
        made_up.Field("Torque", made_up.INTEGER32, 32),
    ]
    protocol = made_up.protocol([("State", fields), ("Far", [made_up.Field("Way", made_up.UNSIGNED32, 32)]),
                                 ("Real", [made_up.Field("Value", made_up.REAL32, 32)])])  # fmt: skip
    defined = re.findall(r"#define (?:MADE_UP_|BUS_)?(\w+_(?:MIN|MAX)) (.*)", c.c_header(protocol, "bus"))
    assert [(name.removeprefix("BUS_"), value) for name, value in defined] == [
        ("STATE_TRIM_MIN", "((-127) - 1)"),
        ("STATE_TRIM_MAX", "127"),
        ("STATE_LEVEL_MIN", "0u"),
        ("STATE_LEVEL_MAX", "255u"),
        ("STATE_TORQUE_MIN", "((-INT32_C(2147483647)) - 1)"),
        ("STATE_TORQUE_MAX", "INT32_C(2147483647)"),
        ("FAR_WAY_MIN", "UINT32_C(0)"),
        ("FAR_WAY_MAX", "UINT32_C(4294967295)"),
    ]


def test_no_name_ends_a_comment_or_begins_a_trigraph() -> None:
    header = c.c_header(made_up.protocol([("a*/b /*c ??/", [made_up.Field("Way", made_up.UNSIGNED8, 8)])]), "bus")
    assert "a* /b / *c ? ?/" in header


@needs_compiler
def test_a_program_uses_it(tmp_path: Path) -> None:
    judge = exports.compiled(c.c_header(plant.protocol(), "bus"), USER, tmp_path)
    said = subprocess.run([judge], capture_output=True, text=True, check=True).stdout
    assert said == "D2 74 23 59 2C 01 C3 A5 0 0 1 75 0 16777214"
