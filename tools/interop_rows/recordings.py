"""Compares what other programs read in recordings of our nodes, and what we read in theirs.

The recording is a session of our drive on an in-process bus; the master's frames are a table.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import can

from eurobot_od import cli
from eurobot_od.frame import Frame
from eurobot_od.traffic import formats
from interop_rows.bench import SHORT_GOTO, collect, open_bus, robot
from interop_rows.row import Answer, agree
from interop_rows.tools import run

# What is recorded


class Step(NamedTuple):
    """A frame of the master, and the identifier and first bytes of the drive's answer."""

    cob_id: int
    data: bytes
    answer: int
    answer_data: str = ""


SCRIPT = (
    Step(0x602, bytes.fromhex("4017100000000000"), 0x582, "4b171000"),  # upload of 0x1017
    Step(0x602, bytes.fromhex("2b17100014000000"), 0x582, "60171000"),  # download: a heartbeat every 20 ms
    Step(0x602, bytes.fromhex("4000500000000000"), 0x582, "8000500000000206"),  # no such object
    Step(0x602, bytes.fromhex("2b18100100000000"), 0x582, "80181001"),  # read only
    Step(*SHORT_GOTO, 0x082, "1082"),
    Step(0x000, b"\x02\x02", 0x702, "04"),
    Step(0x000, b"\x80\x02", 0x702, "7f"),
    Step(0x000, b"\x01\x02", 0x702, "05"),
    Step(0x000, b"\x81\x02", 0x702, "00"),
)


def session() -> list[can.Message]:
    """Send the table to our drive and return all frames."""
    messages: list[can.Message] = []
    with robot("drive") as channel, open_bus(channel) as master, open_bus(channel) as listener:
        for step in SCRIPT:
            master.send(can.Message(arbitration_id=step.cob_id, data=step.data, is_extended_id=False))
            messages += collect(listener, partial(_answers, step))
            agree(f"an answer to {step}", _answers(step, messages[-1]), True)
    return messages


def _answers(step: Step, message: can.Message) -> bool:
    return message.arbitration_id == step.answer and message.data.hex().startswith(step.answer_data)


# python-can

FORMATS = ("log", "asc", "csv", "trc", "blf")
"""Suffixes of the formats that python-can writes without a further package and without loss."""

LOSES = (
    "when it is stopped, its `.db` writer drops what it has not written yet, and `can_logger` drops everything on "
    "SIGTERM: end a recording with Ctrl-C, and choose another format"
)


def written_by_python_can(folder: Path) -> Answer:
    """Record the session with python-can's Logger in each format, and read it with ours."""
    messages = session()
    for form in FORMATS:
        file = folder / f"session.{form}"
        with can.Logger(file) as logger:
            for message in messages:
                logger(message)
        with file.open("rb") as opened:
            found = [raw for *_, raw in formats.read(opened)]
        agree(f"frames in {file.name}", [_frame(each) for each in messages], found)
    return Answer(f"{', '.join(FORMATS)}: every frame of a session read by us as recorded", LOSES)


def _frame(message: can.Message) -> Frame:
    return Frame(message.arbitration_id, bytes(message.data))


def read_by_python_can(folder: Path) -> Answer:
    """Read the logs of a simulated match in each format with python-can's LogReader."""
    counts = {form: _read_match(folder / f"match.{form}") for form in FORMATS}
    agree("the number of frames in each format", set(counts.values()), {counts["log"]})
    return Answer(f"{', '.join(FORMATS)}: all {counts['log']} frames of `eurobot-od match --log` read as we read them")


def _read_match(file: Path) -> int:
    with contextlib.redirect_stdout(io.StringIO()):
        agree("the exit status", cli.main(["match", "--for", "3", "--log", str(file)]), 0)
    with file.open("rb") as opened:
        ours = [raw for *_, raw in formats.read(opened)]
    with can.LogReader(file) as reader:
        agree(f"frames in {file.name}", [_frame(each) for each in reader], ours)
    return len(ours)


# tshark

DIRECTION = re.compile(r" [RT]$", re.MULTILINE)

REFUSES = (
    "it refuses candump logs whose lines end in ` R` or ` T`, as python-can and so `--log x.log` write them: "
    r"`sed 's/ [RT]$//'` first. It goes by the predefined connection set (CiA 301 7.3.3), so it shows this "
    "protocol's 0x080 as SYNC, 0x100 as TIME, others as malformed or unknown: read those with `eurobot-od decode`"
)


def number(low: int, high: int) -> Callable[[bytes], int]:
    """Return the function that reads some bytes as a number."""
    return lambda data: int.from_bytes(data[low:high], "little")


MULTIPLEXOR = {"canopen.sdo.main_idx": number(1, 3), "canopen.sdo.sub_idx": number(3, 4)}
MEANING: Mapping[int, Mapping[str, Callable[[bytes], int]]] = {
    0x000: {"canopen.nmt_ctrl.cd": number(0, 1), "canopen.nmt_ctrl.node_id": number(1, 2)},
    0x082: {"canopen.em.err_code": number(0, 2), "canopen.em.err_reg": number(2, 3)},
    0x582: MULTIPLEXOR,
    0x602: MULTIPLEXOR,
    0x702: {"canopen.nmt_guard.state": number(0, 1)},
}
"""Where each value is in a frame by CiA 301 (7.2.4.3, 7.2.7.3, 7.2.8.3), under tshark's names."""

ABORT = {"canopen.sdo.abort_code": number(4, 8)}
FIELDS = list(dict.fromkeys(name for fields in (*MEANING.values(), ABORT) for name in fields))


def dissected_by_tshark(folder: Path) -> Answer:
    """Dissect the recorded session with tshark."""
    messages = session()
    file = folder / "session.log"
    with can.Logger(file) as logger:
        for message in messages:
            logger(message)
    agree("tshark's status for ` R` line ends", tshark(file)[0], 2)
    file.write_text(DIRECTION.sub("", file.read_text()))
    _, lines = tshark(file)
    for message, line in zip(messages, lines, strict=True):
        if message.arbitration_id in MEANING:
            agree(f"dissection of {_frame(message)}", _dissected(line), _meant(message))
    return Answer("NMT, SDO with abort, EMCY, heartbeat and boot-up dissected as sent", REFUSES)


def tshark(file: Path) -> tuple[int, list[str]]:
    """Return tshark's status, and for each frame its FIELDS, separated by tabs."""
    wanted = [word for name in FIELDS for word in ("-e", name)]
    done = run("tshark", "-r", file, "-d", "can.subdissector,canopen", "-T", "fields", *wanted)
    return done.returncode, done.stdout.splitlines()


def _dissected(line: str) -> dict[str, int]:
    return {name: int(value, 0) for name, value in zip(FIELDS, line.split("\t"), strict=True) if value}


def _meant(message: can.Message) -> dict[str, int]:
    data = bytes(message.data)
    is_abort = message.arbitration_id == 0x582 and data[0] == 0x80
    fields = {**MEANING[message.arbitration_id], **(ABORT if is_abort else {})}
    return {name: read(data) for name, read in fields.items()}
