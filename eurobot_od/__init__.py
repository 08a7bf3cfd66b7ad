"""A CANopen workbench for any device, and the Eurobot 2014 robot's CAN protocol as CANopen object dictionaries.

    from eurobot_od import Network

    with Network.open("socketcan", "can0") as network:
        drive = network.add(5, "drive.eds")
        drive["Profile velocity"].value = 1500

`help(Network)` shows more; docs/api.md lists the stable names. Public names are loaded on first use, so that a command
without a bus starts at once; `__init__.pyi` lists them.
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from typing import Any

from eurobot_od.canopen_names import ModulesOfCanopen, module_attribute

sys.meta_path.append(ModulesOfCanopen)

with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _lines:  # noqa: PTH123 (pathlib takes longer than this)
    _HOMES = {name: home for home, name in re.findall(r"^from (\S+) import .* as (\w+)$", _lines.read(), re.MULTILINE)}

_EXTRAS = {"Season": "season"}
"""Names that need an extra, so `import *` skips them."""


def __dir__() -> list[str]:
    """Return the public names, including those that are not loaded yet."""
    return sorted({*globals(), *_HOMES})


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name == "__all__":
        return [each for each in _HOMES if each not in _EXTRAS]
    if name not in _HOMES:
        module_attribute(__name__)(name)
    if name in _EXTRAS:
        from eurobot_od.support.extras import needed

        with needed(_EXTRAS[name]):
            import_module(_HOMES[name])
    home = import_module(_HOMES[name])
    # If the name is a module, its package may not have imported it.
    found = getattr(home, name) if hasattr(home, name) else import_module(f"{_HOMES[name]}.{name}")
    return globals().setdefault(name, found)
