"""Capsule distances and gradients: against exact arithmetic, coal, MuJoCo and finite differences."""

from collections.abc import Callable
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from capsule_oracles import MujocoScene, PinocchioScene, coal_distance
from hypothesis import given
from hypothesis import strategies as st

from ik_proto.robots import RobotDescription
from ik_service.clearance import (
    Segment,
    capsule_ends,
    clearances,
    closest,
    joint_lines,
    pair_distances,
    pair_gradient,
    smallest,
)
from ik_service.collision import Carrier, CollisionModel
from ik_service.kinematics import wrist_pose
from ik_service.proximity import Proximity
from ik_service.robot import Robot


def _segment_pair() -> ca.Function:
    """(a0, a1, b0, b1) -> (distance, point on a, point on b)."""
    a0, a1, b0, b1 = ends = [ca.SX.sym(name, 3) for name in ("a0", "a1", "b0", "b1")]
    near = closest(*(Segment(p, q - p, ca.sumsqr(q - p)) for p, q in ((a0, a1), (b0, b1))))
    return ca.Function("segment_pair", ends, [near.distance, near.point_a, near.point_b])


SEGMENT_PAIR = _segment_pair()

coordinates = st.floats(-0.5, 0.5)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)
Ends = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def distance_and_points(*ends: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    distance, point_a, point_b = SEGMENT_PAIR(*ends)
    return float(distance), np.array(point_a).ravel(), np.array(point_b).ravel()


def exact_distance(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> float:
    """Distance of two segments in rational arithmetic: the best of all edges of the square and of its inside."""

    def less(p: np.ndarray, q: np.ndarray) -> list[Fraction]:
        return [Fraction(float(x)) - Fraction(float(y)) for x, y in zip(p, q, strict=True)]

    def dot(p: list[Fraction], q: list[Fraction]) -> Fraction:
        return sum((x * y for x, y in zip(p, q, strict=True)), Fraction(0))

    def within(x: Fraction) -> Fraction:
        return min(max(x, Fraction(0)), Fraction(1))

    u, v, w = less(a1, a0), less(b1, b0), less(a0, b0)
    a, b, c, d, e = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    candidates = []
    for end in (Fraction(0), Fraction(1)):
        candidates.append((end, within((b * end + e) / c) if c else Fraction(0)))
        candidates.append((within((b * end - d) / a) if a else Fraction(0), end))
    if determinant := a * c - b * b:
        s, t = (b * e - c * d) / determinant, (a * e - b * d) / determinant
        if 0 <= s <= 1 and 0 <= t <= 1:
            candidates.append((s, t))
    squares = [a * s * s + c * t * t - 2 * b * s * t + 2 * d * s - 2 * e * t + dot(w, w) for s, t in candidates]
    return float(min(squares)) ** 0.5


@given(points, points, points, points)
def test_distance_of_segments_is_exact(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> None:
    distance, point_a, point_b = distance_and_points(a0, a1, b0, b1)
    assert distance == pytest.approx(exact_distance(a0, a1, b0, b1), abs=1e-12)
    assert np.linalg.norm(point_a - point_b) == pytest.approx(distance, abs=1e-12)
    for point, start, end in ((point_a, a0, a1), (point_b, b0, b1)):
        assert exact_distance(point, point, start, end) < 1e-12


@given(points, points, points, st.floats(-2.0, 2.0), points, st.floats(-17.0, -3.0))
def test_distance_of_nearly_parallel_segments_is_exact(
    a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, stretch: float, aside: np.ndarray, exponent: float
) -> None:
    for bend in (aside, b0 - a0):  # the second leaves them in one plane
        b1 = b0 + stretch * (a1 - a0) + 10.0**exponent * bend
        distance, _, _ = distance_and_points(a0, a1, b0, b1)
        assert distance == pytest.approx(exact_distance(a0, a1, b0, b1), abs=1e-12)


X, Y, Z = np.eye(3)
ZERO = np.zeros(3)
SPECIAL: dict[str, tuple[Ends, float]] = {
    "crossing": ((-X, X, -Y, Y), 0.0),
    "the same": ((ZERO, X, ZERO, X), 0.0),
    "the same, other way round": ((ZERO, X, X, ZERO), 0.0),
    "in line, apart": ((ZERO, X, 3 * X, 5 * X), 2.0),
    "in line, overlapping": ((ZERO, 2 * X, X, 5 * X), 0.0),
    "parallel": ((ZERO, X, Y - X, Y + X), 1.0),
    "parallel, offset": ((ZERO, X, Y + 2 * X, Y + 3 * X), 2.0**0.5),
    "end to end": ((ZERO, X, X, X + Y), 0.0),
    "T": ((ZERO, X, X + Y, X + 2 * Y), 1.0),
    "skew": ((-X, X, Z - Y, Z + Y), 1.0),
    "a point": ((X, X, -Y, Y), 1.0),
    "a segment and a point": ((-Y, Y, X, X), 1.0),
    "two points": ((X, X, Y, Y), 2.0**0.5),
    "one point": ((X, X, X, X), 0.0),
}


@pytest.mark.parametrize(("ends", "expected"), SPECIAL.values(), ids=SPECIAL.keys())
def test_special_positions(ends: Ends, expected: float) -> None:
    distance, point_a, point_b = distance_and_points(*ends)
    assert distance == pytest.approx(expected, abs=1e-15)
    assert np.linalg.norm(point_a - point_b) == pytest.approx(expected, abs=1e-15)


def test_coal_agrees_on_random_segments() -> None:
    for ends in np.random.default_rng(1).uniform(-0.3, 0.3, (500, 4, 3)):
        distance, _, _ = distance_and_points(*ends)
        assert distance == pytest.approx(coal_distance(ends[:2], ends[2:]), abs=1e-9)


@given(st.lists(st.sampled_from([0.3, 0.1, 0.2, -0.4]), min_size=1, max_size=9))
def test_smallest_is_the_first_of_the_least(values: list[float]) -> None:
    symbols = ca.SX.sym("values", len(values))
    value, place = ca.Function("smallest", [symbols], list(smallest(symbols)))(values)
    assert float(value) == min(values)
    assert int(place) == values.index(min(values))


Measure = Callable[[np.ndarray, np.ndarray], list[np.ndarray]]


@pytest.fixture(scope="module")
def model(robot: Robot) -> CollisionModel:
    return robot.collision


@pytest.fixture(scope="module")
def pairs(model: CollisionModel) -> list[tuple[str, str]]:
    return [(model.capsules[a].name, model.capsules[b].name) for a, b in model.pairs]


def symbols_of(robot: Robot, model: CollisionModel) -> tuple[ca.SX, ca.SX, list]:
    """Joint positions, ends of the base's capsules, and the kinematics of both arms."""
    q, split = ca.SX.sym("q", robot.nq), len(robot.arms[0].joint_names)
    count = sum(capsule.carrier is Carrier.BASE for capsule in model.capsules)
    poses = [wrist_pose(arm, part) for arm, part in zip(robot.arms, (q[:split], q[split:]), strict=True)]
    return q, ca.SX.sym("base_ends", 3, 2 * count), poses


def numbers_of(robot: Robot, function: ca.Function) -> Measure:
    """Call a function of q and base ends with q and the waist joints."""

    def measure(q: np.ndarray, waist: np.ndarray) -> list[np.ndarray]:
        base_ends = robot.collision.base_ends(robot.waist.motion(waist)).reshape(-1, 3).T
        return [np.array(output) for output in function.call([q, base_ends])]

    return measure


@pytest.fixture(scope="module")
def measure(robot: Robot, model: CollisionModel) -> Measure:
    """(q, waist) -> (distances of the pairs, ends of the capsules)."""
    q, base_ends, poses = symbols_of(robot, model)
    segments = capsule_ends(model, *poses, base_ends)
    ends = ca.horzcat(*(column for segment in segments for column in (segment.start, segment.start + segment.along)))
    return numbers_of(robot, ca.Function("measure", [q, base_ends], [pair_distances(model, segments), ends]))


def random_postures(robot: Robot, count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return [(rng.uniform(robot.lower, robot.upper), rng.uniform(-0.5, 0.5, 3)) for _ in range(count)]


def test_coal_agrees_on_the_g1(
    robot: Robot, description: RobotDescription, pairs: list[tuple[str, str]], measure: Measure
) -> None:
    scene = PinocchioScene(description)
    for q, waist in random_postures(robot, 50, seed=2):
        distances, _ = measure(q, waist)
        assert np.allclose(distances.ravel(), scene.distances(q, waist, pairs), rtol=0.0, atol=1e-9)


def test_mujoco_agrees_on_the_g1(
    robot: Robot, description: RobotDescription, pairs: list[tuple[str, str]], measure: Measure
) -> None:
    scene = MujocoScene(description)
    for q, waist in random_postures(robot, 50, seed=3):
        distances, _ = measure(q, waist)
        assert np.allclose(distances.ravel(), scene.distances(q, waist, pairs), rtol=0.0, atol=1e-9)
        assert not np.allclose(distances.ravel(), scene.distances(q, 0.0 * waist, pairs), rtol=0.0, atol=1e-3)


def test_functions_of_all_ends_give_the_same(robot: Robot, model: CollisionModel, measure: Measure) -> None:
    all_of, d = clearances(model), ca.SX.sym("d", len(model.pairs))
    least = ca.Function("least", [d], list(smallest(d)))
    for q, waist in random_postures(robot, 20, seed=4):
        distances, ends = measure(q, waist)
        assert np.allclose(np.array(all_of(ends)), distances, rtol=0.0, atol=1e-12)
        distance, pair = (float(output) for output in least(all_of(ends)))
        assert distance == pytest.approx(distances.min(), abs=1e-12)
        assert int(pair) == distances.argmin()


def gradients(robot: Robot, model: CollisionModel, forget_origins: bool = False) -> Measure:
    """(q, waist) -> (Jacobian of the distances, distances of the axes)."""
    q, base_ends, poses = symbols_of(robot, model)
    segments, lines = capsule_ends(model, *poses, base_ends), ca.horzcat(*map(joint_lines, poses))
    if forget_origins:
        lines[3:, :] = 0.0
    near = [closest(segments[a], segments[b]) for a, b in model.pairs]
    proximity = Proximity.of(robot)
    moves = [proximity.moves(k, robot.arms) for k in range(len(model.pairs))]
    rows = [pair_gradient(where, lines, ca.SX(counts)).T for where, counts in zip(near, moves, strict=True)]
    outputs = [ca.vertcat(*rows), ca.vertcat(*(where.distance for where in near))]
    return numbers_of(robot, ca.Function("gradients", [q, base_ends], outputs))


def finite_differences(robot: Robot, measure: Measure, q: np.ndarray, waist: np.ndarray) -> np.ndarray:
    step = 1e-6 * np.eye(robot.nq)
    columns = [(measure(q + h, waist)[0] - measure(q - h, waist)[0]) / 2e-6 for h in step]
    return np.concatenate(columns, axis=1)


def test_gradients_match_finite_differences(robot: Robot, model: CollisionModel, measure: Measure) -> None:
    evaluate, wrong = gradients(robot, model), gradients(robot, model, forget_origins=True)
    for q, waist in random_postures(robot, 20, seed=5):
        expected = finite_differences(robot, measure, q, waist)
        jacobian, axes = evaluate(q, waist)
        smooth = axes.ravel() > 1e-3  # Nearer than that the normal turns within the step of the differences.
        assert smooth.sum() > 0.9 * len(model.pairs)
        assert np.allclose(jacobian[smooth], expected[smooth], rtol=0.0, atol=1e-6)
        assert not np.allclose(wrong(q, waist)[0][smooth], expected[smooth], rtol=0.0, atol=1e-2)


def test_gradient_is_defined_in_penetration_and_zero_where_axes_meet(robot: Robot, model: CollisionModel) -> None:
    evaluate = gradients(robot, model)
    for q, waist in random_postures(robot, 200, seed=6):
        jacobian, axes = evaluate(q, waist)
        assert np.isfinite(jacobian).all()
        assert np.isfinite(axes).all()
    a, b = (Segment(*map(ca.SX, (start, end - start, 4.0))) for start, end in ((-X, X), (-Y, Y)))
    assert ca.evalf(closest(a, b).normal).full().ravel().tolist() == [0.0, 0.0, 0.0]
