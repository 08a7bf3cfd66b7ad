"""What lives long and is disturbed at any moment: operations and faults in any order, one invariant each."""

from __future__ import annotations

import errno
import re
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from tests.kit import lift
from tests.kit.lift import CATALOGUE

pytest.importorskip("pyarrow", reason="the extra `season` is not installed")
pytest.importorskip("polars", reason="the extra `season` is not installed")

import pyarrow.parquet as pq

from eurobot_od.bus.live import Driver
from eurobot_od.bus.live.buses import Connection
from eurobot_od.client.program import load
from eurobot_od.device.objects import FileStore
from eurobot_od.errors import BusError, DictionaryError, ProgramError
from eurobot_od.od.values import Address, Value
from eurobot_od.season.archive import BEGUN, Archived, DecodedNetwork, archive
from eurobot_od.support import connections
from tests.client.flash import NODE_ID, FlashDevice, Trouble
from tests.client.wired import wired

NETWORK = DecodedNetwork(tuple(lift.dictionaries()), CATALOGUE)

EXAMPLES = settings().max_examples
FEW = settings(max_examples=EXAMPLES // 4, stateful_step_count=12)
MANY = settings(max_examples=EXAMPLES * 3, stateful_step_count=25)
"""For machines of which a step takes long, and for others."""


class StoredSettings(RuleBasedStateMachine):
    """A device's file has what was saved last, whatever went wrong with a later saving; damage is refused by name."""

    CABIN = lift.dictionary("cabin")
    VALUES = st.fixed_dictionaries(
        {}, optional={(0x2101, 1): st.integers(1, 1000), (0x1017, 0): st.integers(0, 0xFFFF), (0x2100, 1): st.just(9)}
    )

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory()
        self._file = Path(self._folder.name, "cabin.dcf")
        self._saved: dict[Address, Value] = {}
        self._damaged = False

    @property
    def store(self) -> FileStore:
        """What a device has that was just switched on."""
        return FileStore(self._file, self.CABIN)

    @rule(values=VALUES)
    def save(self, values: dict[Address, Value]) -> None:
        self.store.save(values, 2)
        self._saved, self._damaged = values, False

    @rule(values=VALUES, number=st.sampled_from([errno.ENOSPC, errno.EIO]))
    def save_on_a_full_disk(self, values: dict[Address, Value], number: int) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("eurobot_od.support.files.os.fsync", failing(OSError(number, "no")))
            with pytest.raises(OSError, match="no"):
                self.store.save(values, 2)

    @rule(values=VALUES)
    def be_killed_while_saving(self, values: dict[Address, Value]) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Path, "replace", failing(KeyboardInterrupt()))
            patch.setattr(Path, "unlink", lambda *_, **__: None)  # nobody clears up after SIGKILL
            with suppress(KeyboardInterrupt):
                self.store.save(values, 2)

    @rule()
    def save_what_has_no_place(self) -> None:
        with pytest.raises(DictionaryError):
            self.store.save({(0x5FFF, 0): 1}, 2)

    @precondition(lambda self: self._file.exists())
    @rule(data=st.data())
    def flip_a_bit(self, data: st.DataObject) -> None:
        content = bytearray(self._file.read_bytes())
        values = [match.end() - 1 for match in re.finditer(rb"ParameterValue=\w+", content)]
        position = st.sampled_from(values) if values else st.integers(content.index(b"\n") + 1, len(content) - 1)
        content[data.draw(position)] ^= 1 << data.draw(st.integers(0, 2))  # mostly a digit becomes another one
        self._damaged = True
        self._file.write_bytes(content)

    @invariant()
    def the_file_has_what_was_saved_or_is_refused(self) -> None:
        try:
            found = self.store.load()
        except DictionaryError as error:
            refusal = str(error)
        else:
            refusal = ""
            assert found == self._saved
        assert not refusal or (self._damaged and str(self._file) in refusal)

    def teardown(self) -> None:
        self._folder.cleanup()


def failing(error: BaseException) -> Any:
    """A function that raises."""

    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


class CountingBus(VirtualBus):
    """A bus whose driver counts what it has lost; a new one counts from 0."""

    lost = 0


