"""The tolerant reader keeps places, and turns everything that is not an EDS into an oddity."""

from __future__ import annotations

import pytest

from eurobot_od.od.document import Entry, Odd, read
from eurobot_od.od.normal import in_normal_form
from tests.eds_text import DEVICE_TYPE

PLACES = [
    # (text, key, value, line, column): columns count bytes from 1 and point at the value
    (b"[A]\nKey=1\n", "key", "1", 2, 5),
    (b"[A]\r\nKey=1\r\n", "key", "1", 2, 5),  # CR LF
    (b"[A]\rKey=1\r", "key", "1", 2, 5),  # CR alone
    (b"\xef\xbb\xbf[A]\nKey=1", "key", "1", 2, 5),  # byte order mark, no line end at the end
    (b"[A]\nKey = 1 \n", "key", "1", 2, 7),  # blanks around
    (b"[A]\n\tKEY=1\n", "key", "1", 2, 6),  # a tab before, another case
    (b"[A]\n;Key=0\nKey=1 ; one\n", "key", "1", 3, 5),  # comments
    (b"[A]\nKey=a;b\n", "key", "a;b", 2, 5),  # a semicolon inside a word is not a comment
    (b"[A]\nKey=a=b\n", "key", "a=b", 2, 5),  # only the first = separates
    (b"[A]\nKey=\n", "key", "", 2, 5),
    (b"[ a ]\nKey=1\n", "key", "1", 2, 5),
    (b"[A]\nKey=1\nkey=2\n", "key", "1", 2, 5),  # the first counts
    (b"[A]\nKey=1\n[a]\nKey=2\n", "key", "1", 2, 5),
    ("[A]\nKey=1\n".encode("utf-16"), "key", "1", 2, 5),
    (b"[A]\nK\xe4y=\xfc\n", "k\xe4y", "\xfc", 2, 5),  # Latin-1
]


@pytest.mark.parametrize(("text", "key", "value", "line", "column"), PLACES)
def test_an_entry_knows_its_place(text: bytes, key: str, value: str, line: int, column: int) -> None:
    entry = read(text).sections["a"].entries[key]
    assert entry[1:] == (value, line, column)


ODDITIES = [
    (b"[A]\nwords\n", [Odd.NOT_AN_ENTRY]),
    (b"[A\n", [Odd.HEADER]),
    (b"[]\n", [Odd.HEADER]),
    (b"[A] words\n", [Odd.HEADER]),
    (b"[A] ; words\n", []),  # a comment may follow
    (b"Key=1\n", [Odd.NO_SECTION]),
    (b"[A]\n=1\n", [Odd.NO_KEY]),
    (b"[A]\n#Key=1\n", [Odd.HASH]),
    (b"[A]\n Key=1\n", [Odd.INDENTED]),
    (b"[A]\nK\0ey=1\n", [Odd.BINARY]),
    (b"[A]\nKey=1\n\x1a", [Odd.END_MARK]),
    (b"[A]\nKey=1\0\0\n", [Odd.END_MARK]),
    (b"[A]\r\nKey=1\n", [Odd.LINE_ENDS]),
    (b"", []),
    (b"\n\n;\n  \n", []),
]


@pytest.mark.parametrize(("text", "kinds"), ODDITIES)
def test_a_file_that_is_no_eds_is_an_oddity(text: bytes, kinds: list[Odd]) -> None:
    assert [each.kind for each in read(text).oddities] == kinds


def test_a_missing_key_points_at_its_section() -> None:
    section = read(b"\n[A]\n").sections["a"]
    assert (section.at("key").line, section.text("key")) == (2, "")
    assert not isinstance(section.at("key"), Entry)


# Code pages

NAMES = {
    "cp1251": "Скорость профиля",
    "koi8-r": "Скорость профиля",
    "cp932": "速度設定モード",
    "gb2312": "目标速度",
    "latin-1": "Länge in µm",
    "cp1252": "Température – déjà",
}


@pytest.mark.parametrize(("encoding", "name"), NAMES.items())
def test_a_name_in_a_code_page_is_read_and_fixed_as_what_it_is(encoding: str, name: str) -> None:
    data = f"[FileInfo]\nFileName=a.eds\nCreatedBy={name}\n{DEVICE_TYPE}".encode(encoding)
    document = read(data)
    assert (document.encoding, document.text("fileinfo", "createdby")) == (encoding, name)
    assert f"CreatedBy={name}" in in_normal_form(data)[0].decode()


@pytest.mark.parametrize("text", ["СКОРОСТЬ".encode("cp1251"), "目標位置".encode("cp932"), bytes(range(0x80, 0x100))])
def test_a_text_that_no_code_page_fits_for_certain_keeps_its_bytes(text: bytes) -> None:
    fixed, _ = in_normal_form(b"[FileInfo]\nFileName=a.eds\nCreatedBy=" + text + b"\n" + DEVICE_TYPE.encode())
    assert b"CreatedBy=" + text in fixed
