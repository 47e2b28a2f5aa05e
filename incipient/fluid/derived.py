"""Quantities derived from a computed flow: vorticity, cell Reynolds number, energies."""

from __future__ import annotations

from collections.abc import Callable
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


def kinetic_energy(fluid: Fluid) -> float:
    """Kinetic energy of the whole domain. Collective."""
    v, _ = ufl.split(fluid.state)
    return integral(fluid, "kinetic energy", lambda: ufl.inner(v, v) / 2 * fluid.quadrature())


def dissipation(fluid: Fluid) -> float:
    """Rate of dissipation in the whole domain. Collective."""
    D = rate_of_strain(ufl.split(fluid.state)[0], fluid.reference_map)
    density = 2 * fluid.viscosity * ufl.inner(D, D)
    return integral(fluid, "dissipation", lambda: density * fluid.quadrature())


def power(fluid: Fluid) -> float:
    """Power of prescribed, carried and moving frictional boundaries on the fluid, from the residual. Collective.

    Without open boundaries and body forces, less dissipation it is the rate of kinetic energy.
    """
    residual = fluid.residual()
    velocities = fluid.space.velocity_map
    mine = velocities[velocities < len(residual)]
    work = fluid.domain.comm.allreduce(float(residual[mine] @ fluid.state.x.array[mine]))
    of_walls = 0.0
    if any(wall.moves for wall in fluid.constraints.friction):
        of_walls = integral(fluid, "work of walls", lambda: fluid.walls.work(fluid.state))
    return float(fluid.domain.multiplicity * work + of_walls)


def integral(fluid: Fluid, name: str, integrand: Callable[[], Any]) -> float:
    """Integral over the whole domain of UFL, made and compiled once for its name. Collective."""
    form = fluid.kept(name, lambda: compat.form(integrand()))
    return fluid.domain.multiplicity * compat.integral(form, fluid.domain.comm)


def _forms(fluid: Fluid) -> tuple[Any, Any, Any]:
    gdim, order = fluid.space.gdim, fluid.space.order - 1
    space = compat.space(fluid.domain.mesh, ("Lagrange", order), (gdim,) if gdim == 3 else ())
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx, curl = fluid.space.quadrature(), curl_of(ufl.split(fluid.state)[0])
    return space, compat.form(ufl.inner(u, w) * dx), compat.form(ufl.inner(curl, w) * dx)
