"""DFG 2D-1 in plain dolfinx: Taylor-Hood, Newton's method with a new LU each time, forces by the residual.

Run: python plain_cylinder.py ORDER CELL_ORDER CELL_AT_CYLINDER CELL_FAR; prints one line of JSON.
"""

import json
import sys

import gmsh
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.io import gmshio
from mpi4py import MPI
from petsc4py import PETSc
from plain_newton import newton

LENGTH, HEIGHT, RADIUS, VISCOSITY, MEAN = 2.2, 0.41, 0.05, 1e-3, 0.2
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
    settings = {"IField": 1, "LcMin": near, "LcMax": far, "DistMin": 0.5 * RADIUS, "DistMax": HEIGHT}
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


def inflow_profile(x):
    return np.vstack([6 * MEAN * x[1] * (HEIGHT - x[1]) / HEIGHT**2, 0 * x[1]])


def main(order: int, cell_order: int, near: float, far: float) -> None:
    mesh, facets = make_mesh(near, far, cell_order)
    vector, scalar = (
        ufl.VectorElement("CG", "triangle", order),
        ufl.FiniteElement("CG", "triangle", order - 1),
    )
    mixed = fem.FunctionSpace(mesh, ufl.MixedElement(vector, scalar))
    velocity = fem.FunctionSpace(mesh, vector)

    def condition(value, group):
        dofs = fem.locate_dofs_topological((mixed.sub(0), velocity), 1, facets.find(group))
        return fem.dirichletbc(value, dofs, mixed.sub(0))

    still, inflow = fem.Function(velocity), fem.Function(velocity)
    inflow.interpolate(inflow_profile)
    conditions = [condition(inflow, INFLOW), condition(still, WALL), condition(still, CYLINDER)]

    state = fem.Function(mixed)
    (u, p), (v, q) = ufl.split(state), ufl.TestFunctions(mixed)
    nu = fem.Constant(mesh, PETSc.ScalarType(VISCOSITY))
    form = nu * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx + ufl.inner(ufl.grad(u) * u, v) * ufl.dx
    form -= ufl.inner(p, ufl.div(v)) * ufl.dx + ufl.inner(ufl.div(u), q) * ufl.dx
    residual, iterations = newton(form, state, conditions, tolerance=1e-10)

    unit = 0.5 * MEAN**2 * 2 * RADIUS
    forces = []
    for axis in (0, 1):
        component, _ = mixed.sub(0).sub(axis).collapse()
        dofs = fem.locate_dofs_topological((mixed.sub(0).sub(axis), component), 1, facets.find(CYLINDER))
        forces.append(-residual.array[dofs[0]].sum() / unit)
    sizes = {"unknowns": mixed.dofmap.index_map.size_global, "cells": mesh.topology.index_map(2).size_global}
    print(json.dumps({"drag": forces[0], "lift": forces[1], "iterations": iterations, **sizes}))


main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4]))
