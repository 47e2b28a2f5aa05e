"""The safety factor: how much the flow's load may grow before the contacts cannot balance it.

One conic program, max s such that G f + s flow + weight = 0 with f in the product of friction cones K, and one
solver for a single case and for millions: an interior-point method on the homogeneous self-dual embedding

    a x = b tau,   a^T y + z = c tau,   b.y - c.x = kappa,   x, z in K,   tau, kappa >= 0,

with the scaling of Nesterov and Todd (1997) and the predictor and corrector of Mehrotra (1992), as in Vandenberghe,
The CVXOPT linear and quadratic cone program solvers (2010). Whether a program has a solution, none or no largest one
follows from tau and kappa. The scaled rows are orthonormalised, so that Newton's matrix is never squared. The first
`linear` entries of a vector are non-negative, the others triples in the unit cone |(y, z)| <= x.
"""

import math
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.contact.problem import ContactProblem, Kernel, Load
from incipient.errors import ConvergenceError
from incipient.geometry.contacts import Contacts

TOLERANCE = 1e-9  # dimensionless imbalance, or distance outside a cone, that counts as none
NO_FORCE = (
    1e-7  # contact forces and cone margins below it, relative to the largest force, count as zero
)
ENDLESS = (
    1e6  # a dimensionless factor above it is infinite if the contacts balance the flow's load alone
)
ITERATIONS = 60
STEP = 0.998  # of the longest step inside the cones
CLOSED = 1e-13  # duality gap at which a program is solved
ANSWERED = 1e-8  # relative error of the dual value up to which it is an answer
CERTIFIED = 1e-11  # what a certificate of no, or no largest, solution may miss
PROJECTIONS, INSIDE = (
    12,
    0.02,
)  # between cones and equilibrium, before the conic program; the margin aimed at
ROUND_OFF = 1e-15  # of a certificate's equations
RANK = (
    1e-7  # of the largest row: a shorter row depends on the others, and balances up to its length
)
OPTIMAL, INFEASIBLE, UNBOUNDED, UNANSWERED = 0, 1, 2, 3  # of a program
UNHELD, HELD, FAILED = 0, 1, 2  # the weight in a row; or some program of the row is not answered


class SafetyStatus(Enum):
    """Why the safety factor is what it is."""

    CRITICAL = "a larger multiple of the flow's load is not balanced"
    UNLIMITED = "contact forces balance the flow's load at any size"
    NO_FLOW = "there is no flow load, and the weight is held"
    NO_RESERVE = "the weight is held, but no part of the flow's load"
    HELD_BY_FLOW = (
        "the weight alone is not held; with the flow's load at the factors of the interval it is"
    )
    UNHELD = "neither the weight alone nor any multiple of the flow's load with it is held"


class ConeState(Enum):
    """Where a contact force is in its friction cone."""

    UNLOADED = "no force"
    INSIDE = "inside the friction cone"
    EDGE = "on the edge of the friction cone"


@dataclass(frozen=True, eq=False)
class SafetyFactor:
    """The safety factor and the contact forces that show it.

    `value`: the largest s >= 0 such that forces in the friction cones balance weight + s times the flow's
    load; math.inf if there is no largest; 0 if the weight alone is not held. `interval`: the smallest and the
    largest s that are balanced, None if none is. `held`: whether 1 is in it. `contact_forces` (n, 3) on the
    grain balance the load at `factor`: the largest of the interval; if that is infinite 1, or twice the
    smallest if 1 is not in it; NaN, with zero forces, if there is no interval. `contact_states`: of these
    forces; `jams`: forces in the cones can balance one another, so contact forces have no bound; `residual`:
    how far equilibrium and cones are missed, relative to the largest force.
    """

    value: float
    status: SafetyStatus
    interval: tuple[float, float] | None
    held: bool
    contact_forces: Floats
    contact_states: tuple[ConeState, ...]
    factor: float
    jams: bool
    residual: float

    def to_dict(self) -> dict[str, Any]:
        """All of it as numbers, strings and lists for JSON; infinity and NaN as None."""
        plain = {item.name: getattr(self, item.name) for item in fields(self)}
        plain |= {"status": self.status.name, "wording": self.status.value}
        plain["contact_forces"] = self.contact_forces.tolist()
        plain["contact_states"] = [state.name for state in self.contact_states]
        for name in ("value", "factor"):
            plain[name] = plain[name] if math.isfinite(plain[name]) else None
        if self.interval is not None:
            plain["interval"] = [end if math.isfinite(end) else None for end in self.interval]
        return plain


