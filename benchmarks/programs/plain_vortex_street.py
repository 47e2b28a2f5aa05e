"""DFG 2D-2 in plain dolfinx by splitting: the components of the velocity one by one, the pressure, a projection.

Incremental pressure correction with Crank and Nicolson's rule and a convecting velocity extrapolated by Adams and
Bashforth, on Taylor-Hood elements: one matrix serves both components, and a Krylov method solves it in few iterations.

Run: python plain_vortex_street.py CELL_AT_CYLINDER CELL_FAR STEP END SINCE; prints one line of JSON with times,
drag and lift from SINCE on.
"""

import json
import sys

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from petsc4py import PETSc
from plain_channel import CYLINDER, HEIGHT, INFLOW, OUTFLOW, RADIUS, VISCOSITY, WALL, make_mesh

MEAN = 1.0
SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


def assembled(form, conditions=()):
    matrix = petsc.assemble_matrix(fem.form(form), list(conditions))
    matrix.assemble()
    return matrix


def solver(matrix, kind, preconditioner):
    """A Krylov method that starts from what its vector holds, or a factorisation."""
    method = PETSc.KSP().create(matrix.comm)
    method.setOperators(matrix)
    method.setType(kind)
    method.getPC().setType(preconditioner)
    if kind == "preonly":
        method.getPC().setFactorSolverType("mumps")
    else:
        method.setTolerances(rtol=1e-8)
        method.setInitialGuessNonzero(True)
    return method


class Splitting:
    """Matrices, fields and solvers of the scheme."""

    def __init__(self, mesh, facets, step: float):
        self.step = step
        self.space, self.pressures = (fem.FunctionSpace(mesh, ("CG", order)) for order in (2, 1))
        self._conditions(facets)
        u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        p, q = ufl.TrialFunction(self.pressures), ufl.TestFunction(self.pressures)
        self.now, self.before, self.tentative = (
            [fem.Function(self.space) for _ in "xy"] for _ in range(3)
        )
        for i in range(2):
            self.now[i].x.array[self.held] = self.held_values[i]
            self.before[i].x.array[:] = self.now[i].x.array
        self.pressure, self.rise = fem.Function(self.pressures), fem.Function(self.pressures)
        convecting = ufl.as_vector(
            [1.5 * a - 0.5 * b for a, b in zip(self.now, self.before, strict=True)]
        )
        self.convection = fem.form(ufl.inner(ufl.dot(convecting, ufl.grad(u)), v) * ufl.dx)
        self.mass = assembled(u * v * ufl.dx)
        self.stiffness = assembled(VISCOSITY * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
        self.gradients = [assembled(p.dx(i) * v * ufl.dx) for i in range(2)]
        self.divergences = [assembled(u.dx(i) * q * ufl.dx) for i in range(2)]
        self.push = [
            assembled(p * v.dx(i) * ufl.dx) for i in range(2)
        ]  # of the pressure, at the cylinder
        laplacian = assembled(ufl.inner(ufl.grad(p), ufl.grad(q)) * ufl.dx, self.outflow)
        self.transport, self.system = petsc.create_matrix(self.convection), self.mass.duplicate()
        self.rows = self.mass.duplicate()
        self.for_velocity = solver(self.rows, "bcgs", "jacobi")
        self.for_pressure = solver(laplacian, "preonly", "lu")
        self.for_mass = solver(self.mass, "cg", "jacobi")

    def _conditions(self, facets) -> None:
        def dofs(space, *groups):
            found = [fem.locate_dofs_topological(space, 1, facets.find(group)) for group in groups]
            return np.unique(np.concatenate(found)).astype(np.int32)

        inflow = fem.Function(self.space)
        inflow.interpolate(lambda x: 6 * MEAN * x[1] * (HEIGHT - x[1]) / HEIGHT**2)
        self.held = dofs(self.space, INFLOW, WALL, CYLINDER)
        at_inflow = np.isin(self.held, dofs(self.space, INFLOW))
        self.held_values = [
            np.where(at_inflow, inflow.x.array[self.held], 0.0),
            np.zeros(len(self.held)),
        ]
        self.body, self.open = dofs(self.space, CYLINDER), dofs(self.pressures, OUTFLOW)
        self.outflow = [fem.dirichletbc(fem.Function(self.pressures), self.open)]

    def advance(self) -> None:
        """One step."""
        self._assemble()
        known = [self._known(i) for i in range(2)]
        source = self.rise.vector.duplicate()
        for i in range(2):
            right = known[i].copy()
            right.axpy(-1.0, self.gradients[i] * self.pressure.vector)
            right.array[self.held] = self.held_values[i]
            self.tentative[i].x.array[:] = self.now[i].x.array
            self.for_velocity.solve(right, self.tentative[i].vector)
            source.axpy(-1 / self.step, self.divergences[i] * self.tentative[i].vector)
        source.array[self.open] = 0.0
        self.for_pressure.solve(source, self.rise.vector)
        self.pressure.vector.axpy(1.0, self.rise.vector)
        for i in range(2):
            right = self.mass * self.tentative[i].vector
            right.axpy(-self.step, self.gradients[i] * self.rise.vector)
            self.before[i].x.array[:] = self.now[i].x.array
            self.now[i].x.array[:] = self.tentative[i].x.array
            self.for_mass.solve(right, self.now[i].vector)
            self.now[i].x.array[self.held] = self.held_values[i]
        self.known = known

    def forces(self) -> list[float]:
        """Minus the residual of the momentum equation at the cylinder, with the last step's terms."""
        found = []
        for i in range(2):
            residual = self.system * self.now[i].vector
            residual.axpy(-1.0, self.known[i])
            residual.axpy(-1.0, self.push[i] * self.pressure.vector)
            found.append(-residual.array[self.body].sum())
        return found

    def _assemble(self) -> None:
        """System = M/dt + (C + K)/2, and the same with conditions."""
        self.transport.zeroEntries()
        petsc.assemble_matrix(self.transport, self.convection)
        self.transport.assemble()
        self.transport.axpy(1.0, self.stiffness, SAME)
        self.mass.copy(self.system, SAME)
        self.system.scale(1 / self.step)
        self.system.axpy(0.5, self.transport, SAME)
        self.system.copy(self.rows, SAME)
        self.rows.zeroRows(self.held, 1.0)
        self.for_velocity.setOperators(self.rows)

    def _known(self, i: int):
        """(M/dt - (C + K)/2) u of the step before."""
        known = self.mass * self.now[i].vector
        known.scale(1 / self.step)
        known.axpy(-0.5, self.transport * self.now[i].vector)
        return known


def main(near: float, far: float, step: float, end: float, since: float) -> None:
    splitting = Splitting(*make_mesh(near, far, 2), step)
    unit, steps = 0.5 * MEAN**2 * 2 * RADIUS, round(end / step)
    found: dict[str, list[float]] = {"time": [], "drag": [], "lift": []}
    for n in range(1, steps + 1):
        splitting.advance()
        if n % 100 == 0:
            PETSc.garbage_cleanup(splitting.mass.comm)  # vectors that PETSc else keeps to the end
        if n * step > since:
            forces = [force / unit for force in splitting.forces()]
            for key, value in zip(found, (n * step, *forces), strict=True):
                found[key].append(value)
    unknowns = (
        2 * splitting.space.dofmap.index_map.size_global
        + splitting.pressures.dofmap.index_map.size_global
    )
    print(json.dumps({**found, "unknowns": unknowns, "steps": steps}))


main(*map(float, sys.argv[1:6]))
