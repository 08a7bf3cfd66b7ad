"""Layouts that are kept by name in the folder of the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.web.scene import channel, live_page
from tests.web.test_server import answer, talk

LAYOUT = {"address": "#trace?identifier=180", "kept": {"columns": ["count"]}}


async def kept(opened: Any, **words: Any) -> Any:
    return await answer(opened, json.dumps({"id": 1, **words}))


def test_a_layout_is_there_for_the_next_server(tmp_path: Path) -> None:
    with live_page(channel(), tmp_path) as served:
        talk(served, lambda opened: kept(opened, do="keep layout", name="tracing", layout=LAYOUT))
    with live_page(channel(), tmp_path) as served:
        assert talk(served, lambda opened: kept(opened, do="layouts"))["ok"] == {"tracing": LAYOUT}
        talk(served, lambda opened: kept(opened, do="remove layout", name="tracing"))
        assert talk(served, lambda opened: kept(opened, do="layouts"))["ok"] == {}


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"name": "", "layout": LAYOUT}, "a layout has a name of 1 to 60 characters"),
        ({"name": "a\nb", "layout": LAYOUT}, "a layout has a name of 1 to 60 characters"),
        ({"name": "a"}, "layout is missing"),
    ],
)
def test_what_is_no_layout_is_refused_in_a_line(tmp_path: Path, words: dict[str, Any], error: str) -> None:
    with live_page(channel(), tmp_path) as served:
        assert talk(served, lambda opened: kept(opened, do="keep layout", **words))["error"] == error
    assert not (tmp_path / "layouts.json").exists()


def test_damaged_layouts_are_said(tmp_path: Path) -> None:
    (tmp_path / "layouts.json").write_text("{")
    with live_page(channel(), tmp_path) as served:
        assert "layouts.json: not JSON" in talk(served, lambda opened: kept(opened, do="layouts"))["error"]
