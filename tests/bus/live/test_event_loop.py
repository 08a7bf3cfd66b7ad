"""Coroutines of users run to their end, and what they leave behind ends with them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from eurobot_od.bus.live import event_loop


def test_what_is_left_of_an_async_generator_cleans_up_before_the_loop_is_closed() -> None:
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
