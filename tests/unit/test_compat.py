"""The layer between dolfinx's versions, as far as flows do not show it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import dolfinx
import gmsh
import numpy as np
import pytest
from domains import curved_box, rectangle, unit_box
from mpi4py import MPI

from incipient import compat
from incipient.mesh.cells import shape_functions
from incipient.mesh.domain import build
from incipient.meshes.model import meshed
from incipient.meshes.session import session

COMM = MPI.COMM_WORLD


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
