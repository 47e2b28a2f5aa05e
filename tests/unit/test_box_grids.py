"""Grids of boxes in space: what they fill, what they are called, and that pressures are determined on them."""

import numpy as np
import pytest

import incipient
from incipient.mesh.sampling import sample
from incipient.meshes import BoxGrid
from incipient.meshes.box import cut
from incipient.planning.cells import layer_ends
from incipient.scene import Domain, Fluid, Lid, Numerics, Scene

NAMES = ("upstream", "downstream", "right", "left", "bottom", "top")


def grid(counts: tuple[int, int, int], half: bool = False) -> BoxGrid:
    extents = ((-1.0, 2.0), (0.0, 1.0), (0.5, 1.0))
    ends = tuple(layer_ends(n, 0.3, half and axis == 1) for axis, n in enumerate(counts))
    names = (*NAMES[:2], "symmetry", *NAMES[3:]) if half else NAMES
    return BoxGrid(extents, ends, names, half)


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("counts", [(2, 2, 2), (4, 3, 5)])
def test_cells_fill_the_box_and_triangles_cover_its_sides(counts, half):
    made = cut(grid(counts, half))
    corners = made.points[made.cells]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(1.5, rel=1e-12)
    areas = {}
    for name, triangles in made.sides.items():
        a, b, c = made.points[triangles].transpose(1, 0, 2)
        areas[name] = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert list(areas) == ["upstream", "downstream", "symmetry" if half else "right", *NAMES[3:]]
    assert list(areas.values()) == pytest.approx([0.5, 0.5, 1.5, 1.5, 3.0, 3.0], rel=1e-12)


@pytest.mark.parametrize("half", [False, True])
def test_faces_fit_and_no_cell_has_all_of_its_corners_on_walls(half):
    made = cut(grid((4, 3, 5), half))
    on_walls = np.zeros(len(made.points), dtype=bool)
    for name, triangles in made.sides.items():
        on_walls[triangles] = on_walls[triangles] | (name != "symmetry")
    assert not on_walls[made.cells].all(axis=1).any()
    faces = np.sort(np.concatenate([np.delete(made.cells, k, axis=1) for k in range(4)]), axis=1)
    _, shared = np.unique(faces, axis=0, return_counts=True)
    assert set(shared) == {1, 2}
    assert (shared == 1).sum() == sum(map(len, made.sides.values()))


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
