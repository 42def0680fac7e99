"""`ik-sim --listen`, and a record of every control tick.

    python -m benchmarks.faults.robot_process TRACE.npz [OPTIONS OF ik-sim]

The command as users run it, but that what it looks at after each tick for its report is written down too, for
`RobotTrace`, and saved when it has ended in order.
"""

import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

from sim_client import robot_runner
from sim_client.cli import main
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.robot_report import RobotRecord

RECORD: dict[str, list] = defaultdict(list)


class FullRecord(RobotRecord):
    """The report's record, and everything else."""

    def observe(self, robot: SimRobot) -> None:
        """Look at the robot after a tick."""
        super().observe(robot)
        state = robot.read()
        RECORD["t"].append(time.monotonic())
        RECORD["dt"].append(CONTROL_PERIOD)
        RECORD["state"].append(robot.guard.state.value)
        RECORD["weight"].append(robot.guard.weight)
        RECORD["q_set"].append(state.q if state.q_set is None else state.q_set)
        RECORD["q"].append(state.q)
        RECORD["dq"].append(state.dq)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    setattr(robot_runner, "RobotRecord", FullRecord)  # noqa: B010  # a class in place of its base
    code = main(sys.argv[2:])
    np.savez_compressed(path, **{name: np.array(values) for name, values in RECORD.items()})  # ty: ignore[invalid-argument-type]
    sys.exit(code)
