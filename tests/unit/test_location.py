"""Cells that hold points, cells nearest to points outside, straight and curved."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import pytest
from domains import bent_box, curved_box, ring, square_in_box, unit_box

from incipient import compat
from incipient.mesh.sampling import Locator, evaluate


def places_again(mesh: Any, places: Any) -> Any:
    """Where the places found are in space."""
    space = compat.function_space(mesh, compat.coordinate_element(mesh))
    identity = dolfinx.fem.Function(space)
    nodes = identity.x.array.reshape(-1, mesh.geometry.dim)
    nodes[compat.cell_dofs(space)] = mesh.geometry.x[
        compat.geometry_dofs(mesh), : mesh.geometry.dim
    ]
    return evaluate(identity, places)


def test_cells_hold_their_points() -> None:
    """Outside and inside the hole there is none."""
    mesh = square_in_box(0.3, 0.2).mesh
    points = np.array([[0.1, 0.1], [1.9, 0.9], [0.8, 0.55], [3.0, 0.5]])
    places = Locator(mesh).inside(points)
    assert places.found.tolist() == [True, True, False, False]
    assert places.distances.tolist() == [0.0, 0.0, np.inf, np.inf]
    assert places.reference[:2].min() > 0.0
    assert places_again(mesh, places.at(places.found)) == pytest.approx(points[:2], abs=1e-12)


@pytest.mark.parametrize("order", [2, 3])
def test_points_between_a_curved_side_and_its_chord(order: int) -> None:
    """They have a cell too; the square is bent by d = (0.2 y^2, 0.3 x y)."""
    mesh = curved_box(2, 2, order).mesh
    x, y = mesh.geometry.x[:, :2].T.copy()
    mesh.geometry.x[:, :2] = np.column_stack([x + 0.2 * y**2, y + 0.3 * x * y])
    s = np.linspace(0.01, 0.99, 23)
    left = np.column_stack([0.2 * s**2 + 1e-6, s])
    right = np.column_stack([1 + 0.2 * s**2 - 1e-6, 1.3 * s])
    away = np.array([[2e-6, 0.0]])
    locator = Locator(mesh)
    assert locator.inside(np.vstack([left, right])).found.all()
    assert not locator.inside(np.vstack([left - away, right + away])).found.any()


@pytest.mark.parametrize(("gdim", "order"), [(2, 1), (2, 2), (2, 3), (3, 1), (3, 2)])
def test_reference_coordinates_map_back(gdim: int, order: int) -> None:
    """Of points in all cells of a bent box, whether or not the straight cells hold them."""
    mesh = bent_box(gdim, 3, order) if order > 1 else unit_box(gdim, 3).mesh
    inner = np.random.default_rng(2).dirichlet(np.ones(gdim + 1), 400)[:, 1:]
    cells = np.resize(np.arange(mesh.topology.index_map(gdim).size_local), 400)
    points = Locator(mesh).mapped(inner, cells)
    places = Locator(mesh).inside(points)
    assert (places.cells == cells).all()
    assert places.reference == pytest.approx(inner, abs=1e-10)
    assert places_again(mesh, places) == pytest.approx(points, abs=1e-12)


@pytest.mark.parametrize("gdim", [2, 3])
def test_points_on_sides_and_corners_are_inside(gdim: int) -> None:
    mesh = unit_box(gdim, 3).mesh
    assert Locator(mesh).inside(mesh.geometry.x).found.all()


def test_cells_of_very_different_sizes() -> None:
    """A mesh squeezed towards a side: the widest cell is 10^4 times the thinnest."""
    mesh = unit_box(2, 20).mesh
    mesh.geometry.x[:, 1] **= 4
    points = np.random.default_rng(3).random((500, 2))
    points[:, 1] **= 4
    places = Locator(mesh).inside(points)
    assert places_again(mesh, places) == pytest.approx(points, abs=1e-12)


def test_the_mesh_where_it_is_now() -> None:
    mesh = unit_box(2, 3).mesh
    before = Locator(mesh)
    mesh.geometry.x[:, 0] += 2.0
    point = np.array([[2.5, 0.5]])
    assert not before.inside(point).found[0]
    assert Locator(mesh).inside(point).found[0]


@pytest.mark.parametrize("gdim", [2, 3])
def test_distance_outside_a_corner(gdim: int) -> None:
    """The nearest point of the box is its corner."""
    nearest = Locator(unit_box(gdim, 4).mesh).nearest(np.full((1, gdim), 1.1))
    assert nearest.distances == pytest.approx(0.1 * np.sqrt(gdim), rel=1e-12)
    assert nearest.found.all()


@pytest.mark.parametrize("gdim", [2, 3])
def test_distance_outside_a_side(gdim: int) -> None:
    """The side is nearest, however skew the cells behind it."""
    mesh = unit_box(gdim, 4).mesh
    mesh.geometry.x[:, 1] += 0.8 * mesh.geometry.x[:, 0]
    points = np.random.default_rng(4).random((200, gdim))
    points[:, 0] = -np.linspace(1e-3, 0.3, 200)
    nearest = Locator(mesh).nearest(points)
    assert places_again(mesh, nearest) == pytest.approx(points, abs=1e-12)
    assert nearest.distances == pytest.approx(-points[:, 0], rel=1e-9)


@pytest.mark.parametrize("order", [2, 3])
def test_distance_inside_a_round_hole(order: int) -> None:
    """The hole of radius 1/2 seen from within: the distance is that to the circle."""
    angles = np.linspace(0.0, 6.0, 50)
    points = 0.45 * np.column_stack([np.cos(angles), np.sin(angles)])
    mesh = ring(0.5, 1.0, 24, order).mesh
    nearest = Locator(mesh).nearest(points)
    assert nearest.distances == pytest.approx(0.05, rel=0.02)
    assert places_again(mesh, nearest) == pytest.approx(points, abs=1e-10)


def test_something_is_found_however_far() -> None:
    """Straight cells go on for ever; the map of a curved one may have no inverse there, then a near point counts."""
    for mesh in (unit_box(2, 3).mesh, bent_box(2, 3, 2)):
        nearest = Locator(mesh).nearest(np.array([[30.0, -40.0], [0.0, 1000.0]]))
        assert nearest.found.all()
        assert np.isfinite(nearest.reference).all()
        assert nearest.distances == pytest.approx([49.4, 999.0], rel=0.01)


def test_no_points() -> None:
    locator = Locator(unit_box(2, 2).mesh)
    for places in (locator.inside(np.empty((0, 2))), locator.nearest(np.empty((0, 2)))):
        assert places.reference.shape == (0, 2)


def test_a_flat_cell_holds_nothing() -> None:
    """Nor does it stop the search; the rest of the mesh is found."""
    mesh = unit_box(2, 2).mesh
    cell = compat.geometry_dofs(mesh)[0]
    corners = [tuple(mesh.geometry.x[k]) for k in cell]
    middle = np.mean(corners, axis=0)
    mesh.geometry.x[cell[0]] = mesh.geometry.x[cell[1:]].mean(axis=0)
    places = Locator(mesh).inside(np.vstack([middle, mesh.geometry.x]))
    assert 0 not in places.cells


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("gdim", [2, 3])
def test_values_are_the_librarys(gdim: int, order: int) -> None:
    """Random coefficients, so that every node counts, in cells turned in all ways."""
    mesh = bent_box(gdim, 2, 2)
    function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", order), (gdim,)))
    random = np.random.default_rng(5)
    function.x.array[:] = random.standard_normal(len(function.x.array))
    inner = random.dirichlet(np.ones(gdim + 1), 100)[:, 1:]
    points = Locator(mesh).mapped(
        inner, np.resize(np.arange(mesh.topology.index_map(gdim).size_local), 100)
    )
    places = Locator(mesh).inside(points)
    spatial = np.pad(points, ((0, 0), (0, 3 - gdim)))
    expected = function.eval(spatial, places.cells.astype(np.int32))
    assert evaluate(function, places) == pytest.approx(expected, abs=1e-8)
