"""Runs `eurobot-od` and writes the names of the EDS and DCF files that it opened.

`opened.py REPORT WORD...`: Python reports every file that is opened (PEP 578).
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

opened: set[str] = set()


def note(event: str, arguments: tuple[object, ...]) -> None:
    """Note the name of an EDS or DCF file that is opened."""
    if event == "open" and isinstance(arguments[0], (str, os.PathLike)):
        name = Path(arguments[0])
        if name.suffix.lower() in (".eds", ".dcf"):
            opened.add(str(name.resolve()))


if __name__ == "__main__":
    report = sys.argv.pop(1)
    sys.addaudithook(note)
    from eurobot_od.cli import main

    status = main()
    Path(report).write_text("\n".join(sorted(opened)))
    sys.exit(status)
