"""Long work beside the page: one at a time, the same for all browsers, and what it has changed is put back."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp
import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.client.configure import write_value
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.objects import find_one
from eurobot_od.web.desk import Desk
from eurobot_od.web.jobs import Job, JobEnded, JobState
from eurobot_od.web.session import Session
from tests.kit import plant
from tests.web.scene import LONG, channel, line, live_page
from tests.web.test_server import answer, snapshot, talk


async def ended(opened: aiohttp.ClientWebSocketResponse, name: str) -> dict[str, Any]:
    """Wait until a job is over, and return it with all its rows."""
    rows: list[Any] = []
    while True:
        for job in (await snapshot(opened))["jobs"]:
            rows[job["first"] :] = job["rows"]
            if job["name"] == name and job["state"] not in ("running", "ending"):
                return {**job, "rows": rows}


async def done(opened: aiohttp.ClientWebSocketResponse, name: str, **words: Any) -> dict[str, Any]:
    """Start a job, and return it once it is over."""
    said = await answer(opened, json.dumps({"id": 1, **words}))
    assert "ok" in said, said
    return await ended(opened, name)


def test_a_scan_gives_each_node_with_its_file_and_says_who_is_missing(tmp_path: Path) -> None:
    name = channel()
    with line(name), live_page(name, tmp_path, control=False) as served:
        job = talk(served, lambda opened: done(opened, "scan", do="scan"))
    assert (job["state"], job["done"], job["total"]) == ("done", 127, 127)
    assert [(each["node_id"], each["file"], each["further"]) for each in job["rows"]] == [
        (1, "panel.eds", ""),
        (2, "lift.eds", ""),
        (3, "scale.eds", ""),
    ]
    assert job["result"] == {"missing": []}


def test_a_node_that_does_not_answer_a_scan_is_missing(tmp_path: Path) -> None:
    with live_page(channel(), tmp_path) as served:
        job = talk(served, lambda opened: done(opened, "scan", do="scan"))
    assert (job["rows"], job["result"]) == ([], {"missing": ["panel (1)", "lift (2)", "scale (3)"]})


def test_two_browsers_see_the_same_job_and_either_may_end_it(tmp_path: Path) -> None:
    async def both(first: aiohttp.ClientWebSocketResponse) -> tuple[dict[str, Any], dict[str, Any]]:
        origin = served.address.rstrip("/")
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{origin}/live", origin=origin) as second:
            await answer(first, '{"id": 1, "do": "scan"}')
            await answer(second, '{"id": 1, "do": "end job"}')
            return await ended(first, "scan"), await ended(second, "scan")

    with live_page(channel(), tmp_path) as served:
        mine, theirs = talk(served, both)
    assert mine == theirs
    assert (mine["state"], mine["error"]) == ("ended", "ended from the page")


@pytest.mark.parametrize(
    "words",
    [
        {"do": "read", "node": "lift", "object": "0x1017"},
        {"do": "write", "node": "lift", "object": "0x1017", "value": "500"},
        {"do": "nmt", "command": "stop", "node": "lift"},
        {"do": "send frame", "frame": "7FF#", "sure": True},
        {"do": "find lss"},
    ],
    ids=lambda words: words["do"],
)
def test_requests_that_send_are_refused_while_a_job_runs(tmp_path: Path, words: dict[str, Any]) -> None:
    async def during(opened: aiohttp.ClientWebSocketResponse) -> str:
        await answer(opened, '{"id": 1, "do": "scan"}')
        return str((await answer(opened, json.dumps({"id": 2, **words})))["error"])

    with live_page(channel(), tmp_path) as served:
        assert talk(served, during) == "the scan is under way: wait for its end, or end it"


class Bench(NamedTuple):
    """A session with its desk, whose bus this test drives."""

    desk: Desk
    session: Session

    def run(self, job: Job) -> None:
        """Drive the bus until a job is over."""

        async def run() -> None:
            while not job.is_over:
                self.session.poll()
                await asyncio.sleep(0)

        asyncio.run(asyncio.wait_for(run(), LONG))

    def start(self, work: Any) -> Job:
        """Start a job."""
        return self.desk.jobs.start("test", "the test", work)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with _bench(channel(), tmp_path) as found:
        yield found


@contextmanager
def _bench(name: str, folder: Path) -> Iterator[Bench]:
    session = Session(partial(open_bus, "virtual", name), plant.decoder(), 500_000)
    try:
        yield Bench(Desk(session, folder, control=True), session)
    finally:
        session.close()


def put_back(job: Job) -> str:
    """Change a value, wait until somebody ends that, and put it back as a command does at Ctrl-C."""
    with job.master() as master:
        node = master.node(2)
        write_value(node, find_one("0x1017", plant.load("lift").objects), 500)
        job.row("changed")
        try:
            master.pump(LONG)
        except JobEnded:
            return node.upload((0x1017, 0)).hex()
        return "nobody has ended it"


def test_an_ended_job_gets_one_exception_and_can_restore(tmp_path: Path) -> None:
    name = channel()
    with line(name), _bench(name, tmp_path) as bench:
        job = bench.start(put_back)

        async def run() -> None:
            while not job.data(-1)["rows"]:
                bench.session.poll()
                await asyncio.sleep(0)
            bench.desk.jobs.end()

        asyncio.run(asyncio.wait_for(run(), LONG))
        bench.run(job)
    assert (job.state, job.result) == (JobState.ENDED, "f401")


def test_the_end_of_the_server_waits_for_what_a_job_puts_back(tmp_path: Path) -> None:
    name = channel()
    with line(name), _bench(name, tmp_path) as bench:
        job = bench.start(put_back)

        async def run() -> None:
            while not job.data(-1)["rows"]:
                bench.session.poll()
                await asyncio.sleep(0)
            waiting = asyncio.create_task(bench.desk.jobs.wait())
            while not waiting.done():
                bench.session.poll()
                await asyncio.sleep(0)

        asyncio.run(asyncio.wait_for(run(), LONG))
    assert job.result == "f401"


def test_no_job_begins_while_something_moves_by_the_page_s_order(bench: Bench) -> None:
    bench.desk.drives.post([Frame(0x123)])
    with pytest.raises(LocalError, match="the scan: a drive moves by the page's order, or is being stopped"):
        bench.desk.start("scan", "the scan", lambda _: None)


START = Frame(0x000, b"\x01\x02")


def test_after_stop_a_job_sends_nothing_that_may_move_something(bench: Bench) -> None:
    def stopped(job: Job) -> list[str]:
        bus, refused = job.open(), []
        bench.desk.jobs.end(is_stopped=True)
        for frame in (Frame(0x7E5, bytes(8)), START):
            try:
                bus.send_frame(frame)
            except LocalError as error:
                refused.append(str(error))
        bus.shutdown()
        return refused

    job = bench.start(stopped)
    bench.run(job)
    assert job.result == ["not sent after STOP: NMT start lets lift obey PDOs, with the targets that they have"]


def test_the_bus_of_a_job_gives_all_that_others_send_and_not_what_it_sends_itself(tmp_path: Path) -> None:
    name = channel()

    def heard(job: Job) -> list[int]:
        bus = job.open()
        bus.send_frame(Frame(0x7E5, bytes(8)))
        with open_bus("virtual", name) as other:
            Driver(other).send(Frame(0x181))
            found = [message.arbitration_id for message in iter(partial(bus.recv, 0.5), None)]
        bus.shutdown()
        return found

    with _bench(name, tmp_path) as bench:
        job = bench.start(heard)
        bench.run(job)
    assert job.result == [0x181]


def test_a_fault_in_a_job_is_told_and_ends_only_that(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    job = bench.start(lambda _: 1 / 0)
    bench.run(job)
    assert job.state is JobState.FAILED
    assert job.error.startswith("a fault of this program: ZeroDivisionError")
    assert "the test has failed" in caplog.text
    assert bench.desk.jobs.running is None
