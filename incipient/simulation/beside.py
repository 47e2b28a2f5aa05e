"""Coarse runs for the error bars of a steady flow in space: on the mesh of the run, moved, in elements of order two."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..errors import ConvergenceError
from ..geometry.rest import lifted
from ..geometry.space.terrain import Plane
from ..parallel import Comm
from ..planning.conditions import conditions
from ..planning.flow_setup import Setup
from ..results.errorbars import Loads
from ..scene import Scene
from .state import Run

if TYPE_CHECKING:
    from ..fluid import Fluid
    from ..planning.base_flow import BaseFlow

# To what error the flows are solved: their differences are percents of the loads.
TOLERANCE = 1e-5
ORDER = 2  # of their elements
KEPT = 2.0  # distance from the grain's centre, in grain sizes, within which a larger domain leaves the mesh as it is


@dataclass(frozen=True)
class _Moved:
    """Where the mesh's nodes (n, 3) are in a scene, and the grain's centre (3,)."""

    places: Floats
    centre: Floats


class Beside:
    """Loads in scenes that differ from that of a solved run by their gap or domain; callable. Collective.

    In space one mesh, moved, serves for all of them, or for none: new ones would differ by their errors as well, and
    take most of the time. Where it does not serve each scene is run by itself.

    Args:
        run: solved; its mesh is as it was whenever a call ends.
        by_itself: runs a scene on a mesh of its own, at a speed.
        speed: of the flow whose loads are asked for, over the scene's.
    """

    def __init__(self, run: Run, by_itself: Callable[[Scene, Comm, float], Loads], speed: float = 1.0):
        self._run, self._by_itself, self._speed = run, by_itself, speed
        self._moved: dict[str, _Moved] | None = None

    def __call__(self, scene: Scene) -> Loads:
        """Force and couple in a scene. Collective."""
        if self._moved is None:
            self._moved = self._all_moved()
        moved = self._moved.get(scene.model_dump_json())
        if moved is None:
            return self._by_itself(scene, self._run.comm, self._speed)
        return self._loads(scene, moved)

    def _all_moved(self) -> dict[str, _Moved]:
        """The mesh in every scene of a coarse run, by the JSON of the scene; none if it does not serve for one."""
        run = self._run
        if (
            run.setup.has_wall_layer
            or run.scene.gdim != 3
            or run.scene.time is not None
            or run.layout.placement is None
        ):
            return {}
        from ..accuracy.errorbars import coarse_scenes
        from ..mesh.motion import MeshMotion
        from ..mesh.stretching import Lifting, serves

        motion, lifting = MeshMotion(run.domain), Lifting(run.domain, "body")
        found: dict[str, _Moved] = {}
        for scene in coarse_scenes(run.scene):
            if scene.numerics.meshed_bed != run.scene.numerics.meshed_bed:
                continue  # another bed
            centre = self._centre(scene)
            places = _in_domain(run, scene)
            if places is None:
                return {}
            shift = centre - np.asarray(run.layout.placement.centre)
            moved = _Moved(places + lifting.at(shift), centre)
            if not serves(motion, moved.places):
                return {}
            found[scene.model_dump_json()] = moved
        return found

    def _centre(self, scene: Scene) -> Floats:
        """Where the grain's centre is with the scene's gap."""
        layout, grain, bed = self._run.layout, scene.grain, scene.bed_shape
        assert layout.placement is not None and layout.resting is not None and grain is not None
        if bed is None or not scene.rests:
            return np.asarray(layout.placement.centre)
        return np.asarray(lifted(grain, layout.resting, bed, scene.contact_gap).centre)

    def _loads(self, scene: Scene, moved: _Moved) -> Loads:
        """Force and couple on the moved mesh."""
        from ..coupled.tractions import TractionProbe
        from ..fluid import Fluid

        run, places = self._run, self._run.domain.mesh.geometry.x
        before, fluid = places.copy(), run.fluid.coarse or run.fluid
        places[:] = moved.places
        try:
            with ExitStack() as stack:
                if fluid.space.order != ORDER or not np.array_equal(places, before):
                    model = replace(fluid.model, order=ORDER)
                    other = stack.enter_context(
                        Fluid(run.domain, model, conditions(Setup(scene)), fluid.reynolds)
                    )
                    other.interpolate(fluid)
                    if fluid.space.order == ORDER:
                        self._follow(fluid, other, Setup(scene).base_flow)
                    self._solve(other)
                    fluid = other
                found = TractionProbe(fluid, "body", moved.centre.tolist()).resultant()
        finally:
            places[:] = before
        # The fluid's unit of speed is its own; what is left of the way to `speed` is short, or in Stokes flow.
        unit = self._speed * run.fluid.reynolds / run.plan.reynolds
        return Loads(unit * found.force, unit * found.couple, moved=True)

    def _follow(self, fluid: Fluid, other: Fluid, base_flow: BaseFlow) -> None:
        """Add to the velocity of the run's flow what the base flow differs by between old places and new ones."""
        points = [one.constraints.points for one in (fluid, other)]
        flows = self._run.setup.base_flow, base_flow
        here, there = (flow.velocity(x.T, 0.0).T for flow, x in zip(flows, points, strict=True))
        places = other.space.velocity_map.reshape(-1, other.space.gdim)
        other.state.x.array[places] += (there - here)[:, : other.space.gdim]

    def _solve(self, fluid: Fluid) -> None:
        """From a flow that is near. Collective. Raises ConvergenceError."""
        with self._run.stage("flow"):
            report = fluid.solve(TOLERANCE, self._run.scene.numerics.max_iterations)
        if not report.converged:
            raise ConvergenceError("the flow on the moved mesh did not converge from the solution of the run")


def _in_domain(run: Run, scene: Scene) -> Floats | None:
    """(n, 3) the mesh's nodes in the domain of a scene; None where the bed there is another one."""
    from ..mesh.stretching import KeptBox, stretched

    def box(domain: Any) -> KeptBox:
        sides = np.array([(domain.left, domain.right), domain.across, (domain.bottom, domain.ceiling)])
        return KeptBox(sides[:, 0], sides[:, 1])

    x, region, placement = run.domain.mesh.geometry.x, run.layout.shape, run.layout.placement
    old, new = (box(one.domain) for one in (run.scene, scene))
    if np.array_equal(old.low, new.low) and np.array_equal(old.high, new.high):
        return np.array(x)
    assert placement is not None
    bed, resolved = run.scene.bed_shape, getattr(region, "resolved", None)
    if Setup(scene).base_flow.datum != run.setup.base_flow.datum:
        return None
    if resolved is None and not (bed is None or (isinstance(bed, Plane) and not any(bed.slope))):
        return None
    kept = np.full(3, KEPT * run.scene.grain.size)
    if resolved is not None:
        kept[:2] = np.maximum(kept[:2], resolved.radius + resolved.passage)
    return stretched(np.array(x), np.asarray(placement.centre), kept, old, new)
