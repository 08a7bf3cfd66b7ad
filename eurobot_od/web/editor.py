"""The requests of the view Files: a device file as objects, PDOs and findings, an edit of its text, and a save.

Rule of this file: no file is kept here, and only a save writes. The browser holds the text and the history of edits;
each request brings the text, from which the answer is made. A text travels as its bytes: a character up to U+00FF for
each, so that line ends and letters of any encoding come back unchanged.
"""

from __future__ import annotations

import asyncio
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from eurobot_od.errors import DictionaryError, LocalError, look_up
from eurobot_od.lint.edits import VERBS, difference, make_edit
from eurobot_od.lint.findings import LEVELS, Finding
from eurobot_od.lint.rules import lint
from eurobot_od.od.description import (
    DescribedDevice,
    DescribedObject,
    DescribedRecords,
    DescribedVariable,
    parse_section_name,
)
from eurobot_od.od.document import COMMISSIONING, Document, read_bytes
from eurobot_od.od.editing import PROFILES, readable
from eurobot_od.od.values import ACCESS_TYPES, DATA_TYPES, DUMMIES, MappingEntry, label
from eurobot_od.support.files import write_whole
from eurobot_od.support.texts import one_line
from eurobot_od.web.asking import Arguments, answered, text_of
from eurobot_od.web.page import picked

SUFFIXES = (".eds", ".dcf")
"""Files that can be edited; a device description in XML has no lines to change."""

LARGEST = 4 << 20
"""Size of the largest file that is edited, in bytes; those of real devices have some hundred thousand."""

LONGEST_REQUEST = 3 * LARGEST
"""Length of the longest request, in bytes: JSON writes some bytes of a file as two or more."""

KEYS = ("datatype", "accesstype", "defaultvalue", "parametervalue", "lowlimit", "highlimit", "pdomapping")
UNIT_KEYS = ("unit", "factor", "offset")


PROGRAM = Path(__file__).parents[1]
"""The installed program, whose own files are opened, but never saved."""


class EditableFile(NamedTuple):
    """A file on the disk that a page may open, and its origin: `named`, `network` or `library`."""

    path: Path
    origin: str

    @property
    def is_ours(self) -> bool:
        """Whether it is a part of this program."""
        return self.path.is_relative_to(PROGRAM)


class FileEditor:
    """Answers the requests of browsers about files; `control` tells whether they may save.

    `files` returns those that they may open now; no other can be named.
    """

    def __init__(self, files: Callable[[], Iterable[EditableFile]], control: bool = False) -> None:
        self._files = files
        self._control = control
        self._one_at_a_time = asyncio.Lock()

    async def post(self, body: str) -> str:
        """Answer a request in a thread, one after the other, as lint uses a processor."""
        async with self._one_at_a_time:
            return await asyncio.to_thread(self.answer, body)

    def answer(self, body: str) -> str:
        """Answer a request, both as JSON; it never raises."""

        def do(said: Arguments) -> Any:
            return look_up("request", str(said.get("do"))[:40], REQUESTS)(self, said)

        return answered(body, do)

    def list_files(self, _: Arguments) -> dict[str, Any]:
        """Return the files that can be opened, and the choices of a form."""
        files = [
            {"file": file, "name": each.path.name, "origin": each.origin, "saves": self._control and not each.is_ours}
            for file, each in self._listed.items()
        ]
        choices = {"profiles": list(PROFILES), "types": [each.name for each in DATA_TYPES.values()]}
        return {"files": files, "largest": LARGEST, "access": ACCESS_TYPES, **choices}

    @property
    def _listed(self) -> dict[str, EditableFile]:
        found: dict[str, EditableFile] = {}
        for each in self._files():
            if each.path.suffix.lower() in SUFFIXES:
                found.setdefault(str(each.path), each)
        return found

    def _file(self, said: Arguments) -> EditableFile:
        file = text_of(said, "file")
        if file not in self._listed:
            raise LocalError(f"{file} is no file of this page")
        return self._listed[file]

    def open(self, said: Arguments) -> dict[str, Any]:
        """Return a file of the disk: its text, its digest, and its description."""
        path = self._file(said).path
        data = read_bytes(path)
        return {"text": data.decode("latin-1"), "digest": _digest(data)} | looked_at(data, path.name)

    def look(self, said: Arguments) -> dict[str, Any]:
        """Return the description of a text, with lint's findings."""
        return looked_at(_data(said), text_of(said, "name"))

    def edit(self, said: Arguments) -> dict[str, Any]:
        """Return the text after an edit, the changes, and the new description.

        Raises LocalError for an edit that is refused.
        """
        before = _data(said)
        name = text_of(said, "name")
        words = said.get("words")
        if not isinstance(words, list) or not words or not all(isinstance(each, str) for each in words):
            raise LocalError("words are a list of texts")
        verb, *rest = words
        made = make_edit(before, name, look_up("edit", verb, VERBS).changes(rest))
        if made.errors:
            first, *more = made.errors
            others = f" (and {len(more)} more)" if more else ""
            raise LocalError(f"not changed: line {first.line}: {first.code} {first.message}{others}")
        _check_size(made.data)
        text = made.data.decode("latin-1")
        changed = difference(before, made.data, name)[2:]
        warnings = [each.message for each in made.warnings]
        return {"text": text, "changed": changed, "warnings": warnings} | described(made.data, name, made.findings)

    def save(self, said: Arguments) -> dict[str, str]:
        """Write a text into the file from which it was opened, unless that has changed since."""
        if not self._control:
            raise LocalError("this page saves nothing: start the server with --control, or download the file")
        file = self._file(said)
        data = _data(said)
        path = file.path
        if file.is_ours:
            raise LocalError(f"not saved: {path.name} is a part of this program; download it")
        readable(data, path.name)
        if _digest(read_bytes(path)) != text_of(said, "digest"):
            raise LocalError(f"not saved: {path.name} was changed on the disk since it was opened; download yours")
        write_whole(path, data)
        return {"digest": _digest(data)}


