"""The master of docs/python.md, three times: ours are as short as canopen's, and every PDO of 200 SYNCs is read.

`tests/test_docs.py` runs them as they stand.
"""

from __future__ import annotations

import ast
import asyncio
import re
from itertools import islice
from pathlib import Path

import pytest

from eurobot_od.client.network import AsyncNetwork
from tests.client.servo import DCF, SERVO, live_servos, servo

PAGE = Path(__file__).parents[2] / "docs" / "python.md"
SECTION = PAGE.read_text(encoding="utf-8").split("## A master\n")[1].split("\n## ")[0]
OURS, OURS_ASYNC, CANOPEN = re.findall(r"```python\n(.*?)```", SECTION, re.DOTALL)

LINES, IMPORTS = 19, 2
"""What canopen's takes at most: lines with something in them, and imports."""


def lines(text: str) -> int:
    return sum(bool(line.strip()) for line in text.splitlines())


def imports(text: str) -> int:
    return sum(isinstance(each, (ast.Import, ast.ImportFrom)) for each in ast.walk(ast.parse(text)))


@pytest.mark.parametrize("program", [OURS, OURS_ASYNC, CANOPEN], ids=["ours", "async", "canopen"])
def test_a_master_has_few_lines_and_imports(program: str) -> None:
    assert lines(program) <= LINES
    assert imports(program) <= IMPORTS


def test_every_pdo_of_200_syncs_is_read() -> None:
    with servo() as network:
        drive, syncs = network[5], list[float]()
        network.simulation.observers.append(lambda now, frame: syncs.append(now) if frame.cob_id == 0x080 else None)
        drive.configure(DCF)
        drive.nmt.start(within=1.0)
        readings = iter(drive.pdo["TPDO1"])
        task = network.sync(period=0.01)
        network.sleep(1.995)
        task.stop()
        network.sleep(0.1)
        assert len(syncs) == drive.pdo["TPDO1"].count == 200
        times = [each.time for each in islice(readings, 200)]
        assert all(0 < came - asked < 0.001 for asked, came in zip(syncs, times))


def test_every_pdo_is_read_in_an_event_loop() -> None:
    async def main(channel: str) -> None:
        async with AsyncNetwork.open("virtual", channel, answer_wait=2.0) as network:
            drive = network.add(5, SERVO)
            await drive.nmt.start(within=2.0)
            pdo = drive.pdo["TPDO1"]
            for number in range(1, 201):
                network.send(0x080)
                while pdo.count < number:
                    await pdo.wait(2.0)

    with live_servos(5) as channel:
        asyncio.run(main(channel))
