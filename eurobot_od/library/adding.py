"""Adds device files to a library, each checked before anything is written."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.library.library import Library, LibraryEntry, described
from eurobot_od.lint.findings import LEVELS, Severity, count
from eurobot_od.lint.model import load
from eurobot_od.lint.rules import lint_device
from eurobot_od.od.document import read_bytes
from eurobot_od.od.formats import SUFFIXES, is_xml
from eurobot_od.od.maker import DEVICE_FILE, device_yaml_of
from eurobot_od.od.normal import Change, in_normal_form
from eurobot_od.support.files import read_whole, write_whole
from eurobot_od.support.texts import amount


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
            return
        product = [each.path for each in library.entries if each.identity[:2] == entry.identity[:2]]
        same = [each.name for each in product if each != self.target]
        if same:
            yield f"{self.target}: also of this product: {', '.join(same)}"


def checked(file: Path, folder: Path, fix: bool, replace: bool) -> AddedFile:
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