REQUESTS: Mapping[str, Callable[[FileEditor, Arguments], Any]] = {
    "list": FileEditor.list_files,
    "open": FileEditor.open,
    "look": FileEditor.look,
    "edit": FileEditor.edit,
    "save": FileEditor.save,
}


def _data(said: Arguments) -> bytes:
    try:
        data = text_of(said, "text").encode("latin-1")
    except UnicodeEncodeError:
        raise LocalError("text is the bytes of a file, each as a character up to U+00FF") from None
    _check_size(data)
    return data


def _check_size(data: bytes) -> None:
    if len(data) > LARGEST:
        raise LocalError(f"{len(data)} bytes; the page edits files of up to {LARGEST >> 20} MB")


def _digest(data: bytes) -> str:
    return sha256(data).hexdigest()


# A file as data


def looked_at(data: bytes, file: str) -> dict[str, Any]:
    """Return the description of a file; raises DictionaryError if it is no EDS or DCF that can be edited."""
    _check_size(data)
    document = readable(data, file)
    if not DescribedDevice(document).objects and not document.sections.keys() & {"fileinfo", "deviceinfo"}:
        raise DictionaryError(file, None, "not a readable EDS: no section describes a device or an object")
    return described(data, file, lint(data, file))


def described(data: bytes, file: str, findings: Iterable[Finding]) -> dict[str, Any]:
    """Return the objects and PDOs of a file as data, with lint's findings."""
    document = readable(data, file)
    device = DescribedDevice(document)
    places = _Places(document)
    is_configuration = file.lower().endswith(".dcf") or COMMISSIONING.lower() in document.sections
    return {
        "objects": [_object(device.objects[index]) for index in sorted(device.objects)],
        "pdos": [_pdo(device, each) for each in device.pdos],
        "findings": [_finding(each, places) for each in findings],
        "configuration": is_configuration,
    }


def _object(whole: DescribedObject) -> dict[str, Any]:
    variables = list(whole.variables())
    own = len(variables) == 1 and variables[0].section is whole.section
    kind = whole.code.name if whole.code else ""
    rows = list(map(_variable, variables))
    return {"index": whole.index, "name": whole.name, "kind": kind, "own": own, "variables": rows}


def _variable(variable: DescribedVariable) -> dict[str, Any]:
    entries = {key: each for key in (*KEYS, *UNIT_KEYS) if (each := variable.section.text(key))}
    type_ = {"type": variable.type.name, "bits": variable.type.bits} if variable.type else {"type": "", "bits": 0}
    return picked(variable, "sub", "name", "is_mappable") | type_ | {"entries": entries}


def _pdo(device: DescribedDevice, records: DescribedRecords) -> dict[str, Any]:
    entries = [
        {"object": label(each.address), "bits": each.bits, "name": _mapped_name(device, each)}
        for each, _ in records.mapped()
    ]
    return {"name": records.key, "valid": records.is_valid, "multiplexed": records.is_multiplexed, "entries": entries}


def _mapped_name(device: DescribedDevice, entry: MappingEntry) -> str:
    if entry.index in DUMMIES:
        return "unused"
    whole = device.objects.get(entry.index)
    variable = device.variable(*entry.address)
    if whole is None or variable is None:
        return "not in the file"
    return variable.name if variable.section is whole.section else f"{whole.name}: {variable.name}"


class _Places:
    """The object of each line of a file."""

    def __init__(self, document: Document) -> None:
        self._headers = sorted(document.headers)
        self._names = {each.line: parse_section_name(each.name.strip()) for each in document.sections.values()}

    def __call__(self, line: int) -> tuple[int | None, int | None]:
        """Return index and sub-index of the section with a line; None for a section of no object."""
        header = self._headers[bisect_right(self._headers, line) - 1] if self._headers else 0
        name = self._names.get(header) if line >= header else None
        if not name:
            return None, None
        return name.object_index, name.sub if name.sub >= 0 else None


def _finding(finding: Finding, places: Callable[[int], tuple[int | None, int | None]]) -> dict[str, Any]:
    index, sub = places(finding.line)
    words = {"level": LEVELS[finding.severity], "message": one_line(finding.message)}
    return picked(finding, "code", "line") | words | {"index": index, "sub": sub}
