"""Free surface of a run: coupling with the flow, and history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, spatial
from ..errors import ConvergenceError, MeshError
from ..fluid import Fluid
from ..fluid.transient import TimeStep, Transient
from ..geometry.placement import Placement
from ..mesh.elevation import RisingDisplacement
from ..mesh.motion import MeshMotion
from ..mesh.sampling import Transfer
from ..parallel import largest
from ..results.loads import Elevations
from ..scene.sections import stations_of
from ..setup.setup import Setup
from .surface import SurfacePart

if TYPE_CHECKING:
    from ..restart import Checkpoint

# Distances of a moving grain, in its size: from the surface, counting as contact; from the still level, below which a
# new mesh has its top at the mean surface above the grain.
TOUCHING, NEAR = 0.05, 0.25


class MovingSurface(SurfacePart):
    """Free surface above a fluid on a mesh with a level top. Every method is collective.

    readings: time, elevations at the stations, and largest absolute elevation
    """

    effect = "free surface"

    def __init__(self, setup: Setup, fluid: Fluid, motion: MeshMotion):
        self._setup, self._scene, self._motion = setup, setup.scene, motion
        space, condition = fluid.surface.space, fluid.surface.condition
        body = () if setup.scene.grain is None else ("body",)
        self._up = fluid.domain.gdim - 1
        rising = RisingDisplacement(
            *(fluid.domain, space, condition.boundary, (setup.sides.bottom, *body)),
            condition.pinned,
            condition.origin[self._up],
        )
        self._stations = Transfer(fluid.domain.mesh, _stations(setup, rising.raised))
        elevation, room = np.zeros((2, len(fluid.surface.elevation.x.array)))
        self._places: Floats = space.tabulate_dof_coordinates()[rising.nodes]
        self._places[:, self._up] -= rising.raised
        elevation[rising.nodes] = setup.surface.height(self._places.T)
        # A grain does not count: the mesh above it folds before the surface touches it.
        room[rising.nodes] = setup.scene.domain.ceiling - setup.scene.bed_height(self._places)
        below = "the bottom" if setup.scene.bed is None else "the bed"
        super().__init__(fluid, rising, elevation, room, below)
        self.readings: list[tuple[float, list[float], float]] = []

    def on(self, fluid: Fluid, motion: MeshMotion) -> MovingSurface:
        """The surface above a fluid on its original mesh, with the same volume."""
        new = MovingSurface(self._setup, fluid, motion)
        mesh = self.fluid.domain.mesh
        now = mesh.geometry.x.copy()
        mesh.geometry.x[:] = self._motion.reference
        transfer = Transfer(mesh, new._places + self.mesh.raised * np.eye(3)[self._up], reach=0.0)
        new.readings, new.times, new.past = self.readings, list(self.times), []
        for elevation in self.past:
            nodal = np.zeros_like(fluid.surface.elevation.x.array)
            nodal[new.mesh.nodes] = transfer.of_state(self.mesh.space, elevation)[:, 0]
            new.past.append(new.mesh.with_volume(nodal, self.mesh.mean(elevation)))
        new.restore()
        mesh.geometry.x[:] = now
        return new

    def check(self, step: TimeStep, placement: Placement | None) -> None:
        """Raise ConvergenceError for a surface that is too steep or touches the bed or the grain's placement."""
        why = self.ends()
        if not why and placement is not None:
            surface = self._scene.domain.ceiling + self._mean_above(placement)
            if surface - self._top_of(placement) <= TOUCHING * self._scene.grain.size:
                why = "the grain touches the free surface: use an earlier time.end, a heavier grain or deeper water"
        if why:
            raise ConvergenceError(f"at t = {step.time:.6g} {why}")

    def drawn_height(self, height: float, placement: Placement) -> float:
        """Height of a new mesh around a grain: the still level or, near it, the mean surface above the grain.

        Raises MeshError if the grain reaches it.
        """
        level, size = self._scene.domain.ceiling, self._scene.grain.size
        top, unit, raised = self._top_of(placement), TOUCHING * size, 0.0
        if top > level - NEAR * size:
            raised = unit * round(self._mean_above(placement) / unit)
        if top > level + raised - unit:
            raise MeshError(
                "the grain has risen to the free surface, where the domain cannot be remeshed: use an "
                "earlier time.end, a heavier grain or deeper water"
            )
        return height + raised

    def _top_of(self, placement: Placement) -> float:
        upwards = placement.rotation[self._up]
        return float(placement.to_scene([self._scene.grain.extreme(upwards)])[0, self._up])

    def _mean_above(self, placement: Placement) -> float:
        own = slice(0, self.mesh.owned)
        away = self._places[own, : self._up] - np.asarray(placement.centre)[: self._up]
        above = np.linalg.norm(away, axis=1) <= 0.5 * self._scene.grain.size
        near = self.past[0][self.mesh.nodes[own]][above]
        total, count = self.fluid.domain.comm.allreduce(np.array([near.sum(), len(near)]))
        return float(total / max(count, 1.0))

    def read(self) -> None:
        highest = largest(self.fluid.domain.comm, np.abs(self.past[0]))
        self.readings.append((self.fluid.time, self._at_stations(), highest))

    def _at_stations(self) -> list[float]:
        return list(self._stations.values(self.fluid.surface.elevation)[:, 0].tolist())

    @property
    def elevations(self) -> Elevations | None:
        if not self.readings:
            return None
        times, values, largest = zip(*self.readings, strict=True)
        return Elevations(np.array(times), np.array(values), max(largest))

    def columns(self, step: TimeStep) -> dict[str, float]:
        _, elevations, _ = self.readings[-1]
        by_station = {f"elevation_{number}": value for number, value in enumerate(elevations, 1)}
        return by_station | {
            **self._discharge(),
            "volume_above_level": self.volume(),
            "through_surface": self.crossed(),
            "energy_potential": self.energy(),
        }

    def reported(self) -> dict[str, Any]:
        stations = [
            station[0] if len(station) == 1 else station
            for station in stations_of(self._scene.surface, self._scene.domain)
        ]
        surface = {"stations": stations, "elevations": self._at_stations()}
        return {"surface": surface | self._discharge(), "elevations": self.elevations}

    def _discharge(self) -> dict[str, float]:
        held, whole = self.fluid.constraints, self.fluid.domain.multiplicity
        return {"inflow": whole * held.influx} if held.entries else {}

    @property
    def unknowns(self) -> int:
        return int(self.fluid.domain.comm.allreduce(self.mesh.owned))

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, transient: Transient) -> dict[str, Any]:
        from ..restart import numbered_nodes

        nodes = numbered_nodes(self.fluid.domain.mesh)
        elevations = np.stack([self.mesh.on_nodes(x) for x in self.past], axis=1)
        return {"surface": {"elevations": nodes.joined(elevations), "times": self.times}}

    def resume(self, kept: Checkpoint) -> None:
        from ..restart import spread_nodes

        elevations = spread_nodes(self.fluid.domain.mesh, kept.surface["elevations"]).T.copy()
        self.past = [self.mesh.from_nodes(elevation) for elevation in elevations]
        self.times = kept.surface["times"]
        self.restore()


def _stations(setup: Setup, raised: float) -> Floats:
    """Positions (n, 3) of the stations on top of the mesh, in half of a domain of its part with the larger y."""
    scene, domain = setup.scene, setup.scene.domain
    points = [(*place, domain.ceiling + raised) for place in stations_of(scene.surface, domain)]
    places = spatial(np.array(points).reshape(-1, scene.gdim))
    if setup.symmetric:
        places[:, 1] = domain.middle + np.abs(places[:, 1] - domain.middle)
    return places
