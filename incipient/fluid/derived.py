"""Quantities derived from a computed flow: vorticity, cell Reynolds number, energies."""

from __future__ import annotations

from typing import Any

import dolfinx
import ufl

from .. import compat
from ..forms import vorticity as curl_of
from ..forms.kinematics import rate_of_strain
from ..parallel import largest
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
    return largest(fluid.domain.comm, reynolds.x.array)


class EnergyBudget:
    """Energies of a fluid, of the whole domain if half is meshed. Every method is collective.

    Without open boundaries and body forces, power minus dissipation is the rate of kinetic energy.
    """

    def __init__(self, fluid: Fluid):
        self.fluid, self._whole = fluid, 2.0 if fluid.domain.halved else 1.0
        v = ufl.split(fluid.state)[0]
        dx, D = fluid.quadrature(), rate_of_strain(v, fluid.reference_map)
        self._kinetic = compat.form(ufl.inner(v, v) / 2 * dx)
        work = 0 if fluid.walls is None else fluid.walls.work(fluid.state)
        self._work = compat.form(work) if work else None
        self._dissipation = compat.form(2 * fluid.viscosity * ufl.inner(D, D) * dx)

    def kinetic(self) -> float:
        return self._sum(self._kinetic)

    def dissipation(self) -> float:
        return self._sum(self._dissipation)

    def power(self) -> float:
        """Power of prescribed, carried and moving frictional boundaries on the fluid, from the residual."""
        residual = self.fluid.residual()
        velocities = self.fluid.space.velocity_map
        mine = velocities[velocities < len(residual)]
        work = float(residual[mine] @ self.fluid.state.x.array[mine])
        of_walls = self._sum(self._work) if self._work is not None else 0.0
        return self._whole * float(self.fluid.domain.comm.allreduce(work)) + of_walls

    def _sum(self, form: Any) -> float:
        return self._whole * compat.integral(form, self.fluid.domain.comm)


def _forms(fluid: Fluid) -> tuple[Any, Any, Any]:
    gdim, order = fluid.space.gdim, fluid.space.order - 1
    space = compat.space(fluid.domain.mesh, ("Lagrange", order), (gdim,) if gdim == 3 else ())
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx, curl = fluid.space.quadrature(), curl_of(ufl.split(fluid.state)[0])
    return space, compat.form(ufl.inner(u, w) * dx), compat.form(ufl.inner(curl, w) * dx)
