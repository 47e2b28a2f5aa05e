"""Many loads in the plane on one grain and its contacts: what depends on the contacts alone is computed once.

The loads that contact forces balance are a polyhedral cone, whose facets are found once: a safety factor is then the
least of a few ratios. The loads of each way to begin to move are cones as well, and signs tell which one a load is in.
Loads near to a boundary are left to the single judge.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Booleans, Floats, Integers, cross
from incipient.contact.exact import fans
from incipient.contact.exact.grasp import Grasp, grasp
from incipient.contact.exact.judge import MassAndInertia
from incipient.contact.exact.motion_modes import Mode
from incipient.contact.exact.planar_modes import mode_along
from incipient.contact.exact.planar_motion import ZERO, MotionPlane, plane_basis, plane_problem
from incipient.contact.exact.release import release
from incipient.contact.model import Loads
from incipient.geometry.contacts import Contacts

FLAT = 1e-9  # a generator so near to a plane lies in it
CLEAR = 1e-7  # of unit vectors: what is nearer to a boundary than that is judged by itself


@dataclass(frozen=True, eq=False)
class _Motion:
    """Loads that begin to move in one way: those w (3,) with rows w > 0, and the mode's place among the labels."""

    rows: Floats
    mode: int
    # (3,) row of the angular acceleration where the mode is one with rotation; None: it is told by itself
    turning: Floats | None = None


@dataclass(frozen=True, eq=False)
class Planar:
    """A case in the plane: `basis` (3, 6) takes wrenches there, couples over `reach`."""

    basis: Floats
    reach: float
    facets: Floats  # (f, 3) rows that are not positive for loads that are held
    # The ways to move; None: without mass and inertia, or where they are judged one by one
    motions: tuple[_Motion, ...] | None
    tells: bool  # whether the mode of a load that moves is to be told

    @classmethod
    def of(
        cls, loads: Loads, contacts: Contacts, friction: float, inert: MassAndInertia | None
    ) -> "Planar | None":
        """The case if it is in the plane of the first two directions with friction, else None."""
        if len(loads) == 0 or _leaves_plane(loads, contacts):
            return None
        held_by = grasp(loads.load(0), contacts, friction)
        if held_by.plane is None or held_by.fan is None or len(held_by.fan) < 2:
            return None
        basis = plane_basis(held_by.plane)
        facets = _facets(-(basis @ fans.edges(held_by, held_by.fan)).T)
        if facets is None:
            return None
        motions = None if inert is None else _motions(loads, contacts, friction, inert, held_by, basis)
        return cls(basis, held_by.reach, facets, motions, inert is not None)

    def judged(self, loads: Loads) -> tuple[Floats, Booleans, Integers, Booleans]:
        """Safety factors, whether held, modes, and which loads are too near to a boundary, (n,) each."""
        flow, weight = (self._wrenches(*pair) for pair in ((loads.force, loads.couple), (loads.weight, None)))
        flow_size, weight_size = (np.linalg.norm(one, axis=1) for one in (flow, weight))
        whole = flow + weight
        size = flow_size + weight_size
        doubtful = (flow_size <= CLEAR * size) | (weight_size <= CLEAR * size)
        f, w = flow @ self.facets.T, weight @ self.facets.T
        doubtful |= (np.abs(f) <= CLEAR * flow_size[:, None]).any(axis=1)
        on = np.abs(w) <= ZERO * 1e-3 * weight_size[:, None]
        w[on] = 0.0
        doubtful |= ((np.abs(w) <= CLEAR * weight_size[:, None]) & ~on).any(axis=1)
        weight_held = (w <= 0.0).all(axis=1)
        factors = np.where(weight_held, _largest(f, w), 0.0)
        margin = whole @ self.facets.T / size[:, None]
        held = (margin <= 0.0).all(axis=1)
        doubtful |= ~((margin < -CLEAR).all(axis=1) | (margin > CLEAR).any(axis=1))
        modes = np.where(held, 0, 1).astype(np.int64)
        if self.tells and self.motions is None:
            doubtful |= ~held
        elif self.motions is not None:
            told, unclear = _told(self.motions, whole / np.linalg.norm(whole, axis=1)[:, None])
            modes = np.where(held, 0, told).astype(np.int64)
            doubtful |= unclear & ~held
        return factors, held, modes, doubtful

    def _wrenches(self, force: Floats, couple: Floats | None) -> Floats:
        both = np.zeros((len(force), 6))
        both[:, :3] = force
        if couple is not None:
            both[:, 3:] = couple / self.reach
        return np.asarray(both @ self.basis.T)


