"""Units once: wherever a unit stands, each command that prints a value says the same."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.cli.devices import Devices
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.web.page import described
from tests.cli.console import run
from tests.client.wired import WiredBus
from tests.kit.devices import DOCS

pl = pytest.importorskip("polars")
pq = pytest.importorskip("pyarrow.parquet")

TEXT = (DOCS / "motor.eds").read_text(encoding="utf-8")
LOG = (
    "(1.000000) can0 185#0000D700D7000000\n(2.000000) can0 605#4000200200000000\n(2.001000) can0 585#4B002002D7000000\n"
)
POSITION_LOG = LOG.replace("40002002", "40646000").replace("4B002002", "43646000")
PACKAGE = """
from pathlib import Path
from eurobot_od.plugin import Plugin
DEVICE = Plugin("motor", identity=(0, 5), words=Path(__file__).with_name("words.yaml"))
"""
WORDS = "{unit: degC, factor: 0.1, offset: -40}"


class UnitSource(NamedTuple):
    """Where a unit stands: the options that name the device, and what 215 of the object means there."""

    options: tuple[str, ...]
    object: str = "Motor.Current"
    physical: float = -18.5
    unit: str = "degC"

    @property
    def field(self) -> str:
        return "current" if self.object == "Motor.Current" else "position_actual_value"

    @property
    def text(self) -> str:
        return f"{self.physical:g} {self.unit}"


def file_with(entries: str = "", more: str = "", section: str = "[2000sub2]") -> tuple[str, ...]:
    """Write the motor, with entries in a section, whose two values are 215; return the options that name it."""
    text = re.sub(r"(\[(?:2000sub2|6064)\](?:\n[^\[].*)*?\nDefaultValue=)0", r"\g<1>215", TEXT)
    Path("motor.eds").write_text(text.replace(f"{section}\n", f"{section}\n{entries}") + more, encoding="utf-8")
    return ("--eds", "5=motor.eds")


def _object(index: str, *values: int) -> str:
    """Return the sections of an UNSIGNED32, or of an array of two."""
    plain = "\n[{0}{1}]\nParameterName={0}{1}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue={2}\n"
    if len(values) == 1:
        return plain.format(index, "", values[0])
    subs = (plain.format(index, f"sub{number}", value) for number, value in enumerate(values, 1))
    count = f"\n[{index}sub0]\nParameterName=n\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nDefaultValue=2\n"
    return f"\n[{index}]\nParameterName={index}\nObjectType=0x9\nSubNumber=3\n{count}{''.join(subs)}"


def eds_keys() -> UnitSource:
    return UnitSource(file_with("Unit=degC\nFactor=0.1\nOffset=-40\n"))


def comments() -> UnitSource:
    head = "Units and codes (object | unit | plain values | codes):"
    lines = f"[Comments]\nLines=2\nLine1={head}\nLine2=2000:2 | 0.1 degC |  |\n"
    file = file_with()
    text = re.sub(r"\[Comments\]\n(?:[^\[\n].*\n)*", "", Path("motor.eds").read_text(encoding="utf-8"))
    Path("motor.eds").write_text(lines + "\n" + text, encoding="utf-8")
    return UnitSource(file, physical=21.5)


def xdd() -> UnitSource:
    file_with("Unit=degC\nFactor=0.1\nOffset=-40\n")
    from eurobot_od.export.xdd import xdd_text

    Path("motor.xdd").write_text(xdd_text(Dictionary.load("motor.eds", 1)), encoding="utf-8")
    return UnitSource(("--eds", "5=motor.xdd"))


def xdd_with_a_list_of_units() -> UnitSource:
    source = xdd()
    text = Path("motor.xdd").read_text(encoding="utf-8")
    unit = re.search(r"<co:unit .*?</co:unit>", text, re.DOTALL)
    assert unit is not None
    listed = unit[0].replace("<co:unit ", '<co:unit uniqueID="U1" ')
    text = text.replace(unit[0], "").replace("<co:parameter ", '<co:parameter unitIDRef="U1" ', 1)
    text = text.replace("</co:parameterList>", f"</co:parameterList><co:unitList>{listed}</co:unitList>", 1)
    Path("motor.xdd").write_text(text, encoding="utf-8")
    return source


def patch() -> UnitSource:
    Path("mine.yaml").write_text(f"Motor.Current: {WORDS}\n")
    return UnitSource((*file_with(), "--patch", "mine.yaml"))


def network_file() -> UnitSource:
    file_with()
    Path("network.yaml").write_text(
        f"nodes:\n  motor: {{file: motor.eds, node_id: 5, units: {{Motor.Current: {WORDS}}}}}\n"
    )
    return UnitSource(("--network", "network.yaml"))


def device_yaml() -> UnitSource:
    Path("device.yaml").write_text(f"units:\n  Motor.Current: {WORDS}\n")
    return UnitSource(file_with())


def package() -> UnitSource:
    Path("package").mkdir()
    Path("package/device.py").write_text(PACKAGE)
    Path("package/words.yaml").write_text(f"units:\n  Motor.Current: {WORDS}\n")
    return UnitSource((*file_with(), "--package", "package"))


def si_unit_of_a_drive() -> UnitSource:
    return UnitSource(file_with(more=_object("60A8", 0xFF410000)), "Position actual value", 21.5, "deg")


def turns_of_a_drive() -> UnitSource:
    return UnitSource(file_with(more=_object("6092", 1000, 1)), "Position actual value", 0.215, "rev")


SOURCES: list[Callable[[], UnitSource]] = [
    *(eds_keys, comments, xdd, xdd_with_a_list_of_units, patch, network_file, device_yaml, package),
    *(si_unit_of_a_drive, turns_of_a_drive),
]
KINDS = (eds_keys, package, si_unit_of_a_drive)
"""A unit of the file, one by the device's identity, and one by its objects: each command has to find these three.

