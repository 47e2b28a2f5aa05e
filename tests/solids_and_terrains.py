"""Grains and beds in space of every kind, for tests that hold for all of them."""

import numpy as np
import pytest
import trimesh
from hypothesis import strategies as st

from incipient.geometry import (
    Box,
    Ellipsoid,
    HeightMap,
    Plane,
    Polyhedron,
    Ridges,
    Sphere,
    SphereBed,
    Spheres,
    Superquadric,
    Triangulated,
)

TORUS = trimesh.creation.torus(0.5, 0.2, 16, 12)
POINTS = np.random.default_rng(5).normal(size=(14, 3)) * [0.5, 0.4, 0.3]


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
    "heap": SphereBed(
        [[-0.8, 0.2, 0.3], [0.5, -0.4, 0.2], [0.2, 1.1, 0.3], [1.4, 0.3, 0.1]],
        [0.9, 0.5, 0.3, 0.6],
        0.3,
    ),
    "ridges": Ridges(0.1, 1.0, 0.4, 0.2),
    "height map": HeightMap(0.2 * np.sin(3.0 * X) * np.cos(2.0 * Y), (0.1, 0.1), (-4.0, -4.0, 0.0)),
}
solids = pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())
terrains = pytest.mark.parametrize("bed", TERRAINS.values(), ids=TERRAINS.keys())
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
