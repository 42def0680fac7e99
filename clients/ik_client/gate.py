"""The gate: which poses of a hand may be followed. One gate per hand, one check per tick, in front of the clutch.

| verdict   | when                                                                                  | the hand |
|-----------|---------------------------------------------------------------------------------------|----------|
| ok        | none of the others                                                                    | passes   |
| missing   | there is no sample                                                                    | is lost  |
| untracked | the tracker does not see the hand                                                     | is lost  |
| invalid   | the pose is no rigid transform of finite numbers                                      | is lost  |
| stale     | the sample arrived longer than `max_age` ago, or the one before it did, unnoticed     | is lost  |
| frozen    | the position has not changed by a bit for `freeze_time`, however new the samples are  | is lost  |
| jump      | the hand moved or turned faster than a hand does; it may be a glitch                  | is lost  |
| moved     | `jump_frames` samples in a row did: the hand is somewhere else now                    | is gone  |
| gone      | it has been lost, for whatever reason but a suspected jump, for longer than `give_up` | is gone  |

- Whoever follows a hand must stop when it is lost and take a new snapshot before going on, because the sample after a
  loss may be anywhere. A hand that is gone needs a new grip as well.
- Jumps are rejected here, before any rate limiter: a limiter alone turns a jump into a legal slew to a bogus target.
- Age is counted from the tick at which a sample was first seen, on the caller's clock. A stamp only tells samples
  apart; one of the past or of the future changes nothing.
- Frozen looks at the position alone: a controller out of its cameras' sight keeps turning by its gyroscope.
- The clock is monotonic. Should it step back all the same, samples count as stale until they arrive anew.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ik_client.hand import HandSample
from ik_client.rotation import turn
from ik_proto import Array
from ik_proto.pose import as_pose

_Identity = tuple[float | None, bool, bytes]
"""Stamp, tracked, pose: what tells a sample from another."""


class Verdict(StrEnum):
    """What the gate thinks of a hand in this tick."""

    OK = "ok"
    MISSING = "missing"
    UNTRACKED = "untracked"
    INVALID = "invalid"
    STALE = "stale"
    FROZEN = "frozen"
    JUMP = "jump"
    MOVED = "moved"
    GONE = "gone"

    @property
    def revokes(self) -> bool:
        """Whether the hand is gone, so that following it again needs a new grip."""
        return self in (Verdict.MOVED, Verdict.GONE)


@dataclass(frozen=True, slots=True)
class GateLimits:
    """Where the gate draws its lines.

    Attributes:
        max_age: Age at which a sample still counts [s].
        give_up: Loss after which the hand is gone [s].
        max_speed: Fastest a hand moves [m/s].
        max_turn: Fastest a hand turns [rad/s].
        min_interval: Samples that arrive closer together than this are judged as this far apart [s]. Arrival times
            jitter; judged by them alone, an ordinary hand reaches 19 m/s. At 3 m/s it grants a step of 6 cm.
        jump_frames: New samples in a row, each beyond the limits, after which the hand is somewhere else.
        freeze_time: How long a position may stay the same to the bit [s]; infinite for scripted hands.
    """

    max_age: float = 0.1
    give_up: float = 0.5
    max_speed: float = 3.0
    max_turn: float = 12.0
    min_interval: float = 0.02
    jump_frames: int = 3
    freeze_time: float = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Gated:
    """What a check gives.

    Attributes:
        verdict: Whether the hand may be followed, and why not.
        pose: The pose, made exact, where the verdict is ok; else None.
    """

    verdict: Verdict
    pose: Array | None = None


class PoseGate:
    """Judges the samples of one hand."""

    def __init__(self, limits: GateLimits | None = None) -> None:
        """Start without memory.

        Args:
            limits: Where to draw the lines.

        Raises:
            ValueError: A limit is not positive.
        """
        self.limits = limits or GateLimits()
        for name in GateLimits.__dataclass_fields__:
            if not getattr(self.limits, name) > 0:
                raise ValueError(f"the gate's {name} must be positive, not {getattr(self.limits, name)}")
        self._seen: _Identity | None = None
        self._position = b""
        self._arrived = -math.inf
        self._changed = -math.inf
        self._good_arrival = -math.inf
        self._good: Array | None = None
        self._verdict = Verdict.MISSING
        self._jumps = 0

    def check(self, sample: HandSample | None, now: float) -> Gated:
        """Judge the tracker's latest sample; the same one may come in several ticks.

        Args:
            sample: What the tracker says; None where it says nothing.
            now: Time of the tick [s], monotonic.

        Returns:
            The verdict, with the pose where the hand may be followed.
        """
        verdict, pose = self._judge(sample, now)
        if verdict is Verdict.OK:
            self._good_arrival = self._arrived
        elif verdict is not Verdict.JUMP:
            # The stretch of good samples ends. What comes next begins a new one, wherever it is.
            self._good, self._jumps = None, 0
            silence = now - self._good_arrival
            if not 0.0 <= silence <= self.limits.give_up:
                verdict = Verdict.GONE
        self._verdict = verdict
        return Gated(verdict, pose if verdict is Verdict.OK else None)

    def _judge(self, sample: HandSample | None, now: float) -> tuple[Verdict, Array | None]:
        if sample is None:
            return Verdict.MISSING, None
        pose = _rigid(sample.pose)
        interval = self._note_arrival(_identity(sample, pose), pose, now)
        if not sample.tracked:
            return Verdict.UNTRACKED, None
        if pose is None:
            return Verdict.INVALID, None
        # Written so that a clock that stepped back, or NaN, fails them.
        if not 0.0 <= now - self._arrived <= self.limits.max_age:
            return Verdict.STALE, None
        if not 0.0 <= now - self._changed <= self.limits.freeze_time:
            return Verdict.FROZEN, None
        if interval is None:
            return self._repeated(pose)
        if self._good is not None and not 0.0 <= interval <= self.limits.max_age:
            return Verdict.STALE, None
        return self._continuous(pose, interval)

    def _note_arrival(self, identity: _Identity, pose: Array | None, now: float) -> float | None:
        """Time since the sample before this one arrived [s]; None where it is the same one."""
        if identity == self._seen:
            return None
        interval = now - self._arrived
        self._seen, self._arrived = identity, now
        if pose is not None and (position := pose[:3, 3].tobytes()) != self._position:
            self._position, self._changed = position, now
        return interval

    def _repeated(self, pose: Array) -> tuple[Verdict, Array | None]:
        """A sample seen before: what was rejected as a jump stays rejected; the first after a loss begins anew."""
        if self._verdict is Verdict.JUMP:
            return Verdict.JUMP, None
        self._good = pose
        return Verdict.OK, pose

    def _continuous(self, pose: Array, interval: float) -> tuple[Verdict, Array | None]:
        """A new sample: is it where the hand can have come to since the last good one?

        What a step may be does not grow while samples are rejected, else waiting would let any jump through.
        """
        if self._good is not None:
            span = max(interval, self.limits.min_interval)
            step = math.dist(pose[:3, 3].tolist(), self._good[:3, 3].tolist())
            angle = turn(self._good[:3, :3], pose[:3, :3])
            if not (step <= self.limits.max_speed * span and angle <= self.limits.max_turn * span):
                self._jumps += 1
                return (Verdict.MOVED if self._jumps >= self.limits.jump_frames else Verdict.JUMP), None
        self._good, self._jumps = pose, 0
        return Verdict.OK, pose


def _identity(sample: HandSample, pose: Array | None) -> _Identity:
    """What tells a sample from another, kept by value: a tracker may write into its arrays again.

    A stamp that is no number tells nothing.
    """
    stamp = sample.stamp if math.isfinite(sample.stamp) else None
    return stamp, bool(sample.tracked), b"" if pose is None else pose.tobytes()


def _rigid(T: Array) -> Array | None:
    """A copy of the pose, made exact; None where it is no pose."""
    try:
        T = np.array(T, dtype=np.float64)
        return as_pose(T) if T.shape == (4, 4) else None
    except (TypeError, ValueError):
        return None
