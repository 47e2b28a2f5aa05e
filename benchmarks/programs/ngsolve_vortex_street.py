"""DFG 2D-2 in NGSolve: viscosity and pressure implicit, convection explicit, one factorisation for all steps.

Run: python ngsolve_vortex_street.py ORDER CELL_AT_CYLINDER CELL_FAR STEP END SINCE; prints one line of JSON
with the history of drag and lift from SINCE on.
"""

import json
import sys

import ngsolve as ng
from ngsolve_channel import DIAMETER, HEIGHT, VISCOSITY, make_mesh
from ngsolve_solver import INVERSE

MEAN = 1.0


def main(order: int, near: float, far: float, step: float, end: float, since: float) -> None:
    mesh = make_mesh(near, far, order)
    velocity = ng.VectorH1(mesh, order=order, dirichlet="wall|inflow|cylinder")
    space = velocity * ng.H1(mesh, order=order - 1)
    (u, p), (v, q) = space.TnT()
    stokes = (
        VISCOSITY * ng.InnerProduct(ng.Grad(u), ng.Grad(v)) - ng.div(u) * q - ng.div(v) * p
    ) * ng.dx
    viscous = ng.BilinearForm(stokes).Assemble()
    implicit = ng.BilinearForm(u * v * ng.dx + step * stokes).Assemble()
    mass = ng.BilinearForm(u * v * ng.dx).Assemble()
    convection = ng.BilinearForm(space, nonassemble=True)
    convection += (ng.Grad(u) * u) * v * ng.dx

    flow = ng.GridFunction(space)
    profile = 6 * MEAN * ng.y * (HEIGHT - ng.y) / HEIGHT**2
    flow.components[0].Set(
        ng.CoefficientFunction((profile, 0)), definedon=mesh.Boundaries("inflow")
    )
    residual, change = flow.vec.CreateVector(), flow.vec.CreateVector()
    residual.data = viscous.mat * flow.vec
    free = space.FreeDofs()
    flow.vec.data -= viscous.mat.Inverse(free, inverse=INVERSE) * residual
    factors = implicit.mat.Inverse(free, inverse=INVERSE)

    tests = []
    for direction in ((1.0, 0.0), (0.0, 1.0)):
        test = ng.GridFunction(space)
        test.components[0].Set(
            ng.CoefficientFunction(direction), definedon=mesh.Boundaries("cylinder")
        )
        tests.append(test)
    unit = 0.5 * MEAN**2 * DIAMETER
    history: dict[str, list[float]] = {"time": [], "drag": [], "lift": []}
    for i in range(1, round(end / step) + 1):
        convection.Apply(flow.vec, residual)
        residual.data += viscous.mat * flow.vec
        change.data = factors * residual
        flow.vec.data -= step * change
        if i * step > since:
            # What is left of the momentum equation at the cylinder, with the step's own terms.
            residual.data -= mass.mat * change
            residual.data -= step * (viscous.mat * change)
            forces = [-ng.InnerProduct(residual, test.vec) / unit for test in tests]
            for key, value in zip(history, (i * step, *forces), strict=True):
                history[key].append(value)
    sizes = {"unknowns": space.ndof, "cells": mesh.ne, "steps": round(end / step)}
    print(json.dumps({"history": history, **sizes}))


main(int(sys.argv[1]), *map(float, sys.argv[2:7]))
