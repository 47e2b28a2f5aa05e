"""Quantities derived from a computed flow: its vorticity, and the Reynolds number of its cells."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..compat import petsc
from ..forms import vorticity as curl_of
from ..symmetric import solve_symmetric
from .flow import Fluid
from .space import cell_size


def vorticity(fluid: Fluid) -> Any:
    """curl v projected onto continuous elements of the pressure's order; a scalar in 2D. Collective."""
    space, of_mass, of_curl = fluid.kept("vorticity", lambda: _forms(fluid))
    field = dolfinx.fem.Function(space, name="vorticity")
    mass, right = petsc.assemble_matrix(of_mass), petsc.assemble_vector(of_curl)
    mass.assemble()
    right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    solve_symmetric(mass, right, field, rtol=1e-10)
    return field


def measured_cell_reynolds(fluid: Fluid) -> float:
    """The largest |v| h/(k nu) of all cells of a computed flow; h is the root of the doubled area. Collective."""
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
    """The space of the field, the form of its mass matrix, and that of the curl."""
    gdim, order = fluid.space.gdim, fluid.space.order - 1
    space = compat.space(fluid.domain.mesh, ("Lagrange", order), (gdim,) if gdim == 3 else ())
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx, curl = fluid.space.quadrature(), curl_of(ufl.split(fluid.state)[0])
    return space, compat.form(ufl.inner(u, w) * dx), compat.form(ufl.inner(curl, w) * dx)
