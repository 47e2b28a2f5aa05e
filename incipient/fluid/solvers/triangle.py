"""Block-triangular preconditioner of the flow's Jacobian."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from ... import compat
from ...parallel import Owner
from .equations import Equations, component_rows
from .options import RELAXATION, algebraic, preconditioner
from .pressure import schur_complement

VELOCITY = "fluid_velocity_"
# Relaxation suffices for the mass matrix of a projection.
OF_MASS = {"pc_type": "sor"}
OF_COMPONENT = {"pc_mg_galerkin": "pmat"} | RELAXATION


class Triangle(Owner):
    """Upper block triangle of [[F, G], [B, 0]], or its transpose: a `PCPYTHON` context. Methods are collective.

    z_p = -S^-1 r_p, z_v = F^-1 (r_v - G z_p), with an approximate Schur complement S (`pressure`) and, for each
    component's block of F, one multigrid V-cycle. Constrained rows are identities. Velocities (n,) and pressures of
    the blocks ascend as in the mixed system.
    """

    def __init__(self, matrix: Any, equations: Equations, transposed: bool = False):
        super().__init__()
        self._matrix, self._transposed = matrix, transposed
        self._schur = self.holding(schur_complement(equations))
        start, end = matrix.getOwnershipRange()
        rows = np.sort(component_rows(equations.space)[1])
        parts = [part[part < end - start] for part in rows]
        self._velocities = np.sort(np.concatenate(parts))
        self._places = [np.searchsorted(self._velocities, part) for part in parts]
        self._pressures = equations.owned_pressures()
        self._order = np.argsort(self._pressures)
        unknowns = (*parts, self._velocities, self._pressures[self._order])
        self._sets = [
            self.holding(
                PETSc.IS().createGeneral((start + some).astype(PETSc.IntType), comm=matrix.comm)
            )
            for some in unknowns
        ]
        self._interpolations: list[Any] = []
        if equations.viscosity is not None:
            self._interpolations = [self.holding(one) for one in _interpolations(equations)]
        self._present, self._cycles = self.holding(Owner()), list[Any]()

    def assemble(self) -> None:
        self._present.destroy()
        self._extract()
        self._schur.assemble(self)
        chosen = OF_COMPONENT | algebraic("mg_coarse_") if self._interpolations else OF_MASS
        interpolations = self._interpolations or [None] * len(self._components)
        self._cycles = [
            self._present.holding(preconditioner(one, VELOCITY, chosen, interpolation))
            for one, interpolation in zip(self._components, interpolations, strict=True)
        ]

    def _extract(self) -> None:
        *each, velocities, pressures = self._sets
        pairs = [*((one, one) for one in each), (velocities, pressures), (pressures, velocities)]
        blocks = [self._matrix.createSubMatrix(*pair) for pair in pairs]
        if self._transposed:
            blocks = [block.transpose() for block in blocks]
            blocks[-2:] = blocks[:-3:-1]
        *self._components, self.gradient, self.divergence = map(self._present.holding, blocks)
        self._vectors = [
            [self._present.holding(one) for one in block.createVecs()] for block in blocks
        ]

    def apply(self, _: Any, right: Any, left: Any) -> None:
        r, z = right.array_r, np.empty(right.getLocalSize())
        z[self._pressures] = -self._schur.solve(r[self._pressures])
        forces = self.push(z[self._pressures[self._order]])
        z[self._velocities] = self._each(
            r[self._velocities] - forces, [cycle.apply for cycle in self._cycles]
        )
        left.setArray(z)

    def destroy(self, _: Any = None) -> None:
        super().destroy()

    def _each(self, values: np.ndarray, solved: list[Any]) -> np.ndarray:
        results = np.empty_like(values)
        for at, (right, left), solve in zip(self._places, self._vectors, solved, strict=False):
            right.setArray(values[at])
            solve(right, left)
            results[at] = left.array_r
        return results

    def carry(self, values: np.ndarray) -> np.ndarray:
        """Diagonal blocks of F times velocities (n,)."""
        return self._each(values, [block.mult for block in self._components])

    def diagonal(self) -> np.ndarray:
        entries = np.empty(len(self._velocities))
        for at, block, (_, left) in zip(
            self._places, self._components, self._vectors, strict=False
        ):
            block.getDiagonal(left)
            entries[at] = left.array_r
        return entries

    def push(self, pressures: np.ndarray) -> np.ndarray:
        """G times ascending pressures, (n,), to be copied."""
        return _times(self.gradient, self._vectors[-2], pressures)

    def gather(self, velocities: np.ndarray) -> np.ndarray:
        """B times velocities (n,), (owned pressures,) ascending, to be copied."""
        return _times(self.divergence, self._vectors[-1], velocities)


def _times(matrix: Any, vectors: list[Any], values: np.ndarray) -> np.ndarray:
    right, left = vectors
    right.setArray(values)
    matrix.mult(right, left)
    return np.asarray(left.array_r)


def _interpolations(equations: Equations) -> list[Any]:
    """Interpolation (ascending rows of a component, vertices), identity at constrained ones. Collective."""
    fine, rows = component_rows(equations.space)
    coarse = compat.space(fine.mesh, ("Lagrange", 1))
    whole = compat.interpolation_matrix(coarse, fine)
    (owned, owned_below), comm = whole.getLocalSize(), whole.comm
    start, start_below = whole.getOwnershipRange()[0], whole.getOwnershipRangeColumn()[0]
    columns = PETSc.IS().createStride(owned_below, start_below, 1, comm=comm)
    vertices, nodes = compat.cell_dofs(coarse), compat.cell_dofs(fine)
    at_vertices = np.empty(vertices.max(initial=-1) + 1, dtype=np.int64)
    at_vertices[vertices] = nodes[:, : vertices.shape[1]]
    interpolations = []
    for mine, held in zip(rows, equations.held()[rows], strict=True):
        order = np.argsort(mine[:owned])
        ascending = PETSc.IS().createGeneral((start + order).astype(PETSc.IntType), comm=comm)
        one = whole.createSubMatrix(ascending, columns)
        free, free_below = one.createVecLeft(), one.createVecRight()
        free.setArray(~held[order])
        free_below.setArray(~held[at_vertices[:owned_below]])
        one.diagonalScale(free, free_below)
        places = start + np.argsort(order)
        for vertex in np.flatnonzero(held[at_vertices[:owned_below]]):
            one.setValue(places[at_vertices[vertex]], start_below + vertex, 1.0)
        one.assemble()
        interpolations.append(one)
        for lent in (ascending, free, free_below):
            lent.destroy()
    for lent in (whole, columns):
        lent.destroy()
    return interpolations
