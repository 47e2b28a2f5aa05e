"""The steady flow and its turbulence as one system of equations, and the bounds of its corrections."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from ... import compat
from ...arrays import Floats, Integers
from ...compat import petsc
from ...errors import IncipientError
from ...fluid import Fluid
from ...fluid.solvers.direct import Direct
from ...fluid.space import cell_size
from .fields import TurbulenceFields
from .linear import BlockByBlock

# By dimension: with that of the residual, 7, as many steps take 1.2 times as long in the plane and 1.4 times in space.
DEGREE_OF_DERIVATIVE = {2: 5, 3: 4}
LARGEST_CHANGE = 0.3  # of a velocity at a node, in a step, over the largest speed
# Past grains of a random bed at u* d/nu = 300 k and velocity at single nodes in clefts, and next to spheres that are
# three cells across, went to and fro, velocities by four times V, and took the flow with them. In the wake of a stone
# in the plane Newton's method asked for logarithms at single nodes changed by 400 while the flow changed by 1%. In the
# plane, and in a fast flow in space, cells at nodes that would change by more than this, a logarithm, or a velocity
# over the largest speed, therefore take shorter steps than others, in proportion, by this factor at most, which then
# shrinks from step to step. In space no node changes by more, after the first steps.
MOST_AT_NODES, MOST_SLOWED, RELAXED = (0.5, 0.05), 1000.0, 0.8


class CoupledFlow:
    """Flow and turbulence as one system of equations. Every method is collective.

    In pseudo-time each cell takes a step of its own, a Courant number times the time in which the flow passes it, by
    one correction of Newton's method, with a derivative by coarser quadrature than the residual. Holds PETSc objects:
    use it as a context manager, or call `destroy`.
    """

    def __init__(self, fluid: Fluid, turbulence: TurbulenceFields):
        self._fluid, self._turbulence = fluid, turbulence
        self._scale = 1.0
        self._held: list[Any] = []
        self._per_step = turbulence.constant(0.0)
        flow_from = (
            fluid.state.x.array[fluid.space.velocity_map] if fluid.domain.gdim == 2 else np.empty(0)
        )
        self._speed = turbulence.constant(turbulence.largest(flow_from))
        self._slowed = dolfinx.fem.Function(
            compat.space(fluid.domain.mesh, ("Discontinuous Lagrange", 0))
        )
        self._slowed.x.array[:] = 1.0
        forms = self._residual_forms()
        states = fluid.state, turbulence.state
        self._residuals = [compat.form(one) for one in forms]
        self._conditions = fluid.constraints.dirichlet, turbulence.conditions
        self._derivatives = [
            [compat.form(self._derivative(form, own, state)) for state in states]
            for form, own in zip(forms, states, strict=True)
        ]
        self._vectors = [self._holding(petsc.assemble_vector(one)) for one in self._residuals]
        self._blocks = [
            [self._holding(petsc.create_matrix(one)) for one in row] for row in self._derivatives
        ]
        self._assemble_blocks()
        self._nest = self._holding(PETSc.Mat().createNest(self._blocks, comm=fluid.domain.comm))
        self._nest.assemble()
        self._matrix = self._holding(PETSc.Mat())
        self._solver = self._holding(
            self._factors() if fluid.domain.gdim == 2 else BlockByBlock(fluid, self._nest)
        )
        self._right, self._correction = (
            self._holding(one) for one in self._solver.matrix.createVecs()
        )

    def _factors(self) -> Direct:
        """The solver by factors of both as one matrix."""
        self._nest.convert("aij", self._matrix)
        return Direct(self._matrix)

    def _residual_forms(self) -> list[Any]:
        """Both residuals in UFL, the eddy viscosity limited by the strain of the flow as it is."""
        fluid, turbulence = self._fluid, self._turbulence
        flow = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
        return [turbulence.watching(flow, ufl.split(fluid.state)[0]), turbulence.form]

    def _derivative(self, form: Any, own: Any, state: Any) -> Any:
        """The derivative of a residual in UFL, with the rate in pseudo-time in the state that is its `own`."""
        change = ufl.TrialFunction(state.function_space)
        found = ufl.derivative(form, state, change)
        coarser = {"quadrature_degree": DEGREE_OF_DERIVATIVE[self._fluid.domain.gdim]}
        found = ufl.Form(
            [one.reconstruct(metadata=one.metadata() | coarser) for one in found.integrals()]
        )
        if state is not own:
            return found
        test, rate = (
            ufl.TestFunction(state.function_space),
            self._per_step * self._slowed * self._passing(),
        )
        degree = {"quadrature_degree": 2 * self._fluid.space.order}
        measure = ufl.dx(domain=self._fluid.domain.mesh, metadata=degree)
        if own is self._fluid.state:
            return found + rate * ufl.inner(ufl.split(change)[0], ufl.split(test)[0]) * measure
        return found + rate * self._turbulence.inside * ufl.inner(change, test) * measure

    def _passing(self) -> Any:
        """One over the time in which the flow passes a cell, diffuses through it, or is sheared, in UFL.

        In space: where the strain is large what a change of the velocity carries would else outweigh the rate. In the
        plane all cells are passed as fast as the fastest flow at the start: else k dies out where the flow separates,
        before it has come there.
        """
        fluid = self._fluid
        velocity, _ = ufl.split(dolfinx.fem.Function(fluid.state.function_space, fluid.state.x))
        size = cell_size(fluid.domain.mesh)
        passing = ufl.sqrt(ufl.inner(velocity, velocity) + self._speed**2) / size
        passing += self._turbulence.of_molecules / size**2
        slope = ufl.grad(velocity)
        return passing + ufl.sqrt(ufl.inner(slope, slope)) if fluid.domain.gdim == 3 else passing

    def _assemble_blocks(self) -> None:
        conditions = [*self._conditions[0], *self._conditions[1]]
        for forms, matrices in zip(self._derivatives, self._blocks, strict=True):
            for form, matrix in zip(forms, matrices, strict=True):
                matrix.zeroEntries()
                petsc.assemble_matrix(matrix, form, conditions)
                matrix.assemble()

    def correction(self, courant: float, half_way: bool = False) -> tuple[Floats, Floats]:
        """The changes (owned unknowns,) of the flow and of the logarithms in a step with a Courant number.

        What upwinding knows of them follows the step before, or goes `half_way` there.

        Raises:
            ConvergenceError: the matrix has no factors.
        """
        self._per_step.value = 1.0 / courant
        self._turbulence.stop(half_way)
        return self._next_correction()

    def slow_down(self, of_flow: Floats, of_logarithms: Floats) -> None:
        """Let cells at nodes with large corrections (owned unknowns,) take shorter steps than the others."""
        fluid, slowed = self._fluid, self._slowed.x.array
        states, changes = (fluid.state, self._turbulence.state), list[Floats]()
        for state, values in zip(states, (of_flow, of_logarithms), strict=True):
            change = dolfinx.fem.Function(state.function_space)
            change.x.array[: len(values)] = values
            change.x.scatter_forward()
            changes.append(change.x.array)
        logarithms, most = (
            np.abs(changes[1]).reshape(-1, 2).max(axis=1),
            MOST_AT_NODES[1] * _fastest(fluid),
        )
        asked = (
            (
                fluid.space.velocity,
                np.linalg.norm(changes[0][fluid.space.unknowns_at_nodes], axis=1) / most,
            ),
            (self._turbulence.space, logarithms / MOST_AT_NODES[0]),
        )
        of_cells = [values[compat.cell_dofs(space)].max(axis=1) for space, values in asked]
        slowed[:] = np.clip(np.maximum(*of_cells), np.maximum(RELAXED * slowed, 1.0), MOST_SLOWED)

    def carry_out(self, of_flow: Floats, of_logarithms: Floats) -> None:
        """Add corrections (owned unknowns,) to both states."""
        for state, values in (
            (self._fluid.state, of_flow),
            (self._turbulence.state, of_logarithms),
        ):
            state.x.array[: len(values)] += values
            state.x.scatter_forward()

    @property
    def most_slowed(self) -> float:
        """The factor by which the step of a cell is shorter than asked for, at the most. Collective."""
        mine = float(self._slowed.x.array.max(initial=1.0))
        return float(self._fluid.domain.comm.allreduce(mine, op=MPI.MAX))

    def _next_correction(self) -> tuple[Floats, Floats]:
        self._turbulence.prepare()
        for vector, form, conditions in zip(
            self._vectors, self._residuals, self._conditions, strict=True
        ):
            with vector.localForm() as local:
                local.set(0.0)
            petsc.assemble_vector(vector, form)
            vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            compat.set_zero(vector, conditions)
        self._renew()
        self._vectors[1].scale(self._scale)
        self._right.setArray(np.concatenate([one.array_r for one in self._vectors]))
        self._solver.approximate(self._right, self._correction)
        number = self._vectors[0].getLocalSize()
        found = -self._correction.array_r
        return found[:number], found[number:]

    def _renew(self) -> None:
        """Make the derivative that of the present state, and factors of it."""
        self._assemble_blocks()
        if self._solver.matrix is self._matrix:
            self._nest.convert("aij", self._matrix)
        else:
            self._scale = self._solver.balance(tuple(self._vectors))
        self._solver.prepare()

    def _holding(self, made: Any) -> Any:
        self._held.append(made)
        return made

    def __enter__(self) -> CoupledFlow:
        return self

    def __exit__(self, kind: type[BaseException] | None, *exception: object) -> None:
        # Freeing is collective: after a defect of one rank it would wait for the others for ever.
        if kind is None or issubclass(kind, IncipientError) or self._fluid.domain.comm.size == 1:
            self.destroy()

    def destroy(self) -> None:
        """Free PETSc's memory."""
        while self._held:
            self._held.pop().destroy()


