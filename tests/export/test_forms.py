"""The document of a network: what it says, and that no text of a file gets out of its place."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from eurobot_od.errors import UnknownName
from eurobot_od.export.forms import FORMS, docs_text, form_of, one_line
from eurobot_od.pdo.protocol import Protocol
from tests.export import made_up
from tests.kit import plant

VOID = ("meta",)
TAGS = {"html", "head", "meta", "title", "style", "body", "h1", "h2", "h3", "p", "a"}
TAGS |= {"table", "thead", "tbody", "tr", "th", "td"}
"""All that a document is made of."""


class Tables(HTMLParser):
    """Reads the tables of a page, and fails on a tag that is not closed where it ought to be."""

    def __init__(self) -> None:
        super().__init__()
        self.tables: list[list[list[str]]] = []
        self.tags: set[str] = set()
        self.headings: list[str] = []
        self.links: list[str] = []
        self.anchors: list[str] = []
        self._open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = dict(attrs)
        self.tags.add(tag)
        self.links += [said["href"] or ""] if "href" in said else []
        self.anchors += [said["id"] or ""] if "id" in said else []
        self._open += [tag] if tag not in VOID else []
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
        elif re.fullmatch("h[1-6]", tag):
            self.headings.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if {"td", "th"} & set(self._open):
            self.tables[-1][-1][-1] += data
        elif re.fullmatch("h[1-6]", next(iter(self._open[-1:]), "")):
            self.headings[-1] += data


def read(page: str) -> Tables:
    tables = Tables()
    tables.feed(page)
    assert tables._open == []
    return tables


def page(text: str, form: str) -> str:
    """Return a document as HTML; Markdown as others make HTML of it, with no HTML of its own but anchors."""
    if form == "html":
        return text
    anchors = re.compile(r'<a id="([a-z]+-[0-9a-f]+)"></a>\n')
    assert anchors.sub("", text).count("<") == text.count("\\<")
    return str(MarkdownIt("commonmark", {"html": True}).enable("table").render(text))


def line(form: str, dialect: str | None = None) -> Tables:
    return read(page(docs_text(plant.protocol(dialect), plant.load_all(dialect), form), form))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_json_lists_all_messages_and_objects(form: str, dialect: str) -> None:
    found = line(form, dialect)
    protocol, dictionaries = plant.protocol(dialect), plant.load_all(dialect)
    messages, *_, scale = found.tables
    assert [row[:2] for row in messages[1:]] == [[f"0x{b.cob_id:03X}", b.name] for b in protocol.bindings]
    addresses = [(int(row[0], 16), int(row[1])) for row in scale[1:] if row[1]]
    assert addresses == list(dictionaries[-1].addresses())
    assert {each[1:] for each in found.links} <= set(found.anchors)


@pytest.mark.parametrize("form", FORMS)
def test_the_fields_of_a_message(form: str) -> None:
    found = next(each for each in line(form).tables if each[1][0] == "x")
    assert found[:3] == [
        ["Field", "Bits", "Width", "Number", "Range", "Unit", "Values with names"],
        ["x", "0.0..1.3", "12", "unsigned", "0..3000", "mm", ""],
        ["y", "1.4..2.7", "12", "unsigned", "0..2000", "mm", ""],
    ]


@pytest.mark.parametrize("form", FORMS)
def test_names_stay_text(form: str) -> None:
    messages = [(f"Number {n} {name}", [made_up.Field(name, 7, 8)]) for n, name in enumerate(made_up.BAD_NAMES)]
    protocol = made_up.protocol(messages)
    found = read(page(docs_text(protocol, [made_up.dictionary(messages)], form), form))
    assert found.tags <= TAGS
    assert len(found.tables) == 1 + len(messages) + 1
    names = [row[1] for row in found.tables[0][1:]]
    assert [" ".join(each.split()) for each in names] == [one_line(each.name) for each in protocol.bindings]


@pytest.mark.parametrize("form", FORMS)
def test_a_device_without_messages_has_its_objects(form: str) -> None:
    lonely = made_up.dictionary([("Lonely", [made_up.Field("Value", 7, 32)])])
    found = read(page(docs_text(Protocol([]), [lonely], form), form))
    assert "None of the devices has a valid PDO." in docs_text(Protocol([]), [lonely], form)
    assert len(found.tables) == 1


FILES = [("a.md", "markdown"), ("a.MARKDOWN", "markdown"), ("a.html", "html"), ("b/a.htm", "html")]


@pytest.mark.parametrize(("file", "form"), FILES)
def test_the_suffix_says_the_form(file: str, form: str) -> None:
    assert form_of(Path(file)) == form


def test_another_suffix_is_unknown() -> None:
    with pytest.raises(UnknownName, match=r"unknown document format '\.pdf'; known: \.md"):
        form_of(Path("a.pdf"))
