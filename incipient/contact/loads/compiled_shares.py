"""The largest share of a load that contacts hold, compiled to machine code by numba.

The largest a with start + a change + null x in the friction cones, 0 <= a <= 1, by a primal-dual interior
point method for second-order cones with the scaling of Nesterov and Todd (1997) and the predictor and corrector of
Mehrotra (1992), as in Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010). It is the program of
`cones.largest_share`, whose setting up takes several times as long as solving it. Import this module only where it is
needed (see `compiled`).

Vectors have two entries for 1 - a and a, then three for each contact, whose cone is |(y, z)| <= x.
"""

import math

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.compiled import inner, largest, product, solved

STEPS = 40
CLOSED = 1e-14  # gap of values at which a program is solved
LENGTH = 0.995  # of a step, in the longest that stays within the cones
SMALLEST = 1e-300


@inner
def optimum(table: Floats, limits: Floats) -> tuple[Floats, float]:
    """The x with the largest last entry for which limits - table x is in the cones, and how far that may be off."""
    height, width = table.shape
    x, slack, dual = _first(table, limits)
    best, least = x.copy(), np.inf
    degree = 2 + (height - 2) // 3
    size, turn, centre = np.empty(height), np.empty(height), np.empty(height)
    scaled, wanted = np.empty(height), np.empty(height)
    for _ in range(STEPS):
        missed, lacking = _missed(table, limits, x, slack), _lacking(table, dual)
        gap = product(slack, dual)
        off = gap + (1.0 + largest(dual)) * largest(missed) + (1.0 + largest(x)) * largest(lacking)
        if not off < least:  # round-off leaves no better
            if off > 1e3 * least or not math.isfinite(off):
                break
        else:
            best[:], least = x, off
        if gap <= CLOSED:
            break
        if not _scale(slack, dual, size, turn, centre):
            break
        matrix = _normal(table, size, turn)
        for j in range(height):
            wanted[j] = -centre[j]
        step_s, step_z, _ = _direction(table, matrix, size, turn, missed, lacking, wanted, 1.0)
        part = min(_longest(slack, step_s), _longest(dual, step_z))
        keep = (1.0 - part) ** 3
        _apply(size, turn, step_s, True, scaled)
        first = scaled.copy()
        _apply(size, turn, step_z, False, scaled)
        _put_correction(centre, first, scaled, keep * gap / degree, wanted)
        step_s, step_z, step_x = _direction(
            table, matrix, size, turn, missed, lacking, wanted, 1.0 - keep
        )
        part = min(1.0, LENGTH * min(_longest(slack, step_s), _longest(dual, step_z)))
        for j in range(width):
            x[j] += part * step_x[j]
        for j in range(height):
            slack[j] += part * step_s[j]
            dual[j] += part * step_z[j]
    return best, least


@inner
def _first(table: Floats, limits: Floats) -> tuple[Floats, Floats, Floats]:
    """Unknowns, slacks and multipliers to begin with, the latter moved into their cones."""
    width = table.shape[1]
    square, goal = table.T @ table, np.zeros(width)
    goal[width - 1] = 1.0
    x = solved(square.copy(), table.T @ limits)
    slack, dual = limits - table @ x, table @ solved(square, goal)
    _move_inside(slack)
    _move_inside(dual)
    return x, slack, dual


@inner
def _move_inside(vector: Floats) -> None:
    least = min(vector[0], vector[1])
    for j in range(2, len(vector), 3):
        least = min(least, vector[j] - math.hypot(vector[j + 1], vector[j + 2]))
    if least <= 1e-3:
        vector[0] += 1.0 - least
        vector[1] += 1.0 - least
        for j in range(2, len(vector), 3):
            vector[j] += 1.0 - least


@inner
def _missed(table: Floats, limits: Floats, x: Floats, slack: Floats) -> Floats:
    """table x + slack - limits."""
    missed = slack - limits
    for j in range(len(slack)):
        missed[j] += product(table[j], x)
    return missed


@inner
def _lacking(table: Floats, dual: Floats) -> Floats:
    """table^T dual less the gradient of the last unknown."""
    lacking = np.zeros(table.shape[1])
    lacking[-1] = -1.0
    for j in range(len(dual)):
        for i in range(len(lacking)):
            lacking[i] += table[j, i] * dual[j]
    return lacking


@inner
def room(table: Floats, limits: Floats, x: Floats) -> float:
    """How far inside their cones the forces are: the least normal part less the shear."""
    least = np.inf
    for j in range(2, len(limits), 3):
        one, two = (
            limits[j + 1] - product(table[j + 1], x),
            limits[j + 2] - product(table[j + 2], x),
        )
        least = min(least, limits[j] - product(table[j], x) - math.hypot(one, two))
    return least


