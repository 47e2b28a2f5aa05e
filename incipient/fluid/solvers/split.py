"""The mixed system taken apart into velocity and pressure."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from .equations import Equations


class Split:
    """Owned rows of the mixed system, by their local numbers, and the blocks B^T and B of its matrix.

    velocities: ascending
    pressures:  in the order of the pressure's own space
    order:      which of them comes first, second and so on in the blocks, where they ascend
    held:       where conditions hold
    """

    def __init__(self, matrix: Any, equations: Equations):
        space, self.matrix = equations.space, matrix
        self.owned = matrix.getLocalSize()[0]
        self.velocities = np.sort(space.velocity_map[space.velocity_map < self.owned])
        self.pressures = space.pressure_map[: space.pressure.dofmap.index_map.size_local]
        self.order = np.argsort(self.pressures)
        self.held = np.flatnonzero(equations.held()[: self.owned])
        self._sets = [
            self.index_set(rows) for rows in (self.velocities, self.pressures[self.order])
        ]

    def index_set(self, rows: np.ndarray) -> Any:
        """PETSc's set of owned rows by their local numbers; the caller frees it. Collective."""
        numbers = self.matrix.getOwnershipRange()[0] + rows
        return PETSc.IS().createGeneral(numbers.astype(PETSc.IntType), comm=self.matrix.comm)

    def gradient(self, into: Any = None) -> Any:
        """The block B^T as it is now: momentum's rows, the pressure's columns. Collective."""
        return self.matrix.createSubMatrix(*self._sets, into)

    def divergence(self, into: Any = None) -> Any:
        """The block B as it is now: continuity's rows, the velocity's columns. Collective."""
        return self.matrix.createSubMatrix(*self._sets[::-1], into)

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for held in self._sets:
            held.destroy()
