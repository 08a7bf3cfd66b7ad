"""Options that several commands share, and how their values are parsed and printed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

from eurobot_od.cli import complain
from eurobot_od.cli.signature import HelpGroup, Option
from eurobot_od.errors import LocalError
from eurobot_od.od.values import BUS_BIT_RATES, NODE_IDS
from eurobot_od.season import MOST_JOBS
from eurobot_od.support import extras, progress, texts

if TYPE_CHECKING:
    import can

    from eurobot_od.bus.live.buses import Opener
    from eurobot_od.client.master import Guard, Master
    from eurobot_od.od.dcf import ChosenCobIds, Dcf
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.plugin import Plugins
    from eurobot_od.season.campaign import Workers
    from eurobot_od.season.results import Results


# Parsers of values


def positive(text: str, of: str = "") -> float:
    """Parse a positive number; `of` completes the error. Raises LocalError."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < inf:
        raise LocalError(f"{text} is not a positive number{of}")
    return value


def span(text: str) -> float:
    """Parse a time in s: `45`, `45s`, `500 ms`, `1min`; raises LocalError.

    In files the unit is needed, as objects use ms.
    """
    return texts.seconds(f"{text} s" if text[-1:].isdigit() else text)


def span_below(longest: float) -> Callable[[str], float]:
    """Return a parser as `span`, which asks for the unit of a number from `longest` on: ms may be meant."""

    def read(text: str) -> float:
        seconds = span(text)
        if text[-1:].isdigit() and seconds >= longest:
            raise LocalError(f"{text} without a unit would be {text} s; write {text}ms, or {text}s")
        return seconds

    return read


def whole(low: int, high: float = inf, what: str = "") -> Callable[[str], int]:
    """Return a parser for an integer in a range; `what` names it in error messages."""

    def read(text: str) -> int:
        # No option takes 16 digits or more; for thousands, `int` has its own error.
        number = int(text) if text.isdecimal() and len(text) < 16 else -1
        if not low <= number <= high:
            allowed = f"{low}..{high}" if high < inf else f"{low} or more"
            raise LocalError(f"{text} is not {what}; allowed: {allowed}" if what else f"{text} is not in {allowed}")
        return number

    return read


def bit_rate(text: str) -> int:
    """Parse a bit rate in bit/s, such as `500000`, `500k` or `1M`; raises LocalError."""
    factor = {"k": 1000, "M": 1_000_000}.get(text[-1:])
    digits = text[:-1] if factor else text
    rate = int(digits) * (factor or 1) if digits.isdecimal() and len(digits) < 16 else 0
    if rate not in BUS_BIT_RATES:
        raise LocalError(f"{text} is not in 1000..1000000 bit/s, such as 500000 or 500k")
    return rate


def assigned(form: str) -> Option:
    """Return an option with values of the `form` NAME=VALUE, split at the first equals sign."""

    def read(text: str) -> tuple[str, str]:
        name, equals, value = text.partition("=")  # the first one, as a value may contain more
        if not equals:
            raise LocalError(f"{text}: write {form}")
        return name, value

    return Option(metavar=form, read=read)


def listed(text: str) -> tuple[str, ...]:
    """Parse names or numbers separated by commas."""
    return tuple(each.strip() for each in text.split(","))


# Options

BIT_RATE = 500_000
"""Default bit rate in bit/s."""

LONG_PERIOD, LONG_WAIT, LONG_RUN = 10.0, 100.0, 1000.0
"""Times in s from which on a number needs its unit: of a period, a wait, a whole run."""

Moment: TypeAlias = Annotated[float, Option(metavar="TIME", read=span)]
Wait: TypeAlias = Annotated[float, Option(metavar="TIME", read=span_below(LONG_WAIT))]
Seconds: TypeAlias = Annotated[float, Option(metavar="TIME", read=span_below(LONG_RUN))]
BitRate: TypeAlias = Annotated[int, Option("-b", read=bit_rate)]
Json: TypeAlias = Annotated[bool, Option("--json"), "print as JSON"]
Output: TypeAlias = Annotated[Path | None, Option("-o", metavar="FILE", is_output=True), "default: standard output"]
NoReconnect: TypeAlias = Annotated[bool, "end when the bus is lost, instead of opening it again"]
Faults: TypeAlias = Annotated[
    Sequence[str], Option(metavar="[NODE.]NAME", suggest=lambda plugins: plugins.fault_names())
]
EmcyFiles: TypeAlias = Annotated[
    Sequence[str],
    Option(metavar="[NODE-ID=]FILE", is_file=True),
    "a maker's words for emergency error codes (YAML), of one node or of all; repeatable",
]


