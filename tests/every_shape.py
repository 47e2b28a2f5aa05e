"""Grains and beds of every kind, in the plane and in space, for tests that hold for all of them."""

import numpy as np
import pytest
import trimesh
from hypothesis import strategies as st

from incipient.geometry import (
    Box,
    Curved,
    Disc,
    Ellipse,
    Ellipsoid,
    Flat,
    HalfDiscs,
    HeightMap,
    Plane,
    Polygon,
    Polyhedron,
    Polyline,
    Rectangle,
    Ridges,
    Sinusoidal,
    Sphere,
    SphereBed,
    Spheres,
    Superquadric,
    Triangulated,
)

TETRAHEDRON = Polyhedron([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
TORUS = trimesh.creation.torus(0.5, 0.2, 16, 12)
POINTS = np.random.default_rng(5).normal(size=(14, 3)) * [0.5, 0.4, 0.3]

GRAINS = {
    "disc": Disc(1.2),
    "ellipse, long side along x": Ellipse((0.7, 0.3)),
    "ellipse, long side along y": Ellipse((0.2, 0.5)),
    "sharp box": Rectangle(1.0, 0.6),
    "rounded box": Rectangle(1.0, 0.6, 0.1),
    "stadium": Rectangle(1.0, 0.6, 0.3),
    "quadrilateral": Polygon([(0, 0), (2, 0.5), (1.5, 1.5), (-0.2, 1.0)]),
    "clockwise arrow": Polygon([(0, 0), (-1, 2), (1, 0), (-1, -2)]),
}
BEDS = {
    "flat": Flat(0.2),
    "wavy": Sinusoidal(0.1, 1.0, 0.4, 0.2),
    "steep wavy": Sinusoidal(0.4, 0.7),
    "touching half-discs": HalfDiscs(0.5, 1.0, 0.1, 0.2),
    "spaced half-discs": HalfDiscs(0.2, 0.7),
    "polyline": Polyline([(-6, 0), (-0.5, 0.3), (0, 0.6), (0.4, -0.2), (1, 0), (6, 0.2)], 0.1),
    "smooth curve": Curved(
        [(-6, 0.2), (-2, 0.2), (-0.5, 0.3), (0.1, 0.6), (0.8, 0.1), (1.5, 0), (6, 0)], 0.1
    ),
}
SOLIDS = {
    "sphere": Sphere(1.2),
    "ellipsoid": Ellipsoid((0.7, 0.4, 0.3)),
    "superquadric": Superquadric((0.7, 0.4, 0.3), (4.0, 3.0)),
    "almost a cylinder": Superquadric((0.4, 0.4, 0.5), (12.0, 2.0)),
    "sharp box": Box((1.0, 0.6, 0.4)),
    "rounded box": Box((1.0, 0.6, 0.4), 0.1),
    "box rounded to a stadium": Box((1.0, 0.4, 0.4), 0.2),
    "polyhedron": Polyhedron(POINTS),
    "torus of triangles": Triangulated(TORUS.vertices, TORUS.faces),
    "spheres": Spheres([(0, 0, 0), (0.5, 0.0, 0.1), (0.1, 0.4, 0.2)], [0.4, 0.35, 0.3]),
}
X, Y = np.meshgrid(np.linspace(-4.0, 4.0, 81), np.linspace(-4.0, 4.0, 81))
TERRAINS = {
    "plane": Plane((0.3, -0.2), 0.1),
    "square half-balls": SphereBed.array(0.4, 1.0, "square", (0.1, 0.2), 0.3),
    "triangular overlapping half-balls": SphereBed.array(0.5, 0.8, "triangular"),
    "balls in disorder": SphereBed.array(0.4, 1.0, "random", (0.1, 0.2), seed=3),
    "heap": SphereBed(
        [[-0.8, 0.2, 0.3], [0.5, -0.4, 0.2], [0.2, 1.1, 0.3], [1.4, 0.3, 0.1]],
        [0.9, 0.5, 0.3, 0.6],
        0.3,
    ),
    "ridges": Ridges(0.1, 1.0, 0.4, 0.2),
    "height map": HeightMap(0.2 * np.sin(3.0 * X) * np.cos(2.0 * Y), (0.1, 0.1), (-4.0, -4.0, 0.0)),
}
solids = pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def dense(curves, count=4001):
    """Points all along a chain of curves."""
    return np.vstack([curve.point(np.linspace(0.0, 1.0, count)) for curve in curves])


def pebble(count):
    """Vertices (count, 2) of a smooth outline that is nowhere convex for long."""
    a = 2.0 * np.pi * np.arange(count) / count
    r = 0.5 * (
        1.0 + 0.15 * np.cos(3.0 * a + 1.0) + 0.08 * np.sin(5.0 * a) + 0.02 * np.cos(17.0 * a)
    )
    return np.column_stack([r * np.cos(a), r * np.sin(a)])
