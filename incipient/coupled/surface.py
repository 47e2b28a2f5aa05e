"""Free surface as a part of a coupling: the weak kinematic condition (337) in backward differences.

int q (a0 h + a1 h(n) + a2 h(n-1)) n . up ds = int q v . n ds for every q, with the elevation h and
the constant area n . up ds below the surface; the velocity raises the surface within the step
(`forms.surface.load`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from .. import compat
from ..arrays import Floats, Integers, extrapolated
from ..compat import petsc
from ..errors import ConvergenceError
from ..fluid import Fluid
from ..fluid.derived import integral
from ..fluid.transient import TimeStep
from ..forms.surface import below, carried, crossing, flux, levelled, potential, returned
from ..mesh.elevation import RisingDisplacement
from ..parallel import Owner, largest
from .coupling import Part

# Speed, relative to that of long waves, that counts as round-off.
ROUND_OFF = 1e-14
# Largest slope of a surface as a graph.
STEEPEST = 2.0
# Smallest depth relative to the largest.
NEAREST = 0.02
TOUCHING = "the free surface touches {below}: use an earlier time.end, a lower wave or deeper water"
STEEP = (
    "the free surface is too steep, its slope is {slope:.2g}: use a smaller numerics.mesh_size, a lower wave or an "
    "earlier time.end"
)


class Drift(Owner):
    """Advection of the elevation with the velocity of the last state, and the level condition at the inflow.

    An elevation update d solves int q (a0 d + u . grad d) = int q a0 (new - old) with the horizontal
    surface velocity u, convergent at CFL numbers above one. At an inflow, where short waves would grow,
    int k(x) grad h . grad q levels h over a short zone, k(x) = |u| times its decreasing length; in
    supercritical flow int r(x) h q, r(x) = k(x) over the squared length, relaxes it to the still level;
    h excludes an incoming wave.

    Destroy after use. Every method is collective.
    """

    def __init__(self, fluid: Fluid, rising: RisingDisplacement):
        super().__init__()
        self._rising, self._fluid, space, load = rising, fluid, rising.space, fluid.surface
        self._places = space.tabulate_dof_coordinates()[rising.nodes].T
        h, q = ufl.TrialFunction(space), ufl.TestFunction(space)
        u, _ = ufl.split(fluid.history[0])
        kept: Any = 0
        for entry in fluid.constraints.entries:
            zone = entry.zone(load.place)
            kept += levelled(h, q, u, load.normal, zone)
            if entry.condition.supercritical:
                kept += returned(h, q, u, load.normal, zone / entry.condition.level**2)
        kinematic = below(h, q, load.normal) + kept / load.rate
        moving = kinematic + carried(h, q, u, load.normal) / load.rate
        self._forms = [compat.form(form * load.measure) for form in (kept, kinematic, moving)]
        self._present = self.holding(Owner())

    def prepare(self) -> None:
        """Assemble the matrices of the surface for the present rate. Collective."""
        self._present.destroy()
        holding, factors = self._present.holding, self._rising.factors
        matrices = [holding(compat.matrix_of(form)) for form in self._forms]
        self._levelling, self._kinematic, _ = matrices
        self._solvers = [holding(factors(matrix)) for matrix in matrices[1:]]

    def raised(self, flux: Any, known: Floats) -> Floats:
        """Rate of elevation (local nodes,) from fluxes tested with every function (PETSc vector)."""
        elevation = known.copy()
        for entry in self._fluid.constraints.entries:
            if entry.condition.elevation is not None:
                coming = entry.condition.elevation(self._places, self._fluid.time)
                elevation[self._rising.nodes] -= coming
        flux.axpy(-1.0, self._rising.times(self._levelling, elevation))
        return self._rising.solved(self._solvers[0], flux)

    def correction(self, missed: Floats) -> Floats:
        """Update of the elevation for the residual `missed`, both (local nodes,)."""
        return self._rising.solved(self._solvers[1], self._rising.times(self._kinematic, missed))


class SurfacePart(Part):
    """Free surface of a fluid as a part of a coupling (see `coupling.Part`). Every method is collective.

    Args:
        fluid: with a `FreeSurface` condition.
        elevation: (local nodes,) at the fluid's time, zero off the surface.
        depths: (local nodes,) from the still level to the boundary named `below`.

    Attributes:
        past: last and earlier elevations at `times`, newest first.
    """

    name = "free surface"
    folded = "the cells below the free surface fold over: use a smaller time.step or mesh_size, or deeper water"

    def __init__(
        self,
        fluid: Fluid,
        displacement: RisingDisplacement,
        elevation: Floats,
        depths: Floats,
        below: str = "the bed",
    ):
        self.fluid, self.mesh, self._load = fluid, displacement, fluid.surface
        self.past, self.times = [elevation], [fluid.time]
        gravity = float(np.linalg.norm(self._load.gravity.value))
        self._depths, self._below = depths, below
        self._deepest = largest(fluid.domain.comm, depths[displacement.nodes])
        fluid.negligible = ROUND_OFF * float(np.sqrt(gravity * self._deepest))
        fluid.holding(displacement)
        self._tried = self._improved = elevation
        self._load.elevation.x.array[:] = elevation
        v, _ = ufl.split(fluid.state)
        load, measure = self._load, self._load.measure
        self._flux = compat.form(flux(v, ufl.TestFunction(load.space), load.normal) * measure)
        self._vector = fluid.holding(petsc.assemble_vector(self._flux))
        self._pairs = _neighbours(displacement)
        self._drift: Drift | None = None
        if fluid.constraints.crossings:
            self._drift = fluid.holding(Drift(fluid, displacement))

    # -- the step, as the coupling sees it --------------------------------------------------------

    def predict(self, length: float, order: int) -> None:
        time = self.times[0] + length
        count = min(order + 1, len(self.past))
        self._tried = extrapolated(self.times[:count], self.past[:count], time)
        a0, *others = (float(rate.value) for rate in self.fluid.rate)
        if a0 == 0.0:  # before the first step of a resumed run
            return
        known = np.zeros_like(self._tried)
        for a, h in zip(others, [*self.past[:2], self.past[-1]], strict=False):
            known -= a / a0 * h
        self._load.known.x.array[:] = known
        if self._load.unfelt is not None:
            self._load.unfelt.x.array[:] = self.mesh.remove_pinned_projection(
                self.past[0], not self.fluid.constraints.open
            )
        if self._drift is not None:
            self._drift.prepare()

    def displacement(self) -> Floats:
        return self.mesh.at(self._tried)

    def place(self) -> None:
        self._load.elevation.x.array[:] = self._tried

    def residual(self, length: float, order: int) -> float:
        """Distance of the mesh from the convected surface, as a velocity relative to the flow's.

        Raises ConvergenceError if the elevation diverges.
        """
        with self.fluid.stage("free surface"):
            a0 = float(self.fluid.rate[0].value)
            self._improved = self._load.known.x.array + self._raised() / a0
            missed = self._size(self._improved - self._tried) * a0
        if not np.isfinite(missed):
            raise ConvergenceError(self.folded)
        if missed <= self.fluid.negligible:
            return 0.0
        return missed / max(self.fluid.speed(), 1e-300)

    def correct(self) -> None:
        if self._drift is None:
            self._tried = self._improved
        else:
            self._tried = self._tried + self._drift.correction(self._improved - self._tried)

    def accept(self, step: TimeStep) -> None:
        """Accept the flow's elevation, which conserves volume to round-off."""
        self._load.elevation.x.array[:] = self._improved
        self.past = [self._improved, *self.past[:2]]
        self.times = [self.fluid.time, *self.times[:2]]

    def restore(self) -> None:
        self._tried = self._improved = self.past[0]
        self._load.elevation.x.array[:] = self.past[0]

    # -- reported ----------------------------------------------------------------------------------

    def volume(self) -> float:
        """Net volume above the still level, of the whole domain."""
        return self.fluid.domain.multiplicity * self.mesh.mean(self.past[0])

    def risen(self) -> float:
        return self._size(self.past[0] - self.past[1]) if len(self.past) > 1 else 0.0

    def energy(self) -> float:
        load = self._load
        return integral(self.fluid, "potential energy", lambda: potential(load) * load.measure)

    def crossed(self) -> float:
        """Root-mean-square (v - v_mesh) . n on the surface."""
        fluid, load = self.fluid, self._load
        v, _ = ufl.split(fluid.state)
        square = integral(fluid, "through surface", lambda: crossing(v, load) * load.measure)
        area = integral(fluid, "area of surface", lambda: fluid.space.constant(1.0) * load.measure)
        return float(np.sqrt(square / area))

    # -- parts ------------------------------------------------------------------------------------

    def ends(self) -> str:
        """Reason and remedy if the run must stop: steep or touching surface; otherwise ""."""
        comm, (first, second, ways) = self.fluid.domain.comm, self._pairs
        elevation = self.past[0]
        slope = largest(comm, np.abs(elevation[first] - elevation[second]) / ways)
        depths = (self._depths + elevation)[self.mesh.nodes]
        if not -largest(comm, -depths, -np.inf) > NEAREST * self._deepest:
            return TOUCHING.format(below=self._below)
        return "" if slope <= STEEPEST else STEEP.format(slope=slope)

    def _raised(self) -> Floats:
        """Rate of elevation (local nodes,), without an open end corrected to the volume of the inflow."""
        compat.vector_of(self._flux, self._vector)
        if self._drift is None:
            elevation = self.mesh.elevation_of(self._vector)
        else:
            elevation = self._drift.raised(self._vector, self._load.known.x.array)
        held = self.fluid.constraints
        return elevation if held.open else self.mesh.with_volume(elevation, held.influx)

    def _size(self, elevation: Floats) -> float:
        own = elevation[self.mesh.nodes[: self.mesh.owned]]
        total, count = self.fluid.domain.comm.allreduce(np.array([own @ own, len(own)]))
        return float(np.sqrt(total / max(count, 1)))


def _neighbours(displacement: RisingDisplacement) -> tuple[Integers, Integers, Floats]:
    """Pairs of surface nodes in the same cell, and their distances across."""
    cells, space = compat.cell_dofs(displacement.space), displacement.space
    first, second = (cells[:, k] for k in np.triu_indices(cells.shape[1], 1))
    both = np.isin(first, displacement.nodes) & np.isin(second, displacement.nodes)
    across = space.tabulate_dof_coordinates()[:, : displacement.domain.gdim - 1]
    ways = np.linalg.norm(across[first[both]] - across[second[both]], axis=1)
    return first[both], second[both], ways
