"""The steady flow and its turbulence as one system of equations, and its iterative solution."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats
from ..compat import petsc
from ..fluid import Fluid
from ..fluid.solvers.options import defaults, lu
from ..fluid.space import cell_size
from ..installed import return_freed_memory
from ..parallel import Owner
from .fields import TurbulenceFields

# In a step a logarithm changes by less, and a velocity by less than this part of the largest speed: at a few nodes
# Newton's method overshoots.
MOST_CHANGE = 1.0, 0.3
# Smallest k after a step over that before, where its equation is linear in k itself.
LEAST_LEFT = 0.05
LEAST_RELAXATION = 0.25  # two corrections that alternate need a half
TINY = 1e-300
TOGETHER = "turbulent_"
MOST_TOGETHER = 150
# Iterations up to which factors of the flow serve on; with older ones residuals tell little.
PATIENCE = 10
# Block low-rank factors (ICNTL(35)) and what they leave out of blocks (CNTL(7)): Amestoy, Buttari, L'Excellent & Mary
# (2019), ACM Trans. Math. Software 45, 2. With 78,000 unknowns past a sphere in its pocket they take 9.8 s instead of
# 31.7, an iteration more or less; with 0.05 they take 7.7 s and 24 iterations instead of 5.
LOW_RANK = {"mat_mumps_icntl_35": 2, "mat_mumps_cntl_7": 0.01}


class CoupledFlow(Owner):
    """Flow and turbulence as one system of equations. Every method is collective.

    Holds PETSc objects: use it as a context manager, or call `destroy`.

    Attributes:
        courant: Courant numbers (local cells,).
    """

    def __init__(self, fluid: Fluid, turbulence: TurbulenceFields):
        super().__init__(fluid.domain.comm)
        self._fluid, self._turbulence = fluid, turbulence
        self._courant = dolfinx.fem.Function(
            compat.space(fluid.domain.mesh, ("Discontinuous Lagrange", 0))
        )
        self.courant = self._courant.x.array
        self.courant[:] = 1.0
        flow = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
        forms = [turbulence.watching(flow, ufl.split(fluid.state)[0]), turbulence.form]
        states = fluid.state, turbulence.state
        self._residuals = [compat.form(form) for form in forms]
        self._conditions = fluid.constraints.dirichlet, turbulence.conditions
        self._derivatives = [
            [compat.form(self._derivative(form, own, state)) for state in states]
            for form, own in zip(forms, states, strict=True)
        ]
        self._vectors = [self.holding(petsc.assemble_vector(form)) for form in self._residuals]
        self._rows = self.holding(self._vectors[1].duplicate())
        self._blocks = [
            [self.holding(petsc.create_matrix(form)) for form in row] for row in self._derivatives
        ]
        self._solver: Any = None  # `BlockByBlock`, made with the first blocks
        self._last: tuple[Floats, ...] | None = None  # corrections of the last step
        self.relaxation = 1.0

    def _derivative(self, form: Any, own: Any, state: Any) -> Any:
        """Derivative of a residual in UFL, with the pseudo-time rate if the state is its `own`."""
        change = ufl.TrialFunction(state.function_space)
        jacobian = ufl.derivative(form, state, change)
        # With the degree of the residual, 7, of order 2 as many steps take 1.2 times as long in 2-D and 1.4 times in
        # 3-D. With 5 the convection of order 3 is too inexact: velocities grew eightfold in each iteration.
        coarser = {"quadrature_degree": 2 * self._fluid.space.order + 3 - self._fluid.domain.gdim}
        jacobian = ufl.Form(
            [
                integral.reconstruct(metadata=integral.metadata() | coarser)
                if integral.integral_type() == "cell"
                else integral  # with fewer points velocities on curved walls alternated for ever
                for integral in jacobian.integrals()
            ]
        )
        if state is not own:
            return jacobian
        test, rate = (
            ufl.TestFunction(state.function_space),
            self._passing() / self._courant,
        )
        degree = {"quadrature_degree": 2 * self._fluid.space.order}
        measure = ufl.dx(domain=self._fluid.domain.mesh, metadata=degree)
        if own is self._fluid.state:
            return jacobian + rate * ufl.inner(ufl.split(change)[0], ufl.split(test)[0]) * measure
        return jacobian + rate * ufl.inner(change, test) * measure

    def _passing(self) -> Any:
        """One over the time in which the flow passes a cell, diffuses through it, or is sheared, in UFL."""
        velocity, _ = ufl.split(
            dolfinx.fem.Function(self._fluid.state.function_space, self._fluid.state.x)
        )
        size, slope = cell_size(self._fluid.domain.mesh), ufl.grad(velocity)
        passing = ufl.sqrt(ufl.inner(velocity, velocity)) / size
        passing += self._turbulence.of_molecules / size**2
        return passing + ufl.sqrt(ufl.inner(slope, slope))

    def _assemble_blocks(self) -> None:
        conditions = [*self._conditions[0], *self._conditions[1]]
        for forms, matrices in zip(self._derivatives, self._blocks, strict=True):
            for form, matrix in zip(forms, matrices, strict=True):
                compat.matrix_of(form, conditions, matrix)

    def correction(self, fresh: bool, rough: float) -> tuple[Floats, Floats]:
        """Changes (owned unknowns,) of flow and logarithms in a step, to a relative residual `rough`.

        `fresh`: with a new Jacobian, as the first one must be. Raises ConvergenceError.
        """
        self._turbulence.hold()
        for vector, form, conditions in zip(
            self._vectors, self._residuals, self._conditions, strict=True
        ):
            compat.vector_of(form, vector)
            compat.set_zero(vector, conditions)
        rows = self._turbulence.row_factors()
        if fresh:
            self._rows.setArray(rows)
        self._vectors[1].pointwiseMult(self._vectors[1], self._rows)
        if fresh:
            self._renew()
        self._vectors[1].scale(self._balance)
        self._right.setArray(np.concatenate([vector.array_r for vector in self._vectors]))
        self._solver.approximate(self._right, self._correction, rough)
        number = self._vectors[0].getLocalSize()
        changes = -self._correction.array_r
        # Where the equation is that of k, an older Jacobian gives its change over the k of then.
        return changes[:number], changes[number:] * rows / self._rows.array_r

    def changes_of_cells(
        self, of_flow: Floats, of_logarithms: Floats, units: tuple[float, float]
    ) -> Floats:
        """Largest change (local cells,) at a node of each cell, of a logarithm or a velocity over the largest speed.

        Both in `units`; arguments are changes (owned unknowns,). Those of logarithms are weighted with the eddies'
        fraction of the viscosity: in a viscous sublayer ln k falls by ten without any effect on the flow.
        """
        fluid, changes = self._fluid, list[Floats]()
        states = fluid.state, self._turbulence.state
        seen = np.repeat(self._turbulence.weights(), 2) * of_logarithms
        for state, values in zip(states, (of_flow, seen), strict=True):
            change = dolfinx.fem.Function(state.function_space)
            change.x.array[: len(values)] = values
            change.x.scatter_forward()
            changes.append(change.x.array)
        velocities = np.linalg.norm(changes[0][fluid.space.unknowns_at_nodes], axis=1)
        logarithms = np.abs(changes[1]).reshape(-1, 2).max(axis=1)
        of_spaces = (
            (fluid.space.velocity, velocities / (units[1] * _fastest(fluid))),
            (self._turbulence.space, logarithms / units[0]),
        )
        return np.maximum(
            *(values[compat.cell_dofs(space)].max(axis=1) for space, values in of_spaces)
        )

    def relaxed(self, of_flow: Floats, of_logarithms: Floats) -> tuple[Floats, Floats]:
        """Corrections (owned unknowns,), less of them where they turn back those of the last step.

        Otherwise those past a sphere on a bed at u* d/nu = 3200 alternated, and it converged in no 100 iterations
        instead of 62; past a stone at 1300 the flow took 58 instead of 40. By Aitken's relaxation (Irons & Tuck 1969,
        Int. J. Numer. Meth. Engng 1, 275), of flow or logarithms, whichever turn more.
        """
        corrections = of_flow, of_logarithms
        if self._last is not None:
            pairs = zip(corrections, self._last, strict=True)
            products = np.array([(new @ last, last @ last) for new, last in pairs])
            along, sizes = self._fluid.domain.comm.allreduce(products).T
            onwards = float(np.min(along / np.maximum(sizes, TINY)))
            aitken = self.relaxation / (1.0 - min(onwards, 0.5))
            self.relaxation = min(max(aitken, LEAST_RELAXATION), 1.0)
        self._last = corrections
        return self.relaxation * of_flow, self.relaxation * of_logarithms

    def largest_courant(self) -> float:
        mine = float(self.courant.max(initial=0.0))
        return float(self._fluid.domain.comm.allreduce(mine, op=MPI.MAX))

    def carry_out(self, of_flow: Floats, of_logarithms: Floats) -> None:
        states = self._fluid.state, self._turbulence.state
        for state, values in zip(states, (of_flow, of_logarithms), strict=True):
            state.x.array[: len(values)] += values
            state.x.scatter_forward()

    def _renew(self) -> None:
        """Take the blocks of the present state, balanced by its right-hand side."""
        self._assemble_blocks()
        for block in self._blocks[1]:
            block.diagonalScale(self._rows)
        if self._solver is None:
            nest = PETSc.Mat().createNest(self._blocks, comm=self._fluid.domain.comm)
            self._solver = self.holding(BlockByBlock(self.holding(nest)))
            self._right, self._correction = map(self.holding, nest.createVecs())
        self._balance = self._solver.balance(tuple(self._vectors))
        self._solver.prepare()


class BlockByBlock(Owner):
    """GMRES for A x = b, A a nest of four blocks of flow and turbulence, with its lower triangle.

    The flow's approximate factorisation, reused up to 10 iterations, is applied first, then that of the turbulence's
    whole block: with one per quantity GMRES fails in long steps of k and epsilon. PETSc options with the prefixes
    ``turbulent_``, ``turbulent_fieldsplit_flow_`` and ``turbulent_fieldsplit_fields_`` take precedence. Methods are
    collective.
    """

    def __init__(self, nest: Any):
        super().__init__()
        self.matrix, self._aged = nest, True
        self._options = {
            "ksp_type": "gmres",
            "ksp_pc_side": "right",
            "ksp_gmres_restart": MOST_TOGETHER,
            "pc_fieldsplit_type": "multiplicative",
            **lu("fieldsplit_flow_", LOW_RANK),
            **lu("fieldsplit_fields_", {}),
        }
        self._solver = self.holding(PETSc.KSP().create(nest.comm))
        self._solver.setOptionsPrefix(TOGETHER)
        self._solver.setOperators(nest)
        self._blocks = self._solver.getPC()
        self._blocks.setType("fieldsplit")
        rows = zip(("flow", "fields"), nest.getNestISs()[0], strict=True)
        self._blocks.setFieldSplitIS(*rows)
        self._solver.setTolerances(atol=1e-50, max_it=MOST_TOGETHER)
        with defaults(TOGETHER, self._options):
            self._solver.setFromOptions()

    def prepare(self) -> None:
        """Take the present blocks of the matrix; the flow's factorisation may be of an earlier one."""
        self.matrix.assemble()
        with defaults(TOGETHER, self._options):
            self._solver.setUp()
            if self._aged:
                self._renew()
            self._blocks.getFieldSplitSubKSP()[1].setUp()

    def _renew(self) -> None:
        flow = self._blocks.getFieldSplitSubKSP()[0]
        factors, matrices = flow.getPC(), flow.getOperators()
        factors.setReusePreconditioner(False)
        factors.reset()
        return_freed_memory()
        flow.setOperators(*matrices)
        flow.setUp()
        factors.setReusePreconditioner(True)

    def balance(self, right: tuple[Any, Any]) -> float:
        """Scale the turbulence's rows of A to a right-hand side as large as the flow's; returns the factor.

        Next to walls the logarithms' residuals are larger by orders of magnitude.
        """
        of_flow, of_fields = (vector.norm() for vector in right)
        known = 0.0 < of_flow < np.inf and 0.0 < of_fields < np.inf
        factor = float(of_flow / of_fields) if known else 1.0
        for column in (0, 1):
            self.matrix.getNestSubMatrix(1, column).scale(factor)
        return factor

    def approximate(self, b: Any, x: Any, rtol: float) -> None:
        """Solve A x = b to a residual of `rtol` times b; x is not finite if it fails."""
        solver = self._solver
        solver.setTolerances(rtol=rtol, max_it=MOST_TOGETHER if self._aged else PATIENCE)
        solver.solve(b, x)
        if solver.getConvergedReason() <= 0 and not self._aged:
            with defaults(TOGETHER, self._options):
                self._renew()
            solver.setTolerances(max_it=MOST_TOGETHER)
            solver.solve(b, x)
        self._aged = solver.getConvergedReason() <= 0
        if self._aged:
            x.set(np.inf)


