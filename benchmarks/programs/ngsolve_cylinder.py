"""DFG 2D-1 in NGSolve: Taylor-Hood on curved cells, Newton's method with static condensation.

Run: python ngsolve_cylinder.py ORDER CELL_AT_CYLINDER CELL_FAR; prints one line of JSON.
"""

import json
import sys

import ngsolve as ng
from ngsolve.solvers import Newton
from ngsolve_channel import DIAMETER, HEIGHT, VISCOSITY, make_mesh
from ngsolve_solver import INVERSE

MEAN = 0.2


def make_form(space: ng.FESpace) -> ng.BilinearForm:
    (u, p), (v, q) = space.TnT()
    form = ng.BilinearForm(space, condense=True)
    form += (VISCOSITY * ng.InnerProduct(ng.Grad(u), ng.Grad(v)) + (ng.Grad(u) * u) * v) * ng.dx
    form += (-ng.div(u) * q - ng.div(v) * p) * ng.dx
    return form


def force(form: ng.BilinearForm, flow: ng.GridFunction, direction: tuple[float, float]) -> float:
    """Minus the residual of the momentum equation in a direction, on the cylinder."""
    residual, test = flow.vec.CreateVector(), ng.GridFunction(flow.space)
    form.Apply(flow.vec, residual)
    boundary = flow.space.components[0].mesh.Boundaries("cylinder")
    test.components[0].Set(ng.CoefficientFunction(direction), definedon=boundary)
    return -ng.InnerProduct(residual, test.vec)


def main(order: int, near: float, far: float) -> None:
    mesh = make_mesh(near, far, order)
    velocity = ng.VectorH1(mesh, order=order, dirichlet="wall|inflow|cylinder")
    space = velocity * ng.H1(mesh, order=order - 1)
    flow = ng.GridFunction(space)
    profile = 6 * MEAN * ng.y * (HEIGHT - ng.y) / HEIGHT**2
    flow.components[0].Set(
        ng.CoefficientFunction((profile, 0)), definedon=mesh.Boundaries("inflow")
    )
    form = make_form(space)
    Newton(form, flow, inverse=INVERSE, maxerr=1e-10, printing=False)
    unit = 0.5 * MEAN**2 * DIAMETER
    drag, lift = (force(form, flow, e) / unit for e in ((1.0, 0.0), (0.0, 1.0)))
    print(json.dumps({"drag": drag, "lift": lift, "unknowns": space.ndof, "cells": mesh.ne}))


main(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
