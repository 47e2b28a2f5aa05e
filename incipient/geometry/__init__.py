"""Grains, beds, the curves they are made of, and how one rests on the other, in the plane and in space."""

from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed, Flat, HalfDiscs, Sinusoidal
from incipient.geometry.plane.curved import Curved
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline
from incipient.geometry.plane.discs import Discs
from incipient.geometry.plane.grain import Disc, Ellipse, Grain, Rectangle
from incipient.geometry.plane.polygon import Polygon
from incipient.geometry.plane.polyline import Polyline
from incipient.geometry.plane.smooth import Harmonics, Star, Superellipse
from incipient.geometry.rest import clearance, lifted, rest
from incipient.geometry.settle import Settled, SettlingOutcome, settle
from incipient.geometry.space.cylinder import Cylinder
from incipient.geometry.space.heightmap import HeightMap
from incipient.geometry.space.polyhedra import Box, Polyhedron, Triangulated
from incipient.geometry.space.solid import Ellipsoid, Solid, Sphere, Superquadric
from incipient.geometry.space.spheres import Spheres
from incipient.geometry.space.terrain import Hemispheres, Plane, Ridges, Terrain

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
]
__all__ += [
    "Grain",
    "HalfDiscs",
    "Harmonics",
    "HeightMap",
    "Hemispheres",
    "Line",
    "Placement",
    "Plane",
]
__all__ += [
    "Polygon",
    "Polyhedron",
    "Polyline",
    "Rectangle",
    "Ridges",
    "Settled",
    "SettlingOutcome",
]
__all__ += [
    "Sinusoidal",
    "Solid",
    "Sphere",
    "Spheres",
    "Spline",
    "Star",
    "Superellipse",
    "Superquadric",
]
__all__ += ["Terrain", "Triangulated", "clearance", "lifted", "rest", "settle"]
