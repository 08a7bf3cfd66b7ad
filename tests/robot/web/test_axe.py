"""The field, and logs of matches, as axe-core judges them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from eurobot_od import cli
from tests.cli.processes import command, line
from tests.robot.web.scene import live_page, robot
from tests.web import test_axe
from tests.web.browser import Page
from tests.web.scene import channel


@contextmanager
def our_robot(folder: Path) -> Iterator[str]:
    name = channel()
    with robot(name), live_page(name, folder) as served:
        yield served.address


@contextmanager
def two_logs(folder: Path) -> Iterator[str]:
    logs = [str(folder / f"match-{seed}.log") for seed in (1, 2)]
    for seed, log in enumerate(logs, 1):
        assert cli.main(["match", "--seed", str(seed), "--for", "6", "--log", log]) == 0
    with command("serve", "--listen", "127.0.0.1:0", *logs) as process:
        yield line(process, "http://").split()[0]


@test_axe.needs_axe
@pytest.mark.parametrize(("width", "height", "dark"), test_axe.SIZES)
@pytest.mark.parametrize("shown", [our_robot, two_logs])
def test_no_finding_in_any_view_and_none_is_wider_than_the_window(
    shown: Callable[[Path], AbstractContextManager[str]],
    tmp_path: Path,
    window: Page,
    width: int,
    height: int,
    dark: bool,
) -> None:
    check = test_axe.test_no_finding_in_any_view_and_none_is_wider_than_the_window
    check(shown, tmp_path, window, width, height, dark)
