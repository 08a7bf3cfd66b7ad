"""Coroutines of users run to their end, and what they leave behind ends with them."""

from __future__ import annotations

import asyncio
import linecache
import signal
import time
from collections.abc import AsyncIterator, Iterator
from types import FrameType
from typing import Any

import pytest

from eurobot_od.bus.live import event_loop
from eurobot_od.bus.live.event_loop import Watchdog
from eurobot_od.errors import ProgramFailed


def test_an_unfinished_async_generator_cleans_up_before_the_loop_is_closed() -> None:
    cleaned: list[asyncio.AbstractEventLoop] = []

    async def numbers() -> AsyncIterator[int]:
        try:
            yield 1
            yield 2
        finally:
            cleaned.append(asyncio.get_running_loop())

    left = numbers()  # held here: without a reference Python itself would close it

    async def main() -> asyncio.AbstractEventLoop:
        async for _ in left:
            break
        return asyncio.get_running_loop()

    loop = event_loop.run(main())
    assert cleaned == [loop]


if not hasattr(signal, "SIGURG"):
    pytest.skip("no SIGURG here", allow_module_level=True)

GIVES_WAY_FOR_EVER = """
import asyncio
class GivingWay:
    def __await__(self):
        yield
async def play(ended, in_the_loop):
    asyncio.get_running_loop().set_exception_handler(lambda _loop, context: in_the_loop.append(context))
    try:
        while True:
            await GivingWay()
    except BaseException as error:
        ended.append(error)
"""


def own(_signal: int, _frame: FrameType | None) -> None:
    """A program's own handler."""


@pytest.fixture
def _own_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGURG, own)
    yield
    signal.signal(signal.SIGURG, before)


@pytest.mark.usefixtures("_own_handler")
def test_a_programs_own_handler_is_back_at_the_end() -> None:
    with Watchdog(lambda: True):
        assert signal.getsignal(signal.SIGURG) is not own
    assert signal.getsignal(signal.SIGURG) is own


def test_the_watchdog_ends_the_program_even_with_a_slow_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the watchdog reads the line to tell, the program goes on, and is then in the loop as likely as not."""

    def slow(_file: str, _number: int) -> str:
        time.sleep(0.003)  # the disk's
        return "await GivingWay()"

    monkeypatch.setattr(linecache, "getline", slow)
    monkeypatch.setattr(event_loop, "PATIENCE", 0.2)
    program: dict[str, Any] = {}
    exec(compile(GIVES_WAY_FOR_EVER, "mine.py", "exec"), program)
    for _ in range(3):
        ended: list[BaseException] = []
        in_the_loop: list[dict[str, Any]] = []
        with pytest.raises(ProgramFailed, match="does not give way"):
            event_loop.run(program["play"](ended, in_the_loop))
        assert len(ended) == 1
        assert not in_the_loop
