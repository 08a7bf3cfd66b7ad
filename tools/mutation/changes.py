"""Small changes of a Python source, each as a piece of text that takes another's place.

Rule of this file: a change is made from the syntax tree and written into the text, so that all other lines stay as
they are. What no test can notice by its nature is left alone: annotations, docstrings, assertions, what only a type
checker reads, and the arguments of `@dataclass`.
"""

from __future__ import annotations

import ast
import copy
import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple, TypeVar

MadeT = TypeVar("MadeT")


class Change(NamedTuple):
    """A change of a module: bytes `start` to `end` of its text become `new`."""

    module: str
    """Path of the module below the repository's root."""
    line: int
    lines: range
    """Lines of the statement, or of a compound statement's head, that a test has to come by."""
    start: int
    end: int
    statement: str
    """First line of the statement, without indentation."""
    what: str
    """Old text, arrow, new text, on one line."""
    new: str
    number: int = 1
    """Of the changes that are alike in all that is read, this one's number."""

    @property
    def name(self) -> str:
        """What stands for this change also when lines above it come and go."""
        return f"{self.module}: {self.statement}: {self.what} #{self.number}"

    def applied(self, source: bytes) -> bytes:
        """Return the changed source."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def changes_of(module: str, source: bytes) -> list[Change]:
    """Return all changes of a module's source, in the order of its text; raises SyntaxError."""
    found = _Finder(module, source).changes(ast.parse(source))
    seen: Counter[tuple[str, str]] = Counter()
    numbered = []
    for each in sorted(set(found), key=lambda change: (change.start, change.end, change.new)):
        seen[each.statement, each.what] += 1
        numbered.append(each._replace(number=seen[each.statement, each.what]))
    return numbered


def sample(changes: Iterable[Change], size: int, seed: int) -> list[Change]:
    """Draw changes. An edit of the package replaces only the drawn changes that it touches: the others stay drawn."""
    return sorted(changes, key=lambda change: hashlib.sha256(f"{seed} {change.name}".encode()).digest())[:size]


# What becomes of a piece of syntax

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


def _compared_otherwise(node: ast.Compare) -> Iterator[ast.expr]:
    for place, operator in enumerate(node.ops):
        changed = copy.deepcopy(node)
        changed.ops[place] = COMPARISONS[type(operator)]()
        yield changed


def _by_one(node: ast.Constant) -> Iterator[ast.expr]:
    if isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node.value, (int, float)):
        yield ast.Constant(node.value + 1)


def _and_or(node: ast.BoolOp) -> Iterator[ast.expr]:
    yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)


HELP = {"help", "metavar"}
"""Arguments that are text for `--help`."""


def _called_otherwise(node: ast.Call) -> Iterator[ast.expr]:
    if node.args:
        yield ast.Call(node.func, node.args[:-1], node.keywords)
    for place, keyword in enumerate(node.keywords):
        if keyword.arg not in HELP:
            yield ast.Call(node.func, node.args, node.keywords[:place] + node.keywords[place + 1 :])
    match node.args:
        case [ast.Starred(), *_] | [_, ast.Starred(), *_]:
            return
        case [first, second, *others] if ast.dump(first) != ast.dump(second):
            yield ast.Call(node.func, [second, first, *others], node.keywords)


EXPRESSIONS: dict[type[ast.AST], Callable[..., Iterator[ast.expr]]] = {
    ast.Compare: _compared_otherwise,
    ast.Constant: _by_one,
    ast.BoolOp: _and_or,
    ast.Call: _called_otherwise,
}

TRUE, FALSE = ast.Constant(True), ast.Constant(False)


def _fixed_condition(node: ast.If | ast.IfExp) -> Iterator[tuple[ast.expr, ast.expr]]:
    yield node.test, TRUE
    yield node.test, FALSE


def _no_round(node: ast.While) -> Iterator[tuple[ast.expr, ast.expr]]:
    yield node.test, FALSE  # True would be a time-out each


