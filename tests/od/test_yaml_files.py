"""A maker's words for emergency error codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import FileError, YamlError
from eurobot_od.od.yaml_files import read_error_words
from tests.rows import rows


def read(folder: Path, text: str) -> dict[int, str]:
    file = folder / "maker.yaml"
    file.write_text(text)
    return read_error_words(file)


def test_codes_classes_and_ranges(tmp_path: Path) -> None:
    words = read(
        tmp_path, "0x73xx: sensor\n0x7310: 'speed: too high'\n0xFF01..0xFF03: axis\n0xff02: Achse übersteuert\n"
    )
    assert [words[code] for code in (0x7300, 0x7310, 0x73FF)] == ["sensor", "speed: too high", "sensor"]
    assert [words.get(code) for code in range(0xFF00, 0xFF05)] == [None, "axis", "Achse übersteuert", "axis", None]


def test_the_narrowest_entry_counts_in_any_order(tmp_path: Path) -> None:
    words = read(tmp_path, "0x7310: one\n0x731x: ten\n0x73xx: all\n")
    assert [words[code] for code in (0x7310, 0x7311, 0x7320)] == ["one", "ten", "all"]


@rows(
    "text, what",
    [
        ("0x7310: speed\nspeed: fast\n", "2:1: 'speed' is not an error code: write 0x7310, 0x73xx or 0x7380..0x738F"),
        ("0x12345: long\n", "1:1: '0x12345' is not an error code"),
        ("0xxxxx: any\n", "1:1: '0xxxxx' is not an error code"),
        ("0x7320..0x7310: turned round\n", "1:1: '0x7320..0x7310' is not an error code"),
        ("0x73xx..0x74FF: mixed\n", "1:1: '0x73xx..0x74FF' is not an error code"),
        ("7310: decimal\n", "1:1: '7310' is not an error code"),
        ("0x7310: 5\n", "1:9: expected a text, found '5', which needs quotes to be one"),
        ("0x7310: a\n0x7310: b\n", "2:1: key '0x7310' is given twice"),
        ("- 0x7310\n", "1:1: expected a mapping"),
        ("", "1:1: the file is empty"),
    ],
)
def test_what_a_file_says_wrong_is_one_line_with_its_place(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(YamlError) as error:
        read(tmp_path, text)
    assert str(error.value).startswith(f"{tmp_path / 'maker.yaml'}:{what}")
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"nothing\.yaml"):
        read_error_words(tmp_path / "nothing.yaml")
