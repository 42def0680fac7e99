"""The symbolic factorization against numpy."""

import casadi as ca
import numpy as np
import pytest

from ik_service.ldl import factorize


def _solver(n: int) -> ca.Function:
    A, b = ca.SX.sym("A", n, n), ca.SX.sym("b", n)
    factors = factorize([[A[i, j] for j in range(n)] for i in range(n)])
    solution = ca.vertcat(*factors.solve(ca.vertsplit(b)))
    return ca.Function("solve", [A, b], [solution, factors.smallest_pivot])


@pytest.mark.parametrize("n", [1, 2, 5, 7])
def test_solves_positive_definite_systems(n: int) -> None:
    rng, solve = np.random.default_rng(n), _solver(n)
    for _ in range(20):
        root = rng.normal(size=(n, n))
        A, b = root @ root.T + 0.1 * np.eye(n), rng.normal(size=n)
        x, smallest_pivot = solve(A, b)
        assert np.allclose(np.array(x).ravel(), np.linalg.solve(A, b), rtol=1e-8, atol=1e-10)
        assert float(smallest_pivot) > 0.0


def test_smallest_pivot_tells_indefinite_matrices() -> None:
    rng, solve = np.random.default_rng(0), _solver(6)
    signs = set()
    for _ in range(200):
        A = rng.normal(size=(6, 6))
        A = A + A.T + 6.0 * rng.uniform() * np.eye(6)
        definite = bool(np.linalg.eigvalsh(A).min() > 0.0)
        signs.add(definite)
        assert (float(solve(A, np.ones(6))[1]) > 0.0) == definite
    assert signs == {True, False}
