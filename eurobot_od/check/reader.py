"""Reads suite files: one YAML document for each suite, several documents in a file if need be.

Rule of this file: everything that is wrong in all files comes out in one error, before anything is sent.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import yaml

from eurobot_od.check.format import Format
from eurobot_od.check.shapes import Schema
from eurobot_od.check.suite import Suite
from eurobot_od.check.vocabulary import Networks, Vocabulary, saved_names, texts_at
from eurobot_od.errors import DictionaryError, LocalError, UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.support import bounded
from eurobot_od.support.escaping import one_line
from eurobot_od.support.yaml_places import START, Problem, Problems, ReadError, compose_all, refuse_aliases
from eurobot_od.traffic.meaning import Decoder


class SuiteError(LocalError):
    """Suite files that cannot be used: `problems` with their files, one line each."""

    def __init__(self, problems: Iterable[tuple[Path, Problem]]) -> None:
        self.problems = tuple(problems)
        lines = (one_line(f"{file}:{line}:{column}: {what}") for file, ((line, column), what) in self.problems)
        super().__init__("\n".join(lines))


class SuiteReader:
    """Reads suites for some `networks`: those that name no `dialect` are for the one given here, or the default one.

    Reading raises UnknownName if there is no such network.
    """

    def __init__(self, networks: Networks, dialect: str | None = None) -> None:
        self._networks, self._dialect = networks, dialect
        self._loaded: dict[Path, tuple[Decoder, dict[str, Dictionary]]] = {}

    def read_files(self, files: Iterable[Path]) -> list[Suite]:
        """Read all suites of some files; raises SuiteError with the problems of all of them."""
        sources: list[tuple[Path, str | Problem]] = []
        for file in files:
            try:
                sources.append((file, bounded.read(file).decode()))
            except OSError as error:
                sources.append((file, Problem(START, error.strerror or str(error))))
            except DictionaryError as error:
                # `what` alone: its text names the file, and so does each line of a SuiteError
                sources.append((file, Problem(START, error.what)))
            except UnicodeDecodeError as error:
                byte = f"byte 0x{error.object[error.start]:02X} at {error.start}"
                sources.append((file, Problem(START, f"not UTF-8: {byte}")))
        return self._all_of(sources)

    def read_texts(self, texts: Mapping[Path, str]) -> list[Suite]:
        """Read the suites of texts, by the files that errors and reports call them; raises SuiteError."""
        return self._all_of(texts.items())

    def _all_of(self, sources: Iterable[tuple[Path, str | Problem]]) -> list[Suite]:
        """Return the suites of texts; raises SuiteError with the problems of all, and those of files without a text."""
        suites: list[Suite] = []
        wrong: list[tuple[Path, Problem]] = []
        for file, source in sources:
            problems = [source] if isinstance(source, Problem) else []
            if isinstance(source, str):
                suites += self.read(file, source, problems)
            # They come mapping by mapping, its keys before what is below them; a person reads a file from the top.
            wrong += ((file, problem) for problem in sorted(problems))
        if wrong:
            raise SuiteError(wrong)
        return suites

    def read(self, file: Path, source: str, problems: Problems) -> list[Suite]:
        """Read the suites of a text; problems are noted, and the suites that have some are left out."""
        suites = []
        try:
            documents = compose_all(source, problems)
        except ReadError:
            return []
        for document in documents:
            try:
                refuse_aliases(document, problems)  # first: an alias that refers to itself has no end
                suites.append(self._format(document).read(file, document, problems))
            except ReadError:
                continue
        return suites

    def _format(self, document: yaml.Node) -> Format:
        decoder, dictionaries = self._load(next(iter(texts_at(document, "dialect")), self._dialect))
        named, names = texts_at(document, "node"), tuple(dictionaries)
        # If all names are wrong, any one node will do: "which node?" at each step would only hide the wrong name.
        nodes = tuple(name for name in names if name in named or not named) or names[:1]
        constants, saved = texts_at(document, "variables"), frozenset(saved_names(document))
        return Format(Vocabulary(self._networks, decoder, dictionaries, constants, saved, nodes))

    def _load(self, dialect: str | None) -> tuple[Decoder, dict[str, Dictionary]]:
        """Load the EDS files of a network, once.

        For a dialect that does not exist it is the reader's own.
        """
        try:
            folder = self._networks.find(dialect)
        except UnknownName:
            # The suite can still be checked against these, and the format reports the wrong name with its place.
            folder = self._networks.find(self._dialect)
        if folder not in self._loaded:
            found = self._networks.load(folder)
            decoder = Decoder(found, self._networks.catalogue, self._networks.refused)
            self._loaded[folder] = decoder, {each.name: each for each in found}
        return self._loaded[folder]

    def schema(self) -> Schema:
        """Return the JSON Schema of a suite, with the messages and nodes of the reader's network."""
        decoder, dictionaries = self._load(self._dialect)
        return Format(Vocabulary(self._networks, decoder, dictionaries, {}, frozenset(), tuple(dictionaries))).schema()
