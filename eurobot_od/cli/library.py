"""`devices` lists the library of device files, and adds files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.devices import Devices, LibraryFolders
from eurobot_od.cli.options import Json, give
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError
from eurobot_od.library.adding import checked
from eurobot_od.library.library import Library
from eurobot_od.support.texts import columns, one_line


def devices(
    action: Literal["add"] | None = None,
    files: Annotated[Sequence[Path], Option(metavar="FILE", is_file=True)] = (),
    *,
    library: LibraryFolders = (),
    fix: bool = False,
    replace: bool = False,
    as_json: Json = False,
) -> ExitStatus:
    """List the library of device files, by which nodes are known whose files nobody names; or add files to it.

    A file is checked before it is added, and nothing is added if one of the files cannot be read.

    action: add files (default: list what is there)
    files: EDS, DCF, XDD or XDC files
    fix: add: in the normal form that every tool reads, as `lint --fix` writes it
    replace: add: in place of another file of the same name

    $ devices
    $ devices add motor.eds --library makers
    """
    if action is None and files:
        raise LocalError(f"devices {files[0]}: to add it write `devices add {files[0]}`")
    if action and not files:
        raise LocalError("add which files? Name EDS, DCF, XDD or XDC files")
    if (fix or replace) and not action:
        raise LocalError(f"--{'fix' if fix else 'replace'} is for `devices add`")
    known = Devices(library=library).known_library
    if action:
        found = [checked(each, known.folders[0], fix, replace) for each in files]
        for added in found:
            added.put()
        for added in found:  # after all have been added
            print("\n".join(map(one_line, added.lines(known))))
        return ExitStatus.FINE
    entries = known.entries
    lines = columns(_rows(known)) if entries else [f"no device files in {', '.join(map(str, known.folders))}"]
    give(as_json, [each._asdict() | {"path": str(each.path)} for each in entries], lines)
    for each in entries:
        if each.problem:
            complain(f"{each.path}: {each.problem}")
    return ExitStatus.FINE


def _rows(library: Library) -> Iterator[tuple[str, ...]]:
    yield "vendor", "product", "revision", "type", "maker", "device", "file"
    for folder in library.folders:
        for each in (each for each in library.entries if each.path.is_relative_to(folder)):
            type_ = "-" if each.device_type is None else f"0x{each.device_type:08X}"
            names = each.vendor_name or "-", each.product_name or "-"
            numbers = (f"0x{number:08X}" for number in each.identity[:3])
            yield *numbers, type_, *names, str(each.path.relative_to(folder))