class LostConnection(RuleBasedStateMachine):
    """A bus that fails, opens and works in any order: each loss is reported once and ended once, no frame uncounted."""

    def __init__(self) -> None:
        super().__init__()
        self._patch = pytest.MonkeyPatch()
        self._patch.setattr(connections, "FIRST_PAUSE", 0.0)
        self._patch.setattr(connections, "LONGEST_PAUSE", 0.0)
        self._patch.setattr(Driver, "overflow", property(lambda driver: driver.bus.lost))
        self._now, self._refusals, self._lost_frames, self._away = 0.0, 0, 0, 0.0
        self._lost_at: float | None = None
        self.closed, self.said = False, list[str]()
        driver = Driver(CountingBus("machine"))
        self.connection = Connection(driver, self._open, lambda: self._now, self._lose, self._opened, self._come_back)

    def _open(self) -> can.BusABC:
        if self._refusals:
            self._refusals -= 1
            raise BusError("not yet")
        return CountingBus("machine")

    def _opened(self) -> None:
        """Filters would be set here."""

    def _lose(self, _: BusError, again: bool) -> None:
        assert again
        self.said.append("lost")

    def _come_back(self, gap: float) -> None:
        assert self._lost_at is not None
        assert gap == self._now - self._lost_at
        self._away += gap
        self.said.append("back")

    @rule(seconds=st.floats(0.0, 30.0))
    def wait(self, seconds: float) -> None:
        self._now += seconds

    @rule()
    def fail(self) -> None:
        if self.connection.failure is None:
            self._lost_at = self._now
        self.connection.fail(BusError("it failed"))

    @rule(frames=st.integers(1, 1000))
    def overflow(self, frames: int) -> None:
        bus: Any = self.connection.driver.bus
        bus.lost += frames
        self._lost_frames += frames
        self.connection.count_overflow()

    @precondition(lambda self: not self.connection.up)
    @rule(refusals=st.integers(0, 3), fails=st.booleans())
    def reopen(self, refusals: int, fails: bool) -> None:
        self._refusals = refusals
        assert self.connection.reopen() is not self.closed
        if fails:
            self.connection.fail(BusError("again"))

    @rule()
    def read(self) -> None:
        was_lost = self.connection.failure is not None
        self.connection.works()
        if self.connection.up and was_lost:
            assert self.connection.failure is None

    @rule()
    def close(self) -> None:
        self.connection.close()
        self.closed = True

    @invariant()
    def each_loss_is_reported_once_and_ended_once(self) -> None:
        assert self.said == [("lost", "back")[number % 2] for number in range(len(self.said))]
        assert self.connection.gaps.number == self.said.count("back")
        assert self.connection.gaps.seconds == pytest.approx(self._away)

    @invariant()
    def every_lost_frame_is_counted(self) -> None:
        assert self.connection.overflow == self._lost_frames

    @invariant()
    def what_is_closed_is_not_up(self) -> None:
        assert not (self.closed and self.connection.up)

    def teardown(self) -> None:
        self._patch.undo()
        self.connection.driver.bus.shutdown()


TROUBLES = st.sampled_from(
    [
        Trouble(),
        *(Trouble(refuses=each) for each in (0, 1, 3)),
        Trouble(refuses_data=True),
        *(Trouble(error_after=each, error=error) for each in (3, 1, 0x1F50) for error in (2, 5, 7, 63)),
        Trouble(identification=7),
        *(Trouble(silent_after=each) for each in (0, 1, 3)),
        Trouble(busy_for=0.0),
        Trouble(busy_for=40.0),
        Trouble(starts=False),
        Trouble(restarts=True),
        Trouble(restarts=True, starts=False),
        Trouble(restarts=True, error_after=0x1F50, error=3),
    ]
)


