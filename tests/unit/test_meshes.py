"""Meshes in 2-D and 3-D, with layers at walls."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from domains import measures, square_outline
from every_shape import TORUS
from mpi4py import MPI
from scenes import SCENES, SETTLED, on_bed
from turbulent import channel

from incipient.errors import MeshError
from incipient.geometry import Box, Cylinder, Ellipsoid, Plane, Ridges, Sphere, SphereBed, Spheres
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Flat, HalfDiscs, Sinusoidal
from incipient.geometry.plane.curves import Line, Spline
from incipient.geometry.plane.grains import Disc, Ellipse, Rectangle
from incipient.geometry.settle import proximity
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.grains import Solid, Triangulated
from incipient.mesh.domain import build
from incipient.mesh.motion import MeshMotion
from incipient.mesh.wall_distance import distances
from incipient.meshes import (
    Away,
    Near,
    PlacedSolid,
    Region,
    Resolved,
    Sizes,
    SolidRegion,
    WallLayers,
    space,
)
from incipient.meshes.model import meshed
from incipient.meshes.simplices import Simplices, jacobian_lower_bound
from incipient.meshes.size_map import expected_cells
from incipient.meshes.surfaces import Ground
from incipient.planning import meshing
from incipient.planning.meshing import lay_out
from incipient.planning.plan import make_plan, plan_of
from incipient.scene import (
    Contact,
    Domain,
    Effects,
    Fluid,
    Gravity,
    HeapBed,
    Numerics,
    OpenChannel,
    Poiseuille,
    Scene,
    Turbulence,
    load,
)
from incipient.scene import Sphere as SceneSphere
from incipient.scene import Sphere as SphereGrain
from incipient.scene import SphereBed as SceneSphereBed
from incipient.setup.setup import Setup

# Plane regions and the domains made of meshes: names, sizes, curved cells, errors that every rank hears of.


def grain_above(
    solid: Solid, bed: Terrain | None = None, gap: float = 0.02, half: float = 2.0, **options: Any
) -> tuple[SolidRegion, np.ndarray]:
    """A grain lowered onto a bed and lifted by a gap in a box, and the points of the grain where gaps are."""
    bed = bed or Plane()
    placement = proximity(solid, bed).lowered(Placement((0.0, 0.0, 0.0)), gap)
    level, sides = bed.mean((-1.5, 1.5), (-1.5, 1.5)), ((-half, half), (-half, half))
    options = {"resolved": Resolved((0.0, 0.0), 1.0, 0.5, level)} | options
    region = SolidRegion(
        *sides, 2.0 * half, bed, {"body": PlacedSolid(solid, placement)}, **options
    )
    return region, proximity(solid, bed).gaps(placement, 1.1 * gap).points


def finer_in_the_gap(size: float, gap: float, points: np.ndarray) -> Sizes:
    """Cells of a size at the grain, of half the gap where it is least."""
    narrow = Near(0.5 * gap, 0.18, points=tuple(map(tuple, points.tolist())), needed=True)
    return Sizes(1.0, (Near(size, 0.3, boundary="body"), narrow), gap_part=0.8)


def cells(mesh: Simplices) -> np.ndarray:
    """The nodes of all triangles or tetrahedra, (cells, nodes, gdim)."""
    return mesh.points[mesh.cells]


def faces(mesh: Simplices, name: str) -> np.ndarray:
    """The nodes of the triangles of a named surface, (m, 3 or 6, 3)."""
    return mesh.points[mesh.sides[name]]


def measured(mesh: Simplices) -> dict[str, float]:
    """The volume (of no name), in 2-D the area, and what each boundary measures, by dolfinx."""
    return measures(build(MPI.COMM_SELF, lambda: mesh))


def quality(mesh: Simplices) -> float:
    """Of the worst cell: 1 where it is equilateral, 0 where it is flat, less where it is folded."""
    return MeshMotion(build(MPI.COMM_SELF, lambda: mesh)).quality().worst


FLOOR = (Line((0.0, 0.0), (2.0, 0.0)),)
DISC = tuple(curve.moved(Placement((0.8, 0.5))) for curve in Disc(diameter=0.4).outline())


def on_boundary(mesh: Simplices, name: str) -> np.ndarray:
    """Places of the nodes on a named boundary."""
    return mesh.points[np.unique(mesh.sides[name])]


# -- names --------------------------------------------------------------------------------------


def test_sides_may_share_a_name() -> None:
    region = Region(FLOOR, 1.0, sides=("wall", "outflow", "wall", "inflow"))
    lengths = {"wall": 4.0, "outflow": 1.0, "inflow": 1.0, "": 2.0}
    assert measured(meshed(region, Sizes(0.3), 1)) == pytest.approx(lengths)


@pytest.mark.parametrize(
    ("grain", "bed", "area"),
    [
        # Whole waves take nothing off the rectangle; three half-discs and two quarters take 4 pi r^2 / 2.
        (None, Sinusoidal(0.1, 1.0), 2.0),
        (None, HalfDiscs(0.1, 0.5, 0.5), 2.0 - 4 * 0.5 * np.pi * 0.1**2),
        (Rectangle(0.4, 0.2), Flat(), 2.0 - 0.08),
        (Rectangle(0.4, 0.3, 0.05), Flat(), 2.0 - 0.12 + (4.0 - np.pi) * 0.05**2),
        (Ellipse((0.3, 0.1)), Flat(), 2.0 - 0.03 * np.pi),
        (Disc(0.4), Flat(), 2.0 - 0.04 * np.pi),
    ],
)
def test_area_above_a_bed_around_a_turned_grain(grain: Any, bed: Any, area: float) -> None:
    outline = () if grain is None else grain.outline()
    holes = {"body": tuple(curve.moved(Placement((0.9, 0.5), 0.4)) for curve in outline)}
    name = "bed" if grain is None else "body"
    region = Region(bed.curves(0.0, 2.0), 1.0, holes if outline else {})
    mesh = meshed(region, Sizes(0.2, (Near(0.03, 0.3, boundary=name),)), 2)
    assert measured(mesh)[""] == pytest.approx(area, rel=1e-5)


# -- sizes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_cells_along_a_bed_are_larger_far_away(factor: float) -> None:
    """They grow with the distance from a point up to the largest; a factor on all sizes holds for that one, too."""
    size, growth, largest = 0.02, 0.1, 0.1
    near = Near(size, 0.3, boundary="bed", away=Away((0.0, 0.0), growth, largest))
    mesh = meshed(Region(FLOOR, 1.0), Sizes(0.5, (near,)).scaled(factor), 1)
    places = np.sort(on_boundary(mesh, "bed")[:, 0])
    middles, lengths = 0.5 * (places[1:] + places[:-1]), np.diff(places)
    wanted = factor * np.clip(growth * middles, size, largest)
    assert lengths == pytest.approx(wanted, rel=0.1)


def test_cells_are_small_where_asked_and_grow_from_there() -> None:
    size, growth, far = 0.02, 0.25, 0.3
    sizes = Sizes(far, (Near(size, growth, points=((0.5, 0.0),)),))
    mesh = meshed(Region(FLOOR, 1.0), sizes, 1)
    triangles = cells(mesh)
    sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    lengths = sides.mean(axis=1)
    distance = np.linalg.norm(triangles.mean(axis=1) - [0.5, 0.0], axis=1)
    wanted = np.minimum(far, size + growth * distance)
    # gmsh makes triangles whose edges are 7% off the size asked for in the median.
    assert np.median(lengths / wanted) == pytest.approx(1.0, abs=0.15)
    assert np.all(lengths < 1.8 * wanted)
    assert lengths[np.argmin(distance)] < 2 * size


# -- curved cells -------------------------------------------------------------------------------


@pytest.mark.parametrize(("order", "error"), [(1, 1e-2), (2, 1e-4), (3, 1e-5)])
def test_order_of_the_geometry(order: int, error: float) -> None:
    """The area around a disc, 2 - pi/25, comes out ever more exactly."""
    sizes = Sizes(0.2, (Near(0.1, 0.3, boundary="body"),))
    mesh = meshed(Region(FLOOR, 1.0, {"body": DISC}), sizes, order)
    assert 0 < abs(measured(mesh)[""] / (2 - np.pi * 0.04) - 1) < error
    away = np.linalg.norm(on_boundary(mesh, "body") - [0.8, 0.5], axis=1)
    assert away == pytest.approx(np.full(len(away), 0.2), rel=1e-6) and quality(mesh) > 0.3


def test_folded_cells_are_refused() -> None:
    """A disc hardly above the floor in cells far larger than the gap: they bulge through those below."""
    low = Placement((0.8, 0.201), np.pi / 4)
    outline = tuple(curve.moved(low) for curve in Disc(diameter=0.4).outline())
    region, near = Region(FLOOR, 1.0, {"body": outline}), Near(0.005, 0.3, boundary="body")
    with pytest.raises(MeshError, match="fold over on a curved boundary"):
        meshed(region, Sizes(0.15), 2)
    for sizes, order in ((Sizes(0.15), 1), (Sizes(0.15, (near,)), 2)):
        assert quality(meshed(region, sizes, order)) > 0.0


IN_THE_BED = PlacedSolid(Sphere(1.0), Placement((0.0, 0.0, 0.4)))


@pytest.mark.parametrize(
    ("region", "reason"),
    [
        *(
            (Region(FLOOR, 1.0, {"body": outline}), reason)
            for outline, reason in (
                (square_outline((0.8, 0.5), 0.4)[:3], "could not be meshed: "),  # not closed
                (square_outline((0.8, 0.0), 0.4), "could not be meshed: "),  # crosses the floor
                (
                    (SimpleNamespace(start=(0.0, 0.0), end=(1.0, 0.0)),),
                    "a curve of kind SimpleNamespace cannot be drawn; use lines, arcs or splines",
                ),
            )
        ),
        (
            SolidRegion((-1.0, 1.0), (-1.0, 1.0), 2.0, Plane(), {"body": IN_THE_BED}),
            '"body" reaches into the bed with',
        ),
    ],
)
def test_impossible_region_is_refused(region: Any, reason: str) -> None:
    """gmsh must not take the process down with it; a curve may be one of a program of one's own."""
    with pytest.raises(MeshError, match=reason):
        meshed(region, Sizes(0.2, (Near(0.2, 0.3, boundary="body"),)), 1)


