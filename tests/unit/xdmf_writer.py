"""Writes fields on however many ranks there are, for test_sampling.py: `xdmf_writer.py DIRECTORY`."""

import sys
from pathlib import Path

from mpi4py import MPI  # first: PyPI's dolfinx finds its MPI only then

# isort: split
import numpy as np
from dolfinx.fem import Function
from dolfinx.mesh import create_unit_cube
from floating import box_around

from incipient import compat
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc
from incipient.output.xdmf import FieldSeries

RADIUS = 0.4


def velocity(x):
    return np.array([x[0] * x[1], x[0] ** 2 - x[1]])


def pressure(x):
    return 1 + 2 * x[0] - x[1]


def holed_square(order):
    """Unit-centred square of side 2 with a round hole, and the hole's facets."""
    disc, centre = Disc(2 * RADIUS), Placement((0.0, 0.0))
    domain = box_around(disc, centre, 0.4 / 3, 0.4, (-1.0, -1.0), (1.0, 1.0), order)
    return domain.mesh, domain.facets_of("body")


def functions(mesh, degree=2):
    u = Function(compat.space(mesh, ("Lagrange", degree), (mesh.geometry.dim,)))
    u.interpolate(lambda x: np.vstack([velocity(x), x[2:3] * x[0:1]])[: mesh.geometry.dim])
    p = Function(compat.space(mesh, ("Lagrange", degree - 1)))
    p.interpolate(pressure)
    return {"velocity": u, "pressure": p}


def write_still(directory: Path) -> None:
    """The plane with a hole, its rim in cubic cells, a cube and its skin."""
    comm = MPI.COMM_WORLD
    mesh, _ = holed_square(2)
    FieldSeries(directory / "plane", mesh, comm).write(0.0, functions(mesh))
    mesh, hole = holed_square(3)
    FieldSeries(directory / "rim", mesh, comm, facets=hole).write(0.0, functions(mesh))
    cube = create_unit_cube(comm, 2, 2, 2)
    FieldSeries(directory / "cube", cube, comm).write(0.0, functions(cube))
    skin = FieldSeries(directory / "skin", cube, comm, facets=compat.exterior_facets(cube))
    skin.write(0.0, functions(cube))


if __name__ == "__main__":
    write_still(Path(sys.argv[1]))
