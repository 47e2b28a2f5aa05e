"""Meshes that follow bodies, rigid near them, less displaced farther away; and stretched ones.

A vertex at X moves to x = X + w (c - c0) + (R(w_r theta) - I) (X - c0), with the body's translation c - c0 and rotation
theta. The weights w, one a direction, and w_r are one near the body and zero on other boundaries, but nodes slide along
straight sides. Positions depend on the body's position alone, so that the mesh's velocity is as accurate as the body's.
Displacements of several parts are added. The mesh slides along discs, spheres, and around axes of revolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import basix
import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats, determinants, spatial
from ..compat import petsc
from ..geometry.placement import Placement
from ..meshes import SYMMETRY
from ..symmetric import solve_symmetric
from .domain import CELLS, Domain, barycentric_nodes, is_node_of, shape_functions, straight_cells

# Potential, one on the body and zero on the other boundaries, above which the mesh is rigid.
RIGID = 0.75
# Smallest admissible quality of a moved cell, over that of the cell as made.
LEAST_QUALITY = 0.02


@dataclass(frozen=True)
class MeshQuality:
    """The worst cell: its quality (1 equilateral, 0 flat, negative folded), and that over its first one."""

    worst: float
    relative: float


class RigidDisplacement:
    """Displacement of the mesh by one body. Collective unless stated otherwise.

    Args:
        domain: with its initial mesh.
        boundary: name of the body's boundary.
        placement: initial, of the body.
        turning: whether the mesh turns with the body; False for discs and spheres.
        axis: of revolution at that placement, about which the mesh does not turn.
        others: names of boundaries that other parts displace, along which nodes do not slide.

    Attributes:
        weights: (n, gdim + 1) fraction of the body's displacement in each direction, and of its turn.
    """

    def __init__(
        self,
        domain: Domain,
        boundary: str,
        placement: Placement,
        turning: bool,
        others: tuple[str, ...] = (),
        axis: Floats | None = None,
    ):
        self.boundary, self.placement, self.turning, self._gdim = (
            boundary,
            placement,
            turning,
            domain.gdim,
        )
        self._axis = axis
        self._between = _between_vertices(domain.mesh) if turning else None
        self._arms: Floats = domain.mesh.geometry.x[:, : self._gdim] - np.asarray(placement.centre)
        # A turn of a mirror-symmetric body leaves the plane of symmetry in place.
        turning_within = (SYMMETRY,) if domain.halved else ()
        sliding = [*_sliding(domain, (boundary, *others)), turning_within]
        self.weights = weights_of(domain, boundary, sliding)

    def at(self, placement: Placement) -> Floats:
        """Displacements (n, 3) of the mesh's nodes at a placement of the body. Not collective."""
        along, about = self.weights[:, : self._gdim], self.weights[:, self._gdim :]
        way = np.asarray(placement.centre) - np.asarray(self.placement.centre)
        moved = along * way
        if self._between is not None:
            turn = placement.turn_since(self.placement)
            if self._axis is not None:
                turn = _tilt(self._axis, turn)
            moved += _turned(self._arms, about * turn) - self._arms
            # Shifts are linear in each cell already, as the weights are; turns are not.
            nodes, vertices, shares = self._between
            moved[nodes] = np.einsum("nc,ncd->nd", shares, moved[vertices])
        return spatial(moved)


