"""The free surface of a run: its part in the coupling with the flow, and what the history tells of it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from .. import compat
from ..arrays import Floats, spatial
from ..coupled.coupling import Coupling, InterfaceReport
from ..coupled.energy import EnergyBudget
from ..coupled.surface import SurfacePart
from ..fluid import Fluid, TimeStep
from ..mesh.elevation import RisingDisplacement
from ..mesh.locator import Locator
from ..mesh.motion import MeshMotion
from ..planning.surface import depths, stays_below, surface_of
from ..scene import Scene

Stage = Callable[[str], AbstractContextManager[Any]]


class MovingSurface:
    """The free surface above a fluid whose mesh is as it was made, level on top. Every method is collective.

    Args:
        stage: context managers by name that take the time.

    Attributes:
        coupling: of flow and surface; making it has moved the mesh to where the surface is.
    """

    def __init__(self, scene: Scene, fluid: Fluid, stage: Stage):
        assert fluid.surface is not None
        self.fluid, space = fluid, fluid.surface.space
        boundary = fluid.surface.condition.boundary
        rising = RisingDisplacement(fluid.domain, space, boundary, stays_below(scene))
        self._stations = _Stations(rising, scene)
        elevation = np.zeros_like(fluid.surface.elevation.x.array)
        places = space.tabulate_dof_coordinates()[rising.nodes]
        elevation[rising.nodes] = surface_of(scene).height(places.T)
        room = np.zeros_like(elevation)
        room[rising.nodes], below = depths(scene, places)
        self.part = SurfacePart(fluid, rising, elevation, room, below, stage)
        asked = scene.numerics.interface_tolerance
        motion = MeshMotion(fluid.domain)
        self.coupling = Coupling(fluid, [self.part], motion, None if asked == "auto" else asked, stage=stage)
        fluid.domain.mesh.geometry.x[:] = self.coupling.places[0]
        fluid.constraints.boundary_points_moved()
        self._energy, self._stage = EnergyBudget(fluid), stage

    def columns(self, step: TimeStep) -> dict[str, float]:
        """What the history tells of the surface after a step."""
        assert isinstance(step.report, InterfaceReport)
        with self._stage("free surface"):
            told = self._stations.values(self.part.elevation)
            found = {f"elevation_{number}": value for number, value in enumerate(told, 1)}
            return found | {
                "volume_above_level": self.part.volume(),
                "through_surface": self.part.crossed(),
                "interface": step.report.corrected,
                "interface_residual": step.report.residuals[-1],
                "mesh_quality": self.coupling.quality.worst,
                "energy_fluid": self._energy.kinetic(),
                "energy_potential": self.part.energy(),
                "dissipation": self._energy.dissipation(),
            }

    def unknowns(self) -> int:
        """Number of nodes of the surface over all ranks."""
        return int(self.fluid.domain.comm.allreduce(self.part.mesh.owned))


class _Stations:
    """Reads the elevation at the stations of a scene, of which the weights of the nodes do not change."""

    def __init__(self, rising: RisingDisplacement, scene: Scene):
        comm, space = rising.domain.comm, rising.space
        across = surface_of(scene).places()
        points = np.array([(*place, scene.domain.ceiling) for place in across]).reshape(-1, scene.gdim)
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
