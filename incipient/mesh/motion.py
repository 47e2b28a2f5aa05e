"""The mesh that follows what moves in it: rigid near a body, blended out from there, its cells watched.

A node at X goes to x = X + w (c - c0) + (R(w_r theta) - I) (X - c0), where c - c0 and theta are the body's
translation and rotation since the mesh was made. The weights w, one for each direction, and w_r are one near the
body and zero on other boundaries; but along straight sides the nodes slide, so that a long channel's mesh is
stretched before and behind the body instead of being sheared above and below it. So vertices go; the other nodes of a
straight cell go where it stays straight. The places are a smooth function of the body's place alone: nothing is solved,
and the mesh's velocity has the accuracy of the body's.
Where several parts move, each adds its displacement, which vanishes on the boundaries of the others.
A body whose surface is the same however it is turned (disc, sphere) does not turn the mesh, which slides along it.
"""

from __future__ import annotations

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
from ..arrays import Floats, spatial
from ..compat import petsc
from ..geometry.placement import Placement
from ..meshes import SYMMETRY
from .domain import Domain
from .straight import barycentric_nodes, straight_cells

# Potential, one on the body and zero on the other boundaries, above which the mesh is rigid.
RIGID = 0.75
# Extent of a boundary along an axis, relative to its largest, below which it is plane and normal to the axis.
FLAT = 1e-9


@dataclass(frozen=True)
class MeshQuality:
    """The worst cell: its quality (1 equilateral, 0 flat, negative folded), and that over its quality when made."""

    worst: float
    relative: float


class RigidDisplacement:
    """Displacement of the mesh by one body. Collective unless stated otherwise.

    Args:
        domain: whose mesh is as it was made.
        boundary: name of the body's boundary.
        placement: where the body was when the mesh was made.
        turning: whether the mesh turns with the body; False for discs and spheres.
        others: names of boundaries that other parts displace, along which nodes do not slide.

    Attributes:
        weights: (n, gdim + 1) how far each node follows the body in each direction, and when it turns.
    """

    def __init__(
        self,
        domain: Domain,
        boundary: str,
        placement: Placement,
        turning: bool,
        others: tuple[str, ...] = (),
    ):
        self.boundary, self.placement, self.turning, self._gdim = (
            boundary,
            placement,
            turning,
            domain.gdim,
        )
        self._between = _between_vertices(domain.mesh) if turning else None
        self._arms: Floats = domain.mesh.geometry.x[:, : self._gdim] - np.asarray(placement.centre)
        potentials = Potentials(domain)
        # A turn of a body that is its own mirror image leaves the plane of symmetry in its place.
        turning_within = (SYMMETRY,) if domain.halved else ()
        along_others = _sliding(domain, boundary)
        sliding = [
            *(tuple(n for n in names if n not in others) for names in along_others),
            turning_within,
        ]
        self.weights = np.column_stack([potentials.weights(boundary, names) for names in sliding])

    def at(self, placement: Placement) -> Floats:
        """(n, 3) displacements of the mesh's nodes when the body is there. Not collective."""
        along, about = self.weights[:, : self._gdim], self.weights[:, self._gdim :]
        way = np.asarray(placement.centre) - np.asarray(self.placement.centre)
        moved = along * way
        if self._between is not None:
            moved += _turned(self._arms, about * placement.turn_since(self.placement)) - self._arms
            # Shifts are linear in each cell already, as the weights are; turns are not.
            nodes, vertices, shares = self._between
            moved[nodes] = np.einsum("nc,ncd->nd", shares, moved[vertices])
        return spatial(moved)


