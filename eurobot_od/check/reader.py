"""Reads suite files: one YAML document for each suite, several documents in a file if need be.

Rule of this file: everything that is wrong in all files comes out in one error, before anything is sent.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import yaml

from eurobot_od.check.format import Format
from eurobot_od.check.suite import Suite
from eurobot_od.check.vocabulary import Networks, Vocabulary, saved_names, texts_at
from eurobot_od.errors import FileError, UnknownName, YamlError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.support import yaml_places
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_shapes import Schema
from eurobot_od.traffic.meaning import Decoder


class SuiteReader:
    """Reads suites for some `networks`: those that name no `dialect` are for the one given here, or the default one.

    Reading raises UnknownName if there is no such network.
    """

    def __init__(self, networks: Networks, dialect: str | None = None) -> None:
        self._networks, self._dialect = networks, dialect
        self._loaded: dict[Path, tuple[Decoder, dict[str, Dictionary]]] = {}

    def read_files(self, files: Iterable[Path]) -> list[Suite]:
        """Read all suites of some files; raises YamlError with the problems of all of them."""
        sources: dict[Path, str | yaml_places.Problem] = {}
        for file in files:
            try:
                sources[file] = read_whole(file).decode()
            except FileError as error:
                sources[file] = yaml_places.Problem(yaml_places.START, error.what)
            except UnicodeDecodeError as error:
                byte = f"byte 0x{error.object[error.start]:02X} at {error.start}"
                sources[file] = yaml_places.Problem(yaml_places.START, f"not UTF-8: {byte}")
        return self.read_texts(sources)

    def read_texts(self, texts: Mapping[Path, str | yaml_places.Problem]) -> list[Suite]:
        """Read the suites of texts, by the files that errors and reports call them; raises YamlError.

        In place of a text stands why there is none.
        """
        suites: list[Suite] = []
        wrong: list[str] = []
        for file, text in texts.items():
            problems = [text] if isinstance(text, yaml_places.Problem) else []
            if isinstance(text, str):
                suites += self.read(file, text, problems)
            wrong += yaml_places.placed_lines(file, problems)
        if wrong:
            raise YamlError(wrong[0].partition(":")[0], wrong)
        return suites

    def read(self, file: Path, source: str, problems: yaml_places.Problems) -> list[Suite]:
        """Read the suites of a text; problems are noted, and the suites that have some are left out."""
        suites = []
        try:
            documents = yaml_places.compose_all(source, problems)
        except yaml_places.ReadError:
            return []
        for document in documents:
            try:
                yaml_places.refuse_aliases(document, problems)  # first: an alias that refers to itself has no end
                suites.append(self._format(document).read(file, document, problems))
            except yaml_places.ReadError:
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
