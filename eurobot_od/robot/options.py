"""What a match is played with."""

from __future__ import annotations

from dataclasses import dataclass

from eurobot_od.robot.values import TeamColour

ENEMY_DIAMETER = 30
"""Diameter of the simulated enemies, cm."""


@dataclass(frozen=True)
class MatchOptions:
    """A match: our colour, who else is there, the seed of all chance, and times in seconds.

    `emergency_at` is the match time at which the mushroom is hit, None for never. `duration` None takes the core's
    setting.
    """

    team: TeamColour = TeamColour.RED
    enemies: int = 2
    confederates: int = 1
    seed: int = 1
    duration: float | None = None
    emergency_at: float | None = None
    dialect: str | None = None
