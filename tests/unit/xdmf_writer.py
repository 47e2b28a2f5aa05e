"""Writes series of fields on however many ranks there are, for test_sampling.py: `xdmf_writer.py DIRECTORY TASK`."""

import json
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
from incipient.geometry.plane.grains import Disc, Ellipse
from incipient.mesh.motion import MeshMotion, RigidDisplacement
from incipient.output.xdmf import FieldSeries

RADIUS = 0.4
SEMI_AXES = (0.2, 0.1)  # of the ellipse that moves in the box (0, 2) x (0, 1)
CELLS = (0.3, 0.22, 0.18, 0.26)  # their sizes, before and after each remeshing
STEPS_A_MESH = 2


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


def placement(number):
    """Where the ellipse is at a step."""
    return Placement((0.5 + 0.08 * number, 0.5 + 0.01 * number), 0.15 * number)


def counts(mesh):
    """Cells and quadratic nodes on all ranks."""
    mesh.topology.create_entities(1)
    vertices, edges, cells = (
        mesh.topology.index_map(dimension).size_global for dimension in range(3)
    )
    return {"cells": cells, "nodes": vertices + edges}


def write_moving(directory: Path) -> None:
    """A mesh that follows the ellipse and is made anew three times; what was written is told in steps.json."""
    comm, told, fields = MPI.COMM_WORLD, [], None
    for made, cell in enumerate(CELLS):
        first = STEPS_A_MESH * made
        domain = box_around(Ellipse(SEMI_AXES), placement(first), cell / 3, cell, high=(2.0, 1.0))
        motion = MeshMotion(domain)
        displacement = RigidDisplacement(domain, "body", placement(first), turning=True)
        if fields is None:
            fields = FieldSeries(directory / "fields", domain.mesh, comm)
        else:
            fields.remeshed(domain.mesh)
        for number in range(first, first + STEPS_A_MESH):
            motion.move(displacement.at(placement(number)))
            fields.write(0.25 * number, functions(domain.mesh, degree=4))
            told.append({"time": 0.25 * number, **counts(domain.mesh)})
    if comm.rank == 0:
        (directory / "steps.json").write_text(json.dumps(told))


if __name__ == "__main__":
    _, directory, task = sys.argv
    place = Path(directory) / task
    place.mkdir(exist_ok=True)  # by each rank
    globals()[task](place)
