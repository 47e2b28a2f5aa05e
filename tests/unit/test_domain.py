"""Meshed domains: named boundaries, and errors that every rank hears of."""

from __future__ import annotations

from functools import partial
from typing import Any

import dolfinx
import numpy as np
import pytest
from domains import spoilt, square_in_box, square_without_a_name, unit_box
from mpi4py import MPI

from incipient import compat
from incipient.errors import MeshError
from incipient.mesh.domain import build


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
    # What failed leaves nothing behind in gmsh.
    assert set(unit_box(2, 2).names) == {"left", "right", "bottom", "top"}


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
