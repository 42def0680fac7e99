"""The projected Newton method: where a descent ends, that it never rises, that it keeps the limits."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_service.arm import BLOCKS, arm_objective, arm_problem
from ik_service.chains import ArmChain
from ik_service.newton import TOLERANCE, Objective, descent, iteration, solve_on_free_joints, when
from ik_service.robot import Robot

OPENWBT = (50.0, 1.0, 0.02, 0.1)
PRECISE = (50.0, 1.0, 1e-5, 5e-4)
Weights = tuple[float, float, float, float]


@dataclass(frozen=True)
class Descent:
    """One arm's descent, and its problems."""

    arm: ArmChain
    objective: Objective
    function: ca.Function
    problem: ca.Function

    @classmethod
    def of(cls, arm: ArmChain) -> "Descent":
        objective = arm_objective(arm)
        return cls(arm, objective, descent(objective, BLOCKS, f"{arm.side}_test"), arm_problem(arm))

    def posed(self, q_last: np.ndarray, target: np.ndarray, weights: Weights = OPENWBT) -> np.ndarray:
        position, rotation, regularization, smoothness = weights
        options = np.array([position, rotation, 0.0, 0.0, 0.0, 0.0])
        shared = np.array([regularization, smoothness, 0.0, 0.0, 0.0])
        return np.array(self.problem(q_last, target.ravel(), options, shared, np.eye(3), np.zeros(3))).ravel()

    def run(self, start: np.ndarray, problem: np.ndarray) -> tuple[np.ndarray, float, float, int, bool]:
        """Where it ends: q, cost, projected gradient, iterations, settled."""
        q, value, measures, iterations, settled = self.function(start, problem)
        return np.array(q).ravel(), float(value), float(measures[0]), int(iterations), bool(settled)


def _random_problem(arm: ArmChain, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """An unrelated start and target, the start up to half a radian outside the limits."""
    rng = np.random.default_rng(seed)
    return rng.uniform(arm.lower - 0.5, arm.upper + 0.5), arm.wrist(rng.uniform(arm.lower, arm.upper))


@pytest.fixture(scope="module")
def descents(robot: Robot) -> list[Descent]:
    return [Descent.of(arm) for arm in robot.arms]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_ends_at_a_stationary_point_within_the_limits(descents: list[Descent], seed: int) -> None:
    for mine in descents:
        arm = mine.arm
        start, target = _random_problem(arm, seed)
        problem = mine.posed(start, target)
        q, value, norm, _, settled = mine.run(start, problem)
        assert settled
        assert (arm.lower <= q).all()
        assert (q <= arm.upper).all()
        # A last step so short that its square does not matter may leave more than the tolerance, but not much.
        assert norm <= 1e-3
        again, value_again, norm_again, _, _ = mine.run(q, problem)
        assert value - value_again <= 1e-9 * (1.0 + value)
        assert value_again <= value * (1.0 + 1e-12)
        assert np.abs(again - q).max() <= 1e-4
        if norm_again <= TOLERANCE:
            assert mine.run(again, problem)[3] == 0


@pytest.mark.parametrize("weights", [OPENWBT, PRECISE])
def test_cost_never_rises(descents: list[Descent], weights: Weights) -> None:
    """Iteration by iteration; chained, they are the descent."""
    mine = descents[0]
    once, rejected = iteration(mine.objective, "alone"), 0
    for seed in range(20):
        start, target = _random_problem(mine.arm, seed)
        problem = mine.posed(start, target, weights)
        whole, value, _, iterations, settled = mine.run(start, problem)
        state = [*mine.objective.evaluate(np.clip(start, mine.arm.lower, mine.arm.upper), problem), 0, 0, 0]
        costs = [float(state[1])]
        while not float(state[7]) and len(costs) <= iterations:
            state = list(once(*state, problem))
            costs.append(float(state[1]))
        assert (np.diff(costs) <= 1e-13 * np.array(costs[:-1])).all()
        rejected += int(np.sum(np.diff(costs) == 0.0))
        assert (len(costs) - 1, bool(float(state[7]))) == (iterations, settled)
        assert np.array_equal(np.array(state[0]).ravel(), whole)
        assert costs[-1] == value
    assert rejected > 0  # else acceptance would go untested


def test_settles_far_targets_in_few_iterations(descents: list[Descent]) -> None:
    """Gauss-Newton takes more than 20 on these; the exact Hessian is what makes the difference."""
    rng = np.random.default_rng(4)
    for mine in descents:
        iterations = []
        for _ in range(50):
            q = rng.uniform(mine.arm.lower, mine.arm.upper)
            target = mine.arm.wrist(q)
            target[:3, 3] = mine.arm.shoulder + 1.3 * (target[:3, 3] - mine.arm.shoulder)
            there = mine.run(q, mine.posed(q, target))[0]
            nudged = target.copy()
            nudged[:3, 3] += rng.normal(0.0, 0.01, 3)
            _, _, _, count, settled = mine.run(there, mine.posed(there, nudged))
            assert settled
            iterations.append(count)
        assert np.median(iterations) <= 4


def test_a_settled_start_costs_no_iteration(descents: list[Descent]) -> None:
    """Q = 0 with its own wrist as target: every term is zero."""
    mine = descents[0]
    q = np.zeros(mine.arm.n)
    found, value, norm, iterations, settled = mine.run(q, mine.posed(q, mine.arm.wrist(q)))
    assert np.array_equal(found, q)
    assert (iterations, settled) == (0, True)
    assert max(value, norm) < 1e-9


def test_held_joints_stand_still_and_the_others_take_a_newton_step() -> None:
    n, rng = 6, np.random.default_rng(9)
    symbols = [ca.SX.sym("H", n, n), ca.SX.sym("q", n), ca.SX.sym("g", n), ca.SX.sym("damping")]
    H, q, g, damping = symbols
    rows = [[H[i, j] for j in range(n)] for i in range(n)]
    lower, upper = np.full(n, -1.0), np.full(n, 1.0)
    solve = ca.Function("solve", symbols, list(solve_on_free_joints(rows, q, g, damping, lower, upper)))
    held_at_all = 0
    for _ in range(50):
        root = rng.normal(size=(n, n))
        matrix, gradient = root @ root.T + np.eye(n), rng.normal(size=n)
        point = rng.choice([-1.0, 0.3, 1.0], n)
        held = ((point == -1.0) & (gradient > 0.0)) | ((point == 1.0) & (gradient < 0.0))
        step, pivot = (np.array(out).ravel() for out in solve(matrix, point, gradient, 0.5))
        free = ~held
        expected = np.zeros(n)
        expected[free] = -np.linalg.solve((matrix + 0.5 * np.eye(n))[np.ix_(free, free)], gradient[free])
        assert np.allclose(step, expected, atol=1e-9)
        assert pivot[0] > 0.0
        held_at_all += held.any()
    assert held_at_all > 5


def test_guard_keeps_or_applies() -> None:
    x, y = ca.MX.sym("x", 2), ca.MX.sym("y")
    guarded = when(ca.Function("shift", [x, y], [x + y]))
    assert np.array_equal(np.array(guarded(0, [1.0, 2.0], 5.0)).ravel(), [1.0, 2.0])
    assert np.array_equal(np.array(guarded(1, [1.0, 2.0], 5.0)).ravel(), [6.0, 7.0])
