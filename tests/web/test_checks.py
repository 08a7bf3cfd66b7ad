"""Suites that are run from the page: the steps as they come, the reports that are kept, and what has changed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.meaning import Decoder
from tests.kit.devices import IO, MOTOR, SERVO
from tests.web.scene import Served, channel, live_page
from tests.web.test_jobs import done, ended
from tests.web.test_server import answer, snapshot, talk

SUITE = """\
spec: 1
name: the motor has a speed
node: motor
steps:
  - sdo: {{read: Motor.Speed, expect: {speed}}}
"""


@contextmanager
def motor(folder: Path, file: Path = MOTOR) -> Iterator[Served]:
    """Serve the page of a bus with a device, by default the motor of the documentation."""
    name, dictionary = channel(), Dictionary.load(file, 5).named("motor")
    page = live_page(name, folder, network=Decoder([dictionary]))
    with open_bus("virtual", name) as bus, Live.node(bus, SimulatedDevice(dictionary)), page as served:
        yield served


def run(served: Served, **words: Any) -> dict[str, Any]:
    """Run suites, to the end."""
    known = {"node": "motor", "suites": "CiA 301", "tier": "reading"}
    return dict(talk(served, lambda opened: done(opened, "check", do="check", **{**known, **words})))


def test_a_run_by_cia_301_gives_its_steps_and_keeps_the_reports(tmp_path: Path) -> None:
    with motor(tmp_path) as served:
        job = run(served, steps="Device type")
    steps = [each for each in job["rows"] if "step" in each]
    assert job["state"] == "done"
    assert steps
    assert {each["status"] for each in steps} <= {"ok", "skipped"}
    assert sorted(Path(each).suffix for each in job["result"]["files"]) == [".html", ".json", ".txt", ".xml"]
    assert {each.name for each in (tmp_path / "reports").iterdir()} == set(job["result"]["files"])


def test_a_run_that_writes_needs_confirmation(tmp_path: Path) -> None:
    words = {"id": 1, "do": "check", "node": "motor", "suites": "CiA 301", "tier": "reversible"}
    with motor(tmp_path) as served:
        said = talk(served, lambda opened: answer(opened, json.dumps(words)))
    assert said["asks"] == "it resets and starts motor, and writes to it: what hangs on it may move"


@pytest.mark.parametrize(
    ("file", "words", "reason"),
    [
        (SERVO, {"suites": "CiA 402", "motion": "2000@100"}, "it moves the motor of motor, up to 2000 at 100 in the"),
        (IO, {"suites": "CiA 401", "outputs": True}, "it switches the outputs of motor"),
    ],
    ids=["motion", "outputs"],
)
def test_a_run_that_moves_a_motor_or_switches_outputs_needs_confirmation(
    tmp_path: Path, file: Path, words: dict[str, Any], reason: str
) -> None:
    known = {"do": "check", "node": "motor", "tier": "reading"}
    with motor(tmp_path, file) as served:
        said = talk(served, lambda opened: answer(opened, json.dumps({**known, **words})))
        assert said["asks"].startswith(reason)
        wrong = talk(served, lambda opened: answer(opened, json.dumps({**known, **words, "motion": "2000"})))
        assert wrong["error"].startswith("'2000': a distance and a velocity")


@pytest.fixture
def suites(tmp_path: Path) -> Path:
    (tmp_path / "suites").mkdir()
    return tmp_path / "suites" / "speed.yaml"


def test_a_suite_of_the_folder_is_red_with_its_frames_and_compared_with_the_run_before(
    tmp_path: Path, suites: Path
) -> None:
    with motor(tmp_path) as served:
        suites.write_text(SUITE.format(speed=0))
        green = run(served, suites="speed.yaml", sure=True)
        suites.write_text(SUITE.format(speed=1))
        red = run(served, suites="speed.yaml", sure=True)
    assert (green["rows"][1]["status"], green["result"]["changes"]) == ("ok", [])
    assert red["rows"][1]["status"] == "FAILED"
    assert any("> 605#40" in line for line in red["rows"][1]["why"])
    [change] = red["result"]["changes"]
    assert (change["before"], change["after"]) == ("ok", "failed")


def test_a_recording_becomes_a_suite(tmp_path: Path) -> None:
    async def recorded(opened: Any) -> str:
        for words in ({"do": "record"}, {"do": "read", "node": "motor", "object": "0x1000"}, {"do": "stop recording"}):
            assert "ok" in await answer(opened, json.dumps({"id": 1, **words}))
        make = {"id": 2, "do": "suite of recording", "node": "motor"}
        later = await answer(opened, json.dumps({**make, "from": 1000, "to": 1001}))
        assert "error" in later
        wrong = await answer(opened, json.dumps({**make, "from": 5, "to": 1}))
        assert wrong["error"] == "from and to are times in s, the first one before the second"
        return str((await answer(opened, json.dumps(make)))["ok"])

    with motor(tmp_path) as served:
        job = run(served, suites=talk(served, recorded), sure=True)
    assert [(each["step"], each["status"]) for each in job["rows"] if "step" in each] == [
        ("SDO read 0x1000:0 Device type", "ok")
    ]


def test_a_check_that_is_ended_still_does_its_teardown(tmp_path: Path, suites: Path) -> None:
    teardown = "teardown:\n  - sdo: {write: Motor.Target speed, value: 0}\n"
    steps = "steps:\n  - sdo: {read: Motor.Speed, expect: 0}\n  - wait: 1 min\n"
    suites.write_text(f"spec: 1\nname: long\nnode: motor\n{steps}{teardown}")

    async def end(opened: Any) -> dict[str, Any]:
        words = {"id": 1, "do": "check", "node": "motor", "suites": "speed.yaml", "tier": "", "sure": True}
        assert "ok" in await answer(opened, json.dumps(words))
        while not any(len(job["rows"]) > 1 or job["first"] for job in (await snapshot(opened))["jobs"]):
            pass
        await answer(opened, '{"id": 2, "do": "end job"}')
        return await ended(opened, "check")

    with motor(tmp_path) as served:
        job = talk(served, end)
    assert job["state"] == "ended"
    assert [each["status"] for each in job["rows"] if "step" in each][-2:] == ["interrupted", "ok"]
