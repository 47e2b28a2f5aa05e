"""Questions to polyhedral friction cones: planar cases, no friction, infinite friction. Answers are exact.

Every force a contact can carry is a sum, with factors >= 0, of the few edges of its cone (`Grasp.fan`). What
contact forces can balance is then a polyhedral cone, and linear programs end at its vertices.
"""

import math

import numpy as np
from scipy.optimize import linprog, nnls

from incipient.arrays import Floats
from incipient.contact.exact.grasp import Grasp

EXACT = 1e-10  # residual, in numbers of order one, up to which a system counts as solved
CERTAIN = 1e-9  # cosine between a column and what is missed below which it counts as not positive
PIVOT = 1e-10  # factors below it, relative to the largest, count as zero
LAST = np.eye(7)[6]  # a wrench of zero, and one for the row below it
SOLVER = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def edges(grasp: Grasp, fan: Floats) -> Floats:
    """The wrenches (6, k g) of the g edges of all cones, contact by contact."""
    return np.asarray((grasp.matrix @ fan.T).reshape(6, -1))


def local(factors: Floats, fan: Floats) -> Floats:
    """The local forces (k, 3) of the factors on all edges."""
    return np.asarray(factors.reshape(-1, len(fan)) @ fan)


def combination(columns: Floats, target: Floats) -> Floats | None:
    """Factors >= 0, as few as possible not zero, whose sum of columns is the target, or None.

    Either answer is checked: what is missed by the best factors, if it is not nothing, has to be a direction
    against which no column points and the target does, which proves that there are none.
    """
    try:
        factors = nnls(columns, target)[0]
    except RuntimeError:  # it cycles, which it rarely does
        return _feasible(columns, target)
    missed = target - columns @ factors
    size = math.hypot(*missed)
    if size <= EXACT * max(1.0, math.hypot(*target)):
        return np.asarray(factors)
    return None if (missed @ columns).max() <= CERTAIN * size else _feasible(columns, target)


def largest_share(columns: Floats, flow: Floats, weight: Floats) -> tuple[float, Floats] | None:
    """The largest a in [0, 1] such that a flow + (1 - a) weight is balanced, and the factors; None: no a."""
    system = np.column_stack([columns, flow - weight])
    cost = np.zeros(system.shape[1])
    cost[-1] = -1.0
    bounds = [(0.0, None)] * columns.shape[1] + [(0.0, 1.0)]
    answer = linprog(cost, A_eq=system, b_eq=-weight, bounds=bounds, method="highs", options=SOLVER)
    if answer.x is None or not answer.success:
        return None
    factors = _polished(system, -weight, answer.x)
    return float(np.clip(factors[-1], 0.0, 1.0)), factors[:-1]


def has_share(columns: Floats, flow: Floats, weight: Floats) -> bool:
    """Whether a flow + b weight is balanced for any a, b >= 0 that are not both zero."""
    system = np.vstack([np.column_stack([columns, flow, weight]), np.zeros(columns.shape[1] + 2)])
    system[-1, -2:] = 1.0
    return combination(system, np.append(np.zeros(len(columns)), 1.0)) is not None


def beside(columns: Floats, ways: Floats) -> Floats:
    """Columns (d, n) of forces, and beside them errors: ways p (d, m) with p + q = 2, p, q >= 0, (d + m, n + 2 m)."""
    one, none = np.eye(ways.shape[1]), np.zeros((ways.shape[1], columns.shape[1]))
    return np.asarray(np.block([[columns, ways, np.zeros_like(ways)], [none, one, one]]))


def can_jam(columns: Floats, pressure: Floats) -> bool:
    """Whether forces on the edges, with pressure (e,) somewhere, balance one another."""
    return combination(np.vstack([columns, pressure]), LAST) is not None


def extent(columns: Floats, target: Floats, bounds: Floats, goal: Floats) -> list[Floats]:
    """The solutions x of columns x = target with bounds x >= 0 where goal . x is least and where it is largest.

    An end that is not bounded is left out; there is none if there is no solution.
    """
    limits = np.zeros(len(bounds))
    ends = (
        linprog(
            sign * goal, -bounds, limits, columns, target, (None, None), "highs", options=SOLVER
        )
        for sign in (1.0, -1.0)
    )
    return [np.asarray(end.x) for end in ends if end.success]


def _feasible(columns: Floats, target: Floats) -> Floats | None:
    """Factors >= 0 by linear programming, which is slower and surer."""
    answer = linprog(
        np.ones(columns.shape[1]), A_eq=columns, b_eq=target, method="highs", options=SOLVER
    )
    return np.asarray(answer.x) if answer.success else None


def _polished(system: Floats, target: Floats, answer: Floats) -> Floats:
    """The vertex of a linear program to round-off: its system solved again for factors not zero."""
    used = answer > PIVOT * answer.max()
    factors = np.zeros_like(answer)
    change = np.linalg.lstsq(system[:, used], target - system[:, used] @ answer[used], rcond=1e-13)[
        0
    ]
    factors[used] = answer[used] + change
    return factors if factors.min() >= 0.0 else answer
