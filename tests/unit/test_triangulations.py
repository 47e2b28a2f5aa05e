"""Triangulated surfaces: remeshing, nearest points, distances and sides, of many triangles and of a few."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from allocated import allocated
from scipy.spatial import cKDTree

from incipient.geometry import Plane, Triangulated, rest
from incipient.geometry.closest import touching
from incipient.geometry.space.remeshing import Draft, ExactSurface, Topology, remeshed, summed
from incipient.geometry.space.surfaces import (
    Surface,
    Triangles,
    box,
    grid,
    nearest_on_triangles,
    sphere,
    vector_areas,
)
from incipient.meshes.surfaces import on_level

BRICK = box(np.array([1.0, 0.8, 0.5]), 0.07)


@pytest.mark.parametrize(
    "triangles", [grid(np.arange(4.0), np.arange(3.0))[1], sphere(3).triangles]
)
def test_edges_and_what_lies_beside_them(triangles: np.ndarray) -> None:
    """By a dictionary of edges, on an open and on a closed surface."""
    beside: dict[tuple[int, int], list[int]] = {}
    for number, corners in enumerate(triangles.tolist()):
        for a, b in pairwise([*corners, corners[0]]):
            beside.setdefault((min(a, b), max(a, b)), []).append(number)
    found = Topology(triangles)
    assert [tuple(edge) for edge in found.edges.tolist()] == sorted(beside)
    for edge, pair, across, is_open in zip(
        found.edges.tolist(),
        found.beside.tolist(),
        found.opposite.tolist(),
        found.open,
        strict=True,
    ):
        known = beside[edge[0], edge[1]]
        assert sorted(pair) == sorted([*known, -1][:2])
        assert is_open == (len(known) == 1)
        for triangle, corner in zip(pair, across, strict=True):
            assert (
                corner == -1 if triangle < 0 else {*edge, corner} == {*triangles[triangle].tolist()}
            )
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
    assert np.array_equal(found.edges[found.of_sides], ends)


def test_no_triangles_have_no_edges() -> None:
    found = Topology(np.empty((0, 3), dtype=int))
    assert (
        found.edges.shape == (0, 2)
        and found.beside.shape == (0, 2)
        and found.of_sides.shape == (0, 3)
    )


class Polyhedral(ExactSurface):
    """A closed surface of triangles, in a unit in which its extent is one; sharp edges stay."""

    def __init__(self, surface: Surface):
        low, extent = surface.points.min(axis=0), float(np.ptp(surface.points, axis=0).max())
        self.surface = Surface((surface.points - low) / extent, surface.triangles)
        self.faces, self.extent = Triangles(self.surface.corners), extent

    def draft(self) -> Draft:
        free = np.zeros(self.surface.points.shape, dtype=bool)
        return Draft(self.surface, free, sharp=True)

    def project(self, x: np.ndarray, held: np.ndarray) -> np.ndarray:
        return self.faces.nearest(x, 0.0)[0]


def coarser(surface: Surface, factor: float) -> Surface:
    """The surface with edges `factor` times as long as the eight nearest to each place on average."""
    exact = Polyhedral(surface)
    corners = exact.surface.corners
    following = np.roll(corners, -1, axis=1)
    lengths = np.linalg.norm(following - corners, axis=2).ravel()
    tree = cKDTree((0.5 * (corners + following)).reshape(-1, 3))

    def size(x: np.ndarray) -> np.ndarray:
        return np.asarray(factor * lengths[tree.query(x, k=8)[1]].mean(axis=1))

    made = remeshed(exact, exact.draft(), size)
    return Surface(exact.extent * made.points, made.triangles)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("surface", "factor", "points", "triangles", "area"),
    [
        pytest.param(sphere(20), 3.0, 474, 944, 12.470677779799, id="sphere"),
        pytest.param(BRICK, 1.5, 1427, 2850, 13.600000000559, id="brick"),
        pytest.param(BRICK, 3.0, 325, 646, 13.600000000559, id="coarse brick"),
    ],
)
def test_surfaces_anew_are_what_they_were(
    surface: Surface, factor: float, points: int, triangles: int, area: float
) -> None:
    """Numbers of the program before its operations on edges were made quicker: meshes must not move."""
    made = coarser(surface, factor)
    assert (len(made.points), len(made.triangles)) == (points, triangles)
    assert np.linalg.norm(vector_areas(made.corners), axis=1).sum() == pytest.approx(
        area, rel=1e-11
    )


def test_points_come_onto_a_level_where_held_coordinates_stay() -> None:
    """Onto the unit sphere, quadratically, by two questions a step; the level's slope is taken by differences."""
    x = np.array([[1.1, 0.2, 0.0], [0.0, -0.9, 0.3], [0.4, 0.5, 0.8]])
    held = np.array([[False] * 3, [False] * 3, [False, True, False]])
    asked = []

    def level(points: np.ndarray) -> np.ndarray:
        asked.append(len(points))
        return np.linalg.norm(points, axis=1) - 1.0

    found = on_level(level, x, held, 1.0)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(3), abs=1e-12)
    assert found[2, 1] == x[2, 1]
    assert len(asked) <= 2 * 5 + 1 and asked[1] == 6 * asked[0]


