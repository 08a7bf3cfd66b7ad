"""A request of the page: its text is read apart from what it asks for."""

from __future__ import annotations

import asyncio
import json
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.bus.live import open_bus
from eurobot_od.errors import LocalError
from eurobot_od.web import requests
from eurobot_od.web.asking import Arguments, PageRequest, Way, answered, read_request
from eurobot_od.web.desk import Desk
from eurobot_od.web.requests import Requests
from eurobot_od.web.session import Session
from tests.kit import plant
from tests.web.scene import channel

WRONG = {
    "no JSON": ("{", "a request is JSON"),
    "brackets without end": ("[" * 100_000, "a request is JSON"),
    "no object": ("[1]", "a request is a JSON object"),
}


@pytest.mark.parametrize(("text", "error"), WRONG.values(), ids=WRONG)
def test_a_wrong_request_is_one_line(text: str, error: str) -> None:
    with pytest.raises(LocalError, match=f"^{error}$"):
        read_request(text)
    assert json.loads(answered(text, dict)) == {"error": error}


def broken(*_: Arguments) -> Any:
    raise ValueError("a mistake in the program")


def test_a_mistake_in_the_program_is_not_taken_for_wrong_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, "REQUESTS", {"break": PageRequest(broken, Way.AT_ONCE)})
    text = '{"do": "break"}'
    with pytest.raises(ValueError, match="a mistake in the program"):
        answered(text, broken)
    with closing(Session(partial(open_bus, "virtual", channel()), plant.decoder(), 500_000)) as session:
        answering = Requests(Desk(session, tmp_path, control=True)).answer(text)
        with pytest.raises(ValueError, match="a mistake in the program"):
            asyncio.run(answering)
