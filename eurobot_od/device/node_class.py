"""Checks of a node's class: its tables, its handlers, and methods of ours that it hides.

Checks without a file run when the class is created; checks against the EDS when a node is created. Python would notice
these mistakes only when a message comes, or never. Each mistake is one line with its place in the class.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import CodeType, FunctionType
from typing import Any

from eurobot_od.device.bound import BoundObject, Setting
from eurobot_od.errors import NodeClassError, meant
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import MANUFACTURER, PdoDirection
from eurobot_od.support import extras

TABLES = ("CATALOGUE", "HANDLERS", "OBJECTS", "MEASURED")

LIFE = frozenset({"start", "receive", "requested", "tick", "restart", "failed", "bus_lost", "handle", "reset"})
"""Methods that a subclass may only extend, by calling that of its base class."""

OURS = "eurobot_od."
"""Prefix of our modules, whose classes may know more messages than an EDS has."""

HANDLER = ("self", "message")
READER = ("self",)
"""Arguments of a handler, and of a function that reads an object."""

FUNCTIONS = {"READERS": READER, "WRITERS": ("self", "value")}
"""Tables of a `SimulatedDevice`, with the arguments of their functions."""


# Checks of a class alone


def check(kind: type, node: type) -> None:
    """Check a class of a `node`, unless it is ours; raises NodeClassError."""
    if kind.__module__.startswith(OURS):
        return
    for problems in (misspelled_tables, wrong_handlers, wrong_objects, wrong_measured, wrong_values, hidden_members):
        for word, what in problems(kind, node):
            raise NodeClassError(place_of(kind, word), f"{kind.__name__} {what}")


def misspelled_tables(kind: type, _: type) -> Iterator[tuple[str, str]]:
    """Yield attributes with nearly the name of a table."""
    for name in vars(kind):
        hint = "" if name in TABLES or name.startswith("_") else meant(name, TABLES)
        if hint and isinstance(vars(kind)[name], Mapping):
            yield name, f"has a table {name}, which no node reads{hint}"


def own(kind: type, table: str) -> Mapping[Any, Any]:
    """Return a table of a class itself; raises NodeClassError if it is not a mapping."""
    found = vars(kind).get(table, {})
    if not isinstance(found, Mapping):
        what = f"has {table} of type {type(found).__name__}; a table is meant: {table} = {{...}}"
        raise NodeClassError(place_of(kind, table), f"{kind.__name__} {what}")
    return found


def wrong_handlers(kind: Any, node: type) -> Iterator[tuple[str, str]]:
    """Yield keys that are not messages of the catalogue, and handlers that cannot be called with a message."""
    for key, handler in own(kind, "HANDLERS").items():
        word = key if isinstance(key, str) else getattr(key, "__name__", type(key).__name__)
        if what := not_a_message(kind, key):
            yield word, f"has a handler for {what}"
        if what := not_called_with(handler, HANDLER):
            yield word, f"has a handler for {word} {what}"
        if (name := getattr(handler, "__name__", "")) in dir(node) and vars(kind).get(name) is handler:
            yield name, f"has a handler named {name}, which hides {node.__name__}.{name}; give it another name"


def wrong_values(kind: type, _: type) -> Iterator[tuple[str, str]]:
    """Yield readers and writers of a simulated device that cannot be called."""
    for table, arguments in FUNCTIONS.items():
        for name, function in own(kind, table).items():
            if what := not_called_with(function, arguments):
                yield str(name), f"has in {table} for {name!r} a function {what}"


def not_a_message(kind: Any, key: Any) -> str:
    """Return why a key is not a message class of the node, or an empty text."""
    types = {each.__name__: each for each in kind.CATALOGUE.types}
    if isinstance(key, str):
        hint = meant(key.replace(" ", ""), tuple(types)) or "; the class is meant, without quotes"
        return f"{key!r}, which is a text and no message{hint}"
    if not is_message(key):
        return f"{key!r}, which is no message{f'; did you mean {type(key).__name__}?' if is_message(type(key)) else ''}"
    if not types or key in types.values():  # a subclass may have a catalogue; see `check_file`
        return ""
    name = key.__name__
    if name in types:
        return f"{name} of {key.__module__}, where its CATALOGUE has that of {types[name].__module__}"
    return f"{name}, which is not in its CATALOGUE{meant(name, tuple(types)) or '; is CATALOGUE the right one?'}"


def is_message(key: object) -> bool:
    """Return whether an object is a message class."""
    return isinstance(key, type) and issubclass(key, tuple) and hasattr(key, "_fields")


def not_called_with(function: object, arguments: tuple[str, ...]) -> str:
    """Return why a function cannot be called with these arguments, or an empty text."""
    meant_ = f"; `def name({', '.join(arguments)})` is meant"
    if not callable(function):
        return f"that cannot be called, {function!r}{meant_}"
    if inspect.iscoroutinefunction(function) or inspect.isgeneratorfunction(function):
        return f"that is asynchronous or a generator, {shown(function)}; nobody would run it{meant_}"
    parameters = signature(function)
    if parameters is None or fits(parameters, len(arguments)):
        return ""
    return f"with the arguments {parameters}; it is called with ({', '.join(arguments)}){meant_}"


def signature(function: Callable[..., object]) -> inspect.Signature | None:
    """Return a function's signature, None if Python does not know it."""
    try:
        return inspect.signature(function)
    except ValueError:
        return None


