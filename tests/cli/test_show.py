"""`show`: the table of all messages, the picture of one, and both as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eurobot_od.cli.show import picture
from eurobot_od.od import DIALECT_VARIABLE
from eurobot_od.pdo.protocol import Protocol
from tests.cli.console import run
from tests.eds_text import DEVICE_TYPE, pdo, variable
from tests.kit import plant

PROTOCOLS = {name: plant.protocol(name) for name in plant.DIALECTS}


@pytest.mark.parametrize("dialect", PROTOCOLS)
def test_the_table_has_every_message_in_the_order_of_its_identifier(
    capsys: pytest.CaptureFixture[str], dialect: str
) -> None:
    said = run(capsys, "show", "--dialect", dialect)
    head, *rows = said.out.splitlines()
    assert head.split()[:3] == ["COB-ID", "message", "from"]
    bindings = PROTOCOLS[dialect].bindings
    assert [int(row.split()[0], 16) for row in rows] == [binding.cob_id for binding in bindings]
    assert all(binding.name in row for binding, row in zip(bindings, rows))
    assert rows[4].split() == ["0x203", "Weight", "Request", "panel", "scale", "0"]


def test_a_picture_has_room_for_64_fields(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bits = "".join(variable(f"{0x2000 + n:04X}", "Input", "BOOLEAN") for n in range(64))
    mapped = pdo(0x1800, *(f"0x{0x2000 + n:04X}0001" for n in range(64)))
    Path("many.eds").write_text(DEVICE_TYPE + bits + mapped)
    lines = run(capsys, "show", "many.TPDO1", "--eds", "5=many.eds").out.splitlines()
    cells = [cell.strip() for line in lines if line.startswith("byte ") for cell in line.split("|")[1:-1]]
    assert len(set(cells)) == 64
    assert lines[-1].split()[1:] == ["input_64", "1", "bit", "false,", "true"]


def test_a_picture_shows_each_bit_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    lines = run(capsys, "show", "Order Set").out.splitlines()
    assert lines[0] == "Order Set  COB-ID 0x481  2 bytes"
    assert lines[1] == "panel -> lift, scale"
    rows = [line.split("|")[1:-1] for line in lines if line.startswith("byte ")]
    assert [[cell.strip() for cell in row] for row in rows] == [
        ["R0", "B5", "B4", "B3", "B2", "B1", "B0", "C0"],
        [".", ".", ".", ".", ".", ".", ".", "R1"],
    ]


@pytest.mark.parametrize("name", PROTOCOLS["plain"].names())
@pytest.mark.parametrize("protocol", PROTOCOLS.values())
def test_every_message_has_a_picture_with_every_bit_of_its_fields_once(protocol: Protocol, name: str) -> None:
    lines = list(picture(protocol.binding(name)))
    layout = protocol.binding(name).layout
    cells = [cell.strip() for line in lines if line.startswith("byte ") for cell in line.split("|")[1:-1]]
    drawn = [cell for cell in cells if cell != "."]
    assert len(cells) == 8 * layout.length
    assert len(drawn) == len(set(drawn)) == sum(layout.widths[field] for field in layout.fields)
    assert all(line == line.rstrip() for line in lines)


@pytest.mark.parametrize(
    ("name", "first"),
    [
        ("move to", "Move To  COB-ID 0x202  8 bytes, 6 without gates"),
        ("MoveTo", "Move To  COB-ID 0x202  8 bytes, 6 without gates"),
        ("move-to", "Move To  COB-ID 0x202  8 bytes, 6 without gates"),
        ("0x202", "Move To  COB-ID 0x202  8 bytes, 6 without gates"),
        ("Halt Cause", "Halt Cause  COB-ID 0x281  1 byte"),
        ("Halt Lift", "Halt Lift  COB-ID 0x381  no data"),
    ],
)
def test_a_message_is_found_however_its_name_is_written(
    capsys: pytest.CaptureFixture[str], name: str, first: str
) -> None:
    assert run(capsys, "show", name).out.splitlines()[0] == first


@pytest.mark.parametrize(("words", "count"), [(["show"], len(PROTOCOLS["plain"].bindings)), (["show", "Move To"], 1)])
def test_json_has_the_same_content(capsys: pytest.CaptureFixture[str], words: list[str], count: int) -> None:
    data = json.loads(run(capsys, *words, "--json").out)
    assert len(data) == count
    move = next(each for each in data if each["name"] == "Move To")
    assert move["cob_id"] == 0x202
    assert move["fields"]["y"]["frame_bits"] == list(range(12, 24))


def test_the_dialect_may_come_from_the_environment(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DIALECT_VARIABLE, "packed")
    assert "direction" in run(capsys, "show").out
    assert "direction" not in run(capsys, "show", "--dialect", "plain").out


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["show", "Move Tx"], "unknown message 'Move Tx'; did you mean Move To?"),
        (["show", "panel"], "panel is a device, not a message: show --objects panel lists its objects"),
        (["show", "0x7F0"], "no message has the identifier 0x7F0; `show` lists all"),
        (["show", "--dialect", "nonsense"], "unknown dialect 'nonsense'; known: packed, plain"),
        (["show", "Move To", "--objects"], "either a message or --objects, not both"),
        (["show", __file__], f"{__file__} is a file, not a message: name it by --eds"),
    ],
)
def test_an_unknown_name_is_an_error(capsys: pytest.CaptureFixture[str], words: list[str], complaint: str) -> None:
    said = run(capsys, *words)
    assert (said.status, said.out, said.err) == (2, "", f"eurobot-od: {complaint}\n")


# Objects

MOTOR = f"5={Path(__file__).parents[2] / 'docs' / 'motor.eds'}"
SHOWN_OBJECTS = [
    (["--objects"], "0x1017:0  Producer heartbeat time"),
    (
        ["--objects", "Motor"],
        "0x2000:1  Motor.Speed                        INTEGER16   ro      yes  0      -3000..3000",
    ),
    (["--objects", "motor.speed"], "0x2000:1  Motor.Speed"),
    (["--objects", "0x1014"], "0x00000085"),
]


@pytest.mark.parametrize(("words", "part"), SHOWN_OBJECTS)
def test_the_objects_of_a_device_are_listed(words: list[str], part: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "show", *words, "--eds", MOTOR)
    assert part in said.out
    assert said.out.startswith("object")


def test_objects_of_several_devices_stand_under_their_names(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "show", "--objects", "Position actual value", "--eds", MOTOR, "--eds", MOTOR.replace("5=", "6="))
    assert [each for each in said.out.splitlines() if each.endswith(":")] == ["motor_5:", "motor_6:"]
    (own, _) = json.loads(run(capsys, "show", "--objects", "0x2000:1", "--json", "--eds", MOTOR, "--eds",
                              MOTOR.replace("5=", "6=")).out).values()  # fmt: skip
    assert own[0] | {"value": 0} == {
        "index": 0x2000,
        "subindex": 1,
        "name": "Motor.Speed",
        "type": "INTEGER16",
        "access": "ro",
        "pdo_mapping": True,
        "value": 0,
        "limits": [-3000, 3000],
    }


def test_an_object_that_no_device_has_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "show", "--objects", "Nonsense", "--eds", MOTOR)
    assert (said.status, said.complaint) == (2, "eurobot-od: unknown device or object 'Nonsense'; known: motor")
