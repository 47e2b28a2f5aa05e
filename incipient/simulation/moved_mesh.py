"""Mesh of a steady run, moved to other gaps and domains, and its second-order flow."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Floats, spatial
from ..coupled.tractions import TractionProbe
from ..errors import ConvergenceError
from ..fluid import Fluid
from ..geometry.closest import lifted
from ..geometry.plane.beds import Flat
from ..geometry.space.beds import Plane
from ..mesh.motion import LEAST_QUALITY, MeshMotion, Potentials, stretched
from ..meshes import SYMMETRY
from ..planning.conditions import conditions
from ..results.errorbars import Loads
from ..scene import Scene
from ..setup.setup import Setup
from .state import Run
from .steady import unit_of

# Tolerance of the flows, whose loads differ by per cents.
TOLERANCE = 1e-5
ORDER = 2  # of their elements
KEPT = 2.0  # distance from the grain's centre, in grain sizes, within which a larger domain keeps the mesh


def moved_meshes(run: Run, scenes: Iterable[Scene]) -> dict[str, MovedMesh]:
    """Move the mesh to each scene, by its JSON; empty if one needs another mesh. Collective."""
    assert run.layout.placement is not None
    motion = MeshMotion(run.domain)
    # Nodes follow a fraction of the grain's displacement; those on the plane of symmetry move within it.
    weights = Potentials(run.domain).weights("body", (SYMMETRY,), rigid=1.0)[:, None]
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
        run, places = self.run, self.run.domain.mesh.geometry.x
        before, fluid = places.copy(), run.fluid.coarse or run.fluid
        order = ORDER if run.scene.gdim == 3 else fluid.space.order
        places[:] = self.places
        try:
            with ExitStack() as stack:
                if fluid.space.order != order or not np.array_equal(places, before):
                    model = replace(fluid.model, order=order)
                    other = Fluid(run.domain, model, conditions(self.setup), fluid.reynolds)
                    stack.enter_context(other)
                    other.interpolate(fluid)
                    if fluid.space.order == order:
                        self._follow(fluid, other)
                    self._solve(other)
                    fluid = other
                resultant = TractionProbe(fluid, "body", self.centre.tolist()).resultant()
        finally:
            places[:] = before
        unit = unit_of(run, speed)
        return Loads(unit * resultant.force, unit * resultant.torque, moved=True)

    def _follow(self, fluid: Fluid, other: Fluid) -> None:
        """Add the change of the base flow between old and new positions to the velocity."""
        points = [one.constraints.points for one in (fluid, other)]
        flows = self.run.setup.base_flow, self.setup.base_flow
        here, there = (flow.velocity(x.T, 0.0).T for flow, x in zip(flows, points, strict=True))
        places = other.space.unknowns_at_nodes
        other.state.x.array[places] += (there - here)[:, : other.space.gdim]

    def _solve(self, fluid: Fluid) -> None:
        with self.run.stage("flow"):
            report = fluid.solve(TOLERANCE, self.run.scene.numerics.max_iterations)
        if not report.converged:
            raise ConvergenceError("Newton's method did not converge on the moved mesh")


def _centre(run: Run, setup: Setup) -> Floats:
    layout, scene = run.layout, setup.scene
    assert layout.placement is not None and layout.resting is not None and scene.grain is not None
    if scene.bed_shape is None or not scene.rests:
        return spatial(layout.placement.centre)
    return spatial(lifted(scene.grain, layout.resting, scene.bed_shape, scene.contact_gap).centre)


def _in_domain(run: Run, setup: Setup) -> Floats | None:
    """Node positions (n, 3) in the domain of another setup; None for another bed."""

    def box(domain: Any) -> Floats:
        spans = *domain.spans, (domain.bottom, domain.ceiling), (0.0, 0.0)
        return np.array(spans[:3]).T

    x, region, placement = run.domain.mesh.geometry.x, run.layout.shape, run.layout.placement
    old, new = (box(one.scene.domain) for one in (run.setup, setup))
    if np.array_equal(old, new):
        return np.array(x)
    assert placement is not None
    bed, resolved = run.scene.bed_shape, getattr(region, "resolved", None)
    if bed is not None and setup.base_flow.datum != run.setup.base_flow.datum:
        return None  # without a bed the bottom moves
    level = isinstance(bed, Flat) or (isinstance(bed, Plane) and not any(bed.slope))
    if resolved is None and not (bed is None or level):
        return None
    kept = np.full(3, KEPT * run.scene.grain.size)
    if resolved is not None:
        kept[:2] = np.maximum(kept[:2], resolved.radius + resolved.passage)
    return stretched(np.array(x), spatial(placement.centre), kept, old, new)
