"""Runs what the suite leaves out, as it takes minutes: tests marked `long`, and properties on many more random inputs.

`python3 tools/long_tests.py`. The exit status is 1 if any failed.
"""

from __future__ import annotations

import os
import sys

from environment import ONCE_MORE, ROOT, WORKERS, call, prepare

CAMPAIGNS = {
    "long tests": ("-m", "long"),
    "properties": ("--hypothesis-profile=campaign", "tests/properties"),
}
"""What is run, and pytest's arguments for it; the profile is in tests/conftest.py."""


def main() -> int:
    """Run all campaigns, also after one that failed; return 1 if any did."""
    python = prepare("test")
    os.chdir(ROOT)
    failed = []
    for name, arguments in CAMPAIGNS.items():
        print(f"== {name}", flush=True)
        several = ("-n", WORKERS, "--dist", "worksteal", "--durations=5")
        if call(python, "-m", "pytest", "-q", *several, *arguments) and call(python, *ONCE_MORE, *arguments):
            failed.append(name)
    print(f"failed: {', '.join(failed)}" if failed else "all campaigns passed", flush=True)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
