"""Sets up an environment and runs all checks in it: tests, types, style, EDS files. `python3 tools/test.py`

Tests marked `long` are left out; `tools/long_tests.py` runs those. This runs before anything is installed, so it uses
the standard library only. With arguments, only pytest runs, and gets them.
"""

from __future__ import annotations

import os
import sys

from environment import ONCE_MORE, ROOT, SHORT, WORKERS, call, prepare

CHECKS = (
    ("ruff check", ("-m", "ruff", "check", ".")),
    ("mypy --strict", ("-m", "mypy", "--strict")),
    ("EDS files", ("tools/make_eds.py", "--check")),
    ("pytest", ("-m", "pytest", "-q", "-n", WORKERS, "--dist", "worksteal", "--durations=10", *SHORT)),
)


def main(arguments: list[str]) -> int:
    """Run all checks, also after one that failed; return 1 if any did."""
    python = prepare("test")
    os.chdir(ROOT)
    if arguments:
        return call(python, "-m", "pytest", *arguments)
    failed = []
    for name, words in CHECKS:
        print(f"== {name}", flush=True)
        if call(python, *words):
            failed.append(name)
    if "pytest" in failed and not call(python, *ONCE_MORE):
        print("pytest: what failed beside others has passed alone", flush=True)
        failed.remove("pytest")
    print(f"failed: {', '.join(failed)}" if failed else "all checks passed", flush=True)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
