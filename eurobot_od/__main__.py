"""The program `eurobot-od`, also `python -m eurobot_od`, and `canopen-workbench`: the same without a robot."""

from __future__ import annotations

import gc
import sys

from eurobot_od.cli import WORKBENCH, main
from eurobot_od.support.extras import put_off


def run() -> int:
    """Run the command line; Python need not look through all that is left before the process ends (2 ms)."""
    put_off("asammdf")  # python-can imports it wherever it is, which takes a second
    try:
        return main()
    finally:
        gc.freeze()


def workbench() -> int:
    """Run the command line under its other name, which is what it goes by from here on."""
    sys.argv[0] = WORKBENCH
    return run()


if __name__ == "__main__":
    sys.exit(run())
