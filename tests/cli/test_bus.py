"""`watch`, `sync` and `time`: what is printed, what is sent, and what is refused."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

import pytest

from eurobot_od.cli import options
from eurobot_od.client.master import Master, produce, syncs
from eurobot_od.errors import BusError
from eurobot_od.od.identity import Identity
from eurobot_od.sdo.client import UNANNOUNCED
from tests.cli.console import Said, run
from tests.client.lss_slave import WAITING, LssStation
from tests.client.test_boot import Beating, beats
from tests.client.test_reconnecting import Unplugged
from tests.client.wired import WiredBus
from tests.eds_text import DEVICE_TYPE


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> WiredBus:
    """A bus in simulated time, with node 5 on it for 3 s."""
    bus = WiredBus(Beating([(0.5, b"\0"), *beats(1, 2, 3)]))
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: bus)
    monkeypatch.setattr("eurobot_od.client.master.time.monotonic", lambda: bus.now)
    monkeypatch.setattr("eurobot_od.client.master.Master.__init__.__defaults__", (0.5, lambda: bus.now, UNANNOUNCED))
    return bus


@pytest.mark.usefixtures("bus")
def test_watch_prints_a_line_an_event(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "watch", "--for", "9 s")
    assert (said.status, said.err) == (1, "")
    assert [line.split(maxsplit=1)[1] for line in said.out.splitlines()] == [
        "node 5 has booted",
        "node 5 is lost (operational)",
    ]


@pytest.mark.usefixtures("bus")
def test_watch_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "watch", "5", "--for", "2 s", "--json")
    assert said.status == 0
    assert json.loads(said.out) == {"time": 0.5, "node_id": 5, "change": "booted", "state": "boot-up"}


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize("within", ["1 s", "5 s"])  # which is longer than the watch
def test_an_expected_node_that_is_missing(capsys: pytest.CaptureFixture[str], within: str) -> None:
    said = run(capsys, "watch", "7", "--for", "2 s", "--within", within)
    assert (said.status, said.out.splitlines()[-1].split(maxsplit=1)[1]) == (1, "node 7 is lost")


@pytest.mark.usefixtures("bus")
def test_nodes_have_the_names_of_their_network(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "a.eds").write_text(DEVICE_TYPE)
    (tmp_path / "net.yaml").write_text(
        "nodes: {left: {file: a.eds, node_id: 5}, right: {file: a.eds, node_id: 7}}", encoding="ascii"
    )
    words = ["--network", str(tmp_path / "net.yaml"), "--for", "2 s", "--within", "1 s"]
    said = run(capsys, "watch", *words)
    assert (said.status, [line.split(maxsplit=1)[1] for line in said.out.splitlines()]) == (
        1,
        ["node 5 left has booted", "node 7 right is lost"],
    )
    said = run(capsys, "watch", "right", "--json", *words)
    assert json.loads(said.out.splitlines()[-1])["name"] == "right"
    assert run(capsys, "watch", "middle", *words).complaint == "eurobot-od: unknown node 'middle'; known: left, right"


def test_sync(capsys: pytest.CaptureFixture[str], bus: WiredBus) -> None:
    assert run(capsys, "sync", "--period", "10 ms", "--counter", "2", "--count", "3") == (0, "", "")
    assert [str(frame) for frame in bus.sent] == ["080#01", "080#02", "080#01"]
    assert bus.now == pytest.approx(0.03)


def test_time_is_sent_once(capsys: pytest.CaptureFixture[str], bus: WiredBus) -> None:
    assert run(capsys, "time", "--utc", "--cob-id", "0x101") == (0, "", "")
    assert [(frame.cob_id, len(frame.data)) for frame in bus.sent] == [(0x101, 6)]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["watch", "128"], "node-ID 128 is not in 1..127"),
        (["watch", "--guard", "1 s"], "--guard polls the nodes that are named"),
        (["sync", "--counter", "1"], "a counter of SYNC ends at 2 to 240, not at 1"),
        (["sync", "--period", "0 s"], "the period must be longer than 0"),
        (["sync", "--cob-id", "80"], "80 is decimal or hexadecimal; write 0x80"),
        (["sync", "--cob-id", "0x605"], "0x605 is restricted to the SDO request of node 5 (CiA 301, 7.3.5)"),
        (["sync", "--cob-id", "0x800"], "'0x800' is not an 11-bit identifier"),
    ],
)
def test_wrong_command_lines_are_one_line(
    capsys: pytest.CaptureFixture[str], bus: WiredBus, words: list[str], complaint: str
) -> None:
    said = run(capsys, *words)
    assert said.status == 2
    assert complaint in said.err
    assert bus.sent == []


def test_without_reconnect_a_lost_bus_ends_the_command() -> None:
    bus = Unplugged()
    master = Master(bus, clock=lambda: bus.now)
    with pytest.raises(BusError):
        produce(master, islice(syncs(), 10), 0.5, options.BusOptions().guard(master, no_reconnect=True))


ONE, OTHER = Identity(1, 2, 3, 4), Identity(1, 2, 3, 5)
TEXT = "0x00000001:0x00000002:0x00000003:0x0000000"


def said(
    capsys: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch, slaves: list[LssStation], words: list[str]
) -> Said:
    patch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(*slaves))
    return run(capsys, "lss", *words, "--timeout", "1 ms")


@pytest.mark.parametrize(
    ("words", "status", "out", "err"),
    [
        (["find"], 0, f"{TEXT}4  no node-ID\n", ""),
        (["find", "--identity", "1:2:3:5"], 0, f"{TEXT}5  node-ID 7\n", ""),
        (["find", "--identity", "0x1:2:3:6"], 1, "", f"no device has the identity {TEXT}6"),
        (
            ["set", "--node-id", "5", "--bit-rate", "250", "--store"],
            0,
            f"{TEXT}4  node-ID 5, 250 kbit/s, stored\n",
            "",
        ),
        (["set", "--identity", "1:2:3:5", "--node-id", "255"], 0, f"{TEXT}5  no node-ID\n", ""),
        (
            ["set", "--alone", "--store", "--activate", "2 s"],
            1,
            "",
            "2 devices answer, so none is alone on the bus: --identity selects one",
        ),
        (["set", "--node-id", "0"], 2, "", "node-ID 0 is not in 1..127 (255 for none)"),
        (
            ["set", "--bit-rate", "100"],
            2,
            "",
            "100 kbit/s is not in CiA 305's table: 1000, 800, 500, 250, 125, 50, 20, 10",
        ),
        (["set"], 2, "", "nothing to set: --node-id, --bit-rate, --store and --activate say what"),
        (["find", "--node-id", "5"], 2, "", "--node-id, --bit-rate, --store and --activate are for `lss set`"),
    ],
)
def test_lss_finds_a_device_and_sets_its_node_id(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    status: int,
    out: str,
    err: str,
) -> None:
    slaves = [LssStation(ONE), LssStation(OTHER, node_id=7)]
    complaint = f"eurobot-od: {err}\n" if err else ""
    assert said(capsys, monkeypatch, slaves, words) == (status, out, complaint)
    assert {slave.state for slave in slaves} == {WAITING}


def test_lss_finds_no_device_without_a_node_id(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert said(capsys, monkeypatch, [], ["find"]) == (1, "no device without a node-ID answers\n", "")
    assert said(capsys, monkeypatch, [], ["set", "--store"]).status == 1


@pytest.mark.parametrize("identity", ["1:2:3", "1:2:3:4:5", "a:2:3:4", "1:2:3:0x100000000", "-1:2:3:4"])
def test_an_identity_is_four_numbers(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, identity: str
) -> None:
    done = said(capsys, monkeypatch, [], ["find", f"--identity={identity}"])
    assert done.status == 2
    assert "is not vendor:product:revision:serial" in done.err