def safety_factor(load: Load, contacts: Contacts, friction: float) -> SafetyFactor:
    """The largest s >= 0 such that forces in the friction cones balance weight + s (flow force, flow torque).

    At every contact the force on the grain has a part N >= 0 along the inward normal and a tangential part of
    at most `friction` N. In 2-D, and where friction is zero or infinite, the program is linear.

    Raises SceneError if friction is negative or not a number (it may be infinite), ConvergenceError if the program is
    not solved.
    """
    problem = ContactProblem.of(load, contacts, friction)
    low, high, weight_held, local = balanced_interval(problem)
    interval = None if math.isnan(low) else (low, high)
    factor = math.nan if interval is None else high
    if math.isinf(low):  # balanced by no finite multiple
        factor, local = math.nan, None
    elif math.isinf(factor):
        factor = 1.0 if low < 1.0 else 2.0 * low
        local = forces_that_balance(problem, problem.wrench(factor)[0])
        local = None if local is None else problem.wrench(factor)[1] * local
    if interval is None or local is None:
        local = np.zeros((len(problem), 3))
    local = problem.cone.project(local)
    return SafetyFactor(
        value=high if weight_held and interval else 0.0,
        status=_status(problem, interval, weight_held),
        interval=interval,
        held=bool(low <= 1.0 + TOLERANCE and high >= 1.0 - TOLERANCE),
        contact_forces=problem.forces(local),
        contact_states=_states(problem, local, factor),
        factor=factor,
        jams=can_jam(problem),
        residual=_residual(problem, local, factor),
    )


def balanced_interval(problem: ContactProblem) -> tuple[float, float, bool, Floats | None]:
    """The smallest and largest factor that is balanced (NaN if none), whether the weight is, and forces (k, 3).

    The local forces, in the load's unit, balance the load at the largest factor if that is finite.
    """
    if problem.flow_size == 0.0 and problem.weight_size == 0.0:
        return 0.0, math.inf, True, None
    low, high, weight_held, factors = _asked(problem, problem.flow, problem.weight)
    unit = problem.weight_size or problem.flow_size
    ratio = unit / problem.flow_size if problem.flow_size > 0.0 else 1.0
    ends = low * ratio, (high if math.isinf(high) else high * ratio)
    return *ends, weight_held, unit * problem.local(factors)


def forces_that_balance(problem: ContactProblem, wrench: Floats) -> Floats | None:
    """Local forces (k, 3) in the cones that balance a wrench (6,): the shortest, or those most inside; or None."""
    if not wrench.any():
        return np.zeros((len(problem), 3))
    size = float(np.linalg.norm(wrench))
    low, _, _, factors = _asked(problem, np.zeros(6), wrench / size)
    return None if math.isnan(low) else size * problem.local(factors)


def can_jam(problem: ContactProblem) -> bool:
    """Whether contact forces in the cones, not all zero, balance one another."""
    cosine, sine = problem.cone.scaling[:2]
    push = problem.frames[:, 0].sum(axis=0)
    inward = problem.frames @ push
    if (cosine * inward[:, 0] > sine * np.hypot(inward[:, 1], inward[:, 2])).all():
        return False  # every force in the cones has a part along the same direction
    columns, step = problem.cone_columns, 3 if problem.generators is None else 1
    pressure = np.zeros(columns.shape[1])
    pressure[::step] = 1.0
    target = np.zeros(len(columns) + 1)
    target[-1] = -1.0
    rows = np.vstack([columns, pressure])
    return not math.isnan(_intervals(rows, np.zeros(len(target)), target, problem)[0])


def _asked(
    problem: ContactProblem, flow: Floats, weight: Floats
) -> tuple[float, float, bool, Floats]:
    return _intervals(problem.cone_columns, problem.within(flow), problem.within(weight), problem)


def _intervals(
    columns: Floats, flow: Floats, weight: Floats, problem: ContactProblem
) -> tuple[float, float, bool, Floats]:
    """`safety_rows` of a single case. Raises ConvergenceError if it is not answered."""
    linear = 0 if problem.generators is None else columns.shape[1]
    low, high, state, forces = SAFETY(columns[None], flow[None], weight[None], linear)
    if state[0] == FAILED:
        raise ConvergenceError(
            "contacts: the interior-point method gives no answer; merge contacts near one another"
        )
    return float(low[0]), float(high[0]), bool(state[0] == HELD), forces[0]


