"""Annotations keep to one line, whatever a file says."""

from __future__ import annotations

import pytest

from eurobot_od.support.annotations import Level, annotation

CASES = [
    # (file, title, lines of the message, what is printed)
    ("a.eds", "E308", ["plain"], "::error file=a.eds,line=3,col=7,title=E308::plain"),
    ("a.eds", "E308", ["one", "two: 100 %"], "::error file=a.eds,line=3,col=7,title=E308::one%0Atwo: 100 %25"),
    ("C:\\a,b.eds", "a: b", ["x"], "::error file=C%3A\\a%2Cb.eds,line=3,col=7,title=a%3A b::x"),
    ("a\n::error::b", "\x1b", ["x\r\ny"], "::error file=a\\n%3A%3Aerror%3A%3Ab,line=3,col=7,title=\\x1b::x\\r\\ny"),
]


@pytest.mark.parametrize(("file", "title", "lines", "printed"), CASES)
def test_an_annotation_is_one_line(file: str, title: str, lines: list[str], printed: str) -> None:
    assert annotation(Level.ERROR, file, 3, 7, title, lines) == printed
