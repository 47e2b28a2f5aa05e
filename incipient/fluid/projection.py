"""Projection of transferred fields onto discretely divergence-free velocities."""

from __future__ import annotations

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..compat import petsc
from ..forms.terms import continuity, inertia
from ..parallel import Owner
from .flow import Fluid


class Projection(Owner):
    """Nearest discretely divergence-free velocities on a moving mesh. Every method is collective.

    With a multiplier p and prescribed values kept, (v - v*, w) - (p, div w) = 0, (q, div v) = 0 for
    all w, q; walls contribute as in continuity. GMRES reuses the first factorisation.
    """

    def __init__(self, fluid: Fluid):
        super().__init__(fluid.domain.comm)
        self.fluid, self._correction = fluid, dolfinx.fem.Function(fluid.space.mixed)
        mixed, where, dx = fluid.space.mixed, fluid.reference_map, fluid.quadrature()
        (u, p), (w, q) = ufl.TrialFunctions(mixed), ufl.TestFunctions(mixed)
        change, v = (ufl.split(function)[0] for function in (self._correction, fluid.state))
        left = (inertia(u, w, where) + continuity(w, p, where) + continuity(u, q, where)) * dx
        right = -continuity(v, q, where) * dx
        if fluid.walls is not None:
            left += fluid.walls.through(w, p, own=False) + fluid.walls.through(u, q, own=False)
            right -= fluid.walls.through(v, q)
        self._left, self._right = compat.form(left), compat.form(right)
        self._norms = [compat.form(inertia(one, one, where) * dx) for one in (change, v)]
        self._matrix = self.holding(petsc.create_matrix(self._left))
        self._vector = self.holding(compat.vector_of(self._right))
        self._view = self.holding(compat.vec_view(self._correction))
        self._solver = self.holding(fluid.another_solver(self._matrix))

    def apply(self) -> float:
        """Project the velocity of the fluid's state; returns the relative change in L2. Raises ConvergenceError.

        Prescribed values are kept and, in a closed domain, need zero net flux.
        """
        conditions, vector = self.fluid.constraints.dirichlet, self._vector
        compat.matrix_of(self._left, conditions, self._matrix)
        compat.vector_of(self._right, vector)
        # Zero change of prescribed velocities, zero pinned multiplier.
        compat.set_zero(vector, conditions)
        self._solver.solve(vector, self._view, rtol=1e-12)
        self._correction.x.scatter_forward()
        change, whole = (compat.integral(one, self.fluid.domain.comm) for one in self._norms)
        velocities = self.fluid.space.velocity_map
        self.fluid.state.x.array[velocities] += self._correction.x.array[velocities]
        return float(np.sqrt(change / whole)) if whole else 0.0
