"""The robot on an in-process bus, and the page of it with the field."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.robot import dialects
from eurobot_od.robot.match.stage import stores
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.protocol import decoder
from eurobot_od.robot.scene.panel import FieldPanel
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import assemble
from tests.web import scene
from tests.web.scene import LONG, Served

SETTINGS = (("core.Position polling.Start delay", "0"), ("core.Position polling.Polling period", "200"))
"""So that a test need not wait for places."""


def live_page(channel: str, folder: Path, **options: Any) -> AbstractContextManager[Served]:
    """Serve the page of an in-process bus with the robot's messages and its field, if the options say no other ones."""
    return scene.live_page(channel, folder, **{"network": decoder(), "panels": (FieldPanel,), **options})


@contextmanager
def robot(channel: str) -> Iterator[tuple[Core, World]]:
    """Run our robot's three nodes on a bus, configured for a match it plays alone; gives the core and the world."""
    files = {each.name: each for each in dialects.load_all()}
    kept = stores(SETTINGS, files)
    kinds: dict[str, type[Node]] = {"core": Core, "drive": Drive, "navigation": Navigation}
    nodes = [kind(files[name], store=kept[name]) for name, kind in kinds.items()]
    world = assemble(nodes, MatchOptions(enemies=0, confederates=0, falling=False), time.perf_counter)
    with ExitStack() as stack:
        for node in reversed(nodes):
            stack.enter_context(Live.node(open_bus("virtual", channel), node))
        core = nodes[0]
        assert isinstance(core, Core)
        core.check_nodes().result(LONG)
        core.configure_start(TeamColour.RED).result(LONG)
        yield core, world