def _largest(flow: Floats, weight: Floats) -> Floats:
    """The largest s with weight + s flow not positive for all facets, (n,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(flow > 0.0, -weight / flow, np.inf)
    return np.asarray(ratios.min(axis=1, initial=np.inf))


def _leaves_plane(loads: Loads, contacts: Contacts) -> bool:
    """Whether anything has a part out of the plane of the first two directions."""
    arms = contacts.points - loads.centre
    parts = (arms[:, 2], contacts.normals[:, 2], loads.force[:, 2], loads.weight[:, 2], loads.couple[:, :2])
    return any(part.any() for part in parts)


def _facets(generators: Floats) -> Floats | None:
    """Rows (f, 3) that are not positive on the cone of generators (g, 3) and only there; None if it is a line or less.

    Every facet holds two generators, or one and the normal of the plane that all are in.
    """
    unit = generators / np.linalg.norm(generators, axis=1)[:, None]
    first, second = np.triu_indices(len(unit), 1)
    normals = cross(unit[first], unit[second])
    rank = np.linalg.matrix_rank(unit, tol=FLAT)
    if rank < 2:
        return None
    if rank == 2:
        across = normals[np.argmax(np.linalg.norm(normals, axis=1))]
        normals = np.vstack([normals, cross(across[None], unit)])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > FLAT] / lengths[lengths > FLAT, None]
    both = np.vstack([normals, -normals])
    both = both[(both @ unit.T <= FLAT).all(axis=1)]
    if not len(both):  # all of space
        return both
    same = (np.abs(both[:, None] - both[None]) <= FLAT).all(axis=2)
    return np.asarray(both[same.argmax(axis=1) == np.arange(len(both))])


def _motions(
    loads: Loads, contacts: Contacts, friction: float, inert: MassAndInertia, held_by: Grasp, basis: Floats
) -> tuple[_Motion, ...] | None:
    """All ways to begin to move; None where several contacts are on one line, which has more of them."""
    largest = int(np.argmax(np.linalg.norm(loads.force + loads.weight, axis=1)))  # one that is not zero
    case = release(loads.load(largest), contacts, friction, *inert)
    if case.grasp.plane is None:
        return None
    problem = plane_problem(case)
    if not np.allclose(problem.basis, basis) or any(len(group) > 1 for group in problem.lines_of_action()):
        return None
    return tuple(_ways(problem, case.grasp))


def _ways(problem: MotionPlane, held_by: Grasp) -> Iterator[_Motion]:
    """The free motion, sliding on one contact, and accelerations along lines where two stay or one sticks."""
    inverse = np.linalg.inv(problem.mass)
    turns = np.eye(3)[2] @ inverse
    yield _Motion(problem.normal @ inverse, _place(Mode.LIFTING_AND_ROTATING), turns)
    for way, edge in ((1.0, -1), (-1.0, -2)):
        for i, response in enumerate(problem.edges[edge] @ inverse.T):
            gain = problem.normal[i] @ response
            if abs(gain) > ZERO:
                factor = -(problem.normal[i] @ inverse) / gain
                y = inverse + np.outer(response, factor)
                others = np.delete(problem.normal, i, axis=0) @ y
                rows = np.vstack([factor, way * problem.tangent[i] @ y, others])
                yield _Motion(rows, _place(Mode.PIVOTING_AND_SLIDING), y[2])
    for direction in problem.directions():
        edges = problem.edges[problem.allowed_edges(direction)]
        facets = _facets(np.vstack([problem.mass @ direction, -edges]))
        if facets is not None:
            yield _Motion(-facets, _place(mode_along(problem, held_by, direction)))


def _place(of: Mode) -> int:
    """The place of a mode among the labels: after "rest" and "moves"."""
    return 1 + list(Mode).index(of)


def _told(motions: tuple[_Motion, ...], whole: Floats) -> tuple[Integers, Booleans]:
    """The modes of loads (n, 3) of length one, and which are not clearly those of one mode alone, (n,)."""
    modes, unclear = np.zeros(len(whole), dtype=np.int64), np.zeros(len(whole), dtype=bool)
    for motion in motions:
        lengths = np.linalg.norm(motion.rows, axis=1)
        rows = motion.rows / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        least = (whole @ rows.T).min(axis=1, initial=np.inf)
        inside = least > CLEAR
        unclear |= np.abs(least) <= CLEAR
        if motion.turning is not None:
            unclear |= inside & (np.abs(whole @ motion.turning) <= CLEAR)
        unclear |= inside & (modes > 0) & (modes != motion.mode)
        modes[inside] = motion.mode
    return modes, unclear | (modes == 0)
