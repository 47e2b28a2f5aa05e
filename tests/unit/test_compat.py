"""One test for each function of the layer between dolfinx's versions."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import dolfinx
import gmsh
import numpy as np
import pytest
import ufl
from domains import curved_box, rectangle, square_in_box, unit_box
from mpi4py import MPI

from incipient import compat
from incipient.mesh.cells import shape_functions
from incipient.mesh.domain import build
from incipient.meshes.model import meshed
from incipient.meshes.session import session

COMM = MPI.COMM_WORLD


def size_of(space: Any) -> int:
    return int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs)


# Of the unit square in 2 by 2 squares cut in two: 9 vertices, 16 edges, 8 cells.
SCALARS = {1: 9, 2: 9 + 16, 3: 9 + 2 * 16 + 8}


@pytest.mark.parametrize("degree", SCALARS)
def test_space(degree: int) -> None:
    mesh = unit_box(2, 2).mesh
    assert size_of(compat.space(mesh, ("Lagrange", degree))) == SCALARS[degree]
    assert size_of(compat.space(mesh, ("Lagrange", degree), (2,))) == 2 * SCALARS[degree]
    assert size_of(compat.space(mesh, ("DG", 0))) == 8


def test_element() -> None:
    mesh = unit_box(2, 2).mesh
    scalar = compat.function_space(mesh, compat.element(mesh, 2))
    triple = compat.function_space(mesh, compat.element(mesh, 2, (3,)))
    assert (size_of(scalar), size_of(triple)) == (25, 75)
    assert dolfinx.fem.Function(scalar).ufl_shape == ()
    assert dolfinx.fem.Function(triple).ufl_shape == (3,)


def test_mixed_element() -> None:
    mesh = unit_box(2, 2).mesh
    mixed = compat.mixed_element([compat.element(mesh, 2, (2,)), compat.element(mesh, 1)])
    function = dolfinx.fem.Function(compat.function_space(mesh, mixed))
    velocity, pressure = ufl.split(function)
    assert size_of(function.function_space) == 2 * 25 + 9
    assert (velocity.ufl_shape, pressure.ufl_shape) == ((2,), ())


def test_function_space_of_the_geometry() -> None:
    mesh = curved_box(2, 2, 2).mesh
    space = compat.function_space(mesh, compat.coordinate_element(mesh))
    assert size_of(space) == 2 * len(mesh.geometry.x)


@pytest.mark.parametrize("compiler", [None, {"scalar_type": "double"}])
def test_form(compiler: Any) -> None:
    """The integral of x over the unit square is one half."""
    mesh = unit_box(2, 2).mesh
    form = compat.form(ufl.SpatialCoordinate(mesh)[0] * ufl.dx, compiler)
    assert dolfinx.fem.assemble_scalar(form) == pytest.approx(0.5)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_gmsh_order(order: int) -> None:
    """Nodes of a triangle in the library's order: those of the reference cell, whichever the version."""
    mesh = build(COMM, partial(meshed, rectangle((0.0, 0.0), 1.0, 1.0, 1, 1), order=order)).mesh
    with session():
        kind = gmsh.model.mesh.getElementType("Triangle", order)
        _, _, _, nodes, local, _ = gmsh.model.mesh.getElementProperties(kind)
    assert np.reshape(local, (nodes, 2))[compat.gmsh_order(2, nodes)] == pytest.approx(
        shape_functions(mesh).points, abs=1e-12
    )


GHOSTS = """
from domains import unit_box
import dolfinx
from incipient import compat

mesh = unit_box(2, 4).mesh
ghosts = mesh.topology.index_map(2).num_ghosts
assert ghosts > 0, "inner facets between ranks need both their cells"

function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 1)))
function.x.array[:] = 1.0
function.x.scatter_reverse(compat.ADD)
owned = function.function_space.dofmap.index_map.size_local
# Unknowns on the interface are seen by both ranks.
assert set(function.x.array[:owned]) == {1.0, 2.0} or owned == len(function.x.array)
print("good")
"""


def test_partitioner_and_add(mpirun: Any) -> None:
    """Cells that share a facet with the other rank are there as ghosts; what these add is added to their owners."""
    compat.partitioner()
    done = mpirun(2, GHOSTS, timeout=60)
    assert done.stdout.count("good") == 2, done.stderr


