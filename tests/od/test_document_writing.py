"""Single lines of a file are changed, and all the others stay."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from eurobot_od.od.document import Document, Rewriting, parse

TEXT = """; a comment

[A]
Key = 1 ; one
key=2
; the end of A

[B]
Other=2
"""


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda r, d: r.set(d.sections["a"], "Key", 5), TEXT.replace("Key = 1 ; one", "Key=5")),
        (lambda r, d: r.set(d.sections["a"], "New", 5), TEXT.replace("end of A\n", "end of A\nNew=5\n")),
        (lambda r, d: r.set(d.sections["b"], "New", 5), TEXT + "New=5\n"),
        (lambda r, d: r.unset(d.sections["a"], "Key"), TEXT.replace("Key = 1 ; one\n", "")),
        (lambda r, d: r.unset(d.sections["a"], "Nothing"), TEXT),
        (lambda r, d: r.drop(d.sections["a"]), "; a comment\n\n[B]\nOther=2\n"),
        (lambda r, d: r.drop(d.sections["b"]), TEXT[: TEXT.index("\n[B]")]),
    ],
)
def test_only_what_is_asked_for_changes(change: Callable[[Rewriting, Document], None], expected: str) -> None:
    document = parse(TEXT)
    rewriting = Rewriting(document)
    change(rewriting, document)
    assert rewriting.text() == expected


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_lines_end_in_lf(end: str) -> None:
    assert Rewriting(parse(TEXT.replace("\n", end))).text() == TEXT


def test_a_section_is_added_at_the_end() -> None:
    rewriting = Rewriting(parse(TEXT))
    rewriting.append("C", {"Key": 3})
    assert rewriting.text() == TEXT + "\n[C]\nKey=3\n"
