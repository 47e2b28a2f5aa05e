"""The turbulence of a scene: the law of the wall, where the mesh ends, and conditions on the walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Point
from ..meshes.solid_region import SYMMETRY
from ..scene import Scene
from ..scene.turbulence import LAMINAR, Turbulence
from .cells import layer_ends, side_names, sides_across
from .meshed_bed import resolved_bed
from .wall_law import LARGEST_SHARE, LEAST, SAMPLES, WallLaw

if TYPE_CHECKING:
    from ..geometry.placement import Placement
    from ..geometry.plane.curves import Curve
    from ..meshes import Grid, Near, SolidGrid

FORMS = ("sinusoidal", "half-discs", "ridges", "spheres")  # beds made of forms of one size
FINEST_FORM = 0.5  # of the law's distance: half a form at the least
SAMPLES_OF_DUCT = 300  # on each side of a section
# Of a channel's mesh: rows over the depth of a wall; column over that depth; finest over largest row.
ROWS, COLUMN, GRADING = 14, 1.0, 0.3
FEWEST_ROWS, FEWEST_COLUMNS = 6, 4  # whatever the cells' size
# First of these rows over their mean; where the law's distance is less than 1/FINE_ROW of it, the first row is FINE_ROW
# distances thick, and rows grow by ROW_GROWTH of the distance from it: velocity and epsilon change as fast as that.
FIRST_ROW, FINE_ROW, ROW_GROWTH = 0.5, 4.0 / 3.0, 0.4
FIRST_OF_GRADED = 2.0 * GRADING / (1.0 + GRADING)  # first over mean row of those that are graded as usual
# Of other meshes: cells at walls, over the distance of the law; growth away from them; cells at corners that stick out,
# over those: a shear layer begins as thick as a cell there, which is most of the error of where it reattaches.
WALL_CELL, WALL_GROWTH, CORNER_CELL = 4.0, 0.25, 0.05
SMALLEST_GRAIN = 300.0  # u* d/nu of grains below which the law of the wall is not for them
THICK = 0.05  # of a grain, from which on the layer of the law is told: 50 nu/u* of one of u* d/nu = 1000
THICKEST = 0.5  # of a grain: a layer on both its sides as thick as itself
FEWEST_ACROSS = 6.0  # cells, of a grain in space, below which its loads are told to be uncertain
BISECTIONS = 40
AWAY_GROWTH = 0.05  # of cells along a bed, with the distance from a grain
# Behind such a corner: how far its shear layer reaches, and the cells in it, over the height by which the bed falls;
# their growth away from it; points along it; sine of the turn from which on a corner is one.
LEE, LEE_CELL, LEE_GROWTH, LEE_POINTS, OUTWARD = 6.0, 0.09, 0.15, 25, -0.17
LAYERS = 2  # of cells across a channel in space, at the least


@dataclass(frozen=True)
class Walls:
    """The walls of a scene with turbulence, as estimated before it is computed.

    depth:          over which a wall is felt: that of an open channel, half of that between two walls
    distance:       of the mesh's boundary from the wall
    shear_velocity: estimated
    number:         of walls, one or two
    floor, top:     heights at the inflow of the wall below, and of what is above
    beside:         how many of these the mesh stands off from; the others are where the mesh ends, `distance` being one
                    of the law's alone
    sides:          y of side walls with friction; none in the plane
    """

    law: WallLaw
    depth: float
    distance: float
    shear_velocity: float
    number: int
    floor: float
    top: float
    beside: int
    sides: tuple[float, ...] = ()

    @property
    def reach(self) -> float:
        """Over which the next wall is felt: the depth, in a duct that is narrower half its width."""
        return min(self.depth, 0.5 * (self.sides[-1] - self.sides[0])) if self.sides else self.depth

    @property
    def ceiling(self) -> float:
        """Height of the upper side of the mesh."""
        return self.top - (self.number - 1) * self.distance

    def from_next(self, height: np.ndarray, across: np.ndarray | None = None) -> np.ndarray:
        """Distances (n,) of heights, and of y between side walls, from the next wall, at least that of the law."""
        away = [height - self.floor]
        if self.number == 2:
            away.append(self.top - height)
        if across is not None:
            away.extend(np.abs(across - side) for side in self.sides)
        return np.maximum(np.min(away, axis=0), self.distance)

    def text(self, viscosity: float) -> str:
        """What the walls are taken for, in words."""
        y = self.distance * self.shear_velocity / viscosity
        beyond = "" if self.beside == self.number else ", beyond a bed at which the mesh itself ends"
        return (
            f"law of the wall from {self.distance:.3g}{beyond}, y+ about {y:.3g}, "
            f"u* about {self.shear_velocity:.3g}"
        )


def section(scene: Scene) -> Turbulence:
    """The section [turbulence] of a scene that has turbulence, or what it is by default. Not collective."""
    return scene.turbulence or Turbulence()


def is_plane(scene: Scene) -> bool:
    """Whether all walls are planes, from which the mesh stands off: no bed forms, no grain. Not collective."""
    return scene.body is None and (scene.bed_shape is None or not np.isfinite(scene.bed_shape.feature))


def walls_of(scene: Scene) -> Walls:
    """Where walls are and how far from them the mesh ends. Not collective.

    u* is that of the logarithmic law, whose mean over the depth h is u+(h) - 1/kappa; of a duct h is the area of its
    section over the length of its walls in it (Keulegan 1938, J. Res. Natl. Bur. Stand. 21, 707). Beds that are not
    flat and grains bound the mesh themselves.
    """
    asked, number = section(scene), 1 if scene.flow.kind == "open-channel" else 2
    plane, bed, top = is_plane(scene), scene.bed_shape, scene.domain.ceiling
    ground = scene.domain.bottom if bed is None else height_at_inflow(scene)
    law, depth, viscosity = WallLaw(asked.roughness), (top - ground) / number, scene.viscosity
    sides = scene.domain.across if scene.gdim == 3 and scene.sides == "wall" else ()
    width = sides[1] - sides[0] if sides else math.inf
    hydraulic = depth / (1.0 + 2.0 * depth / width)
    shear_velocity = scene.reference_velocity / 20.0
    for _ in range(50):
        mean = float(law.velocity(shear_velocity, viscosity, hydraulic)) - 1.0 / law.kappa
        shear_velocity = scene.reference_velocity / max(mean, LEAST)
    distance = asked.wall_distance or law.suitable(shear_velocity, viscosity)
    floor, beyond = (ground, 0.0) if plane else (ground - distance, distance)
    sides = (sides[0] - beyond, sides[1] + beyond) if sides else ()
    return Walls(law, depth, distance, shear_velocity, number, floor, top, number - (not plane), sides)


def height_at_inflow(scene: Scene) -> float:
    """Height of the bed where the stream enters; in space the mean, or that of the level ground. Not collective."""
    bed, domain = scene.bed_shape, scene.domain
    if scene.gdim == 2:
        return float(bed.height([domain.left])[0])
    resolved = resolved_bed(scene, scene.placement)
    if resolved is not None and resolved.level is not None:
        return resolved.level
    y = np.linspace(*domain.across, SAMPLES)
    return float(np.mean(bed.height(np.column_stack([np.full_like(y, domain.left), y]))))


def too_near(scene: Scene) -> str:
    """Why the law of the wall is not for a scene, or an empty string. Not collective."""
    walls = walls_of(scene)
    if walls.distance <= LARGEST_SHARE * walls.reach:
        return ""
    share = walls.distance / walls.reach
    of = "depth" if walls.reach == walls.depth else "half width"
    remedy = "use a larger fluid.reynolds, a smaller wall_distance or no turbulence"
    if walls.distance == walls.law.roughness:
        remedy = "use a smaller roughness, from which the law begins at rough walls, or no turbulence"
    return (
        f"the law of the wall would have to reach {percent(share)} of the {of}, at most {percent(LARGEST_SHARE)}; "
        f"{remedy}"
    )


def within_sand(scene: Scene) -> str:
    """Why the law of the wall is not for walls as rough as a scene's, or an empty string. Not collective."""
    walls = walls_of(scene)
    if float(walls.law.velocity(walls.shear_velocity, scene.viscosity, walls.distance)) > LEAST:
        return ""
    return (
        f"roughness: is {walls.law.roughness:g}, and the law of the wall begins within the sand, {walls.distance:.3g} "
        "from the wall; set wall_distance to the roughness or more, or use a smaller roughness"
    )


