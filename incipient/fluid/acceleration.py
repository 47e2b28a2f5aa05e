"""Force of a rapidly accelerating flow: inviscid pressure of the disturbance, with added mass.

If the base flow gains w in unit time, fluid around bodies at rest gains w + grad(phi) with n .
grad(phi) = -n . w on walls; the pressure is -phi at unit density.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats
from ..compat import petsc
from ..mesh.domain import Domain
from ..symmetric import solve_symmetric

ORDER = 2


def load_of_disturbance(
    domain: Domain,
    velocity: Callable[[np.ndarray], np.ndarray],
    walls: Sequence[str],
    outlet: str,
    centre: Sequence[float],
) -> Floats:
    """Force and torque (2, 3) of an accelerating base flow's disturbance on the boundary "body". Collective.

    Args:
        velocity: (gdim, n) at positions (3, n), gained by the base flow in unit time.
        walls: impermeable boundaries, "body" among them.
        outlet: boundary of zero potential.
        centre: (gdim,) of the torque.
    """
    mesh, gdim = domain.mesh, domain.gdim
    space = compat.space(mesh, ("Lagrange", ORDER))
    base = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", ORDER), (gdim,)))
    base.interpolate(velocity)
    u, w, n = ufl.TrialFunction(space), ufl.TestFunction(space), ufl.FacetNormal(mesh)
    stiffness = compat.form(ufl.inner(ufl.grad(u), ufl.grad(w)) * ufl.dx)
    flux = compat.form(-ufl.inner(base, n) * w * domain.measure(*walls))
    phi = dolfinx.fem.Function(space)
    _solve(stiffness, flux, phi, compat.nodes_on(space, domain.facets_of(outlet)))
    return _pushed(phi, n, domain, centre)


def _pushed(phi: Any, n: Any, domain: Domain, centre: Sequence[float]) -> Floats:
    x = ufl.SpatialCoordinate(domain.mesh)
    ds, arms = domain.measure("body"), x - ufl.as_vector([float(one) for one in centre])
    if domain.gdim == 2:
        torque = [0, 0, arms[0] * n[1] - arms[1] * n[0]]
        pushes = [n[0], n[1], 0, *torque]
    else:
        pushes = [*n, *ufl.cross(arms, n)]
    load = np.zeros(6)
    for place, push in enumerate(pushes):
        if not isinstance(push, int):
            load[place] = dolfinx.fem.assemble_scalar(compat.form(-phi * push * ds))
    domain.comm.Allreduce(MPI.IN_PLACE, load)
    if domain.halved:
        load = 2.0 * load * np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0])
    return load.reshape(2, 3)


def _solve(stiffness: Any, flux: Any, phi: Any, held: Any) -> None:
    conditions = [dolfinx.fem.dirichletbc(PETSc.ScalarType(0.0), held, phi.function_space)]
    matrix, right = compat.matrix_of(stiffness, conditions), compat.vector_of(flux)
    petsc.set_bc(right, conditions)
    solve_symmetric(matrix, right, phi, 1e-10, multigrid=True)
