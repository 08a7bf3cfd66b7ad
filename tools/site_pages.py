"""What MkDocs asks while it builds the site: pages that are elsewhere in the repository, or made from the EDS files.

A link in a Markdown file leads to the file in the repository; here it becomes a link to its page.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from eurobot_od.export.forms import docs_text
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol

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
"""Where a link to a file leads, without its anchor."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are not in docs/."""
    for page, source in ELSEWHERE.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text(encoding="utf-8")))
    described = docs_text(EurobotProtocol.load(), dialects.load_all(), "markdown")
    text = described.replace("\n", "\n\nMade from the EDS files by `eurobot-od export docs`.\n", 1)
    files.append(File.generated(config, "messages.md", content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Lead links to pages."""
    name = page.file.src_uri
    folder = posixpath.dirname(ELSEWHERE.get(name, f"docs/{name}"))

    def lead(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, link[1]))
        return PAGES.get(target, posixpath.relpath(target, "docs"))

    return LINK.sub(lead, markdown)
