"""Writes the `.od` of CanFestival's editor: a Python object in XML, as gnosis writes it."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr


def od_file(**attributes: object) -> bytes:
    """Return the bytes of a file with these attributes of a node."""
    begin = ('<?xml version="1.0"?>', '<!DOCTYPE PyObject SYSTEM "PyObjects.dtd">', '<PyObject class="Node">')
    lines = (_element("attr", each, f' name="{name}"') for name, each in attributes.items())
    return "\n".join([*begin, *lines, "</PyObject>", ""]).encode()


def _element(tag: str, value: object, more: str = "") -> str:
    if isinstance(value, dict):
        entries = (f"<entry>{_element('key', key)}{_element('val', each)}</entry>" for key, each in value.items())
        return f'<{tag}{more} type="dict">{"".join(entries)}</{tag}>'
    if isinstance(value, list):
        return f'<{tag}{more} type="list">{"".join(_element("item", each) for each in value)}</{tag}>'
    if isinstance(value, bool):
        return f'<{tag}{more} type="{value}" value=""/>'
    kind = "string" if isinstance(value, str) else "numeric"
    return f"<{tag}{more} type={quoteattr(kind)} value={quoteattr(str(value))}/>"
