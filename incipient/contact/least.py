"""Contact forces of least size, where several sets of forces do the same.

Of all forces x that the contacts allow and that balance a wrench w, columns x = -w, the shortest is the
projection x = P(columns^T v) of a wrench v on what is allowed; v solves columns P(columns^T v) = -w, which is the
condition for a minimum of the convex function |P(columns^T v)|^2 / 2 + w . v.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from incipient.contact import cones
from incipient.contact.grasp import FRICTIONLESS, Grasp
from incipient.contact.model import Floats

RANK = 1e-10  # singular values below it, relative to the largest, count as zero
MISSED = 1e-9  # how far the wrench may be missed, in numbers of order one
CONVERGED, ON_EDGE = 1e-13, 1e-12  # relative to the forces: of the wrench, and of room in a cone
STEPS = 25
SHIFT = 1e-3  # of the curvature, which may be singular, by this much of what is missed
DIAGONAL = np.diag_indices(6)
UNIT = np.eye(3)
DAMPING = 0.5 ** np.arange(10)


@dataclass(frozen=True, eq=False)
class Allowed:
    """What k contacts may carry: their friction cones, but where they slide only the edge against it.

    `matrix` (6, k, 3): wrenches of unit local forces; `scaling` (3,): of the cones; `axes`: how many components
    of a force can be other than zero; `slides` (k,); `edges` (k, 3): unit forces where they slide, else zero.
    """

    matrix: Floats
    scaling: Floats
    axes: int
    slides: NDArray[np.bool_]
    edges: Floats

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """(k, 4): which of three local forces and the edge are those whose sums are all forces, free of limits."""
        free = np.empty((len(self.slides), 4), dtype=bool)
        free[:, :3] = ~self.slides[:, None]
        free[:, self.axes : 3] = False
        free[:, 3] = self.slides
        return free

    @cached_property
    def columns(self) -> Floats:
        """The wrenches (6, m) of those forces."""
        edges = np.einsum("ikj,kj->ik", self.matrix, self.edges)
        return np.asarray(np.concatenate([self.matrix, edges[:, :, None]], axis=2)[:, self.free])

    def forces(self, factors: Floats) -> Floats:
        """The sums (k, 3) of those forces with factors (m,)."""
        whole = np.zeros(self.free.shape)
        whole[self.free] = factors
        return np.asarray(whole[:, :3] + whole[:, 3:] * self.edges)

    def room(self, forces: Floats) -> Floats:
        """How far forces (..., k, 3), that are multiples of the edge where a contact slides, are inside, (..., k)."""
        cosine, sine = self.scaling[:2]
        inside = sine * forces[..., 0] - cosine * np.hypot(forces[..., 1], forces[..., 2])
        return np.where(self.slides | (self.axes == 1), forces[..., 0], inside)

    def nearest(self, forces: Floats) -> "Nearest":
        """The nearest forces (k, 3) that are allowed."""
        cosine, sine = self.scaling[:2]
        shear = np.maximum(np.hypot(forces[:, 1], forces[:, 2]), 1e-300)
        edge = np.empty_like(forces)
        edge[:, 0] = cosine
        edge[:, 1:] = forces[:, 1:] * (sine / shear)[:, None]
        edge[self.slides] = self.edges[self.slides]
        size = np.maximum(np.einsum("kj,kj->k", edge, forces), 0.0)
        inside = (cosine * shear <= sine * forces[:, 0]) & ~self.slides
        return Nearest(np.where(inside[:, None], forces, size[:, None] * edge), inside, edge, size, shear)

    def curvature(self, at: "Nearest") -> Floats:
        """The derivative (6, 6) of the wrench of forces nearest to columns^T v, by v."""
        sides, sine = self.sides, max(self.scaling[1], 1e-300)  # without friction nothing is across
        across = np.zeros_like(at.edge)  # a unit vector along the surface, across the force
        across[:, 1], across[:, 2] = -at.edge[:, 2] / sine, at.edge[:, 1] / sine
        along = (sides @ at.edge[:, :, None])[:, :, 0]
        aside = (sides @ across[:, :, None])[:, :, 0]
        beyond = ~at.inside
        turning = np.where(self.slides, 0.0, beyond * (sine * at.size / at.shear))
        pushed = (beyond & (at.size > 0.0)).astype(float)
        kept = sides[at.inside].transpose(1, 0, 2).reshape(6, -1)
        return np.asarray(kept @ kept.T + (along.T * pushed) @ along + (aside.T * turning) @ aside)

    @cached_property
    def sides(self) -> Floats:
        """`matrix` by contacts, (k, 6, 3)."""
        return np.ascontiguousarray(self.matrix.transpose(1, 0, 2))


@dataclass(frozen=True, eq=False)
class Nearest:
    """Allowed `forces` (k, 3) nearest to others: those `inside` are the same, else `size` times `edge`.

    `shear` (k,): the size along the surface of the others.
    """

    forces: Floats
    inside: NDArray[np.bool_]
    edge: Floats
    size: Floats
    shear: Floats


def allowed(grasp: Grasp, at_contacts: Floats, slides: NDArray[np.bool_], kept: NDArray[np.int64]) -> Allowed:
    """What the contacts `kept` may carry, some of which slide with accelerations at_contacts (k, 3)."""
    cosine, sine = grasp.scaling[:2]
    way, slides = at_contacts[kept, 1:], slides[kept]
    speed = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-300)
    edges = np.column_stack([np.full(len(kept), cosine), -sine * way / speed[:, None]])
    axes = 1 if grasp.friction < FRICTIONLESS else (3 if grasp.plane is None else 2)
    return Allowed(grasp.matrix[:, kept], grasp.scaling, axes, slides, edges * slides[:, None])


def least_forces(by: Allowed, wrench: Floats) -> tuple[Floats | None, bool]:
    """The shortest local forces (k, 3) allowed that balance a wrench (6,), and whether no others do.

    None if there are none, or they are not found.
    """
    left, sizes, right = np.linalg.svd(by.columns)
    rank, count = int((sizes > RANK * sizes[0]).sum()), len(right)
    factors = -right[:rank].T @ ((wrench @ left[:, :rank]) / sizes[:rank])
    start = by.forces(factors)
    if np.abs(by.columns @ factors + wrench).max() > MISSED:
        return None, False
    if rank == count or np.abs(by.nearest(start).forces - start).max() <= CONVERGED:
        return start, rank == count
    if rank == count - 1:
        return _on_line(by, start, by.forces(right[rank])), False
    found = _projected(by, wrench)
    return (_by_cones(by, factors, right[rank:].T) if found is None else found), False


def _on_line(by: Allowed, start: Floats, way: Floats) -> Floats | None:
    """The shortest of start + z way that is allowed; start, across the way, would be the shortest of all.

    What is allowed is an interval of z, and its ends are where some contact is on the edge of its cone: a root of
    (sine N)^2 = (cosine T)^2, or on the apex of a single edge.
    """
    roots = _edge_roots(by, start, way)
    roots = roots[np.argsort(np.abs(roots))]
    tried = start + roots[:, None, None] * way
    room = by.room(tried).min(axis=1)
    inside = np.flatnonzero(room >= -ON_EDGE * np.maximum(1.0, np.abs(tried).max(axis=(1, 2))))
    return tried[inside[0]] if len(inside) else None


def _edge_roots(by: Allowed, start: Floats, way: Floats) -> Floats:
    """Where start + z way meets the edges of the cones, all z (r,)."""
    weights = np.array([by.scaling[1] ** 2, -(by.scaling[0] ** 2), -(by.scaling[0] ** 2)])
    if by.axes == 1:
        weights[1:] = 0.0
    a, b, c = ((weights * one * two).sum(axis=1) for one, two in ((way, way), (start, way), (start, start)))
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        stays = np.concatenate([(-b - root) / a, (-b + root) / a, -0.5 * c / b])
        single = -(by.edges * start).sum(axis=1) / (by.edges * way).sum(axis=1)
    roots = np.concatenate([stays[~np.tile(by.slides, 3)], single[by.slides]])
    return roots[np.isfinite(roots)]


def _projected(by: Allowed, wrench: Floats) -> Floats | None:
    """By Newton's method for v, damped until the convex function falls; None if that does not converge."""
    columns = by.matrix.reshape(6, -1)
    at = _trial(by, columns, wrench, -np.linalg.lstsq(columns @ columns.T, wrench, rcond=RANK)[0])
    for _ in range(STEPS):
        if np.abs(at.missed).max() <= CONVERGED * max(1.0, float(np.abs(at.nearest.forces).max())):
            return at.nearest.forces
        curvature = by.curvature(at.nearest)
        curvature[DIAGONAL] += max(SHIFT * float(np.abs(at.missed).max()), 1e-13)
        change = -np.linalg.solve(curvature, at.missed)
        falling = 1e-4 * float(at.missed @ change)
        enough = 0.25 * float(at.missed @ at.missed)
        for size in DAMPING:
            ahead = _trial(by, columns, wrench, at.v + size * change)
            if ahead.value < at.value + size * falling or ahead.missed @ ahead.missed < enough:
                break
        at = ahead
    return None


