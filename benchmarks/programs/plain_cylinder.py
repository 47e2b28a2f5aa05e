"""DFG 2D-1 in plain dolfinx: Taylor-Hood, Newton's method with a new LU each time, forces by the residual.

Run: python plain_cylinder.py ORDER CELL_ORDER CELL_AT_CYLINDER CELL_FAR; prints one line of JSON.
"""

import json
import sys

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from plain_channel import CYLINDER, HEIGHT, INFLOW, RADIUS, VISCOSITY, WALL, make_mesh
from plain_newton import newton

MEAN = 0.2


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
    form = (
        nu * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx + ufl.inner(ufl.grad(u) * u, v) * ufl.dx
    )
    form -= ufl.inner(p, ufl.div(v)) * ufl.dx + ufl.inner(ufl.div(u), q) * ufl.dx
    residual, iterations = newton(form, state, conditions, tolerance=1e-10)

    unit = 0.5 * MEAN**2 * 2 * RADIUS
    forces = []
    for axis in (0, 1):
        component, _ = mixed.sub(0).sub(axis).collapse()
        dofs = fem.locate_dofs_topological(
            (mixed.sub(0).sub(axis), component), 1, facets.find(CYLINDER)
        )
        forces.append(-residual.array[dofs[0]].sum() / unit)
    sizes = {
        "unknowns": mixed.dofmap.index_map.size_global,
        "cells": mesh.topology.index_map(2).size_global,
    }
    print(json.dumps({"drag": forces[0], "lift": forces[1], "iterations": iterations, **sizes}))


main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4]))
