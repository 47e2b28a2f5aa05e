"""Plane regions and the domains made of meshes: names, sizes, curved cells, errors that every rank hears of."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import spoilt, square_in_box, square_outline, square_without_a_name, unit_box
from mpi4py import MPI
from scenes import SETTLED, on_bed

from incipient import compat
from incipient.errors import MeshError
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import HalfDiscs, Sinusoidal
from incipient.geometry.plane.curves import Line
from incipient.geometry.plane.grains import Disc, Ellipse, Rectangle
from incipient.mesh.domain import build
from incipient.mesh.motion import MeshMotion
from incipient.meshes import Away, Near, Region, Sizes
from incipient.meshes.model import meshed
from incipient.meshes.session import session
from incipient.meshes.simplices import Simplices
from incipient.planning import meshing
from incipient.planning.plan import make_plan
from incipient.setup.setup import Setup

FLOOR = (Line((0.0, 0.0), (2.0, 0.0)),)
DISC = tuple(curve.moved(Placement((0.8, 0.5))) for curve in Disc(diameter=0.4).outline())


def corners(mesh: Simplices) -> np.ndarray:
    """Corners of all triangles, (cells, 3, 2)."""
    return mesh.points[mesh.cells[:, :3]]


def edge_lengths(mesh: Simplices) -> np.ndarray:
    """Lengths of the triangles' three sides, (cells, 3)."""
    triangles = corners(mesh)
    return np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)


def on_boundary(mesh: Simplices, name: str) -> np.ndarray:
    """Places of the nodes on a named boundary."""
    return mesh.points[np.unique(mesh.sides[name])]


def area(mesh: Simplices) -> float:
    """Area of the mesh, curved cells included."""
    domain = build(MPI.COMM_SELF, lambda: mesh)
    one = dolfinx.fem.Constant(domain.mesh, 1.0)
    return float(dolfinx.fem.assemble_scalar(compat.form(one * ufl.dx(degree=8))))


def disc_model(order: int = 1, factor: float = 1.0) -> Simplices:
    sizes = Sizes(0.2, (Near(0.1, 0.3, boundary="body"),)).scaled(factor)
    return meshed(Region(FLOOR, 1.0, {"body": DISC}), sizes, order)


# -- names --------------------------------------------------------------------------------------


def test_region_has_its_names() -> None:
    mesh = disc_model()
    found, body, bed = sorted(mesh.sides), on_boundary(mesh, "body"), on_boundary(mesh, "bed")
    inflow, outflow, top = (on_boundary(mesh, name) for name in ("inflow", "outflow", "top"))
    assert found == ["bed", "body", "inflow", "outflow", "top"]
    assert np.linalg.norm(body - [0.8, 0.5], axis=1) == pytest.approx(np.full(len(body), 0.2))
    for places, axis, value in ((bed, 1, 0.0), (top, 1, 1.0), (inflow, 0, 0.0), (outflow, 0, 2.0)):
        assert places[:, axis] == pytest.approx(np.full(len(places), value))


def test_sides_may_share_a_name() -> None:
    region = Region(FLOOR, 1.0, sides=("wall", "outflow", "wall", "inflow"))
    mesh = meshed(region, Sizes(0.3), 1)
    found, wall = sorted(mesh.sides), on_boundary(mesh, "wall")
    assert found == ["inflow", "outflow", "wall"]
    assert {0.0, 1.0} == set(wall[:, 1].round(9))


@pytest.mark.parametrize(
    ("bed", "expected"),
    [(Sinusoidal(0.1, 1.0), 2.0), (HalfDiscs(0.1, 0.5, 0.5), 2.0 - 4 * 0.5 * np.pi * 0.1**2)],
)
def test_area_above_a_bed(bed: Any, expected: float) -> None:
    """Whole waves take nothing off the rectangle; three half-discs and two quarters take 4 pi r^2 / 2."""
    region = Region(bed.curves(0.0, 2.0), 1.0)
    mesh = meshed(region, Sizes(0.2, (Near(0.03, 0.3, boundary="bed"),)), 2)
    assert area(mesh) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    "grain", [Rectangle(0.4, 0.2), Rectangle(0.4, 0.3, 0.05), Ellipse((0.3, 0.1)), Disc(0.4)]
)
def test_area_around_a_turned_grain(grain: Any) -> None:
    outline = tuple(curve.moved(Placement((0.9, 0.5), 0.4)) for curve in grain.outline())
    sizes = Sizes(0.2, (Near(0.03, 0.3, boundary="body"),))
    mesh = meshed(Region(FLOOR, 1.0, {"body": outline}), sizes, 2)
    assert area(mesh) == pytest.approx(2.0 - grain.volume, rel=1e-5)


