"""Contact forces of least size, where several sets of forces do the same.

Of all forces x that the contacts allow and that balance a wrench w, columns x = -w, the shortest is the
projection x = P(columns^T v) of a wrench v on what is allowed; v solves columns P(columns^T v) = -w, which is the
condition for a minimum of the convex function |P(columns^T v)|^2 / 2 + w . v. Where what is allowed has edges and
no circular cones x is found exactly, by non-negative least squares.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from incipient.arrays import Floats
from incipient.contact.exact import cones
from incipient.contact.exact.grasp import Grasp
from incipient.contact.friction_law import FrictionLaw

RANK = 1e-10  # singular values below it, relative to the largest, count as zero
MISSED = 1e-9  # how far the wrench may be missed, in numbers of order one
INSIDE, ON_EDGE = 1e-13, 1e-12  # of room in a cone: without more ado, and relative to the forces
UNIT = np.eye(3)


@dataclass(frozen=True, eq=False)
class Allowed:
    """What k contacts may carry: their friction cones, but where they slide only the edge against it."""

    matrix: Floats  # (6, k, 3): wrenches of unit local forces
    law: FrictionLaw
    axes: int  # how many components of a force can be other than zero
    slides: NDArray[np.bool_]  # (k,)
    edges: Floats  # (k, 3): unit forces where they slide, else zero

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
        return np.where(self.slides | (self.axes == 1), forces[..., 0], self.law.room(forces))

    def facets(self, forces: Floats) -> Floats:
        """(r, m): polyhedral cones are where these are not negative, by forces (m, k, 3) as in `room`."""
        flat = self.slides | (self.axes == 1)
        normal, along = forces[:, :, 0], self.law.scaling[0] * forces[:, ~flat, 1]
        pressed = self.law.scaling[1] * normal[:, ~flat]
        return np.asarray(
            np.concatenate([normal[:, flat], pressed - along, pressed + along], axis=1).T
        )


def allowed(grasp: Grasp, kept: list[int], slides: NDArray[np.bool_], way: Floats) -> Allowed:
    """What the k contacts `kept` may carry, some of which slide, `slides` (k,), with accelerations `way` (k, 3)."""
    cosine, sine = grasp.law.scaling[:2]
    edges = np.zeros_like(way)
    if slides.any():
        speed = np.maximum(np.hypot(way[:, 1], way[:, 2]), 1e-300)
        edges[:, 0] = cosine * slides
        edges[:, 1:] = (-sine * slides / speed)[:, None] * way[:, 1:]
    axes = 1 if grasp.law.is_frictionless else (3 if grasp.plane is None else 2)
    return Allowed(grasp.matrix[:, kept], grasp.law, axes, slides, edges)


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
    if rank == count or by.room(start).min() >= -INSIDE:
        return start, rank == count
    if rank == count - 1:
        return _on_line(by, start, by.forces(right[rank])), False
    polyhedral = by.axes < 3 or bool(by.slides.all())  # there is no circular cone
    found = _on_facets(by, start, right[rank:]) if polyhedral else _projected(by, wrench)
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
    weights = np.array(
        [by.law.scaling[1] ** 2, -(by.law.scaling[0] ** 2), -(by.law.scaling[0] ** 2)]
    )
    if by.axes == 1:
        weights[1:] = 0.0
    a, b, c = (
        (weights * one * two).sum(axis=1) for one, two in ((way, way), (start, way), (start, start))
    )
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        stays = np.concatenate([(-b - root) / a, (-b + root) / a, -0.5 * c / b])
        single = -(by.edges * start).sum(axis=1) / (by.edges * way).sum(axis=1)
    roots = np.concatenate([stays[~np.tile(by.slides, 3)], single[by.slides]])
    return roots[np.isfinite(roots)]


def _on_facets(by: Allowed, start: Floats, null: Floats) -> Floats | None:
    """The shortest of start + z null that polyhedral cones allow, null being factors (m, f); None if not found.

    Least distance programming by non-negative least squares (Lawson and Hanson 1974, chapter 23): of G z >= h the
    shortest z is G^T u / (1 - h.u), with the u >= 0 for which (G^T u, h.u) is nearest to (0, 1).
    """
    ways, size = np.array([by.forces(way) for way in null]), np.abs(start).max()
    rows, limits = by.facets(ways), -by.facets(start[None])[:, 0] / size
    target = np.append(np.zeros(len(null)), 1.0)
    try:
        u = nnls(np.vstack([rows.T, limits]), target)[0]
    except RuntimeError:  # it cycles, which it rarely does
        return None
    left = 1.0 - limits @ u
    if left <= RANK:  # nothing is allowed
        return None
    found = start + np.tensordot(size * (u @ rows) / left, ways, axes=1)
    return found if by.room(found).min() >= -ON_EDGE * np.abs(found).max() else None


def _projected(by: Allowed, wrench: Floats) -> Floats | None:
    """The least forces by Newton's method, damped until the convex function falls; None if it does not converge."""
    from incipient.contact.exact import (
        compiled,
    )  # numba takes time to import, and most cases do without

    rows = np.ascontiguousarray(by.matrix.reshape(6, -1).T)
    cosine, sine = by.law.scaling[:2]
    found, forces = compiled.balancing_forces(rows, cosine, sine, by.slides, by.edges, wrench)
    return np.asarray(forces).reshape(-1, 3) if found else None


def _by_cones(by: Allowed, factors: Floats, null: Floats) -> Floats | None:
    """The least forces by a cone program for z in factors + null z: slower, for where Newton's method fails."""
    cosine, sine = by.law.scaling[:2]
    places, kinds = np.nonzero(by.free)
    parts = np.zeros((len(by.slides), 3, len(places)))
    directions = np.concatenate(
        [np.broadcast_to(UNIT, (len(by.slides), 3, 3)), by.edges[:, None]], axis=1
    )
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
