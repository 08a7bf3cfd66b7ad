"""The Lua dissector, judged by tshark's reading of frames against ours."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from interop_rows import exports

from eurobot_od.export import wireshark
from eurobot_od.export.description import DescribedMessage, described
from tests.export import made_up
from tests.kit import plant

FRAMES = 50
"""Random frames for each message; `tools/interop.py` takes more."""

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="no tshark")


@pytest.mark.long
@needs_tshark
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_tshark_reads_frames_of_a_catalogue_as_we_do(dialect: str, tmp_path: Path) -> None:
    protocol = plant.protocol(dialect)
    exports.compare_tshark(protocol, described(protocol), tmp_path, FRAMES)


@needs_tshark
def test_tshark_reads_numbers_of_any_type_and_place_as_we_do(tmp_path: Path) -> None:
    messages = list(made_up.ANY_NUMBERS.items())
    protocol = made_up.protocol(messages)
    exports.compare_tshark(protocol, made_up.typed(protocol, messages), tmp_path, FRAMES)


SHOWN = [
    # (frame, what the columns say)
    ("381#", "Halt Lift"),
    ("202#D27423592C01C3A5", "Move To x=1234 mm y=567 mm angle=89 deg speed=75 % gates=42435"),
    ("202#D27423592C01", "Move To x=1234 mm y=567 mm angle=89 deg speed=75 % gates=0"),
    ("202#D27423592CFDC3A5", "Move To x=1234 mm y=567 mm angle=89 deg speed=75 % gates=42435"),  # reserved bits set
    ("202#D27423592C", "Move To [5 bytes, expected 6 or 8]"),
    ("282#FDFFFF", "Move State Response time=unknown"),
    ("281#01FF", "Halt Cause cause=curtain"),
    ("382#B90BFFFF02", "x=3001 mm (out of range) y=4080 mm (out of range) angle=767 deg source=encoder"),
    ("181#R", "ID: 385 (0x181), Length: 0"),
    ("00000202#D27423592C01C3A5", "Ext. ID: 514 (0x202), Length: 8"),
    ("183#E2040000AC41", "Weight Response weight=1250 x 0.01 kg temperature=21.5 degC"),
    ("183#FFFF0000AC41", "Weight Response weight=overload"),
    ("184#0102", "CANopen"),
]


@needs_tshark
def test_the_columns_say_what_a_frame_means(tmp_path: Path) -> None:
    script, log = tmp_path / "line.lua", tmp_path / "frames.log"
    script.write_text(wireshark.lua_text(plant.protocol(), "line"))
    log.write_text("".join(f"({number}.0) can0 {frame}\n" for number, (frame, _) in enumerate(SHOWN)))
    command = ["tshark", "-X", f"lua_script:{script}", "-d", "can.subdissector,canopen", "-r", str(log)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    for line, (_, shown) in zip(done.stdout.splitlines(), SHOWN, strict=True):
        assert shown in line


@needs_tshark
@pytest.mark.parametrize(
    ("messages", "name"),
    [(made_up.many(), ""), *((made_up.badly_named(), name) for name in ("can", "", "x" * 1000, '"'))],
)
def test_tshark_takes_any_names(messages: list[DescribedMessage], name: str, tmp_path: Path) -> None:
    script, log = tmp_path / "bus.lua", tmp_path / "frames.log"
    script.write_text(wireshark.text_of(messages, name))
    assert re.fullmatch(r"[\x20-\x7E\n]+", script.read_text())
    log.write_text(f"(1.0) can0 {messages[0].cob_id:03X}#01FF\n")
    command = ["tshark", "-X", f"lua_script:{script}", "-r", str(log), "-Y", wireshark.filter_name(name)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert [each for each in done.stderr.splitlines() if not each.startswith("Running as")] == []
    assert len(done.stdout.splitlines()) == 1


@needs_tshark
@pytest.mark.parametrize("name", ["a", "7", "\u00fc", "can"])
def test_tshark_takes_a_dissector_of_any_name(name: str, tmp_path: Path) -> None:
    script = tmp_path / "bus.lua"
    script.write_text(wireshark.lua_text(plant.protocol(), name))
    log = tmp_path / "frames.log"
    log.write_text("(1.0) can0 381#\n")
    done = subprocess.run(
        ["tshark", "-X", f"lua_script:{script}", "-r", str(log)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, "bug" in done.stderr) == (0, False)
    assert "Halt Lift" in done.stdout
