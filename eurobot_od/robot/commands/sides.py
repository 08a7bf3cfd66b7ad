"""Options for who plays: our colour, and the other robots, as a start configuration says them."""

from __future__ import annotations

import argparse

from eurobot_od.robot.model.values import TeamColour

COLOURS = [colour.name.lower() for colour in TeamColour]


def add_sides(parser: argparse.ArgumentParser) -> None:
    """Describe our colour, and who else is there."""
    parser.add_argument("--team", choices=COLOURS, default="red", help="our colour (default: red)")
    parser.add_argument("--enemies", type=int, choices=range(3), default=2, help="how many enemies (default: 2)")
    parser.add_argument("--confederates", type=int, choices=range(2), default=1, help="confederates (default: 1)")
