"""Free surface of a run: coupling with the flow, and history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import dolfinx
import numpy as np
from mpi4py import MPI

from .. import compat
from ..arrays import Floats, spatial
from ..coupled.energy import EnergyBudget
from ..coupled.surface import SurfacePart
from ..errors import ConvergenceError, MeshError
from ..fluid import Fluid
from ..fluid.transient import TimeStep, Transient
from ..geometry.placement import Placement
from ..mesh.domain import Domain
from ..mesh.elevation import RisingDisplacement
from ..mesh.motion import MeshMotion
from ..mesh.sampling import Locator, sample
from ..planning.effects import EffectName
from ..results.loads import ElevationReading, Elevations
from ..scene import Scene
from ..scene.surface import stations_of
from ..setup.setup import Setup
from .effect import RunPart, Stage

if TYPE_CHECKING:
    from ..restart import Checkpoint

# Distances of a moving grain, in its size: from the surface, counting as contact; from the still level, below which a
# new mesh has its top at the mean surface above the grain.
TOUCHING, NEAR = 0.05, 0.25
OUTLINE = 65  # points on each curve of a grain's outline


class MovingSurface(RunPart):
    """Free surface above a fluid on a mesh with a level top. Every method is collective.

    Attributes: `part`, set by `joined`; `readings` of elevations.
    """

    effect = EffectName.FREE_SURFACE
    part: SurfacePart

    def __init__(self, setup: Setup, stage: Stage):
        self._setup, self._scene, self._stage = setup, setup.scene, stage
        self.readings: list[ElevationReading] = []

    def joined(self, fluid: Fluid, before: MovingSurface | None = None) -> None:
        """Enter a fluid; the surface of the previous mesh continues with the same volume."""
        assert fluid.surface is not None
        self.fluid, space, condition = fluid, fluid.surface.space, fluid.surface.condition
        setup = self._setup
        body = () if setup.scene.grain is None else ("body",)
        held, pinned = (setup.sides.bottom, *body), condition.pinned
        self._up = fluid.domain.gdim - 1
        rising = RisingDisplacement(
            fluid.domain, space, condition.boundary, held, pinned, condition.origin[self._up]
        )
        self._stations = _Stations(rising, setup)
        elevation, room = np.zeros((2, len(fluid.surface.elevation.x.array)))
        self._places: Floats = space.tabulate_dof_coordinates()[rising.nodes]
        self._places[:, self._up] -= rising.raised
        elevation[rising.nodes] = setup.surface.height(self._places.T)
        room[rising.nodes], below = _depths(setup.scene, self._places)
        self.part = SurfacePart(fluid, rising, elevation, room, below, self._stage)
        self._energy = EnergyBudget(fluid)
        if before is not None:
            self.readings = before.readings
            self._take_over(before)

    def moving(self, motion: MeshMotion) -> tuple[SurfacePart, ...]:
        self._motion = motion
        return (self.part,)

    def on(self, domain: Domain) -> MovingSurface:
        return MovingSurface(self._setup, self._stage)

    def _take_over(self, old: MovingSurface) -> None:
        mesh = old.fluid.domain.mesh
        comm, now = mesh.comm, mesh.geometry.x.copy()
        everywhere = comm.allgather(self._places + old.part.mesh.raised * np.eye(3)[self._up])
        mesh.geometry.x[:] = old._motion.reference
        part, function = self.part, dolfinx.fem.Function(old.part.mesh.space)
        part.times, part.past = list(old.part.times), []
        for elevation in old.part.past:
            function.x.array[:] = elevation
            values = sample(function, np.concatenate(everywhere))[:, 0]
            mine = np.split(values, np.cumsum([len(one) for one in everywhere])[:-1])[comm.rank]
            nodal = np.zeros_like(self.fluid.surface.elevation.x.array)
            nodal[part.mesh.nodes] = mine
            part.past.append(part.mesh.with_volume(nodal, old.part.mesh.mean(elevation)))
        part.restore()
        mesh.geometry.x[:] = now

    def check(self, step: TimeStep, placement: Placement | None) -> None:
        """Raise ConvergenceError for a surface that is too steep or touches the bed or the grain's placement."""
        why = self.part.ends()
        if not why and placement is not None and self._room_above(placement) <= 0.0:
            why = "the grain touches the free surface: use an earlier time.end, a heavier grain or deeper water"
        if why:
            raise ConvergenceError(f"at t = {step.time:.6g} {why}")

    def drawn_height(self, height: float, placement: Placement) -> float:
        """Height of a new mesh around a grain: the still level or, near it, the mean surface above the grain.

        Raises MeshError if the grain reaches it.
        """
        grain, domain = self._scene.grain, self._scene.domain
        assert grain is not None
        upwards = np.eye(domain.gdim)[self._up]
        top = float(self._setup.surroundings.extreme(placement, upwards)[self._up])
        unit = TOUCHING * grain.size
        raised = 0.0
        if top > domain.ceiling - NEAR * grain.size:
            raised = unit * round(self._mean_above(placement, grain.size) / unit)
        if top > domain.ceiling + raised - unit:
            raise MeshError(
                "the grain has risen to the free surface, where the domain cannot be remeshed: use an "
                "earlier time.end, a heavier grain or deeper water"
            )
        return height + raised

    def _mean_above(self, placement: Placement, size: float) -> float:
        own = slice(0, self.part.mesh.owned)
        away = self._places[own, : self._up] - np.asarray(placement.centre)[: self._up]
        near = self.part.elevation[self.part.mesh.nodes[own]][
            np.linalg.norm(away, axis=1) <= 0.5 * size
        ]
        total, count = self.fluid.domain.comm.allreduce(np.array([near.sum(), len(near)]))
        return float(total / max(count, 1.0))

    def _room_above(self, placement: Placement) -> float:
        """Distance of the grain from the surface nodes, less the contact tolerance."""
        grain, nodes = self._scene.grain, self.part.mesh.nodes
        assert grain is not None
        gdim, points = self._up + 1, self._places[:, : self._up + 1].copy()
        points[:, gdim - 1] += self.part.elevation[nodes]
        if gdim == 2:
            outline = placement.to_scene(grain.chain.points(OUTLINE))
            distances = np.linalg.norm(points[:, None] - outline, axis=2)
        else:
            distances = (
                np.linalg.norm(points - np.asarray(placement.centre), axis=1) - 0.5 * grain.size
            )
        nearest = self.fluid.domain.comm.allreduce(float(distances.min(initial=np.inf)), op=MPI.MIN)
        return float(nearest - TOUCHING * grain.size)

    def accept_step(self, step: TimeStep) -> None:
        self.begin()

    def change(self, depth: float) -> float:
        return self.part.risen() / depth

    def begin(self) -> None:
        values = self._stations.values(self.part.elevation)
        self.readings.append(ElevationReading(self.fluid.time, values, self.part.largest()))

    @property
    def elevations(self) -> Elevations | None:
        return Elevations.of(self.readings) if self.readings else None

    def columns(self, step: TimeStep) -> dict[str, float]:
        with self._stage("free surface"):
            elevations = self._stations.values(self.part.elevation)
            by_station = {
                f"elevation_{number}": value for number, value in enumerate(elevations, 1)
            }
            return by_station | {
                **self._discharge(),
                "volume_above_level": self.part.volume(),
                "through_surface": self.part.crossed(),
                "energy_fluid": self._energy.kinetic(),
                "energy_potential": self.part.energy(),
                "dissipation": self._energy.dissipation(),
            }

    def reported(self) -> dict[str, Any]:
        stations = [
            one[0] if len(one) == 1 else one
            for one in stations_of(self._scene.surface, self._scene.domain)
        ]
        surface = {"stations": stations, "elevations": self._stations.values(self.part.elevation)}
        return {"surface": surface | self._discharge(), "elevations": self.elevations}

    def _discharge(self) -> dict[str, float]:
        held, whole = self.fluid.constraints, 2.0 if self.fluid.domain.halved else 1.0
        return {"inflow": whole * held.influx} if held.entries else {}

    @property
    def unknowns(self) -> int:
        return int(self.fluid.domain.comm.allreduce(self.part.mesh.owned))

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, transient: Transient) -> dict[str, Any]:
        from ..restart import StoredSurface, numbered_nodes

        part, nodes = self.part, numbered_nodes(self.fluid.domain.mesh)
        elevations = np.stack([part.mesh.on_nodes(x) for x in part.past], axis=1)
        return {"surface": StoredSurface(nodes.joined(elevations), np.array(part.times))}

    def restore(self, kept: Checkpoint) -> None:
        from ..restart import spread_nodes

        assert kept.surface is not None
        part, mesh = self.part, self.fluid.domain.mesh
        elevations = spread_nodes(mesh, kept.surface.elevations).T.copy()
        part.past = [part.mesh.from_nodes(one) for one in elevations]
        part.times = kept.surface.times.tolist()
        part.restore()