def scanned(frequency: int) -> Triangulated:
    """A rough pebble of 20 frequency^2 triangles."""
    ball = sphere(frequency)
    x, y, z = ball.points.T
    radius = 0.5 + 0.025 * np.sin(3.0 * x + 1.0) * np.cos(4.0 * y) + 0.015 * np.sin(7.0 * z)
    return Triangulated(ball.points * radius[:, None], ball.triangles)


def by_all(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distances (n,) by looking at all pairs."""
    away = nearest_on_triangles(points[:, None], corners) - points[:, None]
    return np.linalg.norm(away, axis=2).min(axis=1)


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
    assert np.abs(grain.level(points)) == pytest.approx(by_all(points, corners), abs=1e-15)
    shares = np.linalg.inv(corners.transpose(0, 2, 1)) @ points.T
    inside = ((shares.sum(axis=1) < 1.0) | (shares < 0.0).any(axis=1)).all(axis=0)
    assert ((grain.level(points) < 0.0) == inside).all()
    assert inside.any() and not inside.all()


def test_sides_are_told_where_the_nearest_point_is_a_corner_or_an_edge():
    """Points on the normals of a sphere's corners, edges and faces are within it or outside, by construction."""
    ball = sphere(3)
    grain = Triangulated(ball.points, ball.triangles)
    edges = ball.points[ball.edges].mean(axis=1)
    for target in (*ball.points[:20], *edges[:20], *ball.corners.mean(axis=1)[:20]):
        points = np.outer([0.5, 0.9, 1.1, 3.0], target)
        assert np.sign(grain.level(points)).tolist() == [-1.0, -1.0, 1.0, 1.0]


def test_a_scanned_grain_of_many_triangles_rests_without_tables_of_pairs():
    """A number for every pair of vertex and triangle takes 4 GB, and minutes. Measured: 30 MiB."""
    with allocated() as most:
        grain = scanned(40)
        assert len(grain.triangles) == 32_000
        placement = rest(grain, Plane(), (0.07, 0.13))
        contacts = touching(grain, placement, Plane(), 1e-9)
    assert most() < 200.0
    points = placement.to_body(contacts.points)
    assert np.abs(grain.level(points)).max() < 1e-12
    # Triangles are 0.02 wide and turn by that over a radius of 0.5: 0.04, whose cosine is 0.9992.
    assert grain.normal(points)[:, 2] == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_point_at_the_corner_of_a_segment_is_found(seed):
    """As far from the middle as the segment reaches: one ulp used to lose some of these, or all."""
    starts = 5.0 + np.random.default_rng(seed).random((200, 3))
    ends = starts + np.random.default_rng(seed + 2).normal(size=(200, 3)) * 1e-2
    segments = Triangles(np.stack([starts, ends, ends], axis=1))
    feet, row, _ = segments.nearest(np.concatenate([starts, ends]), 0.0)
    assert np.array_equal(np.unique(row), np.arange(400))
    assert feet == pytest.approx(np.concatenate([starts, ends]), abs=1e-14)
    # One segment alone has no other to be found in its place; straight beyond its end the end is nearest.
    shares = np.random.default_rng(seed + 4).random((20, 1))
    for segment in segments.corners:
        assert len(Triangles(segment[None]).nearest(segment, 0.0)[0]) == 3
        beyond = segment[0] - shares * (segment[1] - segment[0])
        feet, row, _ = Triangles(segment[None]).nearest(beyond, 0.0)
        assert row.tolist() == [*range(20)]
        assert feet == pytest.approx(np.tile(segment[0], (20, 1)), abs=1e-12)


def test_sums_by_number() -> None:
    """By hand, of rows and of single values; what nothing is added to is zero."""
    of, values = np.array([2, 0, 2, 2]), np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [0.1, 0.2]])
    rows = [[3.0, 4.0], [0.0, 0.0], [6.1, 8.2], [0.0, 0.0]]
    assert summed(of, values, 4) == pytest.approx(np.array(rows), rel=1e-15)
    assert summed(of, values[:, 0], 4) == pytest.approx([3.0, 0.0, 6.1, 0.0], rel=1e-15)
