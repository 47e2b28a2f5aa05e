"""Batched interior-point method for max s such that G f + s flow + weight = 0, f in the friction cones K.

The homogeneous self-dual embedding a x = b tau, a^T y + z = c tau, b.y - c.x = kappa with x, z in K
and tau, kappa >= 0 is solved as in Vandenberghe, The CVXOPT linear and quadratic cone program
solvers (2010), with orthonormalised rows; the first `linear` entries of a vector are non-negative,
the others triples |(y, z)| <= x.
"""

import math

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.contact.kernels import Kernel, add, dot, largest, length

TOLERANCE = 1e-9  # negligible dimensionless imbalance, or distance outside a cone
ITERATIONS = 60
CLOSED = 1e-13  # duality gap of a solved program
CERTIFIED = 1e-11  # residual of a certificate of infeasibility or unboundedness
ROUND_OFF = 1e-15  # of a certificate's equations
RANK = 1e-7  # relative to the largest: smaller singular values of the wrenches count as zero
OPTIMAL, INFEASIBLE, UNBOUNDED, UNANSWERED = 0, 1, 2, 3  # of a program
UNHELD, HELD, FAILED = 0, 1, 2  # state of the weight; FAILED: a program was not solved


def interval_rows(
    columns: Floats, flow: Floats, weight: Floats, linear: int
) -> tuple[Floats, Floats, Integers, Floats]:
    """Balanced factors (low, high) and state of the weight, (n,), and forces (n, h) of n problems.

    columns (n, m, h): wrenches of unit cone forces; flow, weight (n, m): of length one, or zero.
    """
    count, _, width = columns.shape
    low, high, weight_state = np.empty(count), np.empty(count), np.empty(count, np.int64)
    forces = np.zeros((count, width))
    for i in range(count):
        low[i], high[i], weight_state[i] = _interval(
            columns[i], flow[i], weight[i], linear, forces[i]
        )
    return low, high, weight_state, forces


def _interval(
    columns: Floats, flow: Floats, weight: Floats, linear: int, forces: Floats
) -> tuple[float, float, int]:
    """Smallest and largest balanced factor of the flow, NaN if none, and the state of the weight.

    Fills in `forces` (h,) at the largest factor, in units of the weight, or of the flow without it.
    """
    has_flow = largest(flow) > 0.0
    turns, sizes, rows = np.linalg.svd(columns, False)
    rank = int((sizes > RANK * sizes[0]).sum())
    ways, q = turns[:, :rank].copy(), rows[:rank].copy()
    # Nearly coincident contacts balance loads up to that length, which is neglected.
    fits = TOLERANCE + (sizes[rank] if rank < len(sizes) else 0.0)
    f, w = flow @ ways, weight @ ways
    flow_left, weight_left = flow - ways @ f, weight - ways @ w
    flow_missed, weight_missed = length(flow_left), length(weight_left)
    f, w = f / sizes[:rank], w / sizes[:rank]
    state = _balanced(q, w, linear, forces) if weight_missed <= fits else UNHELD
    low, high = np.nan, np.nan
    if not has_flow:
        high = np.inf
    elif state == UNHELD and flow_missed > fits:  # forces and flow are independent
        factor = -dot(flow_left, weight_left) / flow_missed**2
        add(weight_left, factor, flow_left)
        if factor > 0.0 and length(weight_left) <= fits * (1.0 + factor):
            balanced = _balanced(q, w + factor * f, linear, forces)
            if balanced == HELD:
                low, high = factor, factor
            elif balanced == FAILED:
                state = FAILED
    elif state != FAILED and max(flow_missed, weight_missed) <= fits:
        state, low, high = _ends(q, f, w, linear, state, forces)
    if state == HELD:
        return 0.0, high if high > 0.0 else 0.0, HELD
    return low, high if low >= 0.0 else np.nan, state


