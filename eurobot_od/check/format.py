"""The format of suites: tables of keys, by which suites are read and checked.

Each key is in one table, with its shape and whether it is needed; docs/checks.md explains it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from eurobot_od.check import shapes, suite
from eurobot_od.check.actions import ACTIONS
from eurobot_od.check.shapes import COUNT, DURATION, MAX_COUNT, NAME, DocumentShapes, Vocabulary
from eurobot_od.check.suite import Suite
from eurobot_od.errors import FileError, UnknownName, YamlError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.support import yaml_places, yaml_shapes
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_places import PlacedText, Problem, Problems, ReadError, place_of, refuse
from eurobot_od.support.yaml_shapes import SCALAR, TEXT, Key, Shape, converted, filled, pairs_of
from eurobot_od.traffic.meaning import Decoder

VERSION = 1
"""Value of the key `spec`."""


class Format:
    """The format of suites, for the network and the variables of one document."""

    def __init__(self, words: Vocabulary) -> None:
        self._words = words
        self._step: Shape[suite.Step] = Shape(self._read_step)
        document = DocumentShapes(words, self._step)
        self._actions = {key: make(document) for key, make in {**ACTIONS, **words.networks.actions}.items()}
        answer = yaml_shapes.named({"yes": True, "no": False}, "answer")
        self._common = {"name": Key(TEXT), "repeat": Key(COUNT), "needed": Key(answer), "undo": Key(answer)}
        self._common["above"] = Key(TEXT)
        self._steps: dict[str, Shape[dict[str, Any]]] = {
            key: yaml_shapes.record(dict, {key: Key(row.shape), **row.extra, **self._common})
            for key, row in self._actions.items()
        }
        self._suite: Shape[dict[str, Any]] = yaml_shapes.record(dict, self._suite_table())

    # Tables

    def _suite_table(self) -> dict[str, Key]:
        steps = yaml_shapes.listing(self._step)
        version = yaml_shapes.named({str(VERSION): VERSION}, "version")
        node = yaml_shapes.named({name: name for name in self._words.dictionaries}, "node")
        return {
            "spec": Key(version, f"version of the format, `spec: {VERSION}`", needed=True),
            "name": Key(TEXT, "what the suite is for", needed=True),
            "node": Key(yaml_shapes.one_or_more(node)),
            "dialect": Key(yaml_shapes.converted(TEXT, self._dialect)),
            "timeout": Key(DURATION),
            "variables": Key(yaml_shapes.mapping(SCALAR, NAME)),
            "world": Key(yaml_shapes.named({"shared": True, "any": False}, "world")),
            "tags": Key(yaml_shapes.one_or_more(TEXT)),
            "setup": Key(steps),
            "steps": Key(converted(steps, filled), "the steps", needed=True),
            "teardown": Key(steps),
        }

    # Reading

    def read(self, file: Path, root: yaml.Node, problems: Problems) -> suite.Suite:
        """Read the document; raises ReadError with the problems noted."""
        words = self._words
        parts = self._suite.read(root, problems)
        # The version has been checked, and variables have been filled in where they are used.
        fields = {key: value for key, value in parts.items() if key not in ("spec", "variables", "node")}
        nodes = parts.get("node", tuple(words.dictionaries))
        return suite.Suite(file, place_of(root.start_mark), words.dictionaries, words.decoder, nodes, **fields)

    def _dialect(self, text: PlacedText) -> str:
        self._words.networks.find(str(text))
        return str(text)

    def _read_step(self, node: yaml.Node, problems: Problems) -> suite.Step:
        key = str(self._action_key(node, pairs_of(node, problems), problems))
        row = self._actions[key]
        given = self._steps[key].read(node, problems)
        action = row.make(given[key], **{name: given[name] for name in row.extra if name in given})
        name = str(given.get("name", action))
        common = {key: given[key] for key in ("repeat", "needed", "undo", "above") if key in given}
        step = suite.Step(name, place_of(node.start_mark), action, **common)
        # Each `repeat` has a maximum, but repetitions of nested groups multiply.
        if step.total > MAX_COUNT:
            refuse(node, problems, f"with the repetitions inside it {step.total} steps, at most {MAX_COUNT} are done")
        return step

    def _action_key(self, node: yaml.Node, pairs: Iterable[PlacedText], problems: Problems) -> PlacedText:
        """Return the key of a step's one action."""
        found = [key for key in pairs if key in self._actions]
        unknown = [key for key in pairs if key not in self._actions and key not in self._common]
        if len(found) == 1:
            return found[0]
        if found:
            problems.append(Problem(found[1].place, f"a step has one action, and {str(found[0])!r} is one already"))
        elif unknown:
            # Most likely a misspelled action: UnknownName suggests the nearest one.
            problems.append(Problem(unknown[0].place, str(UnknownName("action", str(unknown[0]), self._actions))))
        else:
            refuse(node, problems, f"no action; a step has one of {', '.join(self._actions)}")
        raise ReadError


