"""Grains and beds in 2-D: their sections and geometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from .. import geometry
from ..geometry.plane.grains import MAX_EXPONENT
from .grains import BodySection, OfTime
from .points import MOST_POINTS, FromFile, file_key
from .section import NotNegative, Pair, Positive, PositivePair, Rule, Section, key, of_length

MOST_DISCS, MOST_HARMONICS = 500, 100

Numbers = Annotated[tuple[float, ...], Field(strict=False, max_length=MOST_HARMONICS)]
Course = Annotated[
    tuple[OfTime, OfTime, OfTime],
    Field(strict=False),
    of_length((3,), "give three: velocities along x and y, and the spin"),
]
Circle = Annotated[
    tuple[float, float, Positive],
    Field(strict=False),
    of_length((3,), "give three, as in [x, y, radius]"),
]


class GrainSection(BodySection):
    """Common keys of grains in 2-D."""

    gdim: ClassVar[int] = 2
    gdims: ClassVar[tuple[int, ...]] = (2,)

    centre: Pair | None = key(
        "Centroid of a grain away from the bed [length]; give x or centre",
        None,
        examples=[(4.0, 2.0)],
    )
    angle: float = key("Rotation, counter-clockwise [degrees]", 0.0)
    mass: NotNegative | None = key(
        "Mass instead of density [density of the fluid x area]", None, examples=[2.0]
    )
    inertia: NotNegative | None = key(
        "Moment of inertia about the centroid; default: of a uniform grain", None, examples=[0.25]
    )
    velocity: Pair = key("Velocity of a free grain at time 0 [length/time]", (0.0, 0.0))
    spin: float = key("Angular velocity of a free grain at time 0 [radians/time]", 0.0)
    locked: Annotated[tuple[Literal["x", "y", "angle"], ...], Field(strict=False)] = key(
        "Suppressed motions of a free grain: x, y, angle", (), examples=[("x", "y")]
    )
    course: Course | None = key(
        "Formulas in t for velocity along x, along y and spin of a prescribed motion",
        None,
        examples=[("0.1*cos(t)", "0", "0")],
    )

    def placed(self, centre: Sequence[float]) -> geometry.Placement:
        return geometry.Placement(tuple(centre), math.radians(self.angle))


class Disc(GrainSection):
    """A disc."""

    made_of = (geometry.Disc, "diameter")
    shape: Literal["disc"] = key("Shape of the grain", "disc")
    diameter: Positive = key("Diameter [length]")


class Ellipse(GrainSection):
    """An ellipse."""

    made_of = (geometry.Ellipse, "semi_axes")
    shape: Literal["ellipse"] = key("Shape of the grain", "ellipse")
    semi_axes: PositivePair = key("Semi-axes, the first along x when angle is 0 [length]")


class Rectangle(GrainSection):
    """A rectangle, with rounded or sharp corners."""

    made_of = (geometry.Rectangle, "width", "height", "corner_radius")
    shape: Literal["rectangle"] = key("Shape of the grain", "rectangle")
    width: Positive = key("Side along x when angle is 0 [length]")
    height: Positive = key("The other side [length]")
    corner_radius: NotNegative = key("Radius of the rounded corners [length]", 0.0)

    rules = (
        Rule("corner_radius", lambda s: s.corner_radius > (half := 0.5 * min(s.width, s.height)) and half,
             "is {s.corner_radius:g}, more than half the shorter side, {v:g}", "make it smaller"),
    )  # fmt: skip


class Polygon(FromFile, GrainSection):
    """A simple polygon, such as an outline traced in a file."""

    made_of = (geometry.Polygon, "vertices")
    in_file = shape_key = "vertices"
    fewest = 3
    shape: Literal["polygon"] = key("Shape of the grain", "polygon")
    file: str | None = file_key("CSV file of x, y,", "vertices", "grain.csv")
    vertices: Annotated[
        tuple[Pair, ...], Field(strict=False, min_length=3, max_length=MOST_POINTS)
    ] = key("Vertices in order, three or more, relative to any point [length]", ())

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        points = super().read(path, data)["vertices"]
        return {"vertices": points[:-1] if points[0] == points[-1] else points}


class Superellipse(GrainSection):
    """A superellipse, between an ellipse and a box."""

    made_of = (geometry.Superellipse, "semi_axes", "exponent")
    shape: Literal["superellipse"] = key("Shape of the grain", "superellipse")
    semi_axes: PositivePair = key("Semi-axes, the first along x when angle is 0 [length]")
    exponent: float = key(
        "n in |x/a|^n + |y/b|^n = 1: 2 is an ellipse, 20 almost a rectangle with corner_radius",
        ge=2,
        le=MAX_EXPONENT,
    )


class Star(GrainSection):
    """A star-shaped grain: radius (1 + sum of cosines[k] cos(k a) + sines[k] sin(k a)) at the angle a."""

    made_of = (geometry.Star, "radius", "cosines", "sines")
    shape: Literal["star"] = key("Shape of the grain", "star")
    radius: Positive = key("Mean radius [length]")
    cosines: Numbers = key("Coefficients of cos(a), cos(2 a), ... [-]", (), examples=[(0.0, 0.2)])
    sines: Numbers = key("Coefficients of sin(a), sin(2 a), ... [-]", (), examples=[(0.0, 0.1)])

    @property
    def shape_key(self) -> str:  # type: ignore[override]
        return "cosines" if self.cosines else "sines"


class Discs(GrainSection):
    """Overlapping discs that move as one."""

    shape_key = "discs"
    shape: Literal["discs"] = key("Shape of the grain", "discs")
    discs: Annotated[
        tuple[Circle, ...], Field(strict=False, min_length=1, max_length=MOST_DISCS)
    ] = key("x, y and radius of each disc, relative to any point [length]")

    def new_grain(self) -> geometry.Grain:
        return geometry.Discs([disc[:2] for disc in self.discs], [disc[2] for disc in self.discs])


APART = Rule("spacing", lambda s: s.spacing < 2.0 * s.radius and 2.0 * s.radius,
             "{s.spacing:g} is less than two radii, {v:g}: the {s.kind} overlap",
             "enlarge spacing or reduce radius")  # fmt: skip


class BedSection(Section):
    """Common keys of beds."""

    gdims: ClassVar[tuple[int, ...]] = (2,)  # possible geometric dimensions

    @property
    def slope_angle(self) -> float:
        return math.radians(getattr(self, "slope", 0.0))

    def forms(self, length: float) -> float:
        """Approximate number of bedforms on a length; 0 in 3-D, where not all are meshed."""
        return 0.0

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        """Geometry above a base line or plane at this height, with x, in 3-D also y, counted from a corner."""
        raise NotImplementedError


class Flat(BedSection):
    """A horizontal plane."""

    gdims: ClassVar[tuple[int, ...]] = (2, 3)
    kind: Literal["flat"] = key("Kind of bed", "flat")

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        return geometry.Flat(base) if len(corner) == 1 else geometry.Plane(origin_z=base)


class Inclined(Flat):
    """A plane that falls in the direction of the flow; coordinates are parallel to it and gravity is turned."""

    kind: Literal["inclined"] = key("Kind of bed", "inclined")  # type: ignore[assignment]
    slope: float = key(
        "Angle by which the bed falls in the direction of the flow [degrees]", gt=-90, lt=90
    )


class Sinusoidal(BedSection):
    """Ripples, amplitude sin(2 pi x / wavelength + phase) above the base line."""

    kind: Literal["sinusoidal"] = key("Kind of bed", "sinusoidal")
    amplitude: NotNegative = key("Half the height from trough to crest [length]")
    wavelength: Positive = key("Distance between crests [length]")
    phase: float = key("Phase at x = 0 [degrees]", 0.0)

    def forms(self, length: float) -> float:
        """Number of ripples; for very steep ones the sharpness of the crests counts."""
        return 0.5 * length / self.shape(0.0, (0.0,)).feature

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        ahead = math.radians(self.phase) + math.tau * math.fmod(corner[0] / self.wavelength, 1.0)
        return geometry.Sinusoidal(self.amplitude, self.wavelength, ahead, base)


class HalfDiscs(BedSection):
    """A row of half-discs on the base line."""

    rules = (APART,)
    kind: Literal["half-discs"] = key("Kind of bed", "half-discs")
    radius: Positive = key("Radius of the half-discs [length]")
    spacing: Positive = key("Distance between their centres, at least two radii [length]")
    offset: float = key("Abscissa of the centre of one of them [length]", 0.0)

    def forms(self, length: float) -> float:
        return length / self.spacing

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        return geometry.HalfDiscs(self.radius, self.spacing, self.offset - corner[0], base)


def _disorder(s: Any) -> list[tuple[float, float]]:
    pairs = pairwise(s.points)
    return [(right[0], left[0]) for left, right in pairs if right[0] < left[0] or right == left][:1]


class Polyline(FromFile, BedSection):
    """Straight lines, or a smooth curve, through points."""

    rules = (
        Rule("points", _disorder, "has x = {v[0]:g} after x = {v[1]:g}",
             "sort the points by ascending x, each place once"),
        Rule("smooth", lambda s: s.smooth and s.steps,
             "is true, but points have a step, the same x twice", "leave it out"),
    )  # fmt: skip
    kind: Literal["polyline"] = key("Kind of bed", "polyline")
    file: str | None = file_key("CSV file of x, y,", "points", "bed.csv")
    points: Annotated[
        tuple[Pair, ...], Field(strict=False, min_length=2, max_length=MOST_POINTS)
    ] = key(
        "Points with ascending x, heights counted from the base line; the same x twice: a step [length]",
        (),
    )
    smooth: bool = key("A smooth curve through the points instead of straight lines", False)

    @property
    def steps(self) -> list[float]:
        """Abscissae that are given twice."""
        return [left[0] for left, right in pairwise(self.points) if left[0] == right[0]]

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        curve = geometry.Curved if self.smooth else geometry.Polyline
        return curve([(x - corner[0], y) for x, y in self.points], base)


PlaneBody = Disc | Ellipse | Rectangle | Polygon | Superellipse | Star | Discs
PlaneBed = Flat | Inclined | Sinusoidal | HalfDiscs | Polyline
