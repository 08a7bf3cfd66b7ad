"""The program `eurobot-od`, also `python -m eurobot_od`, and `canopen-workbench`: the same without a robot.

Nothing but the standard library is imported before `run` can answer Ctrl-C: imports are half of what a command takes.
"""

from __future__ import annotations

import gc
import sys

INTERRUPTED = 130
"""Exit status after Ctrl-C, as a shell has it: 128 and the number of SIGINT."""


def run(*, alone: bool = False) -> int:
    """Run the command line and return its exit status; `alone`: as the workbench, which goes by its own name.

    Python need not look through all that is left before the process ends (2 ms).
    """
    try:
        from eurobot_od.cli import WORKBENCH, main
        from eurobot_od.support.extras import put_off

        put_off("asammdf")  # python-can imports it wherever it is, which takes a second
        if alone:
            sys.argv[0] = WORKBENCH
        return main()
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        gc.freeze()


def workbench() -> int:
    """Run the command line without a robot."""
    return run(alone=True)


if __name__ == "__main__":
    sys.exit(run())
