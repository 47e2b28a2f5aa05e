"""Triangulations of surfaces: their edges against a count by hand, and anew as they have always been made."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from incipient.geometry.coarser import coarser_surface
from incipient.geometry.space.surfaces import Surface, box, grid, sphere, vector_areas
from incipient.geometry.space.topology import Topology, summed
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


def test_sums_are_those_of_one_after_another() -> None:
    of, values = np.array([2, 0, 2, 2]), np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [0.1, 0.2]])
    assert summed(of, values, 4).tolist() == [
        [3.0, 4.0],
        [0.0, 0.0],
        [1.0 + 5.0 + 0.1, 2.0 + 6.0 + 0.2],
        [0.0, 0.0],
    ]
    assert summed(of, values[:, 0], 4).tolist() == [3.0, 0.0, 6.1, 0.0]


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
    made = coarser_surface(surface, factor)
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