def _status(
    problem: ContactProblem, interval: tuple[float, float] | None, weight_held: bool
) -> SafetyStatus:
    if interval is None:
        return SafetyStatus.UNHELD
    if not weight_held:
        return SafetyStatus.HELD_BY_FLOW
    if problem.flow_size == 0.0:
        return SafetyStatus.NO_FLOW
    if math.isinf(interval[1]):
        return SafetyStatus.UNLIMITED
    held = interval[1] * problem.flow_size > TOLERANCE * problem.weight_size
    return SafetyStatus.CRITICAL if held else SafetyStatus.NO_RESERVE


def _states(problem: ContactProblem, local: Floats, factor: float) -> tuple[ConeState, ...]:
    """Where forces (k, 3) are in their cones, for each contact given."""
    sizes = np.linalg.norm(local, axis=1)
    unit = max(sizes.max(), 0.0 if math.isnan(factor) else problem.wrench(factor)[1])
    edges = problem.cone.margin(local) <= NO_FORCE * sizes
    states = [
        (ConeState.EDGE if edge else ConeState.INSIDE) if loaded else ConeState.UNLOADED
        for edge, loaded in zip(edges, sizes > NO_FORCE * unit, strict=True)
    ]
    return tuple(states[i] for i in problem.copy.tolist())


def _residual(problem: ContactProblem, local: Floats, factor: float) -> float:
    """The worst imbalance, relative to the load or the largest force."""
    if math.isnan(factor):
        return 0.0
    wrench, size = problem.wrench(factor)
    missed = np.abs(problem.columns @ local.ravel() + size * wrench).max()
    return float(missed / (max(size, np.abs(local).max()) or 1.0))


# From here on kernels, which numba compiles (`problem.Kernel`).


def safety_rows(
    columns: Floats, flow: Floats, weight: Floats, linear: int
) -> tuple[Floats, Floats, Integers, Floats]:
    """Intervals of balanced factors of n problems, by `_interval`: low, high, state of the weight, (n,), and forces.

    columns: (n, m, h) wrenches of unit forces in the cones; flow, weight: (n, m) of length one, or zero
    """
    count, _, width = columns.shape
    low, high, weight_state = np.empty(count), np.empty(count), np.empty(count, np.int64)
    forces = np.zeros((count, width))
    for i in range(count):
        low[i], high[i], weight_state[i] = _interval(
            columns[i].copy(), flow[i].copy(), weight[i].copy(), linear, forces[i]
        )
    return low, high, weight_state, forces


