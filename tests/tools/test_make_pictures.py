"""The documentation's pictures: the same each time, good SVG without anything from elsewhere."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import make_pictures
import pytest

NAMES = ["decode.txt", "field.svg", "match.svg", "monitor.svg"]


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folders = tmp_path_factory.mktemp("one"), tmp_path_factory.mktemp("other")
    for folder in folders:
        assert make_pictures.main(["--folder", str(folder)]) == 0
    return folders


@pytest.mark.parametrize("name", NAMES)
def test_the_same_match_gives_the_same_bytes(twice: tuple[Path, Path], name: str) -> None:
    one, other = twice
    assert (one / name).read_bytes() == (other / name).read_bytes()
    assert sorted(each.name for each in one.iterdir()) == NAMES


@pytest.mark.parametrize("name", NAMES[1:])
def test_pictures_are_good_svg_and_load_nothing(twice: tuple[Path, Path], name: str) -> None:
    text = (twice[0] / name).read_text(encoding="utf-8")
    assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    assert "https://" not in text


def test_the_lines_are_those_of_a_match(twice: tuple[Path, Path]) -> None:
    lines = (twice[0] / "decode.txt").read_text(encoding="utf-8").splitlines()
    assert len(lines) == make_pictures.LINES
    assert any("Goto XY" in line for line in lines)


def test_no_text_of_the_field_is_too_small_for_a_page(twice: tuple[Path, Path]) -> None:
    text = (twice[0] / "field.svg").read_text(encoding="utf-8")
    _, _, width, _ = map(float, re.findall(r'viewBox="([^"]*)"', text)[0].split())
    sizes = [float(each) for each in re.findall(r'font-size="(\d+)"', text)]
    assert min(sizes) * 830 / width >= 11