The other sources become units of the file when it is loaded, which one command shows.
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(params=SOURCES, ids=lambda each: each.__name__)
def source(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> UnitSource:
    """Lay out a source, with a log and a bus on which the motor is."""
    made: UnitSource = request.param()
    Path("run.log").write_text(LOG if made.field == "current" else POSITION_LOG)
    device = SimulatedDevice(Dictionary.load("motor.eds", 5) if Path("motor.eds").is_file() else None)  # type: ignore[arg-type]
    device.start(0.0)
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(device))
    return made


Command = tuple[str, ...]
SAYS: list[tuple[Command, str]] = [
    (("show", "--objects", "OBJECT"), r"\bTEXT\b"),
    (("read", "5", "OBJECT"), r"\bTEXT$"),
    (("dump", "5"), r"\bTEXT$"),
    (("decode", "run.log"), r"FIELD=TEXT\b"),
    (("decode", "run.log"), r"value of 0x\w+:\w+ .*TEXT\b"),
    (("monitor", "run.log", "--plain", "--speed", "max"), r"FIELD=TEXT\b"),
    (("export", "docs", "--format", "markdown"), r"UNIT"),
    (("export", "dbc"), r'"UNIT"'),
    (("export", "c"), r"UNIT"),
]


@pytest.mark.parametrize(
    ("source", "command", "wanted"),
    [*((each, *SAYS[1]) for each in SOURCES), *((each, *row) for each in KINDS for row in SAYS if row != SAYS[1])],
    ids=lambda each: " ".join(each) if isinstance(each, tuple) else getattr(each, "__name__", ""),
    indirect=["source"],
)
def test_a_command_prints_the_unit(
    capsys: pytest.CaptureFixture[str], source: UnitSource, command: Command, wanted: str
) -> None:
    words = [source.object if each == "OBJECT" else each for each in command]
    done = run(capsys, *words, *source.options)
    assert done.status == 0, done.err
    pattern = wanted.replace("TEXT", re.escape(source.text)).replace("UNIT", re.escape(source.unit))
    pattern = pattern.replace(r"\b" + re.escape(source.text), re.escape(source.text)).replace("FIELD", source.field)
    assert re.search(pattern, done.out, re.MULTILINE), done.out


APART: list[Command] = [
    ("show", "--objects", "OBJECT", "--json"),
    ("read", "5", "OBJECT", "--json"),
    ("dump", "5", "--json"),
]


@pytest.mark.parametrize("source", KINDS, ids=lambda each: each.__name__, indirect=True)
@pytest.mark.parametrize("command", APART, ids=" ".join)
def test_json_has_value_and_unit_apart(
    capsys: pytest.CaptureFixture[str], source: UnitSource, command: Command
) -> None:
    words = [source.object if each == "OBJECT" else each for each in command]
    data = json.loads(run(capsys, *words, *source.options).out)
    rows = data if isinstance(data, list) else next(iter(data.values()))
    (row,) = [each for each in rows if each["name"] == source.object]
    assert (row["value"], row["unit"], row["raw"]) == (pytest.approx(source.physical), source.unit, 215)


def test_decoded_lines_have_value_and_unit_apart(capsys: pytest.CaptureFixture[str], source: UnitSource) -> None:
    lines = run(capsys, "decode", "run.log", "--json", *source.options).out.splitlines()
    message, *_, answer = map(json.loads, lines)
    assert message["fields"][source.field] == pytest.approx(source.physical)
    assert message["units"][source.field] == source.unit
    assert (answer["fields"]["value"], answer["fields"]["unit"]) == (pytest.approx(source.physical), source.unit)
    table = run(capsys, "decode", "run.log", "--csv", *source.options).out
    assert f"{source.physical:g}" in table
    message, *_, answer = table.splitlines()[1:]
    assert (f"{source.field}={source.unit}" in message.rpartition(",")[2], answer.rpartition(",")[2]) == (
        True,
        f"value={source.unit}",
    )


def test_page_archive_and_mcap_have_the_unit(capsys: pytest.CaptureFixture[str], source: UnitSource) -> None:
    options = dict(zip(source.options[::2], source.options[1::2]))
    named = {name.lstrip("-"): [value] for name, value in options.items()}
    network = named.pop("network", [None])[0]
    decoder = Devices(network=network, robot_name="none", **named).decoder()  # type: ignore[arg-type]
    fields = {each["name"]: each["unit"] for message in described(decoder)["messages"] for each in message["fields"]}
    assert fields[source.field] == source.unit
    assert run(capsys, "archive", "run.log", "-o", "season", *source.options).status == 0
    metadata = [pq.read_schema(file) for file in Path("season").rglob("*.parquet")]
    units = [each.field(source.field).metadata[b"unit"].decode() for each in metadata if source.field in each.names]
    assert units == [source.unit]
    pytest.importorskip("mcap")
    assert run(capsys, "export", "mcap", "run.log", "-o", "run.mcap", *source.options).status == 0
    assert f"in {source.unit}".encode() in Path("run.mcap").read_bytes()