class MeshMotion:
    """Moves the mesh of a domain, in place, by the sum of what each part adds. Collective unless stated otherwise."""

    def __init__(self, domain: Domain):
        self.domain = domain
        self.reference: Floats = domain.mesh.geometry.x.copy()
        self._cells = compat.geometry_dofs(domain.mesh)
        self._slopes = _slopes(domain.mesh)
        self._qualities = self._cell_qualities(self.reference)

    def places(self, *displacements: Floats) -> Floats:
        """(n, 3) places of the mesh's nodes under displacements (n, 3), one a part. Not collective."""
        return np.asarray(sum(displacements, start=self.reference))

    def move(self, *displacements: Floats) -> None:
        """Move the mesh to where the displacements put it. Not collective."""
        self.domain.mesh.geometry.x[:] = self.places(*displacements)

    def quality(self, places: Floats | None = None) -> MeshQuality:
        """Quality of the mesh as it is now, or as it would be with its nodes at other places (n, 3)."""
        qualities = self._cell_qualities(self.domain.mesh.geometry.x if places is None else places)
        worst, relative = qualities.min(initial=1.0), (qualities / self._qualities).min(initial=1.0)
        comm = self.domain.comm
        return MeshQuality(
            comm.allreduce(float(worst), op=MPI.MIN), comm.allreduce(float(relative), op=MPI.MIN)
        )

    def _cell_qualities(self, places: Floats) -> Floats:
        """(cells,) the least of d det(A)^(2/d) / |A|^2 over points of each cell, A mapping from an equilateral one."""
        gdim = self.domain.gdim
        nodes = places[self._cells, :gdim].transpose(2, 0, 1)
        jacobians = nodes[:, None] @ self._slopes.transpose(0, 2, 1)  # (gdim, gdim, cells, points)
        volume = _determinant(jacobians)
        size = (jacobians**2).sum(axis=(0, 1))
        quality = gdim * np.sign(volume) * np.abs(volume) ** (2 / gdim) / np.maximum(size, 1e-300)
        return np.asarray(quality.min(axis=1))


def _determinant(a: Floats) -> Floats:
    """Determinants (...) of small matrices (d, d, ...), written out: far faster than factorising each."""
    if len(a) == 2:
        return np.asarray(a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    return np.asarray((a[0] * np.cross(a[1], a[2], axis=0)).sum(axis=0))


def _between_vertices(mesh: Any) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats]:
    """The other nodes (m,) of straight cells in `mesh.geometry.x`, vertices between which they lie, and their shares.

    Vertices and shares, barycentric coordinates, are (m, dimension + 1). A node is among them on every rank that has
    it, though the straight cell may be another rank's. Collective.
    """
    cells, corners = compat.geometry_dofs(mesh), barycentric_nodes(mesh)
    space = compat.function_space(mesh, compat.scalar_part(compat.coordinate_element(mesh)))
    dofs, marked = compat.cell_dofs(space), dolfinx.fem.Function(space)
    marked.x.array[dofs[straight_cells(mesh)]] = 1.0
    view = compat.vec_view(marked)
    view.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    view.destroy()
    marked.x.scatter_forward()
    count = corners.shape[1]
    # Several cells share a node, and agree on it: what lies within an edge or a face has no share of other vertices.
    nodes, first = np.unique(cells[:, count:], return_index=True)
    row, column = np.divmod(first, corners.shape[0] - count)
    chosen = marked.x.array[dofs[row, count + column]] > 0.0
    row, column = row[chosen], count + column[chosen]
    return nodes[chosen], cells[row, :count], corners[column]


def _sliding(domain: Domain, boundary: str) -> list[tuple[str, ...]]:
    """The boundaries along which nodes may slide in each direction: plane ones, normal to another axis."""
    space = compat.function_space(
        domain.mesh, compat.scalar_part(compat.coordinate_element(domain.mesh))
    )
    names = [name for name in sorted(domain.names) if name != boundary]
    normals = {name: _normal_axis(domain, name, space) for name in names}
    return [
        tuple(name for name in names if normals[name] not in (None, axis))
        for axis in range(domain.gdim)
    ]


def _normal_axis(domain: Domain, name: str, space: Any) -> int | None:
    """The axis that a plane boundary is normal to; None for others."""
    blocks = compat.nodes_on(space, domain.facets_of(name))
    points = space.tabulate_dof_coordinates()[blocks, : domain.gdim]
    low = np.min(domain.comm.allgather(points.min(axis=0, initial=np.inf)), axis=0)
    high = np.max(domain.comm.allgather(points.max(axis=0, initial=-np.inf)), axis=0)
    flat = np.flatnonzero(high - low <= FLAT * float((high - low).max()))
    return int(flat[0]) if len(flat) else None