def within_forms(scene: Scene) -> str:
    """Why the law of the wall is not for a bed as fine as a scene's, or an empty string. Not collective."""
    bed, distance = scene.bed, walls_of(scene).distance
    fine = bed is not None and bed.kind in FORMS and scene.bed_shape.feature < FINEST_FORM * distance
    if not fine:
        return ""
    return (
        f"has forms as fine as {2.0 * scene.bed_shape.feature:.3g}, the law of the wall begins {distance:.3g} "
        'from them: it stands for more than one of them; give a flat bed and turbulence.wall = "rough" with their '
        "height as roughness"
    )


def beyond_walls(scene: Scene) -> str:
    """Why a measured profile is not for a scene's walls, or an empty string. Not collective."""
    rows, walls = section(scene).profile, walls_of(scene)
    if walls.number == 1 or not rows or rows[-1][0] < walls.number * walls.depth:
        return ""
    return (
        f"profile: has a row at {rows[-1][0]:g}, the wall on top is {walls.number * walls.depth:.4g} above that below; "
        "leave out rows beyond it"
    )


def grain_number(scene: Scene) -> float:
    """u* d/nu of the scene's grain, d its largest diameter and u* estimated. Not collective."""
    return float(scene.grain.size * walls_of(scene).shear_velocity / scene.viscosity)


