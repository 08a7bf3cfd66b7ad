"""The conformance suite of a file, against stock canopen's node with the same file on an in-process bus.

What is red there is a table with the reason beside each; anything else red, or green, differs.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from eurobot_od.check.conformance import suite
from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.conformance.step import BOOT_TIME
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import run_live
from eurobot_od.check.report import Status, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.check.suite import Suite
from eurobot_od.od.dictionary import Dictionary
from interop_rows.bench import new_channel, open_bus, stock_network
from interop_rows.row import Answer, agree

FILE = Path(__file__).parents[2] / "tests" / "lint" / "samples" / "clean.eds"
NODE_ID = 5
"""Node-ID of a device of no network; the file has none."""

PATIENCE = "1 s"
"""How long the node may take to boot: it is in this process, and what it never sends is not awaited for long."""

RED = {
    "7.2.8.3.3 Boot-up": "no boot-up after a reset",
    "7.3.2.2 NMT state": "stays in INITIALISING after a reset until a command comes",
    "7.3.2.2.4 NMT state": "answers SDO in STOPPED",
    "7.3.2.2.3 Values": "a reset does not restore values that were written",
    "7.2.4.3.17 Unknown sub-index": "every sub-index of a VAR gives the VAR",
    "7.2.4.3.17 Wrong length": "accepts any length for a BOOLEAN",
    "7.2.4.3.17 Limits": "accepts values outside LowLimit and HighLimit",
    "7.4.4 Length of the type": "refuses an object without a value with 0x060A0023",
    "7.2.4.3.12 SDO block upload": "answers with a segmented upload although the client did not offer that",
    "7.5.2.35 RPDO communication": "the identifier of a valid PDO can be changed",
    "7.5.2.37 TPDO communication": "the identifier and the inhibit time of a valid PDO can be changed",
    "7.5.2.36 RPDO mapping": "accepts any entry in any order",
    "7.5.2.38 TPDO mapping": "accepts any entry in any order, and more than 64 bits",
    "7.5.2.37 TPDO transmission": "the event timer sends nothing",
    "7.2.2.2 TPDO transmission": "SYNC is not heard",
    "7.2.7 EMCY": "does not report an RPDO that is too short; 0x1001 and 0x1003 show no error",
    "7.5.2.4 Error history": "any number can be written to 0x1003",
    "7.5.2.13 Store": "0x1010 needs no signature",
    "7.5.2.14 Restore": "0x1011 needs no signature",
    "7.4.9 Structure": "sub-index 255 of 0x1000 gives the value of 0x1000",
    "7.2.4.3.13 SDO block upload": "has no block upload, and does not refuse one",
    "7.5.2.23 Verify configuration": "a change of the configuration does not clear 0x1020",
    "7.3.5 Identifiers": "SYNC, TIME and EMCY accept any identifier",
    "7.3.5 RPDO identifier": "accepts any identifier",
    "7.3.5 TPDO identifier": "accepts any identifier",
    "7.2.2.5.2 TPDO by remote frame": "does not answer remote frames",
    "7.5.2.37 SYNC start value": "SYNC is not heard",
    "7.2.8.3.2.1 Node guarding": "does not answer remote frames",
    "7.5.2.12 Life guarding": "does not answer remote frames",
    "7.2.8.2.2 Heartbeat or guarding": "does not answer remote frames",
    "7.5.2.19 Consumer heartbeat time": "watches no node, and accepts one node twice",
    "7.5.2.6 SYNC producer": "sends no SYNC",
    "7.2.2.2 SYNC producer": "sends no SYNC",
    "7.5.2.6 SYNC consumer": "SYNC is not heard",
    "7.5.2.22 SYNC counter": "0x1019 accepts any number at any time",
    "7.5.2.13 SYNC": "sends no SYNC, and a reset does not restore values that were written",
}
"""Clauses and topics with failing steps, and the node's fault."""


def of_stock_node(_: Path) -> Answer:
    """Run all chapters, and compare the topics that have red steps with the table."""
    steps = [step for result in results(FILE) for step in result.steps]
    red = {step.name.partition(":")[0] for step in steps if step.status is Status.FAILED}
    agree("the topics that are red", sorted(red), sorted(RED))
    green = {step.name.partition(":")[0] for step in steps if step.status is Status.PASSED} - red
    reasons = "; ".join(f"{topic}: {reason}" for topic, reason in RED.items())
    return Answer(f"{len(green)} topics green, {len(red)} red", f"red topics: {reasons}")


def results(file: Path) -> list[SuiteResult]:
    """Run all chapters of a file at the same time, each against a node of stock canopen on a bus of its own."""
    dictionary = Dictionary.load(file, NODE_ID)
    networks = Networks(lambda _: file, load=lambda _: (dictionary,), refused=lambda _: None)
    text = suite.text(dictionary, Tier.DESTRUCTIVE).replace(BOOT_TIME, PATIENCE)
    chapters = tuple(SuiteReader(networks).read_texts({file: text}))
    with _silent(), ThreadPoolExecutor(len(chapters)) as threads:  # a chapter waits most of its time
        return list(threads.map(lambda each: result(each, file), chapters))


def result(chapter: Suite, file: Path) -> SuiteResult:
    """Run one chapter against a new node."""
    channel = new_channel()
    with stock_network(open_bus(channel)) as network:
        network.create_node(NODE_ID, str(file))
        return run_live(chapter, RunOptions(keep_going=True), lambda: open_bus(channel))


@contextmanager
def _silent() -> Iterator[None]:
    """Switch off canopen's log, which has a traceback for each refused request."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