ENDS_IN_A_CUSP = (
    "bed.offset=0.525",
    "numerics.mesh_size=2.0",
)  # 0.025 from the foot of its last half-disc


@pytest.mark.parametrize(
    ("spacing", "order", "more"),
    [
        (1.0, 3, ()),
        (1.02, 2, ()),
        (1.05, 3, ()),
        (1.15, 2, ENDS_IN_A_CUSP),
        (1.0, 3, ("bed.offset=0.5",)),  # both ends are in cusps
    ],
)
def test_cells_keep_their_sense_and_sides_are_straight_in_cusps_alone(
    spacing: float, order: int, more: tuple[str, ...]
) -> None:
    """The upper half of the bed's height is that of the half-discs to round-off; fluid is at rest in the lower.

    With spacing 1.02 the force on the grain, 1.07417, is the same on cells half as large.
    """
    chosen = ("numerics.accuracy=0.01", f"bed.spacing={spacing}", f"numerics.order={order}")
    scene = on_bed(*SETTLED, *chosen, *more)
    mesh = meshing.lay_out(Setup(scene), make_plan(scene)).mesh()
    nodes = mesh.points[np.unique(mesh.sides["bed"])]
    assert quality(mesh) > 0.0
    x, y = nodes[nodes[:, 1] > 0.25].T
    assert len(x) > 100 and y == pytest.approx(scene.bed_shape.height(x), abs=1e-9)
    ends = [mesh.points[mesh.sides[name], 0] for name in ("inflow", "outflow")]
    assert [np.ptp(end) for end in ends] == pytest.approx([0.0, 0.0], abs=1e-12)