def too_small(scene: Scene) -> str:
    """Why the law of the wall is not for a scene's grain, or an empty string. Not collective."""
    if scene.body is None:
        return ""
    share = walls_of(scene).distance / scene.grain.size
    if share > THICKEST:
        return (
            f"the layer that the law of the wall stands for is {percent(share)} of the grain, at most "
            f"{percent(THICKEST)}; use a smaller roughness or wall_distance, or a larger fluid.reynolds"
        )
    if grain_number(scene) >= SMALLEST_GRAIN:
        return ""
    return (
        f"the grain has u* d/nu = {grain_number(scene):.3g}, for the law of the wall it must be {SMALLEST_GRAIN:g} at "
        f"least; {LAMINAR}"
    )


def small(scene: Scene) -> str:
    """What is to be known of the law of the wall on a scene's grain, or an empty string. Not collective."""
    if scene.body is None:
        return ""
    share = walls_of(scene).distance / scene.grain.size
    if share <= THICK:
        return ""
    return (
        f"the grain has u* d/nu = {grain_number(scene):.3g}: the layer that the law of the wall stands for is "
        f"{percent(share)} of it; it is thin up to {percent(THICK)}"
    )


def coarse_at_grain(scene: Scene) -> str:
    """What is to be known of how few cells a scene's grain has in space, or an empty string. Not collective."""
    if scene.body is None or scene.gdim == 2:
        return ""
    size = WALL_CELL * _coarsening(scene.order) * walls_of(scene).distance * scene.numerics.mesh_size
    across = scene.grain.size / size
    if across >= FEWEST_ACROSS:
        return ""
    return (
        f"the grain is {across:.2g} cells across: with 3 of them drag was a fifth too large and a safety factor a "
        f"quarter off; use numerics.mesh_size = {scene.numerics.mesh_size * across / FEWEST_ACROSS:.2g} or less"
    )


def smooth_grain(scene: Scene) -> str:
    """How far the model is from measured loads on grains, or an empty string. Not collective."""
    if scene.body is None:
        return ""
    return (
        "the k-epsilon model is far from measured loads on smooth round bodies, by more than error bars tell: drag on "
        "a sphere on a bed a third too small, on a hump a quarter to two fifths of it, lift there a quarter to a third "
        "too large; another program with this model has 1.1 to 1.6 times the drag and 0.5 to 0.9 of the lift"
    )


def cornered(scene: Scene) -> str:
    """What is to be known of the model in a scene's ducts, or an empty string. Not collective."""
    if not walls_of(scene).sides:
        return ""
    return (
        "the k-epsilon model makes no secondary flow, which in a real duct brings fast fluid into the corners: "
        "friction there is larger than computed"
    )


def faster(scene: Scene, factor: float) -> Scene:
    """The scene with its flow faster by a factor at the same viscosity, in units of that flow. Not collective."""
    plain = scene.model_dump()
    plain["fluid"]["reynolds"] *= factor
    return Scene(**{**plain, "units": None})


def slowest(scene: Scene) -> float:
    """The factor of the slowest flow in which the law of the wall is for grain and depth. Not collective."""
    low, high = 1e-6, 1.0
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        trial = faster(scene, middle)
        low, high = (low, middle) if not (too_near(trial) or too_small(trial)) else (middle, high)
    return high


def percent(share: float) -> str:
    """0.25 as 25%."""
    return f"{100 * share:.0f}%"


def grid(scene: Scene, order: int, mesh_size: float) -> Grid | SolidGrid:
    """The mesh between the walls, less what the law of the wall covers; in space it is extruded. Not collective."""
    from ..meshes import Grid, SolidGrid

    walls, domain = walls_of(scene), scene.domain
    coarse = mesh_size * _coarsening(order)
    columns = max(FEWEST_COLUMNS, round(domain.length / (COLUMN * walls.depth * coarse)))
    height = domain.height - walls.number * walls.distance
    corner = (domain.left, domain.bottom + walls.distance)
    ends = _row_ends(walls, coarse, height)
    rows = len(ends) or max(FEWEST_ROWS, round(ROWS * walls.number / coarse))
    found = Grid(corner, domain.length, height, columns, rows, GRADING, side_names(scene), ends)
    if scene.gdim == 2:
        return found
    low, high = (domain.middle, domain.across[1]) if scene.symmetric else domain.across
    layers = max(LAYERS, round((high - low) / (COLUMN * walls.depth * coarse)))
    if walls.sides:
        rubbing = 1 if scene.symmetric else 2
        high, low = high - walls.distance, low + (rubbing - 1) * walls.distance
        layers = max(layers, round(ROWS * rubbing / coarse))
    names = SYMMETRY if scene.symmetric else "right", "left"
    return SolidGrid(
        found, (low, high), layer_ends(layers, GRADING if walls.sides else 1.0, scene.symmetric), names
    )


