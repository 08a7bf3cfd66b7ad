"""Live operation on a python-can bus: the only package with threads and the real clock.

Rule of this file: names only.
"""

from eurobot_od.live.buses import BITRATE as BITRATE
from eurobot_od.live.buses import DEFAULT_BUS as DEFAULT_BUS
from eurobot_od.live.buses import Driver as Driver
from eurobot_od.live.buses import open_bus as open_bus
from eurobot_od.live.live import Live as Live
from eurobot_od.live.reader import Watch as Watch
