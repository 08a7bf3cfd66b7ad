"""The core node, in parts; each has its own chapter of the document.

| part | what it does | document |
|---|---|---|
| `stops.Stops` | stops that are seen to work, and the goto that they end | 2.1, 4.2.2 Obstacle, Emergency mushroom |
| `match_clock.MatchClock` | the end of the match | the rules of the match |
| `distrust.Distrust` | what others send in the core's name | none |
| `losses.Losses` | nodes that are lost | 5.1 |
| `positions.Positions` | where robots are | 4.2.2 Position, Navigation |
| `startup.Startup` | the start configuration | 2.3 |
| `resumption.Resumption` | going on after a loss | 5.1 |
| `equipment.Lookout`, `Tasks` | distance sensor, actuators | 4.2.2 Obstacle |
| `gotos.Gotos` | one goto at a time | 2.1 |

A part knows those above it, and `settings.CoreSettings`, which all share. `core.Core` has the calls, and makes all
parts anew at each reset. What asks and waits are scripts: `flows`, `recovery`, `agreement`; `doubts` judges what was
heard.
"""

from __future__ import annotations

from eurobot_od.robot.nodes.core.core import Core

__all__ = ["Core"]