# -- domains -------------------------------------------------------------------------------------


RANKS = """
from functools import partial
from mpi4py import MPI
from incipient.mesh.domain import build
from incipient.errors import MeshError
from domains import spoilt, square_without_a_name

for drawing in (partial(spoilt, MeshError("cells fold")), partial(square_without_a_name, 1)):
    try:
        build(MPI.COMM_WORLD, drawing)
    except MeshError as error:
        print(error)
"""


def test_every_rank_raises(mpirun: Any) -> None:
    """What goes wrong in drawing the mesh, and what its names lack."""
    done = mpirun(2, RANKS, timeout=60)
    for message in ("cells fold", "belong to no named boundary"):
        assert done.stdout.count(message) == 2


# Regions in space as gmsh meshes them: volumes, areas, names, gaps, halves, units.


NAMES = {"inflow", "outflow", "right", "left", "top", "bed", "body"}
# The least quality of cells about a grain: measured 0.096 among balls that touch in triangles, 0.26 above planes
ROUND = 0.08


@pytest.mark.parametrize(
    ("order", "rate"), [pytest.param(1, 2.0, marks=pytest.mark.slow), (2, 4.0)]
)
def test_volumes_and_areas_converge(order: int, rate: float) -> None:
    """Straight cells miss a part of the sphere of second order in their size, curved ones of fourth.

    A mesh has no points but those of its cells: edges of the shell, drawn for the walls' triangles, leave none.
    """
    errors = []
    for size in (0.3, 0.15):
        region, _ = grain_above(Sphere(1.0), gap=0.5, half=1.5)
        mesh = meshed(region, Sizes(1.0, (Near(size, 0.4, boundary="body"),)), order)
        assert np.array_equal(np.unique(mesh.cells), np.arange(len(mesh.points)))
        result = measured(mesh)
        assert set(result) == {*NAMES, ""} and result["top"] == pytest.approx(9.0)
        errors.append([result[""] - (27.0 - np.pi / 6.0), np.pi - result["body"]])
    orders = np.log2(np.abs(errors[0]) / np.abs(errors[1]))
    assert (orders > rate - 0.5).all(), orders
    assert np.abs(errors[1]).max() < {1: 0.06, 2: 6e-4}[order]