class MeshMotion:
    """Moves the mesh of a domain in place by the sum of displacements. Collective unless stated otherwise."""

    def __init__(self, domain: Domain):
        self.domain = domain
        self.reference: Floats = domain.mesh.geometry.x.copy()
        self._cells = compat.geometry_dofs(domain.mesh)
        self._slopes = _slopes(domain.mesh)
        self._qualities = self._cell_qualities(self.reference)

    def places(self, *displacements: Floats) -> Floats:
        """Positions (n, 3) of the mesh's nodes under displacements (n, 3). Not collective."""
        return np.asarray(sum(displacements, start=self.reference))

    def move(self, *displacements: Floats) -> None:
        self.domain.mesh.geometry.x[:] = self.places(*displacements)

    def quality(self, places: Floats | None = None) -> MeshQuality:
        qualities = self._cell_qualities(self.domain.mesh.geometry.x if places is None else places)
        worst, relative = qualities.min(initial=1.0), (qualities / self._qualities).min(initial=1.0)
        comm = self.domain.comm
        return MeshQuality(
            comm.allreduce(float(worst), op=MPI.MIN), comm.allreduce(float(relative), op=MPI.MIN)
        )

    def _cell_qualities(self, places: Floats) -> Floats:
        """The least of d det(A)^(2/d) / |A|^2 (cells,), A mapping from an equilateral cell."""
        gdim = self.domain.gdim
        nodes = places[self._cells, :gdim].transpose(2, 0, 1)
        jacobians = nodes[:, None] @ self._slopes.transpose(0, 2, 1)  # (gdim, gdim, cells, points)
        volume = determinants(jacobians)
        size = (jacobians**2).sum(axis=(0, 1))
        quality = gdim * np.sign(volume) * np.abs(volume) ** (2 / gdim) / np.maximum(size, 1e-300)
        return np.asarray(quality.min(axis=1))


def _between_vertices(mesh: Any) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats]:
    """Nodes (m,) of straight cells other than vertices, and their barycentric coordinates. Collective.

    A node is among them on every rank that has it, though the straight cell may be another rank's.
    """
    cells, corners = compat.geometry_dofs(mesh), barycentric_nodes(mesh)
    space = compat.function_space(mesh, compat.scalar_part(compat.coordinate_element(mesh)))
    dofs, of_straight = compat.cell_dofs(space), is_node_of(space, straight_cells(mesh))
    count = corners.shape[1]
    # Several cells share a node, and agree on it: what lies within an edge or a face has no share of other vertices.
    nodes, first = np.unique(cells[:, count:], return_index=True)
    row, column = np.divmod(first, corners.shape[0] - count)
    chosen = of_straight[dofs[row, count + column]]
    row, column = row[chosen], count + column[chosen]
    return nodes[chosen], cells[row, :count], corners[column]


def _sliding(domain: Domain, moving: tuple[str, ...]) -> list[tuple[str, ...]]:
    space = compat.function_space(
        domain.mesh, compat.scalar_part(compat.coordinate_element(domain.mesh))
    )
    names = [name for name in sorted(domain.names) if name not in moving]
    normals = {name: _normal_axis(domain, name, space) for name in names}
    return [
        tuple(name for name in names if normals[name] not in (None, axis))
        for axis in range(domain.gdim)
    ]


def _normal_axis(domain: Domain, name: str, space: Any) -> int | None:
    blocks = compat.nodes_on(space, domain.facets_of(name))
    points = space.tabulate_dof_coordinates()[blocks, : domain.gdim]
    low = np.min(domain.comm.allgather(points.min(axis=0, initial=np.inf)), axis=0)
    high = np.max(domain.comm.allgather(points.max(axis=0, initial=-np.inf)), axis=0)
    # Plane and normal to an axis along which the boundary has no extent
    flat = np.flatnonzero(high - low <= 1e-9 * float((high - low).max()))
    return int(flat[0]) if len(flat) else None


