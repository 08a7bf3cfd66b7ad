"""The shape of the package: imports point down, only the EDS files have the numbers."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.util import find_spec
from pathlib import Path

import pytest

from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "eurobot_od"
NAME = PACKAGE.name

# From the bottom up: a module or package imports what stands below it, or beside it as long as that makes no circle.
LAYERS = (
    {"errors", "frame", "canopen_names"},
    {"support"},
    {"od"},
    {"pdo", "sdo", "lint"},
    {"controller", "export", "library"},
    {"device"},
    {"bus"},
    {"client"},
    {"traffic"},
    {"season"},
    {"check", "web"},
    {"plugin"},
    {"loading"},
    {"cli", "pytest_plugin"},
    {"robot"},
    {"__main__"},
)
LAYER = {name: number for number, names in enumerate(LAYERS) for name in names}

# The same within the folder of the robot.
ROBOT = "robot"
ROBOT_LAYERS = (
    {"dialects"},
    {"model"},
    {"protocol", "gatekeeper"},
    {"nodes"},
    {"world", "faults"},
    {"scene"},
    {"match", "check"},
    {"facade", "season", "commands"},
    {"plugin"},
)
ROBOT_LAYER = {name: number for number, names in enumerate(ROBOT_LAYERS) for name in names}

# Identifiers that are also numbers of CiA 301 and 304: bases of the predefined connection set, and GFC.
CIA_NUMBERS = {0x001, *range(0x080, 0x580, 0x080)}
# Other numbers in the form of an identifier: where they stand, and what they are.
NO_IDENTIFIERS = {("bus.live.live", 0x004): "a class bit of Linux's error frames"}
IDENTIFIER_FORM = re.compile(r"0[xX][0-7][0-9a-fA-F]{2}")
IDENTIFIERS = {each.cob_id for each in EurobotProtocol.load(dialects.DEFAULT).bindings} - CIA_NUMBERS

FILES = sorted(PACKAGE.rglob("*.py"))
TOOLS = sorted((ROOT / "tools").rglob("*.py"))


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def module_of(file: Path) -> str:
    """Name a file's module: `nodes.core`, `nodes` for the package itself, `` for the whole package."""
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(file): file for file in FILES}


def unit_of(module: str) -> str:
    return module.partition(".")[0]


def imported(file: Path) -> Iterator[str]:
    """Yield the modules of our package that a file imports, anywhere in it, for types or for good."""
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.ImportFrom) and node.module and unit_of(node.module) == NAME:
            inside = node.module[len(NAME) + 1 :]
            for each in node.names:
                longer = f"{inside}.{each.name}".lstrip(".")
                yield longer if longer in MODULES else inside
        elif isinstance(node, ast.Import):
            yield from (each.name[len(NAME) + 1 :] for each in node.names if unit_of(each.name) == NAME)


@cache
def imports() -> dict[str, set[str]]:
    """Return the modules of the package that each module imports, without the package itself, which is in no layer."""
    return {module: set(imported(file)) - {module} for module, file in MODULES.items() if module}