# Reading suite files: one YAML document per suite, one or more documents per file.
#
# One error lists the problems of all files, before anything is sent.


class SuiteReader:
    """Reads suites for some `networks`; a suite that names no `dialect` is for the one given here.

    Reading raises UnknownName for an unknown network.
    """

    def __init__(self, networks: shapes.Networks, dialect: str | None = None) -> None:
        self._networks = networks
        self._dialect = dialect
        self._loaded: dict[Path, tuple[Decoder, dict[str, Dictionary]]] = {}

    def read_files(self, files: Iterable[Path]) -> list[Suite]:
        """Read all suites of some files; raises YamlError with the problems of all files."""
        return self.read_texts(dict.fromkeys(files))

    def read_texts(self, texts: Mapping[Path, str | None]) -> list[Suite]:
        """Read the suites of some texts, by file name; None means the content of that file.

        Errors and reports use these names. Raises YamlError.
        """
        suites: list[Suite] = []
        wrong: list[str] = []
        for file, text in texts.items():
            problems: Problems = []
            try:
                source = read_whole(file).decode() if text is None else text
            except FileError as error:
                problems.append(Problem(yaml_places.START, error.what))
            except UnicodeDecodeError as error:
                byte = f"byte 0x{error.object[error.start]:02X} at {error.start}"
                problems.append(Problem(yaml_places.START, f"not UTF-8: {byte}"))
            else:
                suites += self.read(file, source, problems)
            wrong += yaml_places.placed_lines(file, problems)
        if wrong:
            raise YamlError(wrong[0].partition(":")[0], wrong)
        return suites

    def read(self, file: Path, source: str, problems: Problems) -> list[Suite]:
        """Read the suites of a text; problems are added to the list, and suites with problems are left out."""
        suites = []
        try:
            documents = yaml_places.compose_all(source, problems)
        except ReadError:
            return []
        for document in documents:
            try:
                yaml_places.refuse_aliases(document, problems)  # first: an alias that refers to itself has no end
                suites.append(self._format(document).read(file, document, problems))
            except ReadError:
                continue
        return suites

    def _format(self, document: yaml.Node) -> Format:
        decoder, dictionaries = self._load(next(iter(shapes.texts_at(document, "dialect")), self._dialect))
        named = shapes.texts_at(document, "node")
        names = tuple(dictionaries)
        # If all names are wrong, take one node: otherwise each step would ask "which node?" and hide the wrong name.
        nodes = tuple(name for name in names if name in named or not named) or names[:1]
        constants = shapes.texts_at(document, "variables")
        saved = frozenset(shapes.saved_names(document))
        return Format(Vocabulary(self._networks, decoder, dictionaries, constants, saved, nodes))

    def _load(self, dialect: str | None) -> tuple[Decoder, dict[str, Dictionary]]:
        """Load the EDS files of a network, once; for an unknown dialect those of the reader's own network."""
        try:
            folder = self._networks.find(dialect)
        except UnknownName:
            # The suite is still checked against these files; the format reports the wrong name with its place.
            folder = self._networks.find(self._dialect)
        if folder not in self._loaded:
            found = self._networks.load(folder)
            decoder = self._networks.decoder(found, self._networks.catalogue, self._networks.refused)
            self._loaded[folder] = decoder, {each.name: each for each in found}
        return self._loaded[folder]
