"""The page as one HTML file: nothing is loaded from elsewhere, and only our own scripts run in it.

Rule of this file: whatever comes from files and buses gets into the page only as JSON without any `<`; a content
security policy names the scripts and styles by their hashes.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from eurobot_od.web.content import panels_described
from eurobot_od.web.panel import Panel

FILES = Path(__file__).with_name("files")
STYLES = ("uplot.css", "page.css")
SCRIPTS = ("uplot.js", "page.js", "drive.js")  # in this order: each uses the ones before it

PART = re.compile(r"\{\{(\w+)\}\}")
"""A place in `page.html` to be filled in."""

POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
"""The place where a page says what may be loaded and run in it."""

NOTHING = "default-src 'none'; base-uri 'none'; form-action 'none'"
"""The policy of a page in which nothing may be loaded or run."""


def page(
    title: str, sources: Sequence[Mapping[str, Any]], panels: Sequence[type[Panel]] = (), **settings: object
) -> str:
    """Return the page that shows some sources; `settings` are for its script."""
    styles = [*(_read(FILES / name) for name in STYLES), *(panel.style for panel in panels)]
    scripts = [*(_read(FILES / name) for name in SCRIPTS), *(panel.script for panel in panels)]
    content = {"title": title, "sources": sources, "panels": panels_described(panels), **settings}
    # By hashes: with 'unsafe-inline', anything that slipped into the page could run as well.
    allowed = f"script-src {_hashes(scripts)}; style-src {_hashes(styles)}; img-src data: blob:; connect-src 'self'"
    parts = {
        "policy": f"{NOTHING}; {allowed}",
        "title": escape(title),
        "icon": base64.b64encode((FILES / "icon.svg").read_bytes()).decode(),
        "styles": "\n".join(f"<style>{each}</style>" for each in styles),
        "scripts": "\n".join(f"<script>{each}</script>" for each in scripts),
        # Without `<`, no text from a file or a bus can end the script element that it is in.
        "content": json.dumps(content, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c"),
    }
    # In one pass: a content with `{{title}}` in it stays as it is.
    return PART.sub(lambda found: parts[found[1]], _read(FILES / "page.html"))


def policy_of(text: str) -> str:
    """Return a page's own content security policy, for the server to send with it."""
    found = POLICY.search(text)
    return found[1] if found else NOTHING


def _read(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def _hashes(texts: Iterable[str]) -> str:
    digests = (base64.b64encode(hashlib.sha256(each.encode()).digest()).decode() for each in texts)
    return " ".join(f"'sha256-{each}'" for each in digests)
