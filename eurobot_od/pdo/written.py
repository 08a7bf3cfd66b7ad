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
    for text in fields:
        field, given, value = text.partition("=")
        if field not in binding.kinds:
            raise UnknownName(f"field of {binding.name}", field, binding.kinds)
        if field in values:
            raise LocalError(f"{binding.name}: {field} given twice")
        kind, limits = binding.kinds[field], binding.limits.get(field)
        try:
            values[field] = kind.parse(value)
        except (ValueError, KeyError):
            allowed = kind.allowed(limits) if limits else "nothing, as the loaded EDS does not map it"
            # without an equals sign the whole word is what was written, and wrong
            raise FieldError(binding.name, field, value if given else text, allowed) from None
    missing = [field for field in binding.kinds if field not in values and field not in binding.defaults]
    if missing:
        raise LocalError(f"{binding.name}: {', '.join(missing)} missing")
    return binding.message(**values)
