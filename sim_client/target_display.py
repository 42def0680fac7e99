"""Shows in the scene where the wrists shall be."""

from sim_client.robot import SimRobot
from sim_client.trace import Tick


class TargetDisplay:
    """Observer that puts the visible targets where the loop wants the wrists; those of an arm at rest stay."""

    def __init__(self, robot: SimRobot) -> None:
        """Show in this robot's scene."""
        self._robot = robot

    def observe(self, tick: Tick) -> None:
        """Show the targets of a tick."""
        left, right = tick.targets
        if left is None and right is None:
            return
        shown_left, shown_right = self._robot.shown_targets()
        self._robot.show_targets(shown_left if left is None else left, shown_right if right is None else right)