def test_exterior_facets() -> None:
    mesh = unit_box(2, 3).mesh
    middles = dolfinx.mesh.compute_midpoints(mesh, 1, compat.exterior_facets(mesh))
    assert len(middles) == 12
    assert np.abs(middles[:, :2] - 0.5).max(axis=1) == pytest.approx(np.full(12, 0.5))


@pytest.mark.parametrize(("order", "per_cell"), [(1, 3), (2, 6), (3, 10)])
def test_geometry_dofs(order: int, per_cell: int) -> None:
    """The first three nodes of a cell are its corners: their areas make up the square's."""
    mesh = curved_box(2, 2, order).mesh
    links = compat.geometry_dofs(mesh)
    assert links.shape == (8, per_cell)
    a, b, c = np.moveaxis(mesh.geometry.x[links[:, :3], :2], 1, 0)
    areas = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))) / 2
    assert areas.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_cell_dofs(order: int) -> None:
    """In the space of the geometry itself, unknowns and nodes correspond through the cells."""
    mesh = curved_box(2, 2, order).mesh
    space = compat.function_space(mesh, compat.coordinate_element(mesh))
    nodes, unknowns = compat.geometry_dofs(mesh), compat.cell_dofs(space)
    assert nodes.shape == unknowns.shape
    place = dolfinx.fem.Function(space)
    place.interpolate(lambda x: x[:2])
    assert place.x.array.reshape(-1, 2)[unknowns] == pytest.approx(
        mesh.geometry.x[nodes][..., :2], abs=1e-12
    )


@pytest.mark.parametrize("order", [1, 2, 3])
def test_coordinate_element(order: int) -> None:
    degree = compat.coordinate_element(curved_box(2, 2, order).mesh).degree
    assert (degree() if callable(degree) else degree) == order


def test_interpolation_points() -> None:
    """An expression interpolated at them gives back a polynomial of the space."""
    mesh = unit_box(2, 2).mesh
    space = compat.space(mesh, ("Lagrange", 2))
    points = compat.interpolation_points(space)
    assert points.shape == (6, 2)
    function, x = dolfinx.fem.Function(space), ufl.SpatialCoordinate(mesh)
    function.interpolate(dolfinx.fem.Expression(x[0] * x[1], points))
    places = space.tabulate_dof_coordinates()
    assert function.x.array == pytest.approx(places[:, 0] * places[:, 1], abs=1e-14)


def test_nodes_on() -> None:
    """On a mesh of which nothing has been asked yet: the lower side of the square has five nodes of order two."""
    domain = unit_box(2, 2)
    scalar = compat.space(domain.mesh, ("Lagrange", 2))
    nodes = compat.nodes_on(scalar, domain.facets_of("bottom"))
    places = scalar.tabulate_dof_coordinates()
    assert sorted(nodes) == list(np.flatnonzero(places[:, 1] < 1e-12))
    mixed = compat.mixed_element([compat.element(domain.mesh, 2), compat.element(domain.mesh, 1)])
    first = compat.function_space(domain.mesh, mixed).sub(0)
    pairs = compat.nodes_on((first, scalar), domain.facets_of("bottom"))
    assert sorted(pairs[1]) == sorted(nodes)


def test_set_zero() -> None:
    """Whatever values the conditions prescribe, and nowhere else."""
    domain = unit_box(2, 2)
    space = compat.space(domain.mesh, ("Lagrange", 1))
    nodes = compat.nodes_on(space, domain.facets_of("bottom"))
    function = dolfinx.fem.Function(space)
    view = compat.vec_view(function)
    view.set(3.0)
    compat.set_zero(
        view, [dolfinx.fem.dirichletbc(dolfinx.fem.Constant(domain.mesh, 7.0), nodes, space)]
    )
    expected = np.full(9, 3.0)
    expected[nodes] = 0.0
    assert np.array_equal(function.x.array, expected)
    view.destroy()


def test_impose() -> None:
    domain = unit_box(2, 2)
    space = compat.space(domain.mesh, ("Lagrange", 1))
    nodes = compat.nodes_on(space, domain.facets_of("bottom"))
    values = np.full(9, 3.0)
    compat.impose(
        values, [dolfinx.fem.dirichletbc(dolfinx.fem.Constant(domain.mesh, 7.0), nodes, space)]
    )
    assert np.array_equal(np.flatnonzero(values == 7.0), np.sort(nodes))