def fits(parameters: inspect.Signature, count: int, names: Iterable[str] = ()) -> bool:
    """Return whether a function can be called with `count` positional arguments, and others by name."""
    try:
        parameters.bind(*range(count), **dict.fromkeys(names))
    except TypeError:
        return False
    return True


def wrong_objects(kind: type, _: type) -> Iterator[tuple[str, str]]:
    """Yield objects without a valid binding."""
    for name, bound in own(kind, "OBJECTS").items():
        if not isinstance(bound, BoundObject):
            what = f"BoundObject(write={shown(bound)})" if is_message(bound) else "BoundObject(read=...)"
            yield name, f"binds {name!r} to {shown(bound)}; {what} is meant"
        elif bound.write is not None and (what := not_a_message(kind, bound.write)):
            yield name, f"binds writing of {name!r} to {what}"
        elif bound.read is not None and (what := not_called_with(bound.read, READER)):
            yield name, f"reads {name!r} by a function {what}"


def shown(value: object) -> str:
    """Return the name of a class or function, else the value's `repr`."""
    return getattr(value, "__name__", repr(value))


def wrong_measured(kind: type, _: type) -> Iterator[tuple[str, str]]:
    """Yield measured values without a valid function."""
    for name, read in own(kind, "MEASURED").items():
        if what := not_called_with(read, READER):
            yield name, f"measures {name!r} by a function {what}"


def hidden_members(kind: type, node: type) -> Iterator[tuple[str, str]]:
    """Yield attributes that hide a method of ours and cannot be called like it."""
    bases = [base for base in kind.__mro__[1:] if base in node.__mro__[:-1] or issubclass(base, node)]
    for name, member in vars(kind).items():
        owner = next((base for base in bases if name in vars(base)), None)
        is_replaced = name in LIFE and isinstance(member, FunctionType) and is_stand_in(kind)
        if owner is None or name.startswith("__") or is_replaced:
            continue
        if isinstance(vars(owner)[name], FunctionType):
            yield from ((name, what) for what in hides(owner, name, member))


def is_stand_in(kind: type) -> bool:
    """Return whether a class replaces a node's `start` or `receive`, and has no tables."""
    acts = any(getattr(kind, table, None) for table in TABLES if table != "CATALOGUE")
    return not acts and bool({"start", "receive"} & vars(kind).keys())


def hides(owner: type, name: str, member: object) -> Iterator[str]:
    """Yield how a member hides a method of a base class."""
    method = f"{owner.__name__}.{name}"
    if not isinstance(member, FunctionType):
        kind = "setting" if isinstance(member, Setting) else type(member).__name__
        yield f"has a {kind} named {name}, which hides the method {method}; give it another name"
        return
    theirs = inspect.signature(member)
    if not takes_calls_of(theirs, inspect.signature(vars(owner)[name])):
        called = inspect.signature(vars(owner)[name]).replace(return_annotation=inspect.Signature.empty)
        yield f"has a method {name}{theirs}, which hides {method}{called}; give it another name or these arguments"
    elif name in LIFE and not {"super", name} & {*names_in(member.__code__)}:  # or by `Node.tick(self, now)`
        yield f"has a method {name} that does not call super().{name}(...), without which the node does nothing"


def names_in(code: CodeType) -> Iterator[str]:
    """Yield the names that a function's code uses, nested code included."""
    yield from code.co_names
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from names_in(each)


