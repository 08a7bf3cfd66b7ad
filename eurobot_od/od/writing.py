"""Changes single lines of an EDS or DCF and keeps all the others as they are: comments, order, letter case.

Rule of this file: only a line about a value that changes is written anew; lines end in LF.
"""

from __future__ import annotations

from bisect import bisect_right

from eurobot_od.od.document import Document, Section


class Rewriting:
    """A document's text with entries set or left out and sections dropped; `text` gives it when all is done."""

    def __init__(self, document: Document) -> None:
        self._lines: list[str | None] = list(document.lines)
        if self._lines[-1:] == [""]:
            del self._lines[-1]  # what follows the last line end is not a line
        self._headers = [*document.headers, len(self._lines) + 1]
        self._added: dict[int, list[str]] = {}  # new lines by the number of the line they follow

    def set(self, section: Section, key: str, value: object) -> None:
        """Give a key its value: in its line if it has one, else in a new line after the section's last."""
        line, entry = f"{key}={value}", section.entries.get(key.lower())
        if entry:
            self._lines[entry.line - 1] = line
        else:
            numbers = range(self._next_header(section) - 1, section.line, -1)
            # Before the empty lines at a section's end, which belong to the next one for a reader.
            last = next((each for each in numbers if (self._lines[each - 1] or "").strip()), section.line)
            self._added.setdefault(last, []).append(line)

    def unset(self, section: Section, key: str) -> None:
        """Leave a key's line out."""
        entry = section.entries.get(key.lower())
        if entry:  # the place is kept, so that the numbers of all other lines stay right
            self._lines[entry.line - 1] = None

    def drop(self, section: Section) -> None:
        """Leave a section out."""
        end = self._next_header(section) - 1
        self._lines[section.line - 1 : end] = [None] * (end - section.line + 1)

    def append(self, name: str, entries: dict[str, object]) -> None:
        """Put a new section at the end."""
        self._lines += [f"[{name}]", *(f"{key}={value}" for key, value in entries.items())]

    def text(self) -> str:
        """Return the whole text, an empty line before each section."""
        lines: list[str] = []
        for number, line in enumerate(self._lines, start=1):
            if line is not None and line.startswith("[") and lines and lines[-1].strip():
                lines.append("")
            if line is not None:
                lines.append(line)
            lines += self._added.get(number, ())
        return "\n".join([*lines, ""] if lines and lines[-1] else lines)

    def _next_header(self, section: Section) -> int:
        return self._headers[bisect_right(self._headers, section.line)]
