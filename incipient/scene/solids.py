"""Grains in 3-D: their sections and geometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from .. import geometry
from ..geometry.placement import product, rotation_by
from ..geometry.plane.grains import MAX_EXPONENT
from .grains import BodySection, OfTime
from .points import MOST_POINTS, FromFile, file_key
from .section import NotNegative, Positive, PositiveTriple, Rule, Triple, key, of_length

MOST_SPHERES = 500


Ball = Annotated[
    tuple[float, float, float, Positive],
    Field(strict=False),
    of_length((4,), "give four, as in [x, y, z, radius]"),
]
Triangle = Annotated[tuple[int, int, int], Field(strict=False)]
SemiAxes = Annotated[
    PositiveTriple, Field(description="Semi-axes along x, y and z without orientation [length]")
]
Exponent = Annotated[float, Field(ge=2, le=MAX_EXPONENT)]
Freedom = Literal["x", "y", "z", "rx", "ry", "rz"]
Course = Annotated[
    tuple[OfTime, OfTime, OfTime, OfTime, OfTime, OfTime],
    Field(strict=False),
    of_length((6,), "give six: velocities along x, y and z, then spins"),
]


def orientation_of(placement: geometry.Placement) -> tuple[float, float, float]:
    """Angles [degrees] of successive rotations about x, y and z, as in `orientation`."""
    a = placement.rotation
    about = (
        np.arctan2(a[2, 1], a[2, 2]),
        np.arcsin(np.clip(-a[2, 0], -1.0, 1.0)),
        np.arctan2(a[1, 0], a[0, 0]),
    )
    x, y, z = np.degrees(about).tolist()
    return x, y, z


class SolidSection(BodySection):
    """Common keys of grains in 3-D."""

    gdim: ClassVar[int] = 3
    gdims: ClassVar[tuple[int, ...]] = (3,)
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule("y", lambda s: s.y is not None and s.x is None, "goes with x, but centre is given", "leave it out"),
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
    inertia: (
        Annotated[
            tuple[NotNegative, NotNegative, NotNegative],
            Field(strict=False),
            of_length((3,), "give three, about the grain's axes"),
        ]
        | None
    ) = key(
        "Moments of inertia about the grain's axes through its centroid; default: of a uniform grain",
        None,
        examples=[(0.1, 0.1, 0.1)],
    )
    velocity: Triple = key("Velocity of a free grain at time 0 [length/time]", (0.0, 0.0, 0.0))
    spin: Triple = key("Angular velocity of a free grain at time 0 [radians/time]", (0.0, 0.0, 0.0))
    locked: Annotated[tuple[Freedom, ...], Field(strict=False)] = key(
        "Suppressed motions of a free grain: x, y, z, rx, ry, rz", (), examples=[("x", "ry")]
    )
    course: Course | None = key(
        "Formulas in t for velocity and spin of a prescribed motion, along and about x, y and z",
        None,
        examples=[("0.1*cos(t)", "0", "0", "0", "0", "0")],
    )

    def placed(self, centre: Sequence[float]) -> geometry.Placement:
        about_x, about_y, about_z = (
            rotation_by(angle * axis)
            for angle, axis in zip(np.radians(self.orientation), np.eye(3), strict=True)
        )
        return geometry.Placement(
            tuple(centre), quaternion=product(about_z, product(about_y, about_x))
        )


class Sphere(SolidSection):
    """A sphere."""

    made_of = (geometry.Sphere, "diameter")
    shape: Literal["sphere"] = key("Shape of the grain", "sphere")
    diameter: Positive = key("Diameter [length]")


class Cylinder(SolidSection):
    """A fixed cylinder across the whole width of the domain."""

    made_of = (geometry.Cylinder, "diameter", "length")
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

    made_of = (geometry.Ellipsoid, "semi_axes")
    shape: Literal["ellipsoid"] = key("Shape of the grain", "ellipsoid")
    semi_axes: SemiAxes


class Superquadric(SolidSection):
    """A superquadric, between an ellipsoid and a box or a cylinder."""

    made_of = (geometry.Superquadric, "semi_axes", "exponents")
    shape: Literal["superquadric"] = key("Shape of the grain", "superquadric")
    semi_axes: SemiAxes
    exponents: Annotated[tuple[Exponent, Exponent], Field(strict=False)] = key(
        "Exponents along z and across it: 2 is an ellipsoid, 100 almost a box"
    )


class Box(SolidSection):
    """A box, with rounded or sharp edges."""

    made_of = (geometry.Box, "sides", "edge_radius")
    shape_key = "edge_radius"
    shape: Literal["box"] = key("Shape of the grain", "box")
    sides: PositiveTriple = key("Sides along x, y and z without orientation [length]")
    edge_radius: NotNegative = key("Radius of the rounded edges and corners [length]", 0.0)


class Polyhedron(SolidSection):
    """A convex polyhedron."""

    made_of = (geometry.Polyhedron, "vertices")
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

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
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
