"""Commands that read logs: `decode` and `compare`; and what all share that do, files and standard input."""

from __future__ import annotations

import io
import json
import os
import stat
import sys
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeAlias

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BitRate, EmcyFiles, Json, Seconds, assigned, whole
from eurobot_od.cli.signature import Group, Option
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support import progress
from eurobot_od.traffic.decoding import Decoding
from eurobot_od.traffic.entries import LARGEST, LogEntry
from eurobot_od.traffic.filters import Wanted, Window, by_name, by_node, by_value
from eurobot_od.traffic.following import Following
from eurobot_od.traffic.formats import FORMATS, read
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.output import Output, TextOutput
from eurobot_od.traffic.statistics import DamageCounts

STANDARD_INPUT = "-"
CHUNK = 1 << 16
"""Bytes read from a pipe at once."""

BIT_RATE = 500_000

Log: TypeAlias = Annotated[str, Option(metavar="LOG", is_file=True)]
Logs: TypeAlias = Annotated[Sequence[Log], "logs; - for standard input, the default"]
Format: TypeAlias = Annotated[str, Option(choices=FORMATS.keys())]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How logs are read: their format, None to find out, and the most bytes of a line or record."""

    format: Annotated[Format | None, "format of the logs (default: by their first bytes, or else by suffix)"] = None
    largest: Annotated[
        int,
        Option(metavar="BYTES", read=whole(1024, what="a number of bytes, 1024 or more")),
        f"longest line or record of a log that is read (default: {LARGEST})",
    ] = LARGEST


@dataclass(frozen=True, kw_only=True)
class Filters:
    """The entries that are wanted: names of messages and nodes, conditions on fields."""

    GROUP = Group("filters", "an entry has to pass all that are given")

    message: Annotated[
        Sequence[str],
        Option(metavar="NAME"),
        "message or service by name (`Goto XY`, goto-xy, SDO), or a protocol: GTP, ELP, GIP, CANopen; repeatable",
    ] = ()
    node: Annotated[
        Sequence[str],
        Option(metavar="NAME", suggest=lambda robot: robot.nodes),
        "messages that this node sends or receives; repeatable",
    ] = ()
    where: Annotated[
        Sequence[str],
        Option(metavar="CONDITION"),
        "condition on a field: `x>1000`, `Goto XY.speed<=20`, `team_colour=red`, `time=unknown`; repeatable",
    ] = ()

    def wanted(self, decoder: Decoder) -> Wanted | None:
        """Return the filter, None for none; raises LocalError for a name or a value that cannot be."""
        wanted: list[Wanted] = [by_value(text, decoder.protocol) for text in self.where]
        if self.message:
            wanted.append(by_name(self.message, decoder.protocol))
        if self.node:
            wanted.append(by_node(self.node, [each.name for each in decoder.dictionaries]))
        return (lambda meaning: all(each(meaning) for each in wanted)) if wanted else None


def decode(
    logs: Logs = (STANDARD_INPUT,),
    *,
    reading: Reading,
    as_json: Annotated[Json, Option(either="form"), "one JSON object per line"] = False,
    as_csv: Annotated[bool, Option("--csv", either="form"), "comma-separated values"] = False,
    filters: Filters,
    since: Annotated[float, Option(metavar="S"), "from this time on, in s"] = 0.0,
    until: Annotated[float, Option(metavar="S"), "up to this time, in s"] = inf,
    relative: Annotated[bool, "count the time from a log's first entry"] = False,
    statistics: Annotated[bool, "print load, gaps, jitter, response times and their bounds instead of lines"] = False,
    bitrate: Annotated[BitRate, f"bit/s for --statistics (default: {BIT_RATE})"] = BIT_RATE,
    strict: Annotated[bool, "exit status 1 if anything is wrong in the logs"] = False,
    devices: Devices,
    emcy: EmcyFiles = (),
) -> ExitStatus:
    """Decode logs of a CAN bus: messages with their fields and units, CANopen services, and whatever is wrong.

    Lines go to standard output, progress and the report to standard error.
    """
    decoder = devices.decoder(emcy)
    several = len(logs) > 1
    if statistics:
        from eurobot_od.traffic.traffic import TrafficOutput  # the usual case starts without the other ones' modules

        output: Output = TrafficOutput(bitrate, devices.promised(decoder), several)
    else:
        output = _output(decoder, as_json, as_csv, several)
    decoding = Decoding(decoder, output, filters.wanted(decoder), Window(since, until, relative))
    sys.stdout.write(output.header)
    for log in logs:
        # Lines on the same terminal would tear the bar apart.
        with opened(log, is_watched=statistics or not sys.stdout.isatty()) as file:
            sys.stdout.writelines(decoding.lines(file, log, reading.format, reading.largest))
    sys.stdout.flush()  # the report comes after the lines, also where both go to one file
    sys.stderr.writelines(f"{line}\n" for line in decoding.damage.report())
    return ExitStatus.FOUND if strict and decoding.damage.total else ExitStatus.FINE


def _output(decoder: Decoder, as_json: bool, as_csv: bool, several: bool) -> Output:
    if not (as_json or as_csv):
        return TextOutput(several)
    from eurobot_od.traffic.formats.records import CsvOutput, JsonOutput

    fields = (field for each in decoder.protocol.bindings for field in each.kinds)
    return JsonOutput() if as_json else CsvOutput(fields)


def compare(
    first: Annotated[Log, "the expected log"],
    second: Annotated[Log, "the log to compare with it"],
    *,
    reading: Reading,
    time: Annotated[Seconds, "tolerance of times (1 ms)"] = 0.001,
    tolerance: Annotated[
        Sequence[tuple[str, str]],
        assigned("[MESSAGE.]FIELD=NUMBER"),
        "tolerance of a field, such as x=5 or 'Goto State Response.time=20'; repeatable",
    ] = (),
    as_json: Annotated[Json, "one JSON object per difference"] = False,
    filters: Filters,
    devices: Devices,
    emcy: EmcyFiles = (),
) -> ExitStatus:
    """Compare two logs that should be the same: which frames are missing, extra or late, or have other values.

    Exit status 1 if they differ: a regression test for a node's program.
    """
    from eurobot_od.traffic.compare import Tolerances
    from eurobot_od.traffic.compare import compare as differences_of

    decoder = devices.decoder(emcy)
    fields, wanted = tolerances(tolerance, decoder.protocol), filters.wanted(decoder)
    # Both are read whole, as the distance between their clocks is found from frames of both.
    expected, found = (
        [(at, raw) for _, (_, at, _, raw) in entries([log], reading) if wanted is None or wanted(decoder(raw))]
        for log in (first, second)
    )
    differences = differences_of(expected, found, decoder, Tolerances(time, fields))
    for each in differences:
        line = f"{each.time:13.6f}  {each.kind.value:<8} {each.name:<29} {each.text}".rstrip()
        print(json.dumps(each._asdict() | {"kind": each.kind.value}) if as_json else line)
    if not as_json:
        kinds = Counter(each.kind.value for each in differences)
        counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no difference"
        print(f"{len(expected)} and {len(found)} frames: {counts}")
    return ExitStatus.FOUND if differences else ExitStatus.FINE


def tolerances(given: Iterable[tuple[str, str]], protocol: Protocol) -> dict[tuple[str, str], float]:
    """Return the tolerances by message and field; raises UnknownName, LocalError."""
    found: dict[tuple[str, str], float] = {}
    for name, text in given:
        message, _, field = name.rpartition(".")
        bindings = [protocol.binding(message)] if message else protocol.bindings
        having = [each.name for each in bindings if field in each.kinds]
        if not having:
            raise UnknownName("field", name, dict.fromkeys(field for each in bindings for field in each.kinds))
        try:
            number = float(text)
        except ValueError:
            number = -1.0
        if not 0 <= number < float("inf"):  # `float` takes "nan" and "inf", with which nothing would ever differ
            raise LocalError(f"--tolerance {name}={text}: not a number, 0 or more")
        found |= dict.fromkeys(((each, field) for each in having), number)
    return found


# Reading


def entries(
    logs: Iterable[str], reading: Reading, is_watched: bool = True
) -> Generator[tuple[str, LogEntry], None, None]:
    """Give the entries of logs, one log after the other, with the log's name. Errors as `logs.formats.read`.

    With `is_watched` a terminal shows how far a long log has been read.
    """
    for log in logs:
        with opened(log, is_watched) as file:
            for entry in read(file, reading.format, reading.largest):
                yield log, entry


def meanings(
    logs: Iterable[str], reading: Reading, decoder: Decoder, damage: DamageCounts, is_watched: bool = True
) -> Iterator[tuple[float, Meaning]]:
    """Give the times in s and meanings of the entries of logs; count in `damage` what is wrong. Errors as `entries`."""
    before, following = "", Following(decoder)
    for log, (line, time, channel, raw) in entries(logs, reading, is_watched):
        if log != before:  # a transfer ends with its log
            before, following = log, Following(decoder)
        meaning = following(time, channel, raw)
        damage.add(log, line, meaning.defects)
        yield time, meaning


@contextmanager
def opened(log: str, is_watched: bool = True) -> Iterator[io.BufferedReader]:
    """Open a log; with `is_watched` a terminal shows how far a long one has been read."""
    with ExitStack() as stack:
        if log == STANDARD_INPUT:
            if sys.stdin is None:
                raise LocalError("standard input is closed")
            file: BinaryIO = sys.stdin.buffer
        else:
            file = stack.enter_context(Path(log).open("rb", buffering=0))  # `Watched` is buffered below
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            # A pipe may be a live bus: what has been decoded is shown before the next lines are waited for.
            yield io.BufferedReader(Watched(file, lambda _: sys.stdout.flush()), CHUNK)
        elif is_watched and sys.stderr.isatty():
            draw = stack.enter_context(progress.bar(log, after=progress.SHORT))
            yield io.BufferedReader(Watched(file, lambda done: draw(done, status.st_size)))
        else:
            yield io.BufferedReader(Watched(file, lambda _: None))  # the same class, so that no format has a second way


class Watched(io.RawIOBase):
    """A file or a pipe that calls `on_read` before each read with the bytes read so far."""

    def __init__(self, file: BinaryIO, on_read: Callable[[int], object]) -> None:
        self.name, self._descriptor, self._on_read, self._read = file.name, file.fileno(), on_read, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._on_read(self._read)
        # Gives what a pipe has now; a buffered file would wait until the whole buffer is full.
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        self._read += len(data)
        return len(data)
