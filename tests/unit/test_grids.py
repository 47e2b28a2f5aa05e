"""Grids of rectangles and boxes: what they fill, where cells end, names, and that pressures are determined on them."""

import math

import numpy as np
import pytest
from domains import rectangle

import incipient
from incipient.mesh.sampling import sample
from incipient.meshes import Grid, graded_ends
from incipient.meshes.grids import grid_cells
from incipient.meshes.model import meshed
from incipient.planning.cells import layer_ends
from incipient.scene import Domain, Fluid, Lid, Numerics, Scene

NAMES = ("upstream", "downstream", "right", "left", "bottom", "top")
BOX = ((-1.0, 2.0), (0.0, 1.0), (0.5, 1.0))


def grid(counts: tuple[int, ...], half: bool = False, parallel: bool = False) -> Grid:
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
    shape = grid(counts, half, parallel)
    made = grid_cells(shape)
    assert len(made.cells) == shape.cells
    corners = made.points[made.cells]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0.0).all()
    assert sizes(corners).sum() == pytest.approx(measure, rel=1e-12)
    found = {name: sizes(made.points[facets]).sum() for name, facets in made.sides.items()}
    assert found == pytest.approx(dict(zip(shape.sides, of_sides, strict=True)), rel=1e-12)
    facets = np.concatenate([np.delete(made.cells, k, axis=1) for k in range(len(counts) + 1)])
    _, shared = np.unique(np.sort(facets, axis=1), axis=0, return_counts=True)
    assert set(shared) == {1, 2}
    assert (shared == 1).sum() == sum(map(len, made.sides.values()))


@pytest.mark.parametrize("half", [False, True])
def test_no_tetrahedron_has_all_of_its_corners_on_walls(half):
    made = grid_cells(grid((4, 3, 5), half))
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


def test_cells_end_where_they_are_told_to():
    columns, rows = (0.2, 0.3, 0.6, 1.0), (0.1, 1.0)
    made = grid_cells(Grid(((1.0, 3.0), (0.0, 1.0)), (columns, rows), NAMES[:2] + NAMES[4:]))
    for name in NAMES[4:]:
        abscissae = np.unique(made.points[made.sides[name]][..., 0])
        assert abscissae == pytest.approx((1.0, 1.4, 1.6, 2.2, 3.0))
    for name in NAMES[:2]:
        assert np.unique(made.points[made.sides[name]][..., 1]) == pytest.approx((0.0, *rows))


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_grid_has_cells_of_an_order(order):
    """3 by 2 rectangles with `order` nodes along each of their sides, in facets of the same order."""
    mesh = meshed(rectangle((1.0, -1.0), 2.0, 1.0, 3, 2), order=order)
    assert len(mesh.points) == (3 * order + 1) * (2 * order + 1)
    assert sorted(mesh.sides) == ["bottom", "left", "right", "top"]
    right = np.unique(mesh.sides["right"])
    assert len(right) == 2 * order + 1
    assert mesh.points[right, 0] == pytest.approx(np.full(len(right), 3.0))


def cube(symmetric: bool) -> Scene:
    """A lid-driven cube on few cells, whole or halved."""
    return Scene(
        domain=Domain(kind="box", length=1.0, width=1.0, height=1.0, symmetric=symmetric),
        fluid=Fluid(reynolds=20.0, scale="flow"),
        flow=Lid(),
        numerics=Numerics(order=2, mesh_size=4.0, tolerance=1e-12, error_bars=False),
    )


def test_half_a_box_has_the_flow_of_the_whole():
    half, whole = (incipient.run(cube(symmetric)) for symmetric in (True, False))
    assert 2 * half.cost["cells"] == whole.cost["cells"]
    points = np.array([[0.3, 0.7, 0.8], [0.6, 0.9, 0.2], [0.5, 0.5, 0.5]])
    mirrored = points * [1.0, -1.0, 1.0] + [0.0, 1.0, 0.0]
    velocity = sample(whole.velocity, points)
    assert np.abs(velocity).max() > 0.05
    assert sample(half.velocity, points) == pytest.approx(velocity, abs=1e-8)
    assert sample(whole.velocity, mirrored) * [1.0, -1.0, 1.0] == pytest.approx(velocity, abs=1e-8)
    for name, extreme in whole.centrelines.items():
        assert half.centrelines[name].value == pytest.approx(extreme.value, abs=1e-8), name
