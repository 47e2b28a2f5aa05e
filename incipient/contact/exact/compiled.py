"""The two inner loops of incipient motions in space, compiled to machine code by numba.

Both are Newton's method for a few dozen unknowns at most, where numpy's calls take longer than the arithmetic in
them. Import this module only where it is needed: numba takes a while to import, and compiling, once for each
version of this file, some seconds. All that is compiled is kept in `__pycache__` here, or in the user's cache.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from incipient.arrays import Floats

CONVERGED = 1e-12  # of Coulomb's law, relative to load and contact forces
STALLED = 1e-11  # the same after one more step: round-off leaves no better
HALVINGS = 4  # sizes of a step that are tried
FALL = 0.1  # part of a step by which the merit has to fall
SHIFT = 1e-11  # of the derivative, which is singular where contact forces are not unique

BALANCED = 1e-13  # of the least forces: what may be missed of the wrench, relative to the forces
BALANCE_STEPS = 25
BALANCE_HALVINGS = 10
CURVATURE_SHIFT = 1e-3  # of the curvature, which may be singular, by this much of what is missed
LEAST_SHIFT, FIRST_SHIFT = 1e-13, 1e-10  # the least of it, and that of the first step

NOTHING = 1e-300  # divided by instead of zero

# What kernels call is compiled into them, and cannot be called from Python: without that it compiles faster.
# Divided by zero is infinite, as in numpy.
inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call and keep the result for other processes, if there is a place for it."""
    try:
        return njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function)
    except (
        RuntimeError
    ):  # numba finds no directory that can be written: compiled in every process then
        return njit(error_model="numpy", no_cfunc_wrapper=True)(function)


@inner
def solved(matrix: Floats, right: Floats) -> Floats:
    """The x (n,) of matrix x = right, by Gaussian elimination with partial pivoting; both are overwritten.

    An unknown without pivot, on which nothing depends, is zero.
    """
    for column in range(len(right)):
        _put_pivot(matrix, right, column)
        if matrix[column, column] != 0.0:
            _eliminate(matrix, right, column)
    for row in range(len(right) - 1, -1, -1):
        for other in range(row + 1, len(right)):
            right[row] -= matrix[row, other] * right[other]
        right[row] = right[row] / matrix[row, row] if matrix[row, row] != 0.0 else 0.0
    return right


@inner
def _put_pivot(matrix: Floats, right: Floats, column: int) -> None:
    """Exchange rows such that the largest entry at or below the diagonal is on it."""
    pivot = column
    for row in range(column + 1, len(right)):
        if abs(matrix[row, column]) > abs(matrix[pivot, column]):
            pivot = row
    if pivot != column:
        right[pivot], right[column] = right[column], right[pivot]
        for entry in range(column, len(right)):
            held = matrix[column, entry]
            matrix[column, entry] = matrix[pivot, entry]
            matrix[pivot, entry] = held


@inner
def _eliminate(matrix: Floats, right: Floats, column: int) -> None:
    """Make a column zero below the diagonal."""
    for row in range(column + 1, len(right)):
        factor = matrix[row, column] / matrix[column, column]
        if factor != 0.0:
            right[row] -= factor * right[column]
            for entry in range(column + 1, len(right)):
                matrix[row, entry] -= factor * matrix[column, entry]


