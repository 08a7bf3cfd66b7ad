"""Compares what other programs read in our EDS and DCF files, and what they write from them.

Every EDS of both dialects goes to every program, unchanged unless the answer says otherwise.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from environment import ROOT

from eurobot_od.lint.diff import compare, read_device
from eurobot_od.lint.findings import Severity
from eurobot_od.lint.rules import lint
from eurobot_od.od import dcf
from eurobot_od.od import dcf as cdcf
from eurobot_od.od.bus_file import load_bus
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import read_bytes
from eurobot_od.od.values import Address
from eurobot_od.robot import dialects
from eurobot_od.support.texts import amount
from interop_rows.row import Answer, Differs, agree
from interop_rows.tools import ODG, run

HEARTBEAT = (0x1017, 0)
PERIOD = 250
"""Heartbeat time in milliseconds, different from the EDS's default."""

MASTER_YAML = """\
master: {{node_id: 127, baudrate: 500}}
drive: {{dcf: {eds}, node_id: 2, heartbeat_producer: {period}}}
"""

STRINGS = re.compile(r"(DataType=0x0009\n(?:\w+=.*\n)*?DefaultValue=)(.+)")
"""The default of a VISIBLE_STRING."""

AS_TEXT = (
    "it takes a VISIBLE_STRING's DefaultValue for a Python literal, where CiA 306-1 has the plain text: an EDS with "
    "`DefaultValue=Eurobot 2014 core` ends in a SyntaxError. Put the text of a copy in quotes"
)


def all_eds() -> list[Path]:
    """Return the EDS files of all dialects."""
    return [each for dialect in dialects.names() for each in sorted(dialects.folder(dialect).glob("*.eds"))]


def label(file: Path) -> str:
    """Return the name of an EDS as `canopen/drive`."""
    return f"{file.parent.name}/{file.stem}"


def accept(*command: str | Path, folder: Path | None = None) -> str:
    """Run a program that must accept its input, and return its output; raises Differs."""
    done = run(*command, folder=folder)
    if done.returncode or done.stderr:
        raise Differs(f"{' '.join(map(str, command))}: {done.stderr or done.stdout}")
    return done.stdout


def write_dcf(folder: Path) -> Path:
    """Write the drive's DCF with another heartbeat."""
    file = folder / "drive.dcf"
    drive = dialects.load("drive")
    file.write_text(dcf.with_values(drive.device, {HEARTBEAT: PERIOD}, 2, "drive", 500))
    return file


# dcf-tools


def dcfchk(file: Path) -> None:
    """Check a file with dcfchk, for node-ID 2; raises Differs for any output."""
    agree(f"dcfchk on {file.name}", accept(sys.executable, "-m", "dcf.cli", "--node_id", "2", file), "")


def check_files(folder: Path) -> Answer:
    """Check all EDS files and a DCF with dcfchk."""
    files = [*all_eds(), write_dcf(folder)]
    for file in files:
        dcfchk(file)
    return Answer(f"{len(files) - 1} EDS files and a DCF accepted without a message")


def generate_concise_dcf(folder: Path) -> Answer:
    """Make the concise DCF of a slave with dcfgen, and read it."""
    eds = dialects.folder(dialects.DEFAULT) / "drive.eds"
    (folder / "robot.yaml").write_text(MASTER_YAML.format(eds=eds, period=PERIOD))
    accept(sys.executable, "-m", "dcfgen.cli", "robot.yaml", folder=folder)
    writes = cdcf.unpack((folder / "drive.bin").read_bytes())
    agree("the concise DCF's writes", writes, [(HEARTBEAT, PERIOD.to_bytes(2, "little"))])
    agree("its bytes", (folder / "drive.bin").read_bytes(), cdcf.pack(writes))
    return Answer("EDS accepted; `drive.bin` holds the one write 0x1017 = 250, which we pack to the same bytes")


def dcf2dev(file: Path) -> str:
    """Make C from an EDS with dcf2dev; raises Differs if it refuses."""
    return accept(sys.executable, "-m", "dcf2dev.cli", file, file.stem)


def generate_c_device(folder: Path) -> Answer:
    """Make C from every EDS with dcf2dev, with its strings in quotes."""
    for file in all_eds():
        quoted = folder / file.name
        quoted.write_text(STRINGS.sub(r'\1"\2"', file.read_text()))
        text = dcf2dev(quoted).lower()
        missing = [index for index in Dictionary.load(file).objects if f"0x{index:04x}" not in text]
        agree(f"objects missing in the C of {label(file)}", missing, [])
    return Answer("C with every object of every EDS, after its strings were put in quotes", AS_TEXT)


# The devices of the documentation, and networks of them

EXAMPLES = ("io", "motor", "servo")
UNDERSTOOD = (
    ("DefaultValue=20.0", "DefaultValue=0x41A00000"),
    *((f"{key}=", f";{key}=") for key in ("Unit", "Factor")),
)
"""What dcf-tools and objdictgen refuse in the examples, and what they accept in its place."""

REFUSED = (
    "they take neither the keys `Unit` and `Factor` (`servo.eds`), which canopen and the tools behind it have, nor, "
    "dcf-tools alone, a REAL in decimal (`motor.eds`, `DefaultValue=20.0`), which is CiA 306's form. `dcfgen "
    "--no-strict` takes the keys; of a copy make the keys comments, and the REAL its bits, `0x41A00000`"
)