@inner
def _scale(slack: Floats, dual: Floats, size: Floats, turn: Floats, centre: Floats) -> bool:
    """Fill in the scaling W = size (2 turn turn^T - J) of each cone, and W dual = W^-1 slack; False: on an edge."""
    for j in range(2):
        if slack[j] <= 0.0 or dual[j] <= 0.0:
            return False
        size[j], centre[j] = math.sqrt(slack[j] / dual[j]), math.sqrt(slack[j] * dual[j])
    for j in range(2, len(slack), 3):
        s, z = _square(slack, j), _square(dual, j)
        if not (s > 0.0 and z > 0.0):
            return False
        s, z = math.sqrt(s), math.sqrt(z)
        along = slack[j] * dual[j] + slack[j + 1] * dual[j + 1] + slack[j + 2] * dual[j + 2]
        both = math.sqrt(2.0 * (1.0 + along / (s * z)))
        w = (slack[j] / s + dual[j] / z) / both
        over = 1.0 / math.sqrt(2.0 * (w + 1.0))
        size[j], turn[j] = math.sqrt(s / z), (w + 1.0) * over
        for i in (j + 1, j + 2):
            turn[i] = (slack[i] / s - dual[i] / z) / both * over
    _apply(size, turn, dual, False, centre)
    return True


@inner
def _square(vector: Floats, j: int) -> float:
    """x^2 - y^2 - z^2 of a cone, without cancelling."""
    shear = math.hypot(vector[j + 1], vector[j + 2])
    return (vector[j] - shear) * (vector[j] + shear)


@inner
def _apply(size: Floats, turn: Floats, vector: Floats, inverse: bool, result: Floats) -> None:
    """Fill in W vector, or its inverse."""
    for j in range(2):
        result[j] = vector[j] / size[j] if inverse else vector[j] * size[j]
    sign = -1.0 if inverse else 1.0
    for j in range(2, len(vector), 3):
        factor = 1.0 / size[j] if inverse else size[j]
        one, two, three = turn[j], sign * turn[j + 1], sign * turn[j + 2]
        along = 2.0 * (one * vector[j] + two * vector[j + 1] + three * vector[j + 2])
        a, b, c = vector[j], vector[j + 1], vector[j + 2]
        result[j] = factor * (along * one - a)
        result[j + 1] = factor * (along * two + b)
        result[j + 2] = factor * (along * three + c)


@inner
def _normal(table: Floats, size: Floats, turn: Floats) -> Floats:
    """table^T W^-2 table."""
    height, width = table.shape
    scaled, column = np.empty((width, height)), np.empty(height)
    for i in range(width):
        for j in range(height):
            column[j] = table[j, i]
        _apply(size, turn, column, True, scaled[i])
    matrix = np.empty((width, width))
    for i in range(width):
        for j in range(i + 1):
            matrix[i, j] = product(scaled[i], scaled[j])
            matrix[j, i] = matrix[i, j]
    return matrix


@inner
def _direction(
    table: Floats,
    matrix: Floats,
    size: Floats,
    turn: Floats,
    missed: Floats,
    lacking: Floats,
    wanted: Floats,
    share: float,
) -> tuple[Floats, Floats, Floats]:
    """The Newton step of slacks, multipliers and unknowns that takes away a share of what is missed and lacking.

    wanted: scaled slack and multiplier steps together.
    """
    height, width = table.shape
    scaled, both, step_s, step_z = (
        np.empty(height),
        np.empty(height),
        np.empty(height),
        np.empty(height),
    )
    _apply(size, turn, missed, True, scaled)
    for j in range(height):
        scaled[j] = share * scaled[j] + wanted[j]
    _apply(size, turn, scaled, True, both)
    right = np.empty(width)
    for i in range(width):
        right[i] = -share * lacking[i]
        for j in range(height):
            right[i] -= table[j, i] * both[j]
    step_x = solved(matrix.copy(), right)
    for j in range(height):
        step_s[j] = -share * missed[j] - product(table[j], step_x)
    _apply(size, turn, step_s, True, scaled)
    for j in range(height):
        scaled[j] = wanted[j] - scaled[j]
    _apply(size, turn, scaled, True, step_z)
    return step_s, step_z, step_x


@inner
def _put_correction(
    centre: Floats, first: Floats, second: Floats, aim: float, wanted: Floats
) -> None:
    """Fill in the u with centre o u = -centre o centre - first o second + aim e, o being the cones' product."""
    for j in range(2):
        wanted[j] = (aim - first[j] * second[j]) / centre[j] - centre[j]
    for j in range(2, len(centre), 3):
        a, b, c = centre[j], centre[j + 1], centre[j + 2]
        one = (
            aim - first[j] * second[j] - first[j + 1] * second[j + 1] - first[j + 2] * second[j + 2]
        )
        two = -first[j] * second[j + 1] - second[j] * first[j + 1]
        three = -first[j] * second[j + 2] - second[j] * first[j + 2]
        along = (a * one - b * two - c * three) / max(_square(centre, j), SMALLEST)
        wanted[j] = along - a
        wanted[j + 1] = (two - along * b) / a - b
        wanted[j + 2] = (three - along * c) / a - c


@inner
def _longest(vector: Floats, step: Floats) -> float:
    """The longest step, at most one, with which a vector stays in the cones."""
    part = 1.0
    for j in range(2):
        if step[j] < 0.0:
            part = min(part, -vector[j] / step[j])
    for j in range(2, len(vector), 3):
        a, c = _square(step, j), max(_square(vector, j), 0.0)
        b = vector[j] * step[j] - vector[j + 1] * step[j + 1] - vector[j + 2] * step[j + 2]
        root = b * b - a * c
        if root >= 0.0:
            root = math.sqrt(root) - b
            if root > 0.0:
                part = min(part, c / root)
    return part
