"""Whole logs decoded by whole processes: `eurobot-od decode` beside `cantools decode`, time and memory.

The traffic is random (see `traffic`); all write to a file. A candump log is also read by tshark, where there is one,
and by thirty lines over cantools' API. After each run the output must have a line for each frame, and a sample of the
lines must have the values of the peer's lines.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import can

from bench.measure import SELDOM, Claim, Contender, Figures, Quantity, Scale, Series, Way, Wrong
from bench.process import CANTOOLS, OURS, PROGRAMS, PYTHON, run
from bench.shared import protocol
from bench.traffic import Timed, random_traffic, write_candump
from eurobot_od.export.dbc import dbc_text

SAMPLES = 1000
"""Lines whose values are compared, from all parts of a log."""

OUR_FIELDS, PEER_FIELDS = re.compile(r"(\w+)=([^,\s]*)"), re.compile(r"(\w+): ([^,\s)]*)")
TSHARK = shutil.which("tshark")

UNKNOWN = ":: Unknown frame id"
"""What cantools writes for the frames of CANopen's own services."""


# Whether the output is right


def compare(ours: Path, peer: Path, count: int) -> None:
    """Compare two outputs; raises Wrong if one is not complete or a sample differs."""
    with ours.open() as own, peer.open() as other:
        step = max(count // SAMPLES, 1)
        number = 0
        for number, (mine, theirs) in enumerate(_pairs(own, other), start=1):
            if number % step == 0 and not agree(mine, theirs):
                raise Wrong(f"line {number}: {mine.strip()!r} against {theirs.strip()!r}")
    if number != count:
        raise Wrong(f"{number} lines for {count} frames")


def _pairs(ours: Iterable[str], peer: Iterable[str]) -> Iterator[tuple[str, str]]:
    try:
        yield from zip(ours, peer, strict=True)
    except ValueError as error:
        raise Wrong("one output has fewer lines than the other") from error


def agree(ours: str, peer: str) -> bool:
    """Return whether two lines have the same fields with the same numbers; words for codes may differ."""
    if UNKNOWN in peer:
        return True
    own, other = dict(OUR_FIELDS.findall(ours)), dict(PEER_FIELDS.findall(peer.partition(" ::")[2]))
    both = (field for field in other if own.get(field, "").isdecimal() and other[field].isdecimal())
    return own.keys() == other.keys() and all(own[field] == other[field] for field in both)


# What is run


def decoded(log: Path, peer: Path, count: int) -> Figures:
    """Run ours, and compare its output with that of the peer, which has run before."""
    output = log.with_suffix(".ours")
    figures = run([*OURS, "decode", log], target=output)
    compare(output, peer, count)
    return figures


@contextmanager
def candump(full: int, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Write a candump log, and yield the programs that decode it."""
    count = scale.of(full, 200)
    with _folder() as (folder, dbc):
        log, peer = folder / "traffic.log", folder / "peer"
        write_candump(log, random_traffic(count))
        yield {
            "cantools": partial(run, [*CANTOOLS, "decode", "-s", dbc], log, peer),
            "bits": partial(run, [PYTHON, PROGRAMS / "peer_bits.py", log, dbc], target=folder / "bits"),
            "loop": partial(run, [PYTHON, PROGRAMS / "peer_loop.py", log, dbc], target=folder / "loop"),
            **({"tshark": partial(run, [TSHARK, "-r", log], target=folder / "tshark")} if TSHARK else {}),
            "ours": partial(decoded, log, peer, count),
            "diagnose": partial(run, [*OURS, "diagnose", "--fail-on", "never", log]),
        }


@contextmanager
def counted(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Write a candump log, and yield the commands that decode it and that count its frames."""
    with tempfile.TemporaryDirectory() as folder:
        write_candump(log := Path(folder, "traffic.log"), random_traffic(scale.of(100_000, 200)))
        words = {"decode": (), "statistics": ("--statistics",)}
        yield {name: partial(run, [*OURS, "decode", *more, log]) for name, more in words.items()}


@contextmanager
def _folder() -> Iterator[tuple[Path, Path]]:
    """Yield a folder and the DBC file in it for the peers."""
    with tempfile.TemporaryDirectory() as name:
        dbc = Path(name, "robot.dbc")
        dbc.write_text(dbc_text(protocol()))
        yield Path(name), dbc


# Other formats, written by python-can

WRITERS: dict[str, Callable[[Path], Any]] = {
    "asc": can.ASCWriter,
    "trc": can.TRCWriter,
    "csv": can.CSVWriter,
    "blf": can.BLFWriter,
    "db": can.SqliteWriter,
}


def write_log(file: Path, writer: Callable[[Path], Any], traffic: Iterable[Timed]) -> None:
    """Write frames with a writer of python-can's."""
    log = writer(file)
    messages = [_message(timed) for timed in traffic]
    for message in messages:
        log.on_message_received(message)
    while getattr(log, "num_frames", len(messages)) < len(messages):
        time.sleep(0.01)  # SqliteWriter drops what its thread has not written when it is stopped
    log.stop()


def _message(timed: Timed) -> can.Message:
    cob_id, data = timed.frame
    return can.Message(timestamp=timed.time, arbitration_id=cob_id, data=data, is_extended_id=False, channel=0)


@contextmanager
def other_format(suffix: str, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Write a log with python-can, and yield the programs that decode it."""
    count = scale.of(100_000, 100)
    with _folder() as (folder, dbc):
        log, peer = folder / f"traffic.{suffix}", folder / "peer"
        write_log(log, WRITERS[suffix], random_traffic(count))
        yield {
            "peer": partial(run, [PYTHON, PROGRAMS / "peer_decode.py", log, dbc], target=peer),
            "ours": partial(decoded, log, peer, count),
        }


# Rows


def _candump(name: str, count: int, wanted: float | None, *claims: Claim, often: float = 1) -> Series:
    beside_cantools = (
        Claim(f"{name}: cantools decode", "ours", "cantools", Way.TIMES_AS_FAST, wanted),
        Claim(f"{name}, memory", "ours", "cantools", Way.RATIO, None, Quantity.MEMORY),
    )
    return Series("logs", name, partial(candump, count), (*beside_cantools, *claims), often)


def _other(suffix: str) -> Series:
    name = f"decode 100 000 frames of {suffix}"
    claim = Claim(f"{name}: python-can and cantools", "ours", "peer", Way.TIMES_AS_FAST, 1)
    return Series("logs", name, partial(other_format, suffix), (claim,), SELDOM)


LINES, MANY = "decode 100 000 lines", "decode 1 000 000 lines"
SERIES = (
    _candump(
        LINES,
        100_000,
        None,
        Claim(f"{LINES}: thirty lines over cantools' API", "ours", "loop", Way.TIMES_AS_FAST, 1),
        *([Claim(f"{LINES}: tshark", "ours", "tshark", Way.TIMES_AS_FAST, 1)] if TSHARK else []),
    ),
    _candump(
        MANY,
        1_000_000,
        6,
        Claim(f"{MANY}: a loop over bitstruct", "ours", "bits", Way.TIMES_AS_FAST, 1),
        Claim("diagnose 1 000 000 lines, CPU: decode", "diagnose", "ours", Way.RATIO, 5, Quantity.CPU_TIME),
        often=SELDOM,
    ),
    Series(
        "logs",
        "decode --statistics of 100 000 lines",
        counted,
        (Claim("decode --statistics of 100 000 lines: decode", "statistics", "decode", Way.RATIO, 1.3),),
    ),
    *map(_other, WRITERS),
)
