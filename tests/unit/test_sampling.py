"""Values of fields at points and extrema along lines."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import pytest
from domains import unit_box

from incipient import compat
from incipient.mesh.sampling import cells_between, extremum, sample


def field(gdim: int, shape: tuple[int, ...], values: Any) -> Any:
    """A field of order two on the unit box."""
    function = dolfinx.fem.Function(compat.space(unit_box(gdim, 4).mesh, ("Lagrange", 2), shape))
    function.interpolate(values)
    return function


def test_scalar_values() -> None:
    """A quadratic field is met exactly."""
    function = field(2, (), lambda x: x[0] ** 2 + x[1])
    points = np.array([[0.1, 0.2], [0.77, 0.31], [1.0, 1.0]])
    assert sample(function, points) == pytest.approx(
        (points[:, 0] ** 2 + points[:, 1])[:, None], abs=1e-13
    )


def test_vector_values_in_three_dimensions() -> None:
    function = field(3, (3,), lambda x: np.vstack([x[0], x[1] * x[2], 1 + 0 * x[0]]))
    assert sample(function, np.array([[0.3, 0.5, 0.4]])) == pytest.approx(
        np.array([[0.3, 0.2, 1.0]]), abs=1e-13
    )


def test_outside_is_not_a_number() -> None:
    function = field(2, (), lambda x: x[0])
    values = sample(function, np.array([[0.5, 0.5], [1.5, 0.5], [0.5, -1e-3]]))[:, 0]
    assert np.isnan(values).tolist() == [False, True, True]


def test_points_on_the_boundary_and_on_edges_are_inside() -> None:
    function = field(2, (), lambda x: x[0])
    points = np.array([[0.0, 0.0], [0.25, 0.5], [0.5, 1.0], [1.0, 0.3]])
    assert sample(function, points)[:, 0] == pytest.approx(points[:, 0], abs=1e-13)


def test_no_points() -> None:
    assert sample(field(2, (2,), lambda x: x[:2]), np.empty((0, 2))).shape == (0, 2)


def along(y: float) -> Any:
    return lambda s: np.column_stack([s, np.full_like(s, y)])


@pytest.mark.parametrize(("sign", "value", "position"), [(1, 1.09, 0.3), (-1, 0.6, 1.0)])
def test_extremum_of_a_parabola(sign: int, value: float, position: float) -> None:
    """1 + 0.6 s - s^2 on (0, 1): the largest value 1.09 at s = 0.3, the smallest 0.6 at the end."""
    function = field(2, (2,), lambda x: np.vstack([x[1], 1 + 0.6 * x[0] - x[0] ** 2]))
    found = extremum(function, 1, along(0.6), (0.0, 1.0), sign)
    assert found.value == pytest.approx(value, abs=1e-12)
    assert found.position == pytest.approx(position, abs=1e-6)


def test_extremum_on_a_line_partly_outside() -> None:
    """Places outside the mesh do not count."""
    function = field(2, (2,), lambda x: np.vstack([x[0], x[1]]))
    found = extremum(function, 0, along(0.5), (-1.0, 1.5), 1)
    assert found.value == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(("y", "count"), [(0.1, 8), (0.3, 8)])
def test_cells_along_a_row(y: float, count: int) -> None:
    """A line along a row of the 4 by 4 grid crosses two triangles in each of its four squares."""
    assert cells_between(unit_box(2, 4).mesh, (0.0, y), (1.0, y)) == count


def test_cells_of_a_short_line() -> None:
    assert cells_between(unit_box(2, 4).mesh, (0.1, 0.02), (0.12, 0.021)) == 1


RANKS = """
import sys
import numpy as np
from mpi4py import MPI
import dolfinx
from domains import unit_box
from incipient import compat
from incipient.mesh.sampling import cells_between, sample

mesh = unit_box(2, 4).mesh
function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 2), (2,)))
function.interpolate(lambda x: np.vstack([x[0], x[1] ** 2]))
points = np.array([[0.1, 0.1], [0.9, 0.9], [0.5, 0.5], [2.0, 2.0]])
values = sample(function, points)
assert np.allclose(values[:3], np.column_stack([points[:3, 0], points[:3, 1] ** 2]), atol=1e-12)
assert np.isnan(values[3]).all()
assert cells_between(mesh, (0.0, 0.1), (1.0, 0.1)) == 8
assert cells_between(mesh, (0.1, 0.0), (0.1, 1.0)) == 8
if MPI.COMM_WORLD.allreduce(1) == 2 and MPI.COMM_WORLD.rank == 0:
    print("good")
"""


def test_all_ranks_get_all_values(mpirun: Any) -> None:
    done = mpirun(2, RANKS)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "good\n"
