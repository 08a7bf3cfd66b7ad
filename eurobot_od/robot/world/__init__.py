"""What is around the nodes in a simulated match: the field, the other robots, and the truth about our own."""

from eurobot_od.robot.world.world import World as World
