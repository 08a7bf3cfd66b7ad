"""Requests without a server: what each is answered, and what is left of a browser that is gone."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.bus.live import open_bus
from eurobot_od.frame import Frame
from eurobot_od.web.desk import Desk
from eurobot_od.web.jobs import Job, JobState
from eurobot_od.web.requests import REQUESTS, Requests
from eurobot_od.web.session import Session
from tests.kit import plant
from tests.web.scene import channel

ME, YOU = "my browser", "your browser"
FILE = {"do": "file", "name": "a.eds", "at": 0, "data": "AAAA"}
LIST = {"do": "begin list", "key": "mine", "title": "mine", "rows": [{"send": "7FF#", "period": "60 s"}], "sure": True}


@pytest.fixture
def session() -> Iterator[Session]:
    session = Session(partial(open_bus, "virtual", channel()), plant.decoder(), 500_000)
    with closing(session):
        yield session


@pytest.fixture
def requests(session: Session, tmp_path: Path) -> Requests:
    return Requests(Desk(session, tmp_path, control=True))


async def asked(requests: Requests, who: object = ME, **words: Any) -> dict[str, Any]:
    """Return the answer to a request."""
    return dict(json.loads(await requests.answer(json.dumps({"id": 7, **words}), who)))


ANSWERS = {
    "not JSON": ("{", None, "a request is JSON"),
    "brackets without end": ("[" * 100_000, None, "a request is JSON"),
    "no object": ("[1]", None, "a request is a JSON object"),
    "no name": ('{"id": 3}', 3, "unknown request 'None'; known: "),
    "an unknown name": ('{"id": "x", "do": "dance"}', "x", "unknown request 'dance'"),
    "a long name is cut": (json.dumps({"id": 4, "do": "x" * 100}), 4, f"unknown request '{'x' * 40}'"),
    "a node that is not there": (
        '{"id": 5, "do": "read", "node": "crane", "object": "0x1000"}',
        5,
        "unknown node 'crane'; known: panel, lift, scale",
    ),
}


@pytest.mark.parametrize(("text", "number", "error"), ANSWERS.values(), ids=ANSWERS)
def test_an_error_is_answered_with_the_number_of_the_request(
    requests: Requests, text: str, number: object, error: str
) -> None:
    said = json.loads(asyncio.run(requests.answer(text, ME)))
    assert (said["re"], "ok" in said) == (number, False)
    assert said["error"].startswith(error)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({}, "nothing to set: give a node-ID, a bit rate, or have it stored"),
        ({"node-ID": "5"}, "node-ID is not a whole number"),
        ({"node-ID": True}, "node-ID is not a whole number"),
        ({"node-ID": 5, "identity": [1, 2, 3]}, "identity is missing, or not four numbers of 32 bits"),
    ],
    ids=["nothing", "text", "a truth value", "three numbers"],
)
def test_what_lss_cannot_set_is_told(requests: Requests, words: dict[str, Any], error: str) -> None:
    said = asyncio.run(asked(requests, do="set lss", **words))
    assert said["error"] == error


ACTING = [name for name, each in REQUESTS.items() if each.acts]


def test_a_page_without_control_does_nothing_that_acts(session: Session, tmp_path: Path) -> None:
    requests = Requests(Desk(session, tmp_path))

    async def errors() -> set[str]:
        return {str((await asked(requests, do=name)).get("error")) for name in ACTING}

    assert asyncio.run(errors()) == {"this page is read-only: start the server with --control"}


def test_requests_that_only_read_need_no_control() -> None:
    assert not {"diagnosis", "scan", "read", "differences"} & {*ACTING}
    assert {"stop", "send", "write", "nmt", "record", "apply", "file"} <= {*ACTING}


def test_a_question_names_what_may_move_and_sure_confirms_it(requests: Requests) -> None:
    said = asyncio.run(asked(requests, do="nmt", command="start", node="lift"))
    assert said["error"] == f"not sent: {said['asks']}"
    yes = asyncio.run(asked(requests, do="nmt", command="start", node="lift", sure=True))
    assert (yes["re"], yes["ok"]) == (7, "000#0102")


def test_a_closed_page_leaves_no_file_and_no_periodic_frames(requests: Requests) -> None:
    async def both() -> None:
        for who in (ME, YOU):
            assert "ok" in await asked(requests, who, **FILE)
            assert "ok" in await asked(requests, who, **{**LIST, "key": who})
        requests.left(ME)

    asyncio.run(both())
    ended = {key: each.ended for key, each in requests.desk.lists.items()}
    assert (list(requests.desk.uploads), ended) == ([YOU], {ME: "its page is gone", YOU: ""})


def until_it_ends(job: Job) -> None:
    while True:
        job.look()


def test_a_server_that_ends_stops_its_job_and_periodic_frames(requests: Requests) -> None:
    async def run() -> Job:
        async with requests.running():
            assert "ok" in await asked(requests, **LIST)
            return requests.desk.jobs.start("long", "a long job", until_it_ends)

    job = asyncio.run(run())
    assert (job.state, requests.desk.lists["mine"].ended) == (JobState.ENDED, "the server ends")


def test_a_list_is_kept_by_name_read_again_and_removed(requests: Requests) -> None:
    async def names() -> object:
        return (await asked(requests, do="lists"))["ok"]

    async def all_of_it() -> tuple[object, object, object]:
        assert "ok" in await asked(requests, do="keep list", name="warm up", rows=LIST["rows"])
        kept = await names()
        rows = (await asked(requests, do="list", name="warm up"))["ok"]
        await asked(requests, do="remove list", name="warm up")
        return kept, rows, await names()

    kept, rows, left = asyncio.run(all_of_it())
    assert (kept, left) == (["warm up"], [])
    assert rows == [{"send": "7FF#", "period": "60000 ms"}]


def test_a_frame_sets_a_row_of_a_list_off(session: Session, tmp_path: Path) -> None:
    desk = Desk(session, tmp_path, control=True)
    rows = [{"send": "7FF#", "trigger": "123"}]
    assert "ok" in asyncio.run(asked(Requests(desk), **(LIST | {"rows": rows})))
    (begun,) = desk.running_lists
    waiting = begun.running.next
    session.first(Frame(0x123))
    assert (waiting, begun.running.next <= session.now) == (inf, True)


@pytest.mark.parametrize("name", ["../out", "a/b", ""], ids=["above the folder", "in a folder of it", "none"])
def test_a_list_is_kept_in_its_folder_only(requests: Requests, tmp_path: Path, name: str) -> None:
    said = asyncio.run(asked(requests, do="keep list", name=name, rows=LIST["rows"]))
    assert "ok" not in said
    assert [*tmp_path.rglob("*.yaml")] == []
