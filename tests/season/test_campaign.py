"""Campaigns: each item once and in order, kept and taken up again, on any executor, whoever is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple, NoReturn

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.season import campaign
from eurobot_od.season.campaign import BLOCK, HERE, Workers, dask, local, workers

pytest.importorskip("pyarrow", reason="the extra `cluster` is not installed")

import pyarrow.parquet as pq

from eurobot_od.season.results import SETTINGS, Results
from tests.cli.processes import PATIENCE
from tests.season.clusters import Cluster, two_workers


class Square(NamedTuple):
    number: int
    square: int


def square(number: int) -> Square:
    return Square(number, number * number)


def squares(*numbers: int) -> list[Square]:
    return list(map(square, numbers))


@pytest.mark.parametrize("count", [0, 1, 7, 40])
def test_results_come_in_order_from_any_executor(count: int) -> None:
    with ThreadPoolExecutor(4) as executor:
        for who in (HERE, Workers(4, executor), Workers(4, executor, BLOCK)):
            assert list(campaign.run(square, range(count), who)) == squares(*range(count))


def test_items_of_one_name_are_refused_before_the_first_is_done() -> None:
    done: list[int] = []
    with pytest.raises(ValueError, match=r"^2 items are called"):
        list(campaign.run(done.append, [0, 1, 1], HERE))
    assert done == []


def test_processes_give_the_same_results_in_order() -> None:
    with local(2) as processes:
        assert list(campaign.run(square, range(9), processes)) == squares(*range(9))


def test_only_the_parent_acts_on_ctrl_c() -> None:
    with campaign.Processes(1) as executor:
        assert executor.submit(signal.getsignal, signal.SIGINT).result() is signal.SIG_IGN


def refused(status: int) -> NoReturn:
    raise AssertionError(f"os._exit({status}) does not end this process")


def endless(number: int) -> None:
    os._exit = refused  # as a match does, whose strategy must not end it
    os.write(1, b"%d\n" % number)  # in one piece: another process writes into the same pipe
    threading.Event().wait()


PROGRAM = """
from eurobot_od.season import campaign
from tests.season.test_campaign import endless
with campaign.local(2) as processes:
    list(campaign.run(endless, range(2), processes))
