"""Say what is wrong on a bus, or in logs, and what to do: `diagnose`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from datetime import UTC, datetime, timedelta
from math import inf
from pathlib import Path
from typing import Annotated, NamedTuple

from eurobot_od.bus.live import BITRATE
from eurobot_od.cli import ExitStatus, version
from eurobot_od.cli.decode import Log, Reading, check_source, decoder_for, opened
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions, FrameNames, Json, NoReconnect, Seconds, give, write
from eurobot_od.cli.signature import Option
from eurobot_od.export.forms import FORMS, DocBlock, DocHeading, DocTable, Paragraph, form_of
from eurobot_od.lint.findings import LEVELS
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.support import texts
from eurobot_od.traffic import formats
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.diagnosis.incidents import Incident, lines
from eurobot_od.traffic.diagnosis.questions import Questions
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.monitor import CLOCK_SET, BusSource

WORDS = (*LEVELS.values(), "never")
"""Choices of `--fail-on`, worst first."""

POLL = 0.02
"""Time between two reads of a bus, in s."""

LOOK = 0.5
"""Time between two searches for nodes to ask, in s."""

SEND_WAIT = 1.0
"""Maximum time for the driver to accept a request, in s."""

BEHIND = 0.5
"""Maximum delay between a frame and its diagnosis that is not reported, in s."""


def diagnose(
    logs: Sequence[Log] = (),
    *,
    reading: Reading,
    duration: Annotated[Seconds, Option("--for")] = inf,
    as_json: Json = False,
    report: Annotated[Path | None, Option(metavar="FILE", is_output=True)] = None,
    fail_on: Annotated[str, Option(choices=WORDS)] = "warning",
    ask: bool = False,
    no_reconnect: NoReconnect = False,
    devices: Devices,
    names: FrameNames,
    bus: BusOptions,
) -> ExitStatus:
    """Report what is wrong in logs or on a bus: a verdict in one line, then incidents with remedies, worst first.

    Exit status 1 if there is an incident of the level of --fail-on, or worse.

    logs: logs, - for standard input (default: listen to a bus)
    duration: how long to listen to a bus (default: until Ctrl-C)
    report: also write a page: .html or .md
    fail_on: lowest level of an incident that is a failure (default: warning)
    ask: read errors, identity, heartbeat settings and a drive's state of nodes that show trouble, by SDO

    $ diagnose run.log --eds 5=motor.eds
    $ diagnose -i socketcan -c can0 --for 10s
    $ diagnose -i socketcan -c can0 --for 10s --ask
    """
    of_a_bus = {"for": duration < inf, "ask": ask, "no-reconnect": no_reconnect}
    check_source(logs, bus, of_a_bus=of_a_bus, of_a_log=reading.given)
    form = form_of(report) if report else ""  # raises for an unknown suffix before the log is read
    decoder = decoder_for(logs, reading, devices, names)
    diagnosis = Diagnosis(decoder, devices.watchers, bus.bitrate or BITRATE, devices.promised(decoder))
    asking = _Asking(diagnosis) if ask else None
    began = datetime.now(UTC).astimezone()
    if logs:
        _read(diagnosis, logs, reading)
    else:
        _listen(diagnosis, bus, duration, no_reconnect, asking)
    found = diagnosis.incidents.sorted()
    found = asking.answered(found) if asking else found
    said = diagnosis.verdict(found)
    data = {"verdict": said, "frames": diagnosis.frames, "incidents": [each.as_data() for each in found]}
    give(as_json, data, [said, *lines(found)], indent=None)
    if report:
        run = ReportedRun(", ".join(Path(each).name for each in logs), bus.words, began, decoder.dictionaries)
        write(report, FORMS[form](list(blocks(run, said, found, diagnosis))))
    reached = WORDS[WORDS.index(LEVELS[found[0].rule.severity]) : -1] if found else ()
    return ExitStatus.FOUND if fail_on in reached else ExitStatus.FINE


def _read(diagnosis: Diagnosis, logs: Sequence[str], reading: Reading) -> None:
    for log in logs:
        before = diagnosis.frames
        diagnosis.begin(log)
        with opened(log) as file:
            for line, at, channel, raw in formats.entries(file, reading.format, reading.largest):
                diagnosis.take(at, channel, raw, line)
        if diagnosis.frames == before:
            diagnosis.silent(log)
    diagnosis.end()


class _Asking:
    """Asks nodes of a bus that show trouble; `is_done` when all of them have been asked."""

    def __init__(self, diagnosis: Diagnosis) -> None:
        self._diagnosis = diagnosis
        self._questions: Questions | None = None
        self._look_at, self._was_last_look = 0.0, False

    @property
    def is_done(self) -> bool:
        return self._questions is None or (self._was_last_look and not self._questions.is_busy)

    def take(self, time: float, meaning: Meaning) -> None:
        """Take a frame of the bus."""
        self._questions = self._questions or self._diagnosis.questions("")
        if self._questions:
            self._questions.take(time, meaning)

    def send(self, time: float, source: BusSource, is_last: bool) -> None:
        """Send the requests that are due at a time in s; raises BusError.

        `is_last` searches for trouble once more.
        """
        if self._questions is None:
            return
        if time >= self._look_at or is_last > self._was_last_look:
            self._look_at, self._was_last_look = time + LOOK, is_last
            self._questions.look(time, self._diagnosis.so_far(time))
        for frame in self._questions.due(time):
            source.send(frame, SEND_WAIT)

    def answered(self, found: list[Incident]) -> list[Incident]:
        """Return incidents with the answers of their nodes."""
        return list(self._questions.answered(found)) if self._questions else found


def _listen(
    diagnosis: Diagnosis, bus: BusOptions, duration: float, no_reconnect: bool, asking: _Asking | None = None
) -> None:
    """Listen to a bus until the time is over, or Ctrl-C; losses in the driver are incidents."""
    with closing(BusSource(bus.open(), opener=bus.reopener(no_reconnect))) as source, suppress(KeyboardInterrupt):
        began = time.monotonic()
        origin = None
        now = 0.0
        behind = 0.0
        while (now := time.monotonic() - began) < duration or (asking and not asking.is_done):
            behind = 0.0
            for at, raw in source.poll():
                origin = at - now if origin is None else origin  # the driver's clock may start anywhere
                behind = max(now - (at - origin), 0.0)
                meaning = diagnosis.take(max(at - origin, 0.0), "", raw)
                if asking:
                    asking.take(max(at - origin, 0.0), meaning)
            diagnosis.tick(now - behind)  # frames that are not read yet are not late
            if asking:
                asking.send(now - behind, source, now >= duration)
            time.sleep(min(POLL, duration - now) if now < duration else POLL)
    if not diagnosis.frames:
        diagnosis.silent()
    diagnosis.end(now - behind)
    diagnosis.missed(each for each in source.notes if not each.startswith(CLOCK_SET.partition("{")[0]))
    if behind > BEHIND:
        diagnosis.missed([f"the last {texts.text(behind, 1)} of the bus: this computer was behind by that"])


# The page


UNIX_TIME = 1e9
"""From this number of seconds on (the year 2001) a log's time is Unix time."""