BUS_YAML = """\
master: {node_id: 1, baudrate: 500, heartbeat_producer: 100}
servo:
  dcf: servo.eds
  node_id: 2
  heartbeat_producer: 250
  heartbeat_consumer: true
  sdo:
    - {index: 0x6081, sub_index: 0, value: 1000}
    - {index: 0x6081, sub_index: 0, value: 1200}
    - {index: 0x607C, sub_index: 0, value: -3}
  tpdo:
    1: {cob_id: auto, transmission: 1, mapping: [{index: 0x6041, sub_index: 0}, {index: 0x6064, sub_index: 0}]}
    2: {enabled: false, cob_id: 0x300}
  rpdo:
    1: {transmission: 0xfe, mapping: [{index: 0x6040, sub_index: 0}]}
"""


def _example(name: str, folder: Path) -> Path:
    """Copy an example, with the parts that the tools refuse replaced."""
    file = folder / f"{name}.eds"
    text = (ROOT / "docs" / f"{name}.eds").read_text()
    for old, new in UNDERSTOOD:
        text = re.sub(f"(?m)^{re.escape(old)}", new, text)
    file.write_text(text)
    return file


def check_examples(folder: Path) -> Answer:
    """Check the examples with dcfchk and dcfgen."""
    for name in EXAMPLES:
        dcfchk(_example(name, folder))
        (folder / "bus.yml").write_text(f"master: {{node_id: 1}}\n{name}: {{dcf: {name}.eds, node_id: 2}}\n")
        accept(sys.executable, "-m", "dcfgen.cli", "bus.yml", folder=folder)
    return Answer(f"{amount(len(EXAMPLES), 'file')} accepted without a message", REFUSED)


def list_examples(folder: Path) -> Answer:
    """Print the examples with `odg list`."""
    for name in EXAMPLES:
        accept(ODG, "--no-color", "list", _example(name, folder))
    return Answer(f"{amount(len(EXAMPLES), 'file')} listed", REFUSED)


def generate_networks(folder: Path) -> Answer:
    """Write a node's configuration with dcfgen, from a bus.yml and from our description of it; compare with ours."""
    eds = _example("servo", folder)
    (folder / "bus.yml").write_text(BUS_YAML)
    theirs = _generated(folder, "bus.yml")
    read = {each.address: each.value for each in load_bus(folder / "bus.yml").writes("servo")[1]}
    stock = Dictionary.load(eds, 2)
    # dcfgen leaves out what the EDS says already.
    agree("what is written", {**{each: stock.default(each) for each in read}, **theirs}, read)
    accept(sys.executable, "-m", "eurobot_od", "export", "bus", "--network", "bus.yml", "-o", "ours.yml", folder=folder)
    agree("what our bus.yml has written", {**read, **_generated(folder, "ours.yml")}, read)
    return Answer("a `bus.yml` of PDOs, SDO and heartbeats, and ours of the same (`export bus`): the same values")


def _generated(folder: Path, file: str) -> dict[Address, int]:
    """Return dcfgen's writes to the servo by address; of two writes to one object the later counts."""
    accept(sys.executable, "-m", "dcfgen.cli", file, folder=folder)
    writes = cdcf.unpack((folder / "servo.bin").read_bytes())
    return {address: int.from_bytes(data, "little", signed=address == (0x607C, 0)) for address, data in writes}


# objdictgen

FORGOTTEN = {"access", "low limit", "high limit", "object", "bit rates"}
"""Aspects that objdictgen's model cannot hold, so that a conversion loses them."""

ERROR_FIELD = (0x1003, 0)
LOST = (
    "its model has no access `const`, `rwr`, `rww`, no limits narrower than the type, no bit rates, no `Granularity` "
    "but 8; ARRAYs become RECORDs; sub-index 0 of 0x1003 and of every mapping becomes the number of places, where "
    "CiA 301 wants the number of mapped objects (minimal example: a PDO without data, `[1600sub0] DefaultValue=0`, "
    "comes back as 8). Read our EDS with it, do not write them with it"
)


def odg_list(_: Path) -> Answer:
    """Print every EDS with `odg list`."""
    for file in all_eds():
        printed = accept(ODG, "--no-color", "list", file).lower()
        missing = [index for index in Dictionary.load(file).objects if f"0x{index:04x} " not in printed]
        agree(f"objects missing in the list of {label(file)}", missing, [])
    return Answer("every object of all EDS files listed")


def odg_round_trip(folder: Path) -> Answer:
    """Convert every EDS into .od and back with `odg convert`."""
    for file in all_eds():
        between, back = folder / "between.od", folder / f"{file.parent.name}-{file.name}"
        accept(ODG, "--no-color", "convert", file, between)
        accept(ODG, "--no-color", "convert", between, back)
        dcfchk(back)
        agree(f"what changed in {label(file)} beside what the model lacks", list(_changes(file, back)), [])
        agree(f"errors in {label(file)}", set(_errors(back)) - {"E632", "E227"}, set())
    said = "indices, types, names, values, identifiers and every mapped bit are the same; dcfchk accepts what came back"
    return Answer(said, LOST)


def _changes(ours: Path, theirs: Path) -> Iterator[str]:
    for each in compare(read_device(str(ours)), read_device(str(theirs)), with_names=True):
        renamed = each.aspect == "name" and each.where[1] == 0
        if each.aspect not in FORGOTTEN and each.where != ERROR_FIELD and not renamed:
            yield str(each)


def _errors(file: Path) -> Iterator[str]:
    """Yield the codes of our own checker; E632 and E227 are the two wrong numbers in LOST."""
    for each in lint(read_bytes(str(file)), file.name):
        if each.severity is Severity.ERROR:
            yield each.code