def weights_of(
    domain: Domain, boundary: str, sliding: Sequence[tuple[str, ...]], rigid: float = RIGID
) -> Floats:
    """Weights (n, k) of the mesh's nodes, from potentials between the boundaries at the vertices. Collective.

    Each potential is one on `boundary`, zero on the others except its `sliding` ones; weights are one where it is above
    `rigid`, in proportion to it elsewhere.
    """
    mesh, space = domain.mesh, compat.space(domain.mesh, ("Lagrange", 1))
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    stiffness = compat.form(ufl.inner(ufl.grad(u), ufl.grad(w)) * ufl.dx)
    zero = compat.form(ufl.inner(dolfinx.fem.Constant(mesh, 0.0), w) * ufl.dx)
    values = np.empty((len(mesh.geometry.x), len(sliding)))
    for column, free in enumerate(sliding):
        held = [name for name in sorted(domain.names) if name not in (boundary, *free)]
        conditions = [
            dolfinx.fem.dirichletbc(
                PETSc.ScalarType(float(name == boundary)),
                compat.nodes_on(space, domain.facets_of(name)),
                space,
            )
            for name in [*held, boundary]
        ]
        matrix, right = compat.matrix_of(stiffness, conditions), petsc.assemble_vector(zero)
        petsc.apply_lifting(right, [stiffness], [conditions])
        right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        petsc.set_bc(right, conditions)
        potential = dolfinx.fem.Function(space)
        solve_symmetric(matrix, right, potential, 1e-10, multigrid=True)
        at_vertices = np.clip(potential.x.array / rigid, 0.0, 1.0)[compat.cell_dofs(space)]
        values[compat.geometry_dofs(mesh), column] = at_vertices @ barycentric_nodes(mesh).T
    return values


def _slopes(mesh: Any) -> Floats:
    gdim, degree, element = mesh.topology.dim, compat.geometry_degree(mesh), shape_functions(mesh)
    # Straight cells have one Jacobian; the determinant of curved ones is of the lattice's order in 2-D.
    points = basix.create_lattice(
        CELLS[gdim], max(1, 2 * (degree - 1)), basix.LatticeType.equispaced, True
    )
    table = element.tabulate(1, points if degree > 1 else points[:1])[1:, :, :, 0]
    flat = [[1.0, 0.5, 0.5], [0.0, 3**0.5 / 2, 3**0.5 / 6], [0.0, 0.0, (2 / 3) ** 0.5]]
    edges = np.array(flat)[:gdim, :gdim]  # of the equilateral cell, as columns
    return np.asarray(np.einsum("kpn,kd->dpn", table, np.linalg.inv(edges)))


def _turned(arms: Floats, rotations: Floats) -> Floats:
    from scipy.spatial.transform import Rotation  # which takes time to import

    vectors = rotations if arms.shape[1] == 3 else rotations * [0.0, 0.0, 1.0]
    return np.asarray(Rotation.from_rotvec(vectors).apply(spatial(arms))[:, : arms.shape[1]])


def _tilt(axis: Floats, turn: Floats) -> Floats:
    """The shortest rotation vector (3,) that moves an axis as a rotation vector does."""
    after = _turned(axis[None], turn[None])[0]
    normal = np.cross(axis, after)
    sine = np.linalg.norm(normal)
    return np.asarray(normal * np.arctan2(sine, axis @ after) / max(sine, 1e-300))


def stretched(x: Floats, centre: Floats, kept: Floats, old: Floats, new: Floats) -> Floats | None:
    """Points (n, 3) of one box in another; None where stretching is impossible. Not collective.

    Boxes (2, 3) are their least and largest coordinates. On each axis a point within `kept` (3,) of the centre is
    fixed; beyond, a parabola maps the old side to the new one.
    """
    moved = x.copy()
    for axis in range(3):
        for side, end, new_end in zip((-1.0, 1.0), old[:, axis], new[:, axis], strict=True):
            way = side * (new_end - end)
            room = side * (end - centre[axis]) - kept[axis]
            if abs(way) < 1e-12 * float(np.ptp(old, axis=0).max()):
                continue
            if room <= 0.0 or way <= -0.5 * room:  # a shorter way back would fold the cells
                return None
            beyond = np.maximum(side * (x[:, axis] - centre[axis]) - kept[axis], 0.0)
            moved[:, axis] += side * way * (beyond / room) ** 2
    return moved
