"""A request of the page: how it is done, whether it takes control, and what its fields must be."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from enum import Enum
from math import isfinite
from typing import Any, NamedTuple

from eurobot_od.errors import EurobotError, LocalError
from eurobot_od.support.texts import one_line

Arguments = Mapping[str, Any]
"""The fields of a request besides its name; `who` is the browser that asks, `stops` how many STOPs came before it."""


class Way(Enum):
    """How a request is done."""

    AT_ONCE = "in the session's own thread"
    SENDS = "beside all others: it waits for the driver at most"
    ORDERS = "in its own turn: what moves drives after all other orders to them, and past all questions"
    ASKS = "after all others that ask: a node has to answer"


class PageRequest(NamedTuple):
    """The function of a request, how it is done, and whether it acts on bus or disk, which takes control."""

    function: Callable[[Any, Arguments], Any]
    way: Way = Way.ASKS
    acts: bool = False


def read_request(text: str) -> dict[str, Any]:
    """Return the fields of a request; raises LocalError for a text that is no JSON object."""
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):  # RecursionError: too many nested brackets
        raise LocalError("a request is JSON") from None
    if not isinstance(said, dict):
        raise LocalError("a request is a JSON object")
    return said


def answered(text: str, do: Callable[[dict[str, Any]], Any]) -> str:
    """Answer a request by the result or the error of `do`, both as JSON."""
    try:
        return json.dumps({"ok": do(read_request(text))})
    except (EurobotError, OSError) as error:
        return json.dumps({"error": one_line(str(error))})


def text_of(said: Arguments, name: str) -> str:
    """Return a field that has to be a text; raises LocalError."""
    value = said.get(name)
    if not isinstance(value, str):
        raise LocalError(f"{name} is missing, or not a text")
    return value


def whole_of(said: Arguments, name: str) -> int:
    """Return a field that has to be a whole number; raises LocalError."""
    value = said.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise LocalError(f"{name} is missing, or not a whole number")
    return value


def number_of(said: Arguments, name: str) -> float:
    """Return a field that has to be a number; raises LocalError."""
    value = said.get(name)
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not isfinite(value):
        raise LocalError(f"{name} is missing, or not a number")
    return value