def _row_ends(walls: Walls, coarse: float, height: float) -> tuple[float, ...]:
    """Where rows end that are as fine at walls as the law's distance asks for; none: rows graded as usual do."""
    largest, first = walls.depth / ROWS, FINE_ROW * walls.distance
    if first >= FIRST_ROW * largest:
        return ()
    part = height / walls.number
    bend = min((largest - first) / ROW_GROWTH, part)  # where rows are largest
    to_bend = math.log1p(ROW_GROWTH * bend / first) / ROW_GROWTH
    whole = to_bend + (part - bend) / largest  # rows of one wall, with cells of size one
    number = max(math.ceil(whole / coarse), FEWEST_ROWS // walls.number)
    counted = whole * np.arange(1, number + 1) / number
    near = first * np.expm1(ROW_GROWTH * np.minimum(counted, to_bend)) / ROW_GROWTH
    ends = (near + largest * np.maximum(counted - to_bend, 0.0)) / part
    ends[-1] = 1.0
    if walls.number == 2:
        ends = 0.5 * np.concatenate([ends, 2.0 - ends[-2::-1], [2.0]])
    # Of few rows those that are graded as usual may have the thinner one at the wall.
    return tuple(map(float, ends)) if ends[0] < FIRST_OF_GRADED / len(ends) else ()


def _coarsening(order: int) -> float:
    """Of cells at walls with elements of an order, relative to those of order three."""
    return 1.0 if order > 2 else 0.75


def coarsest(scene: Scene) -> float:
    """The largest numerics.mesh_size by which all cells become larger; no bound but between planes."""
    if not is_plane(scene):
        return math.inf
    walls = walls_of(scene)
    rows, columns = (
        ROWS * walls.number / FEWEST_ROWS,
        scene.domain.length / (COLUMN * walls.depth * FEWEST_COLUMNS),
    )
    return min(rows, columns) / _coarsening(scene.order)


def cells(scene: Scene, order: int, placement: Placement | None = None) -> tuple[Near, ...]:
    """Cells along walls of which some are no planes, and at their corners, with a grain placed. Not collective."""
    from ..meshes import Away, Near
    from .layout import point

    walls, away = walls_of(scene), None
    size = WALL_CELL * _coarsening(order) * walls.distance
    if placement is not None:
        # Away from a grain the flow next to the bed is that of a channel, for which its rows do.
        away = Away(point(placement.centre), AWAY_GROWTH, max(size, walls.depth / ROWS))
    found = [
        Near(size, WALL_GROWTH, boundary=name, away=None if name == "body" else away)
        for name in wall_names(scene)
    ]
    if scene.bed_shape is not None and scene.gdim == 2:
        bed = scene.bed_shape.curves(scene.domain.left, scene.domain.right)
        if separating := tuple(_separating(bed)):
            points = tuple(corner for corner, _ in separating)
            found.append(Near(CORNER_CELL * size, WALL_GROWTH, points=points))
        found.extend(_lee(corner, drop) for corner, drop in separating if drop > size)
    return tuple(found)


def _separating(bed: tuple[Curve, ...]) -> Iterator[tuple[Point, float]]:
    """Corners that stick out into the stream, which separates there, and how far the bed falls behind each."""
    for before, after in pairwise(range(len(bed))):
        ahead, behind = bed[before].tangent([1.0])[0], bed[after].tangent([0.0])[0]
        if ahead[0] * behind[1] - ahead[1] * behind[0] < OUTWARD:
            falling = takewhile(lambda curve: curve.end[1] <= curve.start[1], bed[after:])
            lowest = min([curve.end[1] for curve in falling], default=bed[after].start[1])
            yield bed[after].start, bed[after].start[1] - lowest


def _lee(corner: Point, drop: float) -> Near:
    """Cells in the shear layer that leaves a corner."""
    from ..meshes import Near

    shares = np.linspace(0.0, 1.0, LEE_POINTS).tolist()
    points = tuple((corner[0] + LEE * drop * s, corner[1] - drop * s) for s in shares)
    return Near(LEE_CELL * drop, LEE_GROWTH, points=points)


def wall_names(scene: Scene) -> tuple[str, ...]:
    """Names of the boundaries that have a wall beyond them."""
    bottom, _, top, _ = side_names(scene)
    upper = () if scene.flow.kind == "open-channel" else (top,)
    sides = sides_across(scene) if scene.gdim == 3 and scene.sides == "wall" else ()
    return (bottom, *upper, *sides, *(() if scene.body is None else ("body",)))
