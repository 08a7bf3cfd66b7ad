"""Loads a team's strategy from its file."""

from __future__ import annotations

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from inspect import iscoroutinefunction
from pathlib import Path

from eurobot_od.errors import LocalError
from eurobot_od.robot.match.referee import Strategy


def load(path: Path) -> Strategy:
    """Return the coroutine `play` of a Python file; raises OSError, and LocalError for a file that has none."""
    loader = SourceFileLoader(path.stem, str(path))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    try:
        loader.exec_module(module)
    except OSError:
        raise
    except Exception as error:
        raise LocalError(f"{path}: {type(error).__name__}: {error}") from error
    play = getattr(module, "play", None)
    if not iscoroutinefunction(play):
        raise LocalError(f"{path}: has no coroutine play(core)")
    strategy: Strategy = play
    return strategy