def test_vec_view() -> None:
    """What is written to the vector is in the function, and the other way round."""
    function = dolfinx.fem.Function(compat.space(unit_box(2, 2).mesh, ("Lagrange", 1), (2,)))
    view = compat.vec_view(function)
    view.set(3.0)
    assert np.all(function.x.array == 3.0)
    function.x.array[:] = 5.0
    assert np.all(view.array_r == 5.0)
    assert view.getBlockSize() == 2
    view.destroy()
    assert np.all(function.x.array == 5.0)


@pytest.mark.parametrize("gdim", [2, 3])
def test_cell_size(gdim: int) -> None:
    """The longest edge of half a square, or of a sixth of a cube, is its diagonal."""
    mesh = unit_box(gdim, 2).mesh
    cells = np.arange(4, dtype=np.int32)
    assert compat.cell_size(mesh, cells) == pytest.approx(np.full(4, 0.5 * np.sqrt(gdim)))


@pytest.mark.parametrize("order", [1, 3])
def test_tabulate(order: int) -> None:
    """Shape functions times the values at a cell's nodes are the function there; one component's for a vector."""
    mesh = square_in_box(0.3, 0.3).mesh
    function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", order), (2,)))
    function.x.array[:] = np.random.default_rng(1).random(len(function.x.array))
    nodes = function.x.array.reshape(-1, 2)[compat.cell_dofs(function.function_space)[7]]
    values = compat.tabulate(function.function_space, np.array([[1 / 3, 1 / 3]])) @ nodes
    middle = mesh.geometry.x[compat.geometry_dofs(mesh)[7]].mean(axis=0)
    assert values[0] == pytest.approx(
        function.eval(middle[None], np.array([7], dtype=np.int32)), abs=1e-12
    )


def test_versions() -> None:
    versions = compat.versions()
    assert versions["dolfinx"] == dolfinx.__version__
    assert set(versions) >= {"incipient", "dolfinx", "ufl", "petsc", "python", "numpy"}
    assert all(version[0].isdigit() for version in versions.values())


@pytest.mark.parametrize("degree", [2, 3])
def test_a_mesh_made_of_another_ones_cells_is_that_mesh(degree: int) -> None:
    """Its nodes lie in the cells where the functions of its coordinate element have theirs."""
    first = curved_box(2, 2, degree).mesh
    cells, nodes = first.geometry.input_global_indices, first.geometry.x
    order = np.argsort(cells)
    again = compat.create_mesh(
        COMM,
        np.asarray(cells)[compat.geometry_dofs(first)].astype(np.int64),
        nodes[order, :2].copy(),
        degree,
    )
    space = compat.function_space(again, compat.scalar_part(compat.coordinate_element(again)))
    dofs, rows = compat.cell_dofs(space), compat.geometry_dofs(again)
    places = space.tabulate_dof_coordinates()
    assert np.abs(places[dofs] - again.geometry.x[rows]).max() < 1e-14


LOGGING = """
import logging, sys
logging.basicConfig(level=logging.INFO, stream=sys.stdout)
from mpi4py import MPI  # first: of PyPI's packages it finds the library
import dolfinx, ufl
from incipient import compat
mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
u = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 1)))
compat.interpolate(dolfinx.fem.Function(u.function_space), 2.0 * u)
compat.form(u**2 * ufl.dx(metadata={"quadrature_degree": 30}))
logging.getLogger().info("mine")
logging.getLogger("ffcx").warning("also mine")
logging.getLogger().setLevel(logging.WARNING)
compat.form(u**3 * ufl.dx)
assert logging.getLogger().level == logging.WARNING
"""


def test_a_program_that_logs_hears_nothing_of_builds(
    mpirun: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    """A quadrature of degree 30 has 256 points, of which the form compiler warns; nothing is in the cache yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    done = mpirun(1, LOGGING)
    assert done.returncode == 0, done.stderr
    assert (done.stdout.splitlines(), done.stderr) == (
        ["INFO:root:mine", "WARNING:ffcx:also mine"],
        "",
    )
