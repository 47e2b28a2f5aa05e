"""Force of a rapidly accelerating flow: inviscid pressure of the disturbance, with added mass.

If the base flow gains w in unit time, fluid around bodies at rest gains w + grad(phi) with n .
grad(phi) = -n . w on walls; the pressure is -phi at unit density.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats
from ..compat import petsc
from ..mesh.domain import Domain
from ..symmetric import solve_symmetric
from .tractions import resultant

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
    mesh, gdim, n = domain.mesh, domain.gdim, ufl.FacetNormal(domain.mesh)
    space = compat.space(mesh, ("Lagrange", ORDER))
    base = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", ORDER), (gdim,)))
    base.interpolate(velocity)
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    still = compat.nodes_on(space, domain.facets_of(outlet))
    conditions = [dolfinx.fem.dirichletbc(PETSc.ScalarType(0.0), still, space)]
    matrix = compat.matrix_of(compat.form(ufl.inner(ufl.grad(u), ufl.grad(w)) * ufl.dx), conditions)
    flux = compat.vector_of(compat.form(-ufl.inner(base, n) * w * domain.measure(*walls)))
    petsc.set_bc(flux, conditions)
    phi = dolfinx.fem.Function(space)
    solve_symmetric(matrix, flux, phi, 1e-10, multigrid=True)
    # Elements that contain rigid motions of curved cells.
    order = max(ORDER, compat.geometry_degree(mesh))
    motions = compat.space(mesh, ("Lagrange", order), (gdim,))
    w = ufl.TestFunction(motions)
    forces = compat.owned_entries(compat.form(-phi * ufl.inner(n, w) * domain.measure("body")))
    forces = forces.reshape(-1, gdim)
    places = motions.tabulate_dof_coordinates()[: len(forces), :gdim]
    load = resultant(domain, forces, places, np.array(centre))
    return np.array([load.force, load.torque])