@pytest.mark.parametrize(
    ("bed", "count"),
    [
        pytest.param(Plane((0.1, -0.05)), 1, marks=pytest.mark.slow),
        pytest.param(Ridges(0.08, 1.0, 0.4), 1, marks=pytest.mark.slow),
        (SphereBed.array(0.5, 1.0), 1),
        pytest.param(SphereBed.array(0.4, 0.8, "triangular"), 1, marks=pytest.mark.slow),
        pytest.param(SphereBed.array(0.2, 0.7), 1, marks=pytest.mark.slow),
        pytest.param(
            SphereBed.array(0.5, 1.0, "triangular", (0.5, np.sqrt(3.0) / 6.0)),
            3,
            marks=pytest.mark.slow,
        ),
    ],
    ids=["slope", "ridges", "touching balls", "touching in triangles", "lone balls", "pocket"],
)
def test_beds(bed: Any, count: int) -> None:
    """Every bed meshes with round cells, none of them folded, and with each gap as it is."""
    region, points = grain_above(Sphere(1.0), bed, half=1.5)
    mesh = meshed(region, finer_in_the_gap(0.25, 0.02, points), 2)
    bottom, body = faces(mesh, "bed").reshape(-1, 3), region.holes["body"]
    assert quality(mesh) > ROUND and len(points) == count
    for point in points:
        near = bottom[np.linalg.norm(bottom - point, axis=1) < 0.1]
        away = body.solid.level(body.placement.to_body(near))
        # The narrowest place lies between two nodes that are a quarter of the gap from each other.
        assert 0.02 - 1e-9 < away.min() < 0.0205