def circle(arrows: dict[str, set[str]]) -> list[str]:
    """Return a circle of arrows, nothing if there is none."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        found: list[str] = error.args[1]
        return found
    return []


def test_every_module_has_its_layer() -> None:
    assert {unit_of(module) for module in imports()} - LAYER.keys() == set()


def test_imports_point_down() -> None:
    arrows = ((module, other) for module, others in imports().items() for other in others)
    assert [each for each in arrows if LAYER[unit_of(each[1])] > LAYER[unit_of(each[0])]] == []


def test_modules_import_each_other_in_no_circle() -> None:
    assert circle(imports()) == []


def test_packages_import_each_other_in_no_circle() -> None:
    units: dict[str, set[str]] = {}
    for module, others in imports().items():
        units.setdefault(unit_of(module), set()).update(unit_of(other) for other in others)
    assert circle({unit: others - {unit} for unit, others in units.items()}) == []


def robot_imports() -> dict[str, set[str]]:
    """Return the other units of the robot that each unit imports."""
    units: dict[str, set[str]] = {}
    for module, others in imports().items():
        if unit_of(module) == ROBOT and module != ROBOT:
            inside = {unit_in_robot(other) for other in others if unit_of(other) == ROBOT}
            units.setdefault(unit_in_robot(module), set()).update(inside - {unit_in_robot(module)})
    return units


def unit_in_robot(module: str) -> str:
    return unit_of(module.partition(".")[2])


def test_every_folder_of_the_robot_has_its_layer() -> None:
    assert robot_imports().keys() == ROBOT_LAYER.keys()


def test_imports_point_down_between_the_folders_of_the_robot() -> None:
    arrows = ((unit, other) for unit, others in robot_imports().items() for other in others)
    assert [(unit, other) for unit, other in arrows if ROBOT_LAYER[other] > ROBOT_LAYER[unit]] == []


def test_folders_of_the_robot_import_each_other_in_no_circle() -> None:
    assert circle(robot_imports()) == []


def test_nobody_imports_through_the_package() -> None:
    assert [module for module, others in imports().items() if "" in others] == []


def test_nothing_names_the_robot_but_itself() -> None:
    # the package's face, which is in no layer, passes its names on; everybody else finds it by the entry point
    outside = {
        module: file.read_text(encoding="utf-8") for module, file in MODULES.items() if unit_of(module) != "robot"
    }
    assert [module for module, text in outside.items() if module and f"{NAME}.robot." in f"{text}."] == []


# The tests: those of the workbench do without the robot and its files.
TESTS = ROOT / "tests"
ROBOTS_FILES = re.compile(r"\beds/(canopen|firmware2014|protocol|network|robot)|eurobot_od\.robot")
ABOUT_BOTH = {
    "test_docs": "all pages, of the robot, too",
    "test_layers": "the house itself",
    "test_packaging": "what is delivered",
    "test_loading": "how the robot is found",
    "test_plugin": "what the robot brings",
    "test_without_robot": "the workbench where the robot is missing",
}
"""Files outside `tests/robot/` that name it, and what for."""


def uses_of_the_robot(file: Path) -> Iterator[str]:
    """Yield what a test file imports of the robot, and what it reads of its files."""
    homes = dict(re.findall(r"^from (\S+) import .* as (\w+)$", (PACKAGE / "__init__.pyi").read_text(), re.MULTILINE))
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [each.name for each in node.names]
            modules = [homes.get(name, "") for name in names] if node.module == NAME else [node.module]
            yield from (each for each in modules if each.startswith((f"{NAME}.robot", "tests.robot")))
            yield from (name for name in names if node.module == NAME and name == "robot")
        elif isinstance(node, ast.BinOp) and isinstance(node.right, ast.Constant) and node.right.value == "eds":
            yield from [ast.unparse(node)] if re.search(r"ROOT|parents\[", ast.unparse(node.left)) else []
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from ROBOTS_FILES.findall(node.value)


def test_only_the_robots_tests_use_the_robot() -> None:
    outside = [each for each in sorted(TESTS.rglob("*.py")) if each.relative_to(TESTS).parts[0] != ROBOT]
    users = {each.relative_to(TESTS).with_suffix("").as_posix() for each in outside if any(uses_of_the_robot(each))}
    assert users == ABOUT_BOTH.keys()


# One model for each noun: the class that has its name, and what is another thing though its name ends in it.
NOUNS: dict[str, dict[str, str]] = {
    "Pdo": {"od.pdos.Pdo": "what a device's records say, from a file or from the device"},
    "MappingEntry": {"od.values.MappingEntry": "index, sub-index and bits"},
    "Mapped": {"od.pdos.Mapped": "an entry with its variable"},
    "Message": {
        "traffic.load.PeriodicMessage": "what is sent again and again, in us or bit times",
        "traffic.statistics.SeenMessage": "what was seen of an identifier",
        "export.description.DescribedMessage": "what exports say of one",
        "export.dbc.DbcMessage": "... as DBC has it",
        "check.suite.SentMessage": "what a step sends",
        "traffic.dbc.ForeignMessage": "what a DBC says of one that is not CANopen",
    },
    "Frame": {
        "frame.Frame": "identifier and data",
        "frame.RemoteFrame": "... of a remote frame",
        "check.suite.SentFrame": "what a step sends",
        "check.bench.SeenFrame": "what a check has seen, and when",
    },
    "Variable": {"od.description.DescribedVariable": "a variable as a file's text; all others are canopen's"},
    "Dictionary": {"od.dictionary.Dictionary": "a loaded file"},
    "Setting": {"device.bound.Setting": "an attribute of a node's class"},
    "Abort": {"sdo.wire.Abort": "why a transfer ends"},
    "Tier": {"check.conformance.clauses.Tier": "what a clause may do to a device"},
}


def classes() -> Iterator[tuple[str, str]]:
    """Yield the name of each class of the package, and its module."""
    for module, file in MODULES.items():
        yield from ((node.name, module) for node in ast.walk(tree(file)) if isinstance(node, ast.ClassDef))


def test_no_two_classes_have_the_same_name() -> None:
    homes: dict[str, list[str]] = {}
    for name, module in classes():
        homes.setdefault(name, []).append(module)
    assert {name: modules for name, modules in homes.items() if len(modules) > 1} == {}


@pytest.mark.parametrize(("noun", "known"), NOUNS.items(), ids=NOUNS)
def test_each_noun_has_one_model(noun: str, known: dict[str, str]) -> None:
    """Whoever needs a class for one of these nouns takes that, or says here what else the new one is."""
    assert {f"{module}.{name}" for name, module in classes() if name.endswith(noun)} == known.keys()


def prints(file: Path) -> bool:
    calls = (node.func for node in ast.walk(tree(file)) if isinstance(node, ast.Call))
    return any(isinstance(each, ast.Name) and each.id in ("print", "input") for each in calls)


def test_only_the_command_line_prints() -> None:
    printing = [module for module, file in MODULES.items() if prints(file)]
    assert [each for each in printing if not each.startswith(("cli", "robot.commands", "__main__"))] == []


def arguments_about_dialects(file: Path) -> Iterator[str]:
    """Yield the texts that calls which load something, or speak of dialects, have as their arguments."""
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.Call):
            given = [*node.args, *(keyword.value for keyword in node.keywords)]
            texts = [each.value for each in given if isinstance(each, ast.Constant) and isinstance(each.value, str)]
            if texts and re.search("load|dialect", ast.unparse(node)):
                yield from texts


# A dialect that is named as a library is may be in comments, imports and other texts; another may be nowhere.
LIBRARIES = {name for name in dialects.names() if find_spec(name)}


def dialects_in(file: Path) -> set[str]:
    text, names = file.read_text(encoding="utf-8"), set(dialects.names())
    return set(arguments_about_dialects(file)) & names | {name for name in names - LIBRARIES if name in text}


def test_no_file_names_a_dialect_but_the_one_that_lists_them() -> None:
    assert {file for file in FILES + TOOLS if dialects_in(file)} <= {PACKAGE / "robot" / "dialects.py"}


def identifiers_in(file: Path) -> set[int]:
    text = file.read_text(encoding="utf-8")
    if not IDENTIFIER_FORM.search(text):
        return set()
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return {int(token.string, 0) for token in tokens if IDENTIFIER_FORM.fullmatch(token.string)} & IDENTIFIERS


def test_no_file_repeats_an_identifier_of_the_protocol() -> None:
    found = {(module, number) for module, file in MODULES.items() for number in identifiers_in(file)}
    assert found <= NO_IDENTIFIERS.keys()
