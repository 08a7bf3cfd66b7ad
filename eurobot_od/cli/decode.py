"""Commands on logs: `decode`, `compare` and `replay`."""

from __future__ import annotations

import io
import json
import os
import re
import stat
import sys
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import inf
from typing import Annotated, Any, BinaryIO, TypeAlias

from eurobot_od.cli import ExitStatus, complain, options
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import (
    NOTHING_NAMED,
    BitRate,
    BusOptions,
    FrameNames,
    Json,
    Moment,
    Wait,
    assigned,
    positive,
    whole,
)
from eurobot_od.cli.signature import HelpGroup, Option, bus_named
from eurobot_od.errors import FileError, LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od.values import Address
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support import files, progress
from eurobot_od.support.texts import amount, one_line
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import Decoding, Output, TextOutput
from eurobot_od.traffic.entries import LARGEST, LogEntry
from eurobot_od.traffic.filters import Wanted, Window, by_name, by_node, by_value
from eurobot_od.traffic.formats import FORMATS
from eurobot_od.traffic.meaning import Decoder

STANDARD_INPUT = "-"
CHUNK = 1 << 16
"""Size of one read from a pipe, in bytes."""

Log: TypeAlias = Annotated[str, Option(metavar="LOG", is_file=True)]
Logs: TypeAlias = Annotated[Sequence[Log], "logs; - for standard input, the default"]
Format: TypeAlias = Annotated[str, Option(choices=FORMATS.keys())]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How logs are read: their format (None: detect it), and the longest line or record.

    format: format of the logs (default: by their first bytes, or else by suffix)
    largest: longest line or record of a log that is read (default: 1048576)
    """

    format: Format | None = None
    largest: Annotated[int, Option(metavar="BYTES", read=whole(1024, what="a number of bytes"))] = LARGEST

    @property
    def given(self) -> Mapping[str, bool]:
        """The options by name, and whether they are given."""
        return {"format": self.format is not None, "largest": self.largest != LARGEST}


def entries(
    logs: Iterable[str], reading: Reading, is_watched: bool = True
) -> Generator[tuple[str, LogEntry], None, None]:
    """Yield the entries of several logs, each with the log's name; raises as `formats.entries`.

    With `is_watched`, a terminal shows the progress of a long log.
    """
    for log in logs:
        with opened(log, is_watched) as file:
            for entry in formats.entries(file, reading.format, reading.largest):
                yield log, entry


@contextmanager
def opened(log: str, is_watched: bool = True) -> Iterator[io.BufferedReader]:
    """Open a log; with `is_watched`, a terminal shows the progress of a long one."""
    with ExitStack() as stack:
        if log == STANDARD_INPUT:
            if sys.stdin is None:
                raise LocalError("standard input is closed")
            file: BinaryIO = sys.stdin.buffer
        else:
            file = stack.enter_context(files.opened(log, buffering=0))  # `Watched` is buffered below
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            # A pipe may be a live bus, so the output is flushed before each read.
            yield io.BufferedReader(Watched(file, lambda _: sys.stdout.flush()), CHUNK)
        elif is_watched and sys.stderr.isatty():
            draw = stack.enter_context(progress.bar(log, late=True))
            yield io.BufferedReader(Watched(file, lambda done: draw(done, status.st_size)))
        else:
            yield io.BufferedReader(
                Watched(file, lambda _: None)
            )  # the same class in all cases, so that formats behave the same
        if stat.S_ISREG(status.st_mode) and not status.st_size:
            complain(f"{log}: the file is empty")


def check_logs(logs: Iterable[str]) -> None:
    """Check that all logs are there, before anything is printed of the first; raises FileError."""
    # Not opened here, as a pipe can be opened once only.
    for log in logs:
        if log != STANDARD_INPUT and not (os.path.exists(log) and not os.path.isdir(log)):  # noqa: PTH110, PTH112
            try:
                files.opened(log).close()
            except FileError as error:
                if advice := _not_a_log(log):
                    error.add_note(advice)
                raise


CANDUMP_FILTER = re.compile(r"[0-9A-Fa-f]{3,8}[:~][0-9A-Fa-f]{3,8}")
"""A filter on candump's command line, in place of a log."""