def _interfaces(_: Plugins) -> Iterable[str]:
    from can.interfaces import BACKENDS  # here, as importing it takes longer than most commands

    return BACKENDS


@dataclass(frozen=True, kw_only=True)
class BusOptions:
    """A CAN bus; None is taken from python-can's own configuration.

    interface: python-can interface, such as socketcan, pcan, slcan, remote
    channel: channel of the interface, such as can0
    bitrate: bit/s, 500000 if nothing else is configured
    """

    GROUP = HelpGroup("bus", "default: python-can's configuration")

    interface: Annotated[str | None, Option("-i", suggest=_interfaces)] = None
    channel: Annotated[str | None, Option("-c")] = None
    bitrate: BitRate | None = None

    @property
    def is_given(self) -> bool:
        """Whether the command line says anything of a bus."""
        return any(vars(self).values())

    @property
    def words(self) -> str:
        """The bus in words: interface, channel, bit rate as far as they are given, here or in the configuration."""
        from eurobot_od.bus import live

        named = live.named(vars(self))
        rate = f"at {named['bitrate']} bit/s" if "bitrate" in named else ""
        return " ".join([*(str(named[key]) for key in ("interface", "channel") if key in named), rate]).strip()

    def check_named(self, instead: str = "") -> None:
        """Check that a bus is named; raises LocalError, which is clearer than python-can's and ends with `instead`."""
        from eurobot_od.bus import live  # here, as importing it takes longer than a command for files

        if not live.is_named(self.interface):
            here = ", ".join(map(str, live.here())) or "none (`doctor` says more)"
            raise LocalError(f"which bus? Name it by -i and -c, such as -i socketcan -c can0; here: {here}{instead}")

    def open(self) -> can.BusABC:
        """Open the bus; raises LocalError, BusError."""
        self.check_named()
        from eurobot_od.bus import live

        return live.open_bus(self.interface, self.channel, self.bitrate)

    def reopener(self, no_reconnect: bool) -> Opener | None:
        """Return a function that opens the bus again when it is lost, None if it is not to be opened again."""
        return None if no_reconnect else self.open

    def guard(self, master: Master, no_reconnect: bool) -> Guard:
        """Return what opens a master's bus again when it is lost; with `no_reconnect`, a lost bus ends the command."""
        from eurobot_od.client.master import Reconnecting, unguarded

        # `complain` writes to standard error, as standard output may be JSON.
        return unguarded if no_reconnect else Reconnecting(master, self.open, complain)


@dataclass(frozen=True, kw_only=True)
class FrameNames:
    """Files that describe frames, besides those of the devices and the network file.

    dbc: DBC, KCD, SYM or ARXML that names frames of other protocols on the bus; repeatable
    """

    emcy: EmcyFiles = ()
    dbc: Annotated[Sequence[str], Option(metavar="FILE", is_file=True)] = ()


NOTHING_NAMED = FrameNames()


@dataclass(frozen=True, kw_only=True)
class Clone:
    """What to do with COB-IDs in another node's DCF that do not follow its node-ID.

    keep_cob_ids: of another node's DCF: keep its COB-IDs that do not follow the node-ID
    move_cob_ids: of another node's DCF: move them by the distance of the two node-IDs
    """

    keep_cob_ids: Annotated[bool, Option(either="cob-ids")] = False
    move_cob_ids: Annotated[bool, Option(either="cob-ids")] = False

    @property
    def chosen(self) -> ChosenCobIds | None:
        """The choice, None if there is none."""
        from eurobot_od.od.dcf import ChosenCobIds  # here, as most commands write no DCF

        if self.keep_cob_ids:
            return ChosenCobIds.KEEP
        return ChosenCobIds.MOVE if self.move_cob_ids else None


