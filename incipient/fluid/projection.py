"""The nearest velocity that is discretely free of divergence, for fields that came from another mesh."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..compat import petsc
from ..forms.terms import continuity, inertia
from ..parallel import Holder
from .flow import Fluid


class Projection(Holder):
    """Replaces velocities by the nearest discretely free of divergence, wherever the mesh of a fluid is moved.

    Nearest in L2, on the mesh at that time, among the velocities v with v* 's values where the velocity is
    prescribed (one component on slip boundaries): with a multiplier p in the pressure's space

        (v - v*, w) - (p, div w) = 0,    (q, div v) = 0    for all w, q.

    Walls with friction of any shape, which nothing crosses, are in both products as in the flow's continuity.
    The factorisation or preconditioner of the first mesh position is reused at the others: GMRES corrects the
    difference.
    Holds PETSc objects: use it as a context manager. Every method is collective.
    """

    def __init__(self, fluid: Fluid):
        super().__init__(fluid.domain.comm)
        self.fluid, self._correction = fluid, dolfinx.fem.Function(fluid.space.mixed)
        self._left, self._right = _forms(fluid)
        self._norms = [
            _squared_norm(fluid, function) for function in (self._correction, fluid.state)
        ]
        self._matrix = self.holding(petsc.create_matrix(self._left))
        self._vector = self.holding(compat.create_vector(self._right, fluid.space.mixed))
        self._view = self.holding(compat.vec_view(self._correction))
        self._solver = self.holding(fluid.another_solver(self._matrix))

    def apply(self) -> float:
        """Project the velocity of the fluid's state; returns the relative change ||v - v*|| / ||v*|| in L2.

        Values on boundaries where the velocity is prescribed stay exactly: set them first if the transfer
        has not. The pressure is unchanged. On open boundaries p vanishes weakly. In a closed domain the prescribed
        velocities must have zero net flux; continuity at the pressure's pinned node then follows from that
        elsewhere, otherwise the node takes the remainder. The change of a fluid at rest is zero.

        Raises:
            ConvergenceError: the system could not be factorised.
        """
        self._solve()
        change, whole = (_assembled(self.fluid, norm) for norm in self._norms)
        velocities = self.fluid.space.velocity_map
        self.fluid.state.x.array[velocities] += self._correction.x.array[velocities]
        return float(np.sqrt(change / whole)) if whole else 0.0

    def _solve(self) -> None:
        conditions, vector = self.fluid.constraints.dirichlet, self._vector
        self._matrix.zeroEntries()
        petsc.assemble_matrix(self._matrix, self._left, conditions)
        self._matrix.assemble()
        with vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(vector, self._right)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        # The change vanishes where the velocity is prescribed, and the multiplier where it is pinned.
        compat.set_zero(vector, conditions)
        self._solver.solve(vector, self._view, rtol=1e-12)
        self._correction.x.scatter_forward()


def _forms(fluid: Fluid) -> tuple[Any, Any]:
    """Matrix of the projection, and the right-hand side that cancels the state's divergence."""
    mixed, where, dx = fluid.space.mixed, fluid.reference_map, fluid.quadrature()
    (u, p), (w, q) = ufl.TrialFunctions(mixed), ufl.TestFunctions(mixed)
    v, _ = ufl.split(fluid.state)
    left = (inertia(u, w, where) + continuity(w, p, where) + continuity(u, q, where)) * dx
    right = -continuity(v, q, where) * dx
    if fluid.walls is not None:
        left += fluid.walls.through(w, p, own=False) + fluid.walls.through(u, q, own=False)
        right -= fluid.walls.through(v, q)
    return compat.form(left), compat.form(right)


def _squared_norm(fluid: Fluid, function: Any) -> Any:
    v, _ = ufl.split(function)
    return _compiled(fluid, inertia(v, v, fluid.reference_map))


def _compiled(fluid: Fluid, integrand: Any) -> Any:
    return compat.form(integrand * fluid.quadrature())


def _assembled(fluid: Fluid, form: Any) -> float:
    return float(fluid.domain.comm.allreduce(dolfinx.fem.assemble_scalar(form)))