def _interval(
    q: Floats, flow: Floats, weight: Floats, linear: int, forces: Floats
) -> tuple[float, float, int]:
    """The smallest and largest factor of the flow that is balanced, NaN if none, and the state of the weight.

    Forces (h,) that balance the load at the largest factor, or the weight if there is no flow, are filled in, in units
    of the weight, or of the flow without a weight.
    """
    has_flow, has_weight = largest(flow) > 0.0, largest(weight) > 0.0
    rank, short = _orthonormalise(q, flow, weight)
    fits = (
        TOLERANCE + short
    )  # forces on contacts near one another balance as much, which is left out
    flow_missed, weight_missed = length(flow[rank:]), length(weight[rank:])
    q, f, w = q[:rank], flow[:rank], weight[:rank]
    margin = _margin(q, w, linear, forces) if weight_missed <= fits else -np.inf
    if np.isnan(margin):
        return np.nan, np.nan, FAILED
    held = margin >= -TOLERANCE
    if not has_flow:
        return (0.0, np.inf, HELD) if held else (np.nan, np.nan, UNHELD)
    if flow_missed > fits:  # forces and flow are independent: one factor at most
        factor = -dot(flow[rank:], weight[rank:]) / flow_missed**2
        if held or factor <= 0.0:
            return (0.0, 0.0, HELD) if held else (np.nan, np.nan, UNHELD)
        add(weight, factor, flow)
        if length(weight[rank:]) > fits * (1.0 + factor):
            return np.nan, np.nan, UNHELD
        margin = _margin(q, w, linear, forces)
        if margin >= -TOLERANCE:
            return factor, factor, UNHELD
        return np.nan, np.nan, FAILED if np.isnan(margin) else UNHELD
    if weight_missed > fits:
        return np.nan, np.nan, UNHELD
    if not has_weight:
        margin = _margin(q, f, linear, forces)
        forces[:] = 0.0
        if np.isnan(margin):
            return np.nan, np.nan, FAILED
        return 0.0, np.inf if margin >= -TOLERANCE else 0.0, HELD
    f_size, w_size = length(f), length(w)
    if w_size == 0.0 or f_size == 0.0:
        return np.nan, np.nan, UNHELD
    table, target, answer = np.empty((rank, q.shape[1] + 1)), -w / w_size, forces.copy()
    table[:, 0], table[:, 1:] = f / f_size, q
    status, value = _conic(table, target, -1.0, linear + 1, forces)
    unit = w_size / f_size
    if status == UNANSWERED:
        return np.nan, np.nan, FAILED
    if status == INFEASIBLE:
        forces[:] = answer
        return (0.0, 0.0, HELD) if held else (np.nan, np.nan, UNHELD)
    high = np.inf if status == UNBOUNDED else max(-value, 0.0) * unit
    if high > ENDLESS and (status == UNBOUNDED or _margin(q, f, linear, answer) >= -TOLERANCE):
        high = np.inf
    else:
        _balance(q, f * high + w, forces, w_size)
    if held:
        return 0.0, high, HELD
    status, value = _conic(table, target, 1.0, linear + 1, answer)
    if status == UNANSWERED:
        return np.nan, np.nan, FAILED
    return max(value, 0.0) * unit, high, UNHELD


def _balance(q: Floats, wrench: Floats, forces: Floats, unit: float) -> None:
    """Scale forces (h,) by a unit and move them by the least that makes them balance a wrench."""
    for j in range(len(forces)):
        forces[j] *= unit
    for i in range(len(q)):
        add(forces, -wrench[i] - dot(q[i], forces), q[i])


def _margin(q: Floats, wrench: Floats, linear: int, forces: Floats) -> float:
    """How far inside the cones forces (h,) can be that balance a wrench, relative to it; they are filled in.

    The shortest forces if they are inside, otherwise those most inside: max m such that q f + wrench = 0 and
    f - m e is in the cones, e the axes of all cones. NaN if that program is not answered.
    """
    size = length(wrench)
    forces[:] = 0.0
    if size == 0.0:
        return 0.0
    for i in range(len(q)):
        add(forces, -wrench[i], q[i])
    inside = cone_margin(forces, linear)
    if inside >= 0.0:
        return inside / size
    axes, width = np.zeros(len(forces)), len(forces)
    axes[:linear], axes[linear::3] = 1.0, 1.0
    for _ in range(PROJECTIONS):
        _push_inside(forces, linear, INSIDE * size)
        _balance(q, wrench, forces, 1.0)
        inside = cone_margin(forces, linear)
        if inside >= 0.0:
            return inside / size
    push = q @ axes
    most = length(push)
    if most <= RANK * width:  # the axes balance one another: such forces can be added
        add(forces, -inside, axes)
        return 0.0
    table, answer = np.empty((len(q), width + 1)), np.empty(width)
    table[:, 0], table[:, 1:] = -push / most, q
    status, value = _conic(table, -wrench / size, 1.0, linear + 1, answer)
    if status != OPTIMAL:
        return np.nan
    forces[:] = answer
    add(forces, -value / most, axes)
    _balance(q, wrench, forces, size)
    return -value / most


def _push_inside(forces: Floats, linear: int, margin: float) -> None:
    """Move forces (h,) to the nearest that are inside their cones by a margin."""
    for j in range(linear):
        forces[j] = max(forces[j], margin)
    for j in range(linear, len(forces), 3):
        normal = forces[j] - margin
        shear = max(math.hypot(forces[j + 1], forces[j + 2]), 1e-300)
        if shear > normal:
            size = max(0.5 * (normal + shear), 0.0)
            forces[j] = size + margin
            forces[j + 1] *= size / shear
            forces[j + 2] *= size / shear


