"""The free surface of a run: its part in the coupling with the flow, and what the history tells of it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

from .. import compat
from ..arrays import Floats, spatial
from ..coupled.coupling import Coupling, InterfaceReport
from ..coupled.energy import EnergyBudget
from ..coupled.part import Part
from ..coupled.surface import SurfacePart
from ..errors import ConvergenceError, MeshError
from ..fluid import Fluid, TimeStep
from ..geometry.placement import Placement
from ..mesh.elevation import RisingDisplacement
from ..mesh.locator import Locator
from ..mesh.motion import MeshMotion
from ..mesh.sampling import sample
from ..planning.open_channel import surface_of
from ..planning.surface import OUTLINE, depths, stays_below
from ..results.elevations import Reading
from ..scene import Scene
from ..scene.surface import stations_of

Stage = Callable[[str], AbstractContextManager[Any]]

# Distance of a moving grain from the surface, in its size, that counts as touching; and distance from the still level
# below which a new mesh has its top at the height of the surface above the grain.
TOUCHING, NEAR = 0.05, 0.25


class MovingSurface:
    """The free surface above a fluid whose mesh is as it was made, level on top. Every method is collective.

    Where the mesh's top is not the still level, the mesh is moved by the elevation less the height in between.

    Args:
        stage: context managers by name that take the time.

    Attributes:
        coupling: of flow, surface and what moves with them, once `coupled` has made it.
    """

    coupling: Coupling

    def __init__(self, scene: Scene, fluid: Fluid, stage: Stage):
        assert fluid.surface is not None
        self.fluid, self._scene, self._stage, space = fluid, scene, stage, fluid.surface.space
        condition = fluid.surface.condition
        held, pinned = stays_below(scene), condition.pinned
        self._up = fluid.domain.gdim - 1
        rising = RisingDisplacement(
            fluid.domain, space, condition.boundary, held, pinned, condition.origin[self._up]
        )
        self._stations = _Stations(rising, scene)
        elevation, room = np.zeros((2, len(fluid.surface.elevation.x.array)))
        self._places: Floats = space.tabulate_dof_coordinates()[rising.nodes]
        self._places[:, self._up] -= rising.raised
        elevation[rising.nodes] = surface_of(scene).height(self._places.T)
        room[rising.nodes], below = depths(scene, self._places)
        self.part = SurfacePart(fluid, rising, elevation, room, below, stage)
        self._energy = EnergyBudget(fluid)

    def coupled(self, motion: MeshMotion, *others: Part) -> Coupling:
        """The coupling of the flow with other parts and the surface; the mesh goes to where they are."""
        asked = self._scene.numerics.interface_tolerance
        tolerance = None if asked == "auto" else asked
        self.coupling = Coupling(self.fluid, [*others, self.part], motion, tolerance, stage=self._stage)
        self.fluid.domain.mesh.geometry.x[:] = self.coupling.places[0]
        self.fluid.constraints.boundary_points_moved()
        return self.coupling

    def carried_to(self, fluid: Fluid) -> MovingSurface:
        """The surface with its past above a new mesh, as that was made; its volume stays."""
        new, mesh, old = MovingSurface(self._scene, fluid, self._stage), self.fluid.domain.mesh, self.part
        comm, now = mesh.comm, mesh.geometry.x.copy()
        everywhere = comm.allgather(new._places + old.mesh.raised * np.eye(3)[self._up])
        mesh.geometry.x[:] = self.coupling.motion.reference
        part, function = new.part, dolfinx.fem.Function(old.mesh.space)
        part.times, part.past = list(old.times), []
        for elevation in old.past:
            function.x.array[:] = elevation
            values = sample(function, np.concatenate(everywhere))[:, 0]
            mine = np.split(values, np.cumsum([len(one) for one in everywhere])[:-1])[comm.rank]
            found = np.zeros_like(fluid.surface.elevation.x.array)
            found[part.mesh.nodes] = mine
            part.past.append(part.mesh.with_volume(found, old.mesh.mean(elevation)))
        part.restore()
        mesh.geometry.x[:] = now
        return new

    def ends(self, step: TimeStep, placement: Placement | None = None) -> None:
        """Refuse to go on from a surface that cannot, above a moving grain's placement if there is one.

        Raises:
            ConvergenceError: it is too steep, or touches what is below it; why, and a remedy.
        """
        why = self.part.ends()
        if not why and placement is not None and self._room_above(placement) <= 0.0:
            why = "the grain touches the free surface: end before it does, or use a heavier grain or deeper water"
        if why:
            raise ConvergenceError(f"at t = {step.time:.6g} {why}")

    def drawn(self, placement: Placement) -> Scene:
        """The scene as a new mesh around a grain is drawn for it.

        Its top is the still level, or where the grain comes near to that the mean height of the surface above it.

        Raises:
            MeshError: the grain reaches up to there.
        """
        grain, domain = self._scene.grain, self._scene.domain
        assert grain is not None
        half = 0.5 * grain.size
        if self._up == 1:
            half = float(placement.to_scene(grain.chain.points(OUTLINE))[:, 1].max()) - placement.centre[1]
        top, unit = placement.centre[self._up] + half, TOUCHING * grain.size
        raised = 0.0
        if top > domain.ceiling - NEAR * grain.size:
            raised = unit * round(self._mean_above(placement, grain.size) / unit)
        if top > domain.ceiling + raised - unit:
            raise MeshError(
                "the grain has risen to the free surface, where no new mesh can be made: end before it does, or use "
                "a heavier grain or deeper water"
            )
        if raised == 0.0:
            return self._scene
        higher = domain.model_copy(update={"height": domain.height + raised})
        return self._scene.model_copy(update={"domain": higher})

    def _mean_above(self, placement: Placement, size: float) -> float:
        """The mean elevation of the surface's nodes within half of a grain's size of its centre along the level."""
        own = slice(0, self.part.mesh.owned)
        away = self._places[own, : self._up] - np.asarray(placement.centre)[: self._up]
        near = self.part.elevation[self.part.mesh.nodes[own]][np.linalg.norm(away, axis=1) <= 0.5 * size]
        total, count = self.fluid.domain.comm.allreduce(np.array([near.sum(), len(near)]))
        return float(total / max(count, 1.0))

    def _room_above(self, placement: Placement) -> float:
        """How far the grain is from the nodes of the surface, less what counts as touching."""
        grain, nodes = self._scene.grain, self.part.mesh.nodes
        assert grain is not None
        gdim, points = self._up + 1, self._places[:, : self._up + 1].copy()
        points[:, gdim - 1] += self.part.elevation[nodes]
        if gdim == 2:
            outline = placement.to_scene(grain.chain.points(OUTLINE))
            distances = np.linalg.norm(points[:, None] - outline, axis=2)
        else:
            distances = np.linalg.norm(points - np.asarray(placement.centre), axis=1) - 0.5 * grain.size
        nearest = self.fluid.domain.comm.allreduce(float(distances.min(initial=np.inf)), op=MPI.MIN)
        return float(nearest - TOUCHING * grain.size)

    def reading(self) -> Reading:
        """The elevations at the stations now, and the largest anywhere."""
        values = self._stations.values(self.part.elevation)
        return Reading(self.fluid.time, values, self.part.largest())

    def columns(self, step: TimeStep) -> dict[str, float]:
        """What the history tells of the surface after a step."""
        assert isinstance(step.report, InterfaceReport)
        with self._stage("free surface"):
            told = self._stations.values(self.part.elevation)
            found = {f"elevation_{number}": value for number, value in enumerate(told, 1)}
            return found | {
                **self._discharge(),
                "volume_above_level": self.part.volume(),
                "through_surface": self.part.crossed(),
                "interface": step.report.corrected,
                "interface_residual": step.report.residuals[-1],
                "mesh_quality": self.coupling.quality.worst,
                "energy_fluid": self._energy.kinetic(),
                "energy_potential": self.part.energy(),
                "dissipation": self._energy.dissipation(),
            }

    def told(self) -> dict[str, Any]:
        """What a result tells of the surface at the end."""
        stations = [one[0] if len(one) == 1 else one for one in stations_of(self._scene)]
        found = {"stations": stations, "elevations": self._stations.values(self.part.elevation)}
        return found | self._discharge()

    def _discharge(self) -> dict[str, float]:
        """What enters per time at the inflow of a channel and through the bed, of the whole where half is meshed."""
        held, whole = self.fluid.constraints, 2.0 if self.fluid.domain.halved else 1.0
        found = {"inflow": whole * (held.influx - held.seepage)} if held.entries else {}
        return found | ({"seepage": whole * held.seepage} if held.seeps else {})

    def unknowns(self) -> int:
        """Number of nodes of the surface over all ranks."""
        return int(self.fluid.domain.comm.allreduce(self.part.mesh.owned))


class _Stations:
    """Reads the elevation at the stations of a scene, of which the weights of the nodes do not change."""

    def __init__(self, rising: RisingDisplacement, scene: Scene):
        comm, space = rising.domain.comm, rising.space
        across = stations_of(scene)
        top = scene.domain.ceiling + rising.raised
        points = np.array([(*place, top) for place in across]).reshape(-1, scene.gdim)
        if scene.symmetric:  # the half that is computed has the larger y
            points[:, 1] = scene.domain.middle + np.abs(points[:, 1] - scene.domain.middle)
        places = Locator(rising.domain.mesh).inside(spatial(points))
        ranks = np.array(comm.allgather(np.where(places.found, comm.rank, comm.size)))
        self._mine = np.flatnonzero(ranks.min(axis=0, initial=comm.size) == comm.rank)
        self._comm, self._count = comm, len(points)
        mine = places.at(self._mine)
        self._nodes = compat.cell_dofs(space)[mine.cells]
        self._weights = compat.tabulate(space, mine.reference)

    def values(self, elevation: Floats) -> list[float]:
        """The elevations, on every rank."""
        found = np.zeros(self._count)
        found[self._mine] = (self._weights * elevation[self._nodes]).sum(axis=1)
        total: list[float] = self._comm.allreduce(found).tolist()
        return total