@inner
def product(one: Floats, two: Floats) -> float:
    """The scalar product."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * two[i]
    return total


@inner
def _combine(start: Floats, rows: Floats, factors: Floats, total: Floats) -> None:
    """Fill in start (n,) plus the sum of factors (m,) times rows (m, n)."""
    for j in range(len(total)):
        total[j] = start[j]
    for i in range(len(factors)):
        for j in range(len(total)):
            total[j] += factors[i] * rows[i, j]


@inner
def _put_moved(start: Floats, part: float, change: Floats, end: Floats) -> None:
    """Fill in start - part change."""
    for j in range(len(end)):
        end[j] = start[j] - part * change[j]


@inner
def largest(vector: Floats) -> float:
    """The size of the largest entry."""
    largest = 0.0
    for value in vector:
        largest = max(largest, abs(value))
    return largest


@inner
def _add_square(square: Floats, vector: Floats) -> None:
    """Add vector vector^T."""
    for i in range(len(vector)):
        for j in range(len(vector)):
            square[i, j] += vector[i] * vector[j]


class Coulomb(NamedTuple):
    """Coulomb's law at k contacts: f = projection of f onto + offset, (3k, 3k) and (3k,); see `spatial_motion`."""

    onto: Floats
    offset: Floats
    friction: float


@kernel
def coulomb_forces(
    onto: Floats, offset: Floats, friction: float, starts: Floats, few: int, many: int
) -> Floats:
    """The forces (s', 3k) that obey Coulomb's law, by damped Newton steps from all starts (s, 3k).

    `few` steps, and up to `many` if no start has led to a solution by then.
    """
    law = Coulomb(onto, offset, friction)
    force, trial, miss, merit = _first(law, starts)
    done, near = np.zeros(len(starts), dtype=np.bool_), np.zeros(len(starts), dtype=np.bool_)
    solutions, count = np.empty_like(starts), 0
    for step in range(many):
        if count == len(starts) or (step == few and count > 0):
            break
        for i in range(len(starts)):
            if done[i]:
                continue
            size, was_near = max(1.0, product(force[i], force[i])), near[i]
            near[i] = merit[i] <= STALLED**2 * size
            done[i] = merit[i] <= CONVERGED**2 * size or (was_near and near[i])
            if done[i]:
                _put_moved(force[i], 1.0, miss[i], solutions[count])
                count += 1
            else:
                merit[i] = _advance(law, force[i], trial[i], miss[i], merit[i])
    return solutions[:count]


