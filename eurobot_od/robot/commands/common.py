"""What several of the robot's commands have: options for who plays, and the exit status of a match."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.robot.model.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.robot.match.summary import Summary
    from eurobot_od.robot.model.options import MatchOptions

COLOURS = [colour.name.lower() for colour in TeamColour]


def add_sides(parser: argparse.ArgumentParser) -> None:
    """Describe our colour, and who else is there."""
    parser.add_argument("--team", choices=COLOURS, default="red", help="our colour (default: red)")
    parser.add_argument("--enemies", type=int, choices=range(3), default=2, help="how many enemies (default: 2)")
    parser.add_argument("--confederates", type=int, choices=range(2), default=1, help="confederates (default: 1)")


def options_of(arguments: argparse.Namespace, settings: Iterable[tuple[str, str]]) -> MatchOptions:
    """Return who plays, the seed and the errors of the instruments; raises UnknownName, LocalError."""
    from eurobot_od.robot.model.options import Errors, MatchOptions

    return MatchOptions(
        TeamColour[arguments.team.upper()],
        arguments.enemies,
        arguments.confederates,
        seed=1 if arguments.seed is None else arguments.seed,
        dialect=arguments.dialect,
        errors=Errors().changed_by(shared.assignments("--world", "NAME=VALUE", arguments.world)),
        settings=tuple(settings),
        robot=arguments.robot,
    )


def status_of(summary: Summary) -> ExitStatus:
    """Return the exit status of a match; print the end of the traceback if the strategy raised."""
    if summary.failure is None:
        return ExitStatus.FINE
    sys.stdout.flush()  # the summary comes first: the traceback goes to the other stream
    print(summary.failure, file=sys.stderr)
    return ExitStatus.FOUND