def _ends(
    q: Floats, f: Floats, w: Floats, linear: int, state: int, forces: Floats
) -> tuple[int, float, float]:
    """State of the weight, and smallest and largest factor of the flow that rows q can balance."""
    f_size, w_size = length(f), length(w)
    if w_size == 0.0:
        flow_state = _balanced(q, f, linear, forces)
        forces[:] = 0.0
        if flow_state == FAILED:
            return FAILED, np.nan, np.nan
        return state, 0.0, np.inf if flow_state == HELD else 0.0
    table, target, answer = np.column_stack((f / f_size, q)), -w / w_size, forces.copy()
    unit = w_size / f_size
    status, value = _conic(table, target, -1.0, linear + 1, forces)
    if status == INFEASIBLE:
        forces[:] = answer
        return state, np.nan, np.nan
    high = np.inf if status == UNBOUNDED else max(-value, 0.0) * unit
    # Beyond that, factors are infinite if the contacts balance the flow's load alone.
    if high > 1e6 and (status == UNBOUNDED or _balanced(q, f, linear, answer) == HELD):
        high = np.inf
    else:
        _balance(q, f * high + w, forces, w_size)
    low = 0.0
    if state == UNHELD and status != UNANSWERED:
        status, low = _conic(table, target, 1.0, linear + 1, answer)
    return (FAILED if status == UNANSWERED else state), max(low, 0.0) * unit, high


def _balance(q: Floats, wrench: Floats, forces: Floats, unit: float) -> None:
    forces *= unit
    for i in range(len(q)):
        add(forces, -wrench[i] - dot(q[i], forces), q[i])


def _balanced(q: Floats, wrench: Floats, linear: int, forces: Floats) -> int:
    """Whether forces (h,) inside the cones, filled in, balance a wrench: HELD, UNHELD or FAILED.

    The shortest forces if inside, otherwise max m such that f - m e is in the cones with axes e.
    """
    size = length(wrench)
    forces[:] = 0.0
    if size == 0.0:
        return HELD
    for i in range(len(q)):
        add(forces, -wrench[i], q[i])
    inside = _cone_margin(forces, linear)
    if inside >= 0.0:
        return HELD
    axes, width = np.zeros(len(forces)), len(forces)
    axes[:linear], axes[linear::3] = 1.0, 1.0
    for _ in range(12):  # alternating projections onto cones and equilibrium
        _push_inside(forces, linear, 0.02 * size)
        _balance(q, wrench, forces, 1.0)
        inside = _cone_margin(forces, linear)
        if inside >= 0.0:
            return HELD
    push = q @ axes
    most = length(push)
    if most <= RANK * width:  # the axes balance one another: add such forces
        add(forces, -inside, axes)
        return HELD
    table, answer = np.column_stack((-push / most, q)), np.empty(width)
    status, value = _conic(table, -wrench / size, 1.0, linear + 1, answer)
    if status != OPTIMAL:
        return FAILED
    forces[:] = answer
    add(forces, -value / most, axes)
    _balance(q, wrench, forces, size)
    return HELD if value <= TOLERANCE * most else UNHELD


def _push_inside(forces: Floats, linear: int, margin: float) -> None:
    for j in range(linear):
        forces[j] = max(forces[j], margin)
    for j in range(linear, len(forces), 3):
        normal = forces[j] - margin
        shear = max(_shear(forces, j), 1e-300)
        if shear > normal:
            size = max(0.5 * (normal + shear), 0.0)
            forces[j] = size + margin
            forces[j + 1] *= size / shear
            forces[j + 2] *= size / shear


