"""Layers of thin cells along walls: they fill the region, are as thick as asked, and fold nowhere; 2-D, then 3-D."""

import numpy as np
import pytest
from mpi4py import MPI
from tetrahedra import area, cells, faces, grain_above, volume

from incipient import compat, make_plan
from incipient.errors import MeshError
from incipient.geometry import Ellipsoid, Sphere
from incipient.geometry.plane.curves import Arc, Line, Spline
from incipient.mesh.domain import build
from incipient.mesh.wall_distance import distances
from incipient.meshes import Near, Region, Sizes, WallLayers
from incipient.meshes.expected import expected_cells
from incipient.meshes.layers import evened, stacked
from incipient.meshes.model import meshed
from incipient.meshes.simplices import jacobian_lower_bound
from incipient.planning.flow_setup import Setup
from incipient.planning.meshing import lay_out
from incipient.scene import (
    Contact,
    Domain,
    Effects,
    Fluid,
    Gravity,
    Numerics,
    OpenChannel,
    Scene,
    SphereBed,
    Turbulence,
)
from incipient.scene import Sphere as SphereGrain


def test_cells_between_columns_fill_the_prism_and_have_one_sense():
    """Two layers on a triangle, of which one column has one: 0.5 (1 + 1 + 0.5) (2/3) and all positive, by hand."""
    points = np.array([[x, y, z] for z in range(3) for x, y in ((0, 0), (1, 0), (0, 1))], float)
    rows = np.array([[[0, 3, 6], [1, 4, 7], [2, 5, 5]]])
    cells = stacked(rows)
    volumes = np.linalg.det(points[cells][:, 1:] - points[cells][:, :1]) / 6.0
    assert len(cells) == 5 and (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(0.5 * (2.0 + 2.0 + 1.0) / 3.0)
    triangles = stacked(np.array([[[0, 6, 7], [1, 4, 4]]]))
    assert {*map(tuple, triangles.tolist())} == {(0, 1, 4), (0, 4, 6), (6, 4, 7)}


def test_thickness_is_evened_along_chains_of_links():
    """From 0 at one end of a chain it rises by the slack of each link, whatever the order of these."""
    links = np.array([[3, 2], [0, 1], [1, 2]])
    assert evened(
        np.array([0.0, 9.0, 9.0, 0.5]), links, np.array([1.0, 0.1, 0.3])
    ) == pytest.approx([0.0, 0.1, 0.4, 0.5])


# -- 2-D ----------------------------------------------------------------------------------------

THIN = 1e-3


def meshed_in_plane(region, walls=("bed",), order=2, factor=1.0, near=()):
    layers = WallLayers(dict.fromkeys(walls, THIN), 80, 1.3, graded=True)
    along = tuple(Near(0.1, 0.3, boundary=name) for name in walls)
    sizes = Sizes(0.4, (*along, *near), layers=layers).scaled(factor)
    return build(MPI.COMM_SELF, lambda: meshed(region, sizes, order))


def step():
    """A channel three high behind a step of one, with a lower wall and a lid."""
    places = [(-2.0, 1.0), (0.0, 1.0), (0.0, 0.0), (4.0, 0.0)]
    return Region(tuple(map(Line, places[:-1], places[1:])), 3.0)


def circle(x, y, radius):
    places = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    return tuple(Arc(a, (x, y), b) for a, b in zip(places, places[1:] + places[:1], strict=True))


def cells_at(domain, walls):
    """Cells that have a corner on one of the named walls, of one rank."""
    corners = compat.space(domain.mesh, ("Lagrange", 1))
    facets = np.unique(np.concatenate([domain.facets_of(name) for name in walls]))
    on_wall = np.zeros(len(corners.tabulate_dof_coordinates()), dtype=bool)
    on_wall[compat.nodes_on(corners, facets)] = True
    return np.flatnonzero(on_wall[compat.cell_dofs(corners)].any(axis=1))


def area_of(domain):
    import dolfinx
    import ufl

    form = dolfinx.fem.form(1.0 * ufl.dx(domain=domain.mesh, degree=4))
    return dolfinx.fem.assemble_scalar(form)


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_layers_go_around_both_corners_of_a_step(factor):
    """The area is that of the region (exact), and cells at walls are as thick as asked but in the corner."""
    domain = meshed_in_plane(step(), order=1, factor=factor)
    assert area_of(domain) == pytest.approx(2.0 * 2.0 + 4.0 * 3.0, rel=1e-12)
    places = domain.mesh.geometry.x[:, :2]
    away = distances(domain, ("bed",), places)
    cells = domain.mesh.geometry.dofmap.array.reshape(-1, 3)
    near = np.unique(cells[cells_at(domain, ("bed",))])
    ends = away[near][away[near] > 1e-12]
    assert ends == pytest.approx(factor * THIN, rel=0.5)
    assert (np.abs(ends / (factor * THIN) - 1.0) < 0.02).mean() > 0.8
    # Around the upper corner they are as thick.
    around = near[np.linalg.norm(places[near] - [0.0, 1.0], axis=1) < 1.5 * factor * THIN]
    assert len(around) >= 5


def test_cells_follow_curved_walls():
    """A disc above a wavy bed, nearly touching it: the area less than 1e-5 from the exact one, folding nowhere."""
    x = np.linspace(0.0, 4.0, 65)
    bed = Spline(np.column_stack([x, 0.05 * np.sin(2.0 * np.pi * x)]))
    disc = circle(1.75, 0.48, 0.5)  # 0.03 above the trough
    pocket = Near(0.015, 0.2, points=((1.75, -0.05), (1.75, -0.02)))
    region = Region((bed,), 2.0, {"body": disc})
    domain = meshed_in_plane(region, ("bed", "body"), near=(pocket,))
    assert area_of(domain) == pytest.approx(8.0 - 0.25 * np.pi, rel=1e-5)
    nodes = domain.mesh.geometry.x[:, :2]
    on_disc = np.abs(np.linalg.norm(nodes - [1.75, 0.48], axis=1) - 0.5) < 1e-4
    assert on_disc.sum() > 60  # corners and middles of edges
    away = distances(domain, ("bed", "body"), nodes)
    thick = away[(away > 1e-9)]
    assert thick.min() < 1.01 * THIN


def test_thinner_layers_grow_less():
    """Half as large cells are everywhere half as large: 4 times as many, to a tenth."""
    number = [
        meshed_in_plane(step(), order=1, factor=factor).mesh.topology.index_map(2).size_global
        for factor in (1.0, 0.5)
    ]
    assert number[1] / number[0] == pytest.approx(4.0, rel=0.1)


def test_cells_of_order_three_are_refused():
    with pytest.raises(MeshError, match="geometry_order"):
        meshed_in_plane(step(), order=3)


# -- 3-D ----------------------------------------------------------------------------------------

FIRST = {"bed": 0.02, "body": 0.01}


def sizes(layers=None):
    """Cells of 0.2 at a sphere of diameter one, and of 0.4 along the bed."""
    near = (Near(0.2, 0.4, boundary="body"), Near(0.4, 0.4, boundary="bed"))
    return Sizes(1.0, near, gap_part=0.8, layers=layers)


@pytest.mark.parametrize("symmetric", [False, True])
def test_layers_leave_the_region_as_it_is(symmetric):
    """Volume and areas are exact to what curved cells miss; no cell folds over."""
    region, _ = grain_above(Sphere(1.0), gap=0.1, half=1.5, symmetric=symmetric)
    whole = 0.5 if symmetric else 1.0
    mesh = meshed(region, sizes(WallLayers(FIRST, 4, 1.5)), 2)
    assert volume(mesh) == pytest.approx(whole * (27.0 - np.pi / 6.0), rel=1e-4)
    assert area(faces(mesh, "body")) == pytest.approx(whole * np.pi, rel=2e-3)
    assert area(faces(mesh, "bed")) == pytest.approx(whole * 9.0, rel=1e-9)
    for side in ("inflow", "outflow"):
        assert area(faces(mesh, side)) == pytest.approx(whole * 9.0, rel=1e-9)
    if symmetric:
        assert area(faces(mesh, "symmetry")) == pytest.approx(9.0 - np.pi / 4.0, rel=1e-3)
    assert jacobian_lower_bound(cells(mesh)).min() > 0.0
    assert {"bed", "body"} < set(mesh.sides)
    found = len(cells(mesh))
    plain = meshed(region, sizes(), 2)
    before = len(cells(plain))
    told = expected_cells(region, sizes(WallLayers(FIRST, 4, 1.5)))
    assert found > before
    assert told["layers along walls"] == pytest.approx(found - before, rel=1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solid", "size"), [(Sphere(1.0), 0.3), (Ellipsoid((0.6, 0.5, 0.35)), 0.22)]
)
def test_layers_follow_a_curved_grain(solid, size):
    """Cells folded between thin layers that bent and a straight upper end: 5 and 28 edges were bent less, by 0.011
    and 0.02 of the grain, and nothing said so. Now all nodes lie on the grain.
    """
    region, _ = grain_above(solid, gap=0.05, half=1.5, symmetric=True)
    layers = WallLayers({"bed": 0.002, "body": 0.001}, 12, 1.5)
    mesh = meshed(
        region, Sizes(1.0, (Near(size, 0.3, boundary="body"),), gap_part=0.8, layers=layers), 2
    )
    body = region.holes["body"]
    away = solid.level(body.placement.to_body(faces(mesh, "body").reshape(-1, 3)))
    assert away == pytest.approx(0.0, abs=1e-9)
    assert jacobian_lower_bound(cells(mesh)).min() > 0.05


def test_first_cells_are_as_thick_as_wanted_and_fill_gaps():
    """Where cells at walls end, and distances from walls: by the sphere and the plane themselves."""
    region, _ = grain_above(Sphere(1.0), gap=0.1, half=1.5)
    centre = region.holes["body"].placement.centre
    shape = sizes(WallLayers(FIRST, 4, 1.5))
    domain = build(MPI.COMM_SELF, lambda: meshed(region, shape, 2))
    space = compat.space(domain.mesh, ("Lagrange", 1))
    near = cells_at(domain, ("bed", "body"))
    corners = space.tabulate_dof_coordinates()[np.unique(compat.cell_dofs(space)[near])]
    away = {"body": np.linalg.norm(corners - centre, axis=1) - 0.5, "bed": corners[:, 2]}
    for name, first in FIRST.items():
        off = away[name][(away[name] > 1e-6) & (away[name] < 2.0 * first)]
        assert np.median(off) == pytest.approx(first, rel=0.02)
    places = np.random.default_rng(3).uniform((-1.5, -1.5, 0.0), (1.5, 1.5, 3.0), (500, 3))
    from_centre = np.linalg.norm(places - centre, axis=1)
    exact = np.minimum(from_centre - 0.5, places[:, 2])[from_centre > 0.5]
    found = distances(domain, ("bed", "body"), places[from_centre > 0.5])
    # The sphere is flat pieces with edges of 0.15 at most, half of a cell: by 0.15^2/(8 0.5) they lie within it.
    assert found == pytest.approx(exact, abs=5.7e-3)


@pytest.mark.slow
def test_no_cell_in_the_layers_of_a_pocket_folds_over():
    """Thin layers at spheres between spheres, of which cells reached 1700 times their volume through themselves."""
    centre = 4.0 + np.sqrt(1.0 / 12.0)
    scene = Scene(
        domain=Domain(length=9.0, width=5.0, height=5.866),
        fluid=Fluid(reynolds=3500.0, scale="grain"),
        flow=OpenChannel(),
        body=SphereGrain(diameter=1.0, x=4.0, density=2.65),
        bed=SphereBed(
            radius=0.5, spacing=1.0, arrangement="triangular", angle=90.0, offset=(centre, 3.0)
        ),
        effects=Effects(turbulence=True),
        turbulence=Turbulence(model="k-omega-sst"),
        contact=Contact(friction=0.5, gap=0.05),
        gravity=Gravity(acceleration=1.0),
        numerics=Numerics(mesh_size=2.2, order=2, error_bars=False),
    )
    mesh = lay_out(Setup(scene), make_plan(scene)).mesh()
    folded = jacobian_lower_bound(cells(mesh))
    assert len(folded) > 10_000 and folded.min() > 0.05
