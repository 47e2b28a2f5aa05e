"""Driven cavity in plain dolfinx: Taylor-Hood on a graded grid, Newton's method, Re = 100, 400, 1000 in turn.

Run: python plain_cavity.py ORDER CELLS_PER_SIDE; prints one line of JSON.
"""

import json
import sys

import numpy as np
import ufl
from dolfinx import fem, geometry
from dolfinx.mesh import DiagonalType, create_unit_square, exterior_facet_indices
from mpi4py import MPI
from petsc4py import PETSc
from plain_newton import newton

STAGES = (100.0, 400.0, 1000.0)


def make_mesh(cells: int):
    mesh = create_unit_square(MPI.COMM_WORLD, cells, cells, diagonal=DiagonalType.crossed)
    x = mesh.geometry.x
    x[:, :2] = 0.5 * (1 - np.cos(np.pi * x[:, :2]))
    return mesh


def boundary_conditions(mesh, mixed, velocity):
    mesh.topology.create_connectivity(1, 2)
    facets = exterior_facet_indices(mesh.topology)
    values = fem.Function(velocity)
    # The lid's corners belong to the walls.
    values.interpolate(
        lambda x: np.vstack([(x[1] > 1 - 1e-9) & (abs(x[0] - 0.5) < 0.5 - 1e-9), 0 * x[0]])
    )
    walls = fem.locate_dofs_topological((mixed.sub(0), velocity), 1, facets)
    pressure, _ = mixed.sub(1).collapse()
    corner = fem.locate_dofs_geometrical((mixed.sub(1), pressure), lambda x: x[0] + x[1] < 1e-9)
    return [
        fem.dirichletbc(values, walls, mixed.sub(0)),
        fem.dirichletbc(fem.Function(pressure), corner, mixed.sub(1)),
    ]


def extrema(mesh, u) -> dict[str, float]:
    """Extreme values on the centrelines among 4001 points."""
    s = np.linspace(0, 1, 4001)
    upright, level = np.c_[0 * s + 0.5, s, 0 * s], np.c_[s, 0 * s + 0.5, 0 * s]
    across, along = sample(mesh, u, upright)[:, 0], sample(mesh, u, level)[:, 1]
    return {
        "minimum of v1": across.min(),
        "maximum of v2": along.max(),
        "minimum of v2": along.min(),
    }


def sample(mesh, u, points):
    tree = geometry.BoundingBoxTree(mesh, 2)
    colliding = geometry.compute_colliding_cells(
        mesh, geometry.compute_collisions(tree, points), points
    )
    return u.eval(points, [colliding.links(i)[0] for i in range(len(points))])


def main(order: int, cells: int) -> None:
    mesh = make_mesh(cells)
    vector, scalar = (
        ufl.VectorElement("CG", "triangle", order),
        ufl.FiniteElement("CG", "triangle", order - 1),
    )
    mixed = fem.FunctionSpace(mesh, ufl.MixedElement(vector, scalar))
    velocity = fem.FunctionSpace(mesh, vector)
    conditions = boundary_conditions(mesh, mixed, velocity)

    state = fem.Function(mixed)
    (u, p), (v, q) = ufl.split(state), ufl.TestFunctions(mixed)
    nu = fem.Constant(mesh, PETSc.ScalarType(1.0))
    form = (
        nu * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx + ufl.inner(ufl.grad(u) * u, v) * ufl.dx
    )
    form -= ufl.inner(p, ufl.div(v)) * ufl.dx + ufl.inner(ufl.div(u), q) * ufl.dx
    iterations = 0
    for reynolds in STAGES:
        nu.value = 1 / reynolds
        iterations += newton(form, state, conditions, tolerance=1e-9)[1]

    sizes = {
        "unknowns": mixed.dofmap.index_map.size_global,
        "cells": mesh.topology.index_map(2).size_global,
    }
    print(json.dumps({**extrema(mesh, state.sub(0).collapse()), "iterations": iterations, **sizes}))


main(int(sys.argv[1]), int(sys.argv[2]))