# -- sizes --------------------------------------------------------------------------------------


def test_one_factor_scales_all_sizes() -> None:
    """Half the size, four times the cells."""
    counts, smallest = [], []
    for factor in (1.0, 0.5, 0.25):
        mesh = disc_model(factor=factor)
        lengths = edge_lengths(mesh)
        counts.append(len(lengths))
        smallest.append(lengths.min())
    assert np.array(counts[1:]) / counts[:-1] == pytest.approx([4.0, 4.0], rel=0.15)  # 3.5 and 3.8
    # The least of all edges scatters: 0.55 and 0.45 times as long.
    assert np.array(smallest[1:]) / smallest[:-1] == pytest.approx([0.5, 0.5], rel=0.15)


def test_scaled_sizes() -> None:
    sizes = Sizes(
        1.0, (Near(0.1, 0.2, points=((0.0, 0.0),)), Near(0.3, 0.5, boundary="bed"))
    ).scaled(0.5)
    assert sizes == Sizes(
        0.5, (Near(0.05, 0.1, points=((0.0, 0.0),)), Near(0.15, 0.25, boundary="bed"))
    )


def test_cells_along_a_bed_are_larger_far_away() -> None:
    """They grow with the distance from a point up to the largest; a factor on all sizes holds for that one, too."""
    size, growth, largest = 0.02, 0.1, 0.1
    near = Near(size, 0.3, boundary="bed", away=Away((0.0, 0.0), growth, largest))
    for factor in (1.0, 0.5):
        mesh = meshed(Region(FLOOR, 1.0), Sizes(0.5, (near,)).scaled(factor), 1)
        places = np.sort(on_boundary(mesh, "bed")[:, 0])
        middles, lengths = 0.5 * (places[1:] + places[:-1]), np.diff(places)
        wanted = factor * np.clip(growth * middles, size, largest)
        assert lengths == pytest.approx(wanted, rel=0.1)


def test_cells_are_small_where_asked_and_grow_from_there() -> None:
    size, growth, far = 0.02, 0.25, 0.3
    sizes = Sizes(far, (Near(size, growth, points=((0.5, 0.0),)),))
    mesh = meshed(Region(FLOOR, 1.0), sizes, 1)
    triangles, lengths = corners(mesh), edge_lengths(mesh).mean(axis=1)
    distance = np.linalg.norm(triangles.mean(axis=1) - [0.5, 0.0], axis=1)
    wanted = np.minimum(far, size + growth * distance)
    # gmsh makes triangles whose edges are 7% off the size asked for in the median.
    assert np.median(lengths / wanted) == pytest.approx(1.0, abs=0.15)
    assert np.all(lengths < 1.8 * wanted)
    assert lengths[np.argmin(distance)] < 2 * size


def test_size_along_a_boundary() -> None:
    mesh = disc_model()
    body = on_boundary(mesh, "body")
    # 0.4 pi round the disc in pieces of 0.1, each quarter rounded up.
    assert len(body) == pytest.approx(0.4 * np.pi / 0.1, abs=4)


# -- curved cells -------------------------------------------------------------------------------


@pytest.mark.parametrize(("order", "error"), [(1, 1e-2), (2, 1e-4), (3, 1e-5)])
def test_order_of_the_geometry(order: int, error: float) -> None:
    """The area around a disc, 2 - pi/25, comes out ever more exactly."""
    mesh = disc_model(order)
    found, body = area(mesh), on_boundary(mesh, "body")
    off = abs(found / (2 - np.pi * 0.04) - 1)
    print(order, off)
    assert 0 < off < error
    assert np.linalg.norm(body - [0.8, 0.5], axis=1) == pytest.approx(
        np.full(len(body), 0.2), rel=1e-6
    )


def test_folded_cells_are_refused() -> None:
    """A disc hardly above the floor in cells far larger than the gap: they bulge through those below."""
    low = Placement((0.8, 0.201), np.pi / 4)
    region = Region(
        FLOOR, 1.0, {"body": tuple(curve.moved(low) for curve in Disc(diameter=0.4).outline())}
    )
    with pytest.raises(MeshError, match="fold over on a curved boundary"):
        meshed(region, Sizes(0.15), 2)
    mesh = meshed(region, Sizes(0.15), 1)
    assert len(corners(mesh)) > 0
    mesh = meshed(region, Sizes(0.15, (Near(0.005, 0.3, boundary="body"),)), 2)
    assert len(corners(mesh)) > 0