"""


@pytest.mark.posix
def test_processes_end_with_their_parent_even_if_their_work_replaces_signal_handlers() -> None:
    with subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, start_new_session=True) as parent:
        group = threading.Timer(PATIENCE, partial(os.killpg, parent.pid, signal.SIGKILL))
        group.start()
        assert parent.stdout
        assert {parent.stdout.readline(), parent.stdout.readline()} == {b"0\n", b"1\n"}
        parent.kill()
        parent.stdout.read()  # the pipe ends when nobody has it open any more
        assert group.is_alive()
        group.cancel()


@pytest.mark.parametrize(
    ("items", "who", "kept", "size"),
    [
        (1000, HERE, False, 1),
        (1000, HERE, True, 100),
        (300, HERE, True, 37),
        (3, HERE, True, 1),
        (100_000, Workers(10, None, BLOCK), False, 100),
        (300, Workers(2, None, BLOCK), False, 18),
    ],
)
def test_blocks_are_of_about_a_hundred_or_smaller(items: int, who: Workers, kept: bool, size: int) -> None:
    assert campaign.block_size(items, who, kept) == size


# Kept results


def kept(folder: Path, resume: bool = False, **settings: str) -> Results[Square]:
    return Results(folder, Square, {"campaign": "squares", **settings}, resume)


def counting(done: list[int], number: int) -> Square:
    done.append(number)
    return square(number)


def test_an_interrupted_campaign_does_only_what_is_left(tmp_path: Path) -> None:
    folder = tmp_path / "squares"
    done = list[int]()
    run = campaign.run(partial(counting, done), range(20), HERE, kept(folder))
    for _ in range(7):
        next(run)
    run.close()
    first = len(done)
    assert 7 <= first < 20
    assert list(campaign.run(partial(counting, done), range(30), HERE, kept(folder, resume=True))) == squares(
        *range(30)
    )
    assert sorted(done) == list(range(30))
    assert list(campaign.run(partial(counting, done), range(30), HERE, kept(folder, resume=True))) == squares(
        *range(30)
    )
    assert len(done) == 30


@pytest.mark.posix
def test_a_block_whose_file_is_damaged_is_done_again(tmp_path: Path) -> None:
    folder = tmp_path / "squares"
    done = list[int]()
    list(campaign.run(square, range(4), HERE, kept(folder)))
    first, second, *_ = files = sorted(folder.glob("*.parquet"))
    os.mkfifo(folder / "x.parquet")  # to read it would never end
    for file in (first, second):
        rows = pq.ParquetFile(file).metadata.row_group(0).column(0)
        content = bytearray(file.read_bytes())
        content[rows.data_page_offset + rows.total_compressed_size - 1] ^= 1
        file.write_bytes(content)
    again = campaign.run(partial(counting, done), range(4), HERE, kept(folder, resume=True))
    assert list(again) == squares(*range(4))
    assert len(done) == 2 * 4 // len(files)


@pytest.mark.parametrize(
    ("settings", "resume", "complaint"),
    [
        ({}, False, "holds a campaign already: --resume goes on with it"),
        ({"team": "red"}, True, "holds a campaign with other settings: team was None, and is 'red'"),
    ],
)
def test_a_folder_holds_one_campaign(settings: dict[str, str], resume: bool, complaint: str, tmp_path: Path) -> None:
    kept(tmp_path / "squares")
    with pytest.raises(LocalError, match=complaint):
        kept(tmp_path / "squares", resume, **settings)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(LocalError, match="is not empty, and holds no campaign"):
        kept(tmp_path, resume=True)


@pytest.mark.parametrize("text", ["", "[]", "[" * 100_000, '{"a": '], ids=["nothing", "a list", "deep", "cut off"])
def test_wrong_settings_are_one_line(text: str, tmp_path: Path) -> None:
    (tmp_path / SETTINGS).write_text(text)
    with pytest.raises(LocalError, match=r"campaign\.json: these are not the settings of a campaign$"):
        kept(tmp_path, resume=True)


# dask


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with two_workers(tmp_path) as cluster:
        yield cluster


def with_pid(folder: str, number: int) -> Square:
    """Note who did it, and take a moment."""
    Path(folder, str(number)).write_text(str(os.getpid()))
    time.sleep(0.05)
    return square(number)


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.filterwarnings("ignore")  # dask's own, when a worker is lost
def test_a_dask_worker_that_is_killed_loses_its_block_only(cluster: Cluster, tmp_path: Path) -> None:
    notes, folder = tmp_path / "notes", tmp_path / "results"
    notes.mkdir()
    with dask(cluster.address) as who:
        assert who.number == 2
        run = campaign.run(partial(with_pid, str(notes)), range(60), who, kept(folder))
        found = [next(run)]
        cluster.started[1].send_signal(signal.SIGKILL)
        found += list(run)
    assert found == squares(*range(60))
    assert list(campaign.run(square, range(60), HERE, kept(folder, resume=True))) == found
    assert cluster.started[1].wait() == -signal.SIGKILL


@pytest.mark.parametrize(
    ("text", "jobs", "complaint"),
    [
        ("127.0.0.1:1", None, "is not an executor: dask://HOST:PORT, or --jobs"),
        ("dask://nonsense", None, "no dask scheduler answers"),
    ],
)
def test_an_executor_that_cannot_be_made_is_one_line(text: str, jobs: int | None, complaint: str) -> None:
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    with pytest.raises(LocalError, match=complaint) as error, workers(text, jobs, 5):
        pass
    assert "\n" not in str(error.value)
