"""The vorticity of a flow as a continuous field."""

from __future__ import annotations

from typing import Any

import dolfinx
import ufl
from petsc4py import PETSc

from .. import compat
from ..compat import petsc
from ..forms import vorticity as curl_of
from .flow import Fluid
from .solvers.mass import solve_mass_matrix


def vorticity(fluid: Fluid) -> Any:
    """curl v projected onto continuous elements of the pressure's order; a scalar in 2D. Collective."""
    gdim = fluid.space.gdim
    mesh = fluid.domain.mesh
    order = fluid.space.order - 1
    space = compat.space(mesh, ("Lagrange", order), (gdim,) if gdim == 3 else ())
    field = dolfinx.fem.Function(space, name="vorticity")
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = fluid.space.quadrature()
    mass = petsc.assemble_matrix(compat.form(ufl.inner(u, w) * dx))
    mass.assemble()
    curl = curl_of(ufl.split(fluid.state)[0])
    right = petsc.assemble_vector(compat.form(ufl.inner(curl, w) * dx))
    right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    solve_mass_matrix(mass, right, field, rtol=1e-10)
    return field
