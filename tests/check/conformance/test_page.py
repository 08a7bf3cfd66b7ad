"""The page for a device's maker: facts, score, each red step with its frames, in three forms."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from eurobot_od.check.conformance import page
from eurobot_od.check.conformance.page import DeviceRun
from eurobot_od.check.conformance.subject import Tier
from eurobot_od.device.faults.device import FAULTS
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import UnknownName
from eurobot_od.od.dictionary import Dictionary
from tests.kit.devices import IO_MODULE, NODE_ID, results, suites


@cache
def report() -> DeviceRun:
    """What there is to say about an I/O module with a fault: of the chapter that finds it."""
    kind = FAULTS["guarding-toggle-stuck"].given_to(SimulatedDevice)
    done = list(results(suites(IO_MODULE, chapter="error-control"), kind))
    return DeviceRun(Dictionary.load(IO_MODULE, NODE_ID), Tier.REVERSIBLE, done, "today")


SAID = [
    "# Conformance of io-module",
    "| Product | DIO 16 |",
    "| Tier | reversible |",
    "| Made by | today |",
    "| node guarding and heartbeat consumer |",
    "### Node guarding: 2. PRE-OPERATIONAL, toggle bit 1",
    "| Clause | CiA 301, 7.2.8.3.2.1 |",
    "| Expected | 705\\#FF |",
    "> 705#R1                remote frame",
    "| 7.3 | its toggle bit | FAILED |",
]


def test_the_page_says_what_was_asked_and_what_came() -> None:
    text = page.text(Path("page.md"), [report()])
    assert [said for said in SAID if said not in text] == []


def test_the_html_is_one_page_with_everything_escaped() -> None:
    html = page.text(Path("page.html"), [report()])
    assert html.startswith("<!DOCTYPE html>")
    assert "&gt; 705#R1" in html


def test_what_follows_a_red_step_of_its_group_is_a_line_each() -> None:
    text = page.text(Path("page.md"), [report()])
    assert text.count("### Node guarding") == 1
    assert "| 4. STOPPED, toggle bit 1 |" in text


def test_json_has_the_same() -> None:
    (data,) = json.loads(page.text(Path("page.json"), [report()]))
    assert (data["device"], data["tier"], len(data["ctt"])) == ("io-module", "reversible", 127)
    assert {each["number"] for each in data["ctt"] if each["verdict"] == "failed"} >= {"7.3"}


def test_another_suffix_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"form of a report '\.txt'"):
        page.check_form(Path("page.txt"))