@dataclass(frozen=True, kw_only=True)
class OneDevice:
    """Modules and patches for the file of a device.

    module: modules that are plugged into the device, in their order: numbers or names, such as 1,1,3
    patch: patch over the file: objects in YAML, or a DCF's values; repeatable
    """

    module: Annotated[tuple[str, ...] | None, Option(metavar="MODULES", read=listed)] = None
    patch: Annotated[Sequence[str], Option(metavar="FILE", is_file=True)] = ()

    def load(self, file: str) -> Dictionary:
        """Read a device's file, `FILE` or `NODE-ID=FILE`, by default for any node-ID; raises DictionaryError."""
        from eurobot_od.od.dictionary import Dictionary  # here, as it imports canopen
        from eurobot_od.od.network import node_file

        named = node_file(file)
        node_id = named.node_id or NODE_IDS[0]
        return Dictionary.load(named.file, node_id, modules=self.module, patch=self.patch)

    def refuse(self, reason: str) -> None:
        """Refuse modules and patches, for this reason, if there are any; raises LocalError."""
        if self.module or self.patch:
            raise LocalError(f"--module and --patch are for one device's file: {reason}")


# Output


def give(as_json: bool, data: object, lines: Iterable[str], indent: int | None = 2) -> None:
    """Print data as JSON, or lines; iterators that are not printed are not evaluated."""
    if as_json:
        import json  # here, as printing lines does not need it

        print(json.dumps(data, indent=indent, default=list))
    else:
        sys.stdout.writelines(f"{line}\n" for line in lines)


def write(output: Path | None, text: str) -> None:
    """Write a text; if that fails, raises OSError and keeps the file's old content."""
    if output is None:
        sys.stdout.write(text)
    else:
        from eurobot_od.support.files import write_whole  # here, as it imports `tempfile`

        write_whole(output, texts.encodable(text).encode())


def write_dcf(output: Path | None, dcf: Dcf) -> None:
    """Write a DCF and the files that belong to it; raises as `write`, LocalError for such files without `output`."""
    if output is not None:
        dcf.write(output)
    elif dcf.files:
        raise LocalError(f"the DCF needs files beside it ({', '.join(dcf.files)}): write it by -o FILE")
    else:
        sys.stdout.flush()  # text that was printed before must come before these bytes
        sys.stdout.buffer.write(dcf.content)


Thing = TypeVar("Thing")

Jobs: TypeAlias = Annotated[int, Option(metavar="N", read=whole(1, MOST_JOBS, "a number of processes"))]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """How many jobs run in parallel, and where their results are kept.

    jobs: processes (default: one per core)
    executor: use the workers of a Dask scheduler instead
    results: keep all results in this folder, as Parquet
    resume: continue the run whose results are in that folder
    """

    jobs: Jobs | None = None
    executor: Annotated[str | None, Option(metavar="dask://HOST:PORT")] = None
    results: Annotated[Path | None, Option(metavar="FOLDER")] = None
    resume: bool = False

    def refuse(self, option: str) -> None:
        """Refuse these options without another one; raises LocalError."""
        for name, value in vars(self).items():
            if value:
                raise LocalError(f"--{name} goes with {option} only")

    @contextmanager
    def workers(self, things: int) -> Iterator[Workers]:
        """Yield the workers for a number of jobs; raises LocalError."""
        from eurobot_od.season import campaign  # here, as it imports `multiprocessing`

        if self.executor and self.jobs:
            raise LocalError("--jobs is for processes of this machine, and does not go with --executor")
        with ExitStack() as stack:
            # Only here, as an import error in a job is a bug.
            with extras.needed("cluster"):
                found = stack.enter_context(campaign.workers(self.executor, self.jobs, things))
            yield found

    def kept(self, record: type[Thing], settings: Callable[[], Mapping[str, Any]]) -> Results[Thing] | None:
        """Return the store for results, None if they are not kept; raises LocalError."""
        if self.results is None:
            if self.resume:
                raise LocalError("--resume needs --results: the folder of the run to continue")
            return None
        with extras.needed("cluster"):
            from eurobot_od.season.results import Results
        return Results(self.results, record, settings(), self.resume)


def counted(things: Iterable[Thing], number: int, what: str, workers: Workers, hidden: bool = False) -> Iterable[Thing]:
    """Yield the things and show the progress, unless it is `hidden`."""
    # At most as many workers as things, for the estimate of the time left.
    return things if hidden else progress.counted(things, number, what, min(workers.number, number))
