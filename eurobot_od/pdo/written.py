"""Messages as a person writes them: fields as `name=value`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from eurobot_od.errors import FieldError, LocalError, UnknownName
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.message import Message


def parse(binding: Binding, fields: Sequence[str]) -> Message:
    """Return the message of `name=value` words; raises UnknownName, FieldError, LocalError."""
    values: dict[str, Any] = {}
    for field, value in (_value(binding, text) for text in fields):
        if field in values:
            raise LocalError(f"{binding.name}: {field} given twice")
        values[field] = value
    missing = [field for field in binding.kinds if field not in values and field not in binding.defaults]
    if missing:
        raise LocalError(f"{binding.name}: {', '.join(missing)} missing")
    return binding.message(**values)


def _value(binding: Binding, text: str) -> tuple[str, Any]:
    field, given, value = text.partition("=")
    if field not in binding.kinds:
        raise UnknownName(f"field of {binding.name}", field, binding.kinds)
    kind = binding.kinds[field]
    try:
        return field, kind.parse(value)
    except (ValueError, KeyError):
        limits = binding.limits.get(field)
        allowed = kind.allowed(limits) if limits else "nothing, as the loaded EDS does not map it"
        raise FieldError(binding.name, field, value if given else text, allowed) from None
