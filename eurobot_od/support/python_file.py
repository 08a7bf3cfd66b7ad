"""A Python file of somebody's, run as a module: a strategy, or a robot.

Rule of this file: whatever is wrong with the file is one line that names the place in it.
"""

from __future__ import annotations

import inspect
import sys
import traceback
from contextlib import redirect_stdout
from pathlib import Path
from types import ModuleType

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
    except (Exception, SystemExit) as error:
        raise LocalError(_complaint(file, error)) from None
    return module


def _complaint(file: Path, error: BaseException) -> str:
    """Say on one line what a file raised, and where in it."""
    what = f"{type(error).__name__}: {' '.join(str(error).split())}"
    if isinstance(error, SyntaxError):
        return f"{error.filename or file}:{error.lineno or 1}: {type(error).__name__}: {error.msg}"
    raised = [(Path(frame.f_code.co_filename), line) for frame, line in traceback.walk_tb(error.__traceback__)]
    # The last place in a file of theirs: further in, the traceback goes through libraries that are not to blame.
    beside = [(path, line) for path, line in raised if path.resolve().parent == file.resolve().parent]
    path, line = beside[-1] if beside else (file, 1)
    return f"{file.parent / path.name}:{line}: {what}"


def place_of(thing: type) -> str:
    """Return `file:line` of a class, or the name of its module if that is not to be found."""
    try:
        return f"{inspect.getsourcefile(thing)}:{inspect.getsourcelines(thing)[1]}"
    except (OSError, TypeError):
        return thing.__module__