def _orthonormalise(rows: Floats, flow: Floats, weight: Floats) -> tuple[int, float]:
    """The rank r of rows (m, h), of which the first r become orthonormal, and the length of the longest other.

    The same steps are taken on two columns (m,).
    """
    count, size = len(rows), 0.0
    for rank in range(count):
        best, most = rank, -1.0
        for i in range(rank, count):
            long = length(rows[i])
            if long > most:
                best, most = i, long
        size = max(size, most)
        if most <= RANK * size:
            return rank, most
        for j in range(rows.shape[1]):
            rows[rank, j], rows[best, j] = rows[best, j], rows[rank, j]
            rows[rank, j] /= most
        flow[rank], flow[best] = flow[best], flow[rank]
        weight[rank], weight[best] = weight[best], weight[rank]
        flow[rank], weight[rank] = flow[rank] / most, weight[rank] / most
        for _ in range(2):
            for i in range(rank + 1, count):
                part = dot(rows[rank], rows[i])
                add(rows[i], -part, rows[rank])
                flow[i] -= part * flow[rank]
                weight[i] -= part * weight[rank]
    return count, 0.0


def _conic(a: Floats, b: Floats, cost: float, linear: int, answer: Floats) -> tuple[int, float]:
    """Minimise cost x[0] subject to a x = b with x in the cones: status and value; x[1:] is filled in.

    The value is that of the dual program, which is known to round-off; if there is no least one, `answer` is left.
    UNANSWERED: the iteration ended before the dual program was solved.
    """
    m, n = a.shape
    x, z, dx, dz, missed, lam, size, turn, c, goal, p, scaled_missed = np.zeros((12, n))
    y, dy, lacking, rho, beta, pull = np.zeros((6, m))
    q, lower = np.empty((m, n)), np.empty((m, m))
    x[:linear] = 1.0
    x[linear::3] = 1.0
    z[:] = x
    degree = 1.0 + linear + (n - linear) // 3
    tau, kappa, nearest, closest, value = 1.0, 1.0, np.inf, np.inf, 0.0
    for _ in range(ITERATIONS):
        for j in range(n):
            missed[j] = -z[j]
        missed[0] += cost * tau
        for i in range(m):
            lacking[i] = b[i] * tau - dot(a[i], x)
            add(missed, -y[i], a[i])
        cx, by, gap = cost * x[0], dot(b, y), dot(x, z) + tau * kappa
        if tau <= -cx * CERTIFIED and largest(lacking) <= ROUND_OFF - cx * CERTIFIED:
            return UNBOUNDED, -np.inf
        if tau <= by * CERTIFIED and largest(missed) <= ROUND_OFF + by * CERTIFIED:
            return INFEASIBLE, np.inf
        error = (largest(missed) + gap / tau) / (tau + abs(by))
        if error + largest(lacking) / tau < nearest:
            nearest = error + largest(lacking) / tau
            for j in range(1, n):
                answer[j - 1] = x[j] / tau
        if error < closest:
            closest, value = error, by / tau
        if error <= CLOSED or error > 1e3 * closest < 1e-6:
            break
        if not _scaling(x, z, linear, size, turn):
            break
        c[:] = 0.0
        c[0] = cost * size[0]
        _scale(size, turn, linear, z, 1.0, lam)
        _scale(size, turn, linear, missed, 1.0, scaled_missed)
        for i in range(m):
            _scale(size, turn, linear, a[i], 1.0, q[i])
        _factorise(q, lower)
        beta[:], rho[:], p[:] = b, lacking, 0.0
        _forward(lower, beta)
        _forward(lower, rho)
        p[0] = -c[0]
        for i in range(m):
            pull[i] = beta[i] + q[i, 0] * c[0]
            add(p, pull[i], q[i])
        slope, rest = dot(p, p) + kappa / tau, by - cx - kappa
        dx[:], dz[:], dtau, dkappa, eta, target, step = 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0
        for corrects in range(2):
            _correct(lam, dx, dz, linear, target, goal)
            change = target - tau * kappa - dtau * dkappa
            for j in range(n):
                dz[j] = goal[j] - eta * scaled_missed[j]
                dx[j] = dz[j]
            for i in range(m):
                dy[i] = eta * rho[i] - dot(q[i], dz)
                add(dx, dy[i], q[i])
            dtau = (c[0] * dx[0] - dot(beta, dy) + change / tau - eta * rest) / slope
            dkappa = (change - kappa * dtau) / tau
            add(dx, dtau, p)
            add(dy, dtau, pull)
            for j in range(n):
                dz[j] = goal[j] - dx[j]
            step = min(_longest(lam, dx, linear), _longest(lam, dz, linear))
            step = min(step, -tau / min(dtau, -0.5 * tau), -kappa / min(dkappa, -0.5 * kappa))
            if corrects == 0:
                eta = 1.0 - (1.0 - min(step, 1.0)) ** 3
                target = (1.0 - eta) * gap / degree
        step = min(1.0, STEP * step)
        _backward(lower, dy)
        _scale(size, turn, linear, dx, 1.0, goal)
        add(x, step, goal)
        _scale(size, turn, linear, dz, -1.0, goal)
        add(z, step, goal)
        add(y, step, dy)
        tau, kappa = tau + step * dtau, kappa + step * dkappa
    return (OPTIMAL if closest <= ANSWERED else UNANSWERED), value


