"""A request's numbers in the vectors that the kernel reads."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, cast

import casadi as ca
import numpy as np

from ik_service.arm import ARM_OPTIONS, SHARED_OPTIONS
from ik_service.layout import AVOID, OFF, REPORT_ONLY, Layout
from ik_service.preset import Preset

Collision = Literal["off", "report", "avoid"]

COLLISION: dict[str, float] = {"off": OFF, "report": REPORT_ONLY, "avoid": AVOID}
"""The settings of collision checking, by their names in requests."""

_ELBOW = ARM_OPTIONS.index("elbow")


class Problem:
    """The vectors of one problem, written in place.

    Attributes:
        request: Joint positions and targets, shape (layout.request,).
        options: Everything else, shape (layout.options,).
        q: Joint positions [rad], shape (nq,); a view, like those that follow.
        left: Target of the left arm in the base frame, shape (4, 4).
        right: Target of the right arm, likewise.
        waist: Waist joint positions [rad].
    """

    def __init__(self, layout: Layout, preset: Preset) -> None:
        """Make the problem of a straight waist, full confidence and no elbow hints, with avoidance off."""
        self.request = np.zeros(layout.request)
        self.options = np.zeros(layout.options)
        nq = layout.nq
        self.q = self.request[:nq]
        self.left = self.request[nq : nq + 16].reshape(4, 4)
        self.right = self.request[nq + 16 :].reshape(4, 4)
        waist, left, right, shared, _ = layout.option_cuts[:-1]
        self.waist = self.options[waist:left]
        self._arms = (self.options[left:right], self.options[right:shared])
        self._shared = self.options[shared : shared + len(SHARED_OPTIONS)]
        self._layout, self._preset = layout, preset
        for key in ("regularization", "smoothness", "hyperextension", "retreat"):
            self.share(key, getattr(preset, key))
        self.hint(None, None, None, None)

    def pose(self, q: np.ndarray, left_wrist: np.ndarray, right_wrist: np.ndarray) -> None:
        """Write joint positions [rad], shape (nq,), and targets in the base frame, shape (4, 4)."""
        self.q[:] = q
        self.left[:] = left_wrist
        self.right[:] = right_wrist

    def hint(
        self,
        waist: np.ndarray | None,
        left_elbow: np.ndarray | None,
        right_elbow: np.ndarray | None,
        weights: np.ndarray | None,
    ) -> None:
        """Write what a request may leave out, as `write_hints` does."""
        hints = (None if hint is None else hint[None] for hint in (waist, left_elbow, right_elbow, weights))
        write_hints(self.options[None], self._layout, self._preset, *hints)

    def share(self, key: str, value: float) -> None:
        """Write one of `arm.SHARED_OPTIONS`."""
        self._shared[SHARED_OPTIONS.index(key)] = value

    def copy(self, other: "Problem", shared: Mapping[str, float], elbow: float) -> None:
        """Take over another problem.

        Args:
            other: The problem.
            shared: Values of `arm.SHARED_OPTIONS` to have instead of its own.
            elbow: What to multiply the weights of elbow hints with.
        """
        self.request[:], self.options[:] = other.request, other.options
        for key, value in shared.items():
            self.share(key, value)
        for arm in self._arms:
            arm[_ELBOW] *= elbow

    @property
    def weights(self) -> list[float]:
        """Weights of position and rotation, of the left and of the right arm."""
        return [weight for arm in self._arms for weight in arm[:_ELBOW].tolist()]

    @property
    def elbows(self) -> list[float]:
        """Weights of the elbow hints, of the left and of the right arm."""
        return [float(arm[_ELBOW]) for arm in self._arms]

    def target(self, arm: int) -> np.ndarray:
        """Target of an arm in the base frame, shape (4, 4); a view."""
        return self.right if arm else self.left

    @property
    def collision(self) -> float:
        """One of `OFF`, `REPORT_ONLY` and `AVOID`."""
        return float(self.options[-1])

    @collision.setter
    def collision(self, value: float) -> None:
        self.options[-1] = value


def write_hints(
    options: np.ndarray,
    layout: Layout,
    preset: Preset,
    waist: np.ndarray | None,
    left_elbow: np.ndarray | None,
    right_elbow: np.ndarray | None,
    weights: np.ndarray | None,
) -> None:
    """Write what requests may leave out into their options; None stands for the default.

    Args:
        options: Options of N problems, shape (N, layout.options).
        layout: Layout of the vectors.
        preset: Weights of full confidence.
        waist: Waist joint positions [rad], shape (N, n_waist); by default straight.
        left_elbow: Unit direction from shoulder to elbow in the base frame, and a confidence in [0, 1], shape (N, 4);
            by default none.
        right_elbow: The same of the right arm.
        weights: Confidence in position and orientation of each wrist target, in [0, 1], shape (N, 2, 2); by default
            full.
    """
    first, left, right, end, _ = layout.option_cuts[:-1]
    options[:, first:left] = 0.0 if waist is None else waist
    full = np.array([preset.position, preset.rotation])
    for i, (begin, stop, elbow) in enumerate(((left, right, left_elbow), (right, end, right_elbow))):
        arm = options[:, begin:stop]
        arm[:, :_ELBOW] = full if weights is None else full * weights[:, i]
        arm[:, _ELBOW:] = 0.0
        if elbow is not None:
            arm[:, _ELBOW] = preset.elbow * elbow[:, 3]
            arm[:, _ELBOW + 1 :] = elbow[:, :3]


def bind(
    function: ca.Function, inputs: Sequence[np.ndarray], outputs: Sequence[np.ndarray]
) -> tuple[Callable[[], None], object]:
    """Tie a CasADi function to arrays, which it reads and writes in place.

    Args:
        function: The function.
        inputs: One contiguous array an input.
        outputs: One contiguous array an output.

    Returns:
        The call, and what must be kept alive as long as it is called: CasADi holds bare pointers to the arrays.
    """
    buffer: Any  # the stubs of set_arg and set_res ask for a size that a memoryview brings along
    buffer, call = cast(Any, function).buffer()
    for i, array in enumerate(inputs):
        buffer.set_arg(i, array.data)
    for i, array in enumerate(outputs):
        buffer.set_res(i, array.data)
    return call, (buffer, inputs, outputs)
