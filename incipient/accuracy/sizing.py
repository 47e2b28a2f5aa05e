"""New cell sizes from the contributions of vertices to an error.

A cell of size h contributes h^(2k + d) to the error of a force in smooth flow, with the velocity's order k and the
dimension d. Equal contributions need the fewest cells (Becker and Rannacher 2001): h_new = h (c / share)^(1 / (2k +
d)), with c from the target error.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from .. import compat
from ..arrays import Floats, Integers
from ..meshes import SizeField
from ..parallel import Comm
from ..planning.layout import STEEPEST

# Range of the size relative to the old one: contributions do not predict those of much smaller cells.
SMALLEST, LARGEST = 0.2, 2.0
FAINT = 1e-3  # of the mean: lower bound of a contribution
BISECTIONS = 60


@dataclass(frozen=True, eq=False)
class Shares:
    """Mesh of simplices and contributions of its vertices to an error; complete on rank 0, elsewhere empty.

    points (n, gdim), cells (m, gdim + 1), errors (n,) not negative
    """

    points: Floats
    cells: Integers
    errors: Floats

    @property
    def dimension(self) -> int:
        return int(self.points.shape[1])

    @property
    def sizes(self) -> Floats:
        """Cell size (n,) around each vertex: side of a regular simplex of the mean volume."""
        corners, d = self.points[self.cells], self.dimension
        contents = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))  # volumes times d!
        sides = (contents * np.sqrt(2.0**d / (d + 1.0))) ** (1.0 / d)
        return _mean_around(self.cells, sides, len(self.points))


def gathered(mesh: Any, parts: list[Floats]) -> Shares:
    """Root sum of squares of the contributions (local vertices,) to several goals. Collective.

    Vertices are numbered as in linear elements (`dual.GoalErrors.shares`).
    """
    comm, hats = mesh.comm, compat.space(mesh, ("Lagrange", 1))
    nodes = hats.dofmap.index_map
    owned = nodes.size_local
    numbers = nodes.local_to_global(np.arange(owned + nodes.num_ghosts, dtype=np.int32))
    cells = mesh.topology.index_map(mesh.topology.dim).size_local
    mine = (
        hats.tabulate_dof_coordinates()[:owned, : mesh.geometry.dim],
        numbers[compat.cell_dofs(hats)[:cells]],
        np.sqrt(np.sum(np.square(parts), axis=0))[:owned],
    )
    received = comm.gather(mine, root=0)
    if received is None:
        d = mesh.geometry.dim
        return Shares(np.empty((0, d)), np.empty((0, d + 1), dtype=np.int64), np.empty(0))
    points, numbered, errors = (np.concatenate(part) for part in zip(*received, strict=True))
    return Shares(points, numbered.astype(np.int64), errors)


def resized(
    shares: Shares, order: int, relative: float, comm: Comm
) -> tuple[SizeField | None, float]:
    """Cell sizes expected to reduce the sum of contributions to a fraction `relative`. Collective.

    Returns the size field (None except on rank 0), and the number of cells relative to this mesh; `order` is that of
    the velocity on the new mesh.
    """
    field, more = None, 1.0
    if comm.rank == 0:
        before = shares.sizes
        factors = _factors(_smooth(shares), order, relative, shares.dimension)
        sizes = _gently_growing(shares, before * factors)
        field = SizeField(shares.points, shares.cells, sizes)
        more = float(np.mean(((before / sizes) ** shares.dimension)[shares.cells]))
    return field, comm.bcast(more, root=0)


def _smooth(shares: Shares) -> Floats:
    around = shares.errors[shares.cells].mean(axis=1)
    errors = _mean_around(shares.cells, around, len(shares.points))
    return np.maximum(errors, FAINT * errors.mean())


def _factors(errors: Floats, order: int, relative: float, dimension: int) -> Floats:
    rate = 2 * order
    shape = (errors.mean() / errors) ** (1.0 / (rate + dimension))

    def at(level: float) -> Floats:
        return np.clip(np.exp(level) * shape, SMALLEST, LARGEST)

    low, high = np.log(SMALLEST / shape.max()), np.log(LARGEST / shape.min())
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        expected = np.sum(errors * at(middle) ** rate) / np.sum(errors)
        low, high = (middle, high) if expected < relative else (low, middle)
    return at(low)


def _gently_growing(shares: Shares, sizes: Floats) -> Floats:
    a, b = np.vstack(
        [shares.cells[:, pair] for pair in combinations(range(shares.dimension + 1), 2)]
    ).T
    reach = STEEPEST * np.linalg.norm(shares.points[a] - shares.points[b], axis=1)
    sizes, before = sizes.copy(), np.full_like(sizes, np.inf)
    while np.any(sizes < before):
        before = sizes.copy()
        np.minimum.at(sizes, a, before[b] + reach)
        np.minimum.at(sizes, b, before[a] + reach)
    return sizes


def _mean_around(cells: Integers, values: Floats, vertices: int) -> Floats:
    rows, each = cells.ravel(), np.repeat(values, cells.shape[1])
    sums = np.bincount(rows, each, minlength=vertices)
    return sums / np.maximum(np.bincount(rows, minlength=vertices), 1)
