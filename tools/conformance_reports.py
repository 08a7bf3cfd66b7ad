"""Runs the conformance suites of some devices, and writes their pages in docs/reports.

    .venv/bin/python tools/conformance_reports.py            all of them
    .venv/bin/python tools/conformance_reports.py drive      only these

Rule of this file: devices are simulated from their files; only stock canopen's node is on a bus, in this process.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from environment import ROOT
from interop_rows import conformance as stock

from eurobot_od.check.conformance import page, suite
from eurobot_od.check.conformance.page import DeviceRun
from eurobot_od.check.conformance.subject import Tier
from eurobot_od.check.reader import SuiteReader
from eurobot_od.check.results import SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.simulated import NodeUnderTest, run_simulated
from eurobot_od.check.vocabulary import Networks
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot import dialects

FOLDER = ROOT / "docs" / "reports"
MAKERS = ROOT / "tests" / "check" / "conformance" / "makers"
"""Files in the style of makers, each of no device that there is."""

NODE_ID = 5


def simulated(dictionary: Dictionary) -> list[SuiteResult]:
    """Run all chapters against the device simulated from its file."""
    file = dictionary.file
    networks = Networks(lambda _: file, load=lambda _: (dictionary,), refused=lambda _: None)
    suites = SuiteReader(networks).read_texts({file: suite.text(dictionary, Tier.DESTRUCTIVE)})

    def nodes(dictionaries: Mapping[str, Dictionary], *_: object) -> list[NodeUnderTest]:
        return [NodeUnderTest(SimulatedDevice(each)) for each in dictionaries.values()]

    return [run_simulated(each, RunOptions(keep_going=True), nodes) for each in suites]


def of_file(file: Path) -> DeviceRun:
    """Return what there is to say about a simulated device."""
    dictionary = Dictionary.load(file, NODE_ID)
    return DeviceRun(dictionary, Tier.DESTRUCTIVE, simulated(dictionary))


def of_node(name: str) -> DeviceRun:
    """Return what there is to say about one of the robot's nodes, run as its file says."""
    dictionary = dialects.load(name)
    return DeviceRun(dictionary, Tier.DESTRUCTIVE, simulated(dictionary))


def of_stock_canopen() -> DeviceRun:
    """Return what there is to say of stock canopen's node with the file of a clean device."""
    dictionary = Dictionary.load(stock.FILE, NODE_ID, "stock canopen")
    return DeviceRun(dictionary, Tier.DESTRUCTIVE, list(stock.results(stock.FILE)))


REPORTS: Mapping[str, Callable[[], DeviceRun]] = {
    "stock-canopen": of_stock_canopen,
    **{name: partial(of_node, name) for name in ("core", "drive", "navigation")},
    **{file.stem: partial(of_file, file) for file in sorted(MAKERS.glob("*.eds"))},
}


def write(names: Iterable[str]) -> None:
    """Write the pages with some names."""
    FOLDER.mkdir(exist_ok=True)
    for name in names:
        target = FOLDER / f"{name}.md"
        target.write_text(page.text(target, [REPORTS[name]()]), encoding="utf-8")
        print(target.relative_to(ROOT))


def main(words: Sequence[str]) -> None:
    """Write the pages that are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("name", nargs="*", choices=[*REPORTS, []], help="default: all")
    write(parser.parse_args(words).name or REPORTS)


if __name__ == "__main__":
    main(sys.argv[1:])
