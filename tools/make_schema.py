#!/usr/bin/env python3
"""Makes the JSON Schema of check suites from the format's tables, or checks that it is what they say.

Rule of this file: only the file and the command line; what the schema says is the format's.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # the package next door, installed or not

from eurobot_od.check.reader import schema  # noqa: E402
from eurobot_od.robot.check import shipped  # noqa: E402

FILE = shipped.SCHEMA
FINE, DIFFERENT = 0, 1


def text() -> str:
    """Return the schema file's text."""
    return json.dumps(schema(), indent=1) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; exit status 0 fine, 1 the file differs."""
    command = argparse.ArgumentParser(description="Make the JSON Schema of check suites.")
    command.add_argument("--output", type=Path, default=FILE, metavar="FILE", help="where it is written")
    command.add_argument("--check", action="store_true", help="write nothing; exit 1 if the file differs")
    options = command.parse_args(arguments)
    if not options.check:
        options.output.write_text(text(), encoding="utf-8")
        return FINE
    same = options.output.is_file() and options.output.read_text(encoding="utf-8") == text()
    print(f"{options.output}: {'is' if same else 'is not'} what the format says")
    return FINE if same else DIFFERENT


if __name__ == "__main__":
    sys.exit(main())
