"""Smooth walls that a model of the mean flow reaches: how finely they are meshed, and what enters between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Floats
from ..forms.k_omega_sst import EXPONENT, at_smooth_wall
from ..meshes import Grid, Near
from ..scene import Domain
from .base_flow import BaseFlow
from .developed_channel import DevelopedChannel, of_discharge
from .scene_geometry import Geometry
from .sides import SideNames
from .wall_cells import RowSizes, growing_rows
from .wall_layer import height_at_inflow

C_MU = 0.09  # of the mixing length of what enters
# Wall units: rows next to plane walls, and cells at others, for mesh_size = 1.
FIRST_ROW, FIRST_CELL = 0.6, 1.0
GROWTH, LARGEST_ROW = 0.3, 0.08  # of cells with the distance from walls; of the depth
CELL_GROWTH = 0.3  # of cells that are not stretched
AT_GRAIN = 0.5  # of cells at a grain over those: u* on its crest is twice that of the bed
COLUMN, FEWEST_COLUMNS = 0.5, 8  # of a channel's mesh, over the depth
OF_PLATE, EXPONENT_OF_PLATE, EARLY = (
    0.027,
    1.0 / 7.0,
    0.05,
)  # C_f = 0.027 Re_x^(-1/7) of plates, and where it is taken
SLOWEST = 1e-3  # of the height of the first volume, below which what enters does not change


@dataclass(frozen=True)
class ResolvedWalls:
    """The walls of a flow that its mesh resolves.

    depth:          over which a wall is felt: that of an open channel, half of that between two walls
    number:         of walls above each other at the inflow, one or two
    floor:          height of the lower one there
    shear_velocity: u* of what enters, or as it is estimated
    mean:           reference velocity; viscosity: kinematic
    plane:          whether all walls are planes: no bed forms, no grain
    names:          of the boundaries that are walls
    given:          intensity and mixing length of a uniform stream that enters; None: a developed one does
    up:             axis of heights
    """

    depth: float
    number: int
    floor: float
    shear_velocity: float
    mean: float
    viscosity: float
    plane: bool
    names: tuple[str, ...]
    given: tuple[float, float] | None
    up: int
    developed: DevelopedChannel | None

    @property
    def unit(self) -> float:
        """nu/u* [length]."""
        return self.viscosity / self.shear_velocity

    def text(self) -> str:
        """How walls are treated, in words."""
        first = FIRST_ROW if self.plane else FIRST_CELL
        return (
            f"walls resolved, first cells {first:g} nu/u* thick with mesh_size = 1, "
            f"u* about {self.shear_velocity:.3g}"
        )

    def from_next(self, x: Floats) -> Floats:
        """Distances (n,) of places (3, n) of the inflow from the next wall, at least zero."""
        above = np.maximum(x[self.up] - self.floor, 0.0)
        return np.minimum(above, np.maximum(2.0 * self.depth - above, 0.0)) if self.number == 2 else above

    @cached_property
    def _speed(self) -> Any:
        from scipy.interpolate import PchipInterpolator

        assert self.developed is not None
        scale = self.mean / self.developed.mean
        return PchipInterpolator(self.developed.heights, scale * self.developed.speed)

    def velocity(self, x: Floats, t: float) -> Floats:
        """The velocity (gdim, n) that enters at places (3, n). Not collective."""
        away = self.from_next(x)
        if self.developed is None:
            speed = np.full(len(away), self.mean)
        else:
            speed = self._speed(np.minimum(away / self.depth, 1.0))
        return np.vstack([speed, *np.zeros((self.up, len(away)))])

    def logarithms(self, x: Floats) -> Floats:
        """ln k and ln omega (2, n) at places (3, n) of the inflow. Not collective."""
        away = self.from_next(x)
        if self.developed is None:
            assert self.given is not None
            intensity, length = self.given
            k = 1.5 * (intensity * self.mean) ** 2
            omega = math.sqrt(k) / (C_MU**0.25 * length)
            return np.log([np.full(len(away), k), np.full(len(away), omega)])
        found, first = self.developed, self.developed.heights[1]
        heights = np.maximum(away / self.depth, SLOWEST * first)
        nodes = np.log(found.heights[1:])
        unit = self.shear_velocity
        k = np.interp(np.log(heights), nodes, found.log_k[1:]) + 2.0 * math.log(unit)
        omega = np.interp(np.log(heights), nodes, found.log_omega[1:]) + math.log(unit / self.depth)
        below = heights < first
        k[below] += EXPONENT * np.log(heights[below] / first)
        omega[below] = at_smooth_wall(self.viscosity, self.depth * heights[below], np)
        return np.array([k, omega])


def resolved_walls_of(asked: Any, geometry: Geometry, base_flow: BaseFlow, names: SideNames) -> ResolvedWalls:
    """The walls of a flow and what enters between them, as the section [turbulence] asks. Not collective.

    Raises:
        ConvergenceError: there is no developed flow that could be found.
    """
    domain, bed, two = geometry.domain, geometry.bed, geometry.top == "wall"
    plane = geometry.grain is None and (bed is None or not np.isfinite(bed.feature))
    ground = domain.bottom if bed is None else height_at_inflow(geometry, base_flow.datum)
    number = 2 if two else 1
    depth, mean, viscosity = (domain.ceiling - ground) / number, base_flow.reference, base_flow.viscosity
    given = (asked.intensity, asked.length) if asked.inflow == "given" else None
    developed = None if given else of_discharge(mean * depth / viscosity)
    shear_velocity = _on_plate(mean, viscosity, domain) if developed is None else mean / developed.mean
    body = () if geometry.grain is None else ("body",)
    return ResolvedWalls(
        depth=depth,
        number=number,
        floor=ground,
        shear_velocity=shear_velocity,
        mean=mean,
        viscosity=viscosity,
        plane=plane,
        names=(names.bottom, *((names.top,) if two else ()), *body),
        given=given,
        up=geometry.up,
        developed=developed,
    )


def _on_plate(mean: float, viscosity: float, domain: Domain) -> float:
    """u* next to the inflow of a uniform stream, as on a plate that begins there."""
    reynolds = EARLY * mean * domain.length / viscosity
    return mean * math.sqrt(0.5 * OF_PLATE * max(reynolds, 1.0) ** -EXPONENT_OF_PLATE)


def channel_rows(
    walls: ResolvedWalls, geometry: Geometry, names: SideNames, order: int, mesh_size: float
) -> Grid:
    """The mesh between plane walls: rows that grow with the distance from them. Not collective."""
    domain, coarse = geometry.domain, mesh_size * (1.0 if order == 2 else ORDER_THREE)
    sizes = RowSizes(
        min(FIRST_ROW * walls.unit, LARGEST_ROW * walls.depth), GROWTH, LARGEST_ROW * walls.depth
    )
    ends = growing_rows(sizes, domain.height, walls.number, coarse)
    columns = max(FEWEST_COLUMNS, round(domain.length / (COLUMN * walls.depth * coarse)))
    corner = (domain.left, domain.bottom)
    rows = tuple(map(float, ends))
    return Grid(corner, domain.length, domain.height, columns, len(rows), 1.0, names.around, rows)


ORDER_THREE = 1.3  # size of cells of order three over those of order two


def cells_at_walls(walls: ResolvedWalls, order: int) -> tuple[Near, ...]:
    """Cells at walls of which some are no planes. Not collective."""
    size = FIRST_CELL * walls.unit * (1.0 if order == 2 else ORDER_THREE)
    return tuple(
        Near(size * (AT_GRAIN if name == "body" else 1.0), CELL_GROWTH, boundary=name) for name in walls.names
    )
