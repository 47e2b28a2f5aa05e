"""The Reynolds number of the cells of a computed flow."""

from __future__ import annotations

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from .. import compat
from .flow import Fluid


def measured_cell_reynolds(fluid: Fluid) -> float:
    """The largest |v| h/(k nu) of all cells of a flow at hand; h is the root of the doubled area. Collective."""
    mesh, order = fluid.domain.mesh, fluid.space.order
    space = compat.space(mesh, ("DG", order))
    size = abs(ufl.JacobianDeterminant(mesh)) ** (1 / mesh.geometry.dim) / order
    v, _ = ufl.split(fluid.state)
    found = dolfinx.fem.Function(space)
    number = ufl.sqrt(ufl.inner(v, v)) * size / fluid.viscosity
    compat.interpolate(found, number)
    mine = float(np.max(found.x.array, initial=0.0))
    return float(fluid.domain.comm.allreduce(mine, op=MPI.MAX))
