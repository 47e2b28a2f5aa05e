"""Every incipient motion of a planar case with friction, by enumeration.

An acceleration y = (two of the centre, angular) in the plane leaves contact i where N_i y > 0 and slides on it
where N_i y = 0, T_i y != 0; the rows N_i, T_i give the normal and tangential acceleration of the grain there.
The planes N_i y = 0 and T_i y = 0 cut space into cells. In each of them the forces allowed are fixed, and
mass y = wrench + forces is a linear problem. So few cells touch a contact that all can be tried:

- y = 0, the grain rests;
- the free acceleration, where no force acts;
- y in one plane N_i y = 0, the grain slides on contact i;
- y on a line where two contacts stay, N_i y = N_j y = 0, or where one sticks, N_i y = T_i y = 0.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from incipient.arrays import Floats, Integers, cross
from incipient.contact.exact import fans
from incipient.contact.exact.release import SAME, Candidate, Release, add

ZERO = 1e-9  # accelerations below it, for directions of length one or relative to the free one, are zero


@dataclass(frozen=True, eq=False)
class MotionPlane:
    """The problem in the plane."""

    basis: Floats  # (3, 6): takes wrenches and accelerations into the plane
    # (g, 3) and (g, k, 3): edges of the cones as local forces and as wrenches, the last two those that oppose sliding
    # against and along the first tangent.
    fan: Floats
    edges: Floats
    normal: Floats  # (k, 3): the rows N
    tangent: Floats  # (k, 3): the rows T
    mass: Floats  # (3, 3)
    wrench: Floats  # (3,): the load
    free: Floats  # (3,): the acceleration it gives without contacts

    @property
    def zero(self) -> float:
        """What counts as no acceleration."""
        return ZERO * float(np.sqrt(self.free @ self.free))

    def candidate(self, y: Floats, factors: Floats, family: bool = False) -> Candidate:
        """An acceleration (3,) with factors (g, k) of the edges."""
        return Candidate(y @ self.basis, np.einsum("gk,gj->kj", factors, self.fan), family)

    def lines_of_action(self) -> Iterator[Integers]:
        """The contacts (m,) on each line along which contacts press, facing or not."""
        rows = self.normal
        parallel = np.abs(cross(rows[:, None], rows[None])).max(axis=2) <= ZERO
        yield from (np.flatnonzero(pattern) for pattern in np.unique(parallel, axis=0))

    def ways_to_slide(self, group: Integers) -> Floats:
        """Signs (s, m) of the tangential accelerations of contacts on one line, in each way to slide on all of them."""
        axes = np.linalg.svd(self.normal[group[:1]])[2][1:]
        return sectors_of_lines(self.tangent[group] @ axes.T)

    def allowed_edges(self, direction: Floats) -> NDArray[np.bool_]:
        """Which edges (g, k) contact forces may have with an acceleration along a direction (3,)."""
        stays, count = self.normal @ direction <= ZERO, len(self.fan)
        way = np.where(stays, self.tangent @ direction, np.nan)
        allowed = np.zeros(self.edges.shape[:2], dtype=bool)
        allowed[:, np.abs(way) <= ZERO] = True
        allowed[-1 % count, way > ZERO] = allowed[-2 % count, way < -ZERO] = True
        return allowed

    def directions(self) -> Floats:
        """Directions (d, 3), of length one, where two contacts stay or one sticks, that lead the grain into none."""
        first, second = np.triu_indices(len(self.normal), 1)
        meets = cross(self.normal[first], self.normal[second])
        lines = np.vstack([cross(self.normal, self.tangent), meets])
        lengths = np.sqrt((lines * lines).sum(axis=1))
        lines = lines[lengths > ZERO] / lengths[lengths > ZERO, None]
        both = np.vstack([lines, -lines])
        both = both[(both @ self.normal.T >= -ZERO).all(axis=1)]
        same = (np.abs(both[:, None] - both[None]) <= ZERO).all(axis=2)
        return np.asarray(both[same.argmax(axis=1) == np.arange(len(both))])


def planar_solutions(case: Release) -> list[Candidate]:
    """All solutions with different accelerations of a planar case with friction; of a family its ends."""
    problem = plane_problem(case)
    found: list[Candidate] = []
    for cells in (_rest, _free, _sectors, _sectors_of_several, _rays):
        for candidate in cells(problem):
            add(found, candidate, case.scale)
    return found


def plane_problem(case: Release) -> MotionPlane:
    """The planar problem of a case that has a plane."""
    plane, fan = case.grasp.plane, case.grasp.fan
    assert plane is not None and fan is not None
    basis = plane_basis(plane)
    rows = (basis @ case.grasp.columns).reshape(3, -1, 3)
    return MotionPlane(
        basis=basis,
        fan=fan,
        edges=(rows @ fan.T).transpose(2, 1, 0),
        normal=rows[:, :, 0].T,
        tangent=rows[:, :, 1].T,
        mass=basis @ case.mass @ basis.T,
        wrench=basis @ case.wrench,
        free=basis @ case.free,
    )


def plane_basis(plane: Floats) -> Floats:
    """The rows (3, 6) that take wrenches and accelerations into a plane (3, 3) of two axes and its normal."""
    basis = np.zeros((3, 6))
    basis[:2, :3], basis[2, 3:] = plane[:2], plane[2]
    return basis


def _rest(problem: MotionPlane) -> Iterator[Candidate]:
    """y = 0: contact forces balance the wrench."""
    factors = fans.combination(problem.edges.reshape(-1, 3).T, -problem.wrench)
    if factors is not None:
        yield problem.candidate(np.zeros(3), factors.reshape(problem.edges.shape[:2]))


def _free(problem: MotionPlane) -> Iterator[Candidate]:
    """No contact force."""
    if (problem.normal @ problem.free >= -problem.zero).all():
        yield problem.candidate(problem.free, np.zeros(problem.edges.shape[:2]))


def _sectors(problem: MotionPlane) -> Iterator[Candidate]:
    """Sliding on one contact along its tangent or against: N_i (free + factor mass^-1 edge) = 0."""
    opposing = problem.edges[[-1, -2]]  # (2, k, 3): sliding along the tangent, against it
    response = np.linalg.solve(problem.mass, opposing.reshape(-1, 3).T).T.reshape(opposing.shape)
    gain = (problem.normal * response).sum(axis=2)
    gain[np.abs(gain) <= ZERO] = np.nan
    factor = -(problem.normal @ problem.free) / gain
    y = problem.free + factor[:, :, None] * response
    slides = np.array([[1.0], [-1.0]]) * (problem.tangent * y).sum(axis=2) >= -problem.zero
    stays_out = (y @ problem.normal.T >= -problem.zero).all(axis=2)
    for way, i in np.argwhere((factor >= 0.0) & slides & stays_out):
        factors = np.zeros(problem.edges.shape[:2])
        factors[-1 - way, i] = factor[way, i]
        yield problem.candidate(y[way, i], factors)


def _sectors_of_several(problem: MotionPlane) -> Iterator[Candidate]:
    """Sliding on several contacts that share a line of action, facing or not: one linear program a way to slide.

    Their planes N_i y = 0 are one plane, cut by their T_i y = 0 into sectors.
    """
    for group in problem.lines_of_action():
        if len(group) > 1:
            for signs in problem.ways_to_slide(group):
                yield from _slides_on_all(problem, group, signs)


def sectors_of_lines(lines: Floats) -> Floats:
    """The signs (s, m) of m linear functions (m, 2) in each of the sectors into which their zeros cut a plane."""
    angles = np.arctan2(lines[:, 1], lines[:, 0]) + 0.5 * np.pi
    bounds = np.unique(np.round(np.concatenate([angles, angles + np.pi]) % (2.0 * np.pi), 12))
    middles = 0.5 * (bounds + np.append(bounds[1:], bounds[0] + 2.0 * np.pi))
    return np.asarray(np.sign(np.stack([np.cos(middles), np.sin(middles)], axis=1) @ lines.T))


def _slides_on_all(problem: MotionPlane, group: Integers, signs: Floats) -> Iterator[Candidate]:
    """The solutions that slide on every contact of a group in the ways given by the signs."""
    edge = np.where(signs > 0.0, -1, -2) % len(problem.fan)
    count = len(group)
    system = np.zeros((4, 3 + count))
    system[:3, :3], system[:3, 3:] = problem.mass, -problem.edges[edge, group].T
    system[3, :3] = problem.normal[group[0]]
    others = np.delete(problem.normal, group, axis=0)
    bounds = np.zeros((2 * count + len(others), 3 + count))
    bounds[:count, 3:] = np.eye(count)
    bounds[count:, :3] = np.vstack([signs[:, None] * problem.tangent[group], others])
    goal = np.concatenate([problem.tangent[group[0]], np.zeros(count)])
    ends = fans.extent(system, np.append(problem.wrench, 0.0), bounds, goal)
    for end in ends:
        factors = np.zeros(problem.edges.shape[:2])
        factors[edge, group] = end[3:]
        yield problem.candidate(end[:3], factors, _apart(ends, problem.zero))


def _rays(problem: MotionPlane) -> Iterator[Candidate]:
    """Accelerations along the lines where two contacts stay or one sticks: y = size * direction, size > 0."""
    for direction in problem.directions():
        allowed = problem.allowed_edges(direction)
        system = np.column_stack([problem.mass @ direction, -problem.edges[allowed].T])
        answer = fans.combination(system, problem.wrench)
        if answer is None or answer[0] <= problem.zero:
            continue
        ends = [answer]
        if np.linalg.matrix_rank(system, tol=1e-10) < system.shape[1]:
            ends = (
                fans.extent(system, problem.wrench, np.eye(len(answer)), np.eye(len(answer))[0])
                or ends
            )
        for end in ends:
            factors = np.zeros(problem.edges.shape[:2])
            factors[allowed] = end[1:]
            yield problem.candidate(
                end[0] * direction, factors, _apart([e[:1] for e in ends], problem.zero)
            )


def _apart(ends: list[Floats], zero: float) -> bool:
    """Whether the two ends found differ."""
    return len(ends) == 2 and bool(np.abs(ends[0][:3] - ends[1][:3]).max() > SAME / ZERO * zero)
