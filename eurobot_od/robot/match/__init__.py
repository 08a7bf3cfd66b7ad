"""A match of the three nodes: start, 90 s of driving to places, end; the same in simulated and in real time.

Rule of this package: it uses nodes the way a team's program does, through the core's calls; what happened comes out as
a timeline of events and a summary, and printing is somebody else's business.
"""

from eurobot_od.robot.match.options import Options as Options
from eurobot_od.robot.match.stage import rehearse as rehearse
from eurobot_od.robot.match.summary import Summary as Summary
from eurobot_od.robot.match.timeline import Event as Event
from eurobot_od.robot.match.timeline import EventKind as EventKind
