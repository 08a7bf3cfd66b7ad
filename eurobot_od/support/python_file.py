"""A Python file of somebody's, run as a module: a strategy, or a robot.

Whatever is wrong with the file is one line that names the place in it.
"""

from __future__ import annotations

import inspect
import sys
import traceback
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path
from types import FrameType, ModuleType

from eurobot_od.errors import LocalError


def load(file: Path) -> ModuleType:
    """Run a file as a module of its own, which may import what stands beside it.

    What the file prints while it is loaded goes to standard error. Raises LocalError, with the line of the file, if it
    cannot be read, is not Python, or raises.
    """
    module = ModuleType(f"file {file.resolve()}")
    module.__file__ = str(file)
    try:
        source = file.read_bytes()
    except OSError as error:
        raise LocalError(f"{file}: {error.strerror}") from None
    folder = str(file.resolve().parent)
    if folder not in sys.path:  # last, so that a `random.py` beside it cannot take the place of Python's own
        sys.path.append(folder)
    sys.modules[module.__name__] = module  # where dataclasses look for the module that they are in
    try:
        with redirect_stdout(sys.stderr):  # standard output may be a document, such as --json
            exec(compile(source, str(file), "exec", dont_inherit=True), module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit, and what `pytest.skip` raises, too
        raise LocalError(complaint(error, f"{file}:1", partial(_stands_in, folder))) from None
    return module


def _stands_in(folder: str, frame: FrameType) -> bool:
    name = frame.f_code.co_filename  # of generated code it is `<...>`
    return not name.startswith("<") and Path(name).resolve().parent == Path(folder)


def complaint(error: BaseException, otherwise: str, is_theirs: Callable[[FrameType], bool]) -> str:
    """Say on one line what somebody's code raised, and in which line of theirs; `otherwise` stands for none."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno or 1}: {type(error).__name__}: {error.msg}"
    raised = [(frame.f_code.co_filename, n) for frame, n in traceback.walk_tb(error.__traceback__) if is_theirs(frame)]
    # The last place of theirs: further in, the traceback goes through libraries that are not to blame.
    where = "{}:{}".format(*raised[-1]) if raised else otherwise
    return f"{where}: {type(error).__name__}: {' '.join(str(error).split())}"


def place_of(thing: type) -> str:
    """Return `file:line` of a class, or the name of its module if that is not to be found."""
    try:
        return f"{inspect.getsourcefile(thing)}:{inspect.getsourcelines(thing)[1]}"
    except (OSError, TypeError):
        return thing.__module__
