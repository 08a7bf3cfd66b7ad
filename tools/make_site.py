"""Makes the documentation's site in build/site, and follows all its links.

`python3 tools/make_site.py` runs before anything is installed, so it uses the standard library only.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from environment import ROOT, call, prepare

SITE = ROOT / "build" / "site"
LOADED = {"img": "src", "script": "src", "link": "href", "source": "src", "iframe": "src"}
"""Attributes with the address of a file that a browser loads by itself, by element."""


class Links(HTMLParser):
    """The links of a page, the files it loads, and its anchors."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.leads: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = {""}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = {name: value or "" for name, value in attrs}
        self.anchors |= {said[name] for name in ("id", "name") if name in said}
        if tag == "a" and "href" in said:
            self.leads.append(said["href"])
        elif LOADED.get(tag) in said and said.get("rel") != "canonical":
            self.loads.append(said[LOADED[tag]])


def wrong_links(site: Path) -> Iterator[str]:
    """Yield the wrong links of a site: a target that does not exist, or a file loaded from another host."""
    files = (file for file in site.rglob("*.html") if file.name != "404.html")  # which may stand for any address
    pages = {file.resolve(): Links(file.read_text(encoding="utf-8")) for file in files}
    for file, page in pages.items():
        for link in page.loads:
            if urlsplit(link).netloc:
                yield f"{file.relative_to(site.resolve())}: loads {link} from another host"
        for link in page.leads + page.loads:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            if not target.is_file() or (target in pages and unquote(parts.fragment) not in pages[target].anchors):
                yield f"{file.relative_to(site.resolve())}: {link} leads nowhere"


def main() -> int:
    """Build the site and check its links; return 1 if something is wrong."""
    python = prepare("docs")
    os.chdir(ROOT)
    build = (python, "-m", "zensical", "build", "--clean", "--strict")
    if call(python, ROOT / "tools" / "site_pages.py", ROOT / "build" / "docs") or call(*build):
        return 1
    wrong = sorted(wrong_links(SITE))
    print("\n".join(wrong) or f"{SITE / 'index.html'}: {len([*SITE.rglob('*.html')])} pages, all links lead somewhere")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
