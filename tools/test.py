"""Sets up an environment and runs all checks in it: style, types, EDS files, tests.

`python3 tools/test.py [ARGUMENT...]`: with arguments, only pytest runs, with these. Tests marked `long` are left out;
`tools/nightly.py` runs those. This runs before anything is installed, so it uses the standard library only.
"""

from __future__ import annotations

import os
import sys

from environment import ONCE_MORE, ROOT, SHORT, SUITE, call, prepare
from steps import Step, python, run

STEPS = (
    Step("ruff check", python("-m", "ruff", "check", ".")),
    Step("ruff format", python("-m", "ruff", "format", "--check", "--quiet", ".")),
    Step("mypy --strict", python("-m", "mypy", "--strict")),
    Step("EDS files", python("tools/make_eds.py", "--check")),
    Step("pytest", python(*SUITE, *SHORT), python(*ONCE_MORE, *SHORT)),
)


def main(arguments: list[str]) -> int:
    """Run all checks, also after one that failed; return 1 if any did."""
    if arguments:
        os.chdir(ROOT)
        return call(prepare("test"), "-m", "pytest", *arguments)
    return run(STEPS)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
