"""Symbolic LDL^T factorization of a small symmetric matrix, written out scalar by scalar."""

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Factors:
    """A = L D L^T with unit lower triangular L and diagonal D.

    Attributes:
        lower: Strictly lower part of L, row by row; row i has i scalars.
        pivots: Diagonal of D, n scalars; all positive exactly when A is positive definite.
    """

    lower: list[list[ca.SX]]
    pivots: list[ca.SX]

    @property
    def smallest_pivot(self) -> ca.SX:
        """The smallest of the pivots."""
        smallest = self.pivots[0]
        for pivot in self.pivots[1:]:
            smallest = ca.fmin(smallest, pivot)
        return smallest

    def solve(self, b: list[ca.SX]) -> list[ca.SX]:
        """Solve A x = b by substitution.

        Args:
            b: Right-hand side, n scalars.

        Returns:
            x, n scalars.
        """
        n = len(b)
        x: list[ca.SX] = []
        for i in range(n):
            x.append(b[i] - sum(self.lower[i][k] * x[k] for k in range(i)))
        x = [value / pivot for value, pivot in zip(x, self.pivots, strict=True)]
        for i in reversed(range(n)):
            for k in range(i + 1, n):
                x[i] -= self.lower[k][i] * x[k]
        return x


def factorize(A: list[list[ca.SX]]) -> Factors:
    """Factorize without pivoting, which is stable for positive definite matrices.

    Args:
        A: Symmetric matrix, n x n scalars; only its lower triangle is read.

    Returns:
        Its factors.
    """
    n = len(A)
    lower: list[list[ca.SX]] = [[] for _ in range(n)]
    scaled: list[list[ca.SX]] = [[] for _ in range(n)]  # L D, which serves a whole column
    pivots: list[ca.SX] = []
    for i in range(n):
        for k in range(i):
            value = A[i][k] - sum(scaled[i][m] * lower[k][m] for m in range(k))
            scaled[i].append(value)
            lower[i].append(value / pivots[k])
        pivots.append(A[i][i] - sum(scaled[i][m] * lower[i][m] for m in range(i)))
    return Factors(lower, pivots)
