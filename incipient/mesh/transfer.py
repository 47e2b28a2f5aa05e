"""Transfer of fields from one mesh to arbitrary points, such as the nodes of a new mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from ..arrays import Floats, Integers
from .sampling import Locator, Places, evaluate


@dataclass(frozen=True)
class _Exchange:
    """Points that ranks look up for one another.

    rows:   for each rank the numbers of this rank's points that it looks up
    places: of the points that this rank looks up, those of the first rank first
    splits: where the points of the next rank begin
    """

    rows: list[Integers]
    places: Places
    splits: Integers


class Transfer:
    """Evaluation of functions on a present mesh at points that may differ from rank to rank.

    Construction is collective. A point outside the mesh takes the extrapolated polynomial of the nearest cell: nodes of
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
        self._comm = mesh.comm
        self._points = np.asarray(points, dtype=float)[:, : mesh.geometry.dim]
        locator = Locator(mesh)
        within = self._exchange(self._candidates(locator), locator.inside)
        lost = np.setdiff1d(np.arange(len(self._points)), np.concatenate(within.rows))
        beyond = self._exchange([lost] * self._comm.size, locator.nearest)
        self._exchanges = within, replace(beyond, places=beyond.places.within(reach))
        self.outside = int(self._comm.allreduce(len(lost)))
        farthest = float(beyond.places.distances.max(initial=0.0))
        self.farthest = float(self._comm.allreduce(farthest, op=MPI.MAX))

    def values(self, function: Any) -> Floats:
        """Values (n, components) at this rank's points. Collective.

        The function is scalar or vector, in a Lagrange space of any order, its ghosts up to date.
        """
        block = function.function_space.dofmap.index_map_bs
        values = np.empty((len(self._points), block))
        for exchange in self._exchanges:
            mine = evaluate(function, exchange.places)
            answers = self._comm.alltoall(np.split(mine, exchange.splits))
            for rows, answer in zip(exchange.rows, answers, strict=True):
                values[rows] = answer
        return values

    def _candidates(self, locator: Locator) -> list[Integers]:
        x = self._points
        boxes = self._comm.allgather(locator.box)
        slack = 1e-6 * max(float(np.ptp(box)) for box in boxes if np.isfinite(box).all())
        return [
            np.flatnonzero(((x >= low - slack) & (x <= high + slack)).all(axis=1))
            for low, high in boxes
        ]

    def _exchange(
        self, requested: list[Integers], look_up: Callable[[Floats], Places]
    ) -> _Exchange:
        requests = self._comm.alltoall([self._points[rows] for rows in requested])
        places = look_up(np.concatenate(requests))
        answers = self._comm.alltoall(np.split(places.distances, _splits(requests)))
        best = self._nearest(requested, answers)
        wanted = [best[rows] == rank for rank, rows in enumerate(requested)]
        rows = [rows[chosen] for rows, chosen in zip(requested, wanted, strict=True)]
        kept = self._comm.alltoall(wanted)
        splits = _splits([np.flatnonzero(chosen) for chosen in kept])
        return _Exchange(rows, places.at(np.concatenate(kept)), splits)

    def _nearest(self, requested: list[Integers], answers: list[Floats]) -> Integers:
        distances = np.full((len(requested), len(self._points)), np.inf)
        for rank, (rows, answer) in enumerate(zip(requested, answers, strict=True)):
            distances[rank, rows] = answer
        return np.where(np.isfinite(distances).any(axis=0), distances.argmin(axis=0), -1)


def _splits(parts: list[Any]) -> Integers:
    return np.cumsum([len(part) for part in parts])[:-1]
