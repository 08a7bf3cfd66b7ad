"""A CANopen workbench for any device, and the Eurobot 2014 robot's CAN protocol as CANopen object dictionaries.

    from eurobot_od import Network

    with Network.open("socketcan", "can0") as network:
        drive = network.add(5, "drive.eds")
        drive["Profile velocity"].value = 1500

`help(Network)` shows what else there is; docs/api.md says what stays as it is. The public names are loaded when they
are asked for, so that a command that needs no bus starts at once: `__init__.pyi` lists them.
"""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _lines:  # noqa: PTH123 (pathlib takes longer than this)
    _HOMES = {name: home for home, name in re.findall(r"^from (\S+) import .* as (\w+)$", _lines.read(), re.MULTILINE)}

_EXTRAS = {"Season": "season"}
"""Names that need an extra: `import *` leaves them out."""


def __dir__() -> list[str]:
    """List the public names, also those that are not loaded yet."""
    return sorted({*globals(), *_HOMES})


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use."""
    if name == "__all__":
        return [each for each in _HOMES if each not in _EXTRAS]
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _EXTRAS:
        from eurobot_od.support.extras import needed

        with needed(_EXTRAS[name]):
            import_module(_HOMES[name])
    home = import_module(_HOMES[name])
    # A module has its own name: `eurobot_od.robot.model` need not have imported it.
    found = getattr(home, name) if hasattr(home, name) else import_module(f"{_HOMES[name]}.{name}")
    return globals().setdefault(name, found)