class _Stations:
    def __init__(self, rising: RisingDisplacement, setup: Setup):
        comm, space, scene = rising.domain.comm, rising.space, setup.scene
        across = stations_of(scene.surface, scene.domain)
        top = scene.domain.ceiling + rising.raised
        points = np.array([(*place, top) for place in across]).reshape(-1, scene.gdim)
        if setup.symmetric:  # the meshed half has the larger y
            points[:, 1] = scene.domain.middle + np.abs(points[:, 1] - scene.domain.middle)
        places = Locator(rising.domain.mesh).inside(spatial(points))
        ranks = np.array(comm.allgather(np.where(places.located, comm.rank, comm.size)))
        self._mine = np.flatnonzero(ranks.min(axis=0, initial=comm.size) == comm.rank)
        self._comm, self._count = comm, len(points)
        mine = places.at(self._mine)
        self._nodes = compat.cell_dofs(space)[mine.cells]
        self._weights = compat.tabulate(space, mine.reference)

    def values(self, elevation: Floats) -> list[float]:
        local = np.zeros(self._count)
        local[self._mine] = (self._weights * elevation[self._nodes]).sum(axis=1)
        total: list[float] = self._comm.allreduce(local).tolist()
        return total


def _depths(scene: Scene, places: Floats) -> tuple[Floats, str]:
    """Depth (n,) below the still level at positions (n, 3), down to bed or resting grain, and which in words.

    A 3-D grain does not count: the mesh above it folds before the surface touches it.
    """
    domain, bed = scene.domain, scene.bed_shape
    floor = np.full(len(places), domain.bottom)
    if bed is not None:
        floor = bed.height(places[:, 0] if scene.gdim == 2 else places[:, :2])
    below = "the bed" if bed is not None else "the bottom"
    grain, placement = scene.grain, scene.placement
    if scene.gdim == 3 or grain is None or placement is None or scene.moves:
        return domain.ceiling - floor, below
    outline = placement.to_scene(grain.chain.points(OUTLINE))
    low, high = outline[:, 0].min(), outline[:, 0].max()
    for row, x in enumerate(places[:, 0]):
        if low <= x <= high:
            near = outline[np.abs(outline[:, 0] - x) <= (high - low) / len(outline) * 8.0]
            floor[row] = max(floor[row], near[:, 1].max(initial=floor[row]))
    return domain.ceiling - floor, f"{below} or the grain"
