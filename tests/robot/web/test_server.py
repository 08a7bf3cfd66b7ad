"""The page of the robot sends a goto only when a core would, and stops it twice."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.robot import dialects
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import ROLES, Core
from tests.robot.web.scene import live_page
from tests.web.scene import LONG, channel
from tests.web.test_server import answer, talk

GO = {"do": "send", "message": "Goto XY", "fields": {"x": "600", "y": "1700", "angle": "0", "speed": "50"}}


def present(roles: dict[str, str], configured: bool) -> Callable[[ExitStack, str], None]:
    """Return what puts nodes on a bus, each with its dialect."""

    def enter(stack: ExitStack, name: str) -> None:
        for role, dialect in roles.items():
            stack.enter_context(Live.node(open_bus("virtual", name), ROLES[role](dialects.load(role, dialect))))
        if configured:
            core = Core(dialects.load("core"))
            with Live.node(open_bus("virtual", name), core):
                core.configure_start(TeamColour.RED).result(LONG)

    return enter


BOTH = {"drive": "canopen", "navigation": "canopen"}

STARTS = [
    # (who is there, what the page says)
    (present({"navigation": "canopen"}, False), "no goto: the drive does not answer its check"),
    (present({"drive": "canopen"}, False), "no goto: the navigation does not answer its check"),
    (
        present(BOTH | {"drive": "firmware2014"}, False),
        "no goto: the drive speaks another dialect than the page's EDS files",
    ),
    (
        present(BOTH | {"navigation": "firmware2014"}, False),
        "no goto: the navigation speaks another dialect than the page's EDS files",
    ),
    (present(BOTH, False), "no goto: the drive's place is unknown; send Start Configuration Set first"),
    (present(BOTH, True), None),
]


@pytest.mark.parametrize(("enter", "objection"), STARTS)
def test_the_page_sends_a_goto_only_when_a_core_would(
    tmp_path: Path, enter: Callable[[ExitStack, str], None], objection: str | None
) -> None:
    name = channel()
    with ExitStack() as stack:
        enter(stack, name)
        served = stack.enter_context(live_page(name, tmp_path))
        other = stack.enter_context(open_bus("virtual", name))
        said = talk(served, lambda opened: answer(opened, json.dumps({"id": 1, **GO})))
        gotos = [each for each in iter(lambda: other.recv(0.1), None) if each.arbitration_id == 0x008]
    assert said.get("error") == objection
    assert len(gotos) == (objection is None)


def test_with_a_core_there_the_page_has_it_send_the_goto(tmp_path: Path) -> None:
    name = channel()
    with ExitStack() as stack:
        present(BOTH, configured=False)(stack, name)
        core = Core(dialects.load("core"))
        stack.enter_context(Live.node(open_bus("virtual", name), core))
        served = stack.enter_context(live_page(name, tmp_path))
        other = stack.enter_context(open_bus("virtual", name))
        core.check_nodes().result(LONG)
        core.configure_start(TeamColour.RED).result(LONG)
        read = {"id": 1, "do": "read", "node": "core", "object": "0x1000"}  # from then on the page has heard the core
        talk(served, lambda opened: answer(opened, json.dumps(read)))
        said = talk(served, lambda opened: answer(opened, json.dumps({"id": 2, **GO})))
        heard = [each.arbitration_id for _ in range(50) if (each := other.recv(LONG))]
        assert core.is_commanding
        assert said["ok"].endswith(" by the core")
        assert heard.count(0x008) == 1
        core.stop().result(LONG)


def test_stop_is_sent_again_when_who_leads_is_held(tmp_path: Path) -> None:
    """What the core had in its mailbox when it heard of the stop leaves after the first one."""
    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path) as served:
        talk(served, lambda opened: answer(opened, json.dumps({"id": 1, "do": "stop"})))
        heard = [message for _ in range(3) if (message := other.recv(LONG))]
    assert [(each.arbitration_id, bytes(each.data)) for each in heard] == [(4, b""), (0, b"\x80\1"), (4, b"")]
