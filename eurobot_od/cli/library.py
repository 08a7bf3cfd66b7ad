"""The library of device files: `devices` lists it, and adds files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.devices import Devices, LibraryFolders
from eurobot_od.cli.options import Json, give
from eurobot_od.cli.signature import Option
from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.library.index import LibraryEntry, described
from eurobot_od.library.library import Library
from eurobot_od.lint.findings import LEVELS, Severity, count
from eurobot_od.lint.model import load
from eurobot_od.lint.rules import lint_device
from eurobot_od.od.document import read_bytes
from eurobot_od.od.formats import SUFFIXES, is_xml
from eurobot_od.od.maker import DEVICE_FILE, device_yaml_of
from eurobot_od.od.normal import Change, in_normal_form
from eurobot_od.support.files import read_whole, write_whole
from eurobot_od.support.texts import amount, columns, one_line


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
        checked = [_checked(each, known.folders[0], fix, replace) for each in files]
        for added in checked:
            added.put()
        for added in checked:  # beside all that are there now
            print("\n".join(map(one_line, added.lines(known))))
        return ExitStatus.FINE
    entries = known.entries
    lines = columns(_rows(known)) if entries else [f"no device files in {', '.join(map(str, known.folders))}"]
    give(as_json, list(map(_as_data, entries)), lines)
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


def _as_data(entry: LibraryEntry) -> dict[str, Any]:
    return entry._asdict() | {"path": str(entry.path)}


class AddedFile(NamedTuple):
    """A device file that has been checked: where it comes from and goes to, its content, and what was found in it."""

    file: Path
    target: Path
    content: bytes
    entry: LibraryEntry
    found: Sequence[str]
    repaired: Sequence[str]

    def put(self) -> None:
        """Write it into the library, with what its maker says beside it; raises OSError."""
        self.target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(self.target, self.content)
        if beside := device_yaml_of(self.file):
            write_whole(self.target.with_name(f"{self.target.stem}.{DEVICE_FILE}"), read_whole(beside))

    def lines(self, library: Library) -> Iterator[str]:
        """Yield what was done, and what is to be known about it."""
        yield from self.repaired
        entry = self.entry
        numbers = ":".join(f"0x{each:08X}" for each in entry.identity[:3])
        title = " ".join(filter(None, (entry.vendor_name, entry.product_name)))
        yield f"{self.target}: {numbers} {title}".rstrip() + f"{''.join(f', {each}' for each in self.found)}"
        if not entry.is_identified:
            yield f"{self.target}: it says neither vendor-ID nor product code (0x1018), so no device is known by it"
        same = [each.path.name for each in library.entries if _is_of(each, entry) and each.path != self.target]
        if same:
            yield f"{self.target}: also of this product: {', '.join(same)}"


def _is_of(one: LibraryEntry, other: LibraryEntry) -> bool:
    return other.is_identified and one.identity[:2] == other.identity[:2]


def _checked(file: Path, folder: Path, fix: bool, replace: bool) -> AddedFile:
    """Read a file that is to be added, and check it; raises DictionaryError, LocalError."""
    entry, content = described(file), read_bytes(file)
    if entry.problem:
        raise DictionaryError(file, None, entry.problem)
    if file.suffix.lower() not in SUFFIXES:
        raise LocalError(f"{file}: a device file ends in {', '.join(SUFFIXES)}")
    changes: list[Change] = []
    suffix = file.suffix
    if fix:
        suffix = ".eds" if is_xml(content) else suffix
        content, changes = in_normal_form(content, str(file))
    maker = re.sub(r"[^\w.-]+", "-", entry.vendor_name).strip("-.") or f"{entry.vendor:08X}"
    target = folder / maker / f"{file.stem}{suffix}"
    if target.is_file() and not replace and read_whole(target) != content:
        raise LocalError(f"{target}: another file of this name is there; --replace replaces it")
    findings = lint_device(load(content, str(file)), str(file))
    counts = {each: count(findings, each) for each in (Severity.ERROR, Severity.WARNING)}
    found = [amount(number, LEVELS[each]) for each, number in counts.items() if number]
    repaired = [f"{file}:{each.line}: {each.what}" for each in changes]
    return AddedFile(file, target, content, entry, found, repaired)
