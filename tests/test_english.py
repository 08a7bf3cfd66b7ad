"""What a program can see of plain English: how a docstring begins, by what is returned, and clever expressions."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("eurobot_od", "tools", "tests")
PROPERTIES = ("property", "cached_property")


class Described(NamedTuple):
    """A function with its docstring: where it stands, what it returns, its first line."""

    place: str
    returns: str
    is_property: bool
    first: str


def functions(folder: str) -> Iterator[Described]:
    for file in sorted((ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or not (said := ast.get_docstring(node)):
                continue
            returns = ast.unparse(node.returns) if node.returns else ""
            is_property = any(ast.unparse(each).rpartition(".")[2] in PROPERTIES for each in node.decorator_list)
            place = f"{file.relative_to(ROOT)}:{node.lineno}"
            yield Described(place, returns, is_property, said.partition("\n")[0])


def mistake(each: Described) -> str:
    """Return what is wrong with the first line of a docstring, if anything is."""
    if each.is_property:
        return "a property" if re.match("(Return|Tell|Say) whether", each.first) else ""
    if each.returns == "bool" and re.match("(Tell|Say) |Whether", each.first):
        return "a bool"
    is_iterator = re.match("(Async)?(Iterator|Generator)", each.returns)
    return "an iterator" if is_iterator and each.first.startswith("Give ") else ""


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_docstring_begins_with_the_verb_for_what_is_returned(folder: str) -> None:
    wrong = [f"{each.place}: {what}: {each.first}" for each in functions(folder) if (what := mistake(each))]
    assert wrong == [], "Return whether ...; of a property Whether ...; Yield ..."


CONDITIONS = (ast.Compare, ast.BoolOp, ast.UnaryOp)


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str | bytes))


def is_condition(node: ast.AST) -> bool:
    return isinstance(node, CONDITIONS) or (isinstance(node, ast.Call) and ast.unparse(node.func) == "bool")


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_text_is_multiplied_by_a_condition(folder: str) -> None:
    wrong = [
        f"{file.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)}"
        for file in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Mult)
        and is_text(node.left)
        and is_condition(node.right)
    ]
    assert wrong == [], "write a conditional expression"
