"""The surroundings of the nodes in a simulated match: field, other robots, and the truth about our own."""

from eurobot_od.robot.world.world import World as World