@inner
def _first(law: Coulomb, starts: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The law at the starts: forces, trials and misses (s, 3k), and merits (s,)."""
    force, trial, miss = starts.copy(), np.empty_like(starts), np.empty_like(starts)
    merit = np.empty(len(starts))
    for i in range(len(starts)):
        merit[i] = _evaluate(law, force[i], trial[i], miss[i])
    return force, trial, miss, merit


@inner
def _evaluate(law: Coulomb, force: Floats, trial: Floats, miss: Floats) -> float:
    """The merit of forces (3k,): the square of what they miss; `trial` f - r A and `miss` (3k,) are filled in."""
    _combine(law.offset, law.onto, force, trial)
    for normal in range(0, len(force), 3):
        pressure, kept, _ = _projection(law.friction, trial, normal)
        miss[normal] = force[normal] - pressure
        miss[normal + 1] = force[normal + 1] - kept * trial[normal + 1]
        miss[normal + 2] = force[normal + 2] - kept * trial[normal + 2]
    return product(miss, miss)


@inner
def _projection(friction: float, trial: Floats, normal: int) -> tuple[float, float, float]:
    """The projection onto the cone of one contact: pressure, the share of the shear that is kept, the shear's size.

    All of the shear is kept, 1, where the contact holds; less where it slips.
    """
    shear = max(math.hypot(trial[normal + 1], trial[normal + 2]), NOTHING)
    pressure = max(trial[normal], 0.0)
    return pressure, min(friction * pressure / shear, 1.0), shear


@kernel
def coulomb_derivative(onto: Floats, offset: Floats, friction: float, force: Floats) -> Floats:
    """The derivative (3k, 3k) of what forces (3k,) miss by the forces, with a shift."""
    law, trial, miss = Coulomb(onto, offset, friction), np.empty_like(force), np.empty_like(force)
    _evaluate(law, force, trial, miss)
    return _derivative(law, trial)


@inner
def _derivative(law: Coulomb, trial: Floats) -> Floats:
    """Generalised Jacobian (3k, 3k) of the miss at `trial`; at kinks one of the two one-sided derivatives."""
    size = len(trial)
    derivative = np.zeros((size, size))
    for normal in range(0, size, 3):
        pressure, kept, shear = _projection(law.friction, trial, normal)
        if pressure > 0.0:
            _by_pressure(law, trial, normal, kept, shear, derivative)
        _by_shear(law, trial, normal, kept, shear, derivative)
    for i in range(size):
        derivative[i, i] += 1.0 + SHIFT
    return derivative


@inner
def _by_pressure(
    law: Coulomb, trial: Floats, normal: int, kept: float, shear: float, derivative: Floats
) -> None:
    """Take away the derivative of the projection by the normal trial, which widens the disc."""
    one, two = normal + 1, normal + 2
    wider = law.friction / shear if kept < 1.0 else 0.0
    for j in range(len(trial)):
        change = law.onto[j, normal]
        derivative[normal, j] -= change
        derivative[one, j] -= wider * trial[one] * change
        derivative[two, j] -= wider * trial[two] * change


@inner
def _by_shear(
    law: Coulomb, trial: Floats, normal: int, kept: float, shear: float, derivative: Floats
) -> None:
    """Take away the derivative by the trial along the surface: of what slips the part along it is lost."""
    one, two = normal + 1, normal + 2
    slips = 1.0 if kept < 1.0 else 0.0
    along_one, along_two = slips * trial[one] / shear, slips * trial[two] / shear
    for j in range(len(trial)):
        change_one, change_two = law.onto[j, one], law.onto[j, two]
        longer = along_one * change_one + along_two * change_two
        derivative[one, j] -= kept * (change_one - along_one * longer)
        derivative[two, j] -= kept * (change_two - along_two * longer)


@inner
def _advance(law: Coulomb, force: Floats, trial: Floats, miss: Floats, merit: float) -> float:
    """Move forces by the largest part of a Newton step that lowers the merit enough, else by the best; in place."""
    change, start = solved(_derivative(law, trial), miss.copy()), force.copy()
    part, best, lowest = 1.0, 1.0, np.inf
    for _ in range(HALVINGS):
        _put_moved(start, part, change, force)
        tried = _evaluate(law, force, trial, miss)
        if tried < (1.0 - FALL * part) * merit:
            return tried
        if tried < lowest:
            best, lowest = part, tried
        part *= 0.5
    _put_moved(start, best, change, force)
    return _evaluate(law, force, trial, miss)


class Cones(NamedTuple):
    """Friction cones, or single edges of them (k, 3), and wrenches (3k, 6) of unit forces; see `least.Allowed`."""

    rows: Floats
    cosine: float
    sine: float
    slides: NDArray[np.bool_]
    edges: Floats


@kernel
def balancing_forces(
    rows: Floats,
    cosine: float,
    sine: float,
    slides: NDArray[np.bool_],
    edges: Floats,
    wrench: Floats,
) -> tuple[bool, Floats]:
    """Whether Newton's method finds the least forces (3k,) in the cones that balance a wrench (6,), and the forces.

    They are P(rows v) for the v that minimises |P(rows v)|^2 / 2 + wrench . v; steps are damped until that falls.
    """
    by = Cones(rows, cosine, sine, slides, edges)
    v, pulled, forces = _unlimited(rows, wrench), np.empty(len(rows)), np.empty(len(rows))
    missed = np.empty(6)
    value = _balance(by, wrench, v, pulled, forces, missed)
    for _ in range(BALANCE_STEPS):
        worst = largest(missed)
        if worst <= BALANCED * max(1.0, largest(forces)):
            return math.isfinite(value), forces
        curvature = _curvature(by, pulled)
        for i in range(6):
            curvature[i, i] += max(CURVATURE_SHIFT * worst, LEAST_SHIFT)
        change = solved(curvature, missed.copy())
        value = _descend(by, wrench, change, value, v, pulled, forces, missed)
    return False, forces


@inner
def _unlimited(rows: Floats, wrench: Floats) -> Floats:
    """The v (6,) of the least forces that balance a wrench if they may be anything, rows v."""
    square, right = np.zeros((6, 6)), np.empty(6)
    for row in rows:
        _add_square(square, row)
    for i in range(6):
        square[i, i] += FIRST_SHIFT
        right[i] = -wrench[i]
    return solved(square, right)


@inner
def _balance(
    by: Cones, wrench: Floats, v: Floats, pulled: Floats, forces: Floats, missed: Floats
) -> float:
    """The function at v (6,); `pulled` rows v, `forces` nearest to it, and the gradient `missed` are filled in."""
    for j in range(len(pulled)):
        pulled[j] = product(by.rows[j], v)
    for contact in range(len(by.slides)):
        inside, size, edge, _ = _cone(by, pulled, contact)
        for axis in range(3):
            j = 3 * contact + axis
            forces[j] = pulled[j] if inside else size * edge[axis]
    _combine(wrench, by.rows, forces, missed)
    return 0.5 * product(forces, forces) + product(wrench, v)


@inner
def _cone(
    by: Cones, pulled: Floats, contact: int
) -> tuple[bool, float, tuple[float, float, float], float]:
    """Whether a contact's force is in its cone, size and unit vector of the nearest on the edge, and its shear."""
    normal, one, two = pulled[3 * contact], pulled[3 * contact + 1], pulled[3 * contact + 2]
    shear = max(math.hypot(one, two), NOTHING)
    if by.slides[contact]:
        edge = (by.edges[contact, 0], by.edges[contact, 1], by.edges[contact, 2])
    else:
        edge = (by.cosine, by.sine * one / shear, by.sine * two / shear)
    size = max(edge[0] * normal + edge[1] * one + edge[2] * two, 0.0)
    return not by.slides[contact] and by.cosine * shear <= by.sine * normal, size, edge, shear


@inner
def _curvature(by: Cones, pulled: Floats) -> Floats:
    """The second derivative (6, 6) of the function."""
    curvature, way = np.zeros((6, 6)), np.empty(6)
    for contact in range(len(by.slides)):
        inside, size, edge, shear = _cone(by, pulled, contact)
        if inside:
            for j in range(3 * contact, 3 * contact + 3):
                _add_square(curvature, by.rows[j])
        elif size > 0.0:
            _put_wrench(by, contact, edge, way)
            _add_square(curvature, way)
            if not by.slides[contact]:  # across the edge the force turns with its shear
                turning = math.sqrt(size / (shear * by.sine))
                _put_wrench(by, contact, (0.0, -turning * edge[2], turning * edge[1]), way)
                _add_square(curvature, way)
    return curvature


@inner
def _put_wrench(by: Cones, contact: int, force: tuple[float, float, float], wrench: Floats) -> None:
    """Fill in the wrench (6,) of a force at a contact."""
    for i in range(6):
        wrench[i] = 0.0
        for axis in range(3):
            wrench[i] += force[axis] * by.rows[3 * contact + axis, i]


@inner
def _descend(
    by: Cones,
    wrench: Floats,
    change: Floats,
    value: float,
    v: Floats,
    pulled: Floats,
    forces: Floats,
    missed: Floats,
) -> float:
    """Move v against a change, halved until the function falls or its gradient halves; the function there."""
    start, part, tried = v.copy(), 1.0, value
    falling, enough = 1e-4 * product(missed, change), 0.25 * product(missed, missed)
    for _ in range(BALANCE_HALVINGS):
        _put_moved(start, part, change, v)
        tried = _balance(by, wrench, v, pulled, forces, missed)
        if tried < value - part * falling or product(missed, missed) < enough:
            break
        part *= 0.5
    return tried
