"""Driven cavity in NGSolve: Taylor-Hood on a graded grid, Newton's method with static condensation.

Run: python ngsolve_cavity.py ORDER CELLS_PER_SIDE; prints one line of JSON.
"""

import json
import sys
from math import cos, pi

import ngsolve as ng
import numpy as np
from ngsolve.meshes import MakeStructured2DMesh
from ngsolve.solvers import Newton
from ngsolve_solver import INVERSE

STAGES = (100.0, 400.0, 1000.0)


def graded(x: float, y: float) -> tuple[float, float]:
    return 0.5 * (1 - cos(pi * x)), 0.5 * (1 - cos(pi * y))


def make_form(space: ng.FESpace, viscosity: ng.Parameter) -> ng.BilinearForm:
    (u, p), (v, q) = space.TnT()
    form = ng.BilinearForm(space, condense=True)
    form += (viscosity * ng.InnerProduct(ng.Grad(u), ng.Grad(v)) + (ng.Grad(u) * u) * v) * ng.dx
    # The tiny pressure mass fixes the level of the pressure, which a closed box leaves open.
    form += (-ng.div(u) * q - ng.div(v) * p - 1e-10 * p * q) * ng.dx
    return form


def set_lid(velocity: ng.GridFunction, mesh: ng.Mesh) -> None:
    velocity.Set(ng.CoefficientFunction((1, 0)), definedon=mesh.Boundaries("top"))
    # The lid's corners belong to the walls.
    for dof, on_wall in enumerate(velocity.space.GetDofs(mesh.Boundaries("left|right"))):
        if on_wall:
            velocity.vec[dof] = 0.0


def extrema(mesh: ng.Mesh, velocity: ng.GridFunction) -> dict[str, float]:
    """Extreme values on the centrelines among 4001 points."""
    s = np.linspace(0, 1, 4001)
    across = np.ravel(velocity[0](mesh(0 * s + 0.5, s)))
    along = np.ravel(velocity[1](mesh(s, 0 * s + 0.5)))
    return {
        "minimum of v1": across.min(),
        "maximum of v2": along.max(),
        "minimum of v2": along.min(),
    }


def main(order: int, cells: int) -> None:
    mesh = MakeStructured2DMesh(quads=False, nx=cells, ny=cells, mapping=graded)
    velocity = ng.VectorH1(mesh, order=order, dirichlet=".*")
    space = velocity * ng.H1(mesh, order=order - 1)
    flow, viscosity = ng.GridFunction(space), ng.Parameter(1.0)
    set_lid(flow.components[0], mesh)
    form = make_form(space, viscosity)
    iterations = 0
    for reynolds in STAGES:
        viscosity.Set(1 / reynolds)
        _, steps = Newton(form, flow, inverse=INVERSE, maxerr=1e-9, maxit=30, printing=False)
        iterations += steps
    sizes = {"unknowns": space.ndof, "cells": mesh.ne}
    print(json.dumps({**extrema(mesh, flow.components[0]), "iterations": iterations, **sizes}))


main(int(sys.argv[1]), int(sys.argv[2]))
