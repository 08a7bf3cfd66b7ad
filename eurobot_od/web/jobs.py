"""Long work beside the page: one job at a time on a bus, which all browsers see and can end.

Theory of operation. A job is a function that runs on a thread of its own, with a master or a bus that receives every
frame of the session (`session.JobBus`). All browsers see its progress, the rows that it has found, and at last its
result or its error. When a person ends it, its next wait raises `JobEnded`, once: the function restores what a command
would restore at Ctrl-C. Meanwhile no other request asks nodes or sends (`desk`), except stops. After STOP a job still
restores values, but sends no frame that may move something.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from typing import Any

from eurobot_od.client.master import Master
from eurobot_od.errors import EurobotError, LocalError
from eurobot_od.frame import Frame
from eurobot_od.web.session import JobBus, Session

LOOK = 0.1
"""Longest time in s until a waiting job notices that it has to end."""

LAST_WAIT = 20.0
"""Time in s for a job to restore what it has changed when the server ends."""

LOGGER = logging.getLogger(__name__)


class JobEnded(EurobotError):
    """A person has ended the job; raised where it waits next."""

    def __init__(self) -> None:
        super().__init__("ended from the page")


class JobState(Enum):
    """The state of a job."""

    RUNNING = "running"
    ENDING = "ending"
    DONE = "done"
    FAILED = "failed"
    ENDED = "ended"


class Job:
    """One piece of long work: its `name` for the view, its `title` for a person, and its results so far.

    `number` counts the jobs of a session. `at_end` is called when it is ended.
    """

    def __init__(self, name: str, title: str, number: int, session: Session, moves: Callable[[Frame], str]) -> None:
        self.name = name
        self.title = title
        self.number = number
        self._session = session
        self._moves = moves
        self.state = JobState.RUNNING
        self.error = ""
        self.result: Any = None
        self._done: tuple[int, int | None] = (0, None)
        self._rows: list[tuple[int, Any]] = []
        self._is_to_end = self._is_stopped = False
        self.at_end: Callable[[], object] = lambda: None
        self.turn = session.turn + 1

    @property
    def is_over(self) -> bool:
        """Whether it no longer runs."""
        return self.state not in (JobState.RUNNING, JobState.ENDING)

    # For the work

    def open(self) -> JobBus:
        """Open the bus of the session for this job."""
        return self._session.open_for_job(self._gate)

    @contextmanager
    def master(self) -> Iterator[Master]:
        """Open the bus for a master that knows where the devices' SDO servers are."""
        with JobMaster(self.open(), self) as master:
            for each in self._session.decoder.dictionaries:
                master.follow(each)
            yield master

    def progress(self, done: int, total: int | None) -> None:
        """Note how much is done, and of how much."""
        self._done = done, total
        self._changed()

    def row(self, row: Any) -> None:
        """Add a result, as data."""
        self._rows.append((self._changed(), row))

    def look(self) -> None:
        """Check whether the job has to end; raises JobEnded, only once, so that restoring is not ended as well."""
        if self._is_to_end:
            self._is_to_end = False
            raise JobEnded

    def _gate(self, frame: Frame) -> None:
        if self._is_stopped and (reason := self._moves(frame)):
            raise LocalError(f"not sent after STOP: {reason}")

    def _changed(self) -> int:
        # The next turn: also for a browser that already has the present one.
        self.turn = self._session.turn + 1
        return self.turn

    # For the page

    def end(self, is_stopped: bool = False) -> None:
        """End it; after a STOP it sends no frame that may move something."""
        self._is_stopped |= is_stopped
        if self.state is JobState.RUNNING:
            self.state = JobState.ENDING
            self._is_to_end = True
            self._changed()
            self.at_end()

    def run(self, work: Callable[[Job], Any]) -> None:
        """Do the work to its end."""
        try:
            self.result = work(self)
            state = JobState.ENDED if self.state is JobState.ENDING else JobState.DONE
        except (EurobotError, OSError) as error:
            self.error = str(error)
            state = JobState.ENDED if self.state is JobState.ENDING else JobState.FAILED
        except Exception as error:
            LOGGER.exception("%s has failed", self.title)
            self.error = f"a fault of this program: {error!r}"
            state = JobState.FAILED
        self.state = state
        self._changed()

    def data(self, since: int) -> dict[str, Any]:
        """Return it as data, with the rows that are newer than a turn."""
        done, total = self._done
        known = {"name": self.name, "title": self.title, "number": self.number, "state": self.state.value}
        # By their places: a row may be new to a browser at two turns.
        first = next((place for place, (turn, _) in enumerate(self._rows) if turn > since), len(self._rows))
        new = {"first": first, "rows": [row for _, row in self._rows[first:]]}
        return known | new | {"done": done, "total": total, "error": self.error, "result": self.result}


class JobMaster(Master):
    """A master whose waits notice that the job has to end."""

    def __init__(self, bus: JobBus, job: Job) -> None:
        super().__init__(bus)
        self._job = job

    async def take_in(self, wait: float, done: Callable[[], bool]) -> bool:
        """Process frames until `done`, and return whether it is; raises JobEnded."""
        end = self.clock() + wait
        self._job.look()
        while not await super().take_in(min(LOOK, end - self.clock()), done):
            if self.clock() >= end:
                return done()
            self._job.look()
        return True


class Jobs:
    """The jobs of a session: at most one runs, and the last one of each name is kept for later browsers.

    `moves` returns why a frame may move something.
    """

    def __init__(self, session: Session, moves: Callable[[Frame], str]) -> None:
        self._session = session
        self._moves = moves
        self._number = 0
        self._last: dict[str, Job] = {}
        self._running: Job | None = None

    @property
    def running(self) -> Job | None:
        """The job that runs, None if there is none."""
        return None if self._running is None or self._running.is_over else self._running

    def check_free(self) -> None:
        """Check that no job runs; raises LocalError."""
        if (job := self.running) is not None:
            raise LocalError(f"{job.title} is under way: wait for its end, or end it")

    def start(self, name: str, title: str, work: Callable[[Job], Any]) -> Job:
        """Start a job; raises LocalError while another one runs."""
        self.check_free()
        self._number += 1
        job = self._running = self._last[name] = Job(name, title, self._number, self._session, self._moves)
        threading.Thread(target=job.run, args=(work,), name=title, daemon=True).start()
        return job

    def end(self, is_stopped: bool = False) -> None:
        """End the running job, if there is one."""
        if (job := self.running) is not None:
            job.end(is_stopped)

    async def wait(self) -> None:
        """End the running job, and wait until it has restored what it has changed."""
        self.end()
        begun = self._session.now
        while self.running is not None and self._session.now < begun + LAST_WAIT:
            await asyncio.sleep(LOOK)

    def data(self, since: int) -> list[dict[str, Any]]:
        """Return the jobs that have changed after a turn."""
        return [each.data(since) for each in self._last.values() if each.turn > since]
