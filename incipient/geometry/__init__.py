"""Grains, beds and their contacts, in 2-D and 3-D."""

from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed, Curved, Flat, HalfDiscs, Polyline, Sinusoidal
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline
from incipient.geometry.plane.grains import (
    Disc,
    Discs,
    Ellipse,
    Grain,
    Polygon,
    Rectangle,
    Star,
    Superellipse,
)
from incipient.geometry.settle import Settled, SettlingOutcome, settle
from incipient.geometry.space.beds import Plane, Ridges, SphereBed, Terrain
from incipient.geometry.space.grains import (
    Box,
    Cylinder,
    Ellipsoid,
    Polyhedron,
    Solid,
    Sphere,
    Spheres,
    Superquadric,
    Triangulated,
)
from incipient.geometry.space.heightmap import HeightMap

__all__ = [
    "Arc",
    "Bed",
    "Box",
    "Curve",
    "Curved",
    "Cylinder",
    "Disc",
    "Discs",
    "Ellipse",
    "Ellipsoid",
    "Flat",
    "Grain",
    "HalfDiscs",
    "HeightMap",
    "Line",
    "Placement",
    "Plane",
    "Polygon",
    "Polyhedron",
    "Polyline",
    "Rectangle",
    "Ridges",
    "Settled",
    "SettlingOutcome",
    "Sinusoidal",
    "Solid",
    "Sphere",
    "SphereBed",
    "Spheres",
    "Spline",
    "Star",
    "Superellipse",
    "Superquadric",
    "Terrain",
    "Triangulated",
    "settle",
]
