"""The actions of steps: each is defined once, with its keys, how they are read, and what it does.

Each module has the actions of one kind, each a value with `run`, and a table of them by key. A device package adds its
actions in the same way (see `steps.SuiteAction`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from eurobot_od.check.actions import frames, nodes, objects
from eurobot_od.check.actions.frames import Never, Period, Poll, Send
from eurobot_od.check.actions.nodes import Dump, Nmt, SelfReported
from eurobot_od.check.actions.objects import SdoRead, SdoRestore, SdoWrite
from eurobot_od.check.shapes import MakeRow

ACTIONS: Final[Mapping[str, MakeRow]] = {**frames.ACTIONS, **objects.ACTIONS, **nodes.ACTIONS}
"""All actions by key."""

QUESTIONS = (Send, SdoRead, SdoWrite, SdoRestore, Dump, SelfReported, Poll)
"""Actions for which an earlier answer would be taken for theirs."""

LOOKS = (*QUESTIONS, Nmt, Never, Period)
"""Actions for which a late frame would be taken for an answer, or for a forbidden frame."""
