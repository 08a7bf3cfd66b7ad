"""What a step of a suite can do: each action is defined once, with its keys, how they are read, and what it does.

A module has the actions of one kind, each a value with `run`, and enters them into its table by their keys. A device
package enters its own in the same way (see `steps.SuiteAction`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from eurobot_od.check.actions import flow, frames, nodes, objects
from eurobot_od.check.actions.flow import Nmt
from eurobot_od.check.actions.frames import Never, Period, Poll, Send
from eurobot_od.check.actions.nodes import Dump, SelfReported
from eurobot_od.check.actions.objects import SdoRead, SdoRestore, SdoWrite
from eurobot_od.check.shapes import MakeRow

ACTIONS: Final[Mapping[str, MakeRow]] = {**frames.ACTIONS, **objects.ACTIONS, **nodes.ACTIONS, **flow.ACTIONS}
"""All actions by their keys."""

QUESTIONS = (Send, SdoRead, SdoWrite, SdoRestore, Dump, SelfReported, Poll)
"""Actions that an answer of before would be taken for an answer to."""

LOOKS = (*QUESTIONS, Nmt, Never, Period)
"""Actions that a frame which comes late would be taken for an answer to, or for one that may not come."""
