"""Mesh of a steady run, moved to other gaps and domains, and its second-order flow."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Floats, spatial
from ..coupled.tractions import TractionProbe
from ..errors import ConvergenceError
from ..fluid import Fluid
from ..fluid.solvers import Direct
from ..geometry.plane.beds import Flat
from ..geometry.space.beds import Plane
from ..mesh.motion import LEAST_QUALITY, MeshMotion, stretched, weights_of
from ..meshes import SYMMETRY
from ..planning.conditions import conditions
from ..results.errorbars import Loads
from ..scene import Scene
from ..setup.setup import Setup
from .state import Run
from .steady import unit_of

# Tolerance of the flows, whose loads differ by per cents; with factors of a nearby flow updates are cheap, and their
# contraction underestimates what is left (bars of grain_on_bed: 1e-6 at 1e-9, 1e-3 at 1e-5).
TOLERANCE, TOLERANCE_NEARBY = 1e-5, 1e-9
ORDER = 2  # of their elements in 3-D
KEPT = 2.0  # distance from the grain's centre, in grain sizes, within which a larger domain keeps the mesh


def moved_meshes(run: Run, scenes: Iterable[Scene]) -> dict[str, MovedMesh]:
    """Move the mesh to each scene, by its JSON; empty if one needs another mesh. Collective."""
    assert run.layout.placement is not None
    motion = MeshMotion(run.domain)
    # Nodes follow a fraction of the grain's displacement; those on the plane of symmetry move within it.
    weights = weights_of(run.domain, "body", [(SYMMETRY,)], rigid=1.0)
    moved: dict[str, MovedMesh] = {}
    for scene in scenes:
        if scene.numerics.meshed_bed != run.scene.numerics.meshed_bed:
            continue  # another bed
        setup = Setup(scene)
        centre, places = _centre(run, setup), _in_domain(run, setup)
        if places is None:
            return {}
        places = places + weights * (centre - spatial(run.layout.placement.centre))
        if motion.quality(places).relative <= LEAST_QUALITY:
            return {}
        moved[scene.model_dump_json()] = MovedMesh(run, setup, places, centre)
    return moved


@dataclass(frozen=True, eq=False)
class MovedMesh:
    """Node positions (n, 3) of a run's mesh, and grain centre (3,), in a slightly different scene."""

    run: Run
    setup: Setup
    places: Floats
    centre: Floats

    def loads(self, speed: float) -> Loads:
        """Force and torque in a flow `speed` times the scene's. Collective; raises ConvergenceError."""
        run, fluid = self.run, self.run.fluid.coarse or self.run.fluid
        before, points = run.domain.mesh.geometry.x.copy(), fluid.constraints.points
        moves, plane = not np.array_equal(before, self.places), run.scene.gdim == 2
        flow: AbstractContextManager[Fluid] = nullcontext(fluid)
        if moves and plane:
            flow = self._carried(fluid, points)
        elif moves or not (plane or fluid.space.order == ORDER):
            flow = self._second_order(fluid, points)
        fluid.move_mesh(self.places)
        try:
            with flow as there:
                resultant = TractionProbe(there, "body", self.centre.tolist()).resultant()
        finally:
            fluid.move_mesh(before)
        if moves and plane and fluid.model.linear:  # later estimates take its matrix as it is
            fluid.linearise()
        return Loads(unit_of(run, speed) * resultant.load, moved=True)

    @contextmanager
    def _carried(self, fluid: Fluid, points: Floats) -> Iterator[Fluid]:
        """Solve with the run's own fluid, whose conditions and state are those of the run afterwards."""
        state, own = fluid.state.x.array.copy(), fluid.conditions
        fluid.let_in(conditions(self.setup))
        try:
            self._follow(fluid, points)
            self._solve(fluid)
            yield fluid
        finally:
            fluid.let_in(own)
            fluid.state.x.array[:] = state

    @contextmanager
    def _second_order(self, fluid: Fluid, points: Floats) -> Iterator[Fluid]:
        model = replace(fluid.model, order=ORDER)
        with Fluid(fluid.domain, model, conditions(self.setup), fluid.reynolds) as other:
            other.interpolate(fluid)
            if fluid.space.order == ORDER:
                self._follow(other, points)
            self._solve(other)
            yield other

    def _follow(self, fluid: Fluid, points: Floats) -> None:
        """Add the change of the base flow between old and new node positions to the velocity."""
        here = self.run.setup.base_flow.velocity(points.T, 0.0).T
        there = self.setup.base_flow.velocity(fluid.constraints.points.T, 0.0).T
        nodes = fluid.space.unknowns_at_nodes
        fluid.state.x.array[nodes] += (there - here)[:, : fluid.space.gdim]

    def _solve(self, fluid: Fluid) -> None:
        kept = isinstance(fluid.solver, Direct)
        tolerance = TOLERANCE_NEARBY if kept else TOLERANCE
        most = self.run.scene.numerics.max_iterations
        with self.run.stage("flow"):
            report = fluid.solve(tolerance, most, keep_factors=kept)
        if not report.converged:
            raise ConvergenceError("Newton's method did not converge on the moved mesh")


def _centre(run: Run, setup: Setup) -> Floats:
    layout, scene = run.layout, setup.scene
    assert layout.placement is not None and layout.resting is not None and scene.grain is not None
    if not scene.rests:
        return spatial(layout.placement.centre)
    return spatial(setup.off_bed(layout.resting).centre)


def _in_domain(run: Run, setup: Setup) -> Floats | None:
    """Node positions (n, 3) in the domain of another setup; None for another bed."""

    def box(domain: Any) -> Floats:
        spans = *domain.spans, (domain.bottom, domain.ceiling), (0.0, 0.0)
        return np.array(spans[:3]).T

    x, region, placement = run.domain.mesh.geometry.x, run.layout.shape, run.layout.placement
    old, new = (box(setup.scene.domain) for setup in (run.setup, setup))
    if np.array_equal(old, new):
        return np.array(x)
    assert placement is not None
    bed, resolved = run.scene.bed_shape, getattr(region, "resolved", None)
    if run.scene.bed is not None and setup.base_flow.datum != run.setup.base_flow.datum:
        return None  # without a bed the bottom moves
    level = isinstance(bed, Flat) or (isinstance(bed, Plane) and not any(bed.slope))
    if resolved is None and not level:
        return None
    kept = np.full(3, KEPT * run.scene.grain.size)
    if resolved is not None:
        kept[:2] = np.maximum(kept[:2], resolved.radius + resolved.passage)
    return stretched(np.array(x), spatial(placement.centre), kept, old, new)