class ProgramDownloads(RuleBasedStateMachine):
    """Downloads into a device that has any trouble: it runs the program, or the error says truly how it was left."""

    @initialize()
    def begin(self) -> None:
        self.device = FlashDevice()

    @rule(content=st.sampled_from([b"one", b"another" * 30, bytes(range(256))]), trouble=TROUBLES)
    def download(self, content: bytes, trouble: Trouble) -> None:
        self.device.trouble = trouble
        before, running = self.device.program, self.device.running
        try:
            with wired(self.device) as master:
                load(master.node(NODE_ID), content)
        except (ProgramError, BusError) as error:
            said = str(error)
        else:
            said = ""
            assert (self.device.program, self.device.running) == (content, True)
        left = said.partition("; node 9: ")[2].partition(";")[0].partition(":")[0]
        assert not said or dict(self._ways(before, running, content))[left], said
        self._switch_off_and_on()

    def _ways(self, before: bytes, running: bool, content: bytes) -> Iterator[tuple[str, bool]]:
        now, runs = self.device.program, self.device.running
        yield "its program is as it was", (now, runs) == (before, running)
        yield "its program may be stopped", now == before
        yield "its program is stopped and may be cleared", now in (before, b"") and not runs
        yield "it is stopped without a whole program", not runs
        yield "the program is written and not started", now == content and not runs
        yield "the program is written and does not run", now == content

    def _switch_off_and_on(self) -> None:
        """A device that has fallen silent answers again; its program is what the flash memory has."""
        program, running = self.device.program, self.device.running
        self.device = FlashDevice()
        self.device.program, self.device.running = program, running

    @rule(content=st.binary(min_size=1, max_size=100))
    def a_device_without_trouble_takes_it_whatever_was_before(self, content: bytes) -> None:
        self.device.trouble = Trouble()
        with wired(self.device) as master:
            load(master.node(NODE_ID), content)
        assert (self.device.program, self.device.running) == (content, True)


class ArchivedLogs(RuleBasedStateMachine):
    """Logs put into a season, broken off, and damaged there: what was archived last without an error is there once."""

    LOGS = (b"", b"(0.1) can0 108#0000000000\n", b"(0.1) can0 108#0000000000\n(0.2) can0 10C#\nnoise\n")

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory()
        self.season = Path(self._folder.name, "season")
        self.whole: dict[str, int] = {}

    def _archive(self, number: int, progress: Any = lambda _: None) -> Archived:
        log = Path(self._folder.name, f"{number}.log")
        log.write_bytes(self.LOGS[number])
        [done] = archive([log], self.season, NETWORK, progress=progress)
        self.whole[done.run] = done.frames if not done.known else self.whole[done.run]
        return done

    @rule(number=st.sampled_from(range(len(LOGS))))
    def archive(self, number: int) -> None:
        self._archive(number)
        assert self._archive(number).known

    @rule(number=st.sampled_from(range(1, len(LOGS))), error=st.sampled_from([KeyboardInterrupt, MemoryError]))
    def be_broken_off(self, number: int, error: type[BaseException]) -> None:
        with suppress(error):
            self._archive(number, failing(error()))

    @rule(number=st.sampled_from(range(len(LOGS))), data=st.data(), cut=st.booleans())
    def damage(self, number: int, data: st.DataObject, cut: bool) -> None:
        run = self._archive(number).run
        table = data.draw(st.sampled_from(sorted(self.season.glob(f"*/{run}.parquet"))))
        if cut:
            table.write_bytes(table.read_bytes()[:-3])
        else:
            table.unlink()
        assert not self._archive(number).known

    @invariant()
    def what_is_whole_is_there_once(self) -> None:
        for run, frames in self.whole.items():
            tables = {name: pq.read_table(self.season / name / f"{run}.parquet") for name in ("runs", "frames")}
            assert tables["runs"].column("frames").to_pylist() == [frames]
            assert tables["frames"].num_rows == frames

    @invariant()
    def nothing_half_done_is_left(self) -> None:
        assert list(self.season.glob(f"{BEGUN}/*")) == []

    def teardown(self) -> None:
        self._folder.cleanup()


StoredSettings.TestCase.settings = ProgramDownloads.TestCase.settings = FEW
ArchivedLogs.TestCase.settings = settings(FEW, max_examples=EXAMPLES // 8, stateful_step_count=6)
LostConnection.TestCase.settings = MANY

TestStoredSettings = StoredSettings.TestCase
TestLostConnection = LostConnection.TestCase
TestProgramDownloads = ProgramDownloads.TestCase
TestArchivedLogs = ArchivedLogs.TestCase
