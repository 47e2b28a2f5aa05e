"""The channel with a cylinder of the DFG benchmarks, meshed by gmsh for plain dolfinx."""

import gmsh
import numpy as np
from dolfinx.io import gmshio
from mpi4py import MPI

LENGTH, HEIGHT, RADIUS, VISCOSITY = 2.2, 0.41, 0.05, 1e-3
FLUID, INFLOW, OUTFLOW, WALL, CYLINDER = 1, 2, 3, 4, 5


def draw(near: float, far: float, order: int) -> None:
    occ, model = gmsh.model.occ, gmsh.model
    channel = occ.addRectangle(0, 0, 0, LENGTH, HEIGHT)
    disc = occ.addDisk(0.2, 0.2, 0, RADIUS, RADIUS)
    occ.cut([(2, channel)], [(2, disc)])
    occ.synchronize()
    model.addPhysicalGroup(2, [tag for _, tag in model.getEntities(2)], FLUID)
    groups: dict[int, list[int]] = {}
    for dim, tag in model.getEntities(1):
        groups.setdefault(_group(occ.getCenterOfMass(dim, tag)), []).append(tag)
    for group, tags in groups.items():
        model.addPhysicalGroup(1, tags, group)
    _grade(groups[CYLINDER], near, far)
    model.mesh.generate(2)
    model.mesh.setOrder(order)


def _group(middle: tuple[float, float, float]) -> int:
    if np.isclose(middle[0], 0.0):
        return INFLOW
    if np.isclose(middle[0], LENGTH):
        return OUTFLOW
    return WALL if min(middle[1], HEIGHT - middle[1]) < 1e-6 else CYLINDER


def _grade(cylinder: list[int], near: float, far: float) -> None:
    field = gmsh.model.mesh.field
    field.add("Distance", 1)
    field.setNumbers(1, "EdgesList", cylinder)
    field.setNumber(1, "NumPointsPerCurve", 200)
    field.add("Threshold", 2)
    settings = {
        "IField": 1,
        "LcMin": near,
        "LcMax": far,
        "DistMin": 0.5 * RADIUS,
        "DistMax": HEIGHT,
    }
    for name, value in settings.items():
        field.setNumber(2, name, value)
    field.setAsBackgroundMesh(2)
    for name in ("FromPoints", "ExtendFromBoundary"):
        gmsh.option.setNumber(f"Mesh.CharacteristicLength{name}", 0)


def make_mesh(near: float, far: float, order: int):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    draw(near, far, order)
    mesh, _, facets = gmshio.model_to_mesh(gmsh.model, MPI.COMM_WORLD, 0, gdim=2)
    gmsh.finalize()
    return mesh, facets
