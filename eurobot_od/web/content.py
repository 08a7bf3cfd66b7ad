"""What the page knows before the first frame: messages with their fields, nodes with what their files say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from eurobot_od.od.standard import IDENTITY
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.message import kinds
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.web.drives import axes_of, drive_data, machine_data
from eurobot_od.web.panel import PageEvent, Panel


def described(decoder: Decoder) -> dict[str, Any]:
    """Return messages and nodes as data."""
    return {
        "messages": [
            {
                "id": each.cob_id,
                "name": each.name,
                "group": each.group,
                "senders": each.senders,
                "receivers": each.receivers,
                "fields": [_field(each, field) for field in each.kinds],
            }
            for each in decoder.protocol.bindings
        ],
        "nodes": [
            {
                "name": each.name,
                "id": each.node_id,
                "file": each.file.name,
                "identity": [each.number((IDENTITY, sub)) for sub in range(1, 5)],
                "drive": drive_data(each),
            }
            for each in decoder.dictionaries
        ],
        "machine": machine_data() if any(map(axes_of, decoder.dictionaries)) else None,
        "groups": list(decoder.protocol.catalogue.groups),
    }


def _field(binding: Binding, field: str) -> dict[str, Any]:
    kind, limits = binding.kinds[field], binding.limits.get(field)
    data: dict[str, Any] = {"name": field, "unit": kind.unit, "words": dict(kind.named_values())}
    data |= {"allowed": kind.allowed(limits)} if limits else {"unmapped": True}
    if limits and kind.numbers(limits):
        data |= {"low": kind.numbers(limits).start, "high": kind.numbers(limits).stop - 1}
    if field in binding.defaults:
        data["default"] = kind.text(binding.defaults[field])
    return data


def panels_described(panels: Iterable[type[Panel]]) -> list[dict[str, Any]]:
    """Return the panels as data."""
    return [{"name": each.name, "title": each.title, "stop": each.stop, "setup": each.setup()} for each in panels]


def stop_message(panels: Sequence[type[Panel]]) -> str:
    """Return the message that stops what can be stopped, `` if no panel has one."""
    return next((each.stop for each in panels if each.stop), "")


def values(meaning: Meaning) -> list[Any] | None:
    """Return a message's values for the page: numbers, None for unknown, words; None if it is not a message."""
    if meaning.message is None:
        return None
    written = kinds(type(meaning.message))
    return [kind.plain(value) for kind, value in zip(written.values(), meaning.message)]


def defects(meaning: Meaning) -> str:
    """Say what is wrong with a frame, `` if nothing is."""
    return "; ".join(f"{damage.value}: {text}" for damage, text in meaning.defects)


def event_data(event: PageEvent) -> dict[str, Any]:
    """Return an event as data."""
    return event._asdict() | {"time": round(event.time, 4), "end": None if event.end is None else round(event.end, 4)}
