"""Text that is not YAML is reported in words, at the place where the parser has noticed it."""

from __future__ import annotations

import pytest

from eurobot_od.support.yaml_places import Problems, ReadError, compose
from tests.marks import marked
from tests.rows import rows

QUOTES = "a text with > or | at its start needs quotes: '> 0'"
INDENTED = "this line is not indented like those it belongs to"
COLON = "a ': ' in a text needs quotes; or this line is indented wrongly"

# Each row: a text with ^ before the place of the complaint, and its words.
TEXTS = {
    "one space more": ("a: 1\n b^: 2\n", COLON),
    "a list that moves": ("a:\n  - x\n ^- y\n", INDENTED),
    "a key behind a list": ("- a\n^b: 1\n", INDENTED),
    "one space less": ("steps:\n- send: x\n  expect: y\n ^wait: 1\n", INDENTED),
    "an item inside an item": ("- a: 1\n  ^- b: 2\n", INDENTED),
    "a colon in a text": ("name: drive^: stops\n", COLON),
    "no space behind the colon": ("key:value\nb^: 1\n", COLON),
    "a list without its end": ("a: [1\nb^: 2\n", "a list in [ ] lacks a comma, or its ]"),
    "a list without commas": ("a: ['x' ^'y']\n", "a list in [ ] lacks a comma, or its ]"),
    "a mapping without its end": ("a: {x: 1\nb^: 2\n", "a mapping in { } lacks a comma, or its }"),
    "greater": ("a: > ^0\n", QUOTES),
    "greater or equal": ("a: >^= 3\n", QUOTES),
    "greater in a mapping": ("a: {t: ^> 0}\n", QUOTES),
    "a tab": ("a:\n^\t- b\n", "a tab; YAML is indented by spaces"),
    "an at": ("a: ^@x\n", "a text with '@' at its start needs quotes"),
    "a percent sign": ("a: ^%x\n", "a text with '%' at its start needs quotes"),
    "a star": ("a: ^*x\n", "* begins a reference, and there is none to 'x'; a text needs quotes"),
    "an ampersand": ("a: &^\n", "a text with & or * at its start needs quotes"),
    "a quote left open": ("a: 'x\n^", "a quote that begins a text is never closed"),
    "an escape": ('a: "\\^d"\n', "\\d means nothing in double quotes; take single ones"),
    "words behind quotes": ("a: 'b' ^c\n", "something behind a text in quotes; put all of it in quotes"),
    "a list on the key's line": ("a: ^- b\n", "a list begins on a line of its own"),
    "a last line without a colon": ("a: 1\nb^", "a line without ': '; a key has a colon and a space behind it"),
    "a bracket too many": ("a: ^]\n", "a value is missing"),
    "two documents in one": (
        "{a: 1}\n^b: 2\n",
        "this does not belong to what is before it: one document is one mapping",
    ),
}


@rows("text, words", TEXTS.values())
def test_what_is_no_yaml_is_told_in_words(text: str, words: str) -> None:
    source, place = marked(text)
    problems: Problems = []
    with pytest.raises(ReadError):
        compose(source, problems)
    ((line, column), what) = problems[0]
    assert (f"{line}:{column}", what) == (place, words)