def _nothing_left_out(node: ast.comprehension) -> Iterator[tuple[ast.expr, ast.expr]]:
    yield from ((each, TRUE) for each in node.ifs)


def _none_returned(node: ast.Return) -> Iterator[tuple[ast.expr, ast.expr]]:
    if node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None):
        yield node.value, ast.Constant(None)


PARTS: dict[type[ast.AST], Callable[..., Iterator[tuple[ast.expr, ast.expr]]]] = {
    ast.If: _fixed_condition,
    ast.IfExp: _fixed_condition,
    ast.While: _no_round,
    ast.comprehension: _nothing_left_out,
    ast.Return: _none_returned,
}
"""Parts of a node and what takes their place."""

DROPPED = (ast.AugAssign, ast.Raise, ast.Delete, ast.Continue, ast.Break)


def _is_dropped(node: ast.stmt) -> bool:
    match node:
        case ast.Expr(value=ast.Constant()):
            return False
        case ast.Expr() | ast.Return(value=None) | ast.Assign(targets=[ast.Attribute() | ast.Subscript(), *_]):
            return True
    return isinstance(node, DROPPED)


# What is left alone

FOR_TYPES = {"TypeVar", "ParamSpec", "NewType", "cast", "dataclass"}
"""Functions whose arguments are for a type checker, or of which most changes leave all behaviour as it is."""


def _is_left_alone(node: ast.AST) -> bool:
    match node:
        case ast.Assert() | ast.JoinedStr():  # before Python 3.12, positions in an f-string are wrong
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.Call(func=ast.Name(id=name)):
            return name in FOR_TYPES
    return False


ANNOTATIONS = {"annotation", "returns", "type_comment", "type_params"}


class _Finder:
    """Walks a module's syntax tree; `_lines` are those of the statement it is at."""

    def __init__(self, module: str, source: bytes) -> None:
        self._module, self._source = module, source
        self._starts = [0]
        for line in source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self._lines = range(1, 1)

    def changes(self, node: ast.AST) -> Iterator[Change]:
        """Find the changes of a node and of all below it."""
        if _is_left_alone(node):
            return
        if isinstance(node, ast.stmt):
            self._lines = _head(node)
        yield from self._here(node)
        for field, value in ast.iter_fields(node):
            if field not in ANNOTATIONS:
                yield from self._below(value)

    def _below(self, value: object) -> Iterator[Change]:
        before = self._lines
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, ast.AST):
                yield from self.changes(each)
        self._lines = before

    def _here(self, node: ast.AST) -> Iterator[Change]:
        if isinstance(node, ast.stmt) and _is_dropped(node):
            yield self._change(node, "pass")
        if isinstance(node, ast.expr):
            yield from (self._change(node, _text(other)) for other in _made(EXPRESSIONS, node))
        for part, other in _made(PARTS, node):
            yield self._change(part, _text(other))

    def _change(self, node: ast.expr | ast.stmt, new: str) -> Change:
        start = self._starts[node.lineno - 1] + node.col_offset
        end = self._starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        return Change(
            self._module,
            node.lineno,
            self._lines,
            start,
            end,
            self._line_text(self._lines.start),
            " ".join(f"{self._source[start:end].decode()} -> {new}".split()),
            new,
        )

    def _line_text(self, line: int) -> str:
        return self._source[self._starts[line - 1] : self._starts[line]].decode().strip()


def _made(table: Mapping[type[ast.AST], Callable[..., Iterator[MadeT]]], node: ast.AST) -> Iterator[MadeT]:
    make = table.get(type(node))
    return make(node) if make else iter(())


def _text(node: ast.expr) -> str:
    text = ast.unparse(ast.fix_missing_locations(node))
    return text if isinstance(node, (ast.Constant, ast.Call)) else f"({text})"


def _head(node: ast.stmt) -> range:
    body = getattr(node, "body", None)
    last: int = body[0].lineno - 1 if body else node.end_lineno or node.lineno
    return range(node.lineno, max(last, node.lineno) + 1)