def _scaling(x: Floats, z: Floats, linear: int, size: Floats, turn: Floats) -> bool:
    """Fill in T = size (2 turn turn^T - J) of each cone with T z = T^-1 x; False if x or z is on an edge."""
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


def _scale(
    size: Floats, turn: Floats, linear: int, vector: Floats, sign: float, out: Floats
) -> None:
    """Fill in T vector, or with a negative sign T^-1 vector."""
    for i in range(linear):
        out[i] = vector[i] * size[i] if sign > 0.0 else vector[i] / size[i]
    for i in range(linear, len(vector), 3):
        factor = size[i] if sign > 0.0 else 1.0 / size[i]
        normal, first, second = vector[i], vector[i + 1], vector[i + 2]
        along = 2.0 * (turn[i] * normal + sign * (turn[i + 1] * first + turn[i + 2] * second))
        out[i] = factor * (along * turn[i] - normal)
        out[i + 1] = factor * (along * sign * turn[i + 1] + first)
        out[i + 2] = factor * (along * sign * turn[i + 2] + second)


def _correct(lam: Floats, p: Floats, q: Floats, linear: int, target: float, out: Floats) -> None:
    """Fill in the u with lam o u = target e - lam o lam - p o q, o being the product of the cones."""
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
    """The longest step, at most two, with which a vector stays in the cones."""
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


def cone_margin(x: Floats, linear: int) -> float:
    """The least distance of the entries and triples of a vector from the edge of their cones."""
    least = np.inf
    for i in range(linear):
        least = min(least, x[i])
    for i in range(linear, len(x), 3):
        least = min(least, x[i] - math.hypot(x[i + 1], x[i + 2]))
    return least


def _determinant(x: Floats, i: int) -> float:
    """x^2 - y^2 - z^2 of a triple without cancellation."""
    shear = math.hypot(x[i + 1], x[i + 2])
    return (x[i] - shear) * (x[i] + shear)


def _factorise(rows: Floats, lower: Floats) -> None:
    """Make rows (m, n) orthonormal and fill in the triangle (m, m) that takes them back: modified Gram-Schmidt."""
    for i in range(len(rows)):
        lower[i], after, before = 0.0, length(rows[i]), np.inf
        while after < 0.5 * before:  # what cancelled is taken away once more
            before = after
            for j in range(i):
                part = dot(rows[j], rows[i])
                lower[i, j] += part
                add(rows[i], -part, rows[j])
            after = length(rows[i])
        lower[i, i] = after
        rows[i] /= after


def _forward(lower: Floats, v: Floats) -> None:
    for i in range(len(v)):
        for j in range(i):
            v[i] -= lower[i, j] * v[j]
        v[i] /= lower[i, i]


def _backward(lower: Floats, v: Floats) -> None:
    for i in range(len(v) - 1, -1, -1):
        for j in range(i + 1, len(v)):
            v[i] -= lower[j, i] * v[j]
        v[i] /= lower[i, i]


def dot(a: Floats, b: Floats) -> float:
    """The scalar product."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def add(total: Floats, factor: float, vector: Floats) -> None:
    """Add a multiple of a vector."""
    for i in range(len(total)):
        total[i] += factor * vector[i]


def length(vector: Floats) -> float:
    """Euclidean length."""
    return math.sqrt(dot(vector, vector))


def largest(vector: Floats) -> float:
    """Magnitude of the largest entry."""
    most = 0.0
    for i in range(len(vector)):
        most = max(most, abs(vector[i]))
    return most


SAFETY = Kernel(safety_rows)
