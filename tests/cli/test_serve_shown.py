"""What the command serve shows, without a server: the pages of logs, files, a bus, and of what was chosen first."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from eurobot_od.cli.serve import PageServer
from eurobot_od.web.requests import Requests
from eurobot_od.web.server import Post
from tests.cli.console import Said, run

MOTOR = Path(__file__).parents[2] / "docs" / "motor.eds"
WORKBENCH = ("--robot", "none")


class Shown:
    """A page that was served: its content, what answers it, and who may leave it."""

    def __init__(self, text: str, requests: Requests | None, posts: Mapping[str, Post]) -> None:
        self.content, _ = json.JSONDecoder().raw_decode(text, text.index('{"title":'))
        self.desk, self.posts = requests.desk if requests else None, posts

    async def ask(self, path: str, **words: Any) -> Any:
        """Return what a request to the page is answered."""
        return json.loads(await self.posts[path](json.dumps(words)))

    @property
    def title(self) -> str:
        return str(self.content["title"])


Act = Callable[[Shown], Awaitable[object]]
"""What a browser does with a page; the command ends if it does not leave it."""


async def look(_: Shown) -> None:
    """Do nothing."""


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Shown]]:
    """Keep the pages that are served, and do with each of them the next of some acts."""

    def served(*acts: Act) -> list[Shown]:
        shown: list[Shown] = []

        async def serve(
            _: PageServer,
            text: Callable[[], str],
            requests: Requests | None = None,
            posts: Mapping[str, Post] = MappingProxyType({}),
            until: asyncio.Event | None = None,
        ) -> bool:
            shown.append(Shown(text(), requests, posts))
            await (acts[len(shown) - 1] if len(shown) <= len(acts) else look)(shown[-1])
            return until is not None and until.is_set()

        monkeypatch.setattr(PageServer, "serve", serve)
        return shown

    return served


Pages = Callable[..., list[Shown]]
Serve = Callable[..., Said]


@pytest.fixture
def serve(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Serve:
    """Run the command in a folder with a file and two logs."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(MOTOR, tmp_path)
    (tmp_path / "one.log").write_text("(1.0) can0 705#05\n(2.5) can0 123#\n(2.6) can0 705#7F\n")
    (tmp_path / "two.log").write_text("(1.0) can0 705#05\n(2.5) can0 124#\n(2.6) can0 705#7F\n")
    return lambda *words: run(capsys, "serve", *words, *WORKBENCH)


def test_a_log_is_shown_and_what_is_wrong_in_it_is_said(pages: Pages, serve: Serve) -> None:
    shown = pages()
    said = serve("one.log", "--eds", "5=motor.eds")
    assert (said.status, said.err.count("\n")) == (0, 1)
    assert "1 x unknown identifier first at one.log:2: 123#" in said.err
    ((source,), content) = shown[0].content["sources"], shown[0].content
    assert (shown[0].title, source["name"], source["left_out"], content["leave"]) == ("one.log", "one.log", 0, False)
    assert "comparison" not in content
    assert source["diagnosis"]["incidents"]
    assert list(shown[0].posts) == ["/files", "/log"]


def test_frames_that_a_page_cannot_hold_are_reported(
    pages: Pages, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages()
    monkeypatch.setattr("eurobot_od.web.page.MOST_FRAMES", 2)
    said = serve("one.log", "--eds", "5=motor.eds")
    assert "one.log: 1 frames are left out: only logs of lines, not packed, are shown whole" in said.complaint


def test_two_logs_are_compared(pages: Pages, serve: Serve) -> None:
    shown = pages()
    serve("one.log", "two.log", "--eds", "5=motor.eds")
    content = shown[0].content
    assert (shown[0].title, [each["name"] for each in content["sources"]]) == (
        "one.log and two.log",
        ["one.log", "two.log"],
    )
    found = content["comparison"]["differences"]
    assert content["comparison"]["count"] == len(found) == 2


@pytest.mark.parametrize(("words", "may_save"), [((), False), (("--control",), True)])
def test_files_are_edited_without_a_bus(pages: Pages, serve: Serve, words: Sequence[str], may_save: bool) -> None:
    listed: list[Any] = []

    async def files(page: Shown) -> None:
        listed.extend((await page.ask("/files", do="list"))["ok"]["files"])

    shown = pages(files)
    assert serve("motor.eds", *words).status == 0
    assert (shown[0].title, shown[0].content["sources"], shown[0].desk) == ("motor.eds", [], None)
    assert [(Path(each["file"]).name, each["origin"], each["saves"]) for each in listed] == [
        ("motor.eds", "named", may_save)
    ]


@pytest.mark.parametrize("words", [(), ("--control",)], ids=["", "control"])
def test_a_bus_is_shown_and_acted_on_only_with_control(pages: Pages, serve: Serve, words: Sequence[str]) -> None:
    folders: list[bool] = []

    async def record(page: Shown) -> None:
        assert page.desk is not None
        folders.append(page.desk.folder.is_dir())

    shown = pages(record)
    assert serve("-i", "virtual", "-c", "shown", "--eds", "5=motor.eds", *words).status == 0
    desk = shown[0].desk
    assert desk is not None
    assert (shown[0].title, desk.control) == ("Bus shown (virtual)", bool(words))
    assert folders == [True]
    assert not desk.folder.exists(), "what was recorded without a workspace is gone with the page"


def test_the_chosen_bus_or_log_is_shown_until_it_is_left(pages: Pages, serve: Serve, tmp_path: Path) -> None:
    async def choose(page: Shown) -> None:
        assert (await page.ask("/start", do="logs"))["ok"]
        assert await page.ask("/start", do="open", log="one.log") == {"ok": None}

    async def leave(page: Shown) -> None:
        assert await page.ask("/leave") == {}

    async def connect(page: Shown) -> None:
        assert await page.ask("/start", do="connect", interface="virtual", channel="chosen") == {"ok": None}

    shown = pages(choose, leave, connect, leave)
    assert serve(str(tmp_path)).status == 0
    assert [each.title for each in shown] == ["CANopen", "one.log", "CANopen", "Bus chosen (virtual)", "CANopen"]
    assert shown[1].content["leave"]
    assert shown[3].desk is not None
    assert shown[3].desk.folder == tmp_path
    assert (tmp_path / "eurobot-od.yaml").read_text() == (
        'library: [devices]\nbus: {"interface": "virtual", "channel": "chosen"}\n'
    )


def test_a_page_that_is_ended_ends_the_command(pages: Pages, serve: Serve) -> None:
    async def choose(page: Shown) -> None:
        await page.ask("/start", do="open", log="one.log")

    shown = pages(choose)
    assert serve().status == 0
    assert [each.title for each in shown] == ["CANopen", "one.log"], "nobody has left it"


def test_simulated_devices_are_on_the_bus_that_is_shown(pages: Pages, serve: Serve) -> None:
    async def simulate(page: Shown) -> None:
        (motor,) = (await page.ask("/start", do="devices"))["ok"]
        words = {"devices": [{"file": motor["file"], "node_id": 5}]}
        assert await page.ask("/start", do="simulate", **words) == {"ok": None}

    async def heard(page: Shown) -> None:
        assert page.desk is not None
        names.extend(each.name for each in page.desk.session.decoder.dictionaries)

    names: list[str] = []
    Path("devices").mkdir()
    shutil.copy(MOTOR, "devices")
    pages(simulate, heard)
    assert serve("--library", "devices").status == 0
    assert names == ["motor"]
