"""Reads suite files: one YAML document a suite, several documents in a file if need be.

Rule of this file: a file is read whole, and all that is wrong in all files comes out in one error, before anything is
sent.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import yaml

from eurobot_od.check.format import Format
from eurobot_od.check.shapes import Schema
from eurobot_od.check.suite import Suite
from eurobot_od.check.vocabulary import Dialect, Vocabulary, load_dialect, saved_names, texts_at
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot import dialects
from eurobot_od.yaml_places import START, Problem, Problems, ReadError, compose_all, refuse_aliases


class SuiteError(LocalError):
    """Suite files that cannot be used: `problems` with their files, one line each."""

    def __init__(self, problems: Iterable[tuple[Path, Problem]]) -> None:
        self.problems = tuple(problems)
        lines = (f"{file}:{line}:{column}: {what}" for file, ((line, column), what) in self.problems)
        super().__init__("\n".join(lines))


class SuiteReader:
    """Reads suites for a `dialect` (None: the default one), where they do not name theirs.

    Reading raises UnknownName if that dialect is not there.
    """

    def __init__(self, dialect: str | None = None) -> None:
        self._dialect = dialect
        self._loaded: dict[Path, Dialect] = {}

    def read_files(self, files: Iterable[Path]) -> list[Suite]:
        """Read all suites of some files; raises SuiteError with the problems of all of them."""
        suites: list[Suite] = []
        wrong: list[tuple[Path, Problem]] = []
        for file in files:
            problems: Problems = []
            suites += self._read_file(file, problems)
            wrong += ((file, problem) for problem in sorted(problems))
        if wrong:
            raise SuiteError(wrong)
        return suites

    def _read_file(self, file: Path, problems: Problems) -> list[Suite]:
        try:
            source = file.read_bytes().decode()
        except OSError as error:
            problems.append(Problem(START, error.strerror or str(error)))
        except UnicodeDecodeError as error:
            problems.append(Problem(START, f"not UTF-8: byte 0x{error.object[error.start]:02X} at {error.start}"))
        else:
            return self.read(file, source, problems)
        return []

    def read(self, file: Path, source: str, problems: Problems) -> list[Suite]:
        """Read the suites of a text; problems are noted, and the suites that have some are left out."""
        suites = []
        try:
            documents = compose_all(source, problems)
        except ReadError:
            return []
        for document in documents:
            try:
                refuse_aliases(document, problems)
                suites.append(self._format(document).read(file, document, problems))
            except ReadError:
                continue
        return suites

    def _format(self, document: yaml.Node) -> Format:
        dialect = self._load(next(iter(texts_at(document, "dialect")), self._dialect))
        named, names = texts_at(document, "node"), tuple(dialect.dictionaries)
        nodes = tuple(name for name in names if name in named or not named) or names[:1]
        return Format(Vocabulary(dialect, texts_at(document, "variables"), saved_names(document), nodes))

    def _load(self, dialect: str | None) -> Dialect:
        """Load a dialect once; one that is not there is told where the suite names it, so the reader's serves."""
        try:
            folder = dialects.folder(dialect)
        except UnknownName:
            folder = dialects.folder(self._dialect)
        if folder not in self._loaded:
            self._loaded[folder] = load_dialect(folder)
        return self._loaded[folder]


def schema() -> Schema:
    """Return the JSON Schema of a suite, with the messages and nodes of the default dialect."""
    dialect = load_dialect(None)
    return Format(Vocabulary(dialect, {}, frozenset(), tuple(dialect.dictionaries))).schema()
