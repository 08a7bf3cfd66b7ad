"""The program `eurobot-od`, also `python -m eurobot_od`, and `canopen-workbench`: the same without a robot.

Nothing but the standard library is imported before `run` can answer Ctrl-C: imports are half of what a command takes.
"""

from __future__ import annotations

import gc
import sys

INTERRUPTED = 130
"""Exit status after Ctrl-C, as a shell has it: 128 and the number of SIGINT."""


def run(name: str = "") -> int:
    """Run the command line, under another `name` of the program if one is given; return its exit status.

    Python need not look through all that is left before the process ends (2 ms).
    """
    try:
        from eurobot_od.cli import main
        from eurobot_od.support.extras import put_off

        put_off("asammdf")  # python-can imports it wherever it is, which takes a second
        sys.argv[0] = name or sys.argv[0]
        return main()
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        gc.freeze()


def workbench() -> int:
    """Run the command line as `canopen-workbench`, which is what it goes by from here on."""
    return run("canopen-workbench")


if __name__ == "__main__":
    sys.exit(run())
