# What the robot has for programs and for robots of a team's own, and from where: type checkers, editors and
# `__init__.py` read it.

from eurobot_od.robot import dialects as dialects
from eurobot_od.robot.facade import Robot as Robot
from eurobot_od.robot.match import rehearse as rehearse
from eurobot_od.robot.match import rehearse_async as rehearse_async
from eurobot_od.robot.model import messages as messages
from eurobot_od.robot.model.messages import Angle as Angle
from eurobot_od.robot.model.options import WorldAddress as WorldAddress
from eurobot_od.robot.model.values import Barriers as Barriers
from eurobot_od.robot.model.values import Direction as Direction
from eurobot_od.robot.model.values import GotoFault as GotoFault
from eurobot_od.robot.model.values import Obstacle as Obstacle
from eurobot_od.robot.model.values import Outcome as Outcome
from eurobot_od.robot.model.values import Passage as Passage
from eurobot_od.robot.model.values import Route as Route
from eurobot_od.robot.model.values import Source as Source
from eurobot_od.robot.model.values import TeamColour as TeamColour
from eurobot_od.robot.nodes import Core as Core
from eurobot_od.robot.nodes import Drive as Drive
from eurobot_od.robot.nodes import Navigation as Navigation
from eurobot_od.robot.nodes.core.agreement import NodeMismatch as NodeMismatch
from eurobot_od.robot.nodes.core.flows import GotoReport as GotoReport
from eurobot_od.robot.nodes.core.flows import NotStanding as NotStanding
from eurobot_od.robot.nodes.node import Component as Component
from eurobot_od.robot.nodes.node import Detection as Detection
from eurobot_od.robot.nodes.node import Loss as Loss
from eurobot_od.robot.nodes.node import RobotNode as RobotNode
from eurobot_od.robot.plugin import own_robot as own_robot
from eurobot_od.robot.protocol import EurobotProtocol as Protocol  # noqa: F401 (it has another name here)
from eurobot_od.robot.world.server import RemoteVehicle as RemoteVehicle
