"""A guard on a bench: time that moves by ticks, arms that go where they are told, and a loop that sends by hand."""

from typing import Any

import numpy as np

from ik_client import Command
from ik_client.robot_end import EndState, Reception, RobotGuard, Setpoint
from ik_proto import Array

N = 3
PERIOD = 0.02
LOWER, UPPER = np.full(N, -2.0), np.full(N, 2.0)
HOME = np.array([0.3, -0.2, 0.5])
TICKS_OF_THE_RAMP = 10


class Bench:
    """A guard whose measured joints are its set-point as far as the weight goes, else home.

    Attributes:
        guard: The guard.
        now: Time [s].
        setpoints: All set-points so far.
    """

    def __init__(self, ramp: float = TICKS_OF_THE_RAMP * PERIOD) -> None:
        self.guard = RobotGuard(N, PERIOD, lower=LOWER, upper=UPPER, ramp=ramp)
        self.now = 1000.0
        self.q = HOME.copy()
        self.setpoints: list[Setpoint] = []
        self._seq: dict[str, int] = {}
        self.tick()

    @property
    def state(self) -> EndState:
        return self.guard.state

    @property
    def q_set(self) -> Array:
        return self.setpoints[-1].q

    def send(self, q: Array | None = None, *, session: str = "a", seq: int | None = None, **fields) -> Reception:
        """Offer a command; where the arms are held, or are, unless told otherwise."""
        if seq is None:
            seq = self._seq.get(session, 0) + 1
            self._seq[session] = seq
        command: dict[str, Any] = {"tau": np.zeros(N), "time": 0.0, "boot_id": "first"} | fields
        q = self.q_set if q is None else np.asarray(q, dtype=float)
        return self.guard.offer(Command(q=q, session=session, seq=seq, **command), self.now)

    def tick(self, ticks: int = 1) -> Setpoint:
        """Let time pass."""
        for _ in range(ticks):
            self.now += PERIOD
            setpoint = self.guard.step(self.now, self.q)
            self.q = setpoint.weight * setpoint.q + (1.0 - setpoint.weight) * HOME
            self.setpoints.append(setpoint)
        return self.setpoints[-1]

    def go(self, ticks: int, q: Array | None = None, **fields) -> Setpoint:
        """Send a command and let a tick pass, some times."""
        for _ in range(ticks):
            self.send(q, **fields)
            self.tick()
        return self.setpoints[-1]

    def take(self, session: str = "a") -> None:
        """Until the arms are ready."""
        self.go(TICKS_OF_THE_RAMP + 2, session=session)
        assert self.state is EndState.READY

    def follow(self, session: str = "a") -> None:
        """Until commands are followed."""
        self.take(session)
        self.go(1, engaged=True, session=session)
        assert self.state is EndState.FOLLOWING


def ramp_towards(bench: Bench, ticks: int, **fields) -> None:
    """Follow a motion at 1 rad/s, which is under way when this ends."""
    start = bench.q_set
    for k in range(ticks):
        bench.go(1, start + PERIOD * (k + 1), engaged=True, **fields)


def speed(bench: Bench) -> float:
    return float(np.abs(bench.setpoints[-1].q - bench.setpoints[-2].q).max()) / PERIOD
