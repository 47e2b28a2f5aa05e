"""Transfer of fields from one mesh to arbitrary points, such as the nodes of a new mesh."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np

from ..arrays import Floats
from .sampling import Locator, Samples


class Transfer:
    """Evaluation of functions on a present mesh at points that may differ from rank to rank.

    Every method is collective. A point outside the mesh takes the extrapolated polynomial of the nearest cell: nodes of
    a remeshed curved boundary lie off the old mesh by a fraction of a cell.

    Args:
        mesh: of simplices, straight or curved.
        points: (n, gdim or 3) of this rank.
        reach: largest extrapolation out of a cell, in barycentric coordinates; farther out a point takes the value at
            a near point of the cell, as in interstices that coarse cells fill differently on each mesh.

    Attributes:
        outside: number of points of all ranks in no cell.
        farthest: their largest distance from their cell.
    """

    def __init__(self, mesh: Any, points: Floats, reach: float = np.inf):
        comm, locator = mesh.comm, Locator(mesh)
        parts = comm.allgather(np.asarray(points, dtype=float)[:, : mesh.geometry.dim])
        every, start = np.concatenate(parts), sum(map(len, parts[: comm.rank]))
        self._mine = slice(start, start + len(points))
        self._within = Samples(comm, locator.inside(every))
        self._lost = np.flatnonzero(np.isinf(self._within.distances))
        self._beyond = Samples(comm, locator.nearest(every[self._lost]).within(reach))
        self.outside = len(self._lost)
        self.farthest = float(self._beyond.distances.max(initial=0.0))

    def values(self, function: Any) -> Floats:
        """Values (n, components) at this rank's points.

        The function is scalar or vector, in a Lagrange space of any order, its ghosts up to date.
        """
        values = self._within.values(function)
        values[self._lost] = self._beyond.values(function)
        return values[self._mine]

    def of_state(self, space: Any, state: Floats) -> Floats:
        """Values (n, components) of the function of a space with nodal values `state` (local unknowns,)."""
        function = dolfinx.fem.Function(space)
        function.x.array[:] = state
        return self.values(function)
