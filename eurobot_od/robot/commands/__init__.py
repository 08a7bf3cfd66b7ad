"""The robot's commands, with what they share: the options for the teams, and the exit status of a match."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, TypeAlias

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.options import assigned
from eurobot_od.cli.signature import Option
from eurobot_od.robot.model.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.robot.match.summary import Summary

WorldErrors: TypeAlias = Annotated[Sequence[tuple[str, str]], Option("--world"), assigned("NAME=VALUE")]


@dataclass(frozen=True, kw_only=True)
class Sides:
    """Our colour, and the other robots.

    team: our colour (default: red)
    enemies: how many enemies (default: 2)
    confederates: confederates (default: 1)
    """

    team: TeamColour = TeamColour.RED
    enemies: Annotated[int, Option(choices=range(3))] = 2
    confederates: Annotated[int, Option(choices=range(2))] = 1


def status_of(summary: Summary) -> ExitStatus:
    """Return the exit status of a match; print the end of the traceback if the strategy raised."""
    if summary.failure is None:
        return ExitStatus.FINE
    sys.stdout.flush()  # so that the summary comes before the traceback, which goes to the other stream
    print(summary.failure, file=sys.stderr)
    return ExitStatus.FOUND
