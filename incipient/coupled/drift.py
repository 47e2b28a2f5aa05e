"""Advection of a surface's elevation by the flow, and the level condition at the inflow.

With u the horizontal velocity on the surface, v . n ds is (v3 - u . grad h) over the area below it. The flow is solved
on the trial mesh, with the slopes of the trial elevation. Without these the iteration on the mesh's position would
fail at CFL numbers above one. A correction d of the elevation therefore solves
int q (a0 d + u . grad d) = int q a0 (new - old), with constant velocities at the nodes.

At an inflow the elevation needs its own condition: short waves travel with the flow only, and would grow at the
end. The condition is a level surface, imposed by a diffusion over a short zone,
int k(x) grad h . grad q with k(x) = |u| times the zone's length, falling to zero along it. Its level is free, and since
constants have no gradient, volume is conserved. Supercritical flow also needs a prescribed level there: it is
relaxed to the still level in the same zone, int r(x) h q with r(x) = k(x) over the square of the zone's length.
With an incoming wave the elevation less that of the wave replaces h in both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from .. import compat
from ..arrays import Floats
from ..compat import petsc
from ..fluid import Fluid
from ..forms.surface import carried, levelled, returned
from ..mesh.elevation import RisingDisplacement


class Drift:
    """The surface's matrices with the velocity of the last state. Holds PETSc objects; every method is collective.

    Args:
        fluid: with a surface below which fluid enters or leaves.
        rising: displacement of the mesh by its surface.
    """

    def __init__(self, fluid: Fluid, rising: RisingDisplacement):
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
        self._levelling, self._carried = (rising.area.copy() for _ in range(2))
        self._matrices: list[Any] = []
        self._solvers: list[Any] = []

    def prepare(self, rate: float) -> None:
        """Take the velocity from the last state, and the rate a0 of the elevation's backward difference."""
        for matrix, form in zip((self._levelling, self._carried), self._forms, strict=True):
            matrix.zeroEntries()
            petsc.assemble_matrix(matrix, form)
            matrix.assemble()
        self._forget()
        self._kinematic = self._rising.area.copy()
        self._kinematic.axpy(1.0 / rate, self._levelling)
        moving = self._kinematic.copy()
        moving.axpy(1.0 / rate, self._carried)
        rising = self._rising
        self._matrices = [self._kinematic, moving]
        self._solvers = [rising.factors(self._kinematic, symmetric=True), rising.factors(moving)]

    def raised(self, flux: Any, known: Floats) -> Floats:
        """(local nodes,) the rate of the elevation by the fluxes against every test function (PETSc vector)."""
        flux.axpy(-1.0, self._rising.times(self._levelling, known - self._entered()))
        return self._rising.solved(self._solvers[0], flux)

    def correction(self, missed: Floats) -> Floats:
        """(local nodes,) the correction of an elevation for the residual `missed` (local nodes,)."""
        return self._rising.solved(self._solvers[1], self._rising.times(self._kinematic, missed))

    def _entered(self) -> Floats:
        """(local nodes,) the elevation of the incoming wave."""
        elevation, nodes = np.zeros_like(self._fluid.surface.known.x.array), self._rising.nodes
        for entry in self._fluid.constraints.entries:
            if entry.wave is not None:
                elevation[nodes] += entry.wave.elevation(self._places, self._fluid.time)
        return elevation

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._forget()
        self._levelling.destroy()
        self._carried.destroy()

    def _forget(self) -> None:
        for held in (self._solvers, self._matrices):
            while held:
                held.pop().destroy()
