"""The core node, in parts; each has its own chapter of the document.

| part | what it does | document | |---|---|---| | `stops.Stops` | stops until the robot is seen to stand, and the goto
they end | 2.1, 4.2.2 Obstacle, Emergency mushroom | | `match_clock.MatchClock` | the end of the match | the rules of
the match | | `distrust.Distrust` | frames that others send under the core's identifiers | none | | `losses.Losses` |
lost nodes | 5.1 | | `positions.Positions` | the positions of all robots | 4.2.2 Position, Navigation | |
`startup.Startup` | the start configuration | 2.3 | | `resumption.Resumption` | continuing after a loss | 5.1 | |
`equipment.Lookout`, `Tasks` | distance sensor, actuators | 4.2.2 Obstacle | | `gotos.Gotos` | one goto at a time | 2.1
| | `gotos.Orders` | gotos and start configurations that are written into objects | none |

A part uses those above it, and `settings.CoreSettings`, which all share. `core.Core` has the calls, and makes all parts
anew at each reset. The questions and waits are scripts, in `flows` and `agreement`; `distrust` judges received
confirms and places.
"""

from __future__ import annotations

from eurobot_od.robot.nodes.core.core import Core

__all__ = ["Core"]