class Potentials:
    """Potentials between the boundaries of a domain, on the nodes of its mesh. Every method is collective."""

    def __init__(self, domain: Domain):
        mesh = domain.mesh
        self.domain = domain
        self.space = compat.space(mesh, ("Lagrange", 1))
        u, w = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        self._stiffness = compat.form(ufl.inner(ufl.grad(u), ufl.grad(w)) * ufl.dx)
        self._zero = compat.form(ufl.inner(dolfinx.fem.Constant(mesh, 0.0), w) * ufl.dx)

    def weights(self, boundary: str, sliding: tuple[str, ...] = (), rigid: float = RIGID) -> Floats:
        """(n,) weight of each node of the mesh's geometry, from the potential between the boundaries at the vertices.

        It is one on the body's `boundary` and zero on the others but for those along which the nodes are `sliding`;
        and it is one wherever the potential is above `rigid`, in proportion to it elsewhere.
        """
        mesh, space = self.domain.mesh, self.space
        held = [name for name in sorted(self.domain.names) if name not in (boundary, *sliding)]
        conditions = [
            _fixed(space, self.domain.facets_of(name), float(name == boundary))
            for name in [*held, boundary]
        ]
        potential = dolfinx.fem.Function(space)
        self._solve(conditions, potential)
        at_vertices = np.clip(potential.x.array / rigid, 0.0, 1.0)
        values = np.empty(len(mesh.geometry.x))
        values[compat.geometry_dofs(mesh)] = (
            at_vertices[compat.cell_dofs(space)] @ barycentric_nodes(mesh).T
        )
        return values

    def _solve(self, conditions: list[Any], potential: Any) -> None:
        """Laplace's equation with the given boundary values."""
        matrix = petsc.assemble_matrix(self._stiffness, conditions)
        matrix.assemble()
        right = petsc.assemble_vector(self._zero)
        petsc.apply_lifting(right, [self._stiffness], [conditions])
        right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        petsc.set_bc(right, conditions)
        solver = PETSc.KSP().create(self.space.mesh.comm)
        solver.setOperators(matrix)
        solver.setType("cg")
        solver.getPC().setType("hypre" if PETSc.Sys.hasExternalPackage("hypre") else "jacobi")
        solver.setTolerances(rtol=1e-10, max_it=10_000)
        solution = matrix.createVecRight()
        solver.solve(right, solution)
        potential.x.array[: solution.getLocalSize()] = solution.array_r
        potential.x.scatter_forward()
        for held in (matrix, right, solution, solver):
            held.destroy()


def _fixed(space: Any, facets: NDArray[np.int32], value: float) -> Any:
    return dolfinx.fem.dirichletbc(PETSc.ScalarType(value), compat.nodes_on(space, facets), space)


def _slopes(mesh: Any) -> Floats:
    """(gdim, points, nodes) derivatives of the cell's shape functions along the axes of an equilateral cell."""
    gdim, degree = mesh.topology.dim, compat.geometry_degree(mesh)
    kind = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}[gdim]
    element = basix.create_element(
        basix.ElementFamily.P, kind, degree, basix.LagrangeVariant.equispaced
    )
    # Straight cells have one Jacobian; the determinant of curved ones is of the lattice's order in the plane.
    points = basix.create_lattice(
        kind, max(1, 2 * (degree - 1)), basix.LatticeType.equispaced, True
    )
    table = element.tabulate(1, points if degree > 1 else points[:1])[1:, :, :, 0]
    flat = [[1.0, 0.5, 0.5], [0.0, 3**0.5 / 2, 3**0.5 / 6], [0.0, 0.0, (2 / 3) ** 0.5]]
    edges = np.array(flat)[:gdim, :gdim]  # of the equilateral cell, as columns
    return np.asarray(np.einsum("kpn,kd->dpn", table, np.linalg.inv(edges)))


def _turned(arms: Floats, rotations: Floats) -> Floats:
    """Arms (n, gdim), each turned by its own angle (n, 1) or rotation vector (n, 3) [radians]."""
    if arms.shape[1] == 2:
        c, s = np.cos(rotations[:, 0]), np.sin(rotations[:, 0])
        return np.column_stack([c * arms[:, 0] - s * arms[:, 1], s * arms[:, 0] + c * arms[:, 1]])
    angle = np.linalg.norm(rotations, axis=1, keepdims=True)
    axis = rotations / np.maximum(angle, 1e-300)
    along = (axis * arms).sum(axis=1, keepdims=True) * axis
    return np.asarray(along + np.cos(angle) * (arms - along) + np.sin(angle) * np.cross(axis, arms))
