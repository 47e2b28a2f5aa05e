"""Wall quantities of a mean flow (position, shear stress) at velocity nodes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from .. import compat
from ..mesh.domain import Domain, cell_facets, input_numbers, local_cells, vertex_numbers
from ..parallel import largest
from .flow import Fluid

STEEP, CORNER = 0.7, 0.95  # streamwise component of steep normals, length of normals in corners
ROUNDING = 1e-6  # relative to the length of a wall: distance of coincident positions


@dataclass(frozen=True)
class AlongWall:
    """Flow along a wall at nodes (n,), by ascending x, on all ranks.

    places, velocities relative to the wall (n, gdim); normals (n, gdim) out of the fluid, means of the facets';
    lengths (n,) of wall per node; shear_velocities (n,) from k; edges (m, 2): node numbers.
    """

    places: np.ndarray
    normals: np.ndarray
    lengths: np.ndarray
    velocities: np.ndarray
    shear_velocities: np.ndarray
    edges: np.ndarray

    @property
    def speeds(self) -> np.ndarray:
        normals = self.normals / np.linalg.norm(self.normals, axis=1, keepdims=True)
        through = (self.velocities * normals).sum(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.velocities - through * normals, axis=1))

    def coarse_fraction(self, stresses: np.ndarray, largest: float) -> float:
        """Fraction of the change of stresses (n,) along the wall in edges along which they change too much.

        Too much is more than `largest` times the larger stress at both ends, or the mean stress if larger. In 2-D
        stresses get the sign of the flow along the wall. Two edges beside corners and ends of the wall, where stresses
        are singular, do not count.
        """
        singular = np.linalg.norm(self.normals, axis=1) < CORNER
        if self.places.shape[1] == 2:
            v, n = self.velocities, self.normals
            stresses = stresses * np.sign(v[:, 1] * n[:, 0] - v[:, 0] * n[:, 1])
            singular |= np.bincount(self.edges.ravel(), minlength=len(stresses)) == 1
        for _ in range(2):
            singular[self.edges[singular[self.edges].any(axis=1)]] = True
        ends = stresses[self.edges[~singular[self.edges].any(axis=1)]]
        change = np.abs(ends[:, 1] - ends[:, 0])
        bound = np.maximum(np.abs(ends).max(axis=1, initial=0.0), np.abs(stresses).mean())
        return float(change[change > largest * bound].sum() / max(change.sum(), 1e-300))

    def backward(self) -> tuple[tuple[float, float], ...]:
        """Intervals of x with reverse flow along nearly level parts of the wall, the longest first."""
        even = np.linalg.norm(self.normals, axis=1) > CORNER
        level = even & (np.abs(self.normals[:, 0]) < STEEP) & (self.velocities[:, 0] != 0.0)
        x, v = self.places[level, 0], self.velocities[level, 0]
        turns = np.flatnonzero(v[1:] * v[:-1] < 0.0)
        zeros = x[turns] - v[turns] * (x[turns + 1] - x[turns]) / (v[turns + 1] - v[turns])
        ends = [*x[:1][v[:1] < 0.0], *zeros, *x[-1:][v[-1:] < 0.0]]
        faces = self.places[self.normals[:, 0] < -STEEP, 0]
        spans = zip(map(float, ends[::2]), map(float, ends[1::2]), strict=True)
        zones = _from_faces(spans, np.unique(faces))
        return tuple(sorted(zones, key=lambda zone: zone[0] - zone[1]))


def _from_faces(
    spans: Iterable[tuple[float, float]], faces: np.ndarray
) -> list[tuple[float, float]]:
    zones: list[tuple[float, float]] = []
    for start, end in spans:
        face = float(faces[faces <= start].max(initial=-np.inf))
        if start - face < end - start:
            zones, start = [zone for zone in zones if zone[1] <= face], face
        zones.append((start, end))
    return zones


def at_end(x: np.ndarray) -> np.ndarray:
    """Mask of the largest coordinates (n,), to round-off."""
    return np.asarray(x >= x.max() - ROUNDING * np.ptp(x))


def along_wall(fluid: Fluid, boundary: str, shear_velocity: Any) -> AlongWall:
    """Read the flow along a named boundary with a law of the wall; `shear_velocity` is UFL. Collective."""
    v = fluid.walls.relative(ufl.split(fluid.state)[0], boundary)
    return _along(fluid, boundary, v, shear_velocity)


def along_no_slip_wall(fluid: Fluid, boundary: str) -> AlongWall:
    """Read the shear stress along a named no-slip wall, in place of velocities. Collective."""
    n, v = ufl.FacetNormal(fluid.domain.mesh), ufl.split(fluid.state)[0]
    traction = -2 * fluid.viscosity * ufl.dot(ufl.sym(ufl.grad(v)), n)
    stress = traction - ufl.inner(traction, n) * n
    return _along(fluid, boundary, stress, ufl.inner(stress, stress) ** 0.25)


def _along(fluid: Fluid, boundary: str, velocity: Any, shear_velocity: Any) -> AlongWall:
    """Corners of cells along a boundary but for the ends of the domain, with means over facets. Collective."""
    domain, gdim = fluid.domain, fluid.space.gdim
    space = compat.space(domain.mesh, ("Lagrange", 1), (gdim,))
    nodes = compat.nodes_on(space, domain.facets_of(boundary))
    nodes = nodes[nodes < space.dofmap.index_map.size_local]

    def forms() -> list[Any]:
        w, n = ufl.TestFunction(space), ufl.FacetNormal(domain.mesh)
        unit = ufl.as_vector([1.0] + [0.0] * (gdim - 1))
        known = unit, n, velocity, shear_velocity * unit
        return [compat.form(ufl.inner(value, w) * domain.measure(boundary)) for value in known]

    compiled = fluid.kept(f"flow along {boundary}", forms)
    means = [compat.owned_entries(form).reshape(-1, gdim)[nodes] for form in compiled]
    columns = np.hstack([space.tabulate_dof_coordinates()[nodes, :gdim], *means])
    whole = np.concatenate(domain.comm.allgather(columns))
    numbers = np.concatenate(domain.comm.allgather(vertex_numbers(space)[nodes]))
    order = np.lexsort(whole[:, :gdim].T[::-1])
    whole = whole[order]
    mine, comm = domain.mesh.geometry.x[:, 0], domain.comm
    low, high = -largest(comm, -mine, -np.inf), largest(comm, mine, -np.inf)
    inner = np.minimum(whole[:, 0] - low, high - whole[:, 0]) > ROUNDING * (high - low)
    edges = _edges(domain, boundary, numbers[order])
    edges = np.cumsum(inner)[edges[inner[edges].all(axis=1)]] - 1
    places, lengths, *sums = np.split(whole[inner], 5, axis=1)
    normals, velocities, shears = (integral / lengths[:, :1] for integral in sums)
    return AlongWall(places, normals, lengths[:, 0], velocities, shears[:, 0], edges)


def _edges(domain: Domain, boundary: str, numbers: np.ndarray) -> np.ndarray:
    """Edges (m, 2) of a boundary between its vertices, whose `numbers` (n,) are those of the input. Collective."""
    mesh, gdim = domain.mesh, domain.gdim
    facets, rows = cell_facets(mesh, local_cells(mesh))
    mine = input_numbers(mesh)[rows[np.isin(facets, domain.facets_of(boundary))]]
    ascending = np.argsort(numbers)
    corners = np.concatenate(domain.comm.allgather(mine))
    places = ascending[np.searchsorted(numbers, corners, sorter=ascending)]
    pairs = [[0, 1]] if gdim == 2 else [[0, 1], [1, 2], [2, 0]]
    return np.unique(np.sort(places[:, pairs].reshape(-1, 2), axis=1), axis=0)