class ReportedRun(NamedTuple):
    """What a report is about: the names of its logs, or else a bus, when the run `began`, and who is who."""

    logs: str
    bus: str
    began: datetime
    nodes: Sequence[Dictionary]

    def clock(self, time: float) -> str:
        """Return the wall-clock time of a time in s on the bus; empty if a log does not tell."""
        if self.logs and time < UNIX_TIME:
            return ""
        at = datetime.fromtimestamp(time, UTC).astimezone() if self.logs else self.began + timedelta(seconds=time)
        return at.isoformat(" ", "milliseconds")

    def facts(self, diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
        """Yield what somebody else has to know of the run."""
        yield ("Logs", self.logs) if self.logs else ("Bus", self.bus)
        yield "Begins", self.clock(diagnosis.first or 0.0) or "the log does not tell"
        yield from (("Frames", str(diagnosis.frames)), ("Time", f"{diagnosis.seconds:.1f} s"))
        yield from (("Reported", self.began.isoformat(" ", "seconds")), ("Made by", version()))

    def row(self, incident: Incident, begin: float) -> tuple[str, ...]:
        """Return the row of an incident in the table; `begin` is the time of the first frame in s."""
        seen, first = incident.seen, incident.seen.places[0].time
        level = LEVELS[incident.rule.severity]
        return level, incident.title, str(seen.number), f"{max(first - begin, 0.0):.3f}", self.clock(first)


def blocks(run: ReportedRun, verdict: str, incidents: Sequence[Incident], diagnosis: Diagnosis) -> Iterator[DocBlock]:
    """Yield the report: the verdict, who is who, all incidents in a table, and each of them."""
    yield DocHeading(1, f"Diagnosis of {run.logs or run.bus}")
    yield Paragraph(f"{verdict}.")
    yield DocTable(("", ""), [*run.facts(diagnosis)])
    if run.nodes:
        yield DocHeading(2, "Who is who")
        who = [(str(each.node_id), each.name, each.file.name, str(Identity.of(each))) for each in run.nodes]
        yield DocTable(("Node-ID", "Name", "File", "Identity in the file (0x1018)"), who, ("Node-ID",))
    if incidents:
        yield DocHeading(2, "What was found")
        rows = [run.row(each, diagnosis.first or 0.0) for each in incidents]
        titles = "Level", "What", "Times", "First, s since the begin", "Clock"
        yield DocTable(titles, rows, titles[2:4], ("Level", "Clock"))
    for each in incidents:
        yield DocHeading(3, f"{LEVELS[each.rule.severity].capitalize()}: {each.title}")
        yield DocTable(("", ""), each.facts)
