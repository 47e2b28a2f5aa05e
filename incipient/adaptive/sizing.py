"""New sizes of cells from what each vertex of a mesh contributes to an error.

A cell's contribution to the error of a force goes with its size h as h^(2k + d) in smooth flow, k the order of the
velocity, d the dimension: the dual-weighted residual converges at twice the order, and the cell itself shrinks. The
fewest cells for a given error are had where all cells contribute alike (Becker and Rannacher 2001), so that
h_new = h (c / share)^(1 / (2k + d)), with c such that the contributions expected add up to the error aimed at.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from .. import compat
from ..arrays import Floats, Integers
from ..meshes import SizeField

if TYPE_CHECKING:
    from mpi4py import MPI


DIMENSION = 2
SMALLEST, LARGEST = (
    0.2,
    2.0,
)  # the size of a cell relative to before: shares say nothing about much smaller ones
STEEPEST = 0.35  # growth of sizes with distance
FAINT = 1e-3  # shares below this part of the mean are looked at as that
BISECTIONS = 60


@dataclass(frozen=True, eq=False)
class Shares:
    """A whole triangle mesh and what its vertices contribute to an error; on rank 0, elsewhere empty.

    points (n, 2), triangles (m, 3), errors (n,) not negative
    """

    points: Floats
    triangles: Integers
    errors: Floats

    @property
    def sizes(self) -> Floats:
        """(n,) size of the cells around each vertex: the side of an equilateral triangle of their mean area."""
        corners = self.points[self.triangles]
        (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        sides = np.sqrt(2.0 / np.sqrt(3.0) * np.abs(a * d - b * c))
        return _mean_around(self.triangles, sides, len(self.points))


@dataclass(frozen=True, eq=False)
class Wanted:
    """The sizes wanted (None but on rank 0), and how many cells that makes for each of the mesh before."""

    field: SizeField | None
    more_cells: float


def gathered(mesh: Any, parts: list[Floats]) -> Shares:
    """Shares (local vertices,) of several goals, put together as the root of their squares. Collective.

    They are numbered as the values of linear elements (`dual.GoalErrors.shares`).
    """
    comm, hats = mesh.comm, compat.space(mesh, ("Lagrange", 1))
    owned, numbers = _numbers(hats)
    cells = mesh.topology.index_map(mesh.topology.dim).size_local
    mine = (
        hats.tabulate_dof_coordinates()[:owned, :DIMENSION],
        numbers[compat.cell_dofs(hats)[:cells]],
        np.sqrt(np.sum(np.square(parts), axis=0))[:owned],
    )
    received = comm.gather(mine, root=0)
    if received is None:
        return Shares(np.empty((0, DIMENSION)), np.empty((0, 3), dtype=np.int64), np.empty(0))
    points, triangles, errors = (np.concatenate(part) for part in zip(*received, strict=True))
    return Shares(points, triangles.astype(np.int64), errors)


def _numbers(space: Any) -> tuple[int, Integers]:
    """How many of a space's unknowns are this rank's, and the global number of each local one."""
    index_map = space.dofmap.index_map
    local = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    return index_map.size_local, index_map.local_to_global(local)


def resized(shares: Shares, order: int, relative: float, comm: MPI.Comm) -> Wanted:
    """Sizes with which the sum of shares is expected to become `relative` times what it is. Collective.

    order: order of the velocity on the new mesh
    """
    wanted = Wanted(None, 1.0)
    if comm.rank == 0:
        factors = _factors(_smooth(shares), order, relative)
        before = shares.sizes
        sizes = _gently_growing(shares, before * factors)
        field = SizeField(shares.points, shares.triangles, sizes)
        more = float(np.mean(((before / sizes) ** DIMENSION)[shares.triangles]))
        wanted = Wanted(field, more)
    return Wanted(wanted.field, comm.bcast(wanted.more_cells, root=0))


def _smooth(shares: Shares) -> Floats:
    """Shares averaged with those of neighbours, and none that vanishes."""
    around = shares.errors[shares.triangles].mean(axis=1)
    errors = _mean_around(shares.triangles, around, len(shares.points))
    return np.maximum(errors, FAINT * errors.mean())


def _factors(errors: Floats, order: int, relative: float) -> Floats:
    """h_new / h at each vertex, within bounds, such that the errors expected add up to the relative sum."""
    rate = 2 * order
    shape = (errors.mean() / errors) ** (1.0 / (rate + DIMENSION))

    def at(level: float) -> Floats:
        """The factors at a level of all."""
        return np.clip(np.exp(level) * shape, SMALLEST, LARGEST)

    low, high = np.log(SMALLEST / shape.max()), np.log(LARGEST / shape.min())
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        expected = np.sum(errors * at(middle) ** rate) / np.sum(errors)
        low, high = (middle, high) if expected < relative else (low, middle)
    return at(low)


def _gently_growing(shares: Shares, sizes: Floats) -> Floats:
    """The largest sizes below the given ones that grow by no more than a share of the distance."""
    a, b = np.vstack([shares.triangles[:, [i, (i + 1) % 3]] for i in range(3)]).T
    reach = STEEPEST * np.linalg.norm(shares.points[a] - shares.points[b], axis=1)
    sizes, before = sizes.copy(), np.full_like(sizes, np.inf)
    while np.any(sizes < before):
        before = sizes.copy()
        np.minimum.at(sizes, a, before[b] + reach)
        np.minimum.at(sizes, b, before[a] + reach)
    return sizes


def _mean_around(triangles: Integers, values: Floats, vertices: int) -> Floats:
    """(vertices,) mean over the triangles around each vertex of values (triangles,)."""
    rows, columns = triangles.ravel(), np.repeat(np.arange(len(triangles)), 3)
    around = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(vertices, len(triangles)))
    return np.asarray(around @ values / np.maximum(around.sum(axis=1).A1, 1.0))
