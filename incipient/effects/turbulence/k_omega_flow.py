"""A scene's flow with the k-omega SST model: its inflow, its steady solution, and its resolved walls."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from ...arrays import Floats
from ...fluid import Fluid
from ...fluid.along_walls import AlongWall, along_resolved_wall, coarse_along
from ...mesh.domain import Domain
from ...mesh.wall_distance import distances
from ...planning.base_flow import Velocity
from ...planning.resolved_walls import ResolvedWalls
from ...results.resolved_wall_report import LARGEST_CHANGE, ResolvedWallReport
from .fields import TurbulenceConditions, Values
from .k_omega_sst import KOmegaSST, Sand
from .part import ORDER, TurbulentFlow

LEAST = (
    1e-3  # k over u*^2, as little as nothing; without it ln k falls for ever in crevices of a bed
)
# k over V^2 that is added to k in its unknown where the edge of a boundary layer would be a front of ln k.
ADDED = 1e-4


class KOmegaFlow(TurbulentFlow):
    """The k-omega SST model in a scene's flow, judged by the cells at its walls. Every method is collective."""

    fields: KOmegaSST

    def _made(self, domain: Domain) -> KOmegaSST:
        walls, left = self._walls, self._setup.sides.left
        given = TurbulenceConditions((left,), self._logarithms, walls.names)
        order = self._setup.order.number
        return KOmegaSST(
            domain,
            given,
            ORDER,
            self._scene.viscosity,
            order,
            self._least,
            Sand(walls.roughness, walls.rough, walls.shear_velocity**2),
            in_layers=not walls.plane,
            added=self._added,
        )

    def _entering(self) -> tuple[Velocity, Values]:
        return self._walls.velocity, self._logarithms

    def _logarithms(self, x: Floats) -> Floats:
        """Inflow values (2, n) at places (3, n)."""
        return self._floored(self._walls.logarithms(x))

    def _floored(self, logarithms: Floats) -> Floats:
        """(2, n) with k at least what is not destroyed, and what is added to it."""
        log_k, log_omega = logarithms
        k = (
            np.maximum(np.exp(log_k), self._least)
            if not self._added
            else np.exp(log_k) + self._added
        )
        return np.array([np.log(k), log_omega])

    def _give(self, fluid: Fluid) -> None:
        """Let inflow and walls be those of the setup as it is now."""
        super()._give(fluid)
        self.fields.stand(self._scene.viscosity, self._walls.shear_velocity**2)
        self.fields.keep(self._least)

    @property
    def _least(self) -> float:
        return float(LEAST * self._walls.shear_velocity**2)

    @property
    def _least_carried(self) -> float:
        """Bound below which k is not destroyed."""
        return math.log(max(self._least, self._added))

    @property
    def _added(self) -> float:
        layer = self._walls.layer_over_forms
        return ADDED * self._scene.reference_velocity**2 if layer else 0.0

    @property
    def _walls(self) -> ResolvedWalls:
        return self._setup.resolved_walls

    def enter(self, fluid: Fluid) -> None:
        """Set velocity and turbulence everywhere to the inflow's values at the distance from the next wall."""
        walls, space = self._walls, fluid.space.velocity
        places = space.tabulate_dof_coordinates()[:, : fluid.domain.gdim]
        away = distances(fluid.domain, walls.names, places)
        fluid.state.x.array[fluid.space.velocity_map] = walls.velocity_at(away).T.ravel()
        self.fields.begin(lambda away: self._floored(walls.logarithms_at(away)))

    def wall_report(self) -> ResolvedWallReport:
        """u* along the walls, and how thick the cells at them are."""
        scene, walls = self._scene, self._walls
        along = {
            name: along_resolved_wall(self._fluid, name, name in walls.rough)
            for name in walls.names
        }
        found, shares = (
            np.concatenate(parts)
            for parts in zip(
                *((one.shear_velocities, one.lengths) for one in along.values()), strict=True
            )
        )
        y_plus, limits, weights = self._thickness(along)
        bottom, in_plane = along[walls.names[0]], scene.gdim == 2
        mean = float(found @ shares / shares.sum())
        last = bottom.at_outflow()
        _, away = self.fields.at_edge()
        return ResolvedWallReport(
            distance=self.fields.largest(away),
            least=float(y_plus.min()),
            largest=float(y_plus.max()),
            shear_velocity=mean,
            at_outflow=last,
            friction=2.0 * (last / scene.reference_velocity) ** 2,
            viscosity=scene.viscosity,
            c_mu=0.09,
            outside=float(np.average(y_plus > limits, weights=weights)),
            plane=walls.plane,
            reach=walls.depth,
            backward=bottom.backward() if in_plane else (),
            along=self._told(along) if in_plane else {},
            mesh_size=scene.numerics.mesh_size,
            thickest=walls.thickest(walls.names[-1]),
            on_sand=walls.thickest(walls.rough[0]) if walls.rough else 0.0,
            excess=float((y_plus / limits).max()),
            iteration=self.continued,
            coarse_along=0.0 if walls.plane else coarse_along(along, walls.rough, LARGEST_CHANGE),
            judged_along=walls.smooth and in_plane,
        )

    def _thickness(self, walls: Mapping[str, AlongWall]) -> tuple[Floats, Floats, Floats]:
        """Thickness (n,) of the cells at walls where they end, in nu/u* of the next place of a wall, on all ranks.

        And up to which (n,) they resolve that wall, and the lengths (n,) of it, in 3-D areas, that they stand for.
        """
        places, away = self.fields.at_edge()
        at_walls, found, lengths = (
            np.concatenate([getattr(one, name) for one in walls.values()])
            for name in ("places", "shear_velocities", "lengths")
        )
        limits = np.repeat(
            [self._walls.thickest(name) for name in walls],
            [len(one.lengths) for one in walls.values()],
        )
        nearest, mine = np.empty(0, dtype=np.int64), np.empty(0)
        if len(places):
            _, nearest = cKDTree(at_walls).query(places)
            mine = away * found[nearest] / self._scene.viscosity
        gathered = self.fields.domain.comm.allgather((mine, nearest))
        thickness, nearest = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        shares = lengths / np.maximum(np.bincount(nearest, minlength=len(lengths)), 1)
        return thickness, limits[nearest], shares[nearest]

    def _told(self, walls: Mapping[str, AlongWall]) -> dict[str, dict[str, list[float]]]:
        """What is drawn of each wall, in six digits; y+ is that of the cell next to each place."""
        scene, gathered = self._scene, self.fields.domain.comm.allgather(self.fields.at_edge())
        ends, away = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
        tree, drawn = cKDTree(ends), {}
        for wall, along in walls.items():
            found = along.shear_velocities
            friction = (
                2.0 * np.sign(along.velocities[:, 0]) * (found / scene.reference_velocity) ** 2
            )
            y_plus = found * away[tree.query(along.places)[1]] / scene.viscosity
            columns = {"x": along.places[:, 0], "y_plus": y_plus, "friction": friction}
            drawn[wall] = {
                name: [float(f"{one:.6g}") for one in values] for name, values in columns.items()
            }
        return drawn
