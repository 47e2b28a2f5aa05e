"""The wall-function layer of a flow: where walls are, and how far from them the mesh ends."""

from dataclasses import dataclass

import numpy as np

from .base_flow import BaseFlow
from .measured_profile import Rows
from .meshed_bed import resolved_bed
from .scene_geometry import Geometry
from .sides import SideNames
from .wall_law import LEAST, SAMPLES, WallLaw


@dataclass(frozen=True)
class LayeredWalls:
    """The walls that a flow feels by a law of the wall, as estimated before it is computed."""

    law: WallLaw
    depth: (
        float  # over which a wall is felt: that of an open channel, half of that between two walls
    )
    distance: float  # of the mesh's boundary from the wall
    shear_velocity: float  # estimated, of two walls the larger one
    bed_shear_velocity: float  # at the lower wall
    number: int  # of walls, one or two
    # floor, top: heights at the inflow of the wall below, and of what is above
    floor: float
    top: float
    # How many of these the mesh stands off from; the others are where the mesh ends, `distance` being one of the law's
    # alone
    beside: int
    mean: float  # reference velocity of the flow
    viscosity: float  # kinematic
    plane: (
        bool  # whether all walls are planes, from which the mesh stands off: no bed forms, no grain
    )
    names: tuple[str, ...]  # of the boundaries that have a wall beyond them

    @property
    def ceiling(self) -> float:
        """Height of the upper side of the mesh."""
        return self.top - (self.number - 1) * self.distance

    def from_next(self, height: np.ndarray) -> np.ndarray:
        """Distances (n,) of heights from the next wall, at least that of the law."""
        away = [height - self.floor]
        if self.number == 2:
            away.append(self.top - height)
        return np.maximum(np.min(away, axis=0), self.distance)

    def text(self) -> str:
        """What the walls are taken for, in words."""
        y = self.distance * self.shear_velocity / self.viscosity
        beyond = (
            "" if self.beside == self.number else ", beyond a bed at which the mesh itself ends"
        )
        return (
            f"law of the wall from {self.distance:.3g}{beyond}, y+ about {y:.3g}, "
            f"u* about {self.shear_velocity:.3g}"
        )


def walls_of(
    law: WallLaw,
    distance: float | None,
    geometry: Geometry,
    base_flow: BaseFlow,
    names: SideNames,
    rows: Rows = (),
) -> LayeredWalls:
    """Walls, and the distance at which the mesh ends; None: where the law suits. Not collective.

    u* is that of the logarithmic law, whose mean over the depth h is u+(h) - 1/kappa (Keulegan 1938, J. Res. Natl. Bur.
    Stand. 21, 707). Where measured rows of height and speed enter, u* gives the row next to a wall its speed; of two
    walls it is the larger. Beds that
    are not flat and grains bound the mesh themselves.
    """
    domain, bed, open_above = geometry.domain, geometry.bed, base_flow.flow.kind == "open-channel"
    plane = geometry.grain is None and (bed is None or not np.isfinite(bed.feature))
    number, top = 1 if open_above else 2, domain.ceiling
    ground = domain.bottom if bed is None else height_at_inflow(geometry, base_flow.datum)
    depth, viscosity = (top - ground) / number, base_flow.viscosity
    shear_velocity = base_flow.reference / 20.0
    for _ in range(50):
        mean = float(law.velocity(shear_velocity, viscosity, depth)) - 1.0 / law.kappa
        shear_velocity = base_flow.reference / max(mean, LEAST)
    of_walls = np.array([shear_velocity])
    if rows:
        nearest = [rows[0][:2], (number * depth - rows[-1][0], rows[-1][1])][:number]
        away, speed = np.array(nearest).T
        if (away > 0.0).all():  # rows beyond a wall are refused
            of_walls = law.shear_velocity(speed * base_flow.reference, viscosity, away)
    shear_velocity = float(of_walls.max())
    distance = distance or law.suitable(shear_velocity, viscosity)
    floor = ground if plane else ground - distance
    return LayeredWalls(
        law=law,
        depth=depth,
        distance=distance,
        shear_velocity=shear_velocity,
        bed_shear_velocity=float(of_walls[0]),
        number=number,
        floor=floor,
        top=top,
        beside=number - (not plane),
        mean=base_flow.reference,
        viscosity=viscosity,
        plane=plane,
        names=(
            names.bottom,
            *(() if open_above else (names.top,)),
            *(() if geometry.grain is None else ("body",)),
        ),
    )


def height_at_inflow(geometry: Geometry, datum: float) -> float:
    """Height of the bed where the flow enters. Not collective.

    In 3-D it is the mean, or that of the planar bed that takes its place there.
    """
    bed, domain = geometry.bed, geometry.domain
    if geometry.gdim == 2:
        return float(bed.height([domain.left])[0])
    resolved = resolved_bed(geometry, geometry.placement, datum)
    if resolved is not None and resolved.level is not None:
        return resolved.level
    y = np.linspace(*domain.across, SAMPLES)
    return float(np.mean(bed.height(np.column_stack([np.full_like(y, domain.left), y]))))
