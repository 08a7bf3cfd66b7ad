"""What a program can see of plain English: how a docstring begins, by what is returned, and clever expressions."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
FOLDERS = ("eurobot_od", "tools", "tests")
PROPERTIES = ("property", "cached_property")


class Described(NamedTuple):
    """A function with its docstring: where it stands, what it returns, its first line."""

    place: str
    returns: str
    is_property: bool
    first: str


KINDS = (
    ast.FunctionDef,
    ast.AsyncFunctionDef,
    ast.Expr,
    ast.BinOp,
    ast.IfExp,
    ast.For,
    ast.AsyncFor,
    ast.comprehension,
)
"""The nodes that a rule looks at."""


@cache
def nodes() -> list[tuple[str, ast.AST]]:
    """Return these nodes of all files, each with its file."""
    files = sorted(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py"))
    trees = ((str(file.relative_to(ROOT)), ast.parse(file.read_text("utf-8"))) for file in files)
    return [(file, node) for file, tree in trees for node in ast.walk(tree) if isinstance(node, KINDS)]


def functions() -> Iterator[Described]:
    for file, node in nodes():
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or not (said := ast.get_docstring(node)):
            continue
        returns = ast.unparse(node.returns) if node.returns else ""
        is_property = any(ast.unparse(each).rpartition(".")[2] in PROPERTIES for each in node.decorator_list)
        yield Described(f"{file}:{node.lineno}", returns, is_property, said.partition("\n")[0])


def mistake(each: Described) -> str:
    """Return what is wrong with the first line of a docstring, if anything is."""
    if each.is_property:
        return "a property" if re.match("(Return|Tell|Say) whether", each.first) else ""
    if each.returns == "bool" and re.match("(Tell|Say) |Whether", each.first):
        return "a bool"
    is_iterator = re.match("(Async)?(Iterator|Generator)", each.returns)
    return "an iterator" if is_iterator and each.first.startswith("Give ") else ""


def test_a_docstring_begins_with_the_verb_for_what_is_returned() -> None:
    wrong = [f"{each.place}: {what}: {each.first}" for each in functions() if (what := mistake(each))]
    assert wrong == [], "Return whether ...; of a property Whether ...; Yield ..."


CONDITIONS = (ast.Compare, ast.BoolOp, ast.UnaryOp)


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str | bytes))


def is_condition(node: ast.AST) -> bool:
    return isinstance(node, CONDITIONS) or (isinstance(node, ast.Call) and ast.unparse(node.func) == "bool")


def test_no_text_is_multiplied_by_a_condition() -> None:
    wrong = [
        f"{file}:{node.lineno}: {ast.unparse(node)}"
        for file, node in nodes()
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Mult)
        and is_text(node.left)
        and is_condition(node.right)
    ]
    assert wrong == [], "write a conditional expression"


UNIT_ALONE = re.compile(r"(Milliseconds|Seconds) (that|after|in|of|from|by|for|between|until|which|without|an?)\b")

BANNED = re.compile(r"(Say|Tell|Give|Have|See|Let|Raise|Look|Seconds|Milliseconds|Make sure)\b")


def test_no_docstring_begins_with_a_vague_verb() -> None:
    wrong = [f"{each.place}: {each.first}" for each in functions() if BANNED.match(each.first)]
    assert wrong == [], "name what the function does: Return, Yield, Send, Check, ..."


def test_no_constant_is_described_by_its_unit_alone() -> None:
    wrong = [
        f"{file}:{node.lineno}: {node.value.value}"
        for file, node in nodes()
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        and UNIT_ALONE.match(node.value.value)
    ]
    assert wrong == [], "say what the constant is, and its unit: Timeout of an answer, in s."


def test_no_conditional_expression_is_inside_another_one() -> None:
    wrong = [
        f"{file}:{node.lineno}: {ast.unparse(node)}"
        for file, node in nodes()
        if isinstance(node, ast.IfExp)
        and any(isinstance(inner, ast.IfExp) for inner in ast.walk(node) if inner is not node)
    ]
    assert wrong == [], "write an if statement"


def test_no_loop_is_over_a_conditional_expression() -> None:
    wrong = [
        f"{file}:{node.iter.lineno}: {ast.unparse(node.iter)}"
        for file, node in nodes()
        if isinstance(node, ast.For | ast.AsyncFor | ast.comprehension) and isinstance(node.iter, ast.IfExp)
    ]
    assert wrong == [], "choose what to loop over in a statement of its own"