@dataclass(frozen=True, eq=False)
class Trial:
    """The convex function of v (6,): its `value`, its gradient `missed` (6,), and the nearest forces."""

    v: Floats
    nearest: Nearest
    missed: Floats
    value: float


def _trial(by: Allowed, columns: Floats, wrench: Floats, v: Floats) -> Trial:
    nearest = by.nearest((v @ columns).reshape(-1, 3))
    flat = nearest.forces.ravel()
    return Trial(v, nearest, columns @ flat + wrench, float(0.5 * flat @ flat + wrench @ v))


def _by_cones(by: Allowed, factors: Floats, null: Floats) -> Floats | None:
    """By a cone program for z in factors + null z, the factors of the basis: slower, where Newton's method fails."""
    cosine, sine = by.scaling[:2]
    places, kinds = np.nonzero(by.free)
    parts = np.zeros((len(by.slides), 3, len(places)))
    directions = np.concatenate([np.broadcast_to(UNIT, (len(by.slides), 3, 3)), by.edges[:, None]], axis=1)
    parts[places, :, np.arange(len(places))] = directions[places, kinds]
    single = by.slides | (by.axes == 1)
    ways = np.where(by.slides[:, None], by.edges, np.eye(3)[0])
    rows = np.einsum("kj,kjm->km", ways[single], parts[single])
    triples = (parts[~single] * np.array([sine, cosine, cosine])[:, None]).reshape(-1, len(places))
    table, size = np.vstack([rows, triples]), null.shape[1]
    found = cones.minimum(np.zeros(size), -table @ null, table @ factors, len(rows), np.eye(size))
    if found is None:
        return None
    found = cones.snapped(triples @ factors, triples @ null, found) if len(triples) else found
    return np.asarray(parts @ (factors + null @ found))
