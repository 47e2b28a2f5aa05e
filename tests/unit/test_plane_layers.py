"""Layers of thin triangles along walls in the plane: they fill the region, are as thick as asked, and fold nowhere."""

import numpy as np
import pytest
from mpi4py import MPI

from incipient.errors import MeshError
from incipient.geometry.plane.curves import Arc, Line, Spline
from incipient.mesh.domain import build
from incipient.mesh.wall_distance import cells_at, distances
from incipient.meshes import Near, Region, Sizes, WallLayers
from incipient.meshes.layered_model import layered_model

FIRST = 1e-3


def meshed(region, walls=("bed",), order=2, factor=1.0, near=()):
    layers = WallLayers(dict.fromkeys(walls, FIRST), 80, 1.3, graded=True)
    along = tuple(Near(0.1, 0.3, boundary=name) for name in walls)
    sizes = Sizes(0.4, (*along, *near), layers=layers).scaled(factor)
    return build(MPI.COMM_SELF, lambda: layered_model(region, sizes, order), 2)


def step():
    """A channel three high behind a step of one, with a lower wall and a lid."""
    places = [(-2.0, 1.0), (0.0, 1.0), (0.0, 0.0), (4.0, 0.0)]
    return Region(tuple(map(Line, places[:-1], places[1:])), 3.0)


def circle(x, y, radius):
    places = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    return tuple(Arc(a, (x, y), b) for a, b in zip(places, places[1:] + places[:1], strict=True))


def area(domain):
    import dolfinx
    import ufl

    form = dolfinx.fem.form(1.0 * ufl.dx(domain=domain.mesh, degree=4))
    return dolfinx.fem.assemble_scalar(form)


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_layers_go_around_both_corners_of_a_step(factor):
    """The area is that of the region (exact), and cells at walls are as thick as asked but in the corner."""
    domain = meshed(step(), order=1, factor=factor)
    assert area(domain) == pytest.approx(2.0 * 2.0 + 4.0 * 3.0, rel=1e-12)
    places = domain.mesh.geometry.x[:, :2]
    away = distances(domain, ("bed",), places)
    cells = domain.mesh.geometry.dofmap.array.reshape(-1, 3)
    near = np.unique(cells[cells_at(domain, ("bed",))])
    ends = away[near][away[near] > 1e-12]
    assert ends == pytest.approx(factor * FIRST, rel=0.5)
    assert (np.abs(ends / (factor * FIRST) - 1.0) < 0.02).mean() > 0.8
    # Around the upper corner they are as thick.
    around = near[np.linalg.norm(places[near] - [0.0, 1.0], axis=1) < 1.5 * factor * FIRST]
    assert len(around) >= 5


def test_cells_follow_curved_walls():
    """A disc above a wavy bed, nearly touching it: the area less than 1e-5 from the exact one, folding nowhere."""
    x = np.linspace(0.0, 4.0, 65)
    bed = Spline(np.column_stack([x, 0.05 * np.sin(2.0 * np.pi * x)]))
    disc = circle(1.75, 0.48, 0.5)  # 0.03 above the trough
    pocket = Near(0.015, 0.2, points=((1.75, -0.05), (1.75, -0.02)))
    region = Region((bed,), 2.0, {"body": disc})
    domain = meshed(region, ("bed", "body"), near=(pocket,))
    assert area(domain) == pytest.approx(8.0 - 0.25 * np.pi, rel=1e-5)
    nodes = domain.mesh.geometry.x[:, :2]
    on_disc = np.abs(np.linalg.norm(nodes - [1.75, 0.48], axis=1) - 0.5) < 1e-4
    assert on_disc.sum() > 60  # corners and middles of edges
    away = distances(domain, ("bed", "body"), nodes)
    thick = away[(away > 1e-9)]
    assert thick.min() < 1.01 * FIRST


def test_thinner_layers_grow_less():
    """Half as large cells are everywhere half as large: 4 times as many, to a tenth."""
    number = [
        meshed(step(), order=1, factor=factor).mesh.topology.index_map(2).size_global
        for factor in (1.0, 0.5)
    ]
    assert number[1] / number[0] == pytest.approx(4.0, rel=0.1)


def test_cells_of_order_three_are_refused():
    with pytest.raises(MeshError, match="geometry_order"):
        meshed(step(), order=3)
