"""Writes the pages of the site: `python tools/site_pages.py FOLDER`. Some are not in docs/, but elsewhere or generated.

A link in a Markdown file leads to the file in the repository; here it becomes a link to its page.
"""

from __future__ import annotations

import posixpath
import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

ELSEWHERE = {
    "index.md": "README.md",
    "speed.md": "tools/bench/README.md",
    "security.md": "SECURITY.md",
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
}
"""Pages whose source is not in docs/."""

PAGES = {source: page for page, source in ELSEWHERE.items()}
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=[)#])")
"""The file that a link leads to, without its anchor."""


def write(folder: Path) -> None:
    """Write all pages and their pictures into a folder, in place of its content."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "docs", folder)
    for page, source in ELSEWHERE.items():
        shutil.copy(ROOT / source, folder / page)
    for file in folder.rglob("*.md"):
        text = file.read_text(encoding="utf-8")
        file.write_text(with_page_links(text, file.relative_to(folder).as_posix()), encoding="utf-8")


def with_page_links(markdown: str, name: str) -> str:
    """Return a page whose links lead to pages."""
    folder = posixpath.dirname(ELSEWHERE.get(name, f"docs/{name}"))

    def lead(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, link[1]))
        page = PAGES.get(target, posixpath.relpath(target, "docs"))
        return posixpath.relpath(page, posixpath.dirname(name) or ".")

    return LINK.sub(lead, markdown)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
