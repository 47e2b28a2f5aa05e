"""One test for each function of the layer between dolfinx's versions."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import dolfinx
import gmsh
import numpy as np
import pytest
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


def _mixed(mesh: Any) -> Any:
    parts = [compat.element(mesh, 2, (2,)), compat.element(mesh, 1)]
    return compat.function_space(mesh, compat.mixed_element(parts))


# Of the unit square in 2 by 2 squares cut in two: 9 vertices, 16 edges, 8 cells.
SPACES: list[tuple[Any, int, Any]] = [
    *(
        (lambda mesh, d=degree: compat.space(mesh, ("Lagrange", d)), size, ())
        for degree, size in {1: 9, 2: 9 + 16, 3: 9 + 2 * 16 + 8}.items()
    ),
    (lambda mesh: compat.space(mesh, ("Lagrange", 2), (2,)), 2 * 25, (2,)),
    (lambda mesh: compat.space(mesh, ("DG", 0)), 8, ()),
    (lambda mesh: compat.function_space(mesh, compat.element(mesh, 2)), 25, ()),
    (lambda mesh: compat.function_space(mesh, compat.element(mesh, 2, (3,))), 75, (3,)),
    (_mixed, 2 * 25 + 9, (3,)),
    (lambda mesh: compat.function_space(mesh, compat.coordinate_element(mesh)), 18, (2,)),
]


@pytest.mark.parametrize(("made", "size", "shape"), SPACES)
def test_spaces_and_elements(made: Any, size: int, shape: tuple[int, ...]) -> None:
    space = made(unit_box(2, 2).mesh)
    assert size_of(space) == size and dolfinx.fem.Function(space).ufl_shape == shape


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


@pytest.mark.parametrize(("order", "per_cell"), [(1, 3), (2, 6), (3, 10)])
def test_geometry_dofs(order: int, per_cell: int) -> None:
    """The first three nodes of a cell are its corners: their areas make up the square's."""
    mesh = curved_box(2, 2, order).mesh
    links = compat.geometry_dofs(mesh)
    assert links.shape == (8, per_cell)
    a, b, c = np.moveaxis(mesh.geometry.x[links[:, :3], :2], 1, 0)
    areas = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))) / 2
    assert areas.sum() == pytest.approx(1.0)


def test_vectors_and_conditions() -> None:
    """What is written to a vector is in the function; conditions are set, to zero or their values, nowhere else."""
    domain = unit_box(2, 2)
    space = compat.space(domain.mesh, ("Lagrange", 1))
    nodes = np.sort(compat.nodes_on(space, domain.facets_of("bottom")))
    function = dolfinx.fem.Function(space)
    seven = dolfinx.fem.Constant(domain.mesh, 7.0)
    conditions = [dolfinx.fem.dirichletbc(seven, nodes, space)]
    view = compat.vec_view(function)
    view.set(3.0)
    compat.set_zero(view, conditions)
    assert np.array_equal(np.flatnonzero(function.x.array == 0.0), nodes)
    compat.impose(function.x.array, conditions)
    view.destroy()
    assert np.array_equal(np.flatnonzero(function.x.array == 7.0), nodes)
    assert set(function.x.array) == {3.0, 7.0}


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
