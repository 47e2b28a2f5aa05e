"""The section [body]: grains in 2-D and 3-D, their mass and their rest on a bed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from .. import geometry
from ..arrays import Floats, unwarned
from ..errors import SceneError
from ..geometry.placement import Placement
from ..geometry.settle import settle
from ..geometry.shape import Shape
from .section import (
    MOST_POINTS,
    FromFile,
    NotNegative,
    Pair,
    Positive,
    PositivePair,
    PositiveTriple,
    Rule,
    Section,
    Triple,
    file_key,
    formula,
    key,
)

if TYPE_CHECKING:
    from ..contact.verdict import MassAndInertia

DEFAULT_FRICTION = 1.0  # where the scene has no contact: rough enough for slopes of 45 degrees
FRICTIONLESS = "frictionless"
LEVEL = "level"
# Keys that only a grain with this motion reads.
READ_ONLY_BY = {
    "velocity": "free",
    "spin": "free",
    "locked": "free",
    "on_contact": "free",
    "course": "prescribed",
}
# Sharper corners than those of this exponent are narrower than cells of default size can follow.
MAX_EXPONENT = 20.0
THINNEST = 1e-7  # area over size squared in 2-D, volume over size cubed in 3-D
OfTime = Annotated[str, formula("t")]
MOST_DISCS, MOST_SPHERES, MOST_HARMONICS = 500, 500, 100

Numbers = Annotated[tuple[float, ...], Field(strict=False, max_length=MOST_HARMONICS)]
Course = Annotated[tuple[OfTime, OfTime, OfTime], Field(strict=False)]
Circle = Annotated[tuple[float, float, Positive], Field(strict=False)]
Ball = Annotated[tuple[float, float, float, Positive], Field(strict=False)]
Triangle = Annotated[tuple[int, int, int], Field(strict=False)]
SemiAxes = Annotated[
    PositiveTriple, Field(description="Semi-axes along x, y and z without orientation [length]")
]
Exponent = Annotated[float, Field(ge=2, le=MAX_EXPONENT)]
Freedom = Literal["x", "y", "z", "rx", "ry", "rz"]
SolidCourse = Annotated[tuple[OfTime, OfTime, OfTime, OfTime, OfTime, OfTime], Field(strict=False)]


class BodySection(Section):
    """A grain, in 2-D or in 3-D.

    Attributes:
        shape_key: the key that is refused if the grain is not possible.
    """

    gdim: ClassVar[int]
    shape_key: ClassVar[str] = "shape"
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule("course", lambda s: s.motion == "prescribed" and s.course is None,
             "is missing though the motion is prescribed", "add it, or set motion = \"fixed\""),
        Rule("x", lambda s: s.motion in ("free", "prescribed") and s.centre is None,
             "a moving grain starts away from the bed",
             'give centre instead of x, or motion = "released" for a grain that starts from rest on the bed'),
        Rule("centre", lambda s: s.motion == "released" and s.x is None,
             "a released grain starts from its rest on the bed", "give x instead of centre"),
        Rule("{v[0]}", lambda s: [(k, m) for k, m in READ_ONLY_BY.items() if s.motion != m and s.changed(k)],
             'is read only with motion = "{v[1]}", but the motion is "{s.motion}"',
             'leave it out, or set motion = "{v[1]}"'),
        Rule("mass", lambda s: s.density is not None and s.mass is not None,
             "is given with density, from which it follows", "leave one of them out"),
        Rule("x", lambda s: s.x is None and s.centre is None,
             "neither x nor centre is given", "give x to rest on the bed, or centre"),
        Rule("x", lambda s: s.x is not None and s.centre is not None, "both x and centre are given", "leave one out"),
        Rule("settle", lambda s: s.settle and s.x is None, "a grain with a given centre does not settle",
             "give x instead of centre, or leave settle out"),
        # Which its geometry may refuse. At thinner grains the mesher ends the process, or takes hours.
        Rule("{s.shape_key}", lambda s: s.grain.volume < THINNEST * s.grain.size**s.gdim and THINNEST,
             "the grain fills less than {v:g} of a square or cube of its size", "make it thicker"),
    )  # fmt: skip

    x: float | None = key(
        "x of a grain that rests on the bed [length]; give x or centre", None, examples=[4.0]
    )
    density: NotNegative | None = key(
        "Density relative to the fluid [-]; without it or a mass there is no weight and no verdict",
        None,
        examples=[2.65],
    )
    settle: bool | Literal["frictionless", "level"] = key(
        "Let the grain roll and tip until it is in equilibrium on the bed, with contact.friction and cohesion; "
        '"frictionless": without both; "level": as if bed.slope were zero',
        False,
    )
    motion: Literal["fixed", "free", "prescribed", "released"] = key(
        "Motion of the grain; free: by flow and weight; prescribed: by `course`; released: from rest on "
        "the bed, by flow, weight and contact",
        "fixed",
    )
    on_contact: Literal["stop", "touch"] = key(
        "stop: the run ends when a moving grain is within contact.gap of a wall; touch: a free grain may "
        "roll, slide or rest on the bed",
        "stop",
    )

    if TYPE_CHECKING:
        centre: Any
        mass: float | None
        inertia: Any

    @property
    def place(self) -> str:
        """The key of the grain's position."""
        return "x" if self.centre is None else "centre"

    @property
    def moves(self) -> bool:
        return self.motion != "fixed"

    @property
    def is_free(self) -> bool:
        return self.motion in ("free", "released")

    @property
    def touches(self) -> bool:
        """Whether contact is simulated; otherwise it ends the run."""
        return self.motion == "released" or self.on_contact == "touch"

    @cached_property  # an outline of many points takes time to check
    def grain(self) -> Any:
        return self.new_grain()

    def new_grain(self) -> Shape:
        """The geometry that has the section's name, its arguments being the section's own keys."""
        keys = (name for name in type(self).__annotations__ if name not in ("shape", "file"))
        shape: Shape = getattr(geometry, type(self).__name__)(*(getattr(self, key) for key in keys))
        return shape


