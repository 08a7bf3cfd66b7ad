"""The program `eurobot-od`, also `python -m eurobot_od`.

Rule of this file: nothing but the call, and the end of the process.
"""

from __future__ import annotations

import gc
import sys

from eurobot_od.cli import main


def run() -> int:
    """Run the command line; Python need not look through all that is left before the process ends (2 ms)."""
    try:
        return main()
    finally:
        gc.freeze()


if __name__ == "__main__":
    sys.exit(run())
