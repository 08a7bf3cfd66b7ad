"""Runs all checks on a clean machine; `.ci/run` starts it. Longer ones are in `nightly.py`."""

from __future__ import annotations

import sys

import test
from environment import ONCE_MORE, SUITE
from steps import Step, python, run

PAGE = ("-m", "long", "tests/web", "tests/robot/web", "--ignore-glob=*/test_axe.py")
"""The tests in a browser, without axe-core's look at each view and width, which the nightly takes."""

STEPS = (
    Step("other programs", python("tools/interop.py", "--install")),  # tshark, a browser, ...: kept for what follows
    *test.STEPS,
    Step("interop", python("tools/interop.py", "--local")),
    Step("site", python("tools/make_site.py")),
    Step("page and site in a browser", python(*SUITE, *PAGE), python(*ONCE_MORE, *PAGE)),
    Step("wheel", python("tools/wheel.py", "3.11")),
    Step("lowest versions", python("tools/pythons.py", "lowest")),
)

if __name__ == "__main__":
    sys.exit(run(STEPS))
