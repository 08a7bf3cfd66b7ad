"""The documentation's pictures: what the tool makes today, good SVG without anything from elsewhere."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import make_pictures
import pytest

pytestmark = pytest.mark.long

NAMES = ["field.svg", "match.svg", "monitor.svg", "red-step.svg"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    assert make_pictures.main(["--folder", str(folder)]) == 0
    assert sorted(each.name for each in folder.iterdir()) == NAMES
    return folder


@pytest.mark.parametrize("name", NAMES[:2])  # that of the monitor changes with rich, too
def test_the_documentation_has_what_the_tool_makes(made: Path, name: str) -> None:
    assert (made / name).read_bytes() == (make_pictures.DOCS / name).read_bytes(), "run tools/make_pictures.py"


@pytest.mark.parametrize("name", NAMES)
def test_pictures_are_good_svg_and_load_nothing(made: Path, name: str) -> None:
    text = (made / name).read_text(encoding="utf-8")
    assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    assert "https://" not in text


def test_no_text_of_the_field_is_too_small_for_a_page(made: Path) -> None:
    text = (made / "field.svg").read_text(encoding="utf-8")
    _, _, width, _ = map(float, re.findall(r'viewBox="([^"]*)"', text)[0].split())
    sizes = [float(each) for each in re.findall(r'font-size="(\d+)"', text)]
    assert min(sizes) * 830 / width >= 11