def _conic(a: Floats, b: Floats, cost: float, linear: int, answer: Floats) -> tuple[int, float]:
    """Minimise cost x[0] subject to a x = b, x in the cones; returns status and dual value, fills in x[1:].

    UNANSWERED: the dual program did not converge.
    """
    m, n = a.shape
    degree, q = 1.0 + linear + (n - linear) // 3, np.empty((m, n))
    x, z, left, size, turn = np.zeros((5, n))
    x[:linear], x[linear::3] = 1.0, 1.0
    z[:] = x
    v, u, y = np.empty((6, n)), np.empty((4, m)), np.zeros(m)
    dx, _, missed, lam, _, _ = v
    dy, beta, rho, _ = u
    tau, kappa, nearest, closest, value = 1.0, 1.0, np.inf, np.inf, 0.0
    for _iteration in range(ITERATIONS):
        for j in range(n):
            missed[j] = -z[j]
        missed[0] += cost * tau
        for i in range(m):
            rho[i] = b[i] * tau - dot(a[i], x)
            add(missed, -y[i], a[i])
        cx, by, gap = cost * x[0], dot(b, y), dot(x, z) + tau * kappa
        lacking, wrong = largest(rho), largest(missed)
        if tau <= -cx * CERTIFIED and lacking <= ROUND_OFF - cx * CERTIFIED:
            return UNBOUNDED, -np.inf
        # The certificate -a^T y = z - c tau may be in the cones although tau is not small; it excludes solutions
        # smaller than 1e10.
        within = wrong + max(cost * tau - z[0], 0.0)
        certain = tau <= by * CERTIFIED and wrong <= ROUND_OFF + by * CERTIFIED
        if certain or (tau <= by and within <= by * 1e-10):
            return INFEASIBLE, np.inf
        error = (wrong + gap / tau) / (tau + abs(by))
        if error + lacking / tau < nearest:
            nearest = error + lacking / tau
            answer[:] = x[1:] / tau
        if error < closest:
            closest, value = error, by / tau
        if error <= CLOSED or error > 1e3 * closest < 1e-6:
            break
        if not _scaling(x, z, linear, size, turn):
            break
        left[:] = missed
        _scale(size, turn, linear, z, lam)
        _scale(size, turn, linear, missed, missed)
        for i in range(m):
            _scale(size, turn, linear, a[i], q[i])
        sides = np.eye(m, m + 2)
        sides[:, m], sides[:, m + 1] = b, rho
        _orthonormalise(q, sides)
        beta[:], rho[:] = sides[:, m], sides[:, m + 1]
        point = tau, kappa, by - cx - kappa, gap / degree
        step, eta, dtau, dkappa = _direction(v, u, q, cost * size[0], linear, point)
        _scale(size, turn, linear, dx, dx)
        add(x, step, dx)
        for i in range(m):
            add(y, step * dy[i], sides[i])
        tau, kappa = tau + step * dtau, kappa + step * dkappa
        # From the second equation: a step scaled by T^-1 adds the round-off of T.
        for j in range(n):
            z[j] = (step * eta - 1.0) * left[j]
        z[0] += cost * tau
        for i in range(m):
            add(z, -y[i], a[i])
    return (OPTIMAL if closest <= 1e-6 else UNANSWERED), value


