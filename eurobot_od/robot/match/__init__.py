"""A match of the three nodes: start, 90 s of driving to places, end; the same in simulated and in real time.

Rule of this package: it uses the nodes as a team's program does, by the core's calls. What happens comes out as a
timeline of events and a summary, which others print.
"""

from eurobot_od.robot.match.stage import rehearse as rehearse
from eurobot_od.robot.match.stage import rehearse_async as rehearse_async
from eurobot_od.robot.match.summary import Summary as Summary
from eurobot_od.robot.model.options import MatchOptions as MatchOptions
from eurobot_od.robot.world.world import EventKind as EventKind
from eurobot_od.robot.world.world import MatchEvent as MatchEvent
