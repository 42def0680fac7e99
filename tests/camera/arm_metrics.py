"""How well a chain follows a person whose joints are known, in the numbers that people compare.

Estimates and truth are in the person's pelvis frame: origin between the hips, upright, turned with the body. An
orientation is judged where the elbow is bent by more than 20 degrees, as the truth is not defined otherwise; jumps are
counted always.
"""

from dataclasses import dataclass, field

import numpy as np
from choreography import Choreography
from skinned_person import Array
from thesis_chain import bend_basis

BENT = np.sin(np.radians(20.0))
JUMP = 30.0
SPIKE = 0.08
BAD_LIMB = 0.25
STILL = 0.03
SHORTEST_HOLD = 15


@dataclass(frozen=True)
class Score:
    """Both arms together.

    Attributes:
        wrist_mean: Error of the wrists in the pelvis frame, mean [m].
        wrist_p95: Its 95th percentile [m].
        elbow_p95: The elbows' [m].
        turn_p95: Error of orientation where it is defined, 95th percentile [degree].
        turned_over: Share of it above 45 degrees.
        jumps: Steps of orientation above 30 degrees from a frame to the next.
        spikes: Steps of a wrist that are more than 8 cm longer than the person's.
        bad_limbs: Share of frames with a limb more than a quarter off.
        jitter: Of a wrist about its mean while the person holds still, rms [m].
        lag: By which the right wrist follows the wave [s]; NaN without a wave.
    """

    wrist_mean: float
    wrist_p95: float
    elbow_p95: float
    turn_p95: float
    turned_over: float
    jumps: int
    spikes: int
    bad_limbs: float
    jitter: float
    lag: float

    def __str__(self) -> str:
        return (
            f"wrist {100 * self.wrist_mean:.1f} / p95 {100 * self.wrist_p95:.1f} cm, elbow p95 "
            f"{100 * self.elbow_p95:.1f} cm, orientation p95 {self.turn_p95:.1f} deg, > 45 deg "
            f"{100 * self.turned_over:.1f} %, jumps {self.jumps}, spikes {self.spikes}, bad limbs "
            f"{100 * self.bad_limbs:.1f} %, jitter {1000 * self.jitter:.0f} mm, lag {1000 * self.lag:.0f} ms"
        )


@dataclass
class Track:
    """Estimates beside the truth, frame by frame.

    Attributes:
        times: Of the frames [s].
        truth: Shoulder, elbow and wrist, shape (2, 3, 3) each [m].
        joints: The same as estimated.
        turns: Orientations of the wrists, shape (2, 3, 3) each.
    """

    times: list[float] = field(default_factory=list)
    truth: list[Array] = field(default_factory=list)
    joints: list[Array] = field(default_factory=list)
    turns: list[Array] = field(default_factory=list)

    def add(self, t: float, truth: Array, joints: Array, turns: Array) -> None:
        """Keep a frame."""
        self.times.append(t)
        self.truth.append(truth)
        self.joints.append(joints)
        self.turns.append(turns)

    def score(self, dance: Choreography) -> Score:
        """Judge the track."""
        G, A, R = np.array(self.truth), np.array(self.joints), np.array(self.turns)
        t = np.array(self.times)
        error = np.linalg.norm(A - G, axis=-1)
        limbs_true, limbs = np.diff(G, axis=2), np.diff(A, axis=2)
        R_true = np.array([[bend_basis(arm) for arm in arms] for arms in G])
        u, f = limbs_true[:, :, 0], limbs_true[:, :, 1]
        bend = np.linalg.norm(np.cross(f, u), axis=-1) / np.linalg.norm(f, axis=-1) / np.linalg.norm(u, axis=-1)
        off = angle_between(R, R_true)[bend > BENT]
        step_true = np.linalg.norm(np.diff(G[:, :, 2], axis=0), axis=-1)
        step = np.linalg.norm(np.diff(A[:, :, 2], axis=0), axis=-1)
        ratio = np.linalg.norm(limbs, axis=-1) / np.linalg.norm(limbs_true, axis=-1)
        return Score(
            wrist_mean=float(error[:, :, 2].mean()),
            wrist_p95=float(np.percentile(error[:, :, 2], 95)),
            elbow_p95=float(np.percentile(error[:, :, 1], 95)),
            turn_p95=float(np.percentile(off, 95)),
            turned_over=float((off > 45.0).mean()),
            jumps=int((angle_between(R[1:], R[:-1]) > JUMP).sum()),
            spikes=int((step - step_true > SPIKE).sum()),
            bad_limbs=float((np.abs(ratio - 1.0) > BAD_LIMB).any(axis=-1).mean()),
            jitter=_jitter(t, G[:, :, 2], A[:, :, 2], dance.turn),
            lag=_lag(t, G[:, 1, 2, 1], A[:, 1, 2, 1], dance.wave),
        )


def angle_between(A: Array, B: Array) -> Array:
    """Angles between rotations, shape (...) [degree]."""
    cosine = (np.einsum("...ij,...ij->...", A, B) - 1.0) / 2.0
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _jitter(t: Array, truth: Array, wrists: Array, turn: tuple[float, float]) -> float:
    squares = []
    speed = np.linalg.norm(np.gradient(truth, t, axis=0), axis=-1)
    turning = (t >= turn[0]) & (t <= turn[1])
    for arm in range(2):
        still = (speed[:, arm] < STILL) & ~turning
        edges = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]])))
        for begin, end in edges.reshape(-1, 2):
            # A moment for the estimate to arrive.
            held = wrists[begin + 5 : max(end - 5, 0), arm]
            if len(held) > SHORTEST_HOLD:
                squares.append(((held - held.mean(axis=0)) ** 2).sum(axis=-1))
    return float(np.sqrt(np.concatenate(squares).mean())) if squares else np.nan


def _lag(t: Array, truth: Array, wrist: Array, wave: tuple[float, float]) -> float:
    inside = (t >= wave[0] + 0.3) & (t <= wave[1] - 0.3)
    if inside.sum() < 10:
        return np.nan
    lags = np.arange(-0.10, 0.40, 0.002)
    speed = np.diff(wrist[inside])
    fits = [np.corrcoef(np.diff(np.interp(t[inside] - lag, t, truth)), speed)[0, 1] for lag in lags]
    return float(lags[int(np.argmax(fits))])
