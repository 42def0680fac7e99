"""Presets: named weights of the cost, from the robot's description."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ik_proto.robots import RobotDescription, RobotError

REQUIRED = ("position", "rotation", "regularization", "smoothness")
"""Weights every preset has."""

OPTIONAL = ("elbow", "hyperextension", "retreat", "restarts", "unreachable_position", "unreachable_rotation")
"""Settings a preset may have besides."""


@dataclass(frozen=True)
class Preset:
    """Weights of the cost, and the errors beyond which a converged answer counts as unreachable.

    The regularization of the `openwbt` weights alone leaves settled, reachable targets up to 15 mm and 4.2 degrees
    (0.073 rad) off, and smoothness adds to that while q is on its way. With the default thresholds a target whose
    posture is within 0.5 rad of the request's q counts as reached; a far jump may count as unreachable until the arm
    has come closer.

    Attributes:
        name: Its name in requests and in the robot's description.
        position: Weight of the squared position error [1/m^2].
        rotation: Weight of the squared rotation error [1/rad^2].
        regularization: Weight of the squared distance from q = 0 [1/rad^2].
        smoothness: Weight of the squared distance from the request's q [1/rad^2].
        elbow: Weight of the squared distance of the elbow from where a hint of full confidence wants it [1/m^2].
        hyperextension: Weight of the squared angle by which the elbow is bent beyond the straight arm [1/rad^2].
        retreat: How much the smoothness weight grows with the cost that remains at the best q; slows an arm that
            cannot reach its target.
        restarts: Further starts tried after a jump that ended off target.
        unreachable_position: Largest position error of a wrist that counts as reached [m].
        unreachable_rotation: Largest rotation error of a wrist that counts as reached [rad].
    """

    name: str
    position: float
    rotation: float
    regularization: float
    smoothness: float
    elbow: float = 0.0
    hyperextension: float = 0.0
    retreat: float = 0.0
    restarts: int = 0
    unreachable_position: float = 0.025
    unreachable_rotation: float = 0.12

    def tolerance(self, weights: np.ndarray | None) -> np.ndarray:
        """Largest errors of wrists that count as reached.

        Args:
            weights: Confidence in position and orientation of each wrist target, shape (..., 2, 2); None for full. What
                has none is free: no error there is too large.

        Returns:
            Left and right position error [m], then left and right rotation error [rad], shape (..., 4).
        """
        limits = np.repeat([self.unreachable_position, self.unreachable_rotation], 2)
        if weights is None:
            return limits
        by_error = np.swapaxes(weights, -1, -2).reshape(*weights.shape[:-2], 4)
        return np.where(by_error > 0.0, limits, np.inf)

    @classmethod
    def of(cls, description: RobotDescription, name: str) -> "Preset":
        """Read a preset from a robot's description.

        Args:
            description: The robot's description.
            name: The preset's name there.

        Returns:
            The preset.

        Raises:
            RobotError: No such preset, a weight or setting missing, negative or unknown, restarts that are not a whole
                number, or no weight that makes the solution unique.
        """
        presets: Mapping[str, Mapping[str, float]] = description.presets
        if name not in presets:
            known = ", ".join(sorted(presets)) or "none"
            raise RobotError(description.source, f"no preset {name}; it has {known}")
        weights = presets[name]
        for weight in REQUIRED:
            if not weights.get(weight, -1.0) >= 0.0:
                raise RobotError(description.source, f"[presets.{name}] needs {weight}, a number >= 0")
        if not weights["regularization"] + weights["smoothness"] > 0.0:
            raise RobotError(description.source, f"[presets.{name}] needs regularization or smoothness above zero")
        if unknown := sorted(weights.keys() - set(REQUIRED) - set(OPTIONAL)):
            raise RobotError(description.source, f"[presets.{name}] has no use for {unknown[0]}")
        settings = dict(weights)
        for setting in OPTIONAL:
            if not settings.get(setting, 0.0) >= 0.0:
                raise RobotError(description.source, f"[presets.{name}] has a {setting} that is not a number >= 0")
        if settings.get("restarts", 0) % 1:
            raise RobotError(description.source, f"[presets.{name}] needs restarts to be a whole number")
        return cls(name, restarts=int(settings.pop("restarts", 0)), **settings)
