"""`lss`: one line for a device, and one where there is none."""

from __future__ import annotations

import pytest

from eurobot_od.client.description import Identity
from tests.cli.console import Said, run
from tests.client.lss_slave import WAITING, LssSlave
from tests.client.wired import WiredBus
from tests.rows import rows

ONE, OTHER = Identity(1, 2, 3, 4), Identity(1, 2, 3, 5)
TEXT = "0x00000001:0x00000002:0x00000003:0x0000000"


def said(
    capsys: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch, slaves: list[LssSlave], words: list[str]
) -> Said:
    patch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(*slaves))
    return run(capsys, "lss", *words, "--timeout", "1 ms")


@rows(
    "words, status, out, err",
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
            0,
            "the only device  stored, bit rate changes in 2 s\n",
            "",
        ),
        (["set", "--node-id", "0"], 2, "", "node-ID 0 is not in 1..127 (255 for none)"),
        (
            ["set", "--bit-rate", "100"],
            2,
            "",
            "100 kbit/s is not in CiA 305's table: 1000, 800, 500, 250, 125, 50, 20, 10",
        ),
        (["set"], 2, "", "nothing to set: give --node-id, --bit-rate, --store or --activate"),
    ],
)
def test_find_and_set(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    status: int,
    out: str,
    err: str,
) -> None:
    slaves = [LssSlave(ONE), LssSlave(OTHER, node_id=7)]
    complaint = f"eurobot-od: {err}\n" if err else ""
    assert said(capsys, monkeypatch, slaves, words) == (status, out, complaint)
    assert {slave.state for slave in slaves} == {WAITING}


def test_nobody_without_a_node_id(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert said(capsys, monkeypatch, [], ["find"]) == (1, "no device without a node-ID answers\n", "")
    assert said(capsys, monkeypatch, [], ["set", "--store"]).status == 1


@rows("identity", ["1:2:3", "1:2:3:4:5", "a:2:3:4", "1:2:3:0x100000000", "-1:2:3:4"])
def test_an_identity_is_four_numbers(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, identity: str
) -> None:
    done = said(capsys, monkeypatch, [], ["find", f"--identity={identity}"])
    assert done.status == 2
    assert "is not vendor:product:revision:serial" in done.err