def test_a_bed_that_crosses_itself_begins_with_other_triangles(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its first triangles may fold it, which smaller cells do not undo: others come first, then smaller cells."""
    region, point = grain_above(Sphere(1.0), SphereBed.array(0.5, 1.0), half=1.5)
    begun, spots, truly = list[float](), list[int](), space.remeshed

    def remeshed(exact: Any, *how: Any) -> Any:
        if isinstance(exact, Ground):
            begun.append(exact.finer)
            spots.append(len(how[-1].spots))
        return truly(exact, *how)

    monkeypatch.setattr(space, "remeshed", remeshed)
    monkeypatch.setattr(space, "crossed", lambda surface: np.arange(int(len(begun) < 3)))
    assert quality(meshed(region, finer_in_the_gap(0.25, 0.02, point), 2)) > ROUND
    assert begun == pytest.approx([1.0, 1.07, 1.07**2]) and spots == [0, 0, 1]


@pytest.mark.parametrize(
    ("solid", "gap"),
    [
        # Its hole opens across the plane of symmetry.
        (Triangulated(TORUS.vertices[:, [1, 2, 0]], TORUS.faces), 0.1),
        pytest.param(Ellipsoid((0.6, 0.5, 0.35)), 0.01, marks=pytest.mark.slow),
        (Box((0.8, 0.8, 0.6), 0.2), 0.1),
        pytest.param(Box((0.8, 0.8, 0.6)), 0.1, marks=pytest.mark.slow),
        pytest.param(
            Spheres([(0, -0.25, 0), (0, 0.25, 0), (0.3, 0, 0)], [0.3, 0.3, 0.15]),
            0.02,
            marks=pytest.mark.slow,
        ),
    ],
    ids=["upright torus", "ellipsoid", "rounded box", "sharp box", "clump"],
)
def test_half_is_half(solid: Any, gap: float) -> None:
    """Half a region has half the volume and half the grain's surface, and its cut is plane."""
    halves = []
    for symmetric in (False, True):
        region, point = grain_above(solid, gap=gap, symmetric=symmetric)
        mesh = meshed(region, finer_in_the_gap(0.12, gap, point), 2)
        result = measured(mesh)
        halves.append([result[""], result["body"]])
        assert quality(mesh) > ROUND
        if symmetric:
            assert set(mesh.sides) == (NAMES - {"right"}) | {"symmetry"}
            assert np.abs(faces(mesh, "symmetry")[..., 1]).max() < 1e-12
    assert 64.0 - halves[0][0] == pytest.approx(solid.volume, rel=5e-3)
    assert 2.0 * halves[1][0] == pytest.approx(halves[0][0], abs=2e-3 * solid.volume)
    assert 2.0 * halves[1][1] == pytest.approx(halves[0][1], rel=2e-3)


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_cylinder_from_side_to_side(symmetric: bool) -> None:
    """A tunnel through the domain: volume and areas are the exact ones."""
    tube = PlacedSolid(Cylinder(1.0, 2.0), Placement((0.0, 0.0, 0.0)))
    region = SolidRegion(
        (-1.5, 1.5), (-1.0, 1.0), 1.5, Plane(origin_z=-1.5), {"body": tube}, symmetric=symmetric
    )
    share = 0.5 if symmetric else 1.0
    result = measured(meshed(region, Sizes(0.6, (Near(0.2, 0.3, boundary="body"),)), 2))
    assert result[""] == pytest.approx(share * (18.0 - 0.5 * np.pi), rel=1e-4)
    assert result["body"] == pytest.approx(share * 2.0 * np.pi, rel=1e-4)
    assert result["left"] == pytest.approx(9.0 - 0.25 * np.pi, rel=1e-4)


@pytest.mark.parametrize(
    ("scene", "mesh_size", "radius", "most"),
    [
        # As many cells as the first mesh, with cells that fold; the coarsest has two thirds more.
        ("settling_sphere", 2.0, 7.5, 1.1 * 1223),
        ("settling_sphere", 2.82842, 7.5, 1.1 * 792),
        ("settling_sphere", 4.0, 7.5, 1.1 * 446),
        ("settling_sphere", 5.66, 7.5, 2.0 * 298),
        # With a flat facet the torque in Stokes flow was 1.6% below O'Neill's (1968).
        ("sphere_on_plane", 1.41421, 0.5, np.inf),
    ],
)
def test_cells_make_room_for_a_curved_grain(
    scene: str, mesh_size: float, radius: float, most: float
) -> None:
    """Cells as large as the sphere's radius fold over its facets, which stayed flat: three edges at 5.66, and others
    only on a second to fourth mesh, finer than asked for. Now all nodes lie on the sphere.
    """
    setup = Setup(load(SCENES / f"{scene}.toml", [f"numerics.mesh_size={mesh_size}"]))
    mesh = lay_out(setup, plan_of(setup)).mesh()
    where = setup.stance.placement.centre
    away = np.linalg.norm(faces(mesh, "body").reshape(-1, 3) - where, axis=1)
    assert away == pytest.approx(radius, abs=1e-9)
    assert jacobian_lower_bound(cells(mesh)).min() > 0.0
    assert len(mesh.cells) < most


def test_edges_that_do_not_follow_a_grain_are_told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Cells six times as large as the radius of a box's edges leave no room to some of them."""
    monkeypatch.setattr(space, "ATTEMPTS", 1)
    region, _ = grain_above(Box((0.8, 0.8, 0.6), 0.05), gap=0.1, half=1.5, symmetric=True)
    mesh = meshed(region, Sizes(1.0, (Near(0.3, 0.3, boundary="body"),)), 2)
    assert jacobian_lower_bound(cells(mesh)).min() > 0.0
    assert (
        "edges of cells do not follow a curved grain" in caplog.text
        and "numerics.mesh_size" in caplog.text
    )


def test_any_unit_and_any_place() -> None:
    """A scene in millimetres and far from the origin has the very same mesh."""
    result = []
    for unit, shift in ((1.0, 0.0), (1000.0, 64000.0)):
        body = PlacedSolid(Sphere(unit), Placement((shift, shift, 0.54 * unit)))
        sides = (shift - 2.0 * unit, shift + 2.0 * unit)
        region = SolidRegion(sides, sides, 4.0 * unit, Plane(), {"body": body}, symmetric=True)
        near = Near(0.02 * unit, 0.2, points=((shift, shift, 0.02 * unit),))
        sizes = Sizes(unit, (Near(0.25 * unit, 0.3, boundary="body"), near), gap_part=0.8)
        result.append((meshed(region, sizes, 2).points - [shift, shift, 0.0]) / unit)
    one, other = result
    assert other.shape == one.shape
    assert np.max(np.abs(other - one)) < 1e-9


@pytest.mark.parametrize(
    ("solid", "gap", "size"), [(Sphere(1.0), 0.01, 0.15), (Box((0.8, 0.6, 0.6), 0.1), 0.2, 0.08)]
)
def test_the_number_of_cells_is_foretold(solid: Solid, gap: float, size: float) -> None:
    """Foretold are 3 to 4% fewer, by integrating over the sizes."""
    region, point = grain_above(solid, gap=gap, symmetric=True)
    sizes = finer_in_the_gap(size, gap, point)
    made = len(cells(meshed(region, sizes, 1)))
    assert sum(expected_cells(region, sizes).values()) == pytest.approx(made, rel=0.1)


# Meshes of scenes with turbulence: where they begin at walls, and how fine they are there.


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
@pytest.mark.parametrize("mesh_size", [2.0, 1.0])
def test_rows_next_to_walls_are_as_fine_as_the_distance_of_the_law_asks_for(flow, mesh_size):
    """The first row is as thick as the distance, times mesh_size; none over 0.06 of a depth; they grow by degrees."""
    numerics = Numerics(order=2, mesh_size=mesh_size)
    scene = channel(flow=flow, fluid=Fluid(reynolds=1e6, scale="flow"), numerics=numerics)
    walls, grid = Setup(scene).walls, lay_out(Setup(scene), make_plan(scene)).shape
    thick = np.diff([0.0, *grid.ends[1]]) * np.ptp(grid.extents[1])
    assert thick.sum() == pytest.approx(1.0 - walls.number * walls.nearest)
    assert 0.7 < thick[0] / (mesh_size * walls.nearest) < 1.4
    assert thick.max() <= 0.75 * mesh_size * walls.depth * 0.08 * (1 + 1e-9)
    if walls.number == 2:
        assert thick == pytest.approx(thick[::-1])
        thick = thick[: len(thick) // 2]
    assert (np.diff(thick) > -1e-12).all() and (
        thick[1:] / thick[:-1]
    ).max() < 1.0 + 0.45 * mesh_size


def test_level_ground_about_a_grain_in_space_is_at_the_datum():
    """Far from the grain a planar bed takes the place of a bed with forms: where the profile of the inflow starts."""
    scene = channel(
        domain=Domain(length=10, width=10, height=5),
        fluid=Fluid(reynolds=20_000.0, scale="grain"),
        flow=OpenChannel(velocity=20.0, datum=0.7),
        body=SceneSphere(diameter=1.0, centre=(5.0, 5.0, 1.7)),
        bed=HeapBed(
            spheres=((5.0, 4.0, 0.9, 0.45), (5.0, 6.0, 0.9, 0.45)), posts=((4.0, 5.0, 0.5, 0.5),)
        ),
        numerics=Numerics(error_bars=False, meshed_bed=0.6),
    )
    assert Setup(scene).walls.depth == pytest.approx(4.3)
    without = scene.model_copy(update={"flow": OpenChannel(velocity=20.0)})
    assert Setup(without).walls.depth == pytest.approx(5.0 - 1.35)  # by default the crest


# Layers of thin cells along walls: they fill the region, are as thick as asked, and fold nowhere; 2-D, then 3-D.


# -- 2-D ----------------------------------------------------------------------------------------

THIN = 1e-3


def meshed_in_plane(region, walls=("bed",), order=2, factor=1.0, near=()):
    layers = WallLayers(dict.fromkeys(walls, THIN), 80, 1.3, graded=True)
    along = tuple(Near(0.1, 0.3, boundary=name) for name in walls)
    return meshed(region, Sizes(0.4, (*along, *near), layers=layers).scaled(factor), order)


# A channel three high behind a step of one, with a lower wall and a lid.
STEP = Region(
    (
        Line((-2.0, 1.0), (0.0, 1.0)),
        Line((0.0, 1.0), (0.0, 0.0)),
        Line((0.0, 0.0), (4.0, 0.0)),
    ),
    3.0,
)


def corners_at(mesh, walls):
    """Corners of the cells that have one on a named wall."""
    corners = mesh.cells[:, : mesh.points.shape[1] + 1]
    on_walls = np.concatenate([mesh.sides[name].ravel() for name in walls])
    return np.unique(corners[np.isin(corners, on_walls).any(axis=1)])


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_layers_go_around_both_corners_of_a_step(factor):
    """The area is that of the region (exact), and cells at walls are as thick as asked but in the corner."""
    mesh = meshed_in_plane(STEP, order=1, factor=factor)
    assert measured(mesh)[""] == pytest.approx(2.0 * 2.0 + 4.0 * 3.0, rel=1e-12)
    near = mesh.points[corners_at(mesh, ("bed",))]
    away = distances(build(MPI.COMM_SELF, lambda: mesh), ("bed",), near)
    ends = away[away > 1e-12] / (factor * THIN)
    assert ends == pytest.approx(1.0, rel=0.5) and (np.abs(ends - 1.0) < 0.02).mean() > 0.8


def test_cells_follow_curved_walls():
    """A disc above a wavy bed, nearly touching it: the area less than 1e-5 from the exact one, folding nowhere."""
    x = np.linspace(0.0, 4.0, 65)
    bed = Spline(np.column_stack([x, 0.05 * np.sin(2.0 * np.pi * x)]))
    disc = tuple(curve.moved(Placement((1.75, 0.48))) for curve in Disc(1.0).outline())
    pocket = Near(0.015, 0.2, points=((1.75, -0.05), (1.75, -0.02)))  # 0.03 above the trough
    mesh = meshed_in_plane(Region((bed,), 2.0, {"body": disc}), ("bed", "body"), near=(pocket,))
    assert measured(mesh)[""] == pytest.approx(8.0 - 0.25 * np.pi, rel=1e-5)
    away = np.linalg.norm(mesh.points - [1.75, 0.48], axis=1) - 0.5
    assert (np.abs(away) < 1e-4).sum() > 60  # corners and middles of edges
    assert away[away > 1e-9].min() < 1.01 * THIN


def test_layers_fit_between_a_sharp_corner_and_a_bed():
    """A box 0.012 above waves: thinner columns next to the cells that were too narrow made no room there."""
    scene = Scene(
        domain=Domain(length=14.0, height=5.0),
        fluid=Fluid(reynolds=6e4, scale="flow"),
        flow=OpenChannel(),
        bed={"kind": "sinusoidal", "amplitude": 0.1, "wavelength": 2.0},
        body={"shape": "rectangle", "width": 1.0, "height": 0.6, "x": 6.0, "density": 2.65},
        gravity=Gravity(acceleration=1.0),
        effects=Effects(turbulence=True),
        turbulence=Turbulence(model="k-omega-sst"),
        contact=Contact(friction=0.5),
        numerics=Numerics(mesh_size=1.0, error_bars=False),
    )
    layout = lay_out(Setup(scene), make_plan(scene))
    assert layout.sizes.layers is not None
    assert measured(layout.mesh())[""] == pytest.approx(70.0 - 0.6, rel=1e-5)


def test_thinner_layers_grow_less():
    """Half as large cells are everywhere half as large: 4 times as many, to a tenth."""
    coarse, fine = (len(meshed_in_plane(STEP, order=1, factor=f).cells) for f in (1.0, 0.5))
    assert fine / coarse == pytest.approx(4.0, rel=0.1)


def test_first_layers_become_thicker_up_to_a_factor():
    """By two factors one after the other as by their product, by 1.5 at most; finer cells have thinner ones."""
    layers = WallLayers({"bed": 1.0}, 80, 1.3, most=1.5)
    assert layers.scaled(4.0).first == layers.scaled(2.0).scaled(2.0).first == {"bed": 1.5}
    assert layers.scaled(0.5).scaled(2.0).first == {"bed": 1.0}


def test_cells_of_order_three_are_refused():
    with pytest.raises(MeshError, match="geometry_order"):
        meshed_in_plane(STEP, order=3)


# -- 3-D ----------------------------------------------------------------------------------------

FIRST = {"bed": 0.02, "body": 0.01}


# Cells of 0.2 at a sphere of diameter one, and of 0.4 along the bed.
WITH_LAYERS = Sizes(
    1.0,
    (Near(0.2, 0.4, boundary="body"), Near(0.4, 0.4, boundary="bed")),
    gap_part=0.8,
    layers=WallLayers(FIRST, 4, 1.5),
)


@pytest.mark.parametrize("symmetric", [False, True])
def test_layers_leave_the_region_as_it_is(symmetric):
    """Volume and areas are exact to what curved cells miss; no cell folds over."""
    region, _ = grain_above(Sphere(1.0), gap=0.1, half=1.5, symmetric=symmetric)
    whole = 0.5 if symmetric else 1.0
    mesh = meshed(region, WITH_LAYERS, 2)
    result = measured(mesh)
    exact = {"": whole * (27.0 - np.pi / 6.0), "body": whole * np.pi, "symmetry": 9.0 - np.pi / 4.0}
    for name, within in (("", 1e-4), ("body", 2e-3), ("symmetry", 1e-3)):
        assert name not in result or result[name] == pytest.approx(exact[name], rel=within)
    for name in ("bed", "inflow", "outflow"):
        assert result[name] == pytest.approx(whole * 9.0, rel=1e-9)
    assert jacobian_lower_bound(cells(mesh)).min() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solid", "size"), [(Sphere(1.0), 0.27), (Ellipsoid((0.6, 0.5, 0.35)), 0.22)]
)
def test_layers_follow_a_curved_grain(solid, size):
    """Cells folded between thin layers that bent and a straight upper end: 5 and 28 edges were bent less, by 0.011
    and 0.02 of the grain, and nothing said so. Now all nodes lie on the grain; where some do not, on cells of 0.3, a
    warning says so.
    """
    region, _ = grain_above(solid, gap=0.05, half=1.5, symmetric=True)
    layers = WallLayers({"bed": 0.002, "body": 0.001}, 12, 1.5)
    mesh = meshed(
        region, Sizes(1.0, (Near(size, 0.3, boundary="body"),), gap_part=0.8, layers=layers), 2
    )
    body = region.holes["body"]
    away = solid.level(body.placement.to_body(faces(mesh, "body").reshape(-1, 3)))
    assert np.abs(away).max() < 1e-9
    assert jacobian_lower_bound(cells(mesh)).min() > 0.05


def test_first_cells_are_as_thick_as_wanted_and_fill_gaps():
    """Where cells at walls end, and distances from walls: by the sphere and the plane themselves."""
    region, _ = grain_above(Sphere(1.0), gap=0.1, half=1.5)
    centre = region.holes["body"].placement.centre
    mesh = meshed(region, WITH_LAYERS, 2)
    corners = mesh.points[corners_at(mesh, FIRST)]
    away = {"body": np.linalg.norm(corners - centre, axis=1) - 0.5, "bed": corners[:, 2]}
    for name, first in FIRST.items():
        off = away[name][(away[name] > 1e-6) & (away[name] < 2.0 * first)]
        assert np.median(off) == pytest.approx(first, rel=0.02)
    places = np.random.default_rng(3).uniform((-1.5, -1.5, 0.0), (1.5, 1.5, 3.0), (500, 3))
    from_centre = np.linalg.norm(places - centre, axis=1)
    exact = np.minimum(from_centre - 0.5, places[:, 2])[from_centre > 0.5]
    domain = build(MPI.COMM_SELF, lambda: mesh)
    result = distances(domain, ("bed", "body"), places[from_centre > 0.5])
    # The sphere is flat pieces with edges of 0.15 at most, half of a cell: by 0.15^2/(8 0.5) they lie within it.
    assert result == pytest.approx(exact, abs=5.7e-3)


@pytest.mark.slow
def test_no_cell_in_the_layers_of_a_pocket_folds_over():
    """Thin layers at spheres between spheres, of which cells reached 1700 times their volume through themselves."""
    centre = 4.0 + np.sqrt(1.0 / 12.0)
    scene = Scene(
        domain=Domain(length=9.0, width=5.0, height=5.866),
        fluid=Fluid(reynolds=3500.0, scale="grain"),
        flow=OpenChannel(),
        body=SphereGrain(diameter=1.0, x=4.0, density=2.65),
        bed=SceneSphereBed(
            radius=0.5, spacing=1.0, arrangement="triangular", angle=90.0, offset=(centre, 3.0)
        ),
        effects=Effects(turbulence=True),
        turbulence=Turbulence(model="k-omega-sst"),
        contact=Contact(friction=0.5, gap=0.05),
        gravity=Gravity(acceleration=1.0),
        numerics=Numerics(mesh_size=2.2, order=2, error_bars=False),
    )
    folded = jacobian_lower_bound(cells(lay_out(Setup(scene), make_plan(scene)).mesh()))
    assert len(folded) > 10_000 and folded.min() > 0.05
