"""Grains: outlines, solids and grids of heights."""

from __future__ import annotations

import math
import pickle
import re
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import every_shape
import numpy as np
import pytest
import trimesh
from every_shape import SOLIDS, TORUS, dense, pebble, solids, vectors
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import message
from settling import rest

from incipient import load
from incipient.accuracy.first_mesh import planned
from incipient.geometry import (
    Arc,
    Box,
    Discs,
    Flat,
    Placement,
    Plane,
    Polygon,
    Polyhedron,
    Rectangle,
    Spheres,
    Spline,
    Star,
    Superellipse,
    Superquadric,
    Triangulated,
)
from incipient.geometry.plane.curves import Line
from incipient.geometry.settle import touching
from incipient.geometry.triangles import (
    Triangles,
    nearest_on_triangles,
    require_closed,
    sphere,
)
from incipient.meshes import Grid, graded_ends
from incipient.meshes.model import grid_cells
from incipient.planning.meshing import layer_ends

# Grains in space: surfaces, level functions, volumes and inertia, by closed formulae and by counting.


@contextmanager
def allocating_at_most(mebibytes: float) -> Iterator[None]:
    """Fails if the sum of allocations within the block becomes larger."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < mebibytes * 2**20
    finally:
        tracemalloc.stop()


@solids
def test_surface_is_closed_faces_outwards_and_encloses_the_moments(solid):
    """Volume, centroid and inertia by the divergence theorem on its triangles (trimesh): exact for flat sides."""
    surface = solid.surface(solid.size / 40.0)
    if not isinstance(solid, Spheres):  # whose triangles are left whole at creases
        require_closed(surface, "the surface")
        assert solid.level(surface.points) == pytest.approx(0.0, abs=1e-13 * solid.size)
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
    within = 1e-12 if isinstance(solid, Polyhedron | Triangulated) else 1e-2
    assert mesh.volume == pytest.approx(solid.volume, rel=within)
    assert mesh.center_mass == pytest.approx(np.zeros(3), abs=0.1 * within * solid.size)
    assert solid.inertia == pytest.approx(mesh.moment_inertia, abs=within * solid.inertia.max())


@solids
def test_no_point_lies_farther_than_the_extreme_ones_and_the_size(solid):
    """Beside the points of a fine surface, along the axes and eight other directions."""
    points = solid.surface(solid.size / 40.0).points
    others = np.random.default_rng(3).normal(size=(8, 3))
    for direction in [*np.eye(3), *others / np.linalg.norm(others, axis=1)[:, None]]:
        end = solid.extreme(direction)
        assert solid.level(end) == pytest.approx(0.0, abs=1e-12 * solid.size)
        beyond = (points @ direction).max() - end @ direction
        assert -5e-3 * solid.size < beyond < 1e-12 * solid.size
    largest = max(np.linalg.norm(points - p, axis=1).max() for p in points[::9])
    assert solid.size * (1.0 - 5e-3) <= largest <= solid.size * (1.0 + 1e-12)


@solids
@settings(max_examples=10, deadline=None)
@given(direction=vectors.filter(lambda v: np.linalg.norm(v) > 0.1), far=st.floats(0.05, 0.4))
def test_the_normal_is_the_gradient_of_the_level(solid, direction, far):
    # From far outside inwards; off the surface, where level functions are smooth almost everywhere.
    outward = np.array([direction]) / np.linalg.norm(direction)
    distance = np.linspace(1.0, 0.0, 201)[:, None] * solid.size
    ray = solid.level(distance * outward)
    point = distance[np.argmin(np.abs(ray - far * solid.size))] * outward
    h = 1e-5 * solid.size
    gradient = [(solid.level(point + h * e) - solid.level(point - h * e))[0] for e in np.eye(3)]
    sides = [solid.normal(point + h * e)[0] for e in np.vstack([np.eye(3), -np.eye(3)])]
    if np.ptp(sides, axis=0).max() < 1e-3:  # not across an edge of the level function
        expected = np.array([gradient]) / np.linalg.norm(gradient)
        assert solid.normal(point) == pytest.approx(expected, abs=1e-6)


AXES = np.array([0.7, 0.4, 0.3])
TURNED = np.array([2.0, 3.0, 6.0]) / 7.0
ELLIPSOID = 4.0 / 3.0 * np.pi * np.prod(AXES)
# V_lens = pi (R + r - d)^2 (d^2 + 2d(r + R) - 3(r - R)^2) / (12 d), of R = 0.5, r = 0.4, d = 0.6
LENS = np.pi * 0.3**2 * (0.6**2 + 2 * 0.6 * 0.9 - 3 * 0.1**2) / (12 * 0.6)
TETRAHEDRON = np.add([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], [3.0, 0.0, -1.0])


@pytest.mark.parametrize(
    ("solid", "volume", "inertia", "within"),
    [
        (
            *(Superquadric(tuple(AXES), (2.0, 2.0)), ELLIPSOID),
            *(0.2 * ELLIPSOID * ((AXES**2).sum() - AXES**2), 1e-12),
        ),
        # As the exponents grow it fills its box.
        (Superquadric(tuple(AXES), (100.0, 100.0)), 8.0 * np.prod(AXES), None, 1e-3),
        # Steiner: V = ABC + 2r (AB + BC + CA) + pi r^2 (A + B + C) + 4/3 pi r^3 with A, B, C the sides less 2r.
        (
            Box((1.0, 0.6, 0.4), 0.1),
            0.064 + 0.2 * 0.56 + np.pi * 0.01 * 1.4 + 4.0 / 3.0 * np.pi * 1e-3,
            *(None, 1e-12),
        ),
        (Box((0.6, 0.6, 0.6), 0.3), np.pi * 0.036, 3 * [np.pi * 0.036**2], 1e-12),
        # Of side s: V = s^3 / (6 sqrt 2), I = V s^2 / 20 about every axis.
        (Polyhedron(TETRAHEDRON), 8.0 / 3.0, 3 * [8.0 / 3.0 * 0.4], 1e-12),
        # Turned by any angle the union is the same, although its sections are others.
        *(
            (
                Spheres([(0, 0, 0), 0.6 * axis], [0.5, 0.4]),
                *(4.0 / 3.0 * np.pi * (0.5**3 + 0.4**3) - LENS, None, 1e-8),
            )
            for axis in (np.eye(3)[0], TURNED)
        ),
    ],
)
def test_volumes_and_moments_in_closed_form(solid, volume, inertia, within):
    assert solid.volume == pytest.approx(volume, rel=within)
    assert inertia is None or solid.inertia == pytest.approx(np.diag(inertia), abs=within)


CUBE = trimesh.creation.box()
MIXED = np.vstack([CUBE.faces[:1, ::-1], CUBE.faces[1:]])


@pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
def test_a_surface_is_read(tmp_path, kind):
    path = tmp_path / f"torus.{kind}"
    TORUS.export(path)
    solid = Triangulated.from_file(path)
    # Formats write six or seven digits.
    assert solid.volume == pytest.approx(TORUS.volume, rel=1e-5)
    assert solid.inertia == pytest.approx(TORUS.moment_inertia, abs=3e-6)


def test_what_can_be_put_right_is(tmp_path):
    # Every third triangle turned over, one there twice, and no point shared; then all turned inwards.
    corners = TORUS.vertices[TORUS.faces].copy()
    corners[::3] = corners[::3, ::-1]
    corners = np.concatenate([corners, corners[:1]])
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False).export(tmp_path / "scan.stl")
    scan = Triangulated.from_file(tmp_path / "scan.stl")
    for solid in (scan, Triangulated(TORUS.vertices, TORUS.faces[:, ::-1])):
        assert solid.volume == pytest.approx(TORUS.volume, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        # Two triangles that share a side leave a hole of four edges.
        (lambda p, f: (p, f[2:]), r"grain.ply is not watertight: it has 4 open edges; close"),
        # One corner is drawn through the opposite faces: they meet the three that share it.
        (
            lambda p, f: (np.where(p.sum(axis=1)[:, None] > 1.4, [[-0.7, -0.6, -0.8]], p), f),
            r"grain.ply runs through itself in \d+ triangles; remesh it",
        ),
        (
            lambda p, f: (np.vstack([p, p + 3.0]), np.vstack([f, f + len(p)])),
            "2 separate parts",
        ),
        (lambda p, f: (p * [1, 1, 0], f), "grain.ply (is|has|encloses)"),
    ],
)
def test_what_is_no_body_is_refused(tmp_path, change, reason):
    box = trimesh.creation.box()
    first = box.subdivide() if "runs" in reason else box
    points, faces = change(np.array(first.vertices), np.array(first.faces))
    trimesh.Trimesh(points, faces, process=False).export(tmp_path / "grain.ply")
    assert re.search(reason, message(lambda: Triangulated.from_file(tmp_path / "grain.ply")))


# Triangulated surfaces: remeshing, nearest points, distances and sides, of many triangles and of a few


def scanned(frequency: int) -> Triangulated:
    """A rough pebble of 20 frequency^2 triangles."""
    ball = sphere(frequency)
    x, y, z = ball.points.T
    radius = 0.5 + 0.025 * np.sin(3.0 * x + 1.0) * np.cos(4.0 * y) + 0.015 * np.sin(7.0 * z)
    return Triangulated(ball.points * radius[:, None], ball.triangles)


@pytest.mark.parametrize("frequency", [1, 8])
def test_distances_are_those_of_all_pairs(frequency):
    grain = scanned(frequency)
    points = np.random.default_rng(4).uniform(-0.7, 0.7, (60, 3))
    corners = grain.vertices[grain.triangles]
    outward = (
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * corners[:, 0]
    ).sum(axis=1)
    assert (outward > 0.0).all(), (
        "it is star-shaped, so that rays from the centre tell what is inside"
    )
    away = nearest_on_triangles(points[:, None], corners) - points[:, None]
    nearest = np.linalg.norm(away, axis=2).min(axis=1)
    assert np.abs(grain.level(points)) == pytest.approx(nearest, abs=1e-15)
    shares = np.linalg.inv(corners.transpose(0, 2, 1)) @ points.T
    inside = ((shares.sum(axis=1) < 1.0) | (shares < 0.0).any(axis=1)).all(axis=0)
    assert ((grain.level(points) < 0.0) == inside).all()
    assert inside.any() and not inside.all()


def test_sides_are_told_where_the_nearest_point_is_a_corner_or_an_edge():
    """Points on the normals of a sphere's corners, edges and faces are within it or outside, by construction."""
    ball = sphere(3)
    grain = Triangulated(ball.points, ball.triangles)
    edges = ball.points[ball.topology.edges].mean(axis=1)
    for target in (*ball.points[:20], *edges[:20], *ball.corners.mean(axis=1)[:20]):
        points = np.outer([0.5, 0.9, 1.1, 3.0], target)
        assert np.sign(grain.level(points)).tolist() == [-1.0, -1.0, 1.0, 1.0]
    # In the hole of a torus one is outside, and as far as its inner circle is round.
    assert SOLIDS["torus of triangles"].level([[0.0, 0.0, 0.0]]) == pytest.approx(0.3, rel=0.05)


