"""The robot's own end of the teleop loop: what must run beside the motors, and the link that leads there.

The driver of a robot runs a `RobotGuard`, and a `LinkServer` where the loop is another process; docs/robot_end.md says
how. A loop reaches it by a `RobotLink`.
"""

from ik_client.robot_end.guard import RobotGuard, Setpoint
from ik_client.robot_end.lease import Reception
from ik_client.robot_end.link import RobotLink, RobotSilent
from ik_client.robot_end.link_server import Arrival, LinkLimits, LinkServer
from ik_client.robot_end.states import EndEvent, EndState

__all__ = [
    "Arrival",
    "EndEvent",
    "EndState",
    "LinkLimits",
    "LinkServer",
    "Reception",
    "RobotGuard",
    "RobotLink",
    "RobotSilent",
    "Setpoint",
]
