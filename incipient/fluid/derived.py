"""Quantities derived from a computed flow."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from .. import compat
from ..forms import vorticity as curl_of
from ..symmetric import solve_symmetric
from .flow import Fluid
from .space import cell_size


def vorticity(fluid: Fluid) -> Any:
    """Project curl v onto continuous elements of the pressure's order; a scalar in 2-D. Collective."""
    space, of_mass, of_curl = fluid.kept("vorticity", lambda: _forms(fluid))
    field = dolfinx.fem.Function(space, name="vorticity")
    mass, right = compat.matrix_of(of_mass), compat.vector_of(of_curl)
    solve_symmetric(mass, right, field, rtol=1e-10)
    return field


def measured_cell_reynolds(fluid: Fluid) -> float:
    """Largest cell Reynolds number |v| h/(k nu); h is the root of twice the area. Collective."""
    mesh, order = fluid.domain.mesh, fluid.space.order
    space = compat.space(mesh, ("DG", order))
    size = cell_size(mesh) / order
    v, _ = ufl.split(fluid.state)
    reynolds = dolfinx.fem.Function(space)
    number = ufl.sqrt(ufl.inner(v, v)) * size / fluid.viscosity
    compat.interpolate(reynolds, number)
    mine = float(np.max(reynolds.x.array, initial=0.0))
    return float(fluid.domain.comm.allreduce(mine, op=MPI.MAX))


def _forms(fluid: Fluid) -> tuple[Any, Any, Any]:
    """Space of the field, mass form, and curl form."""
    gdim, order = fluid.space.gdim, fluid.space.order - 1
    space = compat.space(fluid.domain.mesh, ("Lagrange", order), (gdim,) if gdim == 3 else ())
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx, curl = fluid.space.quadrature(), curl_of(ufl.split(fluid.state)[0])
    return space, compat.form(ufl.inner(u, w) * dx), compat.form(ufl.inner(curl, w) * dx)
