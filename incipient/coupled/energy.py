"""Energy balance of a flow: kinetic energy, dissipation, and the power of the boundaries."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from .. import compat
from ..fluid import Fluid
from ..forms.kinematics import rate_of_strain


class EnergyBudget:
    """Reads the energies of a fluid without a reference map. Every method is collective.

    Without open boundaries and body forces, the power less the dissipation is the rate of the kinetic energy.
    Where half of a symmetric domain is meshed they are those of the whole.
    """

    def __init__(self, fluid: Fluid):
        self.fluid, self._whole = fluid, 2.0 if fluid.domain.halved else 1.0
        v = ufl.split(fluid.state)[0]
        dx, D = fluid.quadrature(), rate_of_strain(v, fluid.reference_map)
        self._kinetic = compat.form(ufl.inner(v, v) / 2 * dx)
        work = None if fluid.walls is None else fluid.walls.work(fluid.state)
        self._work = None if work is None else compat.form(work)
        self._dissipation = compat.form(2 * fluid.viscosity * ufl.inner(D, D) * dx)

    def kinetic(self) -> float:
        """The integral of |v|^2/2, fluid density one."""
        return self._sum(self._kinetic)

    def dissipation(self) -> float:
        """The integral of 2 nu D : D, energy turned into heat in unit time."""
        return self._sum(self._dissipation)

    def power(self) -> float:
        """Work that prescribed and carried boundaries, and walls with friction that move, do on the fluid in unit time.

        The residual vanishes except where velocities are prescribed: there it is the reaction force.
        """
        residual = self.fluid.residual()
        velocities = self.fluid.space.velocity_map
        mine = velocities[velocities < len(residual)]
        work = float(residual[mine] @ self.fluid.state.x.array[mine])
        of_walls = self._sum(self._work) if self._work is not None else 0.0
        return self._whole * float(self.fluid.domain.comm.allreduce(work)) + of_walls

    def _sum(self, form: Any) -> float:
        mine = float(np.real(fem.assemble_scalar(form)))
        return self._whole * float(self.fluid.domain.comm.allreduce(mine))
