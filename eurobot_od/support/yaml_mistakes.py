"""What the YAML parser complains about, in words for the file's author: what is probably meant, and how it is written.

The parser's own words (`expected <block end>`) are never shown; a complaint without a row is shown without its
brackets.
"""

from __future__ import annotations

import re

import yaml

MISTAKES = (
    (r"block scalar\|.*", "a text with > or | at its start needs quotes: '> 0'"),
    (r".*character '[>|]' that cannot start.*", "a text with > or | at its start needs quotes: '> 0'"),
    (r".*character '\\t' that cannot start.*", "a tab; YAML is indented by spaces"),
    (r".*character (?P<sign>'.') that cannot start.*", "a text with {sign} at its start needs quotes"),
    (r".*undefined alias (?P<name>'.*')", "* begins a reference, and there is none to {name}; a text needs quotes"),
    (r"(anchor|alias)\|.*", "a text with & or * at its start needs quotes"),
    (r"directive\|.*|.*'<document start>'.*", "this does not belong to what is before it: one document is one mapping"),
    (r".*mapping values are not allowed.*", "a ': ' in a text needs quotes; or this line is indented wrongly"),
    (r".*sequence entries are not allowed.*", "a list begins on a line of its own"),
    (r".*quoted scalar\|found unexpected end.*", "a quote that begins a text is never closed"),
    (r".*unknown escape character '(?P<sign>.+)'", r"\{sign} means nothing in double quotes; take single ones"),
    (r".*could not find expected ':'", "a line without ': '; a key has a colon and a space behind it"),
    (r"flow sequence\|.*", "a list in [ ] lacks a comma, or its ]"),
    (r"flow mapping\|.*", "a mapping in {{ }} lacks a comma, or its }}"),
    (r"block mapping\|.*'<scalar>'", "something behind a text in quotes; put all of it in quotes"),
    (r"block (mapping|collection)\|.*<block end>.*", "this line is not indented like those it belongs to"),
    (r".*node content.*", "a value is missing"),
    (r".*found another document", "a second document, where one is all there can be"),
)
"""A complaint as `context|problem`, context without `while ...ing a`, and what it means."""

CONTEXT = re.compile(r"while (parsing|scanning) an? ")


def in_words(error: yaml.MarkedYAMLError) -> str:
    """Say what is wrong, for a person."""
    # The parser's words are in two parts, of which either may be what tells one mistake from another.
    complaint = f"{CONTEXT.sub('', error.context or '', count=1)}|{error.problem}"
    for pattern, words in MISTAKES:
        match = re.fullmatch(pattern, complaint, re.DOTALL)
        if match:
            return words.format(**match.groupdict())
    return "not YAML: " + re.sub(r"[<>]", "", str(error.problem))
