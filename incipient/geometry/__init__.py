"""Grains, beds, the curves they are made of, and how one rests on the other, in the plane and in space."""

from incipient.geometry.bed import Bed, Flat, HalfDiscs, Polyline, Sinusoidal
from incipient.geometry.curves import Arc, Curve, Line, Spline
from incipient.geometry.discs import Discs
from incipient.geometry.grain import Disc, Ellipse, Grain, Rectangle
from incipient.geometry.heightmap import HeightMap
from incipient.geometry.placement import Placement
from incipient.geometry.polygon import Polygon
from incipient.geometry.polyhedra import Box, Polyhedron, Triangulated
from incipient.geometry.rest import clearance, lifted, rest
from incipient.geometry.settle import Outcome, Settled, settle
from incipient.geometry.smooth import Harmonics, Star, Superellipse
from incipient.geometry.solid import Ellipsoid, Solid, Sphere, StarSolid, Superquadric
from incipient.geometry.spheres import Spheres
from incipient.geometry.terrain import EggCrate, Hemispheres, Plane, Relief, Ridges, Terrain

__all__ = [
    "Arc",
    "Bed",
    "Box",
    "Curve",
    "Disc",
    "Discs",
    "EggCrate",
    "Ellipse",
    "Ellipsoid",
    "Flat",
    "Grain",
    "HalfDiscs",
    "Harmonics",
    "HeightMap",
    "Hemispheres",
    "Line",
    "Outcome",
    "Placement",
    "Plane",
    "Polygon",
    "Polyhedron",
    "Polyline",
    "Rectangle",
    "Relief",
    "Ridges",
    "Settled",
    "Sinusoidal",
    "Solid",
    "Sphere",
    "Spheres",
    "Spline",
    "Star",
    "StarSolid",
    "Superellipse",
    "Superquadric",
    "Terrain",
    "Triangulated",
    "clearance",
    "lifted",
    "rest",
    "settle",
]
