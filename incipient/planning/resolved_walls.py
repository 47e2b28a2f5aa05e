"""Resolved walls of a mean flow: their mesh, and the inflow between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..arrays import Floats, Point
from ..forms.k_omega_sst import EXPONENT, at_smooth_wall
from ..meshes import LAYERS_SHARE, Away, Grid, Near, WallLayers, graded_ends
from ..scene import Domain
from .base_flow import BaseFlow
from .cells import FEWEST_ROWS, RowSizes, growing_rows, layer_ends
from .developed_channel import DevelopedChannel, length_at_sand, of_discharge
from .scene_geometry import Geometry
from .sides import SideNames
from .wall_layer import height_at_inflow

# Wall units: rows next to plane walls, and cells at others, for mesh_size = 1.
FIRST_ROW, FIRST_CELL = 0.6, 1.0
ON_SAND = 0.25  # of the length over which omega falls at rough walls: rows and cells there
THICKEST = 2.5  # wall units, up to which only molecules matter in the cells at smooth walls
GROWTH, LARGEST_ROW = 0.3, 0.08  # of cells with the distance from walls; of the depth
CELL_GROWTH = 0.3  # of cells that are not stretched
ALONG = 0.1  # of the depth: size of cells along walls, where nothing else asks for smaller ones
# Likewise along smooth beds, of the length over which they would rise by their relief at their steepest slope: on a
# bump 1.5 depths long friction behind the crest is then 12% off instead of 40% (`test_resolved_along_walls.py`).
ALONG_RISE, RISE_SAMPLES = 0.1, 4001
NEAR_GRAIN, AWAY_GROWTH = (
    0.1,
    0.05,
)  # of a grain's size: those next to it; and how they grow along walls away from it
GROWTH_OF_LAYERS, MOST_LAYERS = 1.35, 80
AT_GRAIN = 0.5  # of cells at a grain over those: u* on its crest is twice that of the bed
COLUMN, FEWEST_COLUMNS = 0.5, 8  # of a channel's mesh, over the depth
ACROSS = 2  # layers of such a 3-D mesh, at the least
LAYER_GROWTH = (
    2.0  # of layers along 3-D walls, by which as many are made as lead to the cells beyond
)
COARSENING, ORDER_THREE = {2: 1.0}, 1.3  # of cells of order two, and of higher ones over those
SLOWEST = 1e-3  # of the height of the first volume, below which the inflow does not change


class Entering(Protocol):
    """Prescribed inflow profile by heights (n,) above the lower wall. No method is collective."""

    def speed(self, above: Floats) -> Floats:
        """Speeds (n,)."""

    def logarithms(self, above: Floats) -> Floats:
        """ln k and ln omega (2, n)."""


@dataclass(frozen=True)
class ResolvedWalls:
    """The walls of a flow that its mesh resolves.

    depth:          over which a wall is felt: that of an open channel, half of that between two walls
    number:         of walls above each other at the inflow, one or two
    floor:          height of the lower one there
    shear_velocity: u* of the inflow, of two walls the larger
    bed_shear_velocity: at the lower wall, of a uniform flow that enters the one to which it develops; None: likewise
    mean:           reference velocity; viscosity: kinematic
    plane:          whether all walls are planes: no bed forms, no grain
    names:          of the boundaries that are walls
    up:             axis of heights; developed: the flow that enters
    roughness:      equivalent sand roughness of all walls but a grain, which is smooth; 0: all are
    upstream:       equivalent sand roughness of the bed over which the inflow past smooth walls developed, 0: smooth
    measured:       inflow instead of developed flow; None: developed flow
    smooth:         whether the bed has forms without corners, and there is no grain
    rise:           length over which such a bed would rise by its relief at its steepest slope
    """

    depth: float
    number: int
    floor: float
    shear_velocity: float
    mean: float
    viscosity: float
    plane: bool
    names: tuple[str, ...]
    up: int
    developed: DevelopedChannel
    roughness: float = 0.0
    upstream: float = 0.0
    measured: Entering | None = None
    smooth: bool = False
    rise: float = math.inf
    bed_shear_velocity: float | None = None

    @property
    def is_laminar(self) -> bool:
        """Whether the inflow is laminar by the model."""
        return self.developed.is_laminar

    @property
    def bed_stress(self) -> float:
        """Shear stress of the inflow on the lower wall, fluid density one."""
        return (self.bed_shear_velocity or self.shear_velocity) ** 2

    @property
    def layer_over_forms(self) -> bool:
        """Whether a measured boundary layer, in a flow with hardly any k, passes smooth bedforms."""
        return self.measured is not None and self.smooth

    @property
    def rough(self) -> tuple[str, ...]:
        """Names of the rough walls: all but the grain."""
        return tuple(name for name in self.names if name != "body") if self.roughness else ()

    @property
    def sand(self) -> float:
        """u* k_s/nu of the inflow."""
        return self.roughness / self.unit

    @property
    def first(self) -> float:
        """Thickness [length] of the cells at plane walls for mesh_size = 1."""
        if not self.roughness:
            return FIRST_ROW * self.unit
        return ON_SAND * length_at_sand(self.sand) * self.roughness

    def thickest(self, name: str) -> float:
        """Thickness of cells at a wall [nu/u*] up to which it is resolved."""
        return THICKEST if name not in self.rough else THICKEST / FIRST_ROW * self.first / self.unit

    @property
    def unit(self) -> float:
        """nu/u* [length]."""
        return self.viscosity / self.shear_velocity

    def text(self) -> str:
        """How walls are treated, in words."""
        first = (self.first if self.plane or self.roughness else self._first_free) / self.unit
        kind = f"rough walls (u* k_s/nu about {self.sand:.3g})" if self.roughness else "walls"
        if self.roughness and "body" in self.names:
            kind += " and a smooth grain"
        told = (
            f"{kind} resolved, first cells {first:.3g} nu/u* thick with mesh_size = 1, "
            f"u* about {self.shear_velocity:.3g}"
        )
        if not self.upstream:
            return told
        return (
            f"{told}, that upstream, where the bed is rough (u* k_s/nu about "
            f"{self.upstream * math.sqrt(self.bed_stress) / self.viscosity:.3g})"
        )

    @property
    def along(self) -> float:
        """Size of cells along walls, where nothing else asks for smaller ones [length]."""
        return ALONG * self.depth

    @property
    def largest_row(self) -> float:
        """Size of the largest cells that are fine enough next to the layers at a wall [length]."""
        return LARGEST_ROW * self.depth

    def from_next(self, x: Floats) -> Floats:
        """Distances (n,) of places (3, n) of the inflow from the next wall, at least zero."""
        above = np.maximum(x[self.up] - self.floor, 0.0)
        return (
            np.minimum(above, np.maximum(2.0 * self.depth - above, 0.0))
            if self.number == 2
            else above
        )

    @cached_property
    def _speed(self) -> Any:
        scale = self.mean / self.developed.mean
        return PchipInterpolator(self.developed.heights, scale * self.developed.speed)

    def velocity(self, x: Floats, t: float) -> Floats:
        """The velocity (gdim, n) that enters at places (3, n). Not collective."""
        if self.measured is None:
            return self.velocity_at(self.from_next(x))
        return self._along(self.measured.speed(np.maximum(x[self.up] - self.floor, 0.0)))

    def _along(self, speed: Floats) -> Floats:
        return np.vstack([speed, *np.zeros((self.up, len(speed)))])

    def velocity_at(self, away: Floats) -> Floats:
        """The velocity (gdim, n) that enters at distances (n,) from the next wall. Not collective."""
        if self.measured is not None:
            return self._along(self.measured.speed(np.minimum(away, self.depth)))
        return self._along(self._speed(np.minimum(away / self.depth, 1.0)))

    def logarithms(self, x: Floats) -> Floats:
        """ln k and ln omega (2, n) at places (3, n) of the inflow. Not collective."""
        if self.measured is None:
            return self.logarithms_at(self.from_next(x))
        return self.measured.logarithms(np.maximum(x[self.up] - self.floor, 0.0))

    def logarithms_at(self, away: Floats) -> Floats:
        """ln k and ln omega (2, n) of the inflow at distances (n,) from the next wall. Not collective."""
        if self.measured is not None:
            return self.measured.logarithms(np.minimum(away, self.depth))
        found, first = self.developed, self.developed.heights[1]
        heights, unit = away / self.depth, self.shear_velocity
        units = np.log([[unit**2], [unit / self.depth]])
        log_k, log_omega = found.logarithms(heights) + units
        if not found.sand:
            heights = np.maximum(heights, SLOWEST * first)
            below = heights < first
            log_k[below] += EXPONENT * np.log(heights[below] / first)
            log_omega[below] = at_smooth_wall(self.viscosity, self.depth * heights[below], np)
        return np.array([log_k, log_omega])

    def coarsest(self, domain: Domain, order: int) -> float:
        """The largest numerics.mesh_size by which rows become fewer, and columns where the flow develops along them.

        No bound but between planes.
        """
        if not self.plane:
            return math.inf
        _, rows = self._row_sizes.counted(domain.height / self.number)
        columns = (
            domain.length / (COLUMN * self.depth * FEWEST_COLUMNS) if self.measured else math.inf
        )
        return min(rows / (FEWEST_ROWS // self.number), columns) / COARSENING.get(
            order, ORDER_THREE
        )

    @property
    def _row_sizes(self) -> RowSizes:
        """Rows between planes, for cells of size one."""
        return RowSizes(min(self.first, self.largest_row), GROWTH, self.largest_row)

    def channel_rows(
        self, geometry: Geometry, names: SideNames, order: int, mesh_size: float
    ) -> Grid:
        """The mesh between plane walls: rows that grow with the distance from them. Not collective."""
        domain = geometry.domain
        coarse, sizes = mesh_size * COARSENING.get(order, ORDER_THREE), self._row_sizes
        rows = tuple(map(float, growing_rows(sizes, domain.height, self.number, coarse)))
        columns = max(FEWEST_COLUMNS, round(domain.length / (COLUMN * self.depth * coarse)))
        along, upright = (domain.left, domain.right), (domain.bottom, domain.ceiling)
        if geometry.gdim == 2:
            return Grid((along, upright), (graded_ends(columns, 1.0), rows), names.of_rectangle)
        low, high = geometry.half
        across = max(ACROSS, round((high - low) / (2.0 * COLUMN * self.depth * coarse)))
        half = geometry.symmetric
        ends = graded_ends(columns, 1.0), layer_ends(across, 1.0, half), rows
        shape = along, (low, high), upright
        return Grid(shape, ends, names.of_box(half), half, parallel=True)

    def cells(self, grain: float = math.inf, centre: Point = (0.0, 0.0)) -> tuple[Near, ...]:
        """Cells along 2-D walls of which some are no planes, with a grain of a size. Not collective."""
        largest = self.along
        size = min(largest, NEAR_GRAIN * grain, ALONG_RISE * self.rise)
        far = Away(centre, AWAY_GROWTH, largest) if size < largest else None
        return tuple(
            Near(size, CELL_GROWTH, boundary=name, away=None if name == "body" else far)
            for name in self.names
        )

    def thin_layers(self, order: int) -> WallLayers:
        """Layers at 2-D walls of which some are no planes. Not collective."""
        return WallLayers(self._first_cells(order), MOST_LAYERS, GROWTH_OF_LAYERS, graded=True)

    def layers(self, order: int, along: float) -> WallLayers:
        """Layers at 3-D walls of which some are no planes, with cells of a size along them. Not collective."""
        first = self._first_cells(order)
        most = LAYERS_SHARE * along / min(first.values())
        number = math.ceil(math.log(1.0 + (LAYER_GROWTH - 1.0) * most) / math.log(LAYER_GROWTH))
        return WallLayers(first, max(number, 1), LAYER_GROWTH)

    @property
    def _first_free(self) -> float:
        """Thickness [length] of the cells at smooth walls that are not all planes for mesh_size = 1."""
        return FIRST_CELL * self.unit

    def _first_cells(self, order: int) -> dict[str, float]:
        """How thick cells at each wall are."""
        coarse = COARSENING.get(order, ORDER_THREE)
        found = {
            name: coarse * (self.first if name in self.rough else self._first_free)
            for name in self.names
        }
        if "body" in found:
            found["body"] *= AT_GRAIN
        return found


def resolved_walls_of(
    geometry: Geometry,
    base_flow: BaseFlow,
    names: SideNames,
    roughness: float = 0.0,
    upstream: float = 0.0,
) -> ResolvedWalls:
    """The walls of a flow, of an equivalent sand roughness, and its inflow.

    upstream: equivalent sand roughness of the bed over which the inflow past smooth walls developed

    Raises:
        ConvergenceError: no developed flow converged.
    """
    domain, bed, two = geometry.domain, geometry.bed, geometry.top == "wall"
    plane = geometry.grain is None and (bed is None or not np.isfinite(bed.feature))
    ground = domain.bottom if bed is None else height_at_inflow(geometry, base_flow.datum)
    number = 2 if two else 1
    depth, mean, viscosity = (
        (domain.ceiling - ground) / number,
        base_flow.reference,
        base_flow.viscosity,
    )
    developed = of_discharge(mean * depth / viscosity, (upstream or roughness) / depth)
    body = () if geometry.grain is None else ("body",)
    smooth = geometry.gdim == 2 and not plane and geometry.grain is None
    smooth = smooth and not len(bed.corners(domain.left, domain.right))
    return ResolvedWalls(
        depth=depth,
        number=number,
        floor=ground,
        shear_velocity=mean / developed.mean,
        mean=mean,
        viscosity=viscosity,
        plane=plane,
        names=(
            names.bottom,
            *((names.top,) if two else ()),
            *body,
        ),
        up=geometry.up,
        developed=developed,
        roughness=roughness,
        upstream=upstream,
        smooth=smooth,
        rise=_rise(bed, domain) if smooth else math.inf,
    )


def _rise(bed: Any, domain: Domain) -> float:
    """The length over which a smooth 2-D bed would rise by its relief at its steepest slope."""
    x = np.linspace(domain.left, domain.right, RISE_SAMPLES)
    heights = bed.height(x)
    steepest = float(np.abs(np.gradient(heights, x)).max())
    return float(np.ptp(heights)) / steepest if steepest > 0.0 else math.inf