def test_a_scanned_grain_of_many_triangles_rests_without_tables_of_pairs():
    """A number for every pair of vertex and triangle takes 4 GB, and minutes. Measured: 30 MiB."""
    with allocating_at_most(200.0):
        grain = scanned(40)
        assert len(grain.triangles) == 32_000
        placement = rest(grain, Plane(), (0.07, 0.13))
        contacts = touching(grain, placement, Plane(), 1e-9)
    points = placement.to_body(contacts.points)
    assert np.abs(grain.level(points)).max() < 1e-12
    # Triangles are 0.02 wide and turn by that over a radius of 0.5: 0.04, whose cosine is 0.9992.
    assert grain.normal(points)[:, 2] == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_point_at_the_corner_of_a_segment_is_found(seed):
    """As far from the middle as the segment reaches: one ulp used to lose it; straight beyond its end it is nearest."""
    random = np.random.default_rng(seed)
    shares = random.random((20, 1))
    for start, along in zip(
        5.0 + random.random((200, 3)), random.normal(size=(200, 3)), strict=True
    ):
        segment = Triangles(np.array([[start, start + 1e-2 * along, start + 1e-2 * along]]))
        feet, row, _ = segment.nearest(np.vstack([segment.corners[0], start - shares * along]), 0.0)
        assert row.tolist() == [*range(23)]
        assert feet[:3] == pytest.approx(segment.corners[0], abs=1e-14)
        assert feet[3:] == pytest.approx(np.tile(start, (20, 1)), abs=1e-12)


