"""`edit` changes an EDS or DCF, and keeps every other byte."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.signature import Option
from eurobot_od.lint.edits import VERBS, Verb, difference, make_edit
from eurobot_od.od.document import read_bytes
from eurobot_od.support.files import write_whole


def edit(
    file: Annotated[str, Option(metavar="FILE", is_file=True)],
    verb: Annotated[Verb, Option(choices=VERBS)],
    words: Annotated[Sequence[str], Option(metavar="WORD")] = (),
    *,
    output: Annotated[Path | None, Option("-o", metavar="FILE", is_output=True)] = None,
    dry_run: bool = False,
) -> ExitStatus:
    """Change an EDS or DCF: comments, order, line ends and every other line stay as they are.

    A change that makes an error which `lint` finds is refused: an object twice, a value out of range, a PDO that maps
    what cannot be mapped or is longer than 8 bytes. Other new findings are printed, and the exit status is 1.

    file: an EDS or DCF; of an XDD `export eds` makes one
    verb: what to do
    words: an object, by 0x2001, 0x2001:3 or name, and what about it; type=, access=, default=, low=, high=, map=1 and
        kind=RECORD are short for the keys
    output: the file to write (default: the same file)
    dry_run: show the difference, and write nothing

    $ edit motor.eds set 0x1017 DefaultValue=500 HighLimit=5000
    $ edit motor.eds add 2102 "Filter time" type=UNSIGNED16 access=rw default=20
    $ edit motor.eds map TPDO1 "Motor.Speed" 0x6064
    $ edit motor.eds insert profile 301 --dry-run
    """
    before = read_bytes(file)
    made = make_edit(before, file, verb.changes(words))
    for each in made.errors:
        complain(f"not changed: {each}")
    if made.errors:
        return ExitStatus.WRONG_INPUT
    if dry_run:
        print("".join(f"{line}\n" for line in difference(before, made.data, file)), end="")
    elif made.data != before or output:
        write_whole(output or Path(file), made.data)
    print("".join(f"{each}\n" for each in made.warnings), end="")
    return ExitStatus.FOUND if made.warnings else ExitStatus.FINE
