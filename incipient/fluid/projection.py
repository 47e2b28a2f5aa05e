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
from .flow import Fluid


def restore_incompressibility(fluid: Fluid) -> float:
    """Replace the state's velocity v* by the nearest discretely free of divergence; returns the relative change.

    Nearest in L2, on the mesh as it is now, among the velocities v with v* 's values where the velocity is
    prescribed (one component on slip boundaries): with a multiplier p in the pressure's space

        (v - v*, w) - (p, div w) = 0,    (q, div v) = 0    for all w, q.

    Values on those boundaries stay to the last digit: set them first if the transfer has not. The pressure is
    left alone. On open boundaries p vanishes weakly. In a closed domain the prescribed velocities must let as much
    in as out; continuity at the pressure's pinned node then follows from that elsewhere, else the node takes up
    what is left (see `net_flux`). The change is ||v - v*|| / ||v*|| in L2, zero if v* is. Collective.

    Raises:
        ConvergenceError: the system could not be factorised.
    """
    correction = _correction(fluid)
    change, whole = (_squared_norm(fluid, function) for function in (correction, fluid.state))
    velocities = fluid.space.velocity_map
    fluid.state.x.array[velocities] += correction.x.array[velocities]
    return float(np.sqrt(change / whole)) if whole else 0.0


def net_flux(fluid: Fluid) -> float:
    """Integral of v . n over the whole boundary, of the state on the mesh as it is now. Collective."""
    v, _ = ufl.split(fluid.state)
    one = dolfinx.fem.Constant(fluid.domain.mesh, PETSc.ScalarType(1.0))
    return -_integral(fluid, continuity(v, one, fluid.model.reference_map))


def _correction(fluid: Fluid) -> Any:
    """Function of the mixed space: change of the velocity, and the multiplier."""
    left, right = _forms(fluid)
    conditions = fluid.constraints.dirichlet
    matrix = petsc.assemble_matrix(left, conditions)
    matrix.assemble()
    vector = petsc.assemble_vector(right)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    # The change vanishes where the velocity is prescribed, and the multiplier where it is pinned.
    compat.set_zero(vector, conditions)
    correction = dolfinx.fem.Function(fluid.space.mixed)
    view, solver = compat.vec_view(correction), fluid.another_solver(matrix)
    try:
        solver.solve(vector, view, rtol=1e-12)
    finally:
        solver.destroy()
        for held in (matrix, vector, view):
            held.destroy()
    correction.x.scatter_forward()
    return correction


def _forms(fluid: Fluid) -> tuple[Any, Any]:
    """Matrix of the projection, and the right-hand side that cancels the state's divergence."""
    mixed, where, dx = fluid.space.mixed, fluid.model.reference_map, fluid.space.quadrature()
    (u, p), (w, q) = ufl.TrialFunctions(mixed), ufl.TestFunctions(mixed)
    v, _ = ufl.split(fluid.state)
    left = inertia(u, w, where) + continuity(w, p, where) + continuity(u, q, where)
    return compat.form(left * dx), compat.form(-continuity(v, q, where) * dx)


def _squared_norm(fluid: Fluid, function: Any) -> float:
    v, _ = ufl.split(function)
    return _integral(fluid, inertia(v, v, fluid.model.reference_map))


def _integral(fluid: Fluid, integrand: Any) -> float:
    local = dolfinx.fem.assemble_scalar(compat.form(integrand * fluid.space.quadrature()))
    return float(fluid.domain.comm.allreduce(local))