# Outlines of very many vertices: the same answers as by brute force, in memory that lets one plan.


SCENE = """\
[domain]
length = 8
height = 4
[fluid]
reynolds = 20
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "polygon"
file = "grain.csv"
x = 4
density = 2.65
[bed]
kind = "flat"
[gravity]
acceleration = 1
[contact]
friction = 0.5
"""


def test_an_outline_of_many_points_is_drawn_as_curves_between_its_corners() -> None:
    s = np.linspace(-0.5, 0.5, 500, endpoint=False)
    edge = np.column_stack([s, np.full(500, -0.5)])
    square = np.vstack(
        [edge @ np.array([[c, d], [-d, c]]) for c, d in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    )
    grain = Polygon(square)
    drawn = grain.outline()
    contacts = touching(grain, rest(grain, Flat(), 0.0), Flat(), 1e-9)
    assert contacts.areas == pytest.approx([0.5, 0.5])  # points that line up make a straight side
    assert sorted((round(c.start[0], 9), round(c.start[1], 9)) for c in drawn) == [
        (-0.5, -0.5),
        (-0.5, 0.5),
        (0.5, -0.5),
        (0.5, 0.5),
    ]
    assert len(Polygon(pebble(2000)).outline()) <= 8
    few = Polygon(pebble(40))
    assert all(isinstance(curve, Line) for curve in few.outline()) and len(few.outline()) == 40


@pytest.mark.slow
@pytest.mark.parametrize("settle", [False, True])
def test_an_outline_of_ten_thousand_points_is_planned_without_tables_of_pairs(
    tmp_path: Path, settle: bool
) -> None:
    """A number for every pair of vertices takes 800 MB, and minutes; a coarse outline has about as many cells.

    Measured: 17 MiB.
    """
    np.savetxt(tmp_path / "grain.csv", pebble(10_000), delimiter=",", header="x,y")
    (tmp_path / "scene.toml").write_text(SCENE)
    with allocating_at_most(100.0):
        scene = load(tmp_path / "scene.toml", [f"body.settle={str(settle).lower()}"])
        plan = planned(scene)
    assert scene.body is not None and len(scene.body.vertices) == 10_000  # type: ignore[union-attr]
    assert plan.geometry_order == plan.order == 3
    assert plan.estimate is not None and 500 < plan.estimate.cells < 3000


@pytest.mark.parametrize(
    ("bed", "rows", "words"),
    [
        (
            'kind = "polyline"\nfile = "/dev/zero"',
            "0,0\n1,0\n0,1\n",
            "bed.file: /dev/zero is a pipe or a device; give the name of a CSV",
        ),
        (
            'kind = "flat"',
            "1,0\n" * 100_001,
            "grain.csv has 100001 points; give three or more points, 100000",
        ),
    ],
)
def test_files_of_points_have_a_limit(tmp_path: Path, bed: str, rows: str, words: str) -> None:
    (tmp_path / "grain.csv").write_text(rows)
    (tmp_path / "scene.toml").write_text(SCENE.replace('kind = "flat"', bed))
    assert words in message(lambda: load(tmp_path / "scene.toml"))


def test_files_of_scenes_have_a_limit(tmp_path: Path) -> None:
    with (tmp_path / "large.toml").open("wb") as stream:
        stream.truncate(17 << 20)
    said = message(lambda: load(tmp_path / "large.toml"))
    assert "large.toml: cannot be read (it is larger than 16 MiB); give the name of a scene" in said


# Grains and curves of the plane: Green's theorem, elementary geometry, and every grain by the same questions.


GRAINS = {
    **every_shape.GRAINS,
    "superellipse": Superellipse((0.7, 0.3), 4.0),
    "rounder superellipse": Superellipse((0.5, 0.5), 2.5),
    "star": Star(0.5, (0.1, 0.2, 0.05), (0.0, 0.1)),
    "turned star": Star(0.5, (0.0, 0.0, 0.2 * np.cos(1.0)), (0.0, 0.0, -0.2 * np.sin(1.0))),
    "discs": Discs([(0, 0), (0.7, 0.2), (-0.3, 0.6)], [0.5, 0.3, 0.4]),
}
CROSSED = [*range(700), 701, 700, *range(702, 3000)]
HEXAGON = [(np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)) for k in range(6)]
S = np.linspace(0.0, 1.0, 401)
grains = pytest.mark.parametrize("grain", GRAINS.values(), ids=GRAINS.keys())
CURVES = (
    Line((0.0, 1.0), (2.0, -1.0)),
    Arc((1.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    Arc((0.0, 1.0), (0.0, 0.0), (1.0, 0.0)),
    Arc((2.0, 0.0), (0.0, 0.0), (0.0, 1.0), (2.0, 0.0)),
    Arc((1.0, 0.0), (0.0, 0.0), (0.0, -3.0), (0.0, -3.0)),
    Spline(np.column_stack([S, np.sin(S)])),
    Superellipse((0.5, 0.3), 5.0).outline()[1],
    Star(0.5, (0.0, 0.1)).outline()[2],
)


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: type(curve).__name__)
def test_curves_have_ends_and_tangents_and_move_with_their_points(curve):
    """Also as another rank gets them, by pickling; tangents by differences."""
    assert curve.point([0.0, 1.0]) == pytest.approx(np.array([curve.start, curve.end]), abs=1e-14)
    inner, h = S[1:-1] + 1e-4, 1e-6
    chord = curve.point(inner + h) - curve.point(inner - h)
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    assert curve.tangent(inner) == pytest.approx(chord, abs=1e-7)
    first, second = Placement((0.3, -2.0), 0.7), Placement((-0.5, 0.1), 0.4)
    moved = pickle.loads(pickle.dumps(curve.moved(first).moved(second)))
    there = second.to_scene(first.to_scene(curve.point(S)))
    assert moved.point(S) == pytest.approx(there, abs=1e-14)
    turned = Placement((0.0, 0.0), 1.1).to_scene(curve.tangent(S))
    # Splines have slopes by differences of points 1e-4 apart: round-off over that, at their ends some ten times.
    assert moved.tangent(S) == pytest.approx(turned, abs=1e-10)


@grains
def test_area_centroid_and_polar_moment(grain):
    """Green's theorem along the exact outline, which is closed, Gauss rule on parts of each curve."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    total, h, outline = np.zeros(4), 1e-5, grain.outline()
    for curve, following in zip(outline, (*outline[1:], outline[0]), strict=True):
        assert curve.end == pytest.approx(following.start, abs=1e-14)
        s = ((np.arange(16)[:, None] + 0.5 * (nodes + 1.0)) / 16.0).ravel()
        x, y = curve.point(s).T
        rates = (curve.point(s + h) - curve.point(s - h)) / (2.0 * h)
        dx, dy = rates.T * np.tile(weights, 16) / 32.0
        total[:3] += (x * dy - y * dx).sum() / 2, (x * x * dy).sum() / 2, -(y * y * dx).sum() / 2
        total[3] += ((x**3 * dy - y**3 * dx) / 3.0).sum()
    assert total == pytest.approx([grain.volume, 0.0, 0.0, grain.inertia[2, 2]], abs=1e-8)


@grains
def test_level_normal_and_size(grain):
    """Zero on the outline and a distance across it; the size is the largest distance of two points."""
    s = np.linspace(0.0, 1.0, 101)
    points = np.vstack([curve.point(s) for curve in grain.outline()])
    assert grain.level(points) == pytest.approx(0.0, abs=1e-14)
    apart = np.linalg.norm(points[:, None] - points, axis=2).max()
    assert apart <= grain.size * (1.0 + 1e-12)
    assert apart == pytest.approx(grain.size, rel=1e-3)
    for curve in grain.outline():
        inner, tangents = curve.point(s[1:-1]), curve.tangent(s[1:-1])
        outward = np.column_stack([tangents[:, 1], -tangents[:, 0]])
        assert grain.normal(inner) == pytest.approx(outward, abs=1e-9)
        for step in (1e-3, -1e-3):
            assert grain.level(inner + step * outward) == pytest.approx(step, abs=1e-12)


def test_distances_from_boxes_and_polygons_and_the_bisector_at_corners():
    square, corner = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), [[0.5, -0.5]]
    bisector = np.array([[np.sqrt(0.5), -np.sqrt(0.5)]])
    assert Rectangle(1.0, 1.0).normal(corner) == pytest.approx(bisector)
    assert square.normal(corner) == pytest.approx(bisector)
    arrow = GRAINS["clockwise arrow"]  # inside, nearest to the corner that points inwards
    (notch,) = [x for x in arrow.vertices if np.hypot(*x) < 0.6]
    assert arrow.level([np.add(notch, [0.1, 0.0])]) == pytest.approx(-0.1)


def test_superellipses_and_discs_are_those_of_their_formulae():
    """Two unit discs a distance 1 apart: each loses a segment of 2 pi/3, of area (2 pi/3 - sin(2 pi/3))/2."""
    x, y = np.abs(dense(GRAINS["superellipse"].outline(), 101)).T
    # Measured 1.1e-12 between the points of its splines, which are exact.
    assert (x / 0.7) ** 4 + (y / 0.3) ** 4 == pytest.approx(1.0, abs=1e-11)
    double, segment = Discs([(0, 0), (1, 0)], [1, 1]), np.pi / 3.0 - 0.25 * np.sqrt(3.0)
    assert double.volume == pytest.approx(2.0 * np.pi - 2.0 * segment)
    starts = np.array([curve.start for curve in double.outline()])
    for corner in ((0.0, np.sqrt(0.75)), (0.0, -np.sqrt(0.75))):
        assert np.linalg.norm(starts - corner, axis=1).min() < 1e-12


@pytest.mark.parametrize(
    "grain",
    [
        GRAINS["star"],
        GRAINS["turned star"],
        *(Superellipse((0.5, 0.3), n) for n in (2.5, 6.0, 20.0)),
    ],
)
def test_splines_for_meshes_turn_little(grain):
    """By less than 30 degrees each, so that coarse cells follow blunt corners."""
    for piece in grain.outline():
        first, last = piece.tangent([0.0, 1.0])
        assert np.arccos(np.clip(first @ last, -1.0, 1.0)) < np.radians(30.0)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda _: Polygon([(0, 0), (1, 0), (2, 0)]), "no area"),
        (lambda _: Polygon([(0, 0), (1, 0), (1, 0), (0, 1)]), "twice"),
        (lambda _: Polygon([(0, 0), (1, 1), (1, 0), (0, 1.5)]), "vertices 0 and 2 meet"),
        (lambda _: Polygon(pebble(3000)[CROSSED]), "vertices 699 and 701 meet"),
        (lambda _: Star(1.0, (2.0,)), "-1 at 180 degrees"),
        (lambda _: Discs([(0, 0), (3, 0)], [1, 1]), "number 1 .* does not overlap"),
        (lambda _: Discs([(0, 0), (0.1, 0)], [1, 0.5]), "disc 1 .* lies within"),
        (lambda _: Discs(HEXAGON, [0.55] * 6), "hole"),
        (lambda _: Box((1.0, 1.0, 0.5), 0.3), "edge_radius"),
        (lambda _: Polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]), "no volume"),
        (lambda _: Spheres([(0, 0, 0), (3, 0, 0)], [1, 1]), "does not overlap"),
        (lambda _: Spheres([(0, 0, 0), (0.1, 0, 0)], [1, 0.2]), "sphere 1 .* lies within"),
        (lambda _: Triangulated(CUBE.vertices, MIXED), "face different ways"),
        (lambda _: Triangulated(CUBE.vertices, CUBE.faces + 1), "do not exist"),
        (lambda path: Triangulated.from_file(path / "none.stl"), "No such file or directory"),
        (lambda path: Triangulated.from_file(path / "grain.txt"), "not an STL, PLY or OBJ"),
        (lambda path: Triangulated.from_file(path / "text.stl"), "text.stl"),
    ],
)
def test_bad_grains_and_solids_are_refused_in_one_line(make, reason, tmp_path):
    for name in ("text.stl", "grain.txt"):
        (tmp_path / name).write_text("nothing of the kind")
    assert re.search(reason, message(lambda: make(tmp_path)))


# Grids of rectangles and boxes: what they fill, where cells end, names, and that pressures are determined on them.


NAMES = ("upstream", "downstream", "right", "left", "bottom", "top")
BOX = ((-1.0, 2.0), (0.0, 1.0), (0.5, 1.0))


def grid_of_heights(counts: tuple[int, ...], half: bool = False, parallel: bool = False) -> Grid:
    """A grid of the first axes of a box."""
    ends = tuple(layer_ends(n, 0.3, half and axis == 1) for axis, n in enumerate(counts))
    names = (*NAMES[:2], "symmetry", *NAMES[3:]) if half else NAMES
    return Grid(BOX[: len(counts)], ends, names[: 2 * len(counts)], half, parallel)


def sizes(corners: np.ndarray) -> np.ndarray:
    """Lengths, areas or volumes of simplices (m, k, gdim), by Gram's determinant."""
    sides = corners[:, 1:] - corners[:, :1]
    gram = np.linalg.det(sides @ sides.transpose(0, 2, 1))
    return np.sqrt(gram) / math.factorial(sides.shape[1])


@pytest.mark.parametrize(
    ("counts", "half", "measure", "of_sides"),
    [
        ((4, 3), False, 3.0, [1.0, 1.0, 3.0, 3.0]),
        ((2, 2, 2), False, 1.5, [0.5, 0.5, 1.5, 1.5, 3.0, 3.0]),
        ((4, 3, 5), True, 1.5, [0.5, 0.5, 1.5, 1.5, 3.0, 3.0]),
    ],
)
@pytest.mark.parametrize("parallel", [False, True])
def test_cells_fill_the_box_and_facets_cover_its_sides(counts, half, parallel, measure, of_sides):
    """Volume and sides of the box by hand; every facet has two cells, or one and a name."""
    shape = grid_of_heights(counts, half, parallel)
    made = grid_cells(shape)
    assert len(made.cells) == shape.cells
    corners = made.points[made.cells]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0.0).all()
    assert sizes(corners).sum() == pytest.approx(measure, rel=1e-12)
    result = {name: sizes(made.points[facets]).sum() for name, facets in made.sides.items()}
    assert result == pytest.approx(dict(zip(shape.sides, of_sides, strict=True)), rel=1e-12)
    facets = np.concatenate([np.delete(made.cells, k, axis=1) for k in range(len(counts) + 1)])
    _, shared = np.unique(np.sort(facets, axis=1), axis=0, return_counts=True)
    assert set(shared) == {1, 2}
    assert (shared == 1).sum() == sum(map(len, made.sides.values()))


