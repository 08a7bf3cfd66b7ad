"""Frames of other protocols on the bus, by the names that a DBC has for them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from eurobot_od.errors import FileError, LocalError
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.dbc import read_dbc
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.traffic.meaning import DBC, Decoder

TEXT = """VERSION ""
BU_: Engine
BO_ 2364540158 EEC1: 8 Engine
 SG_ Speed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" Vector__XXX
 SG_ Mode : 0|4@1+ (1,0) [0|15] "" Vector__XXX
BO_ 291 Lights: 2 Vector__XXX
 SG_ code : 0|8@1+ (1,0) [0|255] "" Vector__XXX
BO_ 1029 Wide: 12 Engine
 SG_ Torque : 64|16@1- (0.1,0) [-100|100] "Nm" Vector__XXX
BO_ 389 Own: 8 Engine
 SG_ Z : 0|8@1+ (1,0) [0|255] "" Vector__XXX
BO_ 1797 Beat: 1 Engine
 SG_ Z : 0|8@1+ (1,0) [0|255] "" Vector__XXX
VAL_ 2364540158 Mode 1 "Idle" 2 "Run" ;
"""
SERVO = Path(__file__).parents[2] / "docs" / "servo.eds"


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    file = tmp_path / "engine.dbc"
    file.write_text(TEXT)
    return file


WITHOUT_FILE = (
    (Frame(0x0CF004FE | EXTENDED, bytes.fromhex("02000010 27000000")), "EEC1", "Mode=Run, Speed=1250.0 rpm"),
    (RemoteFrame(0x0CF004FE | EXTENDED), "EEC1", "remote frame: asks for it"),
    (Frame(0x123, b"\x01\x02"), "Lights", "code=1"),
    (Frame(0x123), "Lights", ""),  # too short for any signal
    (Foreign(Damage.FD, f"405##0{bytes(8).hex()}7F000000"), "Wide", "Torque=12.7 Nm"),
    (Foreign(Damage.FD, "00000405#00"), "CAN FD, 1 byte", "00000405#00"),  # 29 bits are another identifier
    (Frame(0x185, b"\x07"), "Own", "Z=7"),  # nearer than the guess that it is a PDO
    (Frame(0x705, b"\x05"), "Beat", "Z=5"),  # nor is a node 5 known whose heartbeat it could be
    (Frame(0x706, b"\x05"), "Heartbeat", "node 6, operational"),
)
"""Frames, and their names and words where no device has a file."""


@pytest.mark.parametrize(("raw", "name", "text"), WITHOUT_FILE)
def test_dbc_names_frames_of_unknown_senders(dbc: Path, raw: Raw, name: str, text: str) -> None:
    meaning = Decoder((), others=read_dbc([str(dbc)]))(raw)
    assert (meaning.name, meaning.text, meaning.defects) == (name, text, ())


def test_eds_files_take_precedence_over_dbc(dbc: Path) -> None:
    decoder = Decoder([Dictionary.load(SERVO, 5)], others=read_dbc([str(dbc)]))
    assert decoder(Frame(0x185, bytes(6))).name == "servo.TPDO1"
    assert decoder(Frame(0x705, b"\x05")).name == "Heartbeat"
    assert decoder(Frame(0x123, b"\x01\x02")).group == DBC


def test_the_first_of_several_files_names_an_identifier(dbc: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.dbc"
    other.write_text('BO_ 291 Doors: 1 Body\n SG_ Open : 0|1@1+ (1,0) [0|1] "" Body\nBO_ 292 Seat: 0 Body\n')
    found = read_dbc([str(dbc), str(other)])
    assert found[0x123].name == "Lights"
    assert found[0x124].name == "Seat"


WRONG = {"text": "nonsense", "eds": SERVO.read_text(), "bytes": "\udcff\udcfe"}


@pytest.mark.parametrize("content", WRONG.values(), ids=WRONG)
def test_a_file_that_cantools_cannot_read_is_one_line(tmp_path: Path, content: str) -> None:
    file = tmp_path / "bus.dbc"
    file.write_text(content, errors="surrogateescape")
    with pytest.raises(FileError, match=r"bus\.dbc: cantools cannot read it: ") as raised:
        read_dbc([str(file)])
    assert "\n" not in str(raised.value)


def test_without_the_extra_one_line_says_what_installs_it(dbc: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cantools", None)
    monkeypatch.setitem(sys.modules, "cantools.database", None)
    with pytest.raises(LocalError, match="the extra `dbc` brings it"):
        read_dbc([str(dbc)])
