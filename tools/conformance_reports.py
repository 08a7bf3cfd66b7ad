"""Runs the conformance suites of some devices, and writes their pages in docs/reports.

    .venv/bin/python tools/conformance_reports.py            all of them
    .venv/bin/python tools/conformance_reports.py drive      only these

Devices are simulated from their files; only stock canopen's node is on a bus, in this process.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from environment import ROOT

if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))  # the devices are the tests'

from interop_rows import conformance as stock

from eurobot_od.check.conformance import page
from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.conformance.page import DeviceRun
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot import dialects
from tests.kit.devices import MAKERS, NODE_ID, results, suites_of

FOLDER = ROOT / "docs" / "reports"

STOCK = "stock-canopen"
"""Stock canopen's node with the file of a clean device."""

SIMULATED: Mapping[str, Callable[[], Dictionary]] = {
    **{name: partial(dialects.load, name) for name in ("core", "drive", "navigation")},
    **{file.stem: partial(Dictionary.load, file, NODE_ID) for file in sorted(MAKERS.glob("*.eds"))},
}
NAMES = (STOCK, *SIMULATED)


def run(name: str) -> DeviceRun:
    """Ask a device for everything, and return what there is to say."""
    if name == STOCK:
        dictionary = Dictionary.load(stock.FILE, NODE_ID, "stock canopen")
        done = stock.results(stock.FILE)
    else:
        dictionary = SIMULATED[name]()
        done = list(results(suites_of(dictionary, Tier.DESTRUCTIVE)))
    return DeviceRun(dictionary, Tier.DESTRUCTIVE, done)


def write(names: Iterable[str]) -> None:
    """Write the pages with some names."""
    FOLDER.mkdir(exist_ok=True)
    for name in names:
        target = FOLDER / f"{name}.md"
        target.write_text(page.text(target, [run(name)]), encoding="utf-8")
        print(target.relative_to(ROOT))


def main(words: Sequence[str]) -> None:
    """Write the pages that are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("name", nargs="*", choices=[*NAMES, []], help="default: all")
    write(parser.parse_args(words).name or NAMES)


if __name__ == "__main__":
    main(sys.argv[1:])