# -- 2-D -------------------------------------------------------------------------------------------


class GrainSection(BodySection):
    """Common keys of grains in 2-D."""

    gdim: ClassVar[int] = 2

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

    shape: Literal["disc"] = key("Shape of the grain", "disc")
    diameter: Positive = key("Diameter [length]")


class Ellipse(GrainSection):
    """An ellipse."""

    shape: Literal["ellipse"] = key("Shape of the grain", "ellipse")
    semi_axes: PositivePair = key("Semi-axes, the first along x when angle is 0 [length]")


class Rectangle(GrainSection):
    """A rectangle, with rounded or sharp corners."""

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

    in_file = shape_key = "vertices"
    fewest = 3
    shape: Literal["polygon"] = key("Shape of the grain", "polygon")
    file: str | None = file_key("CSV file of x, y,", "vertices", "grain.csv")
    vertices: Annotated[
        tuple[Pair, ...], Field(strict=False, min_length=3, max_length=MOST_POINTS)
    ] = key("Vertices in order, three or more, relative to any point [length]", ())

    def read(self, path: Path) -> dict[str, Any]:
        points = super().read(path)["vertices"]
        return {"vertices": points[:-1] if points[0] == points[-1] else points}


class Superellipse(GrainSection):
    """A superellipse, between an ellipse and a box."""

    shape: Literal["superellipse"] = key("Shape of the grain", "superellipse")
    semi_axes: PositivePair = key("Semi-axes, the first along x when angle is 0 [length]")
    exponent: float = key(
        "n in |x/a|^n + |y/b|^n = 1: 2 is an ellipse, 20 almost a rectangle with corner_radius",
        ge=2,
        le=MAX_EXPONENT,
    )


class Star(GrainSection):
    """A star-shaped grain: radius (1 + sum of cosines[k] cos(k a) + sines[k] sin(k a)) at the angle a."""

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


PlaneBody = Disc | Ellipse | Rectangle | Polygon | Superellipse | Star | Discs


# -- 3-D -------------------------------------------------------------------------------------------