def takes_calls_of(theirs: inspect.Signature, ours: inspect.Signature) -> bool:
    """Return whether their method can be called like ours."""
    kinds = [each.kind for each in ours.parameters.values()]
    by_name = [name for name, each in ours.parameters.items() if each.kind is each.KEYWORD_ONLY]
    return fits(theirs, sum(each is not inspect.Parameter.KEYWORD_ONLY for each in kinds), by_name)


# Checks of a class against a file


def check_file(kind: Any, dictionary: Dictionary) -> None:
    """Check that the EDS has the messages and objects of a class, unless it is ours; raises NodeClassError."""
    for problems in (unmapped_messages, unknown_objects, unknown_values):
        for word, what in problems(kind, dictionary):
            raise NodeClassError(place_of(kind, word), f"{kind.__name__} {what}")


def theirs(kind: type, table: str) -> list[Any]:
    """Return the keys of a table that do not come from a class of ours."""
    ours = (base for base in kind.__mro__ if base.__module__.startswith(OURS))
    known = {key for base in ours for key in vars(base).get(table, ())}
    return [key for key in getattr(kind, table) if key not in known]


def unmapped_messages(kind: Any, dictionary: Dictionary) -> Iterator[tuple[str, str]]:
    """Yield messages with a handler that the node cannot receive."""
    wanted = theirs(kind, "HANDLERS")
    pdos = list(dictionary.read_pdos(dictionary.default, lambda _: None)) if wanted else []
    found = [(entry.type, pdo.direction) for pdo in pdos if (entry := kind.CATALOGUE.find(pdo.name))]
    heard = {each.__name__: each for each, direction in found if direction is PdoDirection.RPDO}
    for message in wanted:
        if message not in heard.values():
            sent = "; it sends it" if (message, PdoDirection.TPDO) in found else meant(message.__name__, tuple(heard))
            yield message.__name__, f"handles {message.__name__} without an RPDO for it in {dictionary.file}{sent}"


def unknown_objects(kind: Any, dictionary: Dictionary) -> Iterator[tuple[str, str]]:
    """Yield names of objects that the file does not have."""
    for name in theirs(kind, "OBJECTS"):
        if dictionary.data_index(name) is None:
            names = [dictionary.objects.indices[index].name for index in dictionary.members if index in MANUFACTURER]
            hint = meant(name, names)
            yield name, f"binds {name!r}, which is not an object in {dictionary.file}{hint}"


def unknown_values(kind: Any, dictionary: Dictionary) -> Iterator[tuple[str, str]]:
    """Yield names of settings and measured values that the file does not have."""
    for name in (*theirs(kind, "MEASURED"), *their_settings(kind)):
        if name not in dictionary.names:
            yield name, f"names {name!r}, which is not a value in {dictionary.file}{meant(name, dictionary.names)}"


def their_settings(kind: type) -> Iterator[str]:
    """Yield the names of settings that do not come from a class of ours."""
    for base in kind.__mro__:
        if not base.__module__.startswith(OURS):
            yield from (name for each in vars(base).values() if isinstance(each, Setting) for name in each.names)


# Checks of a node


def check_attributes(node: object, base: type) -> None:
    """Check that no attribute of the node hides a method of `base`; raises NodeClassError."""
    for name in vars(node):
        if isinstance(getattr(base, name, None), FunctionType) and not callable(vars(node)[name]):
            kind = type(node)
            what = f"sets self.{name}, which hides the method {base.__name__}.{name}; give it another name"
            raise NodeClassError(place_of(kind, f"self.{name}"), f"{kind.__name__} {what}")


def check_answer(node: object, answer: object) -> None:
    """Check that a handler's answer is a message; raises NodeClassError."""
    if not is_message(type(answer)):
        kind = type(node)
        hint = f"; did you mean {shown(answer)}()?" if is_message(answer) else ""
        what = f"sends {shown(answer)}, which is no message{hint}"
        raise NodeClassError(place_of(kind, shown(answer)), f"{kind.__name__} {what}")


def place_of(kind: type, word: str) -> str:
    """Return `file:line` of a word in a class, or of the class."""
    place = extras.place_of(kind)
    file, _, line = place.rpartition(":")
    if not line.isdigit():
        return place
    lines = inspect.getsourcelines(kind)[0]
    for end in (r"[\"']?:", r"(?!\w)"):  # as the key of a table, or else anywhere
        for number, text in enumerate(lines[1:], start=int(line) + 1):
            if re.search(rf"(?<!\w){re.escape(word)}{end}", text):
                return f"{file}:{number}"
    return place