def _not_a_log(word: str) -> str:
    """Return what to write for a word that was taken for a log; empty if its meaning is unknown."""
    if CANDUMP_FILTER.fullmatch(word):
        identifier = re.split("[:~]", word)[0]
        return f"a filter is --message, --node or --where; monitor has --filter {identifier}"
    return bus_named(word) or ""


def check_source(
    logs: Sequence[str], bus: BusOptions, *, of_a_bus: Mapping[str, object], of_a_log: Mapping[str, object]
) -> None:
    """Refuse options of a bus where logs are read, and those of logs on a bus, by name and whether they are given.

    The bit rate is also that of the logs. Raises LocalError.
    """
    given = next((name for name, is_given in (of_a_bus if logs else of_a_log).items() if is_given), None)
    if logs and (bus.interface or bus.channel):
        raise LocalError(f"a log or a bus, not both: leave out -i and -c, or {', '.join(logs)}")
    if given and logs:
        raise LocalError(f"--{given} is for a bus: leave it out, or {', '.join(logs)}")
    if given:
        raise LocalError(f"--{given} is for a log: name one, or leave it out")


def decoder_for(logs: Iterable[str], reading: Reading, devices: Devices, names: FrameNames = NOTHING_NAMED) -> Decoder:
    """Return the decoder for logs, with the library's files for devices whose identity is in the logs.

    Raises FileError for a log that is not there, and as `Devices.decoder`.
    """
    shown: dict[int, dict[Address, int]] = {}
    if devices.known_library.entries:
        from eurobot_od.traffic.identities import shown_in

        for log in filter(os.path.isfile, logs):  # a pipe can be read once only
            with opened(log, is_watched=False) as file:
                shown = shown_in(file, reading.format, reading.largest) | shown
    decoder = devices.decoder(names, shown)
    check_logs(logs)
    return decoder


class Watched(io.RawIOBase):
    """A file or pipe that calls `on_read` before each read with the number of bytes read so far."""

    def __init__(self, file: BinaryIO, on_read: Callable[[int], object]) -> None:
        self.name = file.name
        self._descriptor = file.fileno()
        self._on_read = on_read
        self._read = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return stat.S_ISREG(os.fstat(self._descriptor).st_mode)

    def readinto(self, buffer: Any) -> int:
        self._on_read(self._read)
        # Returns the data that a pipe has now; a buffered file would wait for a full buffer.
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        self._read += len(data)
        return len(data)


@dataclass(frozen=True, kw_only=True)
class Filters:
    """Which entries are shown: names of messages and nodes, conditions on fields.

    message: message or service by name (`Goto XY`, goto-xy, SDO), or a protocol: GTP, ELP, GIP, CANopen; repeatable
    node: messages that this node sends or receives; repeatable
    where: condition on a field: `x>1000`, `Goto XY.speed<=20`, `team_colour=red`, `time=unknown`; repeatable
    """

    GROUP = HelpGroup("filters", "an entry has to pass all that are given")

    message: Annotated[Sequence[str], Option(metavar="NAME")] = ()
    node: Annotated[Sequence[str], Option(metavar="NAME", suggest=lambda plugins: plugins.robot.nodes)] = ()
    where: Annotated[Sequence[str], Option(metavar="CONDITION")] = ()

    def wanted(self, decoder: Decoder) -> Wanted | None:
        """Return the filter, None if there is none; raises LocalError for an unknown name or impossible value."""
        wanted: list[Wanted] = [by_value(text, decoder.protocol) for text in self.where]
        if self.message:
            wanted.append(by_name(self.message, decoder))
        if self.node:
            wanted.append(by_node(self.node, [each.name for each in decoder.dictionaries]))
        return (lambda meaning: all(each(meaning) for each in wanted)) if wanted else None


