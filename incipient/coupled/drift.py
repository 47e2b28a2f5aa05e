"""Advection of a surface's elevation, and the level condition at the inflow.

An elevation update d solves int q (a0 d + u . grad d) = int q a0 (new - old) with the horizontal
surface velocity u, convergent at CFL numbers above one. At an inflow, where short waves would grow,
int k(x) grad h . grad q levels h over a short zone, k(x) = |u| times its decreasing length; in
supercritical flow int r(x) h q, r(x) = k(x) over the squared length, relaxes it to the still level;
h excludes an incoming wave.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from .. import compat
from ..arrays import Floats
from ..fluid import Fluid
from ..forms.surface import carried, levelled, returned
from ..mesh.elevation import RisingDisplacement
from ..parallel import Owner


class Drift(Owner):
    """Surface matrices with the velocity of the last state; destroy after use. Every method is collective."""

    def __init__(self, fluid: Fluid, rising: RisingDisplacement):
        super().__init__()
        self._rising, self._fluid, space, load = rising, fluid, rising.space, fluid.surface
        self._places = space.tabulate_dof_coordinates()[rising.nodes].T
        h, q = ufl.TrialFunction(space), ufl.TestFunction(space)
        u, _ = ufl.split(fluid.history[0])
        zone: Any = sum(entry.zone(load.place) for entry in fluid.constraints.entries)
        kept = levelled(h, q, u, load.normal, zone)
        for entry in fluid.constraints.entries:
            if entry.given:
                kept += returned(h, q, u, load.normal, entry.rate(load.place))
        forms = kept, carried(h, q, u, load.normal)
        self._forms = [compat.form(one * load.measure) for one in forms]
        self._levelling, self._carried = (self.holding(rising.area.copy()) for _ in range(2))
        self._present = self.holding(Owner())

    def prepare(self, rate: float) -> None:
        """Assemble the matrices of the surface for a rate 1/dt. Collective."""
        for matrix, form in zip((self._levelling, self._carried), self._forms, strict=True):
            compat.matrix_of(form, matrix=matrix)
        self._present.destroy()
        rising, holding = self._rising, self._present.holding
        self._kinematic = holding(rising.area.copy())
        self._kinematic.axpy(1.0 / rate, self._levelling)
        moving = holding(self._kinematic.copy())
        moving.axpy(1.0 / rate, self._carried)
        factors = rising.factors(self._kinematic), rising.factors(moving)
        self._solvers = [holding(one) for one in factors]

    def raised(self, flux: Any, known: Floats) -> Floats:
        """Rate of elevation (local nodes,) from fluxes tested with every function (PETSc vector)."""
        flux.axpy(-1.0, self._rising.times(self._levelling, known - self._entered()))
        return self._rising.solved(self._solvers[0], flux)

    def correction(self, missed: Floats) -> Floats:
        """Update of the elevation for the residual `missed`, both (local nodes,)."""
        return self._rising.solved(self._solvers[1], self._rising.times(self._kinematic, missed))

    def _entered(self) -> Floats:
        elevation, nodes = np.zeros_like(self._fluid.surface.known.x.array), self._rising.nodes
        for entry in self._fluid.constraints.entries:
            if entry.wave is not None:
                elevation[nodes] += entry.wave.elevation(self._places, self._fluid.time)
        return elevation