def bounded(
    fluid: Fluid, turbulence: TurbulenceFields, of_flow: Floats, of_logarithms: Floats
) -> tuple[Floats, Floats]:
    """Newton updates (owned unknowns,) limited to the largest admissible change at a node. Collective.

    Where the equation of k is weighted, the update of ln k is the relative change of k in a linear equation. Taken as
    such, k of recirculation zones falls from that of the inflow in fewer steps.
    """
    most, nodes = MOST_CHANGE[1] * _fastest(fluid), fluid.space.unknowns_at_nodes
    own = nodes[nodes[:, -1] < len(of_flow)]
    sizes, limited = np.linalg.norm(of_flow[own], axis=1), of_flow.copy()
    limited[own] *= np.minimum(1.0, most / np.maximum(sizes, most))[:, None]
    logarithms = np.clip(of_logarithms, -MOST_CHANGE[0], MOST_CHANGE[0])
    if turbulence.weighted:
        of_k = np.maximum(of_logarithms[0::2], LEAST_LEFT - 1.0)
        logarithms[0::2] = np.minimum(np.log1p(of_k), MOST_CHANGE[0])
    return limited, logarithms


def _fastest(fluid: Fluid) -> float:
    velocities = fluid.state.x.array[fluid.space.unknowns_at_nodes]
    mine = float(np.linalg.norm(velocities, axis=1).max(initial=0.0))
    return float(fluid.domain.comm.allreduce(mine, op=MPI.MAX))