@pytest.mark.parametrize(
    "outline",
    [square_outline((0.8, 0.5), 0.4)[:3], square_outline((0.8, 0.0), 0.4)],
    ids=["not closed", "crosses the floor"],
)
def test_impossible_region_is_refused(outline: tuple[Line, ...]) -> None:
    """gmsh must not take the process down with it."""
    region = Region(FLOOR, 1.0, {"body": outline})
    with pytest.raises(MeshError, match="could not be meshed: "):
        meshed(region, Sizes(0.2), 1)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_all_cells_keep_their_sense(order: int) -> None:
    assert MeshMotion(build(MPI.COMM_SELF, lambda: disc_model(order))).quality().worst > 0.3


def test_a_curve_of_another_kind_is_refused() -> None:
    """Such as one that a grain of a program of one's own may have; it says what can be drawn."""
    other = SimpleNamespace(start=(0.0, 0.0), end=(1.0, 0.0))
    region = Region(FLOOR, 1.0, {"body": (other,)})  # type: ignore[dict-item]
    remedy = "a curve of kind SimpleNamespace cannot be drawn; use lines, arcs or splines"
    with pytest.raises(MeshError, match=remedy):
        meshed(region, Sizes(0.2), 1)


def test_a_defect_while_drawing_is_no_complaint_of_gmsh() -> None:
    """Only what gmsh complains of is a MeshError; another error keeps its type."""
    with pytest.raises(KeyError), session():
        raise KeyError("not gmsh's fault")


ENDS_IN_A_CUSP = (
    "bed.offset=0.525",
    "numerics.mesh_size=2.0",
)  # 0.025 from the foot of its last half-disc


@pytest.mark.parametrize(
    ("spacing", "order", "more"),
    [(1.0, 3, ()), (1.02, 2, ()), (1.05, 3, ()), (1.15, 2, ENDS_IN_A_CUSP)],
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
    assert MeshMotion(build(MPI.COMM_SELF, lambda: mesh)).quality().worst > 0.0
    assert scene.bed_shape is not None
    x, y = nodes[nodes[:, 1] > 0.25].T
    assert len(x) > 100 and y == pytest.approx(scene.bed_shape.height(x), abs=1e-9)


# -- domains -------------------------------------------------------------------------------------


def length(domain: Any, *names: str) -> float:
    one = dolfinx.fem.Constant(domain.mesh, 1.0)
    return float(dolfinx.fem.assemble_scalar(compat.form(one * domain.measure(*names))))


def test_boundaries_have_names_and_lengths() -> None:
    domain = square_in_box(0.3, 0.3)
    assert set(domain.names) == {"bottom", "right", "top", "left", "body"}
    expected = {"bottom": 2.0, "right": 1.0, "top": 2.0, "left": 1.0, "body": 1.2}
    assert {name: length(domain, name) for name in domain.names} == pytest.approx(expected)
    assert length(domain, "bottom", "body") == pytest.approx(3.2)


@pytest.mark.parametrize("gdim", [2, 3])
def test_facets_lie_where_their_name_says(gdim: int) -> None:
    domain = unit_box(gdim, 2)
    assert domain.gdim == gdim
    middles = dolfinx.mesh.compute_midpoints(domain.mesh, gdim - 1, domain.facets_of("top"))
    assert middles[:, 1] == pytest.approx(np.ones(len(middles)))
    assert len(middles) == {2: 2, 3: 8}[gdim]


@pytest.mark.parametrize("unnamed", [1, 4])
def test_boundary_without_a_name_is_an_error(unnamed: int) -> None:
    """It would silently be an open boundary."""
    with pytest.raises(MeshError, match="boundary facets of the mesh belong to no named boundary"):
        build(MPI.COMM_WORLD, partial(square_without_a_name, unnamed))


def test_error_in_the_drawing_is_passed_on() -> None:
    with pytest.raises(MeshError, match="cells fold"):
        build(MPI.COMM_WORLD, partial(spoilt, MeshError("cells fold")))


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
    assert done.returncode == 0, done.stderr
    for message in ("cells fold", "belong to no named boundary"):
        assert done.stdout.count(message) == 2
