"""Where a command's file goes: `-o FILE`, written whole, or standard output."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli.table import option
from eurobot_od.errors import LocalError
from eurobot_od.support.files import write_whole

if TYPE_CHECKING:
    from eurobot_od.od.dcf import Dcf

OUTPUT = option("-o", "--output", type=Path, metavar="FILE", help="default: standard output")


def write(output: Path | None, text: str) -> None:
    """Write a text; raises OSError, and leaves what was in the file then."""
    if output is None:
        sys.stdout.write(text)
    else:
        write_whole(output, text.encode())


def write_dcf(output: Path | None, dcf: Dcf) -> None:
    """Write a DCF, after the files beside it; raises as `write`, and LocalError where there is no place for those."""
    if output is not None:
        # First, so that a DCF that is there is whole: it names them.
        for name, content in dcf.files.items():
            write_whole(output.with_name(name), content)
        write_whole(output, dcf.content)
    elif dcf.files:
        raise LocalError(f"the DCF needs files beside it ({', '.join(dcf.files)}): write it by -o FILE")
    else:
        sys.stdout.flush()  # what was printed as text must not come after these bytes
        sys.stdout.buffer.write(dcf.content)