def largest_change(fluid: Fluid, of_flow: Floats) -> float:
    """The largest change of a velocity at a node, over the largest speed. Collective."""
    changed = _largest(fluid, of_flow[_owned_nodes(fluid, of_flow)])
    return changed / _fastest(fluid) if np.isfinite(changed) else np.inf


def bound(fluid: Fluid, of_flow: Floats, part: float = LARGEST_CHANGE) -> None:
    """Let no velocity change by more than a part of the largest speed: at a few nodes it may overshoot. Collective."""
    most, own = part * _fastest(fluid), _owned_nodes(fluid, of_flow)
    sizes = np.linalg.norm(of_flow[own], axis=1)
    of_flow[own] *= np.minimum(1.0, most / np.maximum(sizes, most))[:, None]


def _owned_nodes(fluid: Fluid, of_flow: Floats) -> Integers:
    """Unknowns (n, gdim) of the velocity at nodes that this rank owns."""
    nodes = fluid.space.unknowns_at_nodes
    return np.asarray(nodes[nodes[:, -1] < len(of_flow)])


def _fastest(fluid: Fluid) -> float:
    """The largest speed at a node. Collective."""
    return _largest(fluid, fluid.state.x.array[fluid.space.unknowns_at_nodes])


def _largest(fluid: Fluid, velocities: Floats) -> float:
    """The largest size of velocities (n, gdim) on all ranks, 0 if there are none. Collective."""
    mine = float(np.linalg.norm(velocities, axis=1).max(initial=0.0))
    return float(fluid.domain.comm.allreduce(mine, op=MPI.MAX))