def _direction(
    v: Floats,
    u: Floats,
    q: Floats,
    c: float,
    linear: int,
    point: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    """Predictor-corrector steps except that of z; returns step length, eta, steps of tau and kappa.

    q (m, n): orthonormal rows of the program in scaled variables, with cost c of the first one and
    right-hand side beta; v (6, n): steps of x and z, dual residual, lambda, two work vectors;
    u (4, m): step of y, beta, primal residual, work vector; point: tau, kappa, residual of the
    third equation, gap over the degree of the cones.
    """
    dx, dz, missed, lam, goal, p = v
    dy, beta, rho, pull = u
    tau, kappa, rest, centred = point
    p[:] = 0.0
    p[0] = -c
    for i in range(len(q)):
        pull[i] = beta[i] + q[i, 0] * c
        add(p, pull[i], q[i])
    dx[:], dz[:], dtau, dkappa, eta, target, step = 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0
    slope = dot(p, p) + kappa / tau
    for _pass in range(2):
        _correct(lam, dx, dz, linear, target, goal)
        change = target - tau * kappa - dtau * dkappa
        for j in range(len(dz)):
            dz[j] = goal[j] - eta * missed[j]
            dx[j] = dz[j]
        for i in range(len(q)):
            dy[i] = eta * rho[i] - dot(q[i], dz)
            add(dx, dy[i], q[i])
        dtau = (c * dx[0] - dot(beta, dy) + change / tau - eta * rest) / slope
        dkappa = (change - kappa * dtau) / tau
        add(dx, dtau, p)
        add(dy, dtau, pull)
        for j in range(len(dz)):
            dz[j] = goal[j] - dx[j]
        step = min(_longest(lam, dx, linear), _longest(lam, dz, linear))
        step = min(step, -tau / min(dtau, -0.5 * tau), -kappa / min(dkappa, -0.5 * kappa))
        if eta == 1.0:
            eta = 1.0 - (1.0 - min(step, 1.0)) ** 3
            target = (1.0 - eta) * centred
    return min(1.0, 0.998 * step), eta, dtau, dkappa


def _scaling(x: Floats, z: Floats, linear: int, size: Floats, turn: Floats) -> bool:
    """Scaling T = size (2 turn turn^T - J) of each cone with T z = T^-1 x; False on the boundary."""
    for i in range(linear):
        if x[i] <= 0.0 or z[i] <= 0.0:
            return False
        size[i] = math.sqrt(x[i] / z[i])
    for i in range(linear, len(x), 3):
        of_x, of_z = _determinant(x, i), _determinant(z, i)
        if not (of_x > 0.0 and of_z > 0.0):
            return False
        of_x, of_z = math.sqrt(of_x), math.sqrt(of_z)
        along = (x[i] * z[i] + x[i + 1] * z[i + 1] + x[i + 2] * z[i + 2]) / (of_x * of_z)
        both = math.sqrt(2.0 * (1.0 + along))
        first = (x[i] / of_x + z[i] / of_z) / both
        over = 1.0 / math.sqrt(2.0 * (first + 1.0))
        size[i], turn[i] = math.sqrt(of_x / of_z), (first + 1.0) * over
        for j in (i + 1, i + 2):
            turn[j] = (x[j] / of_x - z[j] / of_z) / both * over
    return True


def _scale(size: Floats, turn: Floats, linear: int, vector: Floats, out: Floats) -> None:
    for i in range(linear):
        out[i] = vector[i] * size[i]
    for i in range(linear, len(vector), 3):
        normal, first, second = vector[i], vector[i + 1], vector[i + 2]
        along = 2.0 * (turn[i] * normal + turn[i + 1] * first + turn[i + 2] * second)
        out[i] = size[i] * (along * turn[i] - normal)
        out[i + 1] = size[i] * (along * turn[i + 1] + first)
        out[i + 2] = size[i] * (along * turn[i + 2] + second)


def _correct(lam: Floats, p: Floats, q: Floats, linear: int, target: float, out: Floats) -> None:
    """Solve lam o u = target e - lam o lam - p o q for u, with the cones' product o."""
    for i in range(linear):
        out[i] = (target - p[i] * q[i]) / lam[i] - lam[i]
    for i in range(linear, len(lam), 3):
        a, b, c = lam[i], lam[i + 1], lam[i + 2]
        normal = target - p[i] * q[i] - p[i + 1] * q[i + 1] - p[i + 2] * q[i + 2]
        first = -p[i] * q[i + 1] - q[i] * p[i + 1]
        second = -p[i] * q[i + 2] - q[i] * p[i + 2]
        along = (a * normal - b * first - c * second) / max(_determinant(lam, i), 1e-300)
        out[i] = along - a
        out[i + 1] = (first - along * b) / a - b
        out[i + 2] = (second - along * c) / a - c


def _longest(x: Floats, step: Floats, linear: int) -> float:
    most = 2.0
    for i in range(linear):
        if step[i] < 0.0:
            most = min(most, -x[i] / step[i])
    for i in range(linear, len(x), 3):
        a, c = _determinant(step, i), max(_determinant(x, i), 0.0)
        b = x[i] * step[i] - x[i + 1] * step[i + 1] - x[i + 2] * step[i + 2]
        root = math.sqrt(max(b * b - a * c, 0.0)) - b
        if root > 0.0 and (a < 0.0 or b < 0.0):
            most = min(most, c / root)
    return most


def _cone_margin(x: Floats, linear: int) -> float:
    least = np.inf
    for i in range(linear):
        least = min(least, x[i])
    for i in range(linear, len(x), 3):
        least = min(least, x[i] - _shear(x, i))
    return least


def _shear(x: Floats, i: int) -> float:
    return math.sqrt(x[i + 1] * x[i + 1] + x[i + 2] * x[i + 2])


def _determinant(x: Floats, i: int) -> float:
    """x^2 - y^2 - z^2 of a triple without cancellation."""
    shear = _shear(x, i)
    return (x[i] - shear) * (x[i] + shear)


def _orthonormalise(rows: Floats, sides: Floats) -> None:
    """Make rows (m, h) orthonormal in place; rows of `sides` (m, e) are combined alike."""
    for i in range(len(rows)):
        after, before = length(rows[i]), np.inf
        while after < 0.5 * before:  # again after cancellation
            before = after
            for j in range(i):
                part = dot(rows[j], rows[i])
                add(rows[i], -part, rows[j])
                add(sides[i], -part, sides[j])
            after = length(rows[i])
        rows[i] /= after
        sides[i] /= after


INTERVALS = Kernel(interval_rows)
