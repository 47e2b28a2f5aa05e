"""Wall quantities of a mean flow (position, shear stress) at velocity nodes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import dolfinx
import numpy as np
import ufl
from scipy.spatial import cKDTree

from .. import compat
from ..mesh.domain import Domain
from ..mesh.wall_distance import places_on_facets
from .flow import Fluid
from .space import boundary_blocks

STEEP, CORNER = 0.7, 0.95  # streamwise component of steep normals, length of normals in corners
ROUNDING = 1e-6  # relative to the length of a wall: distance of coincident positions


@dataclass(frozen=True)
class AlongWall:
    """Flow along a wall at nodes (n,), by ascending x, on all ranks.

    normals (n, gdim) point out of the fluid and are shorter than one in corners; lengths (n,) of
    wall per node; velocities (n, gdim) relative to the wall; shear_velocities (n,); facets (m, 2)
    of a resolved wall: nodes of facets, in 3-D of edges.
    """

    places: np.ndarray
    normals: np.ndarray
    lengths: np.ndarray
    velocities: np.ndarray
    shear_velocities: np.ndarray
    facets: np.ndarray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @property
    def speeds(self) -> np.ndarray:
        """Tangential speeds (n,)."""
        normals = self.normals / np.linalg.norm(self.normals, axis=1, keepdims=True)
        through = (self.velocities * normals).sum(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.velocities - through * normals, axis=1))

    def at_outflow(self) -> float:
        """Mean u* at the positions farthest downstream."""
        last = at_end(self.places[:, 0])
        return float(np.average(self.shear_velocities[last], weights=self.lengths[last]))

    @property
    def _level(self) -> np.ndarray:
        """Mask (n,) of nodes off corners and steep faces."""
        even = np.linalg.norm(self.normals, axis=1) > CORNER
        return np.asarray(even & (np.abs(self.normals[:, 0]) < STEEP))

    def coarse_share(self, largest: float) -> float:
        """Fraction of the wall stress variation in under-resolved facets (in 3-D edges).

        The stress (`velocities`) there changes by more than `largest` times the larger of its end
        values and the mean. Two facets on either side of corners and ends of the wall are excluded.
        """
        singular = np.linalg.norm(self.normals, axis=1) < CORNER
        if self.places.shape[1] == 3:
            stress = np.linalg.norm(self.velocities, axis=1)
        else:
            across = self.normals / np.linalg.norm(self.normals, axis=1, keepdims=True)
            stress = self.velocities[:, 1] * across[:, 0] - self.velocities[:, 0] * across[:, 1]
            singular |= np.bincount(self.facets.ravel(), minlength=len(stress)) == 1
        for _ in range(2):
            singular[self.facets[singular[self.facets].any(axis=1)]] = True
        ends = stress[self.facets[~singular[self.facets].any(axis=1)]]
        change, size = np.abs(ends[:, 1] - ends[:, 0]), np.abs(stress)
        bound = np.maximum(np.abs(ends).max(axis=1, initial=0.0), size.mean())
        return float(change[change > largest * bound].sum() / max(change.sum(), 1e-300))

    def backward(self) -> tuple[tuple[float, float], ...]:
        """Intervals of x with reverse flow along nearly level parts of the wall.

        Behind a falling face the interval begins at the face, where the flow separates, despite
        corner eddies.
        """
        level = self._level & (self.velocities[:, 0] != 0.0)
        x, v = self.places[level, 0], self.velocities[level, 0]
        turns = np.flatnonzero(v[1:] * v[:-1] < 0.0)
        zeros = x[turns] - v[turns] * (x[turns + 1] - x[turns]) / (v[turns + 1] - v[turns])
        ends = [*x[:1][v[:1] < 0.0], *zeros, *x[-1:][v[-1:] < 0.0]]
        faces = self.places[self.normals[:, 0] < -STEEP, 0]
        spans = zip(map(float, ends[::2]), map(float, ends[1::2]), strict=True)
        return tuple(_from_faces(spans, np.unique(faces)))


def _from_faces(
    spans: Iterable[tuple[float, float]], faces: np.ndarray
) -> list[tuple[float, float]]:
    """Extend ascending intervals back to a face that is closer than their length."""
    found: list[tuple[float, float]] = []
    for start, end in spans:
        face = float(faces[faces <= start].max(initial=-np.inf))
        if start - face < end - start:
            found, start = [one for one in found if one[1] <= face], face
        found.append((start, end))
    return found


def at_end(x: np.ndarray) -> np.ndarray:
    """Mask of the largest coordinates (n,), to round-off."""
    return np.asarray(x >= x.max() - ROUNDING * np.ptp(x))


def coarse_along(
    walls: Mapping[str, AlongWall], rough: Collection[str], largest: float
) -> float | None:
    """Largest `coarse_share` of smooth walls, or None."""
    shares = [
        one.coarse_share(largest)
        for name, one in walls.items()
        if name not in rough and len(one.facets)
    ]
    return max(shares, default=None)


def along_wall(fluid: Fluid, boundary: str, shear_velocity: Any) -> AlongWall:
    """Flow along a named boundary, in 3-D at cell vertices; `shear_velocity` is UFL. Collective."""
    domain, gdim, flow = fluid.domain, fluid.space.gdim, fluid.velocity
    # Second-order vertex functions integrate to zero over triangles, which would leave vertices without area.
    space = (
        fluid.space.velocity if gdim == 2 else compat.space(domain.mesh, ("Lagrange", 1), (gdim,))
    )
    if gdim == 3:
        flow = dolfinx.fem.Function(space)
        flow.interpolate(fluid.velocity)
    nodes = _owned_nodes(space, domain, boundary)
    lengths, normals = _lengths_and_normals(fluid, space, boundary)
    found = dolfinx.fem.Function(space)
    expression = ufl.as_vector([shear_velocity] + [0.0] * (gdim - 1))
    compat.interpolate(found, expression)
    places = space.tabulate_dof_coordinates()[nodes, :gdim]
    columns = [
        places,
        _at(lengths, nodes, gdim)[:, :1],
        _at(normals, nodes, gdim),
        flow.x.array.reshape(-1, gdim)[nodes] - fluid.walls.velocities(boundary, places),
        found.x.array.reshape(-1, gdim)[nodes, :1],
    ]
    whole = _on_all_ranks(domain, columns)
    places, lengths, normals, velocities, shears = np.split(
        whole, np.cumsum([gdim, 1, gdim, gdim]), axis=1
    )
    return AlongWall(places, normals / lengths, lengths[:, 0], velocities, shears[:, 0])


def along_resolved_wall(fluid: Fluid, boundary: str, rough: bool = False) -> AlongWall:
    """Shear stress along a named no-slip wall, as tangential `velocities`. Collective.

    In 2-D from consistent nodal tractions, off bodies averaged over two facets, without the ends of
    the wall. In 3-D from the velocity gradient at vertices; on rough walls from consistent
    tractions, without the ends.
    """
    if fluid.domain.gdim == 3:
        return _along_wall_in_space(fluid, boundary, rough)
    domain, gdim, space = fluid.domain, fluid.space.gdim, fluid.space.velocity
    nodes = _owned_nodes(space, domain, boundary)
    lengths, normals = _lengths_and_normals(fluid, space, boundary)
    rows = fluid.space.unknowns_at_nodes[nodes]
    columns = [
        space.tabulate_dof_coordinates()[nodes, :gdim],
        _at(lengths, nodes, gdim)[:, :1],
        _at(normals, nodes, gdim),
        -fluid.residual()[rows],
    ]
    whole = _on_all_ranks(domain, columns)
    places, length, normal, pull = np.split(whole, np.cumsum([gdim, 1, gdim]), axis=1)
    lengths = length[:, 0]
    ends = cKDTree(places).query(places_on_facets(domain, [boundary])[:, [0, -1]])[1]
    facets = np.unique(np.sort(ends, axis=1), axis=0)  # several ranks may share a facet
    if boundary != "body":
        pull, lengths = _mean_of_facets(pull)[1:-1], _mean_of_facets(length)[1:-1, 0]
        normal = _mean_of_facets(normal)[1:-1]
        places = places[1:-1]
        facets = facets[((facets > 0) & (facets <= len(places))).all(axis=1)] - 1
    normals = normal / lengths[:, None]
    units = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    stress = pull / lengths[:, None]
    along = stress - (stress * units).sum(axis=1, keepdims=True) * units
    shear_velocities = np.sqrt(np.linalg.norm(along, axis=1))
    return AlongWall(places, normals, lengths, along, shear_velocities, facets)


def _along_wall_in_space(fluid: Fluid, boundary: str, rough: bool) -> AlongWall:
    domain = fluid.domain
    space = compat.space(domain.mesh, ("Lagrange", 1), (3,))
    nodes = _owned_nodes(space, domain, boundary)
    w, n, one = (
        ufl.TestFunction(space),
        ufl.FacetNormal(domain.mesh),
        ufl.as_vector([1.0, 0.0, 0.0]),
    )
    slope = ufl.dot(ufl.grad(ufl.split(fluid.state)[0]), n)
    known = one, n, ufl.dot(slope, n) * n - slope

    def forms() -> list[Any]:
        found = [compat.form(ufl.inner(value, w) * domain.measure(boundary)) for value in known]
        # The eddy viscosity, and with it the velocity gradient, varies within cells at rough walls.
        return [*found[:2], compat.form(-fluid.residual_form(w, ufl.as_ufl(0)))] if rough else found

    areas, normals, pulls = fluid.kept(f"pull along {boundary}", forms)
    columns = [space.tabulate_dof_coordinates()[nodes], _at(areas, nodes, 3)[:, :1]]
    columns += [_at(form, nodes, 3) for form in (normals, pulls)]
    whole = _on_all_ranks(domain, columns)
    if rough:
        x = whole[:, 0]
        whole = whole[~(at_end(-x) | at_end(x))]
    places, area, normal, pull = np.split(whole, [3, 4, 7], axis=1)
    corners = cKDTree(places).query(places_on_facets(domain, [boundary])[:, :3])[1]
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    along = pull / area
    if rough:
        units = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        along -= (along * units).sum(axis=1, keepdims=True) * units
    else:
        along /= fluid.reynolds
    shear_velocities = np.sqrt(np.linalg.norm(along, axis=1))
    return AlongWall(
        *(places, normal / area, area[:, 0], along, shear_velocities, np.unique(edges, axis=0))
    )


def _owned_nodes(space: Any, domain: Domain, boundary: str) -> np.ndarray:
    nodes = boundary_blocks(space, domain.facets_of(boundary))
    return nodes[nodes < space.dofmap.index_map.size_local]


def _lengths_and_normals(fluid: Fluid, space: Any, boundary: str) -> list[Any]:
    """Forms of the length, or area, per boundary node (first component), and of its normal."""
    w, n = ufl.TestFunction(space), ufl.FacetNormal(fluid.domain.mesh)
    one = ufl.as_vector([1.0] + [0.0] * (len(w) - 1))
    measure = fluid.domain.measure(boundary)
    forms: list[Any] = fluid.kept(
        f"lengths and normals of {boundary}",
        lambda: [compat.form(ufl.inner(known, w) * measure) for known in (one, n)],
    )
    return forms


def _on_all_ranks(domain: Domain, columns: list[np.ndarray]) -> np.ndarray:
    """Gather the rows of all ranks, sorted by position (first columns)."""
    whole = np.concatenate(domain.comm.allgather(np.hstack(columns)))
    return np.asarray(whole[np.lexsort(whole[:, : domain.gdim].T[::-1])])


def _mean_of_facets(values: np.ndarray) -> np.ndarray:
    """Sums (n, m) over the nodes of two facets about each node; ends are unchanged."""
    if len(values) < 7:
        return values
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    found = 0.5 * padded[:-4] + padded[1:-3] + padded[2:-2] + padded[3:-1] + 0.5 * padded[4:]
    found[:2], found[-2:] = values[:2], values[-2:]
    # Sums next to the ends would include the corner of the domain.
    found[1], found[-2] = found[2], found[-3]
    return found


def _at(form: Any, nodes: np.ndarray, gdim: int) -> np.ndarray:
    """Entries (n, gdim) of an assembled vector at owned nodes."""
    return compat.owned_entries(form).reshape(-1, gdim)[nodes]
