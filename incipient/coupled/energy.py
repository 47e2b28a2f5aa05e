"""Energy balance of a flow: kinetic energy, dissipation, and the power of the boundaries."""

from __future__ import annotations

from typing import Any

import ufl

from .. import compat
from ..fluid import Fluid
from ..forms.kinematics import rate_of_strain


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
