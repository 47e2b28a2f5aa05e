"""Wall quantities of a mean flow (distance, shear stress) at the nodes of the velocity."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc
from scipy.spatial import cKDTree

from .. import compat
from ..compat import petsc
from ..mesh.domain import Domain
from ..mesh.wall_distance import places_on_facets
from .flow import Fluid
from .space import boundary_blocks

STEEP, CORNER = 0.7, 0.95  # of normals: from which streamwise fraction on, below which length
ROUNDING = 1e-6  # of the length of a wall: how far apart places are that are one


@dataclass(frozen=True)
class AlongWall:
    """The flow next to a wall at nodes (n,), by ascending x, on all ranks.

    places (n, gdim); normals (n, gdim) out of the fluid, shorter than one in corners: the means of their sides';
    lengths (n,) of wall that go with each node; velocities (n, gdim), relative to the wall; and shear_velocities (n,),
    those that k stands for; facets (m, 2) of a resolved wall by the numbers of their ends, in 3-D their edges
    """

    places: np.ndarray
    normals: np.ndarray
    lengths: np.ndarray
    velocities: np.ndarray
    shear_velocities: np.ndarray
    facets: np.ndarray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @property
    def speeds(self) -> np.ndarray:
        """(n,) of the flow along the wall."""
        normals = self.normals / np.linalg.norm(self.normals, axis=1, keepdims=True)
        through = (self.velocities * normals).sum(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.velocities - through * normals, axis=1))

    def at_outflow(self) -> float:
        """u* in the mean over the places farthest downstream."""
        last = at_end(self.places[:, 0])
        return float(np.average(self.shear_velocities[last], weights=self.lengths[last]))

    @property
    def _level(self) -> np.ndarray:
        """Which places (n,) are no corners, and rather level than steep."""
        even = np.linalg.norm(self.normals, axis=1) > CORNER
        return np.asarray(even & (np.abs(self.normals[:, 0]) < STEEP))

    def coarse_share(self, largest: float) -> float:
        """The fraction of the change of the stress along a wall in cells in which it changes too much, in 3-D in edges.

        Too much is more than `largest` times the larger stress at both ends of the cell, or the mean stress if that is
        larger still. `velocities` are stresses. Where they are singular, at corners and at the ends of the wall, two
        facets to both sides do not count, since stresses are means over two.
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
        """Intervals of x in which the flow runs against the first axis, where the wall is rather level than steep.

        Corners do not count. Behind a face that falls an interval begins at the face, where the flow has left the
        wall, although next to the face eddies of the corner may turn otherwise.
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
    """Ascending intervals, each longer than its distance from a face behind which it is beginning there."""
    found: list[tuple[float, float]] = []
    for start, end in spans:
        face = float(faces[faces <= start].max(initial=-np.inf))
        if start - face < end - start:
            found, start = [one for one in found if one[1] <= face], face
        found.append((start, end))
    return found


def at_end(x: np.ndarray) -> np.ndarray:
    """Which of places (n,) are the farthest, but for rounding, wherever the domain lies."""
    return np.asarray(x >= x.max() - ROUNDING * np.ptp(x))


def coarse_along(
    walls: Mapping[str, AlongWall], rough: Collection[str], largest: float
) -> float | None:
    """The largest `coarse_share` of walls but the rough ones; None without one."""
    shares = [
        one.coarse_share(largest)
        for name, one in walls.items()
        if name not in rough and len(one.facets)
    ]
    return max(shares, default=None)


def along_wall(fluid: Fluid, boundary: str, shear_velocity: Any) -> AlongWall:
    """Read the flow along a named boundary, in 3-D at corners of cells; `shear_velocity` is UFL. Collective."""
    domain, gdim, flow = fluid.domain, fluid.space.gdim, fluid.velocity
    # In 3-D the functions of corners in elements of order two integrate to zero: no area would go with them.
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
    """Read the shear stress along a named wall, to which the fluid sticks. Collective.

    `velocities` stand for the direction, along the wall, in which the fluid pulls. In 2-D stresses are the
    consistent tractions of the nodes, away from bodies means over two facets, since triangles lean to one side and the
    other; the ends of the wall are left out. In 3-D they are those of the velocity's slope at corners of cells; on
    rough walls they are consistent tractions there, too, and the ends are left out.
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
    facets = np.unique(np.sort(ends, axis=1), axis=0)  # some are known to several ranks
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
    """The shear stress along a named 3-D wall, at corners of cells. Collective."""
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
        # Within the cells at rough walls the viscosity of eddies changes, and the slope with it.
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
    """Nodes on a named boundary that this rank owns."""
    nodes = boundary_blocks(space, domain.facets_of(boundary))
    return nodes[nodes < space.dofmap.index_map.size_local]


def _lengths_and_normals(fluid: Fluid, space: Any, boundary: str) -> list[Any]:
    """Forms of the length, or area, that goes with each node of a boundary, in the first component, and its normal."""
    w, n = ufl.TestFunction(space), ufl.FacetNormal(fluid.domain.mesh)
    one = ufl.as_vector([1.0] + [0.0] * (len(w) - 1))
    measure = fluid.domain.measure(boundary)
    forms: list[Any] = fluid.kept(
        f"lengths and normals of {boundary}",
        lambda: [compat.form(ufl.inner(known, w) * measure) for known in (one, n)],
    )
    return forms


def _on_all_ranks(domain: Domain, columns: list[np.ndarray]) -> np.ndarray:
    """The rows of all ranks, the first columns being places, in the order of these. Collective."""
    whole = np.concatenate(domain.comm.allgather(np.hstack(columns)))
    return np.asarray(whole[np.lexsort(whole[:, : domain.gdim].T[::-1])])


def _mean_of_facets(values: np.ndarray) -> np.ndarray:
    """Sums (n, m) over the nodes of two facets about each node, ends as they are."""
    if len(values) < 7:
        return values
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    found = 0.5 * padded[:-4] + padded[1:-3] + padded[2:-2] + padded[3:-1] + 0.5 * padded[4:]
    found[:2], found[-2:] = values[:2], values[-2:]
    # Sums at the ends, where there is no second facet, would hold the corner of the domain.
    found[1], found[-2] = found[2], found[-3]
    return found


def _at(form: Any, nodes: np.ndarray, gdim: int) -> np.ndarray:
    """(n, gdim) entries of a vector tested with velocities, at owned nodes. Collective."""
    vector = petsc.assemble_vector(form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    values = vector.array_r.reshape(-1, gdim)[nodes].copy()
    vector.destroy()
    return np.asarray(values)
