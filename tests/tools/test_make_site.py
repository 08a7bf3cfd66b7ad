"""The links of the documentation's site are followed, and what a page loads is its own."""

from __future__ import annotations

from pathlib import Path

import make_site
import pytest

PAGE = '<html><body><h1 id="top">A</h1><a name="old"></a>{}</body></html>'

CASES = [
    # (what stands in a page, what is wrong with it)
    ('<a href="other.html">', []),
    ('<a href="other.html#top">', []),
    ('<a href="other.html#old">', []),
    ('<a href="#top">', []),
    ('<a href="a%20b.png">', []),
    ('<a href="https://example.com/x">', []),
    ('<a href="mailto:a@example.com">', []),
    ('<a href="none.html">', ["page.html: none.html leads nowhere"]),
    ('<a href="other.html#none">', ["page.html: other.html#none leads nowhere"]),
    ('<a href="#none">', ["page.html: #none leads nowhere"]),
    ('<img src="none.png">', ["page.html: none.png leads nowhere"]),
    ('<img src="a b.png">', []),
    ('<link rel="preload" href="https://a.example/x">', ["page.html: loads https://a.example/x from another host"]),
    ('<script src="//a.example/x.js">', ["page.html: loads //a.example/x.js from another host"]),
    ('<link rel="canonical" href="https://a.example/">', []),
]


@pytest.mark.parametrize(("text", "wrong"), CASES)
def test_a_link_leads_somewhere(text: str, wrong: list[str], tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(PAGE.format(text))
    (tmp_path / "other.html").write_text(PAGE.format('<a href="page.html">'))
    (tmp_path / "404.html").write_text('<a href="/none.html">')
    (tmp_path / "a b.png").write_bytes(b"")
    assert list(make_site.wrong_links(tmp_path)) == wrong
