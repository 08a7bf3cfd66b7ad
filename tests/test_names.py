"""What docstrings and pages name in backquotes, and what looks like a name of ours, exists."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "eurobot_od"
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("tools/bench/*.md")]

NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
NAME_ON_A_PAGE = re.compile(r"eurobot_od(\.\w+)+|[A-Z][a-z]+[A-Z]\w*|[a-z_]+\.[A-Z]\w*")
"""On a page other names may be anybody's: of a device, a command, another program."""
PATH = re.compile(r"[a-z_]\w*/[\w/]*(\.(py|yaml|js|md))?")
BASES = (ROOT, PACKAGE, ROOT / "docs", ROOT / "tools")

ELSEWHERE = {
    "NAME_MESSAGE_pack", "NAME_MESSAGE_unpack", "Status_raw", "Status_raw_2", "status_raw", "field_2nd_axis",
    "status_2", "status_3", "FIELD_flag",  # what we make of a device's names
    "RPDO2", "sub9", "m1fixed2000", "Pool_1", "Record.Member", "Motor.Speed", "Motion.Speed", "motor.TPDO1",  # examples
    "setQueueCANListener", "setFunctionCANListener",  # the document's
    "eurobot_od.profiles.p402", "LocalNode", "receive_own_messages",  # canopen's, python-can's
    "DeprecationWarning",  # Python's
    "device.drive402", "drive.od", "drive.emcy", "drive.nmt", "drive.tpdo", "drive.rpdo",  # members of an example
    "CO_storageGroup", "CO_countLabel", "CO_accessSRDO", "CO_stringLengthMin", "COB_ID_EMCY",  # CANopenNode's
    "checks/",  # a folder of a team's
}  # fmt: skip
"""Names that are not ours."""


def texts(tree: ast.AST) -> Iterator[ast.Constant]:
    """Yield the docstrings of a module, its classes, functions and attributes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value


def names_of(tree: ast.AST) -> Iterator[str]:
    """Yield what code calls anything, and the words in its texts but docstrings."""
    docstrings = {id(each) for each in texts(tree)}
    for node in ast.walk(tree):
        yield from (str(getattr(node, each, "")) for each in ("id", "attr", "name", "arg", "asname"))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield from re.findall(r"\w+", node.value)


@cache
def modules() -> dict[str, set[str]]:
    """Return the names in each module, by the module's own: `pdo.codec`, and shorter ones such as `codec`."""
    found: dict[str, set[str]] = {}
    for file in (*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        names = {*names_of(ast.parse(file.read_text("utf-8")))}
        for number in range(len(parts)):
            found.setdefault(".".join(parts[number:]), set()).update(names)
            found.setdefault(".".join(parts[number:-1]), set()).add(parts[-1])
    found.pop("", None)
    return found


@cache
def known() -> set[str]:
    """Return all names of the package, its scripts and its face."""
    others = (each.read_text("utf-8") for each in PACKAGE.rglob("*") if each.suffix in (".js", ".new", ".pyi"))
    return {*(part for each in modules() for part in each.split("."))}.union(
        *modules().values(), *(re.findall(r"\w+", each) for each in others), ELSEWHERE
    )


def exists(name: str) -> bool:
    """Return whether a name is one of the code: in its module if it names that, else anywhere."""
    home, _, last = name.removeprefix("eurobot_od.").rpartition(".")
    if name in ELSEWHERE:
        return True
    if home in modules():
        return last in modules()[home] or f"{home}.{last}" in modules()
    if home.partition(".")[0] in {*sys.stdlib_module_names, "canopen", "can"}:
        return True
    if not home or home.rpartition(".")[2][0].isupper():
        return {home.rpartition(".")[2], last} <= known() | {""}
    # In `plan.at` the first is an example, whose attribute the second is; a module or a class is in a module of ours.
    return last in known() and last not in modules() and not last[0].isupper()


@cache
def folders() -> set[str]:
    """Return the names of the package's folders."""
    return {each.name for each in PACKAGE.rglob("*") if each.is_dir()}


def there(path: str, *bases: Path) -> bool:
    """Return whether a path leads to a file, a module, or a folder."""
    here = any((base / path).exists() or (base / f"{path}.py").exists() for base in (*BASES, *bases))
    return here or path in ELSEWHERE or path.removesuffix("/") in folders()


def test_docstrings_name_what_exists() -> None:
    wrong = []
    for file in sorted(PACKAGE.rglob("*.py")):
        for text in texts(ast.parse(file.read_text("utf-8"))):
            quoted = {each.removesuffix("()") for each in re.findall(r"`([^`\n]+)`", str(text.value))}
            missing = [each for each in quoted if NAME.fullmatch(each) and not re.search(r"\.(ya?ml|pyi?|js)$", each)]
            missing = [each for each in missing if not exists(each)]
            missing += [each for each in quoted if PATH.fullmatch(each) and not there(each, file.parent)]
            wrong += [f"{file.relative_to(ROOT)}:{text.lineno}: {each}" for each in missing]
    assert wrong == []


def test_pages_name_what_exists() -> None:
    wrong = []
    for page in PAGES:
        text = re.sub("```.*?```", lambda block: "\n" * block[0].count("\n"), page.read_text("utf-8"), flags=re.DOTALL)
        for number, line in enumerate(text.splitlines(), 1):
            quoted = {each.removesuffix("()") for each in re.findall(r"`([^`\n]+)`", line)}
            missing = [each for each in quoted if NAME_ON_A_PAGE.fullmatch(each) and not exists(each)]
            missing += [each for each in quoted if PATH.fullmatch(each) and not there(each)]
            wrong += [f"{page.relative_to(ROOT)}:{number}: {each}" for each in missing]
    assert wrong == []