@pytest.mark.parametrize("half", [False, True])
def test_no_tetrahedron_has_all_of_its_corners_on_walls(half):
    made = grid_cells(grid_of_heights((4, 3, 5), half))
    on_walls = np.zeros(len(made.points), dtype=bool)
    for name, triangles in made.sides.items():
        on_walls[triangles] = on_walls[triangles] | (name != "symmetry")
    assert not on_walls[made.cells].all(axis=1).any()


@pytest.mark.parametrize("grading", [1.0, 0.2, 0.05])
def test_cells_are_graded_towards_both_ends(grading):
    """Spacing at the ends over that in the middle, of so many cells that it is that at a point; symmetric."""
    spacing = np.diff([0.0, *graded_ends(2001, grading)])
    assert spacing.sum() == pytest.approx(1.0) and spacing == pytest.approx(spacing[::-1], rel=1e-6)
    assert spacing[0] / spacing[1000] == pytest.approx(grading, rel=0.02)


@pytest.mark.parametrize(
    ("grain", "axis"),
    [
        (Box((1.0, 2.0, 1.0), 0.5), [0.0, 1.0, 0.0]),  # a capsule
        (Box((1.0, 2.0, 1.0), 0.3), None),
        (Superquadric((0.6, 0.3, 0.3), (2.0, 2.0)), [1.0, 0.0, 0.0]),
        (Superquadric((1.0, 1.0, 0.5), (4.0, 4.0)), None),
        (Spheres(centres=[(0.0, 0.0, 0.0), (0.0, 0.0, 0.5)], radii=[0.5, 0.4]), [0.0, 0.0, 1.0]),
        (SOLIDS["ellipsoid"], None),
    ],
)
def test_an_axis_of_revolution_is_found_where_there_is_one(grain: Any, axis: Any) -> None:
    result = grain.axis_of_revolution()
    assert result is None if axis is None else result.tolist() == axis
