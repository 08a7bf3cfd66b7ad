"""The page as a file: it needs nothing else, and what it is given stays data."""

from __future__ import annotations

import base64
import hashlib
import json
import re

import pytest

from eurobot_od.web.page import FILES, SCRIPTS, Columns, page
from tests.kit import plant

EMPTY = Columns("empty", plant.decoder(), 500_000).data()


def test_the_page_loads_nothing_from_elsewhere() -> None:
    text = page("Match", [EMPTY], [])
    assert re.findall(r"""<(?:script|img|iframe)[^>]*src=|url\((?!#)|@import""", text) == []
    assert re.findall(r'href="(?!data:image/svg)[^"]*"', text) == []


@pytest.mark.parametrize(
    "evil", ["</script><script>alert(1)</script>", "<!-- <script>", "{{scripts}}", "'\"&", "\u2028", "]]>"]
)
def test_names_in_files_are_escaped(evil: str) -> None:
    text = page(evil, [{**EMPTY, "name": evil}], [])
    plain = page("plain", [{**EMPTY, "name": "plain"}], [])
    assert text.count("<script") == plain.count("<script")
    found = re.search(r'<script type="application/json" id="content">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    assert json.loads(found[1])["sources"][0]["name"] == evil


def test_the_policy_of_the_page_names_every_script_and_style_by_hash() -> None:
    text = page("Match", [EMPTY], [])
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None
    for tag in ("script", "style"):
        for content in re.findall(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL):
            assert base64.b64encode(hashlib.sha256(content.encode()).digest()).decode() in policy[1]
    assert "default-src 'none'" in policy[1]
    assert "unsafe" not in policy[1]


def test_the_plots_library_has_its_licence_beside_it() -> None:
    assert "Leon Sorokin" in (FILES / "uplot-license.txt").read_text()
    assert "uPlot" in (FILES / "uplot.js").read_text()


def test_nothing_but_the_panel_knows_the_robot() -> None:
    words = re.compile(r"goto|kalman|navigation|enem|barrier|eurobot", re.IGNORECASE)
    for name in ("page.html", "page.css", *(each for each in SCRIPTS if each != "uplot.js")):
        found = set(words.findall((FILES / name).read_text()))
        assert (name, found) == (name, set())