def orientation_of(placement: geometry.Placement) -> tuple[float, float, float]:
    """Angles [degrees] of successive rotations about x, y and z, as in `orientation`."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_matrix(placement.rotation.copy())  # scipy refuses read-only arrays
    with unwarned():  # of one angle that is zero where y turns by 90 degrees
        x, y, z = rotation.as_euler("xyz", degrees=True).tolist()
    return x, y, z


class SolidSection(BodySection):
    """Common keys of grains in 3-D."""

    gdim: ClassVar[int] = 3
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule("y", lambda s: s.y is not None and s.x is None, "goes with x, but centre is given", "leave it out"),
        Rule("inertia", lambda s: s.inertia and 2.0 * max(s.inertia) > sum(s.inertia) * (1.0 + 1e-9),
             "has a moment that exceeds the sum of the others, as no distribution of mass has", "reduce it"),
    )  # fmt: skip

    y: float | None = key(
        "y of a grain that rests on the bed; default: mid-width [length]", None, examples=[5.0]
    )
    centre: Triple | None = key(
        "Centroid of a grain away from the bed [length]; give x or centre",
        None,
        examples=[(4.0, 5.0, 2.0)],
    )
    orientation: Triple = key("Successive rotations about x, y and z [degrees]", (0.0, 0.0, 0.0))
    mass: NotNegative | None = key(
        "Mass instead of density [density of the fluid x volume]", None, examples=[2.0]
    )
    inertia: Annotated[tuple[NotNegative, NotNegative, NotNegative], Field(strict=False)] | None = (
        key(
            "Moments of inertia about the grain's axes through its centroid; default: of a uniform grain",
            None,
            examples=[(0.1, 0.1, 0.1)],
        )
    )
    velocity: Triple = key("Velocity of a free grain at time 0 [length/time]", (0.0, 0.0, 0.0))
    spin: Triple = key("Angular velocity of a free grain at time 0 [radians/time]", (0.0, 0.0, 0.0))
    locked: Annotated[tuple[Freedom, ...], Field(strict=False)] = key(
        "Suppressed motions of a free grain: x, y, z, rx, ry, rz", (), examples=[("x", "ry")]
    )
    course: SolidCourse | None = key(
        "Formulas in t for velocity and spin of a prescribed motion, along and about x, y and z",
        None,
        examples=[("0.1*cos(t)", "0", "0", "0", "0", "0")],
    )

    def placed(self, centre: Sequence[float]) -> geometry.Placement:
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_euler("xyz", self.orientation, degrees=True).as_quat().tolist()
        return geometry.Placement(tuple(centre), quaternion=(w, x, y, z))


class Sphere(SolidSection):
    """A sphere."""

    shape: Literal["sphere"] = key("Shape of the grain", "sphere")
    diameter: Positive = key("Diameter [length]")


class Cylinder(SolidSection):
    """A fixed cylinder across the whole width of the domain."""

    rules = (
        Rule("x", lambda s: s.centre is None, "a cylinder is fixed and does not rest on a bed", "give centre instead"),
        Rule("motion", lambda s: s.moves, "a cylinder across the flow is fixed", 'give "fixed"'),
        Rule("orientation", lambda s: any(s.orientation), "a cylinder lies across the flow", "leave it out"),
    )  # fmt: skip
    shape: Literal["cylinder"] = key("Shape of the grain", "cylinder")
    diameter: Positive = key("Diameter [length]")
    length: Positive = key("Length, the width of the domain [length]")


class Capsule(SolidSection):
    """A cylinder with hemispherical ends, its axis along y before rotation."""

    shape: Literal["capsule"] = key("Shape of the grain", "capsule")
    diameter: Positive = key("Diameter [length]")
    length: Positive = key("Total length, above the diameter [length]")

    rules = (
        Rule("length", lambda s: s.length <= s.diameter, "is {s.length:g}, no more than the diameter",
             'give more than {s.diameter:g}, or shape = "sphere"'),
    )  # fmt: skip

    def new_grain(self) -> geometry.Solid:
        return geometry.Box((self.diameter, self.length, self.diameter), 0.5 * self.diameter)


class Ellipsoid(SolidSection):
    """An ellipsoid."""

    shape: Literal["ellipsoid"] = key("Shape of the grain", "ellipsoid")
    semi_axes: SemiAxes


class Superquadric(SolidSection):
    """A superquadric, between an ellipsoid and a box or a cylinder."""

    shape: Literal["superquadric"] = key("Shape of the grain", "superquadric")
    semi_axes: SemiAxes
    exponents: Annotated[tuple[Exponent, Exponent], Field(strict=False)] = key(
        "Exponents along z and across it: 2 is an ellipsoid, 20 almost a box"
    )


class Box(SolidSection):
    """A box, with rounded or sharp edges."""

    shape_key = "edge_radius"
    shape: Literal["box"] = key("Shape of the grain", "box")
    sides: PositiveTriple = key("Sides along x, y and z without orientation [length]")
    edge_radius: NotNegative = key("Radius of the rounded edges and corners [length]", 0.0)


class Polyhedron(SolidSection):
    """A convex polyhedron."""

    shape_key = "vertices"
    shape: Literal["polyhedron"] = key("Shape of the grain", "polyhedron")
    vertices: Annotated[
        tuple[Triple, ...], Field(strict=False, min_length=4, max_length=MOST_POINTS)
    ] = key("Vertices, four or more, in any order, relative to any point [length]")


class Spheres(SolidSection):
    """Overlapping spheres that move as one."""

    shape_key = "spheres"
    shape: Literal["spheres"] = key("Shape of the grain", "spheres")
    spheres: Annotated[
        tuple[Ball, ...], Field(strict=False, min_length=1, max_length=MOST_SPHERES)
    ] = key("x, y, z and radius of each sphere, relative to any point [length]")

    def new_grain(self) -> geometry.Solid:
        return geometry.Spheres(
            [ball[:3] for ball in self.spheres], [ball[3] for ball in self.spheres]
        )


class Mesh(FromFile, SolidSection):
    """A grain bounded by triangles, such as a scanned pebble, from an STL, PLY or OBJ file."""

    shape_key = "triangles"
    in_file = "vertices"
    instead = "give the name of an STL, PLY or OBJ file"
    shape: Literal["mesh"] = key("Shape of the grain", "mesh")
    file: str | None = file_key("STL, PLY or OBJ file,", "its triangles", "pebble.stl")
    size: Positive | None = key(
        "Largest diameter; default: that in the file [length]", None, examples=[1.0]
    )
    vertices: Annotated[tuple[Triple, ...], Field(strict=False, max_length=MOST_POINTS)] = key(
        "Corners of the triangles, relative to any point [length]", ()
    )
    triangles: Annotated[tuple[Triangle, ...], Field(strict=False)] = key(
        "Three indices of vertices each, from 0, all in the same sense", ()
    )

    def read(self, path: Path) -> dict[str, Any]:
        surface = geometry.Triangulated.from_file(path)
        return {"vertices": surface.vertices.tolist(), "triangles": surface.triangles.tolist()}

    def new_grain(self) -> geometry.Solid:
        points = np.array(self.vertices, dtype=float).reshape(-1, 3)
        triangles = np.array(self.triangles, dtype=int).reshape(-1, 3)
        grain = geometry.Triangulated(points, triangles)
        return (
            grain
            if self.size is None
            else geometry.Triangulated(self.size / grain.size * points, triangles)
        )


SolidBody = (
    Sphere | Cylinder | Capsule | Ellipsoid | Superquadric | Box | Polyhedron | Spheres | Mesh
)


# -- mass and rest ---------------------------------------------------------------------------------


def mean_density(body: BodySection) -> float | None:
    """Density relative to the fluid; None without a density or mass."""
    return body.density if body.mass is None else body.mass / body.grain.volume


def mass(body: BodySection) -> float | None:
    """Mass (fluid density 1), in 2-D per unit depth; None without a density or mass."""
    density = mean_density(body)
    return None if density is None else density * body.grain.volume


def inertia_tensor(body: BodySection) -> Floats:
    """Inertia (3, 3) about the centroid in the body frame, zero without a mass: given, or of a uniform grain.

    In 2-D the polar moment per unit depth fills the diagonal.
    """
    if body.inertia is not None:
        return np.asarray(np.diag(body.inertia * np.ones(3)))
    tensor = (mean_density(body) or 0.0) * np.asarray(body.grain.inertia)
    return np.asarray(tensor[2, 2] * np.eye(3)) if body.gdim == 2 else tensor


def mass_and_inertia(
    body: BodySection, placement: Placement | None = None
) -> MassAndInertia | None:
    """Mass and inertia (3, 3) about the centre of mass, in 2-D per unit depth; None without either.

    Added mass is omitted: it changes neither equilibrium nor the safety factor.
    """
    heavy, inert = mass(body), inertia_tensor(body)
    if not heavy or not inert.any():
        return None
    if body.gdim == 3 and placement is not None:
        inert = placement.rotation @ inert @ placement.rotation.T
    return heavy, inert


# The placement of a scene is read many times; computing it takes one or two seconds.
@lru_cache(maxsize=16)
def rested(
    grain: Any,
    bed: Any,
    above: Placement,
    down: tuple[float, ...],
    friction: float,
    cohesion: float,
    reach: float,
) -> Placement:
    """Equilibrium of a grain released above a placement, in 2-D or in 3-D.

    down: direction of gravity; cohesion: in weights; reach: distance over which the grain may roll. Raises SceneError
    without a stable rest.
    """
    start = replace(above, centre=(*above.centre[:-1], bed.crest + grain.size))
    settled = settle(grain, bed, start, down, friction, reach / grain.size, cohesion=cohesion)
    if not settled.stable:
        turn = "angle" if above.gdim == 2 else "y or orientation"
        raise SceneError(
            f"the grain {settled.outcome.value}; change x or {turn}, or leave settle out"
        )
    return settled.placement