def decode(
    logs: Logs = (STANDARD_INPUT,),
    *,
    reading: Reading,
    as_json: Annotated[Json, Option(either="form")] = False,
    as_csv: Annotated[bool, Option("--csv", either="form")] = False,
    filters: Filters,
    since: Moment = 0.0,
    until: Moment = inf,
    relative: bool = False,
    statistics: Annotated[bool, Option(either="form")] = False,
    bitrate: BitRate | None = None,
    strict: bool = False,
    devices: Devices,
    names: FrameNames,
) -> ExitStatus:
    """Decode logs of a CAN bus: messages with their fields and units, CANopen services, and whatever is wrong.

    Lines go to standard output, progress and the report to standard error.

    as_json: one JSON object per line
    as_csv: comma-separated values
    since: from this time on, such as 10.5 or 1min
    until: up to this time
    relative: count the time from a log's first entry
    statistics: print load, gaps, jitter, response times and their bounds instead of lines
    bitrate: bit/s for --statistics (default: 500000)
    strict: exit status 1 if anything is wrong in the logs, or no frame is in one

    $ decode run.log --eds 5=motor.eds
    $ decode run.log --statistics
    """
    if bitrate and not statistics:
        raise LocalError("--bitrate is for --statistics")
    if since > until:
        raise LocalError(f"--since {since:g} s is after --until {until:g} s: no entry is between them")
    decoder = decoder_for(logs, reading, devices, names)
    several = len(logs) > 1
    if statistics:
        from eurobot_od.traffic.statistics import TrafficOutput  # here, as decoding does not need it

        output: Output = TrafficOutput(bitrate or options.BIT_RATE, devices.promised(decoder), several)
    else:
        output = _output(decoder, as_json, as_csv, several)
    decoding = Decoding(decoder, output, filters.wanted(decoder), Window(since, until, relative))
    sys.stdout.write(output.header)
    for log in logs:
        # No bar while lines are printed on the same terminal.
        with opened(log, is_watched=statistics or not sys.stdout.isatty()) as file:
            sys.stdout.writelines(decoding.lines(file, log, reading.format, reading.largest))
    sys.stdout.flush()  # so that the report comes after the lines, even in one file
    sys.stderr.writelines(f"{line}\n" for line in decoding.damage.report())
    for log in decoding.silent:
        if log == STANDARD_INPUT or os.stat(log).st_size:  # noqa: PTH116  # an empty file is told where it is opened
            complain(f"no frame is in {log}")
    return ExitStatus.FOUND if strict and (decoding.damage.total or decoding.silent) else ExitStatus.FINE


def _output(decoder: Decoder, as_json: bool, as_csv: bool, several: bool) -> Output:
    if not (as_json or as_csv):
        return TextOutput(several)
    from eurobot_od.traffic.decoding import CsvOutput, JsonOutput

    fields = (field for each in decoder.protocol.bindings for field in each.kinds)
    signals = (signal for each in decoder.others.values() for signal in each.units)
    return JsonOutput() if as_json else CsvOutput((*fields, *signals))


def compare(
    first: Log,
    second: Log,
    *,
    reading: Reading,
    time: Wait = 0.001,
    tolerance: Annotated[Sequence[tuple[str, str]], assigned("[MESSAGE.]FIELD=NUMBER")] = (),
    as_json: Json = False,
    filters: Filters,
    devices: Devices,
    names: FrameNames,
) -> ExitStatus:
    """Compare two logs that should be the same: which frames are missing, extra or late, or have other values.

    Exit status 1 if they differ: a regression test for a node's program.

    first: the expected log
    second: the log to compare with it
    time: tolerance of times (1 ms)
    tolerance: tolerance of a field, such as x=5 or 'Goto State Response.time=20'; repeatable
    as_json: one JSON object per difference

    $ compare run.log again.log
    $ compare run.log again.log --eds 5=motor.eds
    """
    from eurobot_od.traffic.compare import ComparedEntry, Tolerances
    from eurobot_od.traffic.compare import compare as differences_of
    from eurobot_od.traffic.decoding import TrackingDecoder

    decoder = decoder_for([first, second], reading, devices, names)
    fields = tolerances(tolerance, decoder.protocol)
    wanted = filters.wanted(decoder)

    def seen(log: str) -> Iterator[ComparedEntry]:
        following = TrackingDecoder(decoder)
        for _, (_, at, channel, raw) in entries([log], reading):
            decode = following.at(at, channel, raw)
            if wanted is None or wanted(decode(raw)):
                yield ComparedEntry(at, raw, channel, decode)

    # Both are read completely, as the offset of their clocks is computed from frames of both.
    expected, found = list(seen(first)), list(seen(second))
    if all(len({each.channel for each in log}) < 2 for log in (expected, found)):  # one bus, under any name
        expected, found = ([each._replace(channel="") for each in log] for log in (expected, found))
    differences = differences_of(expected, found, decoder, Tolerances(time, fields))
    for each in differences:
        channel = f"{one_line(each.channel)}  " if each.channel else ""
        data = {key: value for key, value in each._asdict().items() if key != "channel" or value}
        line = f"{each.time:13.6f}  {channel}{each.kind.value:<8} {each.name:<29} {each.text}".rstrip()
        print(json.dumps(data | {"kind": each.kind.value}) if as_json else line)
    if not as_json:
        kinds = Counter(each.kind.value for each in differences)
        counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no difference"
        print(f"{len(expected)} and {len(found)} frames: {counts}")
    return ExitStatus.FOUND if differences else ExitStatus.FINE


def tolerances(given: Iterable[tuple[str, str]], protocol: Protocol) -> dict[tuple[str, str], float]:
    """Return the tolerances by message and field; raises UnknownName, LocalError."""
    found: dict[tuple[str, str], float] = {}
    for name, text in given:
        number = _number(name, text)
        message, _, field = name.rpartition(".")
        bindings = [protocol.binding(message)] if message else protocol.bindings
        having = [each.name for each in bindings if field in each.kinds]
        if not having:
            raise UnknownName("field", name, dict.fromkeys(field for each in bindings for field in each.kinds))
        found |= dict.fromkeys(((each, field) for each in having), number)
    return found


def _number(name: str, text: str) -> float:
    """Parse the tolerance of a field; raises LocalError."""
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < inf:  # `float` accepts "nan" and "inf"
        with_unit = "; it is in the unit of the field, and has none itself" if text[:1].isdigit() else ""
        raise LocalError(f"--tolerance {name}={text}: not a number, 0 or more{with_unit}")
    return number


def replay(
    logs: Logs = (STANDARD_INPUT,),
    *,
    reading: Reading,
    speed: Annotated[float, Option(metavar="N", read=positive)] = 1.0,
    only: Annotated[Sequence[str], Option(metavar="NODE", either="sender")] = (),
    without: Annotated[Sequence[str], Option("--except", metavar="NODE", either="sender")] = (),
    devices: Devices,
    bus: BusOptions,
) -> None:
    """Replay a log onto a bus with its recorded timing, so that one real node meets yesterday's others.

    `--except drive` leaves out what the drive sent in the log: the drive on the bus sends it itself.

    speed: how many times faster (default: 1)
    only: only frames that this node sent; repeatable
    without: no frames that this node sent; repeatable

    $ replay run.log -i socketcan -c can0
    $ replay run.log --speed 10 -i socketcan -c can0
    """
    from eurobot_od.client.master import LATE, Master  # here, as decoding does not need it
    from eurobot_od.client.master import replay as replay_frames
    from eurobot_od.traffic.filters import by_sender

    decoder = decoder_for(logs, reading, devices)
    wanted = by_sender(decoder.dictionaries, decoder.protocol, only, without)
    # Other entries of a log are no frames.
    timed = ((at, raw) for _, (_, at, _, raw) in entries(logs, reading) if isinstance(raw, Frame) and wanted(raw))
    with Master(bus.open()) as master:
        frames, late, worst = replay_frames(master, timed, speed)
    print(
        f"{amount(frames, 'frame')} sent, {late} of them later than {LATE * 1000:g} ms, {worst * 1000:.1f} ms at most"
    )
